"""Where each controller stops working: maps of real flips, and how far the verdict depends on solver and estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True)
class BordersResult:
    """The maps and the table of variations, with the outcome of every cell."""

    scenario: Scenario
    maps: tuple[Map, ...]
    cells: dict[str, dict[str, list[list[Outcome]]]]
    """By map and architecture, rows along y, columns along x."""
    variations: tuple[Variation, ...]
    varied: dict[str, list[Outcome]]
    """By architecture, in the order of the variations."""
    out: Path
    quick: bool

    def summary(self) -> dict[str, Any]:
        """The body of summary.json."""
        return {
            "quick": self.quick,
            "maps": [_map_summary(drawn, self.cells[drawn.name]) for drawn in self.maps],
            "variations": _variation_summary(self.variations, self.varied),
        }


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    maps: Sequence[str] | None = None,
    resolution: int | None = None,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
) -> BordersResult:
    """Fly every cell of the maps under every architecture, and the variations; write summary.json.

    maps: names of `maps_of`, and "variations"; by default all.  resolution: points per axis.  What an earlier call
    left in `out` is used.  A cell without a motion, or that diverges, is an outcome.  Raises InputError.
    """
    known = maps_of(scenario, QUICK_RESOLUTION if quick and resolution is None else resolution)
    names = list(maps) if maps is not None else [*QUICK_MAPS] if quick else [*known, VARIATIONS]
    for name in names:
        if name not in known and name != VARIATIONS:
            raise InputError(f"unknown map '{name}'; choose from {', '.join([*known, VARIATIONS])}")
    build_loop(scenario)  # what is wrong with the scenario itself shows before anything is computed
    chosen = tuple(known[name] for name in dict.fromkeys(names) if name in known)
    variations = tuple(variations_of(scenario)) if VARIATIONS in names else ()

    flips: list[Flip] = []
    for drawn in chosen:
        flips += [cell(scenario, drawn, i, j, name) for name in ARCHITECTURES for j, i in _grid(drawn)]
    flips += [Flip(v.applied_to(scenario), name) for name in ARCHITECTURES for v in variations]
    outcomes = iter(run_flips(flips, Path(out), jobs=jobs, progress=progress))

    cells = {
        drawn.name: {name: [[next(outcomes) for _ in drawn.x.values] for _ in drawn.y.values] for name in ARCHITECTURES}
        for drawn in chosen
    }
    varied = {name: [next(outcomes) for _ in variations] for name in ARCHITECTURES}
    result = BordersResult(scenario, chosen, cells, variations, varied, Path(out), quick)
    write_summary(Path(out) / "summary.json", "borders", scenario, result.summary())
    return result


def cell(scenario: Scenario, drawn: Map, i: int, j: int, architecture: str) -> Flip:
    """The flip of one cell, column i and row j; run alone it gives the same numbers as in the map."""
    return Flip(scenario.with_overrides({**drawn.x.overrides[i], **drawn.y.overrides[j]}), architecture)


def _grid(drawn: Map) -> list[tuple[int, int]]:
    return [(j, i) for j in range(len(drawn.y.values)) for i in range(len(drawn.x.values))]


def _map_summary(drawn: Map, cells: dict[str, list[list[Outcome]]]) -> dict[str, Any]:
    return {
        "name": drawn.name,
        "title": drawn.title,
        "question": drawn.question,
        "x": _axis_summary(drawn.x),
        "y": _axis_summary(drawn.y),
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


def _variation_summary(variations: Sequence[Variation], varied: dict[str, list[Outcome]]) -> list[dict[str, Any]]:
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
