"""Section III: what each block does to gain, phase, error, torque and noise (Figs 5–10), and the claims C1–C14."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path, write_summary
from flipdiagram.flips.flip import code_version
from flipdiagram.scenario.one_dof import Frequency, OneDof
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.frequency import realisations
from flipdiagram.studies.frequency.broadband import Spectrum, noise_spectrum
from flipdiagram.studies.frequency.claims import Claim, acceleration_gain, evaluate, phase
from flipdiagram.studies.frequency.curves import curves_of, friction_curves, torque_of
from flipdiagram.studies.frequency.laboratory import Factory, Kind, Laboratory, Loop, Measured
from flipdiagram.studies.frequency.realisations import Realisation
from flipdiagram.studies.frequency.sweep import Response

QUICK = {"frequency.lowest": 1.0, "frequency.count": 24, "frequency.torque_count": 9, "frequency.noise_time": 20.0}
"""The scenario of a quick run; it also leaves out the table of realisations and the other friction model."""
SOURCES = (
    "blocks",
    "compiled",
    "diagrams/arrows",
    "diagrams/one_dof",
    "plants",
    "scenario",
    "studies/frequency",
    "theory",
)
"""Modules whose code decides what this study measures."""
Progress = Callable[[str], None]


@dataclass(frozen=True)
class FrequencyResult:
    """All that one study measured.  `rows` and `other_friction` are empty after a quick run.

    unsteady: an entry of summary.json for each response that missed the criterion, with what it does instead.
    """

    scenario: Scenario
    out: Path
    measured: Measured
    claims: list[Claim]
    rows: list[Realisation]
    other_friction: Measured | None
    spectra: dict[Loop, Spectrum]
    unsteady: list[dict[str, Any]]
    quick: bool
    steps: int
    channel_steps_per_s: float
    seconds: float

    def summary(self) -> dict[str, Any]:
        """The body of summary.json."""
        body = {
            "code": code_version(SOURCES),
            "quick": self.quick,
            "curves": curves_of(self.measured),
            "torque": torque_of(self.measured),
            "claims": [claim.as_dict() for claim in self.claims],
            "observer": realisations.observer(self.measured.settings),
            "channel_steps_per_s": self.channel_steps_per_s,
            "channel_steps": self.steps,
            "seconds": self.seconds,
            "measurement": _measurement(self.measured) | {"unsteady": self.unsteady},
            "broadband": [
                {
                    "architecture": name,
                    "g_dis_rad_s": g or None,
                    "omega_rad_s": spectrum.omega,
                    "value": spectrum.gain,
                    "theory": np.abs(self.measured.theory((name, g)).noise(spectrum.omega)),
                    "segments": spectrum.segments,
                }
                for (name, g), spectrum in self.spectra.items()
            ],
        }
        if self.rows:
            body["realisations"] = [row.as_dict() for row in self.rows]
            body["best_realisation"] = realisations.best(self.rows).name
        if self.other_friction is not None:
            models = compare_friction(self.measured, self.other_friction)
            body["friction_models"] = models | {"curves": friction_curves(self.other_friction)}
        return body

    def write(self) -> None:
        """Write summary.json and frequency.nc."""
        write_summary(self.out / "summary.json", "frequency", self.scenario, self.summary())
        with atomic_path(self.out / "frequency.nc") as temporary:
            dataset(self.measured).to_netcdf(temporary, engine="scipy")


def run(
    scenario: Scenario, out: str | Path, *, quick: bool = False, progress: Progress = lambda text: None
) -> FrequencyResult:
    """Measure Figs 5–10 and the claims; write summary.json and frequency.nc.

    Raises InputError for bad settings and SimulationError for an unstable loop, naming the loop and its pole.
    """
    begin = time.perf_counter()
    if quick:
        scenario = scenario.with_overrides(_quick(scenario))
    settings, study = scenario.one_dof, scenario.frequency
    laboratory = Laboratory(settings, study)
    rooms = {} if quick else realisations.laboratories(settings, study)
    rough = None if quick else _other_friction(settings, study)
    everything = [laboratory, *([rough] if rough else []), *rooms.values()]
    laboratory.stable(laboratory.loops(sorted({settings.g_dis, *study.g_dis})))
    measured = realisations.measure_all(laboratory, progress)
    progress("responses to broadband noise")
    loops = [loop for loop in measured.noise if loop[0] != "pd+ff+dob" or loop[1] == settings.g_dis]
    spectra = {loop: noise_spectrum(laboratory, loop) for loop in loops}
    other = None
    if rough is not None:
        progress(f"responses with {rough.settings.friction_model} friction")
        rough_responses = rough.command(rough.loops((settings.g_dis,)), study.frequencies(), friction=True)
        other = Measured(rough.settings, study, friction=rough_responses)
    rows = realisations.table(rooms, progress)
    progress("what unsteady responses do")
    unsteady = unsteady_responses(laboratory, measured)
    if rough is not None and other is not None:
        unsteady += unsteady_responses(rough, other)
    steps = sum(room.steps for room in everything)
    result = FrequencyResult(
        scenario,
        Path(out),
        measured,
        evaluate(measured),
        rows,
        other,
        spectra,
        unsteady,
        quick,
        steps,
        laboratory.sweep_steps / laboratory.seconds,
        time.perf_counter() - begin,
    )
    result.write()
    return result


def stored(scenario: Scenario, out: str | Path, *, quick: bool = False) -> dict[str, Any] | None:
    """The summary that an earlier run left in `out`, where this code would measure the same again; else None."""
    if quick:
        scenario = scenario.with_overrides(_quick(scenario))
    try:
        summary: dict[str, Any] = json.loads((Path(out) / "summary.json").read_text(encoding="utf-8"))
        same = summary["code"] == code_version(SOURCES) and summary["scenario"] == scenario.model_dump(mode="json")
        return summary if same and summary["quick"] is quick else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def compare(controllers: Mapping[str, Factory], scenario: Scenario, *, friction: bool = False) -> dict[str, Response]:
    """Command responses of controllers of your own, by name, on the study's frequencies; see one_dof_loop for ports.

    A factory makes a new controller for the loop's settings at each call: `lambda settings: MyController()`.  Names
    of the four architectures may stand beside them with `one_dof_loop.build_controller` as factory.
    """
    if not controllers:
        raise InputError("controllers = {}; give at least one factory by name")
    laboratory = Laboratory(scenario.one_dof, scenario.frequency, controllers)
    loops = laboratory.loops((scenario.one_dof.g_dis,))
    responses = laboratory.command(loops, scenario.frequency.frequencies(), friction=friction)
    return {name: response for (name, _), response in responses.items()}


def unsteady_responses(laboratory: Laboratory, measured: Measured) -> list[dict[str, Any]]:
    """The responses whose windows differ by more than the tolerance: by how much, and what they do; see periodicity."""
    entries = []
    kinds: dict[Kind, dict[Loop, Response]]
    kinds = {"linear": measured.linear, "friction": measured.friction, "noise": measured.noise}
    for kind, responses in kinds.items():
        for (name, g), response in responses.items():
            odd = np.flatnonzero(~response.steady)
            for i, repetition in zip(odd, laboratory.repetitions((name, g), response, kind), strict=True):
                entry = {"kind": kind, "architecture": name, "g_dis_rad_s": g or None}
                entry |= {"friction_model": measured.settings.friction_model} if kind == "friction" else {}
                entry |= {"omega_rad_s": response.omega[i], "spread": response.spread[i]}
                entry |= {"spread_of_fundamental": response.spread_x[i], "verdict": repetition.verdict}
                entry |= {"judged_at_omega_rad_s": repetition.omega, "repeats_after_periods": repetition.periods}
                entries.append(entry | {"windows": repetition.windows, "spread_there": repetition.spread})
    return entries


def compare_friction(one: Measured, other: Measured) -> dict[str, Any]:
    """Gain at the lowest frequency and largest difference of gain and phase between two friction models."""
    models = one.settings.friction_model, other.settings.friction_model
    comparison: dict[str, Any] = {"figures_6_and_8": models[0], "other": models[1]}
    for loop in other.friction:
        a, b = one.friction[loop], other.friction[loop]
        gains, phases = (acceleration_gain(a), acceleration_gain(b)), (phase(a), phase(b))
        comparison[loop[0]] = {
            "omega_rad_s": float(a.omega[0]),
            "gain_at_lowest": dict(zip(models, (float(gain[0]) for gain in gains), strict=True)),
            "same_gain_within_5_percent_above_rad_s": _agree_above(a.omega, gains[0], gains[1], 0.05),
            "largest_phase_difference_rad": float(np.max(np.abs(phases[0] - phases[1]))),
            "rms_error_at_lowest_m": [float(a.rms_error[0]), float(b.rms_error[0])],
        }
    return comparison


def dataset(measured: Measured) -> xr.Dataset:
    """Every response as an xarray.Dataset: linear_…, friction_…, noise_… (loop, omega), torque_… (omega, g_dis)."""
    kinds = {"linear": measured.linear, "friction": measured.friction, "noise": measured.noise}
    loops = list(measured.linear)
    variables: dict[str, Any] = {}
    units = {"peak_x": "m", "peak_a": "m/s2", "peak_force": "N", "rms_error": "m", "spread": "1", "ticks": "1"}
    for kind, responses in kinds.items():
        for name, unit in units.items():
            values = np.stack([getattr(responses[loop], name) for loop in loops]).astype(float)
            variables[f"{kind}_{name}"] = (("loop", "omega"), values, {"units": unit})
        phasors = np.stack([responses[loop].x for loop in loops])
        variables[f"{kind}_x_amplitude"] = (("loop", "omega"), np.abs(phasors), {"units": "m"})
        variables[f"{kind}_x_phase"] = (("loop", "omega"), np.angle(phasors), {"units": "rad"})
        steady = np.stack([responses[loop].steady for loop in loops]).astype(np.int8)
        variables[f"{kind}_steady"] = (("loop", "omega"), steady, {"units": "1"})
    for name, values in measured.torque.items():
        spread = np.broadcast_to(values, (len(measured.torque_omega), len(measured.torque_g_dis))).copy()
        variables[f"torque_{name.replace('+', '_')}"] = (("torque_omega", "torque_g_dis"), spread, {"units": "N"})
    return xr.Dataset(
        variables,
        coords={
            "omega": ("omega", measured.linear[loops[0]].omega, {"units": "rad/s"}),
            "architecture": ("loop", [name for name, _ in loops]),
            "g_dis": ("loop", [g for _, g in loops], {"units": "rad/s"}),
            "torque_omega": ("torque_omega", measured.torque_omega, {"units": "rad/s"}),
            "torque_g_dis": ("torque_g_dis", measured.torque_g_dis, {"units": "rad/s"}),
        },
        attrs={"noise_amplitude_m_s": measured.study.noise_amplitude, "phase": "relative to sin(omega t)"},
    )


def _quick(scenario: Scenario) -> dict[str, Any]:
    study, changes = scenario.frequency, dict(QUICK)
    if study.omega is not None or not study.lowest <= changes["frequency.lowest"] < study.highest:
        del changes["frequency.lowest"]
    for path in ("count", "torque_count", "noise_time"):
        changes[f"frequency.{path}"] = min(changes[f"frequency.{path}"], getattr(study, path))
    return changes


def _other_friction(settings: OneDof, study: Frequency) -> Laboratory:
    """A laboratory with the friction model that the settings do not choose."""
    model = "stick-slip" if settings.friction_model == "signum" else "signum"
    return Laboratory(settings.model_copy(update={"friction_model": model}), study)


def _agree_above(omega: Any, one: Any, other: Any, part: float) -> float | None:
    """The frequency from which on two curves agree within a part; None where they do not at the end."""
    apart = np.nonzero(np.abs(one / other - 1) > part)[0]
    last = -1 if not apart.size else int(apart[-1])
    return float(omega[last + 1]) if last + 1 < len(omega) else None


def _measurement(measured: Measured) -> dict[str, Any]:
    """How far the figures can be trusted: windows, and the sampled peak beside the fundamental."""
    linear = list(measured.linear.values())
    peak = max(float(np.max(np.abs(r.peak_a / np.abs(r.a) - 1))) for r in linear)
    return {
        "tolerance": measured.study.tolerance,
        "largest_part_of_a_period_missing_in_a_window": max(float(np.max(np.abs(r.rest))) for r in linear),
        "largest_difference_of_peak_and_fundamental_without_friction": peak,
        "largest_difference_of_fundamental_and_theory": max(
            float(np.max(np.abs(-r.x / measured.theory(loop).command(r.omega) - 1)))
            for loop, r in measured.linear.items()
        ),
        "torque_frequencies": "chosen below, at and above g_dis; the paper does not state its own",
    }
