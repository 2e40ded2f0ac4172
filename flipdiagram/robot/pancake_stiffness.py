"""How much too stiff a mesh of linear tetrahedra is in bending, and the modulus that makes up for it.

A tetrahedron has one strain, so what bends as a plate is sheared in the mesh instead, and far too stiff: eight times
with 75 vertices, three times with 500.  A pancake that is turned over hardly does anything but bend, so the mesh is
given the modulus with which it bends as the material does by plate theory.  It is then softer than the material in
compression and shear by the same factor, which says how fine a mesh a soft material needs.
"""

from functools import lru_cache

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import spsolve

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.robot.pancake_mesh import PancakeMesh, pancake_mesh
from flipdiagram.scenario.cell import Object
from flipdiagram.theory.contact import GRAVITY_Z

MOST_COMPRESSED = 0.1
"""Strain under its own weight at the bottom of a pancake that its mesh may have."""


def mesh_modulus(pancake: Object) -> float:
    """Young's modulus [Pa] with which the mesh of a pancake bends as a plate of the pancake's own modulus.

    Raises InputError where the mesh would then give way under its own weight.
    """
    modulus = pancake.youngs_modulus * bending_share(pancake)
    area = np.pi * pancake.diameter**2 / 4 if pancake.diameter is not None else pancake.length * pancake.width
    compressed = -pancake.mass * GRAVITY_Z / area / modulus
    if compressed > MOST_COMPRESSED:
        problem = (
            f"scenario field 'object.refinement' = {pancake.refinement}: so coarse a mesh of so soft a pancake,"
            f" {pancake.youngs_modulus:g} Pa, gives way by {100 * compressed:.0f} % under its own weight"
        )
        valid = f"a finer mesh, or a stiffer pancake, that gives way by at most {100 * MOST_COMPRESSED:.0f} %"
        raise InputError.of("object.refinement", pancake.refinement, valid, problem)
    return modulus


def bending_share(pancake: Object) -> float:
    """Energy of a plate in cylindrical bending over that of the mesh, both of one material; below 1.

    The mesh's vertices on the rim move as the exact solution of linear elasticity says (u_y = −κ y z,
    u_z = κ y²/2 + κ ν/(1 − ν) z²/2, free faces), the others where they are at rest.  The plate has ½ D κ² for each unit
    of area, D = E h³ / (12 (1 − ν²)).
    """
    shape = pancake.diameter, pancake.length, pancake.width, pancake.thickness
    return _share(*shape, pancake.poissons_ratio, pancake.refinement, pancake.layers)


@lru_cache(maxsize=64)
def _share(
    diameter: float | None, length: float, width: float, thickness: float, nu: float, refinement: int, layers: int
) -> float:
    pancake = Object(
        kind="pancake",
        diameter=diameter,
        length=length,
        width=width,
        thickness=thickness,
        poissons_ratio=nu,
        refinement=refinement,
        layers=layers,
    )
    mesh = pancake_mesh(pancake)
    K = _stiffness(mesh, nu)
    _, y, z = mesh.vertices.T
    u = np.column_stack([np.zeros_like(y), -y * z, y**2 / 2 + nu / (1 - nu) * z**2 / 2]).ravel()
    side = np.zeros((2 * refinement + 1, 2 * refinement + 1), dtype=bool)
    side[[0, -1]] = side[:, [0, -1]] = True
    held = np.repeat(np.tile(side.ravel(), layers + 1), 3)
    u[~held] = spsolve(K[~held][:, ~held], -(K[~held][:, held] @ u[held]))
    plate = mesh.volumes.sum() * thickness**2 / (24 * (1 - nu**2))
    return float(plate / (u @ (K @ u) / 2))


def _stiffness(mesh: PancakeMesh, nu: float) -> csc_matrix:
    """Stiffness matrix (3 V, 3 V) of linear elasticity [m], for E = 1 Pa."""
    corners = mesh.vertices[mesh.tetrahedra]
    inverse = np.linalg.inv(corners[:, 1:] - corners[:, :1])
    slopes = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2)  # of the four shape functions
    B = np.zeros((len(slopes), 6, 12))
    for a in range(4):
        x, y, z = slopes[:, :, a].T
        B[:, :, 3 * a : 3 * a + 3] = _strain_rows(x, y, z)
    lame, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    C = np.diag([2 * mu] * 3 + [mu] * 3)
    C[:3, :3] += lame
    own = np.einsum("eki,kl,elj,e->eij", B, C, B, mesh.volumes)
    at = (3 * mesh.tetrahedra[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows, columns = np.repeat(at, 12, axis=1).ravel(), np.tile(at, (1, 12)).ravel()
    return csc_matrix((own.ravel(), (rows, columns)), shape=(mesh.vertices.size,) * 2)


def _strain_rows(x: Floats, y: Floats, z: Floats) -> Floats:
    """(E, 6, 3): strains xx, yy, zz, xy, yz, zx of a vertex's displacement, from the slopes of its shape function."""
    zero = np.zeros_like(x)
    rows = [[x, zero, zero], [zero, y, zero], [zero, zero, z], [y, x, zero], [zero, z, y], [z, zero, x]]
    return np.moveaxis(np.array(rows), -1, 0)
