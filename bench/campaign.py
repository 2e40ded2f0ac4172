"""A campaign: flips a minute, two processes against one, what a trial costs beyond its flip, memory over many trials.

`python -m bench.campaign JOBS TRIALS` is one campaign in a process of its own; prints its times as JSON.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bench import cluster
from bench.processes import fresh, processor_time
from bench.results import Section, Target

SPEEDUP = Target(">=", 1.8)
PACE = Target(">=", 1.0)
OVERHEAD = Target("<", 0.05)
GROWTH = Target("<", 1.1)
MANY = 2000
"""Short flips over which memory is watched."""
SPECIFICATION = """
vary:
  object.friction: {{uniform: [1.2, 2.4]}}
  object.mass: {{uniform: [0.04, 0.09]}}
  disturbance.payload: {{uniform: [0.0, 0.2]}}
  joint_friction.coulomb: {{uniform: [0.05, 0.13]}}
sampler: sobol
trials: {trials}
seed: 1
architectures: [pd+ff+dob]
limit_hours: 10
"""
"""One plan serves all, as what varies is unknown to the planner."""
TEXT = (
    "A campaign of the default flip under pd+ff+dob, four parameters drawn by Sobol, into SQLite, from its first flip"
    " to its last: without the start of Python, of the workers, and the one plan. Overhead: what the driver computes"
    " for a flip (drawing, checking, sending, writing) and what passes between the end of one flip and the beginning"
    " of the next on a worker, over the flip itself."
)
MEMORY_TEXT = (
    "Resident memory of a worker over its flips; a worker is replaced by a new one after its share, since Drake never"
    " frees a Python system. Flat: the largest of the second half of the campaign over that of the first."
)


def sections(repetitions: int, quick: bool) -> Iterator[Section]:
    """Pace and overhead; memory.  Quick: ten flips, no verdict on memory."""
    flips = 12 if quick else 60
    section = Section("A campaign", TEXT)
    runs: dict[int, list[dict[str, Any]]] = {1: [], 2: []}
    for _ in range(max(repetitions, 1)):
        for jobs in runs:
            runs[jobs].append(fresh("bench.campaign", str(jobs), str(flips))[1])
    paces = {jobs: [run["pace"] for run in found] for jobs, found in runs.items()}
    section.add("flips a second, one process", paces[1], "1/s")
    section.add("flips a second, two processes", paces[2], "1/s", PACE)
    section.add("two processes / one", [b / a for a, b in zip(paces[1], paces[2], strict=True)], "x", SPEEDUP)
    whole = section.add("one flip on a worker", [run["flip"] for run in runs[1]])
    section.whole = whole
    section.add("driver: processor time a flip", [run["driver"] for run in runs[1]], indent=1)
    section.add("worker: between two flips", [run["gap"] for run in runs[1]], indent=1)
    section.add("database: a row on the disk", [run["row"] for run in runs[1]], indent=1)
    share = [(run["driver"] + run["gap"]) / run["flip"] for run in runs[1]]
    section.add("overhead of a trial / its flip", share, "x", OVERHEAD)
    section.add("start: import, check, workers, plan", [run["start"] for run in runs[1]])
    for name in ("build", "simulate", "measure"):
        section.add(f"of a flip: {name}", [run[name] for run in runs[1]], indent=1)
    cost = {jobs: statistics.median(run["processor"] for run in found) for jobs, found in runs.items()}
    section.add("two / one if nothing else ran: by processor time", [2 * cost[1] / cost[2]], "x")
    section.add("processor time of a flip, one process", [cost[1]])
    section.add("processor time of a flip, two processes", [cost[2]])
    same = len({run["digest"] for found in runs.values() for run in found}) == 1
    section.checks.append(f"all rows of one and of two processes {'are the same' if same else 'are NOT the same'}")
    yield section
    yield memory(24 if quick else MANY, quick)
    if find_spec("distributed"):
        yield cluster.measure(quick, whole.median)


def memory(trials: int, quick: bool) -> Section:
    """Short flips, many of them: their diagrams are what leaks."""
    section = Section(f"Memory of a campaign over {trials} flips", MEMORY_TEXT)
    _, run = fresh("bench.campaign", "2", str(trials), "short")
    half = len(run["workers"]) // 2
    first, second = max(run["workers"][:half]), max(run["workers"][half:])
    section.add("worker, largest of the first half", [first], "B")
    section.add("worker, largest of the second half", [second], "B")
    section.add("second half / first", [second / first], "x", None if quick else GROWTH)
    section.add(
        "driver, second half / first",
        [run["memory"][-1] / run["memory"][len(run["memory"]) // 2]],
        "x",
        None if quick else GROWTH,
    )
    section.add("a flip leaves behind", [run["leak"]], "B")
    section.checks.append(f"{trials} flips, {run['children']} workers in all, {run['pace'] * 60:.0f} flips a minute")
    return section


def campaign(jobs: int, trials: int, short: bool) -> dict[str, Any]:
    """Fly one campaign here and read its times from its rows."""
    begin = time.perf_counter()
    from flipdiagram.campaign.checks import from_text
    from flipdiagram.campaign.run import run
    from flipdiagram.flips import child_process
    from flipdiagram.flips.store_file import open_to_read

    text = SPECIFICATION.format(trials=trials)
    if short:
        text += "base: {simulation: {hold_time: 0.05, settle_time: 0.02}}\n"
    seen: list[tuple[int, int]] = []
    driver: list[int] = []
    clock: list[tuple[float, float]] = []
    begun: set[int] = set()
    spent: dict[int, float] = {}
    before: dict[int, float] = {}

    def look(progress: str) -> None:
        clock.append((time.perf_counter(), time.process_time()))
        for pid in child_process.children():
            begun.add(pid)
            seen.append((pid, _resident(pid)))
            spent[pid] = processor_time(pid)
        driver.append(_resident(os.getpid()))
        if len(clock) == 2:  # the first flip has ended
            before.update(spent)

    with tempfile.TemporaryDirectory() as folder:
        specification = from_text(text)
        file = run(specification, Path(folder), jobs=jobs, progress=look, any_version=True).file
        with open_to_read(file) as results:
            rows = sorted(results.rows(), key=lambda row: row.finished)
        row_time = _row_time(Path(folder) / "row")
    first = clock[1]  # the first call is the announcement
    flips = [row.seconds for row in rows]
    steady = clock[-1][0] - first[0]
    count = len(rows) - 1
    per_worker: dict[int, list[int]] = {}
    for pid, size in seen:
        per_worker.setdefault(pid, []).append(size)
    leaks = [(sizes[-1] - sizes[len(sizes) // 4]) / (0.75 * len(sizes)) * jobs for sizes in per_worker.values()]
    return {
        "pace": count / steady,
        "flip": statistics.fmean(flips),
        "gap": max(jobs * steady / count - statistics.fmean(flips[1:]), 0.0),
        "processor": (sum(spent.values()) - sum(before.values())) / count,
        "driver": (clock[-1][1] - first[1]) / count,
        "row": row_time,
        "start": first[0] - begin - flips[0],
        "digest": _digest(rows),
        "workers": [size for _, size in seen] or [1, 1],
        "memory": driver,
        "children": len(begun),
        "leak": statistics.median(leaks),
        **(_parts() if not short else {}),
    }


def _parts() -> dict[str, float]:
    """Where the time of a flip goes [s]."""
    from flipdiagram.diagrams.loop import build_loop
    from flipdiagram.planning import plan_motion
    from flipdiagram.scenario.scenario import Scenario
    from flipdiagram.simulation import metrics
    from flipdiagram.simulation.simulate import simulate_loop

    scenario = Scenario()
    motion = plan_motion(scenario)
    a = time.perf_counter()
    loop = build_loop(scenario, "pd+ff+dob", record=True)
    b = time.perf_counter()
    flown = simulate_loop(loop, motion)
    c = time.perf_counter()
    metrics.measure(flown.recording)
    return {"build": b - a, "simulate": c - b, "measure": time.perf_counter() - c}


def _row_time(path: Path) -> float:
    """Seconds to put a row on the disk."""
    from flipdiagram.flips.row import Row
    from flipdiagram.flips.store_file import open_to_write

    with open_to_write(path, {"digest": ""}) as results:
        begin = time.perf_counter()
        for k in range(50):
            text = "x" * 2000
            results.put([Row(k, "pd", "slid later", text, 1, "", {}, [], None, None, "", {}, 0.0, "", 1, 0.0).packed()])
        return (time.perf_counter() - begin) / 50


def _digest(rows: list[Any]) -> str:
    import hashlib

    times = {"seconds", "host", "attempts", "finished", "solve_time_s"}
    contents = [asdict(row) for row in rows]
    contents = [{name: data for name, data in row.items() if name not in times} for row in contents]
    for row in contents:
        row["plan"] = row["plan"] and {name: data for name, data in row["plan"].items() if name not in times}
    return hashlib.sha256("\n".join(sorted(json.dumps(row, sort_keys=True) for row in contents)).encode()).hexdigest()


def _resident(pid: int) -> int:
    """Resident memory of a process [B], 0 where it has ended."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


if __name__ == "__main__":
    print(json.dumps(campaign(int(sys.argv[1]), int(sys.argv[2]), "short" in sys.argv)))
