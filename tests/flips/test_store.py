"""Where finished flips are kept: nothing is lost, and what goes wrong is one line that names the file."""

import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from patience import HUNG

from flipdiagram.errors import InputError
from flipdiagram.flips import store as module
from flipdiagram.flips.store import VERSION, Store

ROW = ("pd", "arm: {}", '{"metrics": null}', 1.5)


def test_what_is_kept_is_found_again_and_what_is_not_is_none(tmp_path):
    path = tmp_path / "deep" / "runs.sqlite"
    with Store(path) as store:
        assert store.outcome("a") is None and store.plan("a") is None
        store.put_outcome("a", *ROW)
        store.put_plan("p", "{}", None)
        store.put_plan("q", None, "too far")
    with Store(path) as store:
        assert store.outcome("a") == ROW[2]
        assert store.plan("p") == ("{}", None)
        assert store.plan("q") == (None, "too far")
        store.put_outcome("a", "pd", "", "again", 0.0)
        assert store.outcome("a") == "again"
        assert store.outcome("b") is None


def test_every_entry_is_on_the_disk_before_the_next_is_begun(tmp_path):
    """A process that is killed in the middle of writing leaves all that it had put."""
    program = (
        "import os, signal, sys; from pathlib import Path; from flipdiagram.flips.store import Store\n"
        "with Store(Path(sys.argv[1])) as store:\n"
        "    for k in range(20): store.put_outcome(str(k), 'pd', '', f'outcome {k}', 0.0)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = tmp_path / "runs.sqlite"
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == -9, done.stderr
    with Store(path) as store:
        assert [store.outcome(str(k)) for k in range(20)] == [f"outcome {k}" for k in range(20)]


def test_two_stores_on_one_file_lose_nothing(tmp_path):
    path, count, errors = tmp_path / "runs.sqlite", 40, []

    def write(name):
        try:
            with Store(path) as store:
                for k in range(count):
                    store.put_outcome(f"{name}{k}", "pd", "", name, 0.0)
        except Exception as error:  # a thread's error would go unseen
            errors.append(error)

    threads = [threading.Thread(target=write, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    with Store(path) as store, Store(path) as other:
        assert all(store.outcome(f"{name}{k}") == name for name in "ab" for k in range(count))
        store.put_outcome("new", *ROW)
        assert other.outcome("new") == ROW[2]  # seen at once


def test_two_stores_that_open_a_new_file_at_once_both_get_it(tmp_path):
    """A race, so many times over: without patience about one in ten fails."""
    for k in range(40):
        path, errors, together = tmp_path / f"{k}.sqlite", [], threading.Barrier(2)

        def begin(name, path=path, errors=errors, together=together):
            together.wait()
            try:
                with Store(path) as store:
                    store.put_outcome(name, *ROW)
            except Exception as error:
                errors.append(error)

        threads = [threading.Thread(target=begin, args=(name,)) for name in "ab"]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not errors


def refused(path, *words):
    with pytest.raises(InputError) as caught, Store(path) as store:
        store.outcome("a")
        store.put_outcome("a", *ROW)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_a_file_of_a_newer_version_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        store.put_outcome("a", *ROW)
    connection = sqlite3.connect(path)
    connection.execute(f"PRAGMA user_version = {VERSION + 1}")
    connection.close()
    before = path.read_bytes()
    refused(path, f"version {VERSION + 1}", "newer", f"at most {VERSION}")
    assert path.read_bytes() == before


def test_a_damaged_file_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "runs.sqlite"
    path.write_bytes(b"this is a letter, not a database\n" * 100)
    before = path.read_bytes()
    refused(path, "not a database")
    assert path.read_bytes() == before


def test_a_file_with_a_damaged_page_is_refused(tmp_path):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        for k in range(200):
            store.put_outcome(f"{k:04d}", "pd", "", "x" * 200, 0.0)
    data = bytearray(path.read_bytes())
    data[4096:] = b"\xff" * (len(data) - 4096)  # all but the first page
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match="malformed"), Store(path) as store:
        for k in range(200):
            store.outcome(f"{k:04d}")


def test_a_full_disk_is_one_line_and_what_was_finished_stays(tmp_path):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        store.put_outcome("first", *ROW)
        store._database.execute("PRAGMA max_page_count = 8")
        with pytest.raises(InputError, match="full"):
            for k in range(100):
                store.put_outcome(f"k{k}", "pd", "", "x" * 4000, 0.0)
        assert store.outcome("first") == ROW[2]
        kept = [k for k in range(100) if store.outcome(f"k{k}") is not None]
        assert kept == list(range(len(kept))) and 0 < len(kept) < 100
    with Store(path) as store:
        assert [k for k in range(100) if store.outcome(f"k{k}") is not None] == kept


def test_a_file_that_another_process_holds_is_waited_for_and_then_named(tmp_path, monkeypatch):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        store.put_outcome("a", *ROW)
    monkeypatch.setattr(module, "PATIENCE", 0.1)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    try:
        refused(path, "locked")
    finally:
        other.close()


def test_a_place_where_nothing_can_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    refused(tmp_path / "file" / "runs.sqlite")
    (tmp_path / "folder" / "runs.sqlite").mkdir(parents=True)
    refused(tmp_path / "folder" / "runs.sqlite", "unable to open")


def test_a_folder_that_even_root_may_not_write_to_is_named():
    refused(Path("/proc/self/runs.sqlite"), "unable to open")
