"""What is measured of a recorded flip: pure functions of the recording, never of the plan's promises."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.recording import Recording, in_tool, roll

CONTACT_FORCE = 1e-6
"""Force [N] from which two bodies count as touching."""
APART = 0.005
"""Seconds without contact after which the block counts as released."""
RELEASE_TOLERANCE = 0.1
"""How far [rad] short of π/2 the tool may be at the last contact: it lags behind a plan that may release at π/2."""
VIBRATION_WINDOW = 0.2
"""Seconds after the end of the trajectory in which endpoint vibration is measured."""
SATURATED = 0.999
"""Torque over its limit from which a joint counts as saturated."""
LARGEST_DELAY = 0.1
"""Range of lags [s] searched by `velocity_delay`."""


@dataclass(frozen=True)
class Touchdown:
    """First contact of block and table: time [s], centre of the block [m], angle [rad]."""

    time_s: float
    y_m: float
    z_m: float
    theta_rad: float


@dataclass(frozen=True)
class FlipMetrics:
    """The `runs` entry of summary.json; see the functions below for the definitions."""

    architecture: str
    start_y_m: float
    success: bool
    failure: str | None
    touchdown: Touchdown | None
    position_rmse_m: float
    angle_rmse_rad: float
    acceleration_rmse_m_s2: float
    max_torque_Nm: list[float]
    saturated_s: float
    max_slip_m: float
    max_lift_off_m: float
    release_time_s: float
    release_angle_rad: float
    contact_after_release_s: float
    landing_cost_J: float
    velocity_delay_s: float
    endpoint_vibration_m_s: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)


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


def landing_cost(data: Recording) -> float:
    """J of eq. (5) that the block really landed with: (θ − π)² + α (y − y_target)² + β (v_y² + v_z²).

    From the last sample before touch-down, the velocity a difference over it; nan where it never lands.
    """
    landed, time = touchdown(data), data["time"].values
    if landed is None:
        return float("nan")
    k = max(int(np.searchsorted(time, landed.time_s)) - 1, 1)
    pose = data["block_pose"].values
    velocity = (pose[k, 5:] - pose[k - 1, 5:]) / float(time[1] - time[0])
    attrs = data.attrs
    away = landed.y_m - attrs.get("target_y_m", 0.0)
    cost = (landed.theta_rad - np.pi) ** 2 + attrs.get("alpha_1_m2", 20.0) * away**2
    return float(cost + attrs.get("beta_s2_m2", 0.5) * np.sum(velocity**2))


def release_index(data: Recording) -> int:
    """Sample of the last contact of blade and block before touch-down (or the end of the recording)."""
    time, landed = data["time"].values, touchdown(data)
    until = np.inf if landed is None else landed.time_s
    contact = touching(data, "blade-block") & (time <= until)
    return int(np.max(np.nonzero(contact)[0], initial=0))


def judge(data: Recording) -> tuple[bool, str | None]:
    """Success as the paper defines it, from the simulated block alone, and the reason of a failure.

    The block must stay on the blade until the tool has turned to π/2, condition (7) of the plan (less
    `RELEASE_TOLERANCE`), and touch the table at an angle between π/2 and 3π/2.
    """
    time, landed, k = data["time"].values, touchdown(data), release_index(data)
    blade = touching(data, "table-blade") & (time >= 0) & (time <= time[k])
    if data["x"].values[k, 2] <= np.pi / 2 - RELEASE_TOLERANCE:
        hit = f"blade hit the table at {time[np.argmax(blade)]:.3f} s, " if blade.any() else ""
        return False, f"{hit}dropped at {time[k]:.3f} s"
    if landed is None:
        return False, "never reached the table"
    if not np.pi / 2 < landed.theta_rad < 3 * np.pi / 2:
        return False, f"landed at {landed.theta_rad:.2f} rad"
    return True, None


def slip_and_lift(data: Recording) -> tuple[float, float]:
    """Largest displacement of the block on the blade, and largest gap between them, while it is carried [m].

    Both count from where the block rests when the motion starts, until the last contact before touch-down.
    """
    start, end = int(np.searchsorted(data["time"].values, 0.0)), release_index(data)
    if end <= start:
        return float("nan"), float("nan")
    relative = in_tool(data)[start : end + 1]
    moved = relative - relative[0]
    return float(np.hypot(moved[:, 0], moved[:, 1]).max()), float(max(moved[:, 2].max(), 0.0))


def contact_after_release(data: Recording) -> float:
    """Time [s] for which blade and block touch again after they have been apart for `APART` beyond π/2."""
    time = data["time"].values
    period = float(time[1] - time[0])
    contact, beyond = touching(data, "blade-block"), data["x"].values[:, 2] > np.pi / 2
    wanted = round(APART / period)
    free = ~contact & beyond & (time > 0)
    run = np.convolve(free, np.ones(wanted), mode="valid") >= wanted
    if not run.any():
        return 0.0
    return float(np.sum(contact[int(np.argmax(run)) :]) * period)


def rmse(data: Recording, signal: str, reference: str, axes: list[str]) -> float:
    """Root mean square of |signal − reference| over the given axes and the time of the motion, brake included."""
    moving = data.sel(time=slice(0.0, data.attrs["end_time_s"]))
    error = moving[signal].sel(axis=axes).values - moving[reference].sel(axis=axes).values
    return float(np.sqrt(np.mean(np.sum(error**2, axis=-1))))


def velocity_delay(data: Recording) -> float:
    """Delay of the tool's velocity behind its command [s]: the lag of the largest cross-correlation of (v_y, v_z).

    Positive: the response lags.  A parabola through the maximum and its neighbours refines it below the period.
    """
    time = data["time"].values
    period = float(time[1] - time[0])
    lags = np.arange(-round(LARGEST_DELAY / period), round(LARGEST_DELAY / period) + 1)
    start, end = np.searchsorted(time, [0.0, data.attrs["end_time_s"]])
    start, end = max(start, lags[-1]), min(end, len(time) - lags[-1])
    command = data["v_cmd"].values[start:end, :2]
    response = data["v"].values[:, :2]
    score = np.array([np.sum(command * response[start + lag : end + lag]) for lag in lags])
    best = int(np.argmax(score))
    if not 0 < best < len(lags) - 1:
        return float(lags[best] * period)
    left, top, right = score[best - 1 : best + 2]
    return float((lags[best] + 0.5 * (left - right) / (left - 2 * top + right)) * period)


def endpoint_vibration(data: Recording) -> float:
    """RMS velocity of the tool in y and z after the command has stopped, over `VIBRATION_WINDOW` [m/s]."""
    end = data.attrs["end_time_s"]
    after = data["v"].sel(time=slice(end, end + VIBRATION_WINDOW), axis=["y", "z"]).values
    return float(np.sqrt(np.mean(np.sum(after**2, axis=-1))))


def max_torque(data: Recording) -> Floats:
    """Largest |torque| of each joint from the start of the motion to its end [N·m]."""
    moving = data["tau"].sel(time=slice(0.0, data.attrs["end_time_s"])).values
    return np.abs(moving).max(axis=0)


def saturated(data: Recording) -> float:
    """How long a joint's torque was at its limit, |τ| ≥ `SATURATED` τ_max, in all, of the joint with the longest [s].

    Counts from the start of the motion until the block leaves the blade or the blade hits the table, whichever comes
    first: what is saturated later is not why a flip failed.  nan where the recording does not say its limits.
    """
    limit = data["tau"].attrs.get("limit")
    if limit is None:
        return np.nan
    time, blade = data["time"].values, touching(data, "table-blade")
    hit = blade & (time >= 0)
    end = min(release_index(data), int(np.argmax(hit)) if hit.any() else len(time))
    at = np.abs(data["tau"].values) >= SATURATED * np.atleast_1d(limit)
    start = int(np.searchsorted(time, 0.0))
    return float(at[start : end + 1].sum(axis=0).max(initial=0) * (time[1] - time[0]))


def measure(data: Recording) -> FlipMetrics:
    """All metrics of one recording."""
    success, failure = judge(data)
    slip, lift = slip_and_lift(data)
    k = release_index(data)
    return FlipMetrics(
        architecture=data.attrs["architecture"],
        start_y_m=float(data.attrs["start_y_m"]),
        success=success,
        failure=failure,
        touchdown=touchdown(data),
        position_rmse_m=rmse(data, "x", "x_cmd", ["y", "z"]),
        angle_rmse_rad=rmse(data, "x", "x_cmd", ["theta"]),
        acceleration_rmse_m_s2=rmse(data, "a", "a_cmd", ["y", "z"]),
        max_torque_Nm=max_torque(data).tolist(),
        saturated_s=saturated(data),
        max_slip_m=slip,
        max_lift_off_m=lift,
        release_time_s=float(data["time"].values[k]),
        release_angle_rad=float(data["x"].values[k, 2]),
        contact_after_release_s=contact_after_release(data),
        landing_cost_J=landing_cost(data),
        velocity_delay_s=velocity_delay(data),
        endpoint_vibration_m_s=endpoint_vibration(data),
    )
