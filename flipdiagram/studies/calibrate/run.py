"""`flipdiagram calibrate`: which worlds explain what the paper measured?"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.campaign.checks import check_estimate
from flipdiagram.campaign.run import WORK
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError
from flipdiagram.files import plain, write_atomically, write_summary
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import Work
from flipdiagram.flips.run import Clock
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import workers_of
from flipdiagram.scenario.scenario import Scenario, value_of
from flipdiagram.studies.calibrate import inference
from flipdiagram.studies.calibrate.inference import Population
from flipdiagram.studies.calibrate.observations import (
    DATA,
    PAPER,
    QUANTITIES,
    Observation,
    agreements,
    deviations,
    distance,
    stages,
)
from flipdiagram.studies.calibrate.predictions import Shown
from flipdiagram.studies.calibrate.section import MEDIAN, NEAREST, CalibrateSection, load_calibration
from flipdiagram.studies.calibrate.worlds import Worlds
from flipdiagram.studies.study import Progress, silent

FILE = "calibrate.sqlite"
Data = dict[str, Any]


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    file: str | None,
    yes: bool = False,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Progress = silent,
    work: Work = WORK,
) -> None:
    """Draw worlds from the priors of a file, fly them, keep those like the paper's, go on about them.

    Writes summary.json; median.yaml, the scenario with each unknown at its posterior's median; and nearest.yaml, the
    world that was flown whose numbers, verdicts and signs are nearest to the paper's.

    Each flip is kept in `out`/calibrate.sqlite as it ends: an interrupted calibration goes on where it was.

    Args:
        scenario: its fields that are not at their defaults count more than the base of the file.
        out: folder of the results.
        file: the campaign with its section `calibrate`, see examples/calibration.yaml.
        yes: even if it takes longer than the file's limit.
        jobs: processes, by default one a core.
        scheduler: address of a Dask scheduler, whose workers fly instead.
        progress: told how far it is.
        work: what workers do.

    Raises InputError.
    """
    if file is None:
        raise InputError("calibrate needs a FILE; see examples/calibration.yaml", field="FILE")
    priors, settings, scenarios = load_calibration(file, scenario.changes())
    if yes:
        priors = replace(priors, limit_hours=math.inf)
    flips = sum(map(len, stages(settings.starts))) * (priors.trials + settings.rounds * settings.population)
    with workers_of(jobs, scheduler) as workers:
        check_estimate(priors, max(workers.width(), 1), flips / priors.rows)  # before anything is written
        stored = open_to_write(Path(out) / FILE, {"digest": "flips of a calibration"})
        clock = Clock(flips, progress)
        with stored as store:
            worlds = Worlds(priors, settings.starts, Flying(workers, store, work, priors.limits, clock.tick), clock)
            body, found = calibrate(priors, settings, worlds, scenarios, progress)
    for name, of_world in found.items():
        write_atomically(Path(out) / f"{name}.yaml", of_world.to_yaml())
    write_summary(Path(out) / "summary.json", "calibrate", priors.base, body)


def calibrate(
    priors: Specification,
    settings: CalibrateSection,
    worlds: Worlds,
    scenarios: Mapping[str, Scenario],
    progress: Progress = silent,
) -> tuple[dict[str, Any], dict[str, Scenario]]:
    """The body of the summary, and by its name the world at the posterior's medians and the one nearest to the paper.

    The body: posterior, its checks, predictions beside those of named scenarios, data that pull against each other.
    """
    progress(f"{priors.trials} worlds from the priors")
    worlds.fly(priors.points)
    prior, rng = np.arange(priors.trials), np.random.default_rng(priors.seed)
    distances = _distances(worlds, PAPER)
    rejected = inference.rejection(worlds.u, distances, settings.population)
    if len(rejected.u) < 2:
        raise InputError(
            f"{len(rejected.u)} of {priors.trials} worlds of these priors can be measured at all; valid are priors of"
            " worlds in which FF+DOB and DOB turn the block over",
            field="vary",
        )

    def simulate(u: Floats) -> tuple[np.ndarray, Floats]:
        progress(f"{len(u)} worlds about the nearest {len(rejected.u)}")
        index = worlds.fly(u)
        return index, np.array([distance(worlds.observations[k]) for k in index])

    population, history = inference.sequential(rejected, priors.trials, simulate, settings.rounds, rng)
    points = {
        MEDIAN: _quantiles(worlds, population)[1],
        NEAREST: worlds.u[population.index[np.argmin(population.distance)]],
    }
    found = {name: priors.truth(priors.drawn(0, u.tolist(), priors.seeds[0])) for name, u in points.items()}
    progress("the starts of the paper")
    shown = Shown(worlds, population, prior, {**scenarios, **found})
    body = {
        "worlds": len(worlds.observations),
        "starts_y_m": list(settings.starts),
        "rounds": history,
        "unknowns": _unknowns(priors, settings, worlds, population, rejected),
        "draws": _draws(worlds, population),
        "predictions": shown.numbers(),
        "claim_shares": shown.claims(),
        "recovered": _recovered(priors, settings, worlds, prior),
        "held_out": [_held_out(name, settings, worlds, prior) for name in settings.hold_out],
        "pairs": _pairs(worlds, prior),
    }
    return body, found


def _distances(worlds: Worlds, data: Observation, without: Sequence[str] = ()) -> Floats:
    return np.array([distance(world, data, without) for world in worlds.observations])


def _deviations(worlds: Worlds, data: Observation) -> Floats:
    return np.array([deviations(world, data) for world in worlds.observations])


def _unknowns(
    priors: Specification, settings: CalibrateSection, worlds: Worlds, population: Population, rejected: Population
) -> list[Data]:
    """Each unknown with its prior and source, and its posterior's 5, 50 and 95 %, by the sampler and by rejection."""
    found = []
    for kept in (population, rejected):
        found.append([priors.drawn(0, u.tolist(), 0).values for u in _quantiles(worlds, kept)])
    return [
        {
            "name": dimension.name,
            "prior": dimension.as_dict()["vary"],
            "source": settings.sources.get(dimension.name, ""),
            "base": plain(value_of(priors.base, dimension.fields[0])),
            "posterior": [plain(row[k]) for row in found[0]],
            "rejection": [plain(row[k]) for row in found[1]],
        }
        for k, dimension in enumerate(priors.dimensions)
    ]


