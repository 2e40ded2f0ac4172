"""The surface of a pancake that bends, for the renderer and for the browser: its two faces and its rim as meshes.

Both get positions in the world at every instant; neither needs deformable geometry of Drake or of Meshcat.  The upper
face is pale and the others have the block's colour, as the halves of the block have.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import GeometryInstance, InMemoryMesh, Mesh, Meshcat, PerceptionProperties, RenderLabel, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from flipdiagram.arrays import Floats, Indices
from flipdiagram.plants.pancake import COLOUR
from flipdiagram.rendering.scene import TOP_COLOUR, Scene
from flipdiagram.simulation.pancake_surface import Surface

COLOURS = {"upper": TOP_COLOUR, "lower": COLOUR, "rim": COLOUR}
LEVELS = 2**16 - 1
"""Steps of a position in a page between the smallest and the largest: of 15 µm where the pancake moves by a metre."""


def show_surface(scene: Scene, context: Context, surface: Surface, vertices: Floats) -> None:
    """Put the surface with vertices (V, 3) [m] into a scene's context, for the renderer alone, in place of the last."""
    graph, source = scene.scene_graph, scene.plant.get_source_id()
    mine = graph.GetMyMutableContextFromRoot(context)
    inspector = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context)).inspector()
    world = graph.world_frame_id()
    shown = {inspector.GetName(geometry): geometry for geometry in inspector.GetGeometries(world)}
    for name, colour in COLOURS.items():
        if name in shown:
            graph.RemoveGeometry(mine, source, shown[name])
        text = _obj(vertices, getattr(surface, name)).encode()
        mesh = Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", name)))
        instance = GeometryInstance(RigidTransform(), mesh, name)
        properties = PerceptionProperties()
        properties.AddProperty("phong", "diffuse", Rgba(*colour))
        properties.AddProperty("label", "id", RenderLabel.kDontCare)
        instance.set_perception_properties(properties)
        graph.RegisterGeometry(mine, source, world, instance)


def _obj(vertices: Floats, triangles: Indices) -> str:
    """A mesh of smooth shading in Wavefront's format."""
    normals = vertex_normals(vertices, triangles)
    lines = [f"{key} {x:.7g} {y:.7g} {z:.7g}" for key, rows in (("v", vertices), ("vn", normals)) for x, y, z in rows]
    return "\n".join([*lines, *(f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in triangles + 1), ""])


def vertex_normals(vertices: Floats, triangles: Indices) -> Floats:
    """Unit normals (V, 3), of the triangles around each vertex by their area; up where there is none."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(vertices)
    for corner in triangles.T:
        np.add.at(normals, corner, np.cross(b - a, c - a))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


def add_surface(meshcat: Meshcat, root: str, surface: Surface) -> None:
    """Meshes `root`/pancake/upper, lower and rim as in the first frame; each has all vertices: one array moves them."""
    vertices = np.asfortranarray(surface.vertices[0].T)
    for name, colour in COLOURS.items():
        triangles = np.asfortranarray(getattr(surface, name).T.astype(np.int32))
        meshcat.SetTriangleMesh(f"{root}/pancake/{name}", vertices, triangles, Rgba(*colour))


def pack(vertices: Floats) -> dict[str, Any]:
    """Vertices (frames, V, 3) [m] as JSON: position = low + step × number, a number of 16 bits.

    The numbers are in base64, little-endian, frame by frame and in it vertex by vertex.
    """
    low = vertices.min(axis=(0, 1))
    step = float(np.ptp(vertices, axis=(0, 1)).max()) / LEVELS
    numbers = np.rint((vertices - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step, "numbers": base64.b64encode(numbers.tobytes()).decode()}
