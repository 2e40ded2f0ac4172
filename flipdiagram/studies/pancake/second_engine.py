"""The flips of the map once more, as a flex of MuJoCo's on the recorded motion of the blade: does it say the same?"""

import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.statistics import success_rate
from flipdiagram.errors import FlipdiagramError
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import KINDS, Flight, Landed, Work, plan_flight, provenance
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import NOT_PHYSICS, Outcome
from flipdiagram.flips.run import FILE, MARK, Clock, Progress, fly_kept, limits_of
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import Workers
from flipdiagram.simulation.bending import bending
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.recording_files import load_recording


def replay_flight(flight: Flight, plan: str) -> Landed:
    """Replay the recording that a flight names; what goes wrong with the physics is its outcome."""
    from flipdiagram.simulation.flex import replay_in_flex  # brings MuJoCo

    assert flight.recording is not None
    begin = time.perf_counter()
    try:
        again = replay_in_flex(load_recording(flight.recording))
        measured = measure(again)
        outcome = Outcome(measured, measured.failure, {"bending": bending(again)})
    except FlipdiagramError as error:
        outcome = Outcome(None, f"{KINDS.get(type(error), 'refused')}: {error}")
    return Landed(outcome, time.perf_counter() - begin, *provenance())


REPLAY = Work(plan_flight, replay_flight)


def replay_all(
    flips: Sequence[Flip], out: Path, *, jobs: int | None, progress: Progress, work: Work = REPLAY
) -> list[Outcome]:
    """What becomes of recorded flips in MuJoCo, in their order; those that `out` holds are not replayed again."""
    flights = [_flight(flip, out) for flip in flips]
    with open_to_write(out / FILE, MARK) as store, Workers(jobs) as workers:
        clock = Clock(len(flights), lambda text: progress(f"in MuJoCo: {text}"))
        flying = Flying(workers, store, work, limits_of(flips), clock.tick)
        how = f"flex of mujoco {version('mujoco')}"
        return fly_kept(flights, flying, lambda missing: clock.leave_out(len(flights) - missing), how)


def _flight(flip: Flip, out: Path) -> Flight:
    assert flip.recording is not None
    return Flight("", flip.scenario, flip.scenario, flip.architecture, recording=(out / flip.recording).absolute())


def side_by_side(place: Mapping[str, Any], drake: Outcome, mujoco: Outcome) -> dict[str, Any]:
    """One flip in both engines, and MuJoCo's numbers less Drake's; None where one of the two is missing."""
    differences = dict.fromkeys(("touchdown_time_s", "touchdown_angle_rad", "final_centre_m"))
    landed, bent = (_of(drake), _of(mujoco)), (_bent(drake), _bent(mujoco))
    if landed[0] and landed[1]:
        differences["touchdown_time_s"] = landed[1].time_s - landed[0].time_s
        differences["touchdown_angle_rad"] = landed[1].theta_rad - landed[0].theta_rad
    if bent[0] and bent[1]:
        apart = (bent[1][name] - bent[0][name] for name in ("final_x_m", "final_y_m"))
        differences["final_centre_m"] = float(np.hypot(*apart))
    engines = {"drake": drake, "mujoco": mujoco}
    said = {k: {"outcome": o.mode, "success": o.success, "failure": o.failure} for k, o in engines.items()}
    return {**place, **said, "difference": differences, "judged": mujoco.mode not in NOT_PHYSICS}


def agreement(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How often both engines say the same, of the flips that both judged: counts, share, Wilson's interval."""
    judged = [(row["drake"]["success"], row["mujoco"]["success"]) for row in rows if row["judged"]]
    names = {"both": (True, True), "only_drake": (True, False), "only_mujoco": (False, True), "neither": (False, False)}
    counts = {name: judged.count(pair) for name, pair in names.items()}
    same = counts["both"] + counts["neither"]
    return {"flips": len(judged), "same": same, **counts, **success_rate(same, len(judged))}


def _of(outcome: Outcome) -> Any:
    return outcome.metrics and outcome.metrics.touchdown


def _bent(outcome: Outcome) -> Any:
    return (outcome.plan or {}).get("bending")
