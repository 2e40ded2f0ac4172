"""What a recording keeps of a pancake: where its vertices were, what bending stored, what touched, what hung over."""

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.robot.pancake_mesh import PancakeMesh, pancake_mesh
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.cell import Object
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.recording import Recording, rotations

STRIDE = 4
"""Samples between two frames of the vertices."""
SURFACES = ["blade", "table"]


def with_deformation(data: Recording, vertices: Floats, contact_area: Floats, scenario: Scenario) -> Recording:
    """The recording with what was measured of the pancake.

    Args:
        data: the recording.
        vertices: (3 V, time) [m], vertex by vertex.
        contact_area: (2, time) [m²], with blade and table.
        scenario: what was simulated.
    """
    mesh = pancake_mesh(scenario.object)
    frames = np.ascontiguousarray(vertices[:, ::STRIDE].T.reshape(-1, len(mesh.vertices), 3))
    data = with_frames(data, frames, mesh)
    energy = deformation_energy(frames, mesh, scenario.object)
    return data.assign(
        contact_area=(("time", "surface"), contact_area.T.copy(), {"units": "m2"}),
        deformation_energy=("frame", energy, {"units": "J"}),
        overhang=("frame", overhang(data, frames, contact_area[0], scenario), {"units": "1"}),
    ).assign_coords(surface=SURFACES)


def with_frames(data: Recording, frames: Floats, mesh: PancakeMesh) -> Recording:
    """The recording with other vertices (frame, V, 3) [m], a frame each `STRIDE` samples, and the mesh they are of."""
    return data.assign(
        vertices=(("frame", "vertex", "direction"), frames.astype(np.float32), {"units": "m"}),
        tetrahedra=(("tetrahedron", "corner"), mesh.tetrahedra.astype(np.int32)),
        upper_face=(("triangle", "node"), mesh.upper.astype(np.int32)),
        lower_face=(("triangle", "node"), mesh.lower.astype(np.int32)),
    ).assign_coords(frame_time=("frame", data["time"].values[::STRIDE], {"units": "s"}))


def bends(data: xr.Dataset) -> bool:
    """Whether a recording is of a pancake."""
    return "vertices" in data


def deformation_energy(frames: Floats, mesh: PancakeMesh, material: Object) -> Floats:
    """Elastic energy (frame,) [J] of the corotated linear law: Σ V (μ |F − R|² + λ/2 tr(RᵀF − I)²) over the tetrahedra.

    F is the deformation gradient, R its rotation, μ and λ Lamé's constants of ν and the modulus that the mesh has.
    """
    E, nu = mesh_modulus(material), material.poissons_ratio
    mu, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    inverse = np.linalg.inv(_edges(mesh.vertices, mesh))
    energy = np.empty(len(frames))
    for k, frame in enumerate(frames):  # all frames at once would need some hundred megabytes
        F = _edges(frame, mesh) @ inverse
        U, stretch, Vt = np.linalg.svd(F)
        mirrored = np.linalg.det(U @ Vt) < 0  # an element turned inside out
        stretch[mirrored, 2] *= -1
        density = mu * np.sum((stretch - 1) ** 2, axis=1) + lame / 2 * (stretch.sum(axis=1) - 3) ** 2
        energy[k] = mesh.volumes @ density
    return energy


def overhang(data: Recording, frames: Floats, area_on_blade: Floats, scenario: Scenario) -> Floats:
    """Share of the lower face's area that is beyond the blade's edges (frame,); nan where nothing touches the blade."""
    tool = data["tool_pose"].values[::STRIDE]
    half = np.array(scenario.tool.blade_size[:2]) / 2
    lower = pancake_mesh(scenario.object).lower
    share = np.full(len(frames), np.nan)
    for k in np.flatnonzero(area_on_blade[::STRIDE] > 0):
        local = rotations(tool[k : k + 1]).apply(frames[k] - tool[k, 4:], inverse=True)
        beyond = (np.abs(local[lower].mean(axis=1)[:, :2]) > half).any(axis=1)
        area = np.linalg.norm(doubled_normals(local, lower), axis=1)
        share[k] = area[beyond].sum() / area.sum()
    return share


def doubled_normals(vertices: Floats, triangles: np.ndarray) -> Floats:
    """Normals (..., F, 3) of triangles, of twice their area [m²]."""
    a, b, c = (vertices[..., triangles[:, k], :] for k in range(3))
    return np.cross(b - a, c - a)


def _edges(vertices: Floats, mesh: PancakeMesh) -> Floats:
    corners = vertices[mesh.tetrahedra]
    return np.asarray(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
