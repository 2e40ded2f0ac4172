"""The surface of a recorded pancake over time, from its vertices alone: for pictures and figures."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices

if TYPE_CHECKING:  # the child that renders needs none of it
    from flipdiagram.simulation.recording import Recording

MIDDLE = 0.02
"""Distance from the middle plane, over half of the width, up to which a vertex counts as in it; a mesh has 0.05."""
OUTWARDS = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
"""Corners of a tetrahedron's triangles, seen from outside anticlockwise."""


class Surface(NamedTuple):
    """Triangles over the vertices at the surface, and where these were."""

    time: Floats
    """(frames,) [s]."""
    vertices: Floats
    """(frames, V, 3) [m] in the world."""
    upper: Indices
    """(F, 3) of the face that lies above at the start, seen from outside anticlockwise, as all are."""
    lower: Indices
    """(F, 3) of the face that lies on the blade."""
    rim: Indices
    """(G, 3) of what is between them."""

    def at(self, time: ArrayLike) -> "Surface":
        """The surface at times (n,) [s], straight between two frames; before and after them, as at the ends."""
        instants = np.asarray(time, dtype=float)
        where = np.interp(instants, self.time, np.arange(len(self.time)))
        first = np.minimum(where.astype(int), max(len(self.time) - 2, 0))
        later = np.minimum(first + 1, len(self.time) - 1)
        share = (where - first)[:, None, None]
        return self._replace(time=instants, vertices=(1 - share) * self.vertices[first] + share * self.vertices[later])

    def some(self, frames: Indices) -> "Surface":
        """The surface at some of the frames alone."""
        return self._replace(time=self.time[frames], vertices=self.vertices[frames])


def surface_of(recording: "Recording") -> Surface | None:
    """The surface of a recorded pancake; None where the recording is of something rigid."""
    from flipdiagram.simulation.deformation import bends

    if not bends(recording):
        return None
    tetrahedra, upper, lower = (recording[name].values for name in ("tetrahedra", "upper_face", "lower_face"))
    return surface_over(recording["frame_time"].values, recording["vertices"].values, tetrahedra, upper, lower)


def surface_over(time: Floats, vertices: Floats, tetrahedra: ArrayLike, upper: ArrayLike, lower: ArrayLike) -> Surface:
    """The surface of a mesh (E, 4), with its two faces (F, 3), over vertices (frames, V, 3) [m], inner ones too."""
    sides = np.asarray(upper, dtype=int), np.asarray(lower, dtype=int)
    faces = [*sides, _rim(np.asarray(tetrahedra, dtype=int), *sides)]
    used, inverse = np.unique(np.concatenate(faces), return_inverse=True)
    renumbered = np.split(inverse.reshape(-1, 3), np.cumsum([len(face) for face in faces])[:-1])
    return Surface(np.asarray(time), np.asarray(vertices, dtype=float)[:, used], *renumbered)


def _rim(tetrahedra: Indices, upper: Indices, lower: Indices) -> Indices:
    """Triangles (G, 3) that belong to one tetrahedron alone, and to no face."""
    triangles = np.concatenate([tetrahedra[:, OUTWARDS].reshape(-1, 3), upper, lower])
    _, which, count = np.unique(np.sort(triangles, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(triangles[count[which.ravel()] == 1])


def middle_section(recording: "Recording", surface: Surface) -> tuple[Indices, Indices]:
    """Vertices of the upper and of the lower face in the middle plane x = 0 of the pancake, from its -y to its +y."""
    from flipdiagram.simulation.recording import rotations

    pose = recording["block_pose"].sel(time=surface.time[0], method="nearest").values
    local = rotations(pose[None])[0].apply(surface.vertices[0] - pose[4:], inverse=True)
    near = np.abs(local[:, 0]) <= MIDDLE * np.abs(local[:, 0]).max()
    sides = []
    for face in (surface.upper, surface.lower):
        nodes = np.unique(face)
        nodes = nodes[near[nodes]]
        sides.append(nodes[np.argsort(local[nodes, 1])])
    return sides[0], sides[1]


def outlines(surface: Surface, section: tuple[Indices, Indices], time: ArrayLike) -> Floats:
    """The outline (n, 2 k, 2) [m] of the middle section in the y-z plane at times (n,) [s], once around."""
    upper, lower = section
    return surface.at(time).vertices[:, np.concatenate([upper, lower[::-1]]), 1:]
