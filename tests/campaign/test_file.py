"""The file of a campaign: what goes wrong with it is one line that names it, and nothing in it is lost."""

import multiprocessing
import os
import sqlite3

import pytest
from campaign.made_up import QUIET, WORK, contents

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.conduct import run
from flipdiagram.campaign.opening import begun, is_running, opened
from flipdiagram.campaign.results import Row
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips.store import Store

META = {"code": "c", "versions": "{}", "begun": "0"}
SPECIFICATION = from_text(QUIET)


def row(k, text="x"):
    return Row(
        k,
        "pd",
        "slid off",
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
    with begun(path, SPECIFICATION, META, resume=False) as results:
        results.put([row(k) for k in range(5)])
    return path


def refused(path, *words, specification=SPECIFICATION, resume=True, reading=True):
    def write():
        with begun(path, specification, META, resume):
            pass

    def read():
        with opened(path) as results:
            list(results.rows())

    for use in (write, read) if reading else (write,):
        with pytest.raises(InputError) as caught:
            use()
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)
        for word in words:
            assert word in str(caught.value)


def test_rows_come_back_as_they_were_put_and_the_file_is_one_file(file):
    with opened(file) as results:
        assert list(results.rows()) == [row(k) for k in range(5)]
        assert results.counts() == [("pd", "slid off", 5)]
        assert results.meta()["digest"] == SPECIFICATION.digest
    assert sorted(path.name for path in file.parent.iterdir()) == ["campaign.sqlite", "campaign.sqlite.lock"]


def test_a_row_cannot_be_written_twice(file):
    with begun(file, SPECIFICATION, META, resume=True) as results:
        with pytest.raises(InputError, match="UNIQUE"):
            results.put([row(7), row(3)])
        assert len(results.done()) == 5  # neither
        results.put([row(7)])
    with opened(file) as results:
        assert len(results.done()) == 6


def test_without_resume_a_file_is_left_alone(file):
    before = file.read_bytes()
    refused(file, "5 of 60 flips", "--resume", resume=False, reading=False)
    assert file.read_bytes() == before


def test_another_campaign_is_refused(file):
    other = from_text(QUIET.replace("seed: 7", "seed: 8"))
    refused(file, "another campaign", specification=other, reading=False)


def test_a_second_campaign_on_the_same_file_is_refused_and_the_first_goes_on(file):
    with begun(file, SPECIFICATION, META, resume=True) as results:
        assert is_running(file)
        refused(file, f"process {os.getpid()}", "written", reading=False)
        results.put([row(9)])
        with opened(file) as watched:  # reading is allowed
            assert len(watched.done()) == 6
    assert not is_running(file)


def test_a_lock_goes_with_its_process(file):
    def hold(ready):
        with begun(file, SPECIFICATION, META, resume=True):
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
    with begun(file, SPECIFICATION, META, resume=True) as results:
        assert len(results.done()) == 5


def test_a_newer_version_is_refused_and_left_alone(file):
    with sqlite3.connect(file) as database:
        database.execute("PRAGMA user_version = 99")
    database.close()
    refused(file, "version 99", "newer")
    with sqlite3.connect(file) as database:
        assert database.execute("SELECT count(*) FROM trials").fetchone() == (5,)
    database.close()


@pytest.mark.parametrize("content", [b"a letter, not a database\n" * 100, b"x"])
def test_what_is_no_database_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "campaign.sqlite"
    path.write_bytes(content)
    refused(path, "not a database")
    assert path.read_bytes() == content


def test_a_database_of_something_else_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        store.put_outcome("k", "pd", "", "{}", 0.0)
    refused(path, "not of a campaign")
    with Store(path) as store:
        assert store.outcome("k") == "{}"


def test_a_damaged_file_is_refused(file):
    with begun(file, SPECIFICATION, META, resume=True) as results:
        results.put([row(k, "y" * 300) for k in range(100, 400)])
    data = bytearray(file.read_bytes())
    data[4096 * 6 :] = b"\xff" * (len(data) - 4096 * 6)
    file.write_bytes(bytes(data))
    refused(file, "cannot be used")


def test_a_full_disk_is_one_line_and_what_was_finished_stays(file):
    with begun(file, SPECIFICATION, META, resume=True) as results:
        pages = results._database.execute("PRAGMA page_count").fetchone()[0]
        results._database.execute(f"PRAGMA max_page_count = {pages + 3}")
        with pytest.raises(InputError, match="full"):
            for k in range(10, 1000):
                results.put([row(k, "z" * 3000)])
    with opened(file) as results:
        there = len(results.done())
    assert 5 < there < 100
    with begun(file, SPECIFICATION, META, resume=True) as results:  # space again
        results.put([row(1000)])
        assert len(results.done()) == there + 1


def test_a_place_where_nothing_can_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    refused(tmp_path / "file" / "campaign.sqlite", reading=False)
    (tmp_path / "folder" / "campaign.sqlite").mkdir(parents=True)
    refused(tmp_path / "folder" / "campaign.sqlite")
    with pytest.raises(InputError, match="is no file"), opened(tmp_path / "nothing"):
        pass


def test_other_code_is_refused_unless_told(tmp_path):
    few = from_text(QUIET.replace("trials: 30", "trials: 2"))
    file = run(few, tmp_path, jobs=1, work=WORK).file
    with sqlite3.connect(file) as database:
        database.execute("UPDATE meta SET value = 'older' WHERE key = 'code'")
        database.execute("DELETE FROM trials WHERE trial = 1")
    database.close()
    with pytest.raises(InputError, match="other code or versions"):
        run(few, tmp_path, jobs=1, resume=True, work=WORK)
    assert run(few, tmp_path, jobs=1, resume=True, any_version=True, work=WORK).flown == 2


def test_a_worker_with_other_code_ends_the_campaign(tmp_path, monkeypatch):
    monkeypatch.setattr("flipdiagram.campaign.conduct.provenance", lambda: ("mine", {}, "here"))
    with pytest.raises(SimulationError, match="was changed"):
        run(from_text(QUIET), tmp_path, jobs=1, work=WORK)


def test_trials_that_are_drawn_differently_now_are_refused(tmp_path):
    few = from_text(QUIET.replace("trials: 30", "trials: 2"))
    file = run(few, tmp_path, jobs=1, work=WORK).file
    before = contents(file)
    with sqlite3.connect(file) as database:
        database.execute("UPDATE trials SET scenario_hash = 'other' WHERE trial = 1")
    database.close()
    with pytest.raises(InputError, match="trial 1 is drawn differently"):
        run(few, tmp_path, jobs=1, resume=True, work=WORK)
    assert len(contents(file)) == len(before)
