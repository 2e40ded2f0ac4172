"""Where each controller stops working: maps of real flips, and how far the verdict depends on solver and estimates."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.borders.maps import Map, maps_of
from flipdiagram.studies.borders.variations import Variation, variations_of
from flipdiagram.studies.study import Progress, silent

VARIATIONS = "variations"
"""Name of the table of solvers and estimates among the maps."""
QUICK_MAPS = ("disturbance", "inertia")
QUICK_RESOLUTION = 2
NUMBERS = ("position_rmse_m", "acceleration_rmse_m_s2", "max_slip_m", "velocity_delay_s", "endpoint_vibration_m_s")
"""Metrics that a map keeps beside the verdict."""


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    maps: Sequence[str] | None = None,
    resolution: int | None = None,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
) -> None:
    """Fly every cell of the maps under every architecture, and the variations; write summary.json.

    maps: names of `maps_of`, and "variations"; by default all.  resolution: points per axis.  What an earlier call
    left in `out` is used.  A cell without a motion, or that diverges, is an outcome.  Raises InputError.
    """
    known = maps_of(scenario, QUICK_RESOLUTION if quick and resolution is None else resolution)
    valid = [*known, VARIATIONS]
    names = list(maps) if maps is not None else QUICK_MAPS if quick else valid
    if unknown := [name for name in names if name not in valid]:
        message = f"unknown map '{unknown[0]}'; choose from {', '.join(valid)}"
        raise InputError(message, field="maps", value=unknown[0], valid=valid)
    build_loop(scenario)  # what is wrong with the scenario itself shows before anything is computed
    asked = [known[name] for name in dict.fromkeys(names) if name in known]
    variations = list(variations_of(scenario)) if VARIATIONS in names else []

    flips = [
        cell(scenario, a_map, i, j, name)
        for a_map in asked
        for name in ARCHITECTURES
        for j in range(len(a_map.y.values))
        for i in range(len(a_map.x.values))
    ]
    flips += [Flip(scenario.with_overrides(v.overrides), name) for name in ARCHITECTURES for v in variations]
    outcomes = iter(run_flips(flips, Path(out), jobs=jobs, progress=progress))
    cells = [
        {name: [[next(outcomes) for _ in a_map.x.values] for _ in a_map.y.values] for name in ARCHITECTURES}
        for a_map in asked
    ]
    varied = {name: [next(outcomes) for _ in variations] for name in ARCHITECTURES}
    body = {
        "quick": quick,
        "maps": [map_summary(*pair) for pair in zip(asked, cells, strict=True)],
        "variations": variation_summary(variations, varied),
    }
    write_summary(Path(out) / "summary.json", "borders", scenario, body)


def cell(scenario: Scenario, a_map: Map, i: int, j: int, architecture: str) -> Flip:
    """The flip of one cell, column i and row j; run alone it gives the same numbers as in the map."""
    return Flip(scenario.with_overrides({**a_map.x.overrides[i], **a_map.y.overrides[j]}), architecture)


def map_summary(a_map: Map, cells: dict[str, list[list[Outcome]]]) -> dict[str, Any]:
    """The entry of a map; cells: outcomes by architecture, rows along y, columns along x."""
    tables: dict[str, Any] = {}
    for name, rows in cells.items():
        entries = [[_entry(outcome) for outcome in row] for row in rows]
        tables[name] = {key: [[entry[key] for entry in row] for row in entries] for key in entries[0][0]}
    return asdict(a_map) | {"architectures": tables}


def _entry(outcome: Outcome) -> dict[str, Any]:
    """Verdict and metrics of a flip; None where nothing was measured."""
    numbers = {name: outcome.metrics and float(getattr(outcome.metrics, name)) for name in NUMBERS}
    return {"success": outcome.success, "failure": outcome.failure, **numbers}


def variation_summary(variations: Sequence[Variation], varied: dict[str, list[Outcome]]) -> list[dict[str, Any]]:
    """Each variation with its verdicts; fragile where one differs from the first, the scenario as it is."""
    rows: list[dict[str, Any]] = []
    for k, variation in enumerate(variations):
        runs = {}
        for name, outcomes in varied.items():
            metrics = outcomes[k].metrics
            runs[name] = _entry(outcomes[k]) | {"max_torque_joint_2_Nm": metrics and metrics.max_torque_Nm[1]}
        fragile = [name for name in runs if rows and runs[name]["success"] != rows[0]["runs"][name]["success"]]
        rows.append(asdict(variation) | {"fragile": fragile, "runs": runs})
    return rows
