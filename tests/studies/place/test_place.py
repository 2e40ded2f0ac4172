"""`flipdiagram place` end to end, and how a placement is judged."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
import synthetic
from ideal import IDEAL

from flipdiagram.cli import main as cli
from flipdiagram.errors import InputError
from flipdiagram.planning.placing import Placer
from flipdiagram.robot.parts import arm_of
from flipdiagram.simulation.recording_files import load_recording
from flipdiagram.studies.place import run as place
from flipdiagram.studies.place.run import Placement
from flipdiagram.theory.contact import ContactState


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("place")
    names = ["--architecture", "pd", "pd+ff+dob"]
    assert cli.main(["place", "--out", str(folder), *names, "--simulation.hold_time", "1.0", "--quiet"]) == 0
    return folder


def test_the_observer_lays_the_object_down_and_pd_does_not(out):
    summary = json.loads((out / "summary.json").read_text())
    assert summary["schema"] == "flipdiagram/place/1"
    runs = {run["architecture"]: run for run in summary["runs"]}
    assert runs["pd+ff+dob"]["success"] and not runs["pd"]["success"]
    placed = runs["pd+ff+dob"]
    assert placed["distance_m"] < 0.02 and placed["touchdown_speed_m_s"] < 0.3 and placed["tilt_rad"] < 0.1
    # the rest lies with its rim on the table before it has slid the whole way, or a little after
    assert placed["slid_m"] == pytest.approx(placed["planned_slide_m"], rel=0.25)
    assert runs["pd"]["failure"]


def test_the_recording_tells_stick_slide_and_release(out):
    data = load_recording(out / "pd+ff+dob.nc")
    assert {"slide", "slide_cmd", "contact_state"} <= set(data)
    plan = json.loads((out / "summary.json").read_text())["plan"]
    time, states = data["time"].values, data["contact_state"].values
    early = (time > 0.05) & (time < plan["slide_begins_s"] - 0.3)
    assert np.mean(states[early] == ContactState.STICK) > 0.9
    sliding = (time > plan["slide_begins_s"] + 0.02) & (time < plan["slide_begins_s"] + 0.15)
    assert np.mean(states[sliding] != ContactState.STICK) > 0.8
    assert states[-1] == ContactState.RELEASE


def test_a_placement_shows_its_verdict_and_path(out, plan):
    runs = json.loads((out / "summary.json").read_text())["runs"]
    laid, failed = (
        Placement(load_recording(out / run["recording"]), plan, run)
        for run in sorted(runs, key=lambda run: not run["success"])
    )
    assert laid.success and repr(laid) == "Placement(pd+ff+dob: laid down)"
    assert repr(failed) == f"Placement(pd: {failed.verdict['failure']})" and not failed.success
    assert laid.recording.attrs["study"] == "place" and laid.recording.attrs["success"] == 1
    root = ElementTree.fromstring(laid._repr_html_())
    assert len(list(root.iter("polyline"))) == 3 and "touchdown_speed_m_s" in {cell.text for cell in root.iter("td")}
    with pytest.raises(InputError, match="unknown architecture 'pid'"):
        place.place(architecture="pid")


def test_pictures_and_replay_are_written(out):
    names = {path.name for path in out.iterdir()}
    assert {"contact_states.png", "path.svg", "replay.html", "summary.json", "pd.nc"} <= names
    assert "laid down" in (out / "replay.html").read_text()


@pytest.fixture(scope="module")
def plan():
    scenario = IDEAL
    return Placer(scenario, arm_of(scenario)).plan()


def judged(plan, y=0.10, tilt=0.0, speed=0.1):
    """A recording in which the object comes down with a speed and lies at y with a tilt."""
    data = synthetic.recording("pd+ff+dob").copy(deep=True)
    pose = data["block_pose"].values
    landed = int(np.argmax(np.linalg.norm(data["contact_force"].sel(pair="table-block").values, axis=-1) > 0))
    pose[landed - 2 : landed, 5] = 0.1
    pose[landed - 2 : landed, 6] = [0.3 + speed * 1e-3, 0.3]
    pose[-1] = [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0, 0.5, y, 0.205]
    return place.judge(data, 0.10, plan)


@pytest.mark.parametrize(
    ("changes", "failure"),
    [
        ({}, None),
        ({"y": 0.1199}, None),
        ({"y": 0.1201}, "lies 2.0 cm from the target"),
        ({"y": 0.05}, "lies 5.0 cm from the target"),
        ({"tilt": 0.3}, "lies tilted by 0.30 rad"),
        ({"speed": 0.29}, None),
        ({"speed": 0.31}, "came down with 0.31 m/s"),
    ],
    ids=str,
)
def test_a_placement_is_judged_by_place_tilt_and_speed(plan, changes, failure):
    found = judged(plan, **changes)
    assert (found["success"], found["failure"]) == (failure is None, failure)
