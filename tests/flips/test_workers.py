"""Workers end with their parent, however it ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from flips.tasks import die, divide, pid_after, refuse, take
from patience import HUNG

from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips.child_process import Limits, TrialError, TrialLimitError, children
from flipdiagram.flips.workers import Workers

SCRIPT = """
import sys
sys.path = [sys.argv[1], *sys.path]
from flips.tasks import hold_the_interpreter, pid_after
from flipdiagram.flips.workers import Workers

with Workers(1) as workers:
    pid = workers.submit(pid_after, (0,)).result()
    call = workers.submit(globals()[sys.argv[2]], (600,))
    print(pid, flush=True)
    call.result()
"""


def test_what_a_task_raises_is_raised_here():
    with Workers(2) as workers:
        assert sorted(workers.results(divide, [(2,), (4,)])) == [(0, 0.5), (1, 0.25)]
        with pytest.raises(InputError, match="file = 'a'; valid is another") as caught:
            list(workers.results(refuse, [("a",)]))
        assert caught.value.value == "a"
        with pytest.raises(TrialError, match="ZeroDivisionError"):
            list(workers.results(divide, [(0,)]))
        with pytest.raises(SimulationError, match="ended unexpectedly"):
            list(workers.results(die, [()]))
    assert children() == []


def test_an_error_ends_the_workers_at_once():
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt), Workers(2) as workers:
        for _ in workers.results(pid_after, [(0,), (600,)]):
            raise KeyboardInterrupt
    assert time.monotonic() - begin < 300 and children() == []


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="processes are looked up in /proc")
@pytest.mark.parametrize("task", ["pid_after", "hold_the_interpreter"])
def test_workers_of_a_killed_parent_do_not_stay(task):
    if task == "hold_the_interpreter" and sys.platform != "linux":
        pytest.skip("only Linux ends a process with its parent whatever it does")
    command = [sys.executable, "-c", SCRIPT, str(Path(__file__).parents[1]), task]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    worker = int(parent.stdout.readline())
    assert alive(worker)
    time.sleep(0.5)  # it has begun
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + HUNG
    while alive(worker) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not alive(worker)


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="memory is looked up in /proc")
def test_a_call_that_takes_too_much_memory_or_time_is_ended():
    with Workers(1) as workers:
        for arguments, limits, kind in (((0.4,), Limits(600, 0.4), "memory"), ((0.0,), Limits(0.3, 4), "timeout")):
            with pytest.raises(TrialLimitError) as caught:
                workers.submit(take, arguments, limits).result()
            assert caught.value.kind == kind and "took" in str(caught.value)
        assert workers.submit(divide, (2,), Limits(600, 0.4)).result() == 0.5
    assert children() == []
