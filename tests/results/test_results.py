"""Results for people: the accessor of recordings, files back as objects, comparisons, info.  Nothing here simulates."""

import builtins
import json
import re
import subprocess
import sys
from dataclasses import asdict, replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from synthetic import END, MOTION, RELEASE, recording

from flipdiagram.errors import InputError
from flipdiagram.figures.style import STYLES
from flipdiagram.files import write_summary
from flipdiagram.flips.outcome import Outcome
from flipdiagram.grid import unit_of
from flipdiagram.planning.plan import Plan
from flipdiagram.results import compare, info, open_result, run_study
from flipdiagram.results.signals import components, pretty
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.margins import with_margins
from flipdiagram.simulation.metrics import FlipMetrics, measure
from flipdiagram.simulation.recording_files import save_recording
from flipdiagram.simulation.simulate import Run
from flipdiagram.studies.experiment.claims import run_entry
from flipdiagram.studies.experiment.run import recording_name
from flipdiagram.studies.frequency.claims import TEXTS
from flipdiagram.studies.registry import STUDIES


def flown(architecture="pd+ff+dob", **overrides):
    """A hand-made recording with margins, as a simulated one has them."""
    scenario = Scenario().with_overrides({name.replace("__", "."): value for name, value in overrides.items()})
    data = recording(architecture).copy(deep=True).assign_attrs(scenario=scenario.to_yaml())
    origin, force = data["tool_pose"].values[:, 4:], data["contact_force"].sel(pair="blade-block").values
    return with_margins(data, np.cross(origin, force), scenario)


def a_plan(cost=1.0, intervals=7):
    inputs = np.linspace(-1, 1, 3 * intervals).reshape(intervals, 3)
    return Plan(
        sampling_time=0.1,
        n_contact=intervals - 3,
        n_flight=2,
        n_brake=3,
        states=np.zeros((intervals + 1, 6)),
        inputs=inputs,
        cost=cost,
        residual=0.0,
        max_sliding_angle=0.5,
        friction_angle=1.0,
        limit_use={},
        solver="none",
        iterations=1,
        solve_time=0.0,
    )


@pytest.fixture(scope="module")
def best():
    return flown()


@pytest.fixture(scope="module")
def dropped():
    return flown("pd")


# ---- signals and tables


