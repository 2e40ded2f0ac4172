"""Task coordinates (y, z, theta, x, pitch, yaw) of a tool and their rates, as pure functions of its pose.

R = Rz(yaw) Ry(pitch) Rx(theta), all in the base frame, theta unwrapped into (-pi/2, 3 pi/2]. With the angular
velocity w,

    theta' = (cos yaw w_x + sin yaw w_y) / cos pitch,   pitch' = -sin yaw w_x + cos yaw w_y,   yaw' = w_z +
    sin pitch theta',

which is eq. v = N(R) [w; p'] of `rate_map`; `rate_bias` is N' [w; p']. Everything works on float, AutoDiffXd
and Expression alike; plain Python numbers rather than small arrays, as these run every millisecond.
"""

import math
from typing import Any

import numpy as np
import pydrake.math as drake_math
from pydrake.symbolic import Expression, if_then_else

from flipdiagram.arrays import Array
from flipdiagram.errors import PlanningError

AXES = ("y", "z", "theta", "x", "pitch", "yaw")
UNITS = ("m", "m", "rad", "m", "rad", "rad")
TURNS_PER_UNIT = np.array([0, 0, 1, 0, 1, 1]) / (2 * math.pi)  # of AXES: lengths have no turns
COS_PITCH_MIN = 1e-6  # below, theta and yaw turn about the same axis
UPRIGHT = "the tool points straight up or down (pitch +-90 deg), where theta and yaw are one"


def coordinates(R: Array, p: Array) -> Array:
    """Task coordinates (6,) [m, rad] of a pose given as rotation matrix (3, 3) and position (3,) [m]."""
    (r00, _, _), (r10, _, _), (r20, r21, r22) = R.tolist()
    x, y, z = p.tolist()
    if type(r00) is float:
        pitch, yaw = math.atan2(-r20, math.hypot(r00, r10)), math.atan2(r10, r00)
    else:
        pitch, yaw = (drake_math.atan2(-r20, drake_math.sqrt(r00 * r00 + r10 * r10)), drake_math.atan2(r10, r00))
    return np.array([y, z, unwrapped_roll(r21, r22), x, pitch, yaw])


def unwrapped_roll(r21: Any, r22: Any) -> Any:
    """theta in (-pi/2, 3 pi/2] [rad] with sin theta ~ r21 and cos theta ~ r22, the last row of R."""
    if type(r21) is float:
        roll = math.atan2(r21, r22)
        return roll if roll > -math.pi / 2 else roll + 2 * math.pi
    roll = drake_math.atan2(r21, r22)
    if isinstance(roll, Expression):
        return if_then_else(roll > -math.pi / 2, roll, roll + 2 * math.pi)
    return roll if roll.value() > -math.pi / 2 else roll + 2 * math.pi


def rate_map(R: Array) -> Array:
    """N(R) (6, 6) with v = N [w; p']: angular velocity w [rad/s], then velocity p' [m/s], Drake's order.

    Raises PlanningError where pitch is +-90 deg.
    """
    (r00, _, _), (r10, _, _), (r20, _, _) = R.tolist()
    if type(r00) is float:
        cos_pitch = math.hypot(r00, r10)
        if cos_pitch < COS_PITCH_MIN:
            raise PlanningError(UPRIGHT)
        N = np.zeros((6, 6))
    else:
        cos_pitch = drake_math.sqrt(r00 * r00 + r10 * r10)
        N = np.zeros((6, 6), dtype=object)
    cos_yaw, sin_yaw = r00 / cos_pitch, r10 / cos_pitch
    N[0, 4] = N[1, 5] = N[3, 3] = N[5, 2] = 1.0
    N[2, 0], N[2, 1] = cos_yaw / cos_pitch, sin_yaw / cos_pitch
    N[4, 0], N[4, 1] = -sin_yaw, cos_yaw
    N[5, 0], N[5, 1] = -r20 * N[2, 0], -r20 * N[2, 1]
    return N


def rate_bias(R: Array, v: Array) -> tuple[Any, Any, Any]:
    """theta, pitch and yaw components [rad/s^2] of N' [w; p'] at rates v (6,); the others are zero."""
    (r00, _, _), (r10, _, _), (r20, _, _) = R.tolist()
    cos_pitch = math.hypot(r00, r10) if type(r00) is float else drake_math.sqrt(r00 * r00 + r10 * r10)
    _, _, theta_rate, _, pitch_rate, yaw_rate = v.tolist()
    theta = pitch_rate * (yaw_rate - r20 * theta_rate) / cos_pitch
    return theta, -yaw_rate * theta_rate * cos_pitch, pitch_rate * theta_rate * cos_pitch - r20 * theta


def product(A: Array, B: Array) -> Array:
    """A @ B, for numbers, AutoDiffXd and Expression alike."""
    if A.dtype != object:
        return A @ B
    with np.errstate(invalid="ignore"):  # Drake keeps symbolic expressions in NaNs, which NumPy takes for errors
        return A @ B


def difference(target: Array, x: Array) -> Array:
    """target - x with the angles taken the short way round, shape (..., 6)."""
    error = target - x
    return error - 2 * math.pi * np.rint(error * TURNS_PER_UNIT)


def describe(x: Array) -> str:
    """A task pose in words for a message: "y = 0.1 m, z = ..."."""
    return ", ".join(f"{name} = {value:.4g} {unit}" for name, value, unit in zip(AXES, x, UNITS, strict=True))
