"""The verdict on a recorded flip and its cause, from forces and poses alone, never from the plan's promises.

What came first is the cause.  A block that left the blade too early did so because

* a joint's torque was at its limit for `LIMITED` in all, or
* the blade struck the table, or
* the block had slid by `SLID` along the blade.  The slide began where the friction cone was used up for good; in the
  first `BEGINNING` of the planned contact phase that is "at the start", or
* it tipped: it had turned by `TIPPED` against the blade, or left it with hardly any slip.

A slide or a turn counts from when it has gone that far, and only without a strike: blocks slide by two centimetres,
stick again and are turned over, so a block that was still there when the blade struck had not slid off.
"""

from typing import NamedTuple

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.deformation import bends
from flipdiagram.simulation.events import at_limit, release_index, strike_index, touchdown, touching
from flipdiagram.simulation.lying import lying
from flipdiagram.simulation.recording import Recording, in_tool, roll, rotations

RELEASE_TOLERANCE = 0.1
"""How far [rad] short of π/2 the tool may be at the last contact: it lags behind a plan that may release at π/2."""
LIMITED = 0.02
"""Time [s] for which torque may be at its limit without being the reason of a failure.

In that time 5 m/s² that are missing move the tool by 1 mm.
"""
SLID = 0.01
"""Way [m] along the blade from which a block counts as slid."""
EXHAUSTED = 0.95
"""Share of the friction cone from which friction counts as used up."""
BEGINNING = 0.3
"""Share of the planned contact phase that is its beginning."""
TIPPED = 0.1
"""Angle [rad] between block and blade from which the block counts as tipped."""
SLIDES = ("slid at the start", "slid later")
OF_A_PANCAKE = ("not turned", "folded", "off target")
CAUSES = (*SLIDES, "tipped", "struck the table", "wrong angle", "never landed", "torque limit", *OF_A_PANCAKE)
"""Why a flip fails."""
TEXTS = {"landed": "wrong angle", "never": "never landed"}
"""What the text of a failure begins with where that is not its cause."""


class Event(NamedTuple):
    """When a cause had gone far enough to count, and when it began [s]."""

    counts: float
    began: float


def judge(data: Recording) -> tuple[bool, str | None]:
    """Success as the paper defines it, and the reason of a failure: its cause with the time, and how it ended.

    The block must stay on the blade until the tool has turned to π/2, condition (7) of the plan (less
    `RELEASE_TOLERANCE`), and touch the table at an angle between π/2 and 3π/2.  A pancake must, in the place of that
    angle, lie at the end with most of its former upper face down, nothing folded under, near the target; see `lying`.
    """
    time, landed, k = data["time"].values, touchdown(data), release_index(data)
    if data["x"].values[k, 2] <= np.pi / 2 - RELEASE_TOLERANCE:
        return False, f"{_first(_causes(data, k), 'tipped')}, dropped at {time[k]:.3f} s"
    end = "never reached the table" if landed is None else f"landed at {landed.theta_rad:.2f} rad"
    if landed is not None and bends(data):
        lies = lying(data).failure
        if lies is None:
            return True, None
        end = lies
    elif landed is not None and np.pi / 2 < landed.theta_rad < 3 * np.pi / 2:
        return True, None
    # a block that slid a little and was released all the same landed wrongly for how it was released
    before = {cause: at for cause, at in _causes(data, k).items() if cause in ("struck the table", "torque limit")}
    return False, f"{_first(before, '')}, {end}" if before else end


def cause_of(failure: str) -> str | None:
    """One of `CAUSES` by the text of a failure; None for the text of something else."""
    first = failure.split(" ", 1)[0]
    return TEXTS.get(first) or next((cause for cause in CAUSES if failure.startswith(cause)), None)


def _first(causes: dict[str, Event], otherwise: str) -> str:
    """The earliest cause in words: 'struck the table at 0.241 s'."""
    if not causes:
        return otherwise
    cause = min(causes, key=lambda name: causes[name])
    return f"{cause} {'at' if cause == 'struck the table' else 'from'} {causes[cause].began:.3f} s"


def _causes(data: Recording, lost: int) -> dict[str, Event]:
    """The causes that had set in before the block left the blade at sample `lost`."""
    time = data["time"].values
    start = int(np.searchsorted(time, -1e-9))
    found: dict[str, Event] = {}
    if (struck := strike_index(data)) is not None and struck <= lost:
        found["struck the table"] = Event(time[struck], time[struck])
    if (limited := at_limit(data)) is not None:
        longest = limited.max(axis=1)
        if longest[lost] > LIMITED:
            found["torque limit"] = Event(time[np.argmax(longest > LIMITED)], time[np.argmax(longest > 0)])
    if lost <= start or "struck the table" in found:
        return found
    carried = slice(start, lost + 1)
    relative = in_tool(data)[carried]
    slip = np.hypot(*(relative[:, :2] - relative[0, :2]).T)
    if (slip > SLID).any():
        far = int(np.argmax(slip > SLID))
        began = time[start + _since(_cone_use(data)[carried] >= EXHAUSTED, far)]
        early = began <= BEGINNING * float(data.attrs["release_time_s"])
        found["slid at the start" if early else "slid later"] = Event(time[start + far], began)
    turn = np.unwrap(roll(data["block_pose"].values) - roll(data["tool_pose"].values))[carried]
    turned = np.abs(turn - turn[0])
    if (turned > TIPPED).any():
        far = int(np.argmax(turned > TIPPED))
        found["tipped"] = Event(time[start + far], time[start + _since(np.diff(turned, append=np.inf) > 0, far)])
    return found


def _since(holds: np.ndarray, k: int) -> int:
    """The first of the samples up to k, without a break, at which something holds; k where it does not hold there."""
    ends = np.nonzero(~holds[: k + 1])[0]
    return min(int(ends[-1]) + 1, k) if ends.size else 0


def _cone_use(data: Recording) -> Floats:
    """Friction force over what the cone allows, (time,); 1 where blade and block do not touch."""
    force, touch = data["contact_force"].sel(pair="blade-block").values, touching(data, "blade-block")
    x, s, n = rotations(data["tool_pose"].values).apply(force, inverse=True).T
    most = np.tan(float(data.attrs["friction_angle_rad"])) * np.maximum(n, 0.0)
    return np.where(touch & (most > 0), np.hypot(x, s) / np.where(most > 0, most, 1.0), 1.0)
