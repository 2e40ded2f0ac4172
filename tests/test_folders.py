"""A folder of results: of one run at any time, however a run ends, beside what other people keep there."""

import itertools
import os
import shutil
from pathlib import Path

import pytest

from flipdiagram.errors import InputError
from flipdiagram.files import OWN, write_atomically
from flipdiagram.folders import bring_back, renewed, set_aside

OLD = {"pd.nc": "old", "recordings/a.nc": "old", "fig.png": "old", "summary.json": "old"}
NEW = {"pd.nc": "new", "pd+dob.nc": "new", "recordings/b.nc": "new", "summary.json": "new"}


def run(folder, files, summary="summary.json"):
    with renewed(folder, summary):
        for name, text in files.items():
            write_atomically(folder / name, text)


def held(folder):
    """{name: text} of what a user sees, save the notes of his own; no temporary files."""
    paths = [p for p in folder.rglob("[!.]*") if p.is_file() and OWN not in p.parts]
    return {p.relative_to(folder).as_posix(): p.read_text() for p in paths if p.name != "notes.txt"}


@pytest.fixture
def folder(tmp_path):
    run(tmp_path, OLD)
    (tmp_path / "notes.txt").write_text("mine")
    return tmp_path


def test_a_run_replaces_all_that_the_one_before_wrote_and_nothing_else(folder):
    run(folder, NEW)
    assert held(folder) == NEW and (folder / "notes.txt").read_text() == "mine"
    assert os.listdir(folder / OWN) == ["summary.files"]


def test_a_run_that_writes_nothing_leaves_all_as_it_was(folder):
    with pytest.raises(InputError, match="refused"), renewed(folder, "summary.json"):
        assert held(folder) == {}
        raise InputError("refused")
    assert held(folder) == OLD
    run(folder, NEW)
    assert held(folder) == NEW


def test_a_refused_run_leaves_no_folder_behind(tmp_path):
    with pytest.raises(InputError, match="refused"), renewed(tmp_path / "a" / "b", "summary.json"):
        raise InputError("refused")
    assert not (tmp_path / "a").exists()


def test_an_interrupted_run_keeps_what_it_wrote_and_nothing_of_the_one_before(folder):
    with pytest.raises(KeyboardInterrupt), renewed(folder, "summary.json"):
        write_atomically(folder / "pd.nc", "new")
        raise KeyboardInterrupt
    assert held(folder) == {"pd.nc": "new"}


def test_what_is_right_in_both_runs_is_brought_back(folder):
    with renewed(folder, "summary.json"):
        assert set_aside(folder, "recordings/a.nc").read_text() == "old"
        bring_back(folder, "recordings/a.nc")
    assert held(folder) == {"recordings/a.nc": "old"}
    run(folder, NEW)
    assert held(folder) == NEW


def test_runs_with_summaries_of_different_names_live_side_by_side(folder):
    run(folder, {"tuning.json": "tuned", "tuning.png": "tuned"}, "tuning.json")
    assert held(folder) == OLD | {"tuning.json": "tuned", "tuning.png": "tuned"}
    run(folder, NEW)
    assert held(folder) == NEW | {"tuning.json": "tuned", "tuning.png": "tuned"}


def test_results_without_a_list_and_a_folder_in_use_are_refused_in_one_line(tmp_path, folder):
    other = tmp_path / "other"
    other.mkdir()
    (other / "summary.json").write_text("{}")
    with pytest.raises(InputError, match="kept no list of its files; valid is another folder"):
        run(other, NEW)
    assert held(other) == {"summary.json": "{}"}
    with pytest.raises(InputError, match="in use by another run"), renewed(folder, "summary.json"):
        run(folder, NEW)


def test_a_list_cannot_reach_out_of_its_folder(folder, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "precious"
    outside.write_text("precious")
    with open(folder / OWN / "summary.files", "a", encoding="utf-8") as file:
        file.write(f"{outside}\n../{outside.parent.name}/precious\n")
    run(folder, NEW)
    assert outside.read_text() == "precious" and held(folder) == NEW


class Killed(BaseException):
    pass


def kill_at(step, monkeypatch):
    """From the operation of that number on none takes effect, as after kill -9; a function that says whether it came."""
    count = itertools.count()
    last = [-1]

    def mortal(function):
        def call(*arguments, **settings):
            last[0] = next(count)
            if last[0] >= step:
                raise Killed
            return function(*arguments, **settings)

        return call

    for owner, name in ((os, "replace"), (shutil, "rmtree"), (Path, "unlink"), (Path, "rmdir"), (Path, "write_bytes")):
        monkeypatch.setattr(owner, name, mortal(getattr(owner, name)))
    return lambda: last[0] >= step


@pytest.mark.parametrize("ending", [None, InputError("refused")], ids=["done", "refused"])
def test_after_a_kill_at_any_moment_no_two_runs_are_mixed(tmp_path, monkeypatch, ending):
    for step in itertools.count():
        folder = tmp_path / str(step)
        folder.mkdir()
        (folder / "notes.txt").write_text("mine")
        run(folder, OLD)
        with monkeypatch.context() as patch:
            killed = kill_at(step, patch)
            try:
                with renewed(folder, "summary.json"):
                    if ending:
                        raise ending
                    for name, text in NEW.items():
                        write_atomically(folder / name, text)
            except (Killed, InputError):
                pass
            if not killed():
                break
        seen = held(folder)
        assert seen.items() <= OLD.items() or seen.items() <= NEW.items(), (step, seen)
        assert "summary.json" not in seen or seen in (OLD, NEW), (step, seen)
        with pytest.raises(InputError, match="refused"), renewed(folder, "summary.json"):
            raise InputError("refused")
        again = held(folder)
        assert again.items() <= OLD.items() or again.items() <= NEW.items(), (step, again)
        run(folder, {"pd.nc": "third", "summary.json": "third"})
        assert held(folder) == {"pd.nc": "third", "summary.json": "third"}, step
        assert os.listdir(folder / OWN) == ["summary.files"] and (folder / "notes.txt").exists()
    assert step > 8
