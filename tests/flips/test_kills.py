"""Real flips of either engine: driver and worker are killed with -9 ten times at random moments; no row is lost, twice
or another, and no process stays.
"""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest
from campaign.made_up import contents, finished
from patience import HUNG

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.run import run
from flipdiagram.flips import child_process
from flipdiagram.flips.store_file import open_to_read

TEXT = """
base: {simulation: {engine: ENGINE, hold_time: 0.05, settle_time: 0.02}}
vary:
  object.friction: {uniform: [0.5, 2.0]}
  arm.link_inertia_scale: {uniform: [0.9, 1.1]}
  sensors.position_noise: {loguniform: [1.0e-5, 1.0e-3]}
sampler: sobol
trials: 10
seed: 3
architectures: [pd, pd+ff+dob]
timeout: 100
"""
KILLS, ROWS = 10, 20
PROGRAM = "import sys; from flips.test_kills import kill_all; kill_all(*sys.argv[1:])"


def specification(engine):
    return from_text(TEXT.replace("ENGINE", engine))


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="processes are looked up in /proc")
@pytest.mark.parametrize("engine", ["drake", "mujoco"])
def test_ten_drivers_and_ten_workers_killed_at_random_moments_change_no_row(engine, tmp_path):
    undisturbed = contents(run(specification(engine), tmp_path / "undisturbed", jobs=2).file)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", PROGRAM, str(tmp_path), engine]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == 0, done.stderr
    drivers, workers, *children = map(int, done.stdout.split())
    assert drivers == workers == KILLS
    deadline = time.monotonic() + HUNG
    while any(map(alive, children)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert len(children) >= 2 * KILLS and not any(map(alive, children))
    file = tmp_path / "campaign.sqlite"
    kept = finished(file)
    assert 0 < len(kept) < ROWS
    assert run(specification(engine), tmp_path, jobs=2, resume=True).flown == ROWS - len(kept)
    assert kept <= finished(file)  # what was there was not flown again
    rows = contents(file)
    names = ("pd", "pd+ff+dob")
    assert Counter((row["trial"], row["architecture"]) for row in rows) == {(k, n): 1 for k in range(10) for n in names}
    assert rows == undisturbed
    outcomes = {row["outcome"] for row in rows}
    assert "turned over" in outcomes and len(outcomes) > 1 and not outcomes & {"crashed", "timeout"}
    with open_to_read(file) as results:
        assert not results.plan("nothing") and len({row.seed for row in results.rows()}) == 10


def alive(pid):
    """Whether a worker is there."""
    try:
        return b"flipdiagram.flips.child_process" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


def kill_all(out, engine):
    """Ten times: begin the campaign or go on with it, kill -9 one of its workers, then its driver.

    Runs in a process of its own without threads, which may fork and has imported everything.  Prints how many drivers
    and workers were killed, then the ids of all workers that were seen.
    """
    dice, flown, folder, kept, drivers = random.Random(6), specification(engine), Path(out), set(), 0
    seen: set[int] = set()
    killed = folder / "killed"
    killed.touch()
    for turn in range(1, KILLS + 1):
        moment, choice = dice.uniform(0.0, 0.6), dice.randrange(2)
        driver = os.fork()
        if driver == 0:
            with suppress(BaseException):
                threading.Thread(target=kill_worker, args=(moment, choice, killed), daemon=True).start()
                run(flown, folder, jobs=2, resume=True)
            os._exit(0)
        deadline = time.monotonic() + HUNG
        wanted = len(kept) + dice.randrange(2)
        while time.monotonic() < deadline and (
            count(killed) < turn or len(finished(folder / "campaign.sqlite")) < wanted
        ):
            time.sleep(0.02)
        time.sleep(dice.uniform(0.0, 0.4))  # less than a flip
        seen |= {
            int(pid) for file in Path(f"/proc/{driver}/task").glob("*/children") for pid in file.read_text().split()
        }
        os.kill(driver, signal.SIGKILL)
        drivers += os.waitstatus_to_exitcode(os.waitpid(driver, 0)[1]) == -signal.SIGKILL
        now = finished(folder / "campaign.sqlite")
        assert kept <= now, "a row that was there is gone or was written again"
        kept = now
    print(drivers, count(killed), *seen)


def kill_worker(moment, choice, killed):
    """Kill a worker of this process so long after both have begun, be it while it imports, plans or flies."""
    while len(found := child_process.children()) < 2:
        time.sleep(0.01)
    time.sleep(moment)
    found = child_process.children() or found
    os.kill(found[choice % len(found)], signal.SIGKILL)
    with open(killed, "a") as file:
        file.write("killed\n")


def count(file):
    return file.read_text().count("killed")
