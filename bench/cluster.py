"""What a trial costs a Dask cluster beyond its flip: scheduler, driver and worker, over trials that fly nothing.

`python -m bench.cluster TRIALS` starts a scheduler and one worker on loopback, runs one campaign on them, and prints
its times as JSON.
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
from typing import Any

from bench.processes import fresh, processor_time
from bench.results import Section
from flipdiagram.flips.flight import Flight, Landed, Planned, Work, provenance
from flipdiagram.flips.outcome import Outcome
from flipdiagram.scenario.scenario import Scenario

TRIALS = 1000
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
NOTHING = "diverged: nothing was flown"
TEXT = (
    "`dask scheduler` and one `dask worker` in processes of their own on loopback, and a campaign of trials whose flip"
    " returns at once, into SQLite as always. What is left is what a trial costs besides its flip: processor time of"
    " the scheduler, of the driver (drawing, checking, sending, writing), of the worker without its child, and wall"
    " time."
)


def plan_nothing(believed: Scenario) -> Planned:
    """A plan that nobody will read."""
    return "plan", None


def fly_nothing(flight: Flight, plan: str) -> Landed:
    """A trial without a flip."""
    return Landed(Outcome(None, NOTHING), 0.0, *provenance())


WORK = Work(plan_nothing, fly_nothing)


def measure(trials: int, flip: float) -> Section:
    """One campaign on a cluster; flip [s]: what a real trial takes, for what a million would."""
    section = Section("A trial on a Dask cluster, without its flip", TEXT)
    _, run = fresh("bench.cluster", str(trials))
    for name in ("wall", "scheduler", "driver", "worker"):
        what = "wall time, one worker" if name == "wall" else f"{name}: processor time"
        section.add(what, [run[name]], indent=int(name != "wall"))
    section.checks.append(
        f"on paper, {MILLION} trials of {flip:.2f} s on {CORES} cores: {MILLION * flip / CORES / 60:.0f} min if no core"
        f" ever waits; that is {CORES / flip:.0f} trials a second, of which one scheduler can serve"
        f" {1 / run['scheduler']:.0f} ({MILLION * run['scheduler'] / 60:.0f} min of one core in all) and one driver"
        f" {1 / run['driver']:.0f} ({MILLION * run['driver'] / 60:.0f} min)"
    )
    return section


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, int, int]]:
    """A scheduler and a worker on loopback; yields the address and both process numbers."""
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
        worker = start("worker", address, "--nthreads", "1", "--no-nanny")
        yield address, scheduler, worker
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def campaign(trials: int) -> dict[str, Any]:
    """Processor times and wall time per trial, from the tenth of the trials on [s]."""
    from bench.cluster import WORK as work  # by the name that workers know, which `__main__` is not
    from flipdiagram.campaign.checks import from_text
    from flipdiagram.campaign.run import run
    from flipdiagram.flips.store_file import open_to_read

    clock: dict[int, tuple[float, ...]] = {}
    """By the number of trials that have ended."""
    with tempfile.TemporaryDirectory() as name, cluster(Path(name)) as (address, scheduler, worker):

        def look(progress: str) -> None:
            times = (time.perf_counter(), processor_time(scheduler), time.process_time(), processor_time(worker))
            if found := re.match(r"flips (\d+)/", progress):
                clock[int(found[1])] = times

        specification = from_text(SPECIFICATION.format(trials=trials))
        ended = run(specification, Path(name) / "campaign", scheduler=address, work=work, progress=look)
        with open_to_read(ended.file) as results:
            if not all(row.failure == NOTHING for row in results.rows()):
                raise RuntimeError("trials on the cluster did not end as they should")
    begin, end = min(k for k in clock if k >= trials // 10), max(clock)
    values = [(b - a) / (end - begin) for a, b in zip(clock[begin], clock[end], strict=True)]
    return dict(zip(("wall", "scheduler", "driver", "worker"), values, strict=True))


if __name__ == "__main__":
    print(json.dumps(campaign(int(sys.argv[1]))))
