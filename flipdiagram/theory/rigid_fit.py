"""The rigid motion that is nearest to a deformed body: Kabsch's algorithm."""

from typing import NamedTuple

import numpy as np

from flipdiagram.arrays import Floats


class RigidFit(NamedTuple):
    """Rotations (..., 3, 3) from the reference into the world, and centres of mass (..., 3) [m]."""

    rotation: Floats
    centre: Floats


def rigid_fit(points: Floats, reference: Floats, masses: Floats) -> RigidFit:
    """The rotation R and centre c that make Σ m |p − c − R r|² least (W. Kabsch, Acta Cryst. A 32, 922, 1976).

    Args:
        points: (..., V, 3) [m] in the world.
        reference: the same points of the body at rest (V, 3) [m], from its centre of mass.
        masses: (V,) [kg].
    """
    share = masses / masses.sum()
    centre = share @ points
    spread = (reference * share[:, None]).T @ (points - centre[..., None, :])
    U, _, Vt = np.linalg.svd(spread)
    V = np.swapaxes(Vt, -1, -2)
    turn = np.linalg.det(V @ np.swapaxes(U, -1, -2))
    V[..., :, 2] *= np.sign(turn)[..., None]  # a rotation, no reflection
    return RigidFit(V @ np.swapaxes(U, -1, -2), centre)


def spin(points: Floats, velocities: Floats, masses: Floats) -> tuple[Floats, Floats]:
    """Angular velocity [rad/s] and velocity of the centre [m/s], each (3,), of a rigid body with the same momenta.

    points, velocities: (V, 3) [m, m/s].
    """
    share = masses / masses.sum()
    centre, mean = share @ points, share @ velocities
    r = points - centre
    momentum = share @ np.cross(r, velocities - mean)
    inertia = np.einsum("v,vi,vi->", share, r, r) * np.eye(3) - (r * share[:, None]).T @ r
    return np.asarray(np.linalg.solve(inertia, momentum)), np.asarray(mean)
