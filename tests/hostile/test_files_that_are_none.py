"""Pipes, devices, folders, large files and names that cannot be, wherever a command takes the name of a file."""

import os
import socket
from pathlib import Path

import pytest
from hostile.table import Case, check


def bound_socket(path):
    with socket.socket(socket.AF_UNIX) as own:
        own.bind(path.name)  # a relative name is short enough


KINDS = {
    "pipe": (os.mkfifo, "cannot be read: Is a pipe"),
    "socket": (bound_socket, "cannot be read: Is a socket"),
    "endless": (lambda path: path.symlink_to("/dev/zero"), "cannot be read: Is a device"),
    "directory": (Path.mkdir, "cannot be read: Is a directory"),
    "large": (lambda path: (path.touch(), os.truncate(path, 50_000_000)), "It has 50,000,000 bytes or more"),
    "bytes": (lambda path: path.write_bytes(b"\xff\xfe\x00"), "not UTF-8 text"),
}
PLACES = {
    "scenario": ["plan", "--out", ".", "--scenario", "f.yaml"],
    "campaign": ["campaign", "f.yaml"],
    "calibrate": ["calibrate", "--out", ".", "f.yaml"],
    "base of a campaign": ["campaign", "c.yaml"],
}
CASES = [
    Case(
        f"{place}, {kind}",
        words,
        2,
        (says,),
        {"f.yaml": make, "c.yaml": "base: f.yaml\nvary: {object.mass: {uniform: [0.05, 0.07]}}"},
    )
    for place, words in PLACES.items()
    for kind, (make, says) in KINDS.items()
]
CASES += [
    Case(f"{option}, {kind}", ["plan", "--out", ".", f"--{option}", "m.urdf"], 2, (option, says), {"m.urdf": make})
    for option in ("arm.file", "tool.file", "object.file")
    for kind, (make, says) in KINDS.items()
    if kind in ("pipe", "endless", "directory")
]
NAMES = {"NUL": ("a\0b.nc", "b.nc"), "long": ("n" * 300 + ".nc", "File name too long")}
CASES += [
    Case(f"{' '.join(words)} {kind}", [*words, name], 2, (says,))
    for words in (
        ["plan", "--out", ".", "--scenario"],
        ["campaign"],
        ["info"],
        ["campaign", "--watch"],
        ["campaign", "--analyse"],
    )
    for kind, (name, says) in NAMES.items()
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_what_is_no_file_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)
