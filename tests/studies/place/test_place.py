"""`flipdiagram place` end to end, and its recordings read again."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from flipdiagram.cli import main as cli
from flipdiagram.errors import InputError
from flipdiagram.results import compare, info, open_result
from flipdiagram.simulation.events import strike_of
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.placement import PlaceMetrics
from flipdiagram.simulation.recording_files import check_recording, load_recording
from flipdiagram.studies.place.run import Placement, place
from flipdiagram.studies.registry import STUDIES
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


def test_a_placement_shows_its_verdict_and_path(out):
    runs = json.loads((out / "summary.json").read_text())["runs"]
    laid, failed = (
        Placement(load_recording(out / run["recording"]), None, run)
        for run in sorted(runs, key=lambda run: not run["success"])
    )
    assert laid.success and repr(laid) == "Placement(pd+ff+dob: laid down)"
    assert repr(failed) == f"Placement(pd: {failed.verdict['failure']})" and not failed.success
    assert laid.recording.attrs["kind"] == "place" and laid.recording.attrs["success"] == 1
    root = ElementTree.fromstring(laid._repr_html_())
    assert len(list(root.iter("polyline"))) == 3 and "touchdown_speed_m_s" in {cell.text for cell in root.iter("td")}
    with pytest.raises(InputError, match="unknown architecture 'pid'"):
        place(architecture="pid")


def test_pictures_and_replay_are_written(out):
    names = {path.name for path in out.iterdir()}
    assert {"contact_states.png", "path.svg", "replay.html", "summary.json", "pd.nc"} <= names
    assert "laid down" in (out / "replay.html").read_text()


def test_the_blade_strikes_the_table_under_pd_alone_and_everything_says_so(out):
    summary = json.loads((out / "summary.json").read_text())
    runs = {run["architecture"]: run for run in summary["runs"]}
    best, worst = runs["pd+ff+dob"], runs["pd"]
    assert (best["strike_time_s"], best["strike_duration_s"], best["strike_force_N"]) == (None, 0.0, 0.0)
    data = load_recording(out / "pd.nc")
    force = np.linalg.norm(data["contact_force"].sel(pair="table-blade").values, axis=1)[data["time"].values >= 0]
    assert worst["strike_force_N"] == pytest.approx(force.max()) and force.max() > 100
    assert worst["strike_duration_s"] == pytest.approx(1e-3 * np.sum(force > 1e-6))
    assert worst["failure"].startswith(f"struck the table at {worst['strike_time_s']:.3f} s")
    (grid,) = STUDIES["place"].tables(summary)
    cells = {row[0]: row[grid.headings.index("blade on the table")] for row in grid.rows}
    assert cells["`pd+ff+dob`"] == "never" and cells["`pd`"].startswith(f"{force.max():.0f} N, ")


def test_a_recorded_placement_is_judged_as_one_wherever_it_is_read(out):
    data = open_result(out / "pd.nc")
    measured = data.flip.metrics()
    assert isinstance(measured, PlaceMetrics) and data.attrs["kind"] == "place"
    entry = json.loads((out / "summary.json").read_text())["runs"][0]
    assert {**measured.as_dict(), "recording": "pd.nc"} == entry
    rows = dict(info(out / "pd.nc").rows)
    assert rows["object"] == f"not laid down: {entry['failure']}"
    assert rows["blade on the table"].startswith(f"{strike_of(data).force_N:.0f} N")
    with pytest.raises(InputError, match="kind 'place' is not judged as a flip"):
        measure(data)
    assert compare(out / "pd.nc", out / "pd+ff+dob.nc").metrics


def test_a_recording_of_an_unknown_kind_is_refused(out):
    data = load_recording(out / "pd.nc")
    with pytest.raises(InputError, match="is of kind 'thrown', not flip or place"):
        check_recording(data.assign_attrs(kind="thrown"))
    with pytest.raises(InputError, match="lacks signal 'slide'"):
        check_recording(data.drop_vars("slide"))
