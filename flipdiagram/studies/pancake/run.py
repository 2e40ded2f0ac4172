"""Where the rigid plan stops working for a pancake that bends: maps of real flips, judged by a second engine too."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flight import Work
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import WORK, run_flips
from flipdiagram.plants.mujoco_contact import import_mujoco
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.pancake.second_engine import REPLAY, agreement, replay_all, side_by_side
from flipdiagram.studies.pancake.worlds import (
    FRICTIONS,
    MODULI,
    QUICK_FRICTIONS,
    QUICK_MESH,
    QUICK_MODULI,
    World,
    as_pancake,
    worlds_of,
)
from flipdiagram.studies.study import Progress, silent

PLANNED = ("touchdown_y_m", "touchdown_angle_rad", "touchdown_time_s")
"""Numbers of the plan that stand beside those of the flip."""


def run(
    scenario: Scenario,
    out: str | Path,
    architectures: Sequence[str] = ARCHITECTURES,
    *,
    moduli: Sequence[float] | None = None,
    frictions: Sequence[float] | None = None,
    thicknesses: Sequence[float] | None = None,
    quick: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    work: Work = WORK,
    replay: Work = REPLAY,
) -> None:
    """Fly a pancake of every modulus, friction and thickness under every architecture; write summary.json.

    Planner and controller know friction, thickness and mass; nobody knows that the object bends.  Then each recording
    is replayed in MuJoCo where that is installed.  What an earlier call left in `out` is used.  Raises InputError.

    Args:
        scenario: what all flips share; a block in it is taken out for the default pancake.
        out: folder of the results, of the flips' recordings too.
        architectures: of `ARCHITECTURES`.
        moduli: Young's moduli [Pa].
        frictions: friction coefficients of the pancake [1].
        thicknesses: [m], by default the scenario's; the density is the same for all.
        quick: fewer worlds, unless they are named, and the coarsest mesh.
        jobs: processes.
        progress: told how far it is.
        work: what plans and flies.
        replay: what replays.
    """
    base = as_pancake(scenario)
    if quick:
        base = base.with_overrides(QUICK_MESH)
    worlds = worlds_of(
        base,
        moduli or (QUICK_MODULI if quick else MODULI),
        frictions or (QUICK_FRICTIONS if quick else FRICTIONS),
        thicknesses or (base.object.thickness,),
    )
    build_loop(base)  # what is wrong with the scenario itself shows before anything is computed
    folder, keys = Path(out), list(product(worlds, architectures))
    flips = [world.flip(base, name) for world, name in keys]
    outcomes = run_flips(flips, folder, jobs=jobs, progress=progress, work=work)
    entries = [_entry(*row) for row in zip(keys, flips, outcomes, strict=True)]
    body = {"quick": quick, "architectures": list(architectures), "runs": entries}
    flown = [k for k, outcome in enumerate(outcomes) if outcome.metrics is not None]
    try:
        import_mujoco()
    except InputError as error:
        body |= {"second_engine": [], "no_second_engine": str(error)}
    else:
        again = replay_all([flips[k] for k in flown], folder, jobs=jobs, progress=progress, work=replay)
        pairs = zip(flown, again, strict=True)
        rows = [side_by_side(_place(*keys[k]), outcomes[k], outcome) for k, outcome in pairs]
        body |= {"second_engine": rows, "agreement": agreement(rows)}
    write_summary(folder / "summary.json", "pancake", base, body)


def _place(world: World, architecture: str) -> dict[str, Any]:
    return world.as_dict() | {"architecture": architecture}


def _entry(key: tuple[World, str], flip: Flip, outcome: Outcome) -> dict[str, Any]:
    """A flip as the summary keeps it: its place in the map, what it sets, how it ended, its metrics."""
    world, name = key
    entry = _place(world, name) | {"overrides": dict(world.overrides), "outcome": outcome.mode}
    entry |= {"success": outcome.success, "failure": outcome.failure}
    if outcome.metrics is None:
        return entry
    plan = outcome.plan or {}
    planned = {f"planned_{name}": plan.get(name) for name in PLANNED}
    return entry | outcome.metrics.as_dict() | planned | plan.get("bending", {}) | {"recording": flip.recording}