def test_columns_have_flat_names_units_and_the_values_of_the_recording(best):
    frame = best.flip.to_frame()
    units = frame.attrs["units"]
    expected = {
        "x_y": ("m", best["x"].values[:, 0]),
        "x_theta": ("rad", best["x"].values[:, 2]),
        "v_cmd_theta": ("rad/s", best["v_cmd"].values[:, 2]),
        "tau_S": ("N m", best["tau"].values[:, 0]),
        "block_pose_qw": ("1", best["block_pose"].values[:, 0]),
        "block_pose_z": ("m", best["block_pose"].values[:, 6]),
        "contact_force_table-block_z": ("N", best["contact_force"].values[:, 1, 2]),
        "sliding_angle": ("rad", best["sliding_angle"].values),
        "energy_T": ("J", best["energy"].values[:, 5]),
    }
    for name, (unit, values) in expected.items():
        assert units[name] == unit, name
        np.testing.assert_array_equal(frame[name].values, values)
    np.testing.assert_array_equal(frame.index.values, best["time"].values)
    assert frame.index.name == "time" and units["time"] == "s"
    assert set(units) == {"time", *frame.columns}
    count = sum(variable.size // best.sizes["time"] for variable in best.data_vars.values())
    assert len(frame.columns) == len(set(frame.columns)) == count
    assert frame.attrs["architecture"] == "pd+ff+dob"


def test_csv_reads_back_exactly_with_units_in_the_header(best, tmp_path):
    path = best.flip.to_csv(tmp_path / "new" / "flip.csv")
    header = path.read_text().splitlines()[0].split(",")
    assert header[0] == "time [s]" and "x_y [m]" in header and "tau_S [N m]" in header and "a_theta [rad/s2]" in header
    table = np.genfromtxt(path, delimiter=",", skip_header=1)  # a reader that knows nothing of us
    np.testing.assert_array_equal(table[:, 0], best["time"].values)
    np.testing.assert_array_equal(table[:, header.index("x_z [m]")], best["x"].values[:, 1])
    np.testing.assert_array_equal(table[:, header.index("slip [m]")], best["slip"].values)
    assert np.isnan(best["slip"].values).any()
    assert [file.name for file in path.parent.iterdir()] == ["flip.csv"]


def test_parquet_reads_back_exactly_with_units_for_pandas_and_for_others(best, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = best.flip.to_parquet(tmp_path / "flip.parquet")
    frame = best.flip.to_frame()
    read = pd.read_parquet(path)
    pd.testing.assert_frame_equal(read, frame)
    assert read.attrs["units"] == frame.attrs["units"]
    assert read.attrs["release_time_s"] == RELEASE
    schema = parquet.read_schema(path)
    assert schema.names[0] == "time"
    assert schema.field("x_y").metadata[b"units"] == b"m"
    assert {field.name: field.metadata[b"units"].decode() for field in schema} == frame.attrs["units"]


def test_parquet_without_pyarrow_says_what_to_install(best, tmp_path, monkeypatch):
    real = builtins.__import__

    def refuse(name, *rest, **more):
        if name.split(".")[0] == "pyarrow":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(InputError, match=re.escape("pip install 'flipdiagram[parquet]'")):
        best.flip.to_parquet(tmp_path / "flip.parquet")
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_written_is_said_and_leaves_nothing(best, tmp_path):
    (tmp_path / "file").write_text("")
    for write in (best.flip.to_csv, best.flip.to_parquet):
        with pytest.raises(InputError, match="cannot write"):
            write(tmp_path / "file" / "flip.out")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_units_are_read_from_names_and_written_for_figures():
    assert [
        unit_of(name)
        for name in ("position_rmse_m", "acceleration_rmse_m_s2", "max_torque_Nm", "iterations", "success")
    ] == ["m", "m/s2", "N m", "1", "1"]
    assert [pretty(unit) for unit in ("m/s2", "rad/s2", "N m", "1")] == ["m/s²", "rad/s²", "N m", "1"]


def test_joints_of_any_number_and_name(best):
    names = [f"shoulder_{k}" for k in range(7)]
    wide = best.drop_dims("joint").assign_coords(joint=names)
    for name in ("q", "qd", "tau"):
        wide[name] = (("time", "joint"), np.zeros((best.sizes["time"], 7)), best[name].attrs)
    panels = wide.flip.plot("tau")
    assert [panel.get_ylabel() for panel in panels] == [f"tau {name} [N m]" for name in names]
    panels[0].figure.draw_without_rendering()
    assert [part.name for part in components(wide, "q")] == [f"q_{name}" for name in names]


# ---- accessor


def test_metrics_and_scenario_are_those_of_the_recording(best):
    assert isinstance(best.flip.metrics(), FlipMetrics)
    np.testing.assert_equal(asdict(best.flip.metrics()), asdict(measure(best)))  # a share may be nan
    assert best.flip.scenario == Scenario()
    assert flown(task__start_y=0.1).flip.scenario.task.start_y == 0.1


def test_a_dataset_that_is_no_recording_is_refused_by_every_method(best, tmp_path):
    other = xr.Dataset({"x": ("time", [1.0, 2.0])})
    calls = [
        lambda: other.flip.plot("x"),
        other.flip.path,
        other.flip.margins,
        other.flip.metrics,
        other.flip.to_frame,
        lambda: other.flip.to_csv(tmp_path / "a.csv"),
        lambda: other.flip.to_parquet(tmp_path / "a"),
        lambda: other.flip.scenario,
    ]
    for call in calls:
        with pytest.raises(InputError) as error:
            call()
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="time"):
        best.isel(time=slice(0, 1)).flip.metrics()


@pytest.mark.parametrize(
    ("signal", "count", "command"),
    [
        ("x", 3, True),
        ("v", 3, True),
        ("tau", 6, True),
        ("sliding_angle", 1, True),
        ("x_y", 1, True),
        ("x_cmd", 3, False),
        ("contact_force", 9, False),
        ("block_pose", 7, False),
        ("cone_use", 1, True),
        ("tau_S", 1, True),
    ],
)
def test_every_signal_is_drawn_with_units_command_and_events(best, signal, count, command):
    drawn = best.flip.plot(signal)
    panels = list(drawn) if count > 1 else [drawn]
    assert len(panels) == count
    for panel in panels:
        assert re.search(r"\[[^]]+\]$", panel.get_ylabel())
        lines = {line.get_label(): line for line in panel.get_lines()}
        assert ("command" in lines) == (command or signal.endswith("_cmd"))
        if not signal.endswith("_cmd"):
            assert to_hex(lines["PD + FF + DOB"].get_color()).upper() == STYLES["pd+ff+dob"].color
        at = {name: lines[name].get_xdata()[0] for name in ("planned release", "release", "touch-down")}
        assert at["planned release"] == RELEASE
        assert at["release"] == pytest.approx(measure(best).release_time_s)
        assert at["touch-down"] == pytest.approx(measure(best).touchdown.time_s)
    assert any(panel.get_xlabel() == "time [s]" for panel in panels)
    assert "matplotlib.pyplot" not in type(panels[0].figure).__module__


def test_the_lines_are_the_samples_of_the_motion(best):
    panel = best.flip.plot("x_z")
    lines = {line.get_label(): line for line in panel.get_lines()}
    window = best.sel(time=slice(-0.05, MOTION + 0.15))
    np.testing.assert_array_equal(lines["PD + FF + DOB"].get_ydata(), window["x"].values[:, 1])
    np.testing.assert_array_equal(lines["command"].get_ydata(), window["x_cmd"].values[:, 1])
    wide = best.flip.plot("x_z", window=(-0.3, END))
    assert len(wide.get_lines()[0].get_xdata()) == best.sizes["time"]
    with pytest.raises(InputError, match="window"):
        best.flip.plot("x", window=(7.0, 8.0))


def test_drawing_into_axes_of_ones_own(best, dropped):
    grid = Figure().subplots(3, 1)
    assert list(best.flip.plot("v", ax=grid)) == list(grid)
    assert list(dropped.flip.plot("v", ax=list(grid))) == list(grid)
    one = Figure().subplots()
    assert best.flip.plot("sliding_angle", ax=one) is one and best.flip.path(ax=one) is one
    four = Figure().subplots(2, 2)
    assert list(best.flip.margins(four)) == list(four.ravel())
    with pytest.raises(InputError, match="1 axes given; valid are 3"):
        best.flip.plot("v", ax=one)


def test_a_lost_block_is_called_lost_and_a_part_of_a_recording_marks_what_it_holds(dropped, best):
    labels = [line.get_label() for line in dropped.flip.plot("x_y").get_lines()]
    assert "block lost" in labels and "release" not in labels
    early = best.sel(time=slice(None, RELEASE - 0.1))
    labels = [line.get_label() for line in early.flip.plot("x_y").get_lines()]
    assert "release" not in labels and "touch-down" not in labels


def test_an_unknown_signal_is_named_with_what_was_meant(best):
    with pytest.raises(InputError, match="unknown signal 'taus'; did you mean 'tau'"):
        best.flip.plot("taus")


def test_an_architecture_of_ones_own_is_drawn_in_a_colour_of_its_own(best):
    mine = best.assign_attrs(architecture="adaptive")
    line = next(line for line in mine.flip.plot("x_y").get_lines() if line.get_label() == "adaptive")
    assert to_hex(line.get_color()).upper() not in {style.color for style in STYLES.values()}
    assert mine.flip.path() and mine.flip.margins()


def test_the_path_is_drawn_to_scale_with_start_and_release(best, dropped):
    ax = best.flip.path()
    assert ax.get_aspect() == 1.0
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert {"command", "PD + FF + DOB", "start", "release", "block in flight", "touch-down"} == set(lines)
    motion = best.sel(time=slice(0, MOTION))
    np.testing.assert_array_equal(np.c_[lines["PD + FF + DOB"].get_data()], motion["x"].values[:, :2])
    assert "block lost" in {line.get_label() for line in dropped.flip.path().get_lines()}


def test_margins_are_planned_and_realised_until_the_release(best):
    panels = best.flip.margins()
    assert [panel.get_ylabel() for panel in panels] == [
        "friction cone used [1]",
        "centre of pressure [mm]",
        "normal force [N]",
        "slip [mm]",
    ]
    lines = {line.get_label(): line for line in panels[2].get_lines()}
    time = lines["realised, PD + FF + DOB"].get_xdata()
    assert time[0] == pytest.approx(0) and time[-1] == pytest.approx(RELEASE, abs=0.01)
    realised = best["normal_force"].sel(time=slice(0, measure(best).release_time_s)).values
    np.testing.assert_array_equal(lines["realised, PD + FF + DOB"].get_ydata()[: len(realised)], realised)
    half = 1e3 * Scenario().object.length / 2
    assert {half, -half} <= {float(np.ravel(line.get_ydata())[0]) for line in panels[1].get_lines()}
    with pytest.raises(InputError, match="lacks cone_use"):
        recording().flip.margins()


# ---- how results show themselves

SHOWN = {
    "Run(pd+ff+dob: turned over, position RMSE ": lambda best, dropped: Run(best, a_plan(), 1.0),
    "Run(pd: tipped, dropped at ": lambda best, dropped: Run(dropped, a_plan(), 1.0),
    "Plan(release at 0.40 s and 0.00 rad, touch-down at 0.60 s": lambda best, dropped: a_plan(),
    "Comparison(recording, pd+ff+dob and pd differ in ": lambda best, dropped: compare(best, dropped),
    "Comparison(recording, pd (a) and pd (b): no difference)": lambda best, dropped: compare(dropped, dropped),
    "Comparison(motion, a and b differ in 1 number)": lambda best, dropped: compare(a_plan(), a_plan(2.0)),
}


@pytest.mark.parametrize("begin", SHOWN)
def test_a_result_is_one_line_in_a_terminal_and_a_table_in_a_notebook(begin, best, dropped):
    result = SHOWN[begin](best, dropped)
    assert repr(result).startswith(begin) and "\n" not in repr(result) and len(repr(result)) <= 120
    html = result._repr_html_()
    root = ElementTree.fromstring(f"<div>{html}</div>")  # well-formed: every name and text escaped
    assert len(html) < 25_000
    cells = [cell.text for cell in root.iter("td")]
    assert cells or "no difference" in html


def test_a_run_shows_the_path_of_tool_command_and_block(best):
    root = ElementTree.fromstring(Run(best, a_plan(), 1.0)._repr_html_())
    lines = [line.get("points").split() for line in root.iter("polyline")]
    assert len(lines) == 3
    points = np.array([[float(number) for number in point.split(",")] for line in lines for point in line])
    assert points.min() >= 0 and points.max(axis=0)[0] <= 280 and points.max(axis=0)[1] <= 170


# ---- studies by name


def test_a_study_runs_by_its_name_with_the_options_of_its_command(tmp_path, monkeypatch):
    asked = {}

    def run(scenario, out, progress, **options):
        asked.update(options, scenario=scenario)
        write_summary(out / "summary.json", "plan", scenario, {"plan": {}})
        (out / "plan.json").write_text(a_plan().to_json())

    monkeypatch.setitem(STUDIES, "plan", replace(STUDIES["plan"], run=run, options=STUDIES["turnover"].options))
    scenario = Scenario().with_overrides({"controller.k_p": 400.0})
    assert repr(run_study("plan", tmp_path / "new", scenario, quick=True)) == repr(a_plan())
    assert asked == {"scenario": scenario, "quick": True, "jobs": None, "architectures": list(ARCHITECTURES)}


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("fly", {}, "unknown study 'fly'; choose from plan, turnover, frequency"),
        (
            "turnover",
            {"quik": True},
            "the study 'turnover' has no option 'quik'; choose from architectures, quick, jobs",
        ),
        ("plan", {"quick": True}, "the study 'plan' has no option 'quick'; valid is none"),
    ],
)
def test_an_unknown_study_or_option_is_refused_before_anything_is_written(tmp_path, name, options, words):
    with pytest.raises(InputError, match=words):
        run_study(name, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


# ---- compare


def test_a_recording_compared_with_itself_differs_in_nothing(best):
    found = compare(best, best)
    assert found.same and found.same_grid and not found.scenario and not found.notes
    assert all(part.largest == part.rms == part.one_sided == 0 for part in found.signals)
    assert len(found.signals) == len(best.flip.to_frame().columns)
    assert all(change.same for change in found.metrics)
    assert "no difference" in found.to_markdown() and "no difference" in repr(found)


def test_a_run_is_compared_as_its_recording(best, dropped):
    found = compare(Run(best, a_plan(), 1.0), dropped)
    assert found.kind == "recording" and found.names == ("pd+ff+dob", "pd") and not found.same


def test_a_known_shift_is_found_with_its_unit_time_and_scenario(best):
    bump = np.zeros(best.sizes["time"])
    bump[700] = 0.02
    moved = best.copy(deep=True)
    moved["x"].values[:, 1] += 0.01 + bump
    moved = moved.assign_attrs(scenario=Scenario().with_overrides({"controller.k_p": 400.0}).to_yaml())
    found = compare(best, moved)
    parts = {part.name: part for part in found.signals}
    assert {name for name, part in parts.items() if part.largest} == {"x_z"}
    assert parts["x_z"].unit == "m" and parts["x_z"].largest == pytest.approx(0.03)
    assert parts["x_z"].time == best["time"].values[700]
    assert parts["x_z"].rms == pytest.approx(np.sqrt(np.mean((0.01 + bump) ** 2)))
    assert [(row.name, row.unit, row.a, row.b) for row in found.scenario] == [("controller.k_p", "1/s2", 350.0, 400.0)]
    (rmse,) = [row for row in found.metrics if row.name == "position_rmse_m"]
    assert (rmse.unit, rmse.a, rmse.b) == ("m", measure(best).position_rmse_m, measure(moved).position_rmse_m)
    assert not rmse.same and not found.same
    text = found.to_markdown()
    assert "`x_z` | m | 0.03 |" in text and "controller.k_p" in text


def test_recordings_over_other_times_are_compared_where_both_have_a_sample(best, dropped):
    shorter = best.sel(time=slice(-0.1, None))
    found = compare(shorter, best)
    assert found.same_grid is False and not found.same and all(part.largest == 0 for part in found.signals)
    away = best.assign_coords(time=("time", best["time"].values + 10.0005, {"units": "s"}))
    assert "No time in common" in " ".join(compare(best, away.assign_attrs(end_time_s=10.5)).notes)
    other = compare(best, dropped)
    assert any("Architectures" in note for note in other.notes)
    assert any(part.one_sided for part in other.signals if part.name == "cone_use")
    alone = compare(best, best.drop_vars("slip"))
    assert any("slip" in note for note in alone.notes) and not alone.same


def test_the_plot_of_a_comparison_shows_both_or_their_difference(best, dropped):
    moved = best.copy(deep=True)
    moved["x"].values[:, 1] += 0.01
    found = compare(best, moved)
    panel = found.plot("x_z")
    first, second = (line for line in panel.get_lines())
    assert first.get_color() != second.get_color() and first.get_label() != second.get_label()
    np.testing.assert_allclose(second.get_ydata() - first.get_ydata(), 0.01)
    (line,) = found.plot("x_z", difference=True).get_lines()
    np.testing.assert_allclose(line.get_ydata(), 0.01)
    assert len(compare(best, dropped).plot("tau")) == 6
    with pytest.raises(InputError, match="unknown signal"):
        found.plot("nothing")
    renamed = compare(best, best.assign_coords(joint=list("abcdef")))
    assert any("tau_S" in note for note in renamed.notes) and any("tau_a" in note for note in renamed.notes)
    with pytest.raises(InputError, match="tau_S.* and tau_a"):
        renamed.plot("tau")
    with pytest.raises(InputError, match="no signals"):
        compare(a_plan(), a_plan()).plot()


def test_what_cannot_be_compared_is_refused(best):
    for other in (a_plan(), xr.Dataset(), 7):
        with pytest.raises(InputError):
            compare(best, other)


# ---- files


def turnover_body(datas, folder=None):
    runs = []
    for name, data in datas.items():
        if folder is not None:
            save_recording(data, measure(data), folder / f"{name}.nc")
        runs.append(measure(data).as_dict() | {"real_time_factor": 2.0, "recording": f"{name}.nc"})
    return {"plan": a_plan().summary(), "runs": runs}


def experiment_body(starts=(0.0, 0.02)):
    datas = {name: flown(name) for name in ("pd", "pd+ff+dob")}
    flown_from = [(y, replace(measure(data), start_y_m=y)) for y in starts for data in datas.values()]
    runs = [run_entry(y, metrics.architecture, Outcome(metrics, metrics.failure)) for y, metrics in flown_from]
    runs[-1] = run_entry(starts[-1], "pd+ff+dob", Outcome(None, "no plan: far"))
    holds = {"E1": True, "E2": None, "E3": False}
    said = {"text": "it turns", "measured": "1 of 1", "paper": "yes", "numbers": {}, "difference": ""}
    return {
        "quick": True,
        "starts_y_m": list(starts),
        "architectures": list(datas),
        "runs": runs,
        "claims": [{"id": id, "holds": verdict, **said} for id, verdict in holds.items()],
        "second_engine": None,
    }


def borders_body(friction=(0.0, 0.1, 0.2)):
    rng = np.random.default_rng(0)
    cells = {
        name: {
            "success": (rng.random((len(friction), 2)) > 0.5).tolist(),
            "failure": [["dropped", None]] * len(friction),
            "position_rmse_m": rng.random((len(friction), 2)).tolist(),
        }
        for name in ARCHITECTURES
    }
    cells["pd"]["position_rmse_m"][0][0] = None
    x = {"label": "k_p [1/s²]", "values": [70.0, "lab"], "logarithmic": True, "overrides": [{}, {}]}
    y = {
        "label": "joint friction [of rated torque]",
        "values": list(friction),
        "logarithmic": False,
        "overrides": [{}] * len(friction),
    }
    drawn = {"name": "gains", "title": "Gains", "question": "Which?", "x": x, "y": y, "architectures": cells}
    run = {"success": True, "failure": None, "position_rmse_m": 0.01}
    rows = [
        {
            "group": "step",
            "name": f"{k} ms",
            "overrides": {},
            "fragile": ["pd"] * k,
            "runs": {name: dict(run) for name in ARCHITECTURES},
        }
        for k in range(2)
    ]
    return {"quick": False, "maps": [drawn], "variations": rows}


def frequency_body(factor=1.0):
    omega = np.geomspace(0.1, 100, 5)
    curves = [
        {
            "figure": figure,
            "architecture": name,
            "g_dis_rad_s": g,
            "friction": friction,
            "unit": unit,
            "omega_rad_s": omega,
            "value": factor * np.arange(5.0) + k,
            "theory": None if friction else np.arange(5.0),
        }
        for k, (figure, name, g, friction, unit) in enumerate(
            [("5", "pd", None, False, "1"), ("5", "pd+dob", 30.0, False, "1"), ("7", "pd", None, True, "m")]
        )
    ]
    torque = [
        {
            "figure": "9a",
            "omega_rad_s": 10.0,
            "architecture": name,
            "g_dis_rad_s": [3.0, 30.0],
            "max_torque_N": [1.0, 2.0 + k],
            "theory": [1.0, 2.0],
        }
        for k, name in enumerate(("pd", "pd+dob"))
    ]
    claims = [{"id": "C1", "claim": TEXTS["C1"], "holds": factor == 1.0, "measured": {"gain": 1.0}}]
    return {"curves": curves, "torque": torque, "claims": claims, "seconds": factor}


BODIES = {
    "turnover": lambda: turnover_body({"pd": flown("pd"), "pd+ff+dob": flown()}),
    "experiment": experiment_body,
    "borders": borders_body,
    "frequency": frequency_body,
    "report": lambda: {"quick": False, "claims": [{"id": "C1", "claim": "follows", "holds": True, "measured": "1.0"}]},
}


def summary_file(folder, study, body=None, scenario=None):
    return write_summary(folder / "summary.json", study, scenario or Scenario(), body or BODIES[study]())


def test_a_recording_file_gives_the_recording_back(best, tmp_path):
    save_recording(best, measure(best), tmp_path / "pd+ff+dob.nc")
    for path in (tmp_path / "pd+ff+dob.nc", str(tmp_path)):  # the only recording of a folder stands for it
        read = open_result(path)
        for name in best.data_vars:
            np.testing.assert_array_equal(read[name].values, best[name].values)
        np.testing.assert_equal(asdict(read.flip.metrics()), asdict(measure(best)))
        assert read.attrs["success"] == 1
    save_recording(best, measure(best), tmp_path / "pd.nc")
    with pytest.raises(InputError, match=r"several recordings, pd\+ff\+dob.nc, pd.nc"):
        open_result(tmp_path)


def test_plans_come_back_as_plans(tmp_path):
    (tmp_path / "plan.json").write_text(a_plan(2.5).to_json())
    assert open_result(tmp_path).cost == open_result(tmp_path / "plan.json").cost == 2.5
    summary_file(tmp_path, "plan", {"plan": a_plan(2.5).summary()})
    assert open_result(tmp_path).cost == 2.5
    assert ("plan, cost J", "2.5") in info(tmp_path).rows
    assert ("cost J", "2.5") in info(tmp_path / "plan.json").rows
    (tmp_path / "plan.json").unlink()
    with pytest.raises(InputError, match="plan.json"):
        open_result(tmp_path)


def test_turnover_is_a_dataset_over_architectures_with_units(best, dropped, tmp_path):
    summary_file(tmp_path, "turnover", turnover_body({"pd": dropped, "pd+ff+dob": best}, tmp_path))
    data = open_result(tmp_path)
    mine = data.sel(architecture="pd+ff+dob")
    expected = measure(best)
    assert bool(mine["success"]) and not bool(data["success"].sel(architecture="pd"))
    assert float(mine["position_rmse_m"]) == expected.position_rmse_m and mine["position_rmse_m"].attrs["units"] == "m"
    assert float(mine["touchdown_theta_rad"]) == expected.touchdown.theta_rad
    assert float(mine["max_torque_Nm"].sel(joint="L")) == expected.max_torque_Nm[1]
    assert data["max_torque_Nm"].attrs["units"] == "N m"
    assert str(data["failure"].sel(architecture="pd").values) == measure(dropped).failure
    assert data.attrs["plan_cost_J"] == 1.0 and data.attrs["schema"] == "flipdiagram/turnover/1"
    assert data.flip.scenario == Scenario()


def test_joints_without_a_recording_have_numbers(tmp_path):
    summary_file(tmp_path, "turnover")
    assert list(open_result(tmp_path)["joint"].values) == list("123456")


def test_experiment_is_a_dataset_over_architecture_and_start(tmp_path):
    path = tmp_path / recording_name(0.0, "pd")
    path.parent.mkdir()
    save_recording(flown("pd"), measure(flown("pd")), path)
    data = open_result(summary_file(tmp_path, "experiment"))
    assert data["position_rmse_m"].dims == ("architecture", "start_y") and data["start_y"].attrs["units"] == "m"
    assert float(data["position_rmse_m"].sel(architecture="pd", start_y=0.02)) == measure(flown("pd")).position_rmse_m
    unplanned = data.sel(architecture="pd+ff+dob", start_y=0.02)
    assert np.isnan(float(unplanned["position_rmse_m"])) and str(unplanned["failure"].values) == "no plan: far"
    np.testing.assert_array_equal(data["claim_holds"].values, [1, np.nan, 0])
    assert list(data["joint"].values) == list("SLURBT")


def test_borders_are_a_dataset_by_map_over_its_own_axes(tmp_path):
    body = borders_body()
    found = open_result(summary_file(tmp_path, "borders", body))
    assert list(found) == ["gains", "variations"]
    gains = found["gains"]
    assert gains["success"].dims == ("architecture", "joint_friction", "k_p") and gains["success"].dtype == bool
    assert gains["k_p"].attrs["units"] == "1/s²" and gains["joint_friction"].attrs["units"] == "of rated torque"
    cells = body["maps"][0]["architectures"]["pd+dob"]
    for j, friction in enumerate((0.0, 0.1, 0.2)):
        for i, k_p in enumerate(("70", "lab")):
            cell = gains.sel(architecture="pd+dob", joint_friction=friction, k_p=k_p)
            assert bool(cell["success"]) == cells["success"][j][i]
            assert float(cell["position_rmse_m"]) == cells["position_rmse_m"][j][i]
    assert np.isnan(float(gains["position_rmse_m"].sel(architecture="pd", joint_friction=0.0, k_p="70")))
    assert list(found["variations"]["group"].values) == ["step", "step"]
    assert bool(found["variations"]["success"].sel(variation="1 ms").all())


def test_frequency_is_a_dataset_by_figure(tmp_path):
    found = open_result(summary_file(tmp_path, "frequency"))
    assert list(found) == ["5", "7", "9", "claims"]
    curves = found["5"]
    assert curves["value"].dims == ("curve", "omega") and curves["omega"].attrs["units"] == "rad/s"
    np.testing.assert_array_equal(curves["value"].values, [np.arange(5.0), np.arange(5.0) + 1])
    np.testing.assert_array_equal(curves["g_dis"].values, [np.nan, 30.0])
    assert found["7"]["value"].attrs["units"] == "m" and "theory" not in found["7"]
    assert float(found["9"]["max_torque_N"].sel(architecture="pd+dob", omega=10.0, g_dis=30.0)) == 3.0
    assert found["claims"]["holds"].values == [1.0]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("summary.json", "{", "not valid JSON"),
        ("summary.json", "[1]", "has schema null"),
        (
            "summary.json",
            '{"schema": "flipdiagram/other/1"}',
            "valid are flipdiagram/plan/1, flipdiagram/turnover/1, .*flipdiagram/tuning/1",
        ),
        ("summary.json", '{"schema": "flipdiagram/turnover/2"}', "newer than this flipdiagram"),
        ("summary.json", '{"schema": "flipdiagram/turnover/0"}', "older than this flipdiagram"),
        ("summary.json", '{"schema": "flipdiagram/turnover/1"}', "is damaged: it lacks 'versions'"),
        (
            "summary.json",
            '{"schema": "flipdiagram/turnover/1", "versions": {}, "scenario": {}}',
            "is damaged: it lacks 'runs'",
        ),
        (
            "summary.json",
            '{"schema": "flipdiagram/borders/1", "versions": {}, "scenario": {}, "maps": [1], "variations": []}',
            "is damaged",
        ),
        ("summary.json", b"\xff\xfe\x00", "not UTF-8 text"),
        ("plan.json", '{"schema": "flipdiagram/motion/1", "cost": 1}', "plan file"),
        ("plan.json", '{"schema": "flipdiagram/motion/9"}', "newer"),
        ("a.nc", b"not a NetCDF file at all", "is damaged"),
        ("a.nc", b"", "is damaged"),
        ("replay.html", "<html>", "not supported"),
        ("a.txt", "", "no file of results"),
    ],
)
def test_a_file_that_cannot_be_read_ends_in_one_line(name, content, words, tmp_path):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    for call in (open_result, info, lambda file: compare(file, file)):
        if call not in (open_result, info) and "damaged" in words and name == "summary.json":
            continue  # compares whatever stands there
        with pytest.raises(InputError) as error:
            call(path)
        assert "\n" not in str(error.value) and name in str(error.value)
        assert re.search(words, str(error.value))


