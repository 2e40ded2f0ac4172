import json
import math
import os
import socket
from pathlib import Path

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


def _socket(path):
    with socket.socket(socket.AF_UNIX) as own:
        own.bind(str(path))


# Each row: name of the file, what makes it, and why it is not read.
NO_FILES = {
    "missing": ("gone", lambda path: None, "No such file"),
    "directory": ("folder", Path.mkdir, "Is a directory"),
    "pipe": ("pipe", os.mkfifo, "Is a pipe"),
    "socket": ("socket", _socket, "Is a socket"),
    "endless device": ("zero", lambda path: path.symlink_to("/dev/zero"), "Is a device"),
    "empty device": ("null", lambda path: path.symlink_to("/dev/null"), "Is a device"),
    "link to itself": ("loop", lambda path: path.symlink_to(path), "symbolic links"),
    "file as folder": ("a/b", lambda path: path.parent.write_text("a"), "Not a directory"),
    "large": (
        "large",
        lambda path: (path.touch(), os.truncate(path, 50_000_000)),
        "50,000,000 bytes or more, at most 1,000,000",
    ),
    "no size": ("kernel", lambda path: path.symlink_to("/proc/kallsyms"), "at most 1,000,000"),
    "NUL in the name": ("a\0b", lambda path: None, "null"),
    "long name": ("n" * 300, lambda path: None, "File name too long"),
    "name that is no text": ("\udcff", lambda path: None, "No such file"),
    "no text": ("bytes", lambda path: path.write_bytes(b"\xff\xfe"), "not UTF-8 text"),
}


@pytest.mark.parametrize(("name", "make", "reason"), NO_FILES.values(), ids=NO_FILES)
def test_what_is_no_file_is_refused_before_it_is_read(tmp_path, monkeypatch, name, make, reason):
    monkeypatch.chdir(tmp_path)
    make(Path(name))
    with pytest.raises(InputError) as caught:
        files.read_text(name, "scenario file", "a YAML file")
    message = str(caught.value)
    assert message.startswith("scenario file '") and message.endswith("; valid is a YAML file")
    assert f"cannot be read: {reason}" in message or reason in message
    assert message.isprintable() and len(message) < 250


def test_a_file_is_read_as_text(tmp_path):
    path = tmp_path / "a"
    path.write_bytes("θ\r\nb\n".encode())
    assert files.read_text(path, "", "a file") == "θ\nb\n"
    assert files.check_file(path, "", "a file", most=6) == path
    with pytest.raises(InputError, match="'.*a' cannot be read: It has 6 bytes or more, at most 5"):
        files.check_file(path, "", "a file", most=5)