def _quantiles(worlds: Worlds, kept: Population) -> Floats:
    """5, 50 and 95 % of each unknown in the unit cube, after regression."""
    return inference.quantiles(*_moved(worlds, kept))


def _moved(worlds: Worlds, kept: Population) -> tuple[Floats, Floats]:
    """The draws after regression, and their weights."""
    return inference.adjusted(kept, _deviations(worlds, PAPER)[kept.index], worlds.smooth)


def _draws(worlds: Worlds, population: Population) -> Data:
    """The posterior's draws in the unit cube, moved by regression, with weights: for the corner plot."""
    moved, weight = _moved(worlds, population)
    return {"u": moved.tolist(), "weight": weight.tolist(), "distance": population.distance.tolist()}


def _recovered(priors: Specification, settings: CalibrateSection, worlds: Worlds, prior: np.ndarray) -> Data:
    """Worlds of the prior whose own output is the data: how often the 90 % intervals hold the truth, by unknown."""
    known = np.isfinite(_distances(worlds, PAPER)[prior])
    chosen = prior[known][: settings.synthetic]
    u, number = worlds.u[prior], settings.population
    drawn = [worlds.observations[k] for k in prior]

    def seen_from(k: int) -> tuple[Floats, Floats]:
        data = drawn[k]
        return np.array([distance(world, data) for world in drawn]), np.array([deviations(w, data) for w in drawn])

    found = inference.covered(u, seen_from, chosen, number, worlds.smooth)
    names = [dimension.name for dimension in priors.dimensions]
    shares = found.mean(axis=0).tolist() if len(chosen) else [None] * len(names)
    return {
        "worlds": len(chosen),
        "coverage": float(found.mean()) if found.size else None,
        "unknowns": dict(zip(names, shares, strict=True)),
    }


def _held_out(name: str, settings: CalibrateSection, worlds: Worlds, prior: np.ndarray) -> Data:
    """What the worlds nearest to all other data say of a datum that they were not chosen by."""
    distances = _distances(worlds, PAPER, (name,))[prior]
    kept = inference.rejection(worlds.u[prior], distances, settings.population)
    position = DATA.index(name)
    if position < len(QUANTITIES):
        numbers = np.array([worlds.observations[k].numbers[position] for k in prior[kept.index]])
        finite = np.isfinite(numbers)
        low, middle, high = inference.quantiles(numbers[finite], kept.weight[finite])[:, 0].tolist()
        paper = QUANTITIES[position].paper
        return {"name": name, "paper": paper, "interval": [low, middle, high], "inside": low <= paper <= high}
    holds = np.array([agreements(worlds.observations[k])[position] for k in prior[kept.index]], dtype=float)
    return {"name": name, "paper": True, "share": float(kept.weight @ holds)}


def _pairs(worlds: Worlds, prior: np.ndarray) -> list[Data]:
    """Pairs of data that hold together less often than if they were independent, the worst first."""
    agree = np.array([agreements(worlds.observations[k]) for k in prior])
    rows = []
    for i, j in zip(*np.triu_indices(len(DATA), 1), strict=True):
        both, alone = int((agree[:, i] & agree[:, j]).sum()), (int(agree[:, i].sum()), int(agree[:, j].sum()))
        expected = alone[0] * alone[1] / max(len(prior), 1)
        if expected >= 1 and both < expected:
            entry = {"first": DATA[i], "second": DATA[j], "alone": list(alone), "both": both, "expected": expected}
            rows.append(entry | {"lift": both / expected})
    return sorted(rows, key=lambda row: row["lift"])
