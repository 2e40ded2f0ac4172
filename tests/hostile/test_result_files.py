"""Files of results that are not as flipdiagram wrote them: each reader gives its result or one line."""

import json
import os
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import synthetic
import xarray as xr
from hostile.table import Case, check
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flipdiagram.errors import InputError
from flipdiagram.results import info, open_result
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.recording_files import recording_key, save_recording


@cache
def whole():
    """A recording of few samples, which is read and judged quickly."""
    return synthetic.recording().isel(time=slice(250, 1400, 25))


@cache
def written():
    """The bytes of that recording."""
    with TemporaryDirectory() as folder:
        save_recording(whole(), measure(whole()), Path(folder) / "a.nc")
        return (Path(folder) / "a.nc").read_bytes()


def saved(change):
    """A function that writes the recording changed."""
    return lambda path: change(whole().copy(deep=True)).to_netcdf(path, engine="scipy")


def with_signal(name, change):
    return saved(lambda data: data.assign({name: change(data[name])}))


def with_time(change, **attrs):
    return saved(lambda data: data.assign_coords(time=("time", change(data["time"].values), {"units": "s"} | attrs)))


def with_attribute(**attrs):
    return saved(lambda data: data.assign_attrs(attrs))


def holed(signal):
    """One sample of a signal is missing."""
    return signal.where(signal["time"] != signal["time"][3])


BOMB = "a0: &a0 [1, 1]\n" + "".join(f"a{k + 1}: &a{k + 1} [{', '.join([f'*a{k}'] * 9)}]\n" for k in range(30))
RECORDINGS = {
    "transposed": (with_signal("x", lambda x: x.T), "it has 'x' over (axis, time), not (time, axis)"),
    "renamed": (saved(lambda data: data.rename(joint="motor")), "over (time, motor), not (time, joint)"),
    "time renamed": (saved(lambda data: data.rename(time="t")), "two samples on 'time'"),
    "short": (saved(lambda data: data.isel(axis=slice(2))), "other labels of 'axis' than y, z, theta"),
    "other labels": (saved(lambda data: data.assign_coords(pose=list("abcdefg"))), "other labels of 'pose'"),
    "no names of joints": (saved(lambda data: data.drop_vars("joint")), "no names of each 'joint'"),
    "one sample": (saved(lambda data: data.isel(time=slice(1))), "lacks two samples on 'time'"),
    "missing signal": (saved(lambda data: data.drop_vars("tau")), "lacks signal 'tau'"),
    "missing attribute": (saved(lambda data: data.drop_attrs(deep=False)), "lacks attribute 'architecture'"),
    "times of a date": (
        with_time(lambda t: t, units="days since 2000-01-01"),
        "'time' in 'days since 2000-01-01', not s",
    ),
    "times that go back": (with_time(lambda t: t[::-1]), "no equal steps of time"),
    "times that jump": (with_time(lambda t: t**3), "no equal steps of time"),
    "times before the motion": (with_time(lambda t: t - 100), "cannot be judged"),
    "tiny steps": (with_time(lambda t: t * 1e-12), "no equal steps of time"),
    "no time": (with_time(lambda t: t * np.nan), "'time' with a number beyond 1e+15, or none"),
    "texts": (with_signal("q", lambda q: q.astype(str)), "'q' "),
    "beyond sense": (with_signal("tau", lambda tau: tau * 1e300), "'tau' with a number beyond 1e+15"),
    "infinite": (with_signal("x", lambda x: x / 0.0), "'x' with a number beyond 1e+15"),
    "pose missing": (with_signal("block_pose", holed), "'block_pose' with a number beyond 1e+15, or none"),
    "no rotation": (with_signal("tool_pose", lambda pose: pose * 0), "'tool_pose' with a quaternion that is none"),
    "end that is no number": (with_attribute(end_time_s="soon"), "end_time_s = 'soon', no number"),
    "end in a list": (with_attribute(end_time_s=[1.0, 2.0]), "end_time_s = '[1. 2.]', no number"),
    "bomb in the scenario": (with_attribute(scenario=BOMB), "too many values"),
    "no YAML in the scenario": (with_attribute(scenario="a: !!bool abc"), "not valid YAML"),
    "pipe": (os.mkfifo, "Is a pipe"),
    "endless": (lambda path: path.symlink_to("/dev/zero"), "Is a device"),
    "huge": (lambda path: (path.touch(), os.truncate(path, 10**12)), "It has 1,000,000,000,000 bytes or more"),
}
HEAD = {"versions": {}, "scenario": {}}
JSON = {
    "deep": ("a.json", "[" * 900 + "]" * 900, "nested in more than 40 levels"),
    "deeper": ("a.json", "[" * 10**5, "not valid JSON"),
    "pipe": ("summary.json", os.mkfifo, "Is a pipe"),
    "endless": ("plan.json", lambda path: path.symlink_to("/dev/zero"), "Is a device"),
    "plan": (
        "plan.json",
        '{"schema": "flipdiagram/motion/1", "cost": ' + "[" * 900 + "]" * 900 + "}",
        "more than 40 levels",
    ),
    "runs": ("summary.json", json.dumps({"schema": "flipdiagram/turnover/1", "runs": 3, "plan": {}} | HEAD), "damaged"),
    "table": ("a.csv", "a,b\n1,2\n", "lacks 'the columns"),
    "table that is a pipe": ("a.csv", os.mkfifo, "Is a pipe"),
}
CASES = [Case(name, ["info", "a.nc"], 2, (says,), {"a.nc": make}) for name, (make, says) in RECORDINGS.items()]
CASES += [Case(name, ["info", file], 2, (says,), {file: content}) for name, (file, content, says) in JSON.items()]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_damaged_result_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)


def test_a_sound_recording_is_shown(tmp_path):
    (tmp_path / "a.nc").write_bytes(written())
    assert ("kind", "recording") in info(tmp_path / "a.nc").rows
    assert isinstance(open_result(tmp_path / "a.nc"), xr.Dataset)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.booleans(),
    places=st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), min_size=1, max_size=6),
    end=st.none() | st.integers(0, 2**16),
)
def test_any_bytes_changed_give_a_result_or_one_line(tmp_path, head, places, end):
    data = bytearray(written())
    for at, byte in places:
        data[at % (4000 if head else len(data))] = byte
    path = tmp_path / "a.nc"
    path.write_bytes(data[:end])
    for use in (info, recording_key):
        try:
            use(path)
        except InputError as error:
            assert "\n" not in " ".join(str(error).split()) and len(str(error)) < 1000
