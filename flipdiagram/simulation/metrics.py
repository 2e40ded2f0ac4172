"""What is measured of a recorded flip: pure functions of the recording, never of the plan's promises."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.simulation.events import Touchdown, at_limit, release_index, strike_index, touchdown, touching
from flipdiagram.simulation.recording import FLIP, Recording, in_tool, kind_of
from flipdiagram.simulation.verdict import judge

APART = 0.005
"""Seconds without contact after which the block counts as released."""
VIBRATION_WINDOW = 0.2
"""Seconds after the end of the trajectory in which endpoint vibration is measured, and torque still counts."""
LARGEST_DELAY = 0.1
"""Range of lags [s] searched by `velocity_delay`."""


@dataclass(frozen=True)
class FlipMetrics:
    """The `runs` entry of summary.json; see the functions below for the definitions.

    Names with `meas` take the tool as the controller measures it, by its encoders and velocity filter, as the paper
    does; the others take the true one.  max_torque_cmd_Nm is what the controller asked for before the torque limit.
    """

    architecture: str
    start_y_m: float
    success: bool
    failure: str | None
    touchdown: Touchdown | None
    position_rmse_m: float
    angle_rmse_rad: float
    acceleration_rmse_m_s2: float
    position_rmse_meas_m: float
    acceleration_rmse_meas_m_s2: float
    max_torque_Nm: list[float]
    max_torque_cmd_Nm: list[float]
    saturated_s: float
    max_slip_m: float
    max_lift_off_m: float
    release_time_s: float
    release_angle_rad: float
    contact_after_release_s: float
    landing_cost_J: float
    velocity_delay_s: float
    velocity_delay_meas_s: float
    endpoint_vibration_m_s: float
    endpoint_vibration_meas_m_s: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)


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
    wanted = max(round(APART / period), 1)
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


def velocity_delay(data: Recording, signal: str = "v") -> float:
    """Delay of a velocity of the tool behind its command [s]: the lag of the largest cross-correlation of (v_y, v_z).

    Positive: the response lags.  A parabola through the maximum and its neighbours refines it below the period.
    """
    time = data["time"].values
    period = float(time[1] - time[0])
    lags = np.arange(-round(LARGEST_DELAY / period), round(LARGEST_DELAY / period) + 1)
    start, end = np.searchsorted(time, [0.0, data.attrs["end_time_s"]])
    start, end = max(start, lags[-1]), min(end, len(time) - lags[-1])
    command = data["v_cmd"].values[start:end, :2]
    response = data[signal].values[:, :2]
    if end <= start:  # recorded for too short a time to say
        return float("nan")
    score = np.array([np.sum(command * response[start + lag : end + lag]) for lag in lags])
    best = int(np.argmax(score))
    if not 0 < best < len(lags) - 1:
        return float(lags[best] * period)
    left, top, right = score[best - 1 : best + 2]
    return float((lags[best] + 0.5 * (left - right) / (left - 2 * top + right)) * period)


def endpoint_vibration(data: Recording, signal: str = "v") -> float:
    """RMS velocity of the tool in y and z after the command has stopped, over `VIBRATION_WINDOW` [m/s]."""
    end = data.attrs["end_time_s"]
    after = data[signal].sel(time=slice(end, end + VIBRATION_WINDOW), axis=["y", "z"]).values
    return float(np.sqrt(np.mean(np.sum(after**2, axis=-1)))) if after.size else float("nan")


def max_torque(data: Recording, signal: str = "tau") -> Floats:
    """Largest |torque| of each joint [N·m], from the start of the motion to its end and the stop there.

    signal: "tau" as it is applied, "tau_cmd" before the limit.
    """
    window = slice(0.0, data.attrs["end_time_s"] + VIBRATION_WINDOW)
    return np.abs(data[signal].sel(time=window).values).max(axis=0)


def saturated(data: Recording) -> float:
    """How long a joint's torque was at its limit in all, of the joint with the longest [s].

    Counts from the start of the motion until the block leaves the blade or the blade hits the table, whichever comes
    first: what is saturated later is not why a flip failed.  nan where the recording does not say its limits.
    """
    at, hit = at_limit(data), strike_index(data)
    if at is None:
        return np.nan
    end = release_index(data) if hit is None else min(release_index(data), hit)
    return float(at[end].max(initial=0))


def check_moves(data: Recording) -> None:
    """InputError for a recording without a sample of the motion."""
    time, end = data["time"].values, data.attrs["end_time_s"]
    if not ((time >= 0) & (time <= end)).any():
        span, valid = f"{time[0]:g} to {time[-1]:g} s", f"one that holds some of the motion, 0 to {end:g} s"
        raise InputError.of("recording", span, valid, f"a recording from {span} cannot be judged")


def measure(data: Recording) -> FlipMetrics:
    """All metrics of the recording of a flip; raises InputError for one of something else."""
    if (kind := kind_of(data)) != FLIP:
        valid = f"a flip; `recording.flip.metrics()` measures a '{kind}'"
        raise InputError.of("recording", kind, valid, f"a recording of kind '{kind}' is not judged as a flip")
    check_moves(data)
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
        position_rmse_meas_m=rmse(data, "x_meas", "x_cmd", ["y", "z"]),
        acceleration_rmse_meas_m_s2=rmse(data, "a_meas", "a_cmd", ["y", "z"]),
        max_torque_Nm=max_torque(data).tolist(),
        max_torque_cmd_Nm=max_torque(data, "tau_cmd").tolist(),
        saturated_s=saturated(data),
        max_slip_m=slip,
        max_lift_off_m=lift,
        release_time_s=float(data["time"].values[k]),
        release_angle_rad=float(data["x"].values[k, 2]),
        contact_after_release_s=contact_after_release(data),
        landing_cost_J=landing_cost(data),
        velocity_delay_s=velocity_delay(data),
        velocity_delay_meas_s=velocity_delay(data, "v_meas"),
        endpoint_vibration_m_s=endpoint_vibration(data),
        endpoint_vibration_meas_m_s=endpoint_vibration(data, "v_meas"),
    )
