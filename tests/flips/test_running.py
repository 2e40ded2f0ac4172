"""The driver: the same rows from any number of processes, whatever hangs, dies or is killed."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections import Counter

import pytest
from campaign.made_up import (
    DIES,
    DIVERGES,
    DRIVER,
    HANGS,
    KILLER,
    NO_PLAN,
    PLAN_HANGS,
    QUIET,
    RAISES,
    REFUSES,
    SLOW,
    WORK,
    contents,
    finished,
)
from patience import HUNG

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.run import run
from flipdiagram.flips import child_process
from flipdiagram.flips.store_file import open_to_read


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return contents(run(from_text(QUIET), tmp_path_factory.mktemp("quiet"), jobs=1, work=WORK).file)


def test_every_trial_is_there_once_in_every_architecture(undisturbed):
    assert [(row["trial"], row["architecture"]) for row in undisturbed] == [
        (k, name) for k in range(30) for name in ("pd", "pd+ff+dob")
    ]
    specification = from_text(QUIET)
    for row in undisturbed:
        trial = specification.trial(row["trial"])
        assert row["seed"] == trial.seed and tuple(row["values"]) == trial.values
        border = 0.9 if "dob" in row["architecture"] else 1.4
        assert (row["outcome"] == "turned over") == (trial.overrides["object.friction"] > border)
        assert row["failure"] == (
            None if row["outcome"] == "turned over" else "slid later from 0.150 s, dropped at 0.200 s"
        )
        assert row["metrics"]["torque_use"] == 0.5 and row["versions"]["drake"]
        assert "solve_time_s" not in row["plan"]


@pytest.mark.parametrize("jobs", [2, 4])
def test_rows_do_not_depend_on_the_number_of_processes(jobs, tmp_path, undisturbed):
    ended = run(from_text(QUIET), tmp_path, jobs=jobs, work=WORK)
    assert contents(ended.file) == undisturbed
    assert ended.flown == 60 and ended.workers == f"{jobs} processes"
    assert child_process.children() == []


def test_a_shared_motion_is_planned_once_and_one_of_its_own_once_a_trial(tmp_path, monkeypatch):
    monkeypatch.setenv("PLANS_MADE", str(tmp_path / "plans"))
    run(from_text(QUIET), tmp_path / "a", jobs=2, work=WORK)
    assert (tmp_path / "plans").read_text().count("planned") == 1
    own = QUIET.replace("object.mass: {uniform: [0.05, 0.07]}", "task.start_y: {uniform: [0.0, 0.1]}")
    run(from_text(own), tmp_path / "b", jobs=2, work=WORK)
    assert (tmp_path / "plans").read_text().count("planned") == 1 + 30
    before = contents(tmp_path / "b" / "campaign.sqlite")
    assert run(from_text(own), tmp_path / "b", jobs=2, resume=True, work=WORK).flown == 0
    assert contents(tmp_path / "b" / "campaign.sqlite") == before
    assert (tmp_path / "plans").read_text().count("planned") == 1 + 30


BAD = f"""
base: {{simulation: {{hold_time: 0.05, settle_time: 0.05}}}}
vary:
  object.mass: {{grid: [0.06, {HANGS}, {DIES}, {RAISES}, {DIVERGES}, {REFUSES}]}}
  planner.friction_margin: {{grid: [0.2, {NO_PLAN}, {PLAN_HANGS}]}}
