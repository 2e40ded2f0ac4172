"""The same campaign on Dask: a scheduler and workers in processes of their own, on loopback."""

import json
import os
import subprocess
import sys
import time

import pytest
from campaign.made_up import QUIET, SLOW, WORK, contents
from campaign.test_campaign_flips import TEXT
from patience import HUNG

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.run import run
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips.store_file import open_to_read

pytest.importorskip("distributed")


class Cluster:
    """`dask scheduler` and `dask worker` as a user starts them."""

    def __init__(self, folder):
        self.file = folder / "scheduler.json"
        self.processes = []
        self.start("scheduler", "--port", "0", "--scheduler-file", str(self.file))
        deadline = time.monotonic() + HUNG
        while not self.file.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.2)
        self.address = json.loads(self.file.read_text())["address"]

    def start(self, *words):
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        command = [sys.executable, "-m", "dask", words[0], *words[1:], "--host", "127.0.0.1", "--no-dashboard"]
        log = subprocess.DEVNULL
        self.processes.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log, cwd=self.file.parent))
        return self.processes[-1]

    def worker(self, *words):
        return self.start("worker", self.address, "--nthreads", "1", *words)

    def end(self):
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            try:
                process.wait(2)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers, one under a nanny; the tests below use it in their order."""
    made = Cluster(tmp_path_factory.mktemp("dask"))
    made.worker("--no-nanny")
    made.worker()
    yield made
    made.end()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return contents(run(from_text(QUIET), tmp_path_factory.mktemp("local"), jobs=2, work=WORK).file)


def test_real_flips_are_the_same_on_dask(cluster, tmp_path):
    assert cluster.address.startswith("tcp://127.0.0.1:")
    ended = run(from_text(TEXT), tmp_path / "dask", scheduler=cluster.address)
    assert "Dask at tcp://127.0.0.1:" in ended.workers
    assert contents(ended.file) == contents(run(from_text(TEXT), tmp_path / "here", jobs=2).file)


def test_rows_are_the_same_where_a_worker_is_killed_and_another_joins(cluster, tmp_path, undisturbed):
    done = []

    def disturb(text):
        done.append(text)
        if "flips 20/60" in text:
            cluster.processes[1].kill()
            cluster.worker("--no-nanny")

    ended = run(from_text(QUIET), tmp_path, scheduler=cluster.address, work=SLOW, progress=disturb)
    assert any("flips 20/60" in text for text in done)
    assert contents(ended.file) == undisturbed


def test_a_scheduler_that_goes_away_is_one_line_and_the_rest_is_flown_elsewhere(cluster, tmp_path, undisturbed):
    def end(text):
        if "flips 10/60" in text:
            cluster.processes[0].kill()

    with pytest.raises(SimulationError, match=r"gone.*--resume"):
        run(from_text(QUIET), tmp_path, scheduler=cluster.address, work=SLOW, progress=end)
    with open_to_read(tmp_path / "campaign.sqlite") as results:
        assert 10 <= len(results.done()) < 60
    run(from_text(QUIET), tmp_path, jobs=2, resume=True, work=WORK)
    assert contents(tmp_path / "campaign.sqlite") == undisturbed


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://"])
def test_no_scheduler_is_one_line(address, tmp_path, monkeypatch):
    monkeypatch.setattr("flipdiagram.flips.workers.CONNECT_TIMEOUT", 1.0)
    with pytest.raises(InputError, match="--scheduler") as caught:
        run(from_text(QUIET), tmp_path, scheduler=address, work=WORK)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "campaign.sqlite").exists()
