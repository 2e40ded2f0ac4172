"""A pancake in Drake: a deformable body of linear tetrahedra, and the shape in which it rests on the blade.

What Drake asks for: the `sap` contact approximation, a discrete plant, a tetrahedral mesh as a .vtk file.
"""

import hashlib
import io
import json
from contextlib import suppress

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    InMemoryMesh,
    MakePhongIllustrationProperties,
    Mesh,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.fem import DeformableBodyConfig, MaterialModel
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import DeformableBodyId, Frame, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError, first_line
from flipdiagram.files import atomic_path, cache_folder, versions
from flipdiagram.robot.assembly import add_tool
from flipdiagram.robot.own_things import tool_text
from flipdiagram.robot.pancake_mesh import PancakeMesh, pancake_mesh
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.scenario import Scenario

SOFTER = 10.0
"""Drake's `sap_near_rigid_threshold` while the pancake comes to rest on the blade, which with Drake's 1 it never quite
does, trembling by a tenth of a millimetre a second.  The flip has Drake's 1: with softer contact edges sink in.
"""
CARRIER, MODULUS = 0.006, 1e7
"""Thickness [m] and hydroelastic modulus [Pa] of the slab that stands for the blade where a pancake touches it; of the
modulus the contact of deformable bodies takes nothing."""
SETTLING = 40.0
"""Damping [1/s] of the speed of every point while the pancake comes to rest on the blade; at rest it does nothing."""
AT_REST = 2e-4
"""Speed [m/s] of the fastest vertex, of its mean over one `LOOK`, below which it rests: a stiff one trembles on."""
LOOK, LONGEST = 0.02, 4.0
"""Simulated time [s] between two looks whether it rests, and after which it never will."""
COLOUR = np.array([0.87, 0.36, 0.22, 1.0])
"""As in block.sdf."""


def add_pancake(
    plant: MultibodyPlant, scenario: Scenario, X_WP: RigidTransform, settling: float = 0.0
) -> DeformableBodyId:
    """Add a pancake, undeformed, its centre at X_WP, to a discrete plant that is not finalized.

    settling: a damping [1/s] of all speeds, by which it comes to rest sooner.

    Raises InputError where the mesh is too coarse for so soft a material, see `mesh_modulus`.
    """
    pancake, mesh = scenario.object, pancake_mesh(scenario.object)
    config = DeformableBodyConfig()
    config.set_material_model(MaterialModel.kLinearCorotated)
    config.set_youngs_modulus(mesh_modulus(pancake))
    config.set_poissons_ratio(pancake.poissons_ratio)
    config.set_mass_density(pancake.mass * scenario.disturbance.object_mass_scale / mesh.volumes.sum())
    config.set_stiffness_damping_coefficient(pancake.damping)
    config.set_mass_damping_coefficient(settling)
    shape = Mesh(InMemoryMesh(mesh_file=MemoryFile(_vtk(mesh), ".vtk", "pancake")))
    geometry = GeometryInstance(X_WP, shape, "pancake")
    geometry.set_proximity_properties(_rough(scenario))
    geometry.set_illustration_properties(MakePhongIllustrationProperties(COLOUR))
    resolution = pancake.thickness  # of shapes that are no mesh
    return plant.mutable_deformable_model().RegisterDeformableBody(geometry, config, resolution)


def add_carrier(plant: MultibodyPlant, blade: RigidBody, tool: Frame, scenario: Scenario) -> GeometryId:
    """Add what a pancake touches of the blade, to a plant that is not finalized: its face, on a slab of `CARRIER`.

    Drake pushes what penetrates to the nearest side, and the blade's underside is 2 mm from its face: when a stiff
    pancake landed on it again, forces left the friction cone tenfold, and the verdict was another than that of the
    rigid block and of MuJoCo.  A slab of 20 mm strikes the object with its side after the release.
    """
    length, width, _ = scenario.tool.blade_size
    touch = _rough(scenario)
    AddCompliantHydroelasticProperties(CARRIER, MODULUS, touch)
    X_BS = tool.GetFixedPoseInBodyFrame() @ RigidTransform([0.0, 0.0, -CARRIER / 2])
    return plant.RegisterCollisionGeometry(blade, X_BS, Box(length, width, CARRIER), "carrier", touch)


