"""The file of stored flips: what goes wrong with it is one line that names it, and nothing in it is lost."""

import json
import multiprocessing
import os
import sqlite3
import subprocess
import sys
import zlib
from contextlib import closing
from dataclasses import astuple, fields
from pathlib import Path

import pytest
from campaign.made_up import QUIET
from ideal import IDEAL
from patience import HUNG

from flipdiagram.campaign.checks import from_text
from flipdiagram.errors import InputError
from flipdiagram.flips import store_file
from flipdiagram.flips.flight import Flight, Landed
from flipdiagram.flips.order import row_of
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.row import Row
from flipdiagram.flips.store import SCHEMA, digest_of
from flipdiagram.flips.store_file import APPLICATION, is_running, open_to_read, open_to_write
from flipdiagram.simulation.events import Touchdown
from flipdiagram.simulation.metrics import FlipMetrics

WORLD = {"trials": 2000, "architectures": ["pd"], "vary": [{"name": "a"}, {"name": "b"}]}
META = {"digest": digest_of(WORLD), "specification": json.dumps(WORLD), "rows": "60"}


def row(k, text="x"):
    return Row(
        k,
        "pd",
        "slid later",
        text,
        1,
        "hash",
        {"object.friction": 1.0},
        [1.0, 2.0],
        None,
        None,
        "c",
        {},
        0.1,
        "h",
        1,
        5.0,
    )


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "campaign.sqlite"
    with open_to_write(path, META, resume=False) as results:
        results.put([row(k).packed() for k in range(5)])
    return path


def refused(path, *words, meta=META, resume=True, reading=True):
    def write():
        with open_to_write(path, meta, resume):
            pass

    def read():
        with open_to_read(path) as results:
            list(results.rows())

    for use in (write, read) if reading else (write,):
        with pytest.raises(InputError) as caught:
            use()
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)
        for word in words:
            assert word in str(caught.value)


def test_rows_come_back_as_they_were_put_and_the_file_is_one_file(file):
    with open_to_read(file) as results:
        assert list(results.rows()) == [row(k) for k in range(5)]
        assert results.counts() == [("pd", "slid later", 5)]
        assert results.meta() == META
    assert sorted(path.name for path in file.parent.iterdir()) == ["campaign.sqlite", "campaign.sqlite.lock"]


def test_a_row_cannot_be_written_twice(file):
    with open_to_write(file, META) as results:
        with pytest.raises(InputError, match="UNIQUE"):
            results.put([row(7).packed(), row(3).packed()])
        assert len(results.done()) == 5  # neither
        results.put([row(7).packed()])
    with open_to_read(file) as results:
        assert len(results.done()) == 6


def test_without_resume_a_file_is_left_alone(file):
    before = file.read_bytes()
    refused(file, "5 of 60 flips", "--resume", resume=False, reading=False)
    assert file.read_bytes() == before


def test_another_campaign_is_refused(file):
    assert from_text(QUIET.replace("seed: 7", "seed: 8")).digest != from_text(QUIET).digest
    refused(file, "another campaign", meta=META | {"digest": "e"}, reading=False)


def test_a_second_campaign_on_the_same_file_is_refused_and_the_first_goes_on(file):
    with open_to_write(file, META) as results:
        assert is_running(file)
        refused(file, f"process {os.getpid()}", "written", reading=False)
        results.put([row(9).packed()])
        with open_to_read(file) as watched:  # reading is allowed
            assert len(watched.done()) == 6
    assert not is_running(file)


def test_a_lock_goes_with_its_process(file):
    def hold(ready):
        with open_to_write(file, META):
            ready.send(1)
            ready.recv()

    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=hold, args=(theirs,))
    process.start()
    assert ours.recv() == 1 and is_running(file)
    refused(file, f"process {process.pid}", reading=False)
    process.kill()
    process.join()
    assert not is_running(file)
    with open_to_write(file, META) as results:
        assert len(results.done()) == 5


def test_a_newer_version_is_refused_and_left_alone(file):
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("PRAGMA user_version = 99")
    database.close()
    refused(file, "version 99", "newer")
    with closing(sqlite3.connect(file)) as database, database:
        assert database.execute("SELECT count(*) FROM trials").fetchone() == (5,)
    database.close()


@pytest.mark.parametrize("content", [b"a letter, not a database\n" * 100, b"x"])
def test_what_is_no_database_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "campaign.sqlite"
    path.write_bytes(content)
    refused(path, "not a database")
    assert path.read_bytes() == content


def test_a_database_of_something_else_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE letters (text TEXT)")
    database.close()
    before = path.read_bytes()
    refused(path, "not of a campaign or study")
    assert path.read_bytes() == before


def test_the_flips_of_a_study_are_no_campaign(tmp_path):
    with open_to_write(tmp_path / "runs.sqlite", {"digest": "flips of studies"}) as store:
        store.put([row("a key").packed()])
        assert store.outcome("a key", "pd").failure == "x" and store.outcome("a key", "pd+ff") is None
    with pytest.raises(InputError, match="not of a campaign"), open_to_read(tmp_path / "runs.sqlite"):
        pass


