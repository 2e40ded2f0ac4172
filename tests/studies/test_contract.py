"""What every study of the registry keeps: command, help, schema, lazy figures and tables, and results that are read."""

import json
import subprocess
import sys

import numpy as np
import pytest
import recorded
import xarray as xr

from flipdiagram.campaign import dataset
from flipdiagram.campaign.dataset import METRICS
from flipdiagram.cli import main as cli
from flipdiagram.cli.completion import script
from flipdiagram.cli.options import COMMANDS, parser
from flipdiagram.errors import InputError
from flipdiagram.grid import Grid
from flipdiagram.planning import Plan
from flipdiagram.results import compare, info, open_result
from flipdiagram.studies.registry import COMMANDS as STUDY_COMMANDS
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.study import Later

HEAVY = ("pydrake", "matplotlib", "rich", "xarray", "pandas", "numba", "scipy")
RECORDED = sorted(STUDIES.keys() - {"plan"})
WORDS = {"place": "object", "report": None, "frequency": None, "borders": None}
WORDS |= {"pancake": "pancake"} | dict.fromkeys(("engines", "calibrate", "inverse", "challenge", "leaderboard"))
"""What is judged, run by run; None where claims or maps are counted instead."""


def test_the_registry_is_the_list_of_the_issue():
    names = ["plan", "turnover", "frequency", "experiment", "borders", "replanning"]
    names += ["engines", "pancake", "calibrate", "inverse", "place", "campaign", "tuning"]
    names += ["challenge", "leaderboard"]
    assert list(STUDIES) == [*names, "report"]
    assert list(STUDY_COMMANDS) == list(COMMANDS[: len(STUDY_COMMANDS)])
    other = {name for study in STUDIES.values() for name in study.otherwise.values()}
    assert {study.name for study in STUDIES.values() if not study.command} == other


def test_the_records_import_nothing_heavy():
    code = f"import sys, flipdiagram.cli.main, flipdiagram.studies.registry; print({HEAVY!r} & sys.modules.keys())"
    code = code.replace(repr(HEAVY), repr(set(HEAVY)))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stdout + done.stderr


@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
def test_every_function_of_a_record_exists(study):
    for part in (study.run, study.figures, study.tables, study.read, study.first, study.stored):
        if isinstance(part, Later):
            module, name = part.path.split(":")
            assert callable(getattr(__import__(f"flipdiagram.{module}", fromlist=[name]), name)), part.path


@pytest.mark.parametrize("name", STUDY_COMMANDS)
def test_a_command_has_help_common_options_and_completion(name, capsys):
    study = STUDY_COMMANDS[name]
    assert cli.main([name, "--help"]) == 0
    shown = capsys.readouterr().out
    flat = " ".join(shown.split())
    assert study.text in flat and f"results (out/{study.name})" in flat
    completed = script("bash")
    for option in study.options:
        assert set(option.to) <= {"run", "figures", "first"}
        assert option.settings["help"].replace("%%", "%") in flat, option.names
        assert all(word in completed for word in option.names if word.startswith("--"))
    given = vars(parser().parse_args([name]))
    assert {option.dest for option in study.options} <= given.keys()
    assert given["quiet"] is False and str(given["out"]) == f"out/{study.name}"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """{study: folder} of those that are quick enough to be run here."""
    folder = tmp_path_factory.mktemp("ran")
    short = ["--simulation.hold_time", "0.1", "--simulation.settle_time", "0.1", "--quiet"]
    assert cli.main(["plan", "--out", str(folder / "plan"), "--quiet"]) == 0
    words = ["flip", "--quick", "--architecture", "pd+ff+dob", "pd+ff+dob", "--out", str(folder / "turnover"), *short]
    assert cli.main(words) == 0
    return {name: folder / name for name in ("plan", "turnover")}


@pytest.mark.parametrize("name", ["plan", "turnover"])
def test_what_a_run_wrote_is_read_drawn_and_shown(ran, name):
    study, folder = STUDIES[name], ran[name]
    summary = json.loads((folder / study.file).read_text(encoding="utf-8"))
    assert summary["schema"] == study.schema and list(summary)[:3] == ["schema", "versions", "scenario"]
    assert (folder / "plan.png").is_file() and not (folder / "replay.html").exists()
    assert all(grid.rows for grid in study.tables(summary))
    result = open_result(folder)
    assert isinstance(result, Plan if name == "plan" else xr.Dataset)
    if name == "turnover":
        assert list(result["architecture"].values) == ["pd+ff+dob"]  # named twice, flown once
        assert list(result["joint"].values) == list("SLURBT")
    assert ("schema", study.schema) in info(folder).rows


@pytest.mark.parametrize("name", RECORDED)
def test_results_are_read_with_units_and_can_be_saved(name, tmp_path):
    path = recorded.write(STUDIES[name], tmp_path)
    result = open_result(path)
    parts = result if isinstance(result, dict) else {"all": result}
    numbers = 0
    for part, data in parts.items():
        assert data.attrs["schema"] == STUDIES[name].schema
        for variable in data.data_vars.values():
            numbers += variable.dtype.kind in "fi" and "units" in variable.attrs
        data.to_netcdf(tmp_path / f"{part}.nc", engine="scipy")
    assert numbers
    assert compare(path, path).same


