"""Contact between tool and object: section II-B of the paper as pure functions on arrays.

Vectors live in the vertical plane of the motion and are written (y, z).  θ is the inclination of the
tool, its normal n = (−sin θ, cos θ) and tangent s = (cos θ, sin θ).  Gravity is g = (0, g_z) with
g_z = −9.81 m/s².  All functions broadcast over leading dimensions.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats, Indices

GRAVITY_Z = -9.81
"""g_z of eq. (1) [m/s²]; negative, z points up."""


class ContactState(IntEnum):
    """What the object does on the tool, the three rows of eqs. (7)–(9)."""

    STICK = 0
    SLIDE = 1
    RELEASE = 2


def tool_normal(theta: ArrayLike) -> Floats:
    """Unit normal n = (−sin θ, cos θ) of the tool surface, shape (..., 2); θ [rad]."""
    theta = np.asarray(theta, dtype=float)
    return np.stack([-np.sin(theta), np.cos(theta)], axis=-1)


def tool_tangent(theta: ArrayLike) -> Floats:
    """Unit tangent s = (cos θ, sin θ) of the tool surface, shape (..., 2); θ [rad]."""
    theta = np.asarray(theta, dtype=float)
    return np.stack([np.cos(theta), np.sin(theta)], axis=-1)


def friction_angle(mu: ArrayLike) -> Floats:
    """Half-angle of the friction cone ϕ = atan μ [rad], the inclination at which sliding starts (section II-B)."""
    return np.arctan(np.asarray(mu, dtype=float))


def resultant(acceleration: ArrayLike) -> Floats:
    """Resultant i = g − a of gravity and inertia per unit mass, eq. (10); acceleration (..., 2) [m/s²]."""
    return np.array([0.0, GRAVITY_Z]) - np.asarray(acceleration, dtype=float)


def sliding_angle(acceleration: ArrayLike, theta: ArrayLike) -> Floats:
    """Signed sliding angle φ between i and the inward tool normal, from eq. (11): φ = atan2(i_y, −i_z) − θ.

    acceleration (..., 2) [m/s²], θ (...) [rad]; returns φ in [−π, π) [rad].  Conditions (7)–(9) read its modulus.
    """
    i = resultant(acceleration)
    angle = np.arctan2(i[..., 0], -i[..., 1]) - np.asarray(theta, dtype=float)
    return (angle + np.pi) % (2 * np.pi) - np.pi


def acceleration(magnitude: ArrayLike, phi: ArrayLike, theta: ArrayLike) -> Floats:
    """Acceleration that gives a wanted I and φ at inclination θ, eq. (12).

    a = (−I sin(θ + φ), g_z + I cos(θ + φ)) [m/s²], shape (..., 2); I [m/s²], φ and θ [rad].
    """
    magnitude = np.asarray(magnitude, dtype=float)
    total = np.asarray(theta, dtype=float) + np.asarray(phi, dtype=float)
    return np.stack([-magnitude * np.sin(total), GRAVITY_Z + magnitude * np.cos(total)], axis=-1)


def contact_state(phi: ArrayLike, mu: ArrayLike) -> Indices:
    """Contact state of eqs. (7)–(9) for sliding angle φ [rad] and friction coefficient μ, as ContactState values."""
    modulus = np.abs(np.asarray(phi, dtype=float))
    state = np.where(modulus < friction_angle(mu), ContactState.STICK, ContactState.SLIDE)
    return np.where(modulus >= np.pi / 2, ContactState.RELEASE, state).astype(np.int64)


def contact_force(acceleration: ArrayLike, theta: ArrayLike) -> tuple[Floats, Floats]:
    """Force of the tool on the object per unit mass, (tangential, normal) = ((a − g)·s, (a − g)·n) [m/s²].

    With eq. (11) this is (−I sin φ, I cos φ): the normal part must stay positive for contact to hold.
    """
    lift = -resultant(acceleration)
    return np.sum(lift * tool_tangent(theta), axis=-1), np.sum(lift * tool_normal(theta), axis=-1)


def centre_of_pressure(acceleration: ArrayLike, theta: ArrayLike, height: float, gyration: float) -> Floats:
    """Where the contact force acts on the tool surface, measured along s from below the object's centre [m].

    The moment balance of the object about its centre, c N + h F_s = I_θ a_θ, gives c = (k² a_θ − h F_s) / N
    with forces per unit mass.  The paper leaves this out; a flip needs it, as the object tips over its edge when
    |c| reaches half its length.

    acceleration (..., 3) = (a_y, a_z, a_θ); height h of the centre above the tool [m]; gyration k² = I_θ/m [m²].
    Where the normal force is not positive there is no contact and the result is nan.
    """
    a = np.asarray(acceleration, dtype=float)
    tangential, normal = contact_force(a[..., :2], theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = (gyration * a[..., 2] - height * tangential) / normal
    return np.where(normal > 0, centre, np.nan)
