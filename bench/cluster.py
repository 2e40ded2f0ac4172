"""What a trial costs on a Dask cluster beyond its flip: for the scheduler, the driver and a worker.

`python -m bench.cluster TRIALS WORKERS [alone]` is one such campaign in a process of its own; prints its times as JSON.
Alone: each trial is a task of its own.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.processes import fresh, processor_time
from bench.results import Section, Target
from flipdiagram.flips import child_process
from flipdiagram.flips.batches import MOST
from flipdiagram.flips.flight import Flight, Landed, Planned, Work, provenance
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.workers import batch_seconds
from flipdiagram.scenario.scenario import Scenario

TRIALS, ALONE = 2000, 300
"""For each worker of a campaign in batches, and of one without."""
IDLE = 3.0
"""Seconds for which a scheduler is watched that has nothing to do."""
WORKERS = (1, 2, 4)
COST = Target("<", 0.3e-3)
MILLION, CORES = 1_000_000, 1000
START = 60.0
"""Seconds that the scheduler has to start."""
SPECIFICATION = """
vary:
  object.friction: {{uniform: [1.2, 2.4]}}
  object.mass: {{uniform: [0.04, 0.09]}}
sampler: random
trials: {trials}
seed: 1
architectures: [pd+ff+dob]
limit_hours: 10
"""
SETTINGS = ("--nthreads", "1", "--no-nanny", "--preload", "bench.cluster")
NOTHING = "diverged: nothing was flown"
TEXT = (
    "`dask scheduler` and `dask worker`s of one thread in processes of their own on loopback, and a campaign of trials"
    " whose flip returns at once, into SQLite as always. What is left is what a trial costs besides its flip: processor"
    " time of the scheduler, of the driver (handing out, keeping), of a worker without its child, and wall time."
    " A task carries a batch of trials; drawing, checking and the text of a row are done in the child."
    " Children are not replaced here, as nothing leaks: their starts would be all that is seen."
)


def plan_nothing(believed: Scenario) -> Planned:
    """A plan that nobody will read."""
    return "plan", None


def fly_nothing(flight: Flight, plan: str) -> Landed:
    """A trial without a flip."""
    return Landed(Outcome(None, NOTHING), 0.0, *provenance())


WORK = Work(plan_nothing, fly_nothing)


def measure(quick: bool, flip: float) -> Section:
    """Campaigns on clusters of a few workers; flip [s]: what a real trial takes, for what a million would."""
    section = Section("A trial on a Dask cluster, without its flip", TEXT)
    many, few = (200, 40) if quick else (TRIALS, ALONE)
    _, alone = fresh("bench.cluster", str(few), "1", "alone")
    runs = {
        count: fresh("bench.cluster", str(count * many), str(count))[1] for count in WORKERS[: 1 if quick else None]
    }
    _add(section, "one worker, each trial a task of its own", alone)
    for count, run in runs.items():
        _add(section, f"{count} worker{'s' if count > 1 else ''}", run, None if quick else COST)
    section.checks.append(_on_paper(alone, runs[1], flip))
    return section


def dask_setup(worker: object) -> None:
    """What Dask calls in a worker that starts with this module."""
    child_process.RECYCLED_AFTER = MILLION


def _add(section: Section, where: str, run: dict[str, float], target: Target | None = None) -> None:
    section.add(f"{where}: wall time of a trial", [run["wall"]])
    section.add("scheduler: processor time", [run["scheduler"]], indent=1)
    section.add("scheduler: beyond an idle one's", [_served(run)], target=target, indent=2)
    section.add("driver: processor time", [run["driver"]], target=target, indent=1)
    section.add("worker: processor time", [run["worker"]], indent=1)


def _served(run: dict[str, float]) -> float:
    """What a trial costs the scheduler [s]; it looks round all the time, with nothing to do too."""
    return max(run["scheduler"] - run["idle"] * run["wall"], 0.0)


def _on_paper(alone: dict[str, float], batches: dict[str, float], flip: float) -> str:
    """What a million trials would take; a batch costs what a trial alone does beyond its part in a batch."""
    seconds = batch_seconds(CORES)
    size = min(max(int(seconds / flip), 1), MOST)
    single, many = ({"scheduler": _served(run), "driver": run["driver"]} for run in (alone, batches))
    costs = {name: many[name] + max(single[name] - many[name], 0.0) / size for name in many}
    shares = ", ".join(
        f"{name} {1e3 * cost:.2g} ms a trial, {CORES / flip * cost:.0%} of a core" for name, cost in costs.items()
    )
    bound = "the cores" if max(costs.values()) * CORES / flip < 1 else "the driver or the scheduler"
    return (
        f"on paper, {MILLION} trials of {flip:.2f} s on {CORES} cores: {MILLION * flip / CORES / 60:.0f} min if no core"
        f" ever waits; that is {CORES / flip:.0f} trials a second in batches of {size}, {seconds:.0f} s each;"
        f" {shares}: bound by {bound}"
    )


@contextmanager
def cluster(folder: Path, count: int) -> Iterator[tuple[str, int, list[int]]]:
    """A scheduler and workers on loopback; yields the address and the process numbers."""
    file, started = folder / "scheduler.json", []

    def start(*words: str) -> int:
        command = [sys.executable, "-m", "dask", *words, "--host", "127.0.0.1", "--no-dashboard"]
        root = str(Path(__file__).resolve().parents[1])
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(command, cwd=folder, env=environment, **silent))
        return started[-1].pid

    try:
        scheduler = start("scheduler", "--port", "0", "--scheduler-file", str(file))
        deadline = time.monotonic() + START
        while not file.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.2)  # the file is there before it is written
        address = json.loads(file.read_text(encoding="utf-8"))["address"]
        yield address, scheduler, [start("worker", address, *SETTINGS) for _ in range(count)]
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def campaign(trials: int, count: int) -> dict[str, float]:
    """Processor times and wall time per trial, from the tenth on [s]; idle: a scheduler's share of a core before."""
    from bench.cluster import WORK as work  # by the name that workers know, which `__main__` is not
    from flipdiagram.campaign.checks import from_text
    from flipdiagram.campaign.run import run
    from flipdiagram.flips.store_file import open_to_read

    clock: list[tuple[float, ...]] = []
    """When the tenth had ended, and when all had."""
    with tempfile.TemporaryDirectory() as name, cluster(Path(name), count) as (address, scheduler, workers):

        def look(progress: str) -> None:
            found = re.match(r"flips (\d+)/", progress)
            ended = int(found[1]) if found else 0
            if (not clock and ended >= trials // 10) or ended == trials:
                own = sum(map(processor_time, workers))
                clock.append((ended, time.perf_counter(), processor_time(scheduler), time.process_time(), own))

        specification = from_text(SPECIFICATION.format(trials=trials))
        _wait(address, count)
        begin = processor_time(scheduler)
        time.sleep(IDLE)
        idle = (processor_time(scheduler) - begin) / IDLE
        ended = run(specification, Path(name) / "campaign", scheduler=address, work=work, progress=look)
        with open_to_read(ended.file) as results:
            if not all(row.failure == NOTHING for row in results.rows()):
                raise RuntimeError("trials on the cluster did not end as they should")
    flown, *spent = (b - a for a, b in zip(*clock, strict=True))
    names = ("wall", "scheduler", "driver", "worker")
    return dict(zip(names, (value / flown for value in spent), strict=True)) | {"idle": idle}


def _wait(address: str, count: int) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=START)


if __name__ == "__main__":
    if "alone" in sys.argv:
        from flipdiagram.flips import workers

        workers.BATCH_SECONDS = (0.0, 0.0)
    print(json.dumps(campaign(int(sys.argv[1]), int(sys.argv[2]))))
