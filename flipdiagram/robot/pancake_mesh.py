"""The tetrahedral mesh of a pancake: a grid of cells in its plane, some layers over its thickness, no mesher needed."""

from typing import NamedTuple

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.scenario.cell import Object


class PancakeMesh(NamedTuple):
    """Tetrahedra over the vertices of a disc or a box, about its centre; x along the width, z the normal."""

    vertices: Floats
    """(V, 3) [m], layer by layer from below."""
    tetrahedra: Indices
    """(E, 4) with positive volume."""
    upper: Indices
    """(F, 3) triangles of the upper face, seen from outside anticlockwise."""
    lower: Indices
    """(F, 3) of the lower face, also seen from outside anticlockwise."""

    @property
    def volumes(self) -> Floats:
        """Of the tetrahedra (E,) [m³]."""
        return volumes_of(self.vertices, self.tetrahedra)

    def masses(self, mass: float) -> Floats:
        """Share (V,) of a mass [kg] at each vertex: a quarter of each tetrahedron around it."""
        weights = np.zeros(len(self.vertices))
        np.add.at(weights, self.tetrahedra.ravel(), np.repeat(self.volumes / 4, 4))
        return np.asarray(weights * (mass / weights.sum()))


def pancake_mesh(pancake: Object) -> PancakeMesh:
    """The mesh of a pancake: `refinement` cells from the middle to the rim, `layers` over the thickness.

    The square grid of a disc is mapped ring by ring onto circles, diagonals away from the corners of the square, whose
    cells would otherwise be flat.  Each cell is cut into two prisms, each prism into three tetrahedra along the
    diagonals that begin at its vertex of lowest number, so that neighbours share whole triangles.  A disc becomes a
    polygon, larger than the inscribed one to have the disc's area, so volume and mass are exact.
    """
    k = pancake.refinement
    steps = np.arange(-k, k + 1) / k
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    plane = np.column_stack([u, v])
    if pancake.diameter is not None:
        ring, radius = np.maximum(np.abs(u), np.abs(v)), np.hypot(u, v)
        plane = plane * np.divide(ring, radius, out=np.zeros_like(ring), where=radius > 0)[:, None]
    triangles = _triangles(k)
    scale = np.array([pancake.width, pancake.length]) / 2
    if pancake.diameter is not None:
        corners = plane[triangles]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2
        scale = scale * np.sqrt(np.pi / area)
    plane, n = plane * scale, len(plane)
    heights = np.linspace(-0.5, 0.5, pancake.layers + 1) * pancake.thickness
    vertices = np.vstack([np.column_stack([plane, np.full(n, z)]) for z in heights])
    low = np.sort(triangles, axis=1)
    a, b, c = low.T
    prism = np.vstack(_prism(a, b, c, n))
    tetrahedra = np.vstack([prism + layer * n for layer in range(pancake.layers)])
    turned = volumes_of(vertices, tetrahedra) < 0
    tetrahedra[turned] = tetrahedra[turned][:, [0, 2, 1, 3]]
    return PancakeMesh(vertices, tetrahedra, triangles + pancake.layers * n, triangles[:, ::-1])


def _triangles(k: int) -> Indices:
    """Two triangles for each cell of a grid of 2k × 2k cells, (8 k², 3) anticlockwise."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(2 * k), np.arange(2 * k), indexing="ij"))
    row = 2 * k + 1
    corners = np.column_stack([i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1])
    # the diagonal that joins the middle to the corner of the square would leave a flat triangle there
    across = (i >= k) == (j >= k)
    first = np.where(across[:, None], corners[:, [0, 1, 3]], corners[:, [0, 1, 2]])
    second = np.where(across[:, None], corners[:, [1, 2, 3]], corners[:, [0, 2, 3]])
    return np.vstack([first, second])


def _prism(a: Indices, b: Indices, c: Indices, n: int) -> list[Indices]:
    """The three tetrahedra of prisms over triangles a < b < c, whose upper corners have numbers higher by n."""
    return [
        np.column_stack([a, b, c, c + n]),
        np.column_stack([a, b, b + n, c + n]),
        np.column_stack([a, a + n, b + n, c + n]),
    ]


def volumes_of(vertices: Floats, tetrahedra: Indices) -> Floats:
    """Signed volumes (..., E) [m³] of tetrahedra over vertices (..., V, 3)."""
    corners = vertices[..., tetrahedra, :]
    a, b, c = (corners[..., k, :] - corners[..., 0, :] for k in (1, 2, 3))
    return np.asarray(np.einsum("...i,...i->...", np.cross(a, b), c) / 6)
