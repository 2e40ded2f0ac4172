"""What happened in a recorded flip, from the contact forces: who touched whom, when the block left, when it landed."""

from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.recording import Recording, roll

CONTACT_FORCE = 1e-6
"""Force [N] from which two bodies count as touching."""
SATURATED = 0.999
"""Torque over its limit from which a joint counts as saturated."""


@dataclass(frozen=True)
class Touchdown:
    """First contact of block and table: time [s], centre of the block [m], angle [rad]."""

    time_s: float
    y_m: float
    z_m: float
    theta_rad: float


@dataclass(frozen=True)
class Strike:
    """Contact of blade and table: when it began [s], how long they touched in all [s], the largest force [N]."""

    time_s: float
    duration_s: float
    force_N: float


def touching(data: Recording, pair: str) -> np.ndarray:
    """Whether a pair of bodies ('blade-block', 'table-block', 'table-blade') is in contact, shape (time,)."""
    return np.linalg.norm(data["contact_force"].sel(pair=pair).values, axis=-1) > CONTACT_FORCE


def touchdown(data: Recording) -> Touchdown | None:
    """The block's first contact with the table after the motion has started; None where it never comes."""
    time = data["time"].values
    landed = touching(data, "table-block") & (time >= 0)
    if not landed.any():
        return None
    k = int(np.argmax(landed))
    pose = data["block_pose"].values
    return Touchdown(float(time[k]), float(pose[k, 5]), float(pose[k, 6]), float(roll(pose)[k]))


def release_index(data: Recording) -> int:
    """Sample of the last contact of blade and block before touch-down (or the end of the recording)."""
    time, landed = data["time"].values, touchdown(data)
    until = np.inf if landed is None else landed.time_s
    contact = touching(data, "blade-block") & (time <= until)
    return int(np.max(np.nonzero(contact)[0], initial=0))


def strike_index(data: Recording) -> int | None:
    """Sample at which the blade first touches the table after the motion has started; None where it never does."""
    hit = touching(data, "table-blade") & (data["time"].values >= 0)
    return int(np.argmax(hit)) if hit.any() else None


def strike_of(data: Recording) -> Strike | None:
    """How the blade touched the table after the motion had started; None where it never did."""
    first, time = strike_index(data), data["time"].values
    if first is None:
        return None
    force = np.linalg.norm(data["contact_force"].sel(pair="table-blade").values[first:], axis=-1)
    period = float(time[1] - time[0])
    return Strike(float(time[first]), int((force > CONTACT_FORCE).sum()) * period, float(force.max()))


def at_limit(data: Recording) -> Floats | None:
    """How long each joint's torque has been at its limit, |τ| ≥ `SATURATED` τ_max, since the start of the motion [s].

    Shape (time, joint); None where the recording does not say its limits.
    """
    limit = data["tau"].attrs.get("limit")
    if limit is None:
        return None
    time = data["time"].values
    at = (np.abs(data["tau"].values) >= SATURATED * np.atleast_1d(limit)) & (time >= 0)[:, None]
    return np.asarray(np.cumsum(at, axis=0) * float(time[1] - time[0]))
