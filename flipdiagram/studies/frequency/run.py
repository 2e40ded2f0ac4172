"""Section III: what each block does to gain, phase, error, torque and noise (Figs 5–10), and the claims C1–C14."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flipdiagram.files import atomic_path, write_summary
from flipdiagram.flips.flip import code_version
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.frequency import realisations
from flipdiagram.studies.frequency.broadband import noise_gains
from flipdiagram.studies.frequency.claims import acceleration_gain, evaluate, phase
from flipdiagram.studies.frequency.curves import curves_of, friction_curves, torque_of
from flipdiagram.studies.frequency.laboratory import Laboratory, Measured, closed_form
from flipdiagram.studies.frequency.realisations import Progress

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


def run(scenario: Scenario, out: str | Path, *, quick: bool = False, progress: Progress = lambda text: None) -> None:
    """Measure Figs 5–10 and the claims; write summary.json and frequency.nc.

    Raises InputError for bad settings and SimulationError for an unstable loop, naming the loop and its pole.
    """
    begin = time.perf_counter()
    scenario = _quick(scenario) if quick else scenario
    settings, study = scenario.one_dof, scenario.frequency
    laboratory = Laboratory(settings, study)
    measured = realisations.measure_all(laboratory, progress)
    progress("responses to broadband noise")
    body: dict[str, Any] = {
        "code": code_version(SOURCES),
        "quick": quick,
        "curves": curves_of(measured),
        "torque": torque_of(measured),
        "claims": evaluate(measured),
        "observer": realisations.observer(settings),
        "measurement": _measurement(measured),
        "broadband": noise_gains(laboratory, measured),
    }
    progress("what unsteady responses do")
    unsteady, steps = unsteady_responses(laboratory, measured), laboratory.steps
    if not quick:
        model = "stick-slip" if settings.friction_model == "signum" else "signum"
        rough = Laboratory(settings.model_copy(update={"friction_model": model}), study)
        progress(f"responses with {model} friction")
        responses = rough.responses(rough.loops((settings.g_dis,)), study.frequencies(), "friction")
        other = Measured(rough.settings, study, friction=responses)
        body["friction_models"] = compare_friction(measured, other) | {"curves": friction_curves(other)}
        unsteady += unsteady_responses(rough, other)
        rows, steps = [], steps + rough.steps
        for name, room in realisations.laboratories(settings, study).items():
            progress(f"realisation {name}")
            rows.append(realisations.judged(name, room))
            steps += room.steps
        body |= {"realisations": rows, "best_realisation": realisations.best(rows)["name"]}
    body["measurement"] |= {"unsteady": unsteady}
    body |= {"channel_steps_per_s": laboratory.sweep_steps / laboratory.seconds, "channel_steps": steps}
    folder, body["seconds"] = Path(out), time.perf_counter() - begin
    write_summary(folder / "summary.json", "frequency", scenario, body)
    with atomic_path(folder / "frequency.nc") as temporary:
        dataset(measured).to_netcdf(temporary, engine="scipy")


def stored(scenario: Scenario, out: str | Path, *, quick: bool = False) -> dict[str, Any] | None:
    """The summary that an earlier run left in `out`, where this code would measure the same again; else None."""
    scenario = _quick(scenario) if quick else scenario
    try:
        summary: dict[str, Any] = json.loads((Path(out) / "summary.json").read_text(encoding="utf-8"))
        same = summary["code"] == code_version(SOURCES) and summary["scenario"] == scenario.model_dump(mode="json")
        return summary if same and summary["quick"] is quick else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def unsteady_responses(laboratory: Laboratory, measured: Measured) -> list[dict[str, Any]]:
    """The responses whose windows differ by more than the tolerance: by how much, and what they do; see periodicity."""
    entries = []
    for kind, responses in measured.kinds.items():
        for (name, g), response in responses.items():
            odd = np.flatnonzero(~response.steady)
            for i, repetition in zip(odd, laboratory.repetitions((name, g), response, kind), strict=True):
                entry = {"kind": kind, "architecture": name, "g_dis_rad_s": g or None}
                entry |= {"friction_model": measured.settings.friction_model} if kind == "friction" else {}
                entry |= {"omega_rad_s": response.omega[i], "spread": response.spread[i]}
                entries.append(entry | {"spread_of_fundamental": response.spread_x[i]} | repetition)
    return entries


def compare_friction(one: Measured, other: Measured) -> dict[str, Any]:
    """Gain at the lowest frequency and largest difference of gain and phase between two friction models."""
    models = one.settings.friction_model, other.settings.friction_model
    comparison: dict[str, Any] = {"figures_6_and_8": models[0], "other": models[1]}
    for loop in other.friction:
        a, b = one.friction[loop], other.friction[loop]
        gains, phases = (acceleration_gain(a), acceleration_gain(b)), (phase(a), phase(b))
        first = int(np.max(np.flatnonzero(np.abs(gains[0] / gains[1] - 1) > 0.05), initial=-1)) + 1
        comparison[loop[0]] = {
            "omega_rad_s": float(a.omega[0]),
            "gain_at_lowest": dict(zip(models, (float(gain[0]) for gain in gains), strict=True)),
            "same_gain_within_5_percent_above_rad_s": float(a.omega[first]) if first < len(a.omega) else None,
            "largest_phase_difference_rad": float(np.max(np.abs(phases[0] - phases[1]))),
            "rms_error_at_lowest_m": [float(a.rms_error[0]), float(b.rms_error[0])],
        }
    return comparison


def dataset(measured: Measured) -> xr.Dataset:
    """Every response as an xarray.Dataset: linear_…, friction_…, noise_… (loop, omega), torque_… (omega, g_dis)."""
    loops = list(measured.linear)
    variables: dict[str, Any] = {}
    units = {"peak_x": "m", "peak_a": "m/s2", "peak_force": "N", "rms_error": "m", "spread": "1", "ticks": "1"}
    for kind, responses in measured.kinds.items():
        read = {name: np.stack([getattr(responses[loop], name) for loop in loops]) for name in (*units, "x", "steady")}
        columns = {name: (read[name].astype(float), unit) for name, unit in units.items()}
        columns |= {"x_amplitude": (np.abs(read["x"]), "m"), "x_phase": (np.angle(read["x"]), "rad")}
        columns |= {"steady": (read["steady"].astype(np.int8), "1")}
        for name, (values, unit) in columns.items():
            variables[f"{kind}_{name}"] = (("loop", "omega"), values, {"units": unit})
    for name, values in measured.torque.items():
        spread = np.broadcast_to(values, (len(measured.torque_omega), len(measured.torque_g_dis))).copy()
        variables[f"torque_{name.replace('+', '_')}"] = (("torque_omega", "torque_g_dis"), spread, {"units": "N"})
    return xr.Dataset(
        variables,
        coords={
            "omega": ("omega", measured.omega, {"units": "rad/s"}),
            "architecture": ("loop", [name for name, _ in loops]),
            "g_dis": ("loop", [g for _, g in loops], {"units": "rad/s"}),
            "torque_omega": ("torque_omega", measured.torque_omega, {"units": "rad/s"}),
            "torque_g_dis": ("torque_g_dis", measured.torque_g_dis, {"units": "rad/s"}),
        },
        attrs={"noise_amplitude_m_s": measured.study.noise_amplitude, "phase": "relative to sin(omega t)"},
    )


def _quick(scenario: Scenario) -> Scenario:
    study, changes = scenario.frequency, dict(QUICK)
    if study.omega is not None or not study.lowest <= changes["frequency.lowest"] < study.highest:
        del changes["frequency.lowest"]
    for path in ("count", "torque_count", "noise_time"):
        changes[f"frequency.{path}"] = min(changes[f"frequency.{path}"], getattr(study, path))
    return scenario.with_overrides(changes)


def _measurement(measured: Measured) -> dict[str, Any]:
    """How far the figures can be trusted: windows, and the sampled peak beside the fundamental."""
    linear = list(measured.linear.values())
    peak = max(float(np.max(np.abs(r.peak_a / np.abs(r.a) - 1))) for r in linear)
    return {
        "tolerance": measured.study.tolerance,
        "largest_part_of_a_period_missing_in_a_window": max(float(np.max(np.abs(r.rest))) for r in linear),
        "largest_difference_of_peak_and_fundamental_without_friction": peak,
        "largest_difference_of_fundamental_and_theory": max(
            float(np.max(np.abs(-r.x / closed_form(measured.settings, loop).command(r.omega) - 1)))
            for loop, r in measured.linear.items()
        ),
        "torque_frequencies": "chosen below, at and above g_dis; the paper does not state its own",
    }
