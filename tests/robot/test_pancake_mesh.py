"""Mesh and stiffness of a pancake, against geometry and closed forms of linear elasticity."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from flipdiagram.errors import InputError
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.robot.pancake_stiffness import _stiffness, bending_share, mesh_modulus
from flipdiagram.scenario.cell import Object

BOX = {"diameter": None, "length": 0.1, "width": 0.08}
MESHES = [{"refinement": k, "layers": layers, **shape} for k, layers in ((1, 2), (3, 2), (2, 3)) for shape in ({}, BOX)]


def thing(**fields):
    return Object(kind="pancake", **fields)


@pytest.mark.parametrize("fields", MESHES)
def test_volume_mass_and_centre_are_those_of_the_body(fields):
    pancake = thing(**fields)
    mesh = pancake_mesh(pancake)
    area = np.pi * 0.06**2 if "diameter" not in fields else 0.1 * 0.08
    assert mesh.volumes.min() > 0
    assert mesh.volumes.sum() == pytest.approx(area * 0.012, rel=1e-12)
    assert len(mesh.vertices) == pancake.vertices
    masses = mesh.masses(0.1)
    assert masses.sum() == pytest.approx(0.1, rel=1e-12)
    np.testing.assert_allclose(masses @ mesh.vertices, 0, atol=1e-9 * 0.1)


@pytest.mark.parametrize("fields", MESHES)
def test_tetrahedra_share_whole_triangles_and_the_rest_is_the_surface(fields):
    mesh = pancake_mesh(thing(**fields))
    seen = Counter(
        tuple(sorted(face)) for tetrahedron in mesh.tetrahedra.tolist() for face in combinations(tetrahedron, 3)
    )
    assert set(seen.values()) == {1, 2}
    outer = {face for face, times in seen.items() if times == 1}
    assert {tuple(sorted(face)) for face in np.vstack([mesh.upper, mesh.lower]).tolist()} <= outer
    edges = Counter(edge for face in outer for edge in combinations(face, 2))
    assert set(edges.values()) == {2}  # a closed surface


@pytest.mark.parametrize("fields", MESHES)
def test_normals_of_the_faces_point_outwards(fields):
    mesh = pancake_mesh(thing(**fields))
    for face, sign in ((mesh.upper, 1), (mesh.lower, -1)):
        a, b, c = (mesh.vertices[face[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        assert (sign * normals[:, 2] > 0).all()
        assert np.abs(normals[:, :2]).max() < 1e-18
        assert (mesh.vertices[face][:, :, 2] == sign * 0.006).all()


def test_a_uniform_strain_costs_what_hookes_law_says():
    mesh, nu = pancake_mesh(thing(refinement=2)), 0.3
    K = _stiffness(mesh, nu)
    x, y, z = mesh.vertices.T
    stretched = np.column_stack([x, -nu * y, -nu * z]).ravel() * 1e-3  # under tension along x alone: E ε²/2
    assert stretched @ (K @ stretched) / 2 == pytest.approx(1e-6 / 2 * mesh.volumes.sum(), rel=1e-10)
    sheared = np.column_stack([y, 0 * y, 0 * y]).ravel() * 1e-3  # G γ²/2, G = E / (2 (1 + ν))
    assert sheared @ (K @ sheared) / 2 == pytest.approx(1e-6 / (4 * (1 + nu)) * mesh.volumes.sum(), rel=1e-10)
    turned = np.column_stack([-y, x, 0 * z]).ravel()
    assert np.abs(K @ turned).max() < 1e-12  # a small rotation costs nothing
    assert abs(K - K.T).max() < 1e-12


def test_a_finer_mesh_locks_less_and_in_second_order():
    shares = np.array([bending_share(thing(refinement=k, layers=k, **BOX | {"thickness": 0.03})) for k in (2, 3, 6)])
    assert (np.diff(shares) > 0).all() and shares[-1] < 1
    too_stiff = 1 / shares - 1
    order = np.log(too_stiff[:-1] / too_stiff[1:]) / np.log([3 / 2, 2])
    assert (order > 1.3).all() and (order < 2.2).all()


def test_a_mesh_too_coarse_for_a_soft_pancake_is_refused_in_one_line():
    with pytest.raises(
        InputError, match=r"'object\.refinement' = 1: so coarse .* 5000 Pa, gives way by .* at most 10 %"
    ):
        mesh_modulus(thing(refinement=1, youngs_modulus=5e3))
    stiff = thing(youngs_modulus=1e6)
    assert mesh_modulus(stiff) == pytest.approx(1e6 * bending_share(stiff))