def _rough(scenario: Scenario) -> ProximityProperties:
    """The friction of pancake and blade, which combine to the same."""
    touch, mu = ProximityProperties(), scenario.object.friction
    AddContactMaterial(friction=CoulombFriction(mu, mu), properties=touch)
    return touch


def let_carry(
    scene_graph: SceneGraph, plant: MultibodyPlant, pancake: DeformableBodyId, carrier: GeometryId, blade: RigidBody
) -> None:
    """Let the pancake touch the carrier in the place of the blade, and nothing else touch that."""
    inspector, filters = scene_graph.model_inspector(), scene_graph.collision_filter_manager()
    thing = plant.deformable_model().GetGeometryId(pancake)
    others = {*inspector.GetAllGeometryIds(Role.kProximity)} - {thing, carrier}
    thin = [shape for shape in plant.GetCollisionGeometriesForBody(blade) if shape != carrier]
    for one, two in ((carrier, [*others]), (thing, thin)):
        filters.Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet(one), GeometrySet(two)))


def rest_shape(scenario: Scenario, X_TB: RigidTransform) -> Floats:
    """The vertices (V, 3) [m] in the tool's frame, at rest on a level blade, X_TB being where it was laid, undeformed.

    Computed once and kept in the cache folder, by a hash of all that it depends on.

    Raises SimulationError where it does not come to rest there.
    """
    asked = {
        "object": scenario.object.model_dump(),
        "tool": scenario.tool.model_dump(),
        "mass": scenario.disturbance.object_mass_scale,
        "step": scenario.simulation.step,
        "at": [round(float(x), 9) for x in X_TB.translation()],
        "settled": [SOFTER, SETTLING, AT_REST, CARRIER, versions()["drake"]],
    }
    name = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:32]
    path = cache_folder() / "pancakes" / f"{name}.npy"
    with suppress(OSError, ValueError, EOFError):
        kept = np.load(path, allow_pickle=False)
        if kept.shape == (scenario.object.vertices, 3):
            return np.asarray(kept)
    found = _come_to_rest(scenario, X_TB)
    buffer = io.BytesIO()
    np.save(buffer, found)
    with suppress(OSError, InputError):  # a folder that cannot be written costs time only
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary:
            temporary.write_bytes(buffer.getvalue())
    return found


def _come_to_rest(scenario: Scenario, X_TB: RigidTransform) -> Floats:
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=scenario.simulation.step,
        discrete_contact_approximation="sap",
        sap_near_rigid_threshold=SOFTER,
        use_sampled_output_ports=False,
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    body, tool = add_tool(plant, tool_text(scenario))
    plant.WeldFrames(plant.world_frame(), tool)
    carrier = add_carrier(plant, body, tool, scenario)
    pancake = add_pancake(plant, scenario, RigidTransform(X_TB.translation()), SETTLING)
    plant.Finalize()
    let_carry(scene_graph, plant, pancake, carrier, body)
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_context())
    model = plant.deformable_model()
    before = np.array(model.GetPositions(context, pancake))
    try:
        for look in range(1, round(LONGEST / LOOK) + 1):
            simulator.AdvanceTo(look * LOOK)
            vertices = np.array(model.GetPositions(context, pancake))
            if np.abs(vertices - before).max() < AT_REST * LOOK:
                return vertices.T.copy()
            before = vertices
    except RuntimeError as error:
        raise SimulationError(f"the pancake does not come to rest on the blade: {first_line(error)}") from None
    raise SimulationError(
        f"the pancake does not come to rest on the blade within {LONGEST:g} s; valid is a stiffer one"
    )


def _vtk(mesh: PancakeMesh) -> str:
    """The mesh as the text of a legacy VTK file, the only form in which Drake reads tetrahedra."""
    points, cells = len(mesh.vertices), len(mesh.tetrahedra)
    return "\n".join(
        [
            "# vtk DataFile Version 3.0",
            "pancake",
            "ASCII",
            "DATASET UNSTRUCTURED_GRID",
            f"POINTS {points} double",
            *(" ".join(map(repr, map(float, point))) for point in mesh.vertices),
            f"CELLS {cells} {5 * cells}",
            *(" ".join(map(str, [4, *corners])) for corners in mesh.tetrahedra.tolist()),
            f"CELL_TYPES {cells}",
            *["10"] * cells,  # tetrahedron
            "",
        ]
    )
