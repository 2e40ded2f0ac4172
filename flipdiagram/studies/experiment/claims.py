"""The claims E1–E8 of section IV, judged from the measured runs alone, each with the paper's number beside ours.

Positions, velocities and accelerations are judged as the paper measures them, by the motors' encoders and the velocity
filter, and torque before its limit; what is true of the tool is said beside it where it differs.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flipdiagram.flips.outcome import Outcome, mode_of
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.simulation.verdict import SLIDES

JOINT_2 = 1
MUCH = 2.0
"""'Much smaller' (E2): less than one part in this."""
SLIGHT = 0.02
"""'Slightly' (E3): lag or lead of at most this [s]."""
HARDLY = 0.15
"""'Hardly changes' (E6): the last start within this fraction of the mean, as 1.18 of 1.10 cm is within 7 %."""
DIFFERENT = 0.01
"""Relative difference below which two numbers count as equal."""
FACTOR = 2.0
"""Factor between the paper's number and ours from which the difference wants an explanation."""

MEASURED = {
    "position_rmse_m": "position_rmse_meas_m",
    "acceleration_rmse_m_s2": "acceleration_rmse_meas_m_s2",
    "velocity_delay_s": "velocity_delay_meas_s",
    "endpoint_vibration_m_s": "endpoint_vibration_meas_m_s",
    "max_torque_Nm": "max_torque_cmd_Nm",
}
"""Metrics of the true tool, and of the torque applied, by what the paper measures instead."""

FILTER = "the velocity filter makes most of it: 10 Hz alone turns 0.29 cm with exact velocities into 1.02"
"""Of E6: the default of the first versions, examples/ideal_servo.yaml, with sensors.velocity_cutoff 62.8."""

BOTH, DOB, FF, PD = "pd+ff+dob", "pd+dob", "pd+ff", "pd"
WITH_OBSERVER = (DOB, BOTH)
TEXTS = {
    "E1": ("FF+DOB and DOB turn the block over; FF and PD alone drop it at the beginning", "2 of 4, one start"),
    "E2": ("with DOB the error from the commanded trajectory is much smaller", "Fig. 13, no number"),
    "E3": ("velocity: DOB without FF lags slightly, FF+DOB leads slightly", "Fig. 14, no number"),
    "E4": ("vibration at the end of the trajectory is smaller with FF", "Figs 13 and 14, no number"),
    "E5": ("acceleration RMSE with FF below that without", "4.65 against 4.81 m/s²"),
    "E6": ("position RMSE of FF+DOB hardly changes over the starts", "1.10 ± 0.15 cm, last 1.18 cm"),
    "E7": ("maximum torque of joint 2 is lower with FF", "205 against 224 N m"),
    "E8": ("all this with the planner restricted to (7), no sliding, up to θ > π/2", "section II-B"),
}
"""What is claimed, and the paper's number."""


Judgement = tuple[bool | None, str, dict[str, Any], str]
"""Whether a claim holds (None: not judged), the sentence measured, its numbers, what may explain a difference."""


def run_entry(start_y: float, architecture: str, outcome: Outcome) -> dict[str, Any]:
    """The `runs` entry of one flip from a start [m]: that of a turnover, or why there is none."""
    head = {"architecture": architecture, "start_y_m": start_y, "success": outcome.success}
    measured = outcome.metrics.as_dict() if outcome.metrics else {"failure": outcome.failure}
    return head | measured | {"plan": outcome.plan}


class Runs:
    """The `runs` entries by architecture."""

    def __init__(self, entries: Sequence[dict[str, Any]]) -> None:
        self.all = sorted(entries, key=lambda run: run["start_y_m"])

    def of(self, architecture: str) -> list[dict[str, Any]]:
        """Those of an architecture, in the order of the starts."""
        return [run for run in self.all if run["architecture"] == architecture]

    def values(self, architecture: str, metric: str) -> np.ndarray:
        """A metric of every start that was measured, nan for null; of torques that of joint 2."""
        values = np.array([run[metric] for run in self.of(architecture) if metric in run], dtype=float)
        return values[:, JOINT_2] if values.ndim == 2 else values

    def means(self, metric: str, architectures: Sequence[str]) -> dict[str, float]:
        """Its means over the starts."""
        return {name: float(self.values(name, metric).mean()) for name in architectures}

    def successes(self, architecture: str) -> tuple[int, int]:
        """(turned over, tried)."""
        return sum(run["success"] for run in self.of(architecture)), len(self.of(architecture))


