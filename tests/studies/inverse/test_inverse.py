"""The search for E1 over worlds made up so that friction and inertia decide."""

import json
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from campaign.made_up import AS_TOLD, FRAGILE
from synthetic import recordings

from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.events import release_index
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.recording_files import save_recording
from flipdiagram.studies.inverse import run as study
from flipdiagram.studies.inverse.figures import plot_mechanism
from flipdiagram.studies.inverse.tables import tables

BOX = """
vary:
  object.friction: {uniform: [1.0, 2.0]}
  arm.link_inertia_scale: {uniform: [0.5, 2.0]}
  object.mass: {uniform: [0.05, 0.07]}
sampler: lhs
trials: 40
seed: 1
"""


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inverse")
    (folder / "box.yaml").write_text(BOX)
    study.run(Scenario(), folder, file=str(folder / "box.yaml"), jobs=2, work=AS_TOLD)
    return folder


@pytest.fixture(scope="module")
def summary(out):
    return json.loads((out / "summary.json").read_text())


def fits(values):
    kept = values["object.mass"] <= 0.068  # a heavier block is turned over by luck
    return values["object.friction"] < 1.5 and values["arm.link_inertia_scale"] > 1.4 and kept


def test_every_world_that_fits_is_found_and_no_other(summary):
    assert summary["worlds"] == 40 and 4 <= summary["found"] <= 12  # a fifth of the box
    assert all(fits(world["values"]) for world in summary["worlds_found"])
    assert summary["low"] < 0.2 < summary["high"]
    assert not any(fits(world["values"]) for world in summary["nearest"])


def test_the_smallest_change_leaves_out_what_is_not_needed_and_halves_the_rest(summary):
    smallest = summary["smallest"]
    assert set(smallest["values"]) == {"object.friction", "arm.link_inertia_scale"}
    assert 1.4 < smallest["values"]["arm.link_inertia_scale"] < 1.43
    assert 1.48 < smallest["values"]["object.friction"] < 1.5
    assert smallest["base"] == {"object.friction": 1.86, "arm.link_inertia_scale": 1.0}


def test_worlds_that_another_step_or_engine_contradicts_are_told(tmp_path):
    (tmp_path / "box.yaml").write_text(BOX)
    study.run(Scenario(), tmp_path, file=str(tmp_path / "box.yaml"), jobs=1, work=FRAGILE)
    summary = json.loads((tmp_path / "summary.json").read_text())
    heavy = [world["values"]["object.mass"] > 0.06 for world in summary["worlds_found"]]
    assert 0 < sum(heavy) < len(heavy)
    told = [world["firm"] for world in summary["worlds_found"]]
    assert told == [[] if fragile else ["half the step", "mujoco"] for fragile in heavy]
    # shrinking asks one engine: a light block is not needed there, and the base's of 61 g is fragile
    assert "object.mass" not in summary["smallest"]["values"] and summary["smallest"]["firm"] == []
    assert tables(summary)[3].title.endswith("(in this engine, at this step)")


def test_a_controller_is_flown_only_where_those_before_it_went_as_told(out, summary):
    counts = [(stage["flown"], stage["went"]) for stage in summary["stages"]]
    assert counts[0][0] == 40 and all(b[0] == a[1] for a, b in zip(counts, counts[1:], strict=False))
    with closing(sqlite3.connect(out / study.FILE)) as database, database:
        count = "SELECT count(*) FROM trials WHERE architecture = ? AND trial NOT LIKE 'recorded%'"
        flown = [database.execute(count, (name,)).fetchone()[0] for name, _ in study.STAGES]
    assert flown[0] >= 40 and flown[0] > flown[1] >= flown[2] >= flown[3] >= summary["found"]


def test_the_nearest_misses_slid_farthest_under_the_controller_that_should_have_slid_off(summary):
    passed = [world["passed"] for world in summary["nearest"]]
    assert passed == sorted(passed, reverse=True)
    slips = [world["flips"]["pd"]["max_slip_m"] for world in summary["nearest"] if world["passed"] == 0]
    assert slips == sorted(slips, reverse=True)


def test_recordings_of_the_smallest_change_are_made_and_a_second_run_says_the_same(out, summary):
    assert {file.stem for file in out.glob("*.nc")} == {"pd", "pd+ff", "pd+dob", "pd+ff+dob"}
    study.run(Scenario(), out, file=str(out / "box.yaml"), jobs=2, work=AS_TOLD)
    assert json.loads((out / "summary.json").read_text()) == summary


