"""`flipdiagram inverse`: in which worlds would E1 hold as the paper tells it?"""

import math
from collections import Counter
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.checks import check_estimate, load_specification
from flipdiagram.campaign.run import WORK
from flipdiagram.campaign.specification import Specification
from flipdiagram.campaign.statistics import success_rate
from flipdiagram.diagrams.loop import ENGINES
from flipdiagram.errors import InputError
from flipdiagram.files import plain, write_summary
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import Work
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import workers_of
from flipdiagram.scenario.scenario import Scenario, value_of
from flipdiagram.simulation.verdict import SLIDES
from flipdiagram.studies.inverse.search import STAGES, Search, World
from flipdiagram.studies.study import Progress, silent

FILE = "inverse.sqlite"
SHOWN = 10
"""Worlds found, and nearest misses, that are shown; and those found whose change is made as small as possible."""
FINER = "half the step"


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
    """Search the worlds of a campaign's file; write summary.json, and recordings of the world with least change.

    Each flip is kept in `out`/inverse.sqlite as it ends: an interrupted search goes on where it was.

    Args:
        scenario: its fields that are not at their defaults count more than the base of the file.
        out: folder of the results.
        file: the box of worlds as a campaign; its architectures do not count.
        yes: even if it takes longer than the file's limit.
        jobs: processes, by default one a core.
        scheduler: address of a Dask scheduler, whose workers fly instead.
        progress: told how far it is.
        work: what workers do.

    Raises InputError.
    """
    if file is None:
        raise InputError("inverse needs the FILE of a campaign; see examples/inverse.yaml", field="FILE")
    box = load_specification(file, scenario.changes())
    if yes:
        box = replace(box, limit_hours=math.inf)
    with workers_of(jobs, scheduler) as workers:
        # before anything is written; most worlds end with the first controller
        check_estimate(box, max(workers.width(), 1), 1 / len(box.architectures))
        with open_to_write(Path(out) / FILE, {"digest": "flips of an inverse problem"}) as store:
            flying = Flying(workers, store, work, box.limits)
            search = Search(box, flying)
            worlds = search.run(lambda done, found: progress(f"{done}/{box.trials} worlds, {found} as the paper tells"))
            found = [world for world in worlds if world.passed == len(STAGES)]
            firm: list[list[str]] = []
            least, of_least = None, []
            if found:
                progress("the same at half the step and in the other engine")
                firm = _firm(found, box, flying)
                progress("the smallest change that does it")
                most = max(map(len, firm))
                shrunk = search.smallest(
                    [world for world, names in zip(found, firm, strict=True) if len(names) == most][:SHOWN]
                )
                also = _firm(shrunk, box, flying)
                best = min(range(len(shrunk)), key=lambda k: (-len(also[k]), len(shrunk[k].dimensions)))
                least, of_least = shrunk[best], also[best]
                _record(search, least, Path(out), flying)
    body = _body(worlds, found, firm) | {"smallest": _smallest(least, of_least, box.base)}
    write_summary(Path(out) / "summary.json", "inverse", box.base, body)


def _variants(box: Specification) -> dict[str, Specification]:
    """The same worlds as they must come out too, unless it is the solver that decides, by what is other there."""
    own = box.base.simulation
    changes: dict[str, dict[str, Any]] = {FINER: {"simulation.step": own.step / 2}}
    for name in ENGINES:
        if name != own.engine and (name == "drake" or find_spec(name)):
            changes[name] = {"simulation.engine": name}
    return {name: replace(box, base=box.base.with_overrides(change)) for name, change in changes.items()}


def _firm(worlds: list[World], box: Specification, flying: Flying) -> list[list[str]]:
    """In which of `_variants` each world goes as the paper tells too."""
    asked = [replace(world, outcomes={}) for world in worlds]
    flown = {name: Search(other, flying).fly(asked) for name, other in _variants(box).items()}
    return [[name for name, again in flown.items() if again[k].passed == len(STAGES)] for k in range(len(worlds))]


def _record(search: Search, world: World, out: Path, flying: Flying) -> None:
    """Fly a world once more for its recordings."""
    flights = []
    for name, _ in STAGES:
        if (flight := search.flight(world, name)) is not None:
            flights.append(replace(flight, trial=f"recorded {name}", recording=out / f"{name}.nc"))
            flying.store.forget(flights[-1].trial, name)
    fly_all(flights, len(flights), flying)


def _body(worlds: list[World], found: list[World], firm: list[list[str]]) -> dict[str, Any]:
    nearest = sorted((world for world in worlds if world.passed < len(STAGES)), key=lambda world: world.rank)
    stages = []
    for stage, (name, wanted) in enumerate(STAGES):
        reached = [world for world in worlds if world.passed >= stage]
        modes = Counter(world.outcomes[name].mode for world in reached if name in world.outcomes)
        went = sum(world.passed > stage for world in worlds)
        stages.append(
            {"architecture": name, "wanted": list(wanted), "flown": len(reached), "went": went, "modes": modes}
        )
    return {
        "worlds": len(worlds),
        "found": len(found),
        "at_start": sum(all(world.outcomes[name].mode == SLIDES[0] for name, _ in STAGES[:2]) for world in found),
        **success_rate(len(found), len(worlds)),
        "stages": stages,
        "worlds_found": [
            plain(world.as_dict() | {"firm": names}) for world, names in zip(found[:SHOWN], firm, strict=False)
        ],
        "region": [plain(_span(found, k)) for k in range(len(worlds[0].dimensions))] if found else [],
        "nearest": [plain(world.as_dict()) for world in nearest[:SHOWN]],
    }


def _smallest(least: World | None, firm: list[str], base: Scenario) -> Any:
    """The smallest change as plain data, with the base's values of what is changed."""
    if least is None:
        return None
    of_base = {d.name: plain(value_of(base, d.fields[0])) for d in least.dimensions}
    return plain(least.as_dict() | {"base": of_base, "firm": firm})


def _span(found: list[World], k: int) -> dict[str, Any]:
    """Where an unknown lies in the worlds found: 5, 50 and 95 % of a number, the counts of choices."""
    dimension, values = found[0].dimensions[k], [world.values[k] for world in found]
    span: dict[str, Any] = {"name": dimension.name, "box": dimension.as_dict()["vary"]}
    if "choice" in span["box"]:
        return span | {"counts": Counter(map(str, values))}
    return span | {"interval": np.quantile(values, (0.05, 0.5, 0.95)).tolist()}
