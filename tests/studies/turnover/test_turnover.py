"""`flipdiagram flip` as a user runs it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from patience import HUNG, loaded

from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.metrics import VIBRATION_WINDOW
from flipdiagram.simulation.recording_files import load_recording

COMMAND = [sys.executable, "-m", "flipdiagram", "flip"]
PROGRAM = (
    "import sys; from contextlib import nullcontext; from flipdiagram.cli import commands, main;"
    " commands.status = lambda quiet: nullcontext(lambda text: print(text, file=sys.stderr, flush=True));"
    " sys.exit(main.main())"
)
"""The command, with its progress a line each: it shows none where stderr is no terminal."""


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("turnover")
    done = subprocess.run([*COMMAND, "--out", str(folder)], capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    return folder


@pytest.fixture(scope="module")
def summary(out):
    return json.loads((out / "summary.json").read_text())


def test_the_controllers_with_an_observer_succeed_and_those_without_drop_the_block(summary):
    verdicts = {run["architecture"]: run["success"] for run in summary["runs"]}
    assert verdicts == {"pd": False, "pd+ff": False, "pd+dob": True, "pd+ff+dob": True}
    for run in summary["runs"]:
        assert run["success"] == (run["failure"] is None)
        if not run["success"]:
            assert "dropped at" in run["failure"]
            assert 0 < run["release_time_s"] < summary["plan"]["release_time_s"]


def test_the_observer_and_the_feedforward_do_what_they_are_for(summary):
    runs = {run["architecture"]: run for run in summary["runs"]}
    assert runs["pd+dob"]["position_rmse_m"] < runs["pd"]["position_rmse_m"] / 3
    # as the paper measures it: what is true of the tool holds the filter's delay too
    measured = {name: run["acceleration_rmse_meas_m_s2"] for name, run in runs.items()}
    assert measured["pd+ff+dob"] < measured["pd+dob"]


def test_the_summary_keeps_its_contract(summary):
    assert list(summary)[:3] == ["schema", "versions", "scenario"]
    assert summary["schema"] == "flipdiagram/turnover/1"
    assert summary["scenario"] == json.loads(json.dumps(Scenario().model_dump(mode="json")))
    assert {
        "cost_J",
        "release_angle_rad",
        "touchdown_angle_rad",
        "release_time_s",
        "touchdown_time_s",
        "max_sliding_angle_rad",
        "friction_angle_rad",
        "iterations",
        "solve_time_s",
    } <= set(summary["plan"])
    assert summary["plan"]["max_sliding_angle_rad"] < summary["plan"]["friction_angle_rad"]
    assert [run["architecture"] for run in summary["runs"]] == list(ARCHITECTURES)


def test_all_files_are_there_and_no_half_ones(out):
    names = {path.name for path in out.iterdir()} - {"stdout", ".flipdiagram"}
    pictures = {
        f"{n}.{s}"
        for n in (
            "plan",
            "fig12_snapshots",
            "fig13_trajectories",
            "fig14_velocities",
            "fig15_accelerations",
            "sliding_angle",
            "torques",
        )
        for s in ("png", "svg")
    }
    assert names == pictures | {f"{a}.nc" for a in ARCHITECTURES} | {"plan.json", "summary.json", "replay.html"}


def test_the_table_names_every_architecture(out):
    printed = (out / "stdout").read_text()
    for name in ARCHITECTURES:
        assert f" {name} " in printed
    assert printed.count("turned over") == 2


def test_recordings_are_the_runs(out, summary):
    for run in summary["runs"]:
        data = load_recording(out / run["recording"])
        assert data.attrs["architecture"] == run["architecture"]
        assert data.attrs["success"] == run["success"]
        moving = data["tau"].sel(time=slice(0, data.attrs["end_time_s"] + VIBRATION_WINDOW)).values  # stop included
        np.testing.assert_array_equal(np.abs(moving).max(axis=0), run["max_torque_Nm"])


def test_the_impossible_ends_with_exit_3_one_line_and_no_files(tmp_path):
    folder = tmp_path / "out"
    command = [*COMMAND, "--out", str(folder), "--arm.speed_scale", "0.05", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert "joint speed limit cannot be met" in done.stderr
    assert not folder.exists()


def test_ctrl_c_stops_within_two_seconds_and_keeps_finished_runs(tmp_path):
    command = [sys.executable, "-c", PROGRAM, "flip", "--out", str(tmp_path), "--jobs", "1"]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # in the background of a shell it would inherit a Ctrl-C that is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("1/4"):
            break
    limit, pressed = loaded(5), time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    _, rest = process.communicate(timeout=HUNG)
    assert time.monotonic() - pressed < limit
    assert process.returncode == 130
    assert rest == "flipdiagram: interrupted\n"
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert [run["architecture"] for run in summary["runs"]] == ["pd"]
    names = {path.name for path in tmp_path.iterdir()}
    assert {"pd.nc", "plan.json", "summary.json"} <= names
    assert [name for name in names if name.startswith(".")] == [".flipdiagram"]
    load_recording(tmp_path / "pd.nc")
    until = time.monotonic() + HUNG
    while time.monotonic() < until:  # nothing of it lives on
        alive = subprocess.run(["pgrep", "-g", str(process.pid)], capture_output=True, text=True).stdout
        if not alive:
            break
        time.sleep(0.1)
    assert not alive


def turnover_markdown(summary):
    """The runs of a turnover summary.json as a Markdown table, as the README shows it."""
    quantities = ["touch-down", "position RMSE", "acceleration RMSE", "joint 2, max", "slip", "velocity delay"]
    rows = [
        [
            f"`{run['architecture']}`",
            "**turned over**" if run["success"] else run["failure"],
            f"{run['touchdown']['theta_rad']:.2f} rad" if run["touchdown"] else "–",
            f"{100 * run['position_rmse_m']:.2f} cm",
            f"{run['acceleration_rmse_m_s2']:.2f} m/s²",
            f"{run['max_torque_Nm'][1]:.1f} N m",
            f"{1000 * run['max_slip_m']:.1f} mm",
            f"{1000 * run['velocity_delay_s']:.1f} ms",
        ]
        for run in summary["runs"]
    ]
    return Grid(["architecture", "block", *quantities], rows, right=quantities).markdown()


def test_the_readme_shows_the_numbers_of_this_run(summary):
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    assert turnover_markdown(summary) in readme
