"""The course of a recorded motion in words: what happened and when, read from forces and poses, never from the plan."""

from typing import NamedTuple

import numpy as np

from flipdiagram.simulation.deformation import bends
from flipdiagram.simulation.events import release_index, strike_index, touchdown, touching
from flipdiagram.simulation.recording import Recording, in_tool
from flipdiagram.simulation.verdict import RELEASE_TOLERANCE, SLID

APART = 0.02
"""Time [s] without contact after which the block has left the blade for good, once it has touched the table."""


class Happening(NamedTuple):
    """Something that happened: when [s], and what, without the time."""

    time_s: float
    text: str


def course(data: Recording) -> list[Happening]:
    """Strike, slide, release and landing of a recording in the order of time, as far as they came about."""
    time, thing = data["time"].values, "pancake" if bends(data) else "block"
    happened = []
    if (struck := strike_index(data)) is not None:
        happened.append(Happening(float(time[struck]), "blade struck the table"))
    left = left_index(data)
    if (slid := _slid_index(data, left)) is not None:
        happened.append(Happening(float(time[slid]), f"{thing} had slid by {100 * SLID:g} cm"))
    if left < len(time) - 1:
        angle = data["x"].values[left, 2]
        happened.append(Happening(float(time[left]), f"{thing} left the blade, {angle:.2f} rad"))
    if (landed := touchdown(data)) is not None:
        happened.append(Happening(landed.time_s, f"{thing} touched the table, {landed.theta_rad:.2f} rad"))
    return sorted(happened)


def left_index(data: Recording) -> int:
    """Sample of the last contact of blade and block: before touch-down, or after it where they had not yet parted.

    An object that is laid down touches the table while it is still on the blade.
    """
    k, period = release_index(data), float(data["time"][1] - data["time"][0])
    landed = touchdown(data)
    if landed is None or landed.time_s - float(data["time"][k]) > APART:
        return k
    on = np.flatnonzero(touching(data, "blade-block"))
    later = on[on >= k]
    ends = np.flatnonzero(np.diff(later) * period > APART)
    return int(later[ends[0]] if ends.size else later[-1])


def decided_at(data: Recording) -> float:
    """When the verdict on a flip is plain [s]: the block lost, landed, or the end of the recording."""
    k, landed = release_index(data), touchdown(data)
    if data["x"].values[k, 2] <= np.pi / 2 - RELEASE_TOLERANCE:
        return float(data["time"][k])
    return float(data["time"][-1]) if landed is None else landed.time_s


def _slid_index(data: Recording, left: int) -> int | None:
    """Sample at which the block had slid by SLID along the blade, before it left; None where it never had."""
    start = int(np.searchsorted(data["time"].values, -1e-9))
    along = in_tool(data)[start : left + 1, :2]
    far = np.flatnonzero(np.hypot(*(along - along[:1]).T) > SLID)
    return start + int(far[0]) if far.size else None