def test_tables_say_how_far_the_worlds_came(summary):
    stages, found, region, smallest, nearest = tables(summary)
    assert len(found.rows) == summary["found"] and found.rows[0][1] == "half the step, mujoco"
    assert found.rows[0][3].startswith("pd slid") and found.rows[0][3].endswith("pd+ff+dob turned over")
    low, high = (float(end) for end in region.rows[0][2].split("(")[1].rstrip(")").split("–"))
    assert region.rows[0][:2] == ["`object.friction`", "1 to 2"] and 1.0 < low < high < 1.5
    assert stages.title.startswith(f"E1 as the paper tells it in {summary['found']} of 40 worlds")
    assert stages.title.endswith(f"at the start of the motion in {summary['found']}")  # from 0.05 s there
    assert [row[0] for row in stages.rows] == ["`pd`", "`pd+ff`", "`pd+dob`", "`pd+ff+dob`"]
    assert {row[0] for row in smallest.rows} == {"`object.friction`", "`arm.link_inertia_scale`"}
    assert len(nearest.rows) == 10
    flown, went = (summary["stages"][2][name] for name in ("flown", "went"))
    assert went < flown and stages.rows[2][-1] == f"{flown - went} turned over, but slid farther than 15 mm"


def test_choices_are_counted(tmp_path):
    box = BOX.replace("trials: 40", "trials: 20") + "architectures: [pd]\n"
    box = box.replace("object.mass: {uniform: [0.05, 0.07]}", "planner.stop: {choice: [immediate, brake]}")
    (tmp_path / "box.yaml").write_text(box.replace("[1.0, 2.0]", "[1.0, 1.4]").replace("[0.5, 2.0]", "[1.5, 2.0]"))
    study.run(Scenario(), tmp_path, file=str(tmp_path / "box.yaml"), jobs=1, work=AS_TOLD)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["found"] == 20 and summary["region"][2]["counts"] == {"immediate": 10, "brake": 10}
    assert tables(summary)[2].rows[2][1:] == ["immediate or brake", "brake: 10, immediate: 10"]


def test_the_mechanism_shows_cone_slip_and_how_far_each_joint_is_from_both_with_observer(tmp_path):
    files, runs = {}, {}
    for k, (name, run) in enumerate(recordings().items()):
        ramp = np.linspace(0.0, 1e-3 * k, run.sizes["time"])
        run = runs[name] = run.assign(cone_use=("time", 1e3 * ramp), slip=("time", ramp))
        files[name] = tmp_path / f"{name}.nc"
        save_recording(run, measure(run), files[name])
    axes = plot_mechanism(files).axes
    labels = [ax.get_ylabel() for ax in axes]
    assert labels[:4] == ["cone use [1]", "slip [mm]", "tilt θ [rad]", "S: Δ speed [rad/s]"] and len(labels) == 9
    run = runs["pd+ff"]
    left = max(float(run.attrs["release_time_s"]), float(run["time"][release_index(run)]))
    shown = run.sel(time=slice(0.0, left))
    slip = {line.get_label(): line.get_ydata() for line in axes[1].lines}
    np.testing.assert_allclose(slip["PD + FF"], 1000 * shown["slip"])
    # from itself it is nowhere away
    away = {line.get_label(): line.get_ydata() for line in axes[4].lines}
    assert np.all(away["PD + FF + DOB"] == 0) and axes[-1].get_xlabel() == "time [s]"


def test_nothing_found_is_said(tmp_path):
    (tmp_path / "box.yaml").write_text(BOX.replace("[1.0, 2.0]", "[1.6, 2.0]").replace("trials: 40", "trials: 8"))
    study.run(Scenario(), tmp_path, file=str(tmp_path / "box.yaml"), jobs=1, work=AS_TOLD)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["found"] == 0 and summary["smallest"] is None and len(summary["nearest"]) == 8
    assert not list(tmp_path.glob("*.nc")) and not tables(summary)[1].rows and not tables(summary)[2].rows


def test_no_file_is_one_line():
    with pytest.raises(InputError, match="inverse needs the FILE of a campaign"):
        study.run(Scenario(), "nowhere", file=None)


def test_one_that_would_take_too_long_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "long.yaml").write_text(BOX.replace("seed: ", "limit_hours: 0.001\nseed: "))
    with pytest.raises(InputError, match="would take about .* limit_hours is 0.001"):
        study.run(Scenario(), tmp_path / "out", file=str(tmp_path / "long.yaml"), jobs=1, work=AS_TOLD)
    assert not (tmp_path / "out").exists()
