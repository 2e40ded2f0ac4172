"""Random worlds in which the flip is planned once, and again and again: paired, as each world is flown both ways."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.checks import specification
from flipdiagram.campaign.specification_file import parse
from flipdiagram.campaign.statistics import paired, success_rate
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import WORK, Clock, fly_kept
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import Workers
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.study import Progress

WORLDS, QUICK_WORLDS = 200, 1
VARY = """
vary:
  object.friction: {uniform: [0.6, 2.0]}
  disturbance.block_offset: {uniform: [-0.01, 0.01]}
  disturbance.push: {choice: [[0.0, 0.0], [0.0, -20.0], [20.0, 0.0]]}
  disturbance.payload: {uniform: [0.0, 0.3]}
  disturbance.start_error: {uniform: [-0.02, 0.02]}
sampler: sobol
trials: TRIALS
seed: 1
architectures: [ARCHITECTURES]
timeout: 600
"""
"""What neither planner nor controller knows, as a campaign."""
FILE = "worlds.sqlite"
COMPARED = ("landing_cost_J", "position_rmse_m")


def fly_worlds(
    scenario: Scenario,
    ways: Mapping[str, Mapping[str, Any]],
    worlds: int,
    out: Path,
    *,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
) -> dict[str, Any]:
    """Each world in every way under every architecture; flips that `out` holds are used.  Raises InputError.

    Returns per way and architecture how many blocks were turned over, and the comparison with the first way.
    """
    text = VARY.replace("TRIALS", str(worlds)).replace("ARCHITECTURES", ", ".join(ARCHITECTURES))
    box = specification(parse(text, "worlds of replanning"), Path("."), scenario.changes())
    keys = list(product(ways, ARCHITECTURES, range(worlds)))
    boxes = {way: replace(box, base=box.base.with_overrides(changes)) for way, changes in ways.items()}
    flights = [boxes[way].flight(box.trial(index), name) for way, name, index in keys]
    with open_to_write(out / FILE, {"digest": "worlds of replanning"}) as store, Workers(jobs) as workers:
        clock = Clock(len(flights), lambda text: progress(f"{worlds} random worlds: {text}"))
        flying = Flying(workers, store, WORK, box.limits, clock.tick)
        outcomes = fly_kept(flights, flying, lambda missing: clock.leave_out(len(flights) - missing))
    by_key = dict(zip(keys, outcomes, strict=True))
    entries = []
    for way, name in product(ways, ARCHITECTURES):
        flown, once = ([by_key[w, name, k] for k in range(worlds)] for w in (way, next(iter(ways))))
        turned = sum(outcome.success for outcome in flown)
        entry = {"way": way, "architecture": name, "turned_over": turned, **success_rate(turned, worlds)}
        entries.append(entry | ({} if flown == once else {"against_first": against_first(flown, once)}))
    return {"count": worlds, "vary": [dimension.as_dict() for dimension in box.dimensions], "entries": entries}


def against_first(flown: Sequence[Outcome], first: Sequence[Outcome]) -> dict[str, Any]:
    """The same worlds in two ways: success, and where both succeed J of the landing and the position RMSE.

    median_difference is the median over the pairs of this way's number less the first way's; p by Wilcoxon's signed
    ranks (1945).
    """
    from scipy.stats import wilcoxon

    entry: dict[str, Any] = {"success": paired([o.success for o in flown], [o.success for o in first])}
    both = [(a.metrics, b.metrics) for a, b in zip(flown, first, strict=True) if a.success and b.success]
    for name in COMPARED:
        differences = np.array([getattr(a, name) - getattr(b, name) for a, b in both])
        decided = np.count_nonzero(differences)
        p = float(wilcoxon(differences).pvalue) if decided else 1.0
        median = float(np.median(differences)) if both else None
        entry[name] = {"pairs": len(both), "median_difference": median, "p": p}
    return entry