def claims_of(entries: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """E1–E8 of `runs` entries as the `claims` of summary.json; none unless all four architectures were run.

    What lacks a measured run to compare is not judged.
    """
    if {run["architecture"] for run in entries} != set(ARCHITECTURES):
        return []
    claims, runs = [], Runs(entries)
    numbers: dict[str, Any]
    for id, (text, paper) in TEXTS.items():
        needed = {"E1": (), "E2": ARCHITECTURES, "E6": (BOTH,)}.get(id, WITH_OBSERVER)
        if absent := [name for name in needed if not runs.values(name, "position_rmse_m").size]:
            holds, measured, numbers, difference = None, f"not judged: nothing measured of {', '.join(absent)}", {}, ""
        else:
            holds, measured, numbers, difference = JUDGES[id](runs)
        claim = {"id": id, "text": text, "holds": holds, "measured": measured, "paper": paper}
        claims.append(claim | {"numbers": numbers, "difference": difference})
    return claims


def _e1(runs: Runs) -> Judgement:
    # the paper's block slides off: a failure of another kind makes the same verdicts another claim
    successes = {name: runs.successes(name) for name in ARCHITECTURES}
    as_told = all(won == (tried if name in WITH_OBSERVER else 0) for name, (won, tried) in successes.items())
    causes = Counter(mode_of(run["failure"]) for run in runs.all if not run["success"])
    slides = sum(causes[cause] for cause in SLIDES)
    verdicts = ", ".join(f"{name} {won} of {tried}" for name, (won, tried) in successes.items())
    counted = ", ".join(f"{count} {cause}" for cause, count in causes.most_common())
    reason = "" if slides == causes.total() else "the paper's block slid off; " + _instead(causes)
    measured = verdicts + (f"; of the others {counted}" if counted else "")
    holds = as_told and slides == causes.total()
    return holds, measured, {"successes": successes, "causes": dict(causes)}, reason


def _instead(causes: Mapping[str, int]) -> str:
    """Why blocks were lost otherwise than by sliding."""
    struck = causes.get("struck the table", 0)
    if not struck:
        return "here none of those lost only slid"
    sag = "without an observer gravity lets the arm sag by more than the clearance that was planned"
    return f"here in {struck} of {sum(causes.values())} failures the blade struck the table first: {sag}"


def _e2(runs: Runs) -> Judgement:
    means = runs.means("position_rmse_meas_m", ARCHITECTURES)
    holds = max(means[DOB], means[BOTH]) * MUCH < min(means[PD], means[FF])
    measured = ", ".join(f"{name} {100 * value:.2f} cm" for name, value in means.items())
    measured += _true(runs, "position_rmse_m", ARCHITECTURES, "cm", 100)
    return holds, measured, {"position_rmse_m": means}, ""


def _e3(runs: Runs) -> Judgement:
    delays = runs.means("velocity_delay_meas_s", WITH_OBSERVER)
    lags, leads = 0 < delays[DOB] <= SLIGHT, -SLIGHT <= delays[BOTH] < 0
    said = {name: f"{'lags' if delay > 0 else 'leads'} {1000 * abs(delay):.1f} ms" for name, delay in delays.items()}
    difference = "" if leads else "FF shortens the lag; whether it becomes a lead depends on velocity filter and M_n"
    numbers = {"velocity_delay_s": delays, "lags": lags, "leads": leads}
    measured = f"DOB {said[DOB]}, FF+DOB {said[BOTH]}" + _true(runs, "velocity_delay_s", WITH_OBSERVER, "ms", 1000)
    return lags and leads, measured, numbers, difference


def _e4(runs: Runs) -> Judgement:
    holds, means, _ = _less_with_ff(runs, "endpoint_vibration_meas_m_s")
    measured = f"DOB {1000 * means[DOB]:.1f} mm/s, FF+DOB {1000 * means[BOTH]:.1f} mm/s, RMS over 0.2 s after the end"
    measured += _true(runs, "endpoint_vibration_m_s", WITH_OBSERVER, "mm/s", 1000)
    return holds, measured, {"endpoint_vibration_m_s": means}, ""


def _e5(runs: Runs) -> Judgement:
    # the default of the first versions (examples/ideal_servo.yaml) with sensors.velocity_cutoff 62.8, first start
    why = "the velocity filter makes most of it: 10 Hz alone turns 1.58 with exact velocities into 4.49 (true)"
    holds, means, difference = _less_with_ff(runs, "acceleration_rmse_meas_m_s2", (4.65, 4.81), why)
    measured = f"FF+DOB {means[BOTH]:.2f}, DOB {means[DOB]:.2f} m/s²"
    measured += _true(runs, "acceleration_rmse_m_s2", WITH_OBSERVER, "m/s²")
    return holds, measured, {"acceleration_rmse_m_s2": means}, difference


def _e6(runs: Runs) -> Judgement:
    values = runs.values(BOTH, "position_rmse_meas_m")
    mean, sd = float(values.mean()), float(values.std(ddof=1)) if values.size > 1 else 0.0
    last, starts = float(values[-1]), len({run["start_y_m"] for run in runs.all})
    difference = _factor({"mean": 100 * mean / 1.10}, FILTER)
    numbers = {"mean_m": mean, "sd_m": sd, "last_m": last, "position_rmse_m": values.tolist()}
    true = _true(runs, "position_rmse_m", (BOTH,), "cm", 100)
    if starts < 2:
        return None, f"not judged: {100 * mean:.2f} cm{true}, a single start", numbers, difference
    measured = f"{100 * mean:.2f} ± {100 * sd:.2f} cm over {values.size} starts, last {100 * last:.2f} cm{true}"
    return values.size == starts and abs(last / mean - 1) <= HARDLY, measured, numbers, difference


def _e7(runs: Runs) -> Judgement:
    why = "our link inertias and masses are estimates, and the paper does not say how its torque was measured"
    holds, means, difference = _less_with_ff(runs, "max_torque_cmd_Nm", (205.0, 224.0), why)
    measured = f"FF+DOB {means[BOTH]:.1f}, DOB {means[DOB]:.1f} N m"
    measured += _true(runs, "max_torque_Nm", WITH_OBSERVER, "N m", word="applied")
    return holds, measured, {"max_torque_joint_2_Nm": means}, difference


def _true(
    runs: Runs, metric: str, architectures: Sequence[str], unit: str, factor: float = 1.0, word: str = "true"
) -> str:
    """What is true of the tool, in brackets, where it is not what was measured."""
    means = runs.means(metric, architectures)
    measured = runs.means(MEASURED[metric], architectures)
    if all(abs(measured[name] - value) <= DIFFERENT * abs(value) for name, value in means.items()):
        return ""
    return f" ({word}: {', '.join(f'{name} {factor * value:.2f}' for name, value in means.items())} {unit})"


def _e8(runs: Runs) -> Judgement:
    plans = [run["plan"] for run in runs.of(BOTH) if "position_rmse_m" in run and run["plan"]]
    cone = max(p["max_sliding_angle_rad"] / p["friction_angle_rad"] for p in plans)
    release = min(p["release_angle_rad"] for p in plans)
    slip = max(float(runs.values(name, "max_slip_m").max()) for name in WITH_OBSERVER)
    won, tried = runs.successes(BOTH)
    measured = (
        f"planned |φ| up to {100 * cone:.0f} % of the friction angle until θ = {release:.2f} rad;"
        f" {won} of {tried} turned over, slip up to {1000 * slip:.1f} mm"
    )
    holds = cone < 1 and release > np.pi / 2 and won == tried
    return holds, measured, {"cone_use": cone, "release_angle_rad": release, "max_slip_m": slip}, ""


def _less_with_ff(
    runs: Runs, metric: str, paper: Sequence[float] = (), why: str = ""
) -> tuple[bool, dict[str, float], str]:
    """Whether a mean is less with FF, the means, and why they are off the paper's numbers with and without FF."""
    means = runs.means(metric, WITH_OBSERVER)
    pairs = zip(("with FF", "without"), (means[BOTH], means[DOB]), paper, strict=False)
    return means[BOTH] < means[DOB] * (1 - DIFFERENT), means, _factor({name: a / b for name, a, b in pairs}, why)


def _factor(ratios: Mapping[str, float], why: str) -> str:
    """The explanation, where a ratio of ours to the paper's number is off by more than `FACTOR`."""
    off = [f"{name} × {ratio:.2f}" for name, ratio in ratios.items() if not 1 / FACTOR <= ratio <= FACTOR]
    return f"against the paper {', '.join(off)}: {why}" if off else ""


JUDGES = dict(zip(TEXTS, (_e1, _e2, _e3, _e4, _e5, _e6, _e7, _e8), strict=True))