sampler: grid
architectures: [pd]
timeout: 1.5
"""


def test_what_goes_wrong_with_a_trial_is_its_outcome_and_not_the_end(tmp_path):
    specification = from_text(BAD)
    rows = contents(run(specification, tmp_path, jobs=4, work=WORK).file)
    assert len(rows) == 18
    found = {tuple(row["values"]): (row["outcome"], row["failure"]) for row in rows}
    assert found[0.06, 0.2][0] in ("turned over", "slid later", "tipped")
    assert found[HANGS, 0.2] == ("timeout", "timeout: took longer than 1.5 s")
    assert found[DIES, 0.2][0] == "crashed" and "5 times" in found[DIES, 0.2][1]
    assert found[RAISES, 0.2] == ("crashed", "crashed: ZeroDivisionError: a bug")
    assert found[DIVERGES, 0.2][0] == "diverged" and found[REFUSES, 0.2][0] == "refused"
    for mass in (0.06, HANGS, DIES, RAISES, DIVERGES, REFUSES):
        assert found[mass, NO_PLAN] == ("no plan", "no plan: no horizon is feasible")
        assert found[mass, PLAN_HANGS] == ("timeout", "timeout: planning took longer than 1.5 s")
    with open_to_read(tmp_path / "campaign.sqlite") as results:
        attempts = {tuple(row.values): row.attempts for row in results.rows()}
    assert attempts[DIES, 0.2] == 5 and attempts[HANGS, 0.2] == attempts[RAISES, 0.2] == 1


def test_workers_killed_at_ten_random_moments_cost_nothing(tmp_path, undisturbed):
    dice = random.Random(4)
    moments, killed = dice.sample(range(2, 58), 10), []

    def kill_one(text):
        if (found := re.match(r"flips (\d+)/60", text)) and int(found[1]) in moments:
            time.sleep(dice.uniform(0.0, 0.03))
            killed.append(dice.choice(child_process.children()))
            os.kill(killed[-1], signal.SIGKILL)

    ended = run(from_text(QUIET), tmp_path, jobs=2, work=SLOW, progress=kill_one)
    assert len(killed) == 10
    assert contents(ended.file) == undisturbed


def test_a_driver_killed_ten_times_at_random_moments_loses_nothing_and_repeats_nothing(tmp_path, undisturbed):
    command = [sys.executable, "-c", KILLER, QUIET, str(tmp_path), "10", "60"]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == 0, done.stderr
    kills, there = map(int, done.stdout.split())
    assert kills == 10 and 10 <= there < 60
    file = tmp_path / "campaign.sqlite"
    kept = finished(file)
    assert run(from_text(QUIET), tmp_path, jobs=2, resume=True, work=WORK).flown == 60 - there
    assert kept <= finished(file)
    assert contents(file) == undisturbed


def environment():
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def test_children_end_with_a_driver_that_is_killed(tmp_path):
    hanging = QUIET.replace("uniform: [0.05, 0.07]", f"choice: [{HANGS}]")
    command = [sys.executable, "-c", DRIVER, hanging, str(tmp_path), "2"]
    process = subprocess.Popen(command, env=environment())
    found: list[int] = []
    deadline = time.monotonic() + HUNG
    while len(found) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
        found = _children_of(process.pid)
    time.sleep(1.0)  # they hang now, or are about to
    process.kill()
    process.wait()
    deadline = time.monotonic() + HUNG
    while any(map(_alive, found)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(found) == 2 and not any(map(_alive, found))


def _children_of(pid):
    psutil = pytest.importorskip("psutil")
    return [child.pid for child in psutil.Process(pid).children()]


def _alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_child_is_replaced_after_its_share_of_calls_and_the_rows_are_the_same(tmp_path, monkeypatch, undisturbed):
    monkeypatch.setattr(child_process, "RECYCLED_AFTER", 20)
    begun = Counter()
    create = child_process.Child.__init__

    def counted(self):
        create(self)
        begun["children"] += 1

    monkeypatch.setattr(child_process.Child, "__init__", counted)
    assert contents(run(from_text(QUIET), tmp_path, jobs=2, work=WORK).file) == undisturbed
    assert 4 <= begun["children"] <= 5  # 61 calls of at most 20


def test_an_interrupt_ends_the_children_and_keeps_what_has_ended(tmp_path, undisturbed):
    def interrupt(text):
        if "12/60" in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(from_text(QUIET), tmp_path, jobs=2, work=SLOW, progress=interrupt)
    assert child_process.children() == []
    with open_to_read(tmp_path / "campaign.sqlite") as results:
        there = len(results.done())
    assert 12 <= there < 60
    assert run(from_text(QUIET), tmp_path, jobs=2, resume=True, work=SLOW).flown == 60 - there
    assert contents(tmp_path / "campaign.sqlite") == undisturbed


def test_nothing_listens(tmp_path, monkeypatch):
    import socket

    def refuse(*arguments):
        raise AssertionError("a socket listens")

    monkeypatch.setattr(socket.socket, "listen", refuse)
    monkeypatch.setattr(socket.socket, "bind", refuse)
    assert run(from_text(QUIET.replace("trials: 30", "trials: 2")), tmp_path, jobs=2, work=WORK).flown == 4


def test_pickles_are_read_from_the_driver_s_socket_only():
    from pathlib import Path

    package = Path(child_process.__file__).parent
    using = [path.name for path in package.glob("*.py") if "pickle." in path.read_text()]
    assert using == ["child_process.py"]
    text = (package / "child_process.py").read_text()
    assert text.count("pickle.") == 1 and "pickle.loads(message)" in text and "yaml" not in text
