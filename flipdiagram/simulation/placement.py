"""What became of an object that was laid down: from the recording alone, as `metrics` and `verdict` of a flip.

A recording says by its attribute `kind` which of the two it is: 'place' here, 'flip' there.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.simulation.events import strike_of, touchdown, touching
from flipdiagram.simulation.metrics import FlipMetrics, check_moves, measure, rmse
from flipdiagram.simulation.recording import PLACE, Recording, in_tool, kind_of, roll
from flipdiagram.theory.contact import ContactState

NEAR, GENTLE, FLAT = 0.02, 0.3, 0.1
"""Success: within this of the target [m], slower than this at touch-down [m/s], flat within this [rad]."""
STILL = 1e-3
"""Speed along the blade [m/s] above which the object counts as sliding."""


@dataclass(frozen=True)
class PlaceMetrics:
    """The `runs` entry of a placement in summary.json.

    The strike is the contact of blade and table, which the plan keeps apart: when it began, how long the two touched in
    all, the largest force.  Where they never do, its time is None, the others are 0.
    """

    architecture: str
    success: bool
    failure: str | None
    final_y_m: float
    distance_m: float
    tilt_rad: float
    touchdown_time_s: float | None
    touchdown_speed_m_s: float | None
    slid_m: float
    planned_slide_m: float
    strike_time_s: float | None
    strike_duration_s: float
    strike_force_N: float
    position_rmse_m: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)


def placed(data: Recording, slide_cmd: Floats, target_y: float) -> Recording:
    """The recording of a placement: with the slide σ on the blade, the planned one [m], and the contact state.

    slide_cmd: (time,) [m]; target_y: where the object's centre shall lie [m].
    """
    note = {"units": "1", "note": "0 stick, 1 slide, 2 release"}
    signals = {
        "slide": (("time",), sliding(data), {"units": "m"}),
        "slide_cmd": (("time",), slide_cmd, {"units": "m"}),
        "contact_state": (("time",), contact_states(data), note),
    }
    return data.assign(signals).assign_attrs(kind=PLACE, target_y_m=target_y)


def sliding(data: Recording) -> Floats:
    """Displacement σ of the object along the blade since the start [m], (time,)."""
    along = in_tool(data)[:, 1]
    return np.asarray(along - along[int(np.searchsorted(data["time"].values, 0.0))], dtype=np.float64)


def contact_states(data: Recording) -> Indices:
    """Contact state of eqs. (7)–(9) by what the object really does on the blade, as ContactState values, (time,)."""
    speed = np.gradient(sliding(data), data["time"].values)
    state = np.where(np.abs(speed) > STILL, ContactState.SLIDE, ContactState.STICK)
    return np.where(touching(data, "blade-block"), state, ContactState.RELEASE).astype(np.int8)


def measure_placement(data: Recording) -> PlaceMetrics:
    """All that is measured of a placement, and whether it succeeded.

    The object must lie flat within `NEAR` of the target, have come down slower than `GENTLE`, and the blade must never
    have touched the table.  Raises InputError for a recording that ends before the motion begins.
    """
    check_moves(data)
    time, pose, landed, strike = data["time"].values, data["block_pose"].values, touchdown(data), strike_of(data)
    y, tilt = float(pose[-1, 5]), float(abs(np.angle(np.exp(1j * roll(pose)[-1]))))
    distance, speed = abs(y - float(data.attrs["target_y_m"])), None
    if landed is not None:
        k = max(int(np.searchsorted(time, landed.time_s)) - 1, 1)
        speed = float(np.linalg.norm(pose[k, 5:] - pose[k - 1, 5:]) / (time[1] - time[0]))
    reasons = [f"struck the table at {strike.time_s:.3f} s with {strike.force_N:.0f} N"] if strike else []
    if speed is None:
        reasons.append("never reached the table")
    elif tilt > FLAT:
        reasons.append(f"lies tilted by {tilt:.2f} rad")
    elif distance > NEAR:
        reasons.append(f"lies {100 * distance:.1f} cm from the target")
    elif speed >= GENTLE:
        reasons.append(f"came down with {speed:.2f} m/s")
    return PlaceMetrics(
        architecture=data.attrs["architecture"],
        success=not reasons,
        failure=", ".join(reasons) or None,
        final_y_m=y,
        distance_m=distance,
        tilt_rad=tilt,
        touchdown_time_s=landed.time_s if landed else None,
        touchdown_speed_m_s=speed,
        slid_m=float(-data["slide"].values[time <= data.attrs["release_time_s"]].min()),
        planned_slide_m=float(-data["slide_cmd"].values.min()),
        strike_time_s=strike.time_s if strike else None,
        strike_duration_s=strike.duration_s if strike else 0.0,
        strike_force_N=strike.force_N if strike else 0.0,
        position_rmse_m=rmse(data, "x", "x_cmd", ["y", "z"]),
    )


def measure_by_kind(data: Recording) -> FlipMetrics | PlaceMetrics:
    """A recording measured and judged as what it is, a flip or a placement; raises InputError as these."""
    return measure_placement(data) if kind_of(data) == PLACE else measure(data)