@pytest.mark.parametrize("name", RECORDED)
def test_tables_are_made_of_the_summary_alone(name, tmp_path):
    summary = json.loads(recorded.write(STUDIES[name], tmp_path).read_text(encoding="utf-8"))
    parts = [part for part in STUDIES[name].tables(summary) if part is not None]
    grids = [part for part in parts if isinstance(part, Grid)]
    assert grids and grids[0].rows
    assert all(len(row) == len(grid.headings) for grid in grids for row in grid.rows)
    assert str(tmp_path) in STUDIES[name].written(summary, tmp_path)


@pytest.mark.parametrize("name", RECORDED)
def test_info_judges_a_result_by_its_kind(name, tmp_path, capsys):
    path = recorded.write(STUDIES[name], tmp_path)
    assert cli.main(["info", str(path)]) == 0
    assert "schema" in capsys.readouterr().out
    rows = dict(info(path).rows)
    assert rows["kind"] == name and rows["schema"] == STUDIES[name].schema and "drake" in rows["versions"]
    what = WORDS.get(name, "block")
    judged = {label: text for label, text in rows.items() if label.startswith(("block, ", "object, ", "pancake, "))}
    assert all(label.startswith(f"{what}, ") for label in judged) and bool(judged) == (what is not None)
    words = " ".join(judged.values())
    assert ("laid down" in words) == (name == "place") and ("turned over" in words) == (what in ("block", "pancake"))


def test_info_of_a_placement_says_why(tmp_path):
    rows = dict(info(recorded.write(STUDIES["place"], tmp_path)).rows)
    assert rows["object, pd"].startswith("not laid down: ") and rows["object, pd+ff+dob"] == "laid down"


@pytest.mark.parametrize("name", RECORDED)
def test_a_damaged_summary_is_refused_in_one_line(name, tmp_path):
    study = STUDIES[name]
    whole = recorded.BODIES[name]()
    key = {
        "report": "claims",
        "tuning": "held_out",
        "campaign": "architectures",
        "engines": "architectures",
        "borders": "maps",
        "calibrate": "predictions",
        "inverse": "stages",
        "challenge": "scores",
        "leaderboard": "entries",
    }.get(name)
    key = key or ("curves" if name == "frequency" else "runs")
    for broken in ({k: v for k, v in whole.items() if k != key}, whole | {key: [1]}):
        path = recorded.write(study, tmp_path, broken)
        for look in (open_result, info):
            with pytest.raises(InputError, match="is damaged") as error:
                look(path)
            assert "\n" not in str(error.value) and study.file in str(error.value) and error.value.exit_code == 2
    path.write_text(path.read_text(encoding="utf-8").replace(study.schema, f"flipdiagram/{name}/2"), encoding="utf-8")
    with pytest.raises(InputError, match="newer than this flipdiagram reads"):
        info(path)


def flips():
    """What a campaign's file holds: three trials of two architectures, one flip missing, one without a motion."""
    both, shape = ("trial", "architecture"), (3, 2)
    numbers = {name: (both, np.arange(6.0).reshape(shape) / 7, {"units": unit}) for name, unit in METRICS.items()}
    numbers["position_rmse_m"][1][1, 1] = np.nan
    outcome = np.array([["turned over", "slid later"], ["turned over", "no plan"], ["struck the table", ""]])
    torque = (*both, "joint"), np.arange(36.0).reshape((*shape, 6)), {"units": "N m"}
    return xr.Dataset(
        {"outcome": (both, outcome), "success": (both, outcome == "turned over"), **numbers, "max_torque": torque},
        coords={
            "trial": [0, 1, 4],
            "architecture": ["pd+ff+dob", "pd"],
            "seed": ("trial", [7, 8, 9]),
            "object.mass": ("trial", [0.06, 0.061, 0.07]),
            "planner.solver": ("trial", ["clarabel", "daqp", "clarabel"]),
        },
    )


@pytest.mark.parametrize("suffix", ["sqlite", "csv", "parquet", "nc"])
def test_a_campaign_comes_back_from_its_file_and_from_every_export(suffix, tmp_path, monkeypatch):
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    data, path = flips(), tmp_path / f"campaign.{suffix}"
    monkeypatch.setattr(dataset, "load_dataset", lambda file, lost=None: data)
    path.touch() if suffix == "sqlite" else dataset.export("campaign.sqlite", path)
    found = open_result(path)
    gone = found["outcome"] == ""
    assert int(gone.sum()) == 1
    for name, variable in data.data_vars.items():
        kept = ~gone if variable.dtype.kind in "fb" else gone | ~gone
        np.testing.assert_array_equal(found[name].values[kept], variable.values[kept], err_msg=name)
        assert found[name].dims == variable.dims and found[name].attrs.get("units") == variable.attrs.get("units")
    assert found["success"].dtype == bool
    for name in ("seed", "object.mass", "planner.solver", "architecture", "trial"):
        assert list(found[name].values) == list(data[name].values)
    rows = dict(info(path).rows)
    assert rows["kind"] == "campaign data" and rows["flips, pd"] == "2: slid later 1, no plan 1"
    if suffix == "sqlite":
        assert open_result(tmp_path).equals(data)  # the folder of a campaign that was broken off


@pytest.mark.parametrize("name", ["flip.csv", "flip.parquet"])
def test_a_table_of_something_else_is_refused(name, tmp_path):
    path = tmp_path / name
    path.write_text("time [s],x_y [m]\n0.0,0.1\n")
    with pytest.raises(InputError, match="is damaged") as error:
        open_result(path)
    assert "\n" not in str(error.value) and name in str(error.value)
