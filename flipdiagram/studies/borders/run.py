"""Where each controller stops working: maps of real flips, and how far the verdict depends on solver and estimates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Progress, run_flips
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.borders.maps import Axis, Map, maps_of
from flipdiagram.studies.borders.variations import Variation, variations_of

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
    progress: Progress = lambda text: None,
) -> None:
    """Fly every cell of the maps under every architecture, and the variations; write summary.json.

    maps: names of `maps_of`, and "variations"; by default all.  resolution: points per axis.  What an earlier call
    left in `out` is used.  A cell without a motion, or that diverges, is an outcome.  Raises InputError.
    """
    known = maps_of(scenario, QUICK_RESOLUTION if quick and resolution is None else resolution)
    names = list(maps) if maps is not None else [*QUICK_MAPS] if quick else [*known, VARIATIONS]
    for name in names:
        if name not in known and name != VARIATIONS:
            valid = [*known, VARIATIONS]
            message = f"unknown map '{name}'; choose from {', '.join(valid)}"
            raise InputError(message, field="maps", value=name, valid=valid)
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
    flips += [Flip(v.applied_to(scenario), name) for name in ARCHITECTURES for v in variations]
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
    return {
        "name": a_map.name,
        "title": a_map.title,
        "question": a_map.question,
        "x": _axis_summary(a_map.x),
        "y": _axis_summary(a_map.y),
        "architectures": {
            name: {
                "success": [[outcome.success for outcome in row] for row in rows],
                "failure": [[outcome.failure for outcome in row] for row in rows],
                **{number: [[_number(outcome, number) for outcome in row] for row in rows] for number in NUMBERS},
            }
            for name, rows in cells.items()
        },
    }


def _axis_summary(axis: Axis) -> dict[str, Any]:
    return {
        "label": axis.label,
        "values": list(axis.values),
        "logarithmic": axis.logarithmic,
        "overrides": [dict(fields) for fields in axis.overrides],
    }


def _number(outcome: Outcome, name: str) -> float | None:
    return None if outcome.metrics is None else float(getattr(outcome.metrics, name))


def variation_summary(variations: Sequence[Variation], varied: dict[str, list[Outcome]]) -> list[dict[str, Any]]:
    """Each variation with its verdicts; fragile where one differs from the first, the scenario as it is."""
    rows: list[dict[str, Any]] = []
    for k, variation in enumerate(variations):
        outcomes = {name: varied[name][k] for name in varied}
        verdicts = {name: outcome.success for name, outcome in outcomes.items()}
        rows.append(
            {
                "group": variation.group,
                "name": variation.name,
                "overrides": dict(variation.overrides),
                "fragile": [name for name in verdicts if rows and verdicts[name] != rows[0]["runs"][name]["success"]],
                "runs": {
                    name: {
                        "success": outcome.success,
                        "failure": outcome.failure,
                        **{number: _number(outcome, number) for number in NUMBERS},
                        "max_torque_joint_2_Nm": outcome.metrics and outcome.metrics.max_torque_Nm[1],
                    }
                    for name, outcome in outcomes.items()
                },
            }
        )
    return rows
