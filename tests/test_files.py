import json
import math
import os

import numpy as np
import pytest

from flipdiagram import __version__, files
from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario, from_mapping


def test_a_file_is_written_whole_and_replaces_the_old_one(tmp_path):
    path = tmp_path / "new" / "folder" / "a.txt"
    assert files.write_atomically(path, "θ") == path
    assert files.write_atomically(path, b"\x00\xff") == path
    assert path.read_bytes() == b"\x00\xff"
    assert [p.name for p in path.parent.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path, failure):
    path = tmp_path / "a.nc"
    path.write_text("old")
    with pytest.raises(failure), files.atomic_path(path) as temporary:
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".nc")
        temporary.write_text("half")
        raise failure
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


def test_files_get_the_usual_permissions(tmp_path):
    path = files.write_atomically(tmp_path / "a", "")
    usual = tmp_path / "b"
    usual.touch()
    assert path.stat().st_mode == usual.stat().st_mode


def test_what_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write") as caught:
        files.write_atomically(tmp_path / "file" / "a", "text")
    assert str(tmp_path / "file" / "a") in str(caught.value)


def test_a_summary_starts_with_its_head(tmp_path):
    scenario = Scenario()
    body = {"plan": {"cost_J": np.float64(1.5), "n": np.int64(3), "ok": np.bool_(True), "t": np.arange(2.0)}}
    path = files.write_summary(tmp_path / "summary.json", "turnover", scenario, body)
    data = json.loads(path.read_text(encoding="utf-8"))
    assert list(data) == ["schema", "versions", "scenario", "plan"]
    assert data["schema"] == "flipdiagram/turnover/1"
    assert set(data["versions"]) == {"flipdiagram", "drake", "python"}
    assert data["versions"]["flipdiagram"] == __version__
    assert from_mapping(data["scenario"]) == scenario
    assert data["plan"] == {"cost_J": 1.5, "n": 3, "ok": True, "t": [0.0, 1.0]}


def test_what_json_cannot_say_becomes_null(tmp_path):
    body = {"values": [math.nan, np.inf, np.array([1.0, -np.inf]), (1, None)]}
    data = json.loads(files.write_summary(tmp_path / "s.json", "x", Scenario(), body).read_text())
    assert data["values"] == [None, None, [1.0, None], [1, None]]


def test_the_head_cannot_be_overwritten(tmp_path):
    with pytest.raises(ValueError, match="schema"):
        files.write_summary(tmp_path / "s.json", "x", Scenario(), {"schema": "mine"})
    assert not list(tmp_path.iterdir())


def test_checking_an_output_folder_leaves_nothing_behind(tmp_path):
    assert files.check_output_directory(tmp_path) == tmp_path
    assert files.check_output_directory(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["file", "file/below", "n" * 300, "nul\0l", "dangling"])
def test_an_output_folder_that_cannot_be_is_refused(tmp_path, name):
    (tmp_path / "file").touch()
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="--out = .* valid is a writable folder"):
        files.check_output_directory(tmp_path / name)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dangling", "file"]


def test_an_output_folder_without_permission_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # root may write everywhere: be nobody for a moment
    try:
        with pytest.raises(InputError, match="Permission denied"):
            files.check_output_directory(tmp_path / "a")
    finally:
        os.seteuid(user)


def test_an_output_folder_on_a_file_system_that_takes_no_files_is_refused():
    with pytest.raises(InputError, match="cannot be written"):
        files.check_output_directory("/proc/flipdiagram")