def test_a_file_of_version_1_of_a_study_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "runs.sqlite"
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE flips (key TEXT PRIMARY KEY, outcome TEXT)")
        database.execute("PRAGMA user_version = 1")
    database.close()
    before = path.read_bytes()
    refused(path, "version 1", "--out")
    assert path.read_bytes() == before


def test_a_file_of_version_1_of_a_campaign_is_read_and_gone_on_with(tmp_path):
    path = tmp_path / "campaign.sqlite"
    columns = SCHEMA.replace("trial ANY NOT NULL", "trial INTEGER NOT NULL")
    assert columns != SCHEMA
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(columns)
        database.executemany("INSERT INTO meta VALUES (?, ?)", META.items())
        database.execute(f"PRAGMA application_id = {APPLICATION}")
        database.execute("PRAGMA user_version = 1")
    database.close()
    with open_to_write(path, META) as store:
        store.put([row(3).packed(), row(1).packed()])
    with open_to_read(path) as store:
        assert list(store.rows()) == [row(1), row(3)]


def test_a_row_with_numbers_that_are_none_comes_back_as_it_was():
    numbers = {field.name: 0.1 + k / 3 for k, field in enumerate(fields(FlipMetrics))}
    plain = {"architecture": "pd", "success": False, "failure": "dropped", "max_torque_Nm": [1.0, 2.0]}
    for touchdown in (None, Touchdown(0.5, 0.01, 0.205, 3.0)):
        some = {"touchdown": touchdown, "landing_cost_J": float("nan"), "start_y_m": -0.0, "release_time_s": 5e-324}
        before = Outcome(FlipMetrics(**numbers | plain | some), "dropped", {"cost_J": 1.25}, 0.5)
        flight = Flight("key", IDEAL, IDEAL, "pd")
        written = row_of(flight, Landed(before, 1.0, "c", {}, "h"))
        after = json.loads(json.dumps(written.metrics)), written.failure, written.plan
        assert repr(Outcome.from_row(*after)) == repr(before)  # nan differs from itself, its text does not
    lost = Outcome(None, "no plan: too far")
    assert Outcome.from_row(None, lost.failure, None) == lost and not lost.success


def test_plans_are_kept_and_why_there_is_none(tmp_path):
    with open_to_write(tmp_path / "deep" / "runs.sqlite", META) as store:
        store.put_plans({"p": (zlib.compress(b"packed"), None), "q": (None, "too far")})
    with open_to_write(tmp_path / "deep" / "runs.sqlite", META) as store:
        assert [store.plan(key) for key in "pqr"] == [(zlib.compress(b"packed"), None), (None, "too far"), None]


def test_every_row_is_on_the_disk_before_the_next_is_begun(tmp_path):
    """A process that is killed in the middle of writing leaves all that it had put."""
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from flipdiagram.flips.row import Row; from flipdiagram.flips.store_file import open_to_write\n"
        f"with open_to_write(Path(sys.argv[1]), {META}) as store:\n"
        f"    for k in range(20): store.put([Row(k, *{astuple(row(0))[1:]}).packed()])\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = tmp_path / "runs.sqlite"
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == -9, done.stderr
    with open_to_write(path, META) as store:
        assert list(store.rows()) == [row(k) for k in range(20)]


def test_a_file_that_another_process_holds_is_waited_for_and_then_named(file, monkeypatch):
    monkeypatch.setattr(store_file, "PATIENCE", 0.1)
    other = sqlite3.connect(file, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    try:
        refused(file, "locked")
    finally:
        other.close()


def test_a_damaged_file_is_refused(file):
    with open_to_write(file, META) as results:
        results.put([row(k, "y" * 300).packed() for k in range(100, 400)])
    data = bytearray(file.read_bytes())
    data[4096 * 6 :] = b"\xff" * (len(data) - 4096 * 6)
    file.write_bytes(bytes(data))
    refused(file, "damaged")


def test_a_full_disk_is_one_line_and_what_was_finished_stays(file):
    with open_to_write(file, META) as results:
        pages = results._database.execute("PRAGMA page_count").fetchone()[0]
        results._database.execute(f"PRAGMA max_page_count = {pages + 3}")
        with pytest.raises(InputError, match="full"):
            for k in range(10, 1000):
                results.put([row(k, "z" * 3000).packed()])
    with open_to_read(file) as results:
        there = len(results.done())
    assert 5 < there < 100
    with open_to_write(file, META) as results:  # space again
        results.put([row(1000).packed()])
        assert len(results.done()) == there + 1


def test_a_place_where_nothing_can_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    refused(tmp_path / "file" / "campaign.sqlite", reading=False)
    (tmp_path / "folder" / "campaign.sqlite").mkdir(parents=True)
    refused(tmp_path / "folder" / "campaign.sqlite")
    refused(Path("/proc/self/runs.sqlite"), reading=False)  # where even root may not
    with pytest.raises(InputError, match="No such file"), open_to_read(tmp_path / "nothing"):
        pass