@pytest.mark.parametrize("path", ["nowhere", "nowhere/summary.json", "."])
def test_a_missing_file_and_an_empty_folder_are_named(path, tmp_path):
    with pytest.raises(InputError, match="does not exist|holds no results"):
        open_result(tmp_path / path)
    with pytest.raises(InputError):
        open_result("a\0b")


def test_a_recording_cut_off_anywhere_is_called_damaged_or_reads_as_written(best, tmp_path):
    whole = tmp_path / "whole.nc"
    small = best.isel(time=slice(0, 400))
    save_recording(small, measure(best), whole)
    content = whole.read_bytes()
    rng = np.random.default_rng(3)
    path = tmp_path / "part.nc"
    for end in [1, 3, 4, 8, 16, 100, 1000, *map(int, rng.integers(2000, len(content) - 8, 12))]:
        path.write_bytes(content[:end])
        with pytest.raises(InputError) as error:
            open_result(path)
        assert "\n" not in str(error.value)
    for at in rng.integers(0, 4000, 40):  # a byte of the header changed: an error of ours, or a Dataset
        changed = bytearray(content)
        changed[at] ^= 0xFF
        path.write_bytes(changed)
        try:
            open_result(path)
        except InputError as error:
            assert "\n" not in str(error)


def test_another_dataset_is_told_apart_from_a_recording(tmp_path):
    xr.Dataset({"depth": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc", engine="scipy")
    with pytest.raises(InputError, match="holds depth: neither"):
        open_result(tmp_path / "a.nc")
    data = xr.Dataset({"linear_peak_x": ("omega", [1.0, 3.0], {"units": "m"})}, coords={"omega": [1.0, 2.0]})
    data.to_netcdf(tmp_path / "frequency.nc", engine="scipy")
    assert open_result(tmp_path / "frequency.nc")["linear_peak_x"].attrs["units"] == "m"
    assert ("signal linear_peak_x", "omega 2; 1 … 3 m") in info(tmp_path / "frequency.nc").rows


# ---- compare and info of summaries


def test_summaries_tell_verdicts_numbers_and_fields_that_differ(tmp_path):
    one = summary_file(tmp_path / "one", "frequency", frequency_body())
    other = summary_file(
        tmp_path / "two", "frequency", frequency_body(2.0), Scenario().with_overrides({"one_dof.k_p": 1.0})
    )
    found = compare(one, other)
    assert [(row.name, row.a, row.b) for row in found.verdicts] == [("claims[C1].holds", True, False)]
    assert {row.name: (row.a, row.b) for row in found.numbers}["curves[5, pd+dob, 30, no].value[4]"] == (5.0, 9.0)
    assert [row.name for row in found.scenario] == ["one_dof.k_p"]
    text = found.to_markdown()
    assert "claims[C1].holds" in text and "seconds" not in text


def test_runs_of_only_one_summary_and_maps_over_other_axes_are_noted_not_compared(tmp_path):
    one = summary_file(tmp_path / "one", "experiment", experiment_body((0.0, 0.02)))
    other = summary_file(tmp_path / "two", "experiment", experiment_body((0.0, 0.04)))
    notes = " ".join(compare(one, other).notes)
    assert "runs[pd, 0.02]" in notes and "runs[pd, 0.04]" in notes and "runs[pd, 0]" not in notes
    one = summary_file(tmp_path / "one", "borders", borders_body())
    other = summary_file(tmp_path / "two", "borders", borders_body((0.0, 0.1, 0.3)))
    found = compare(one, other)
    assert "Over other axes, not compared: `maps[gains]`" in found.notes
    assert not found.verdicts and not found.numbers


def test_plans_are_compared_by_their_numbers(tmp_path):
    (tmp_path / "plan.json").write_text(a_plan(3.0).to_json())
    (cost,) = compare(a_plan(2.0), tmp_path / "plan.json").numbers
    assert (cost.name, cost.unit, cost.a, cost.b, cost.difference) == ("cost_J", "1", 2.0, 3.0, "+1 (+50 %)")


def test_kinds_that_differ_are_refused(tmp_path):
    one, other = summary_file(tmp_path / "a", "report"), summary_file(tmp_path / "b", "frequency")
    with pytest.raises(InputError, match="kind 'report' with 'frequency'"):
        compare(one, other)


def test_info_of_a_recording_tells_verdict_ranges_and_changed_fields(tmp_path):
    data = flown("pd", controller__k_p=400.0)
    save_recording(data, metrics.measure(data), tmp_path / "pd.nc")
    rows = dict(info(tmp_path / "pd.nc").rows)
    assert rows["kind"] == "recording" and rows["architecture"] == "pd"
    assert rows["block"] == f"not turned over: {measure(data).failure}"
    assert rows["scenario controller.k_p"] == "400 (default 350)"
    low, high = data["x"].values[:, 2].min(), data["x"].values[:, 2].max()
    assert f"theta {low:.4g} … {high:.4g} rad" in rows["signal x"] and "time 1501 × axis 3" in rows["signal x"]
    assert rows["signal tau"].endswith("N m")
    assert rows["duration"].startswith("1.5 s")
    assert info(tmp_path / "pd.nc").markdown() and info(tmp_path / "pd.nc").rich()


@pytest.mark.parametrize(
    ("study", "row"),
    [
        ("turnover", ("block, pd+ff+dob", "turned over")),
        ("experiment", ("claims", "1 of 3 hold")),
        ("experiment", ("claims not judged", "E2")),
        ("experiment", ("block, pd+ff+dob", "1 of 2 turned over: no plan: far")),
        ("borders", ("variations", "2, a verdict differs in 1")),
        ("frequency", ("claims", "1 of 1 hold")),
        ("report", ("schema", "flipdiagram/report/1")),
    ],
)
def test_info_of_a_summary_counts_verdicts_and_claims(study, row, tmp_path):
    scenario = Scenario().with_overrides({"planner.contact_samples": (11, 30)})
    rows = info(summary_file(tmp_path, study, scenario=scenario)).rows
    assert row in rows
    assert ("scenario planner.contact_samples", "[11, 30] (default [10, 20])") in rows
    assert any(name == "versions" and "drake" in text for name, text in rows)


def test_importing_the_results_opens_no_display_and_registers_the_accessor():
    code = "import sys, xarray, flipdiagram.results; assert hasattr(xarray.Dataset, 'flip'); assert 'matplotlib.pyplot' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_texts_of_results_are_json_for_attributes(best):
    json.dumps(best.flip.to_frame().attrs)
