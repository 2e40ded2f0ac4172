"""What is made of the rows: rates, pairs, sensitivities, maps, exports, pages, figures."""

import io
import json
import shutil
import time

import numpy as np
import pytest
import xarray as xr
import yaml
from campaign.made_up import QUIET, WORK
from rich.console import Console
from synthetic import recording

from flipdiagram.campaign import figures as campaign_figures
from flipdiagram.campaign import tables as campaign_tables
from flipdiagram.campaign.analysis import analyse
from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.dataset import METRICS, export, load_dataset, parameters_of, to_dataset
from flipdiagram.campaign.run import run, run_campaign
from flipdiagram.campaign.study import report_section, write_analysis
from flipdiagram.campaign.watch import status_grid, watch
from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import MODES, mode_of
from flipdiagram.flips.row import Row
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.results import compare, open_campaign
from flipdiagram.scenario.scenario import Scenario

NAMES = ("pd", "pd+ff", "pd+dob", "pd+ff+dob")
WORLD = """
base: {simulation: {hold_time: 0.05}}
vary:
  object.friction: {uniform: [0.01, 1.0]}
  object.mass: {uniform: [0.01, 1.0]}
  table.friction: {uniform: [0.01, 1.0]}
  simulation.contact_model: {choice: [point, hydroelastic]}
sampler: SAMPLER
trials: TRIALS
"""


def made(sampler="lhs", trials=192, rule=None):
    """A campaign whose successes follow a rule of the drawn values; timeouts and refusals strewn in."""
    specification = from_text(WORLD.replace("SAMPLER", sampler).replace("TRIALS", str(trials)))
    rows = []
    for k in range(trials):
        trial = specification.trial(k)
        for name in NAMES:
            won = rule(name, trial.values) if rule else trial.values[0] > {"pd": 0.9, "pd+ff": 0.8}.get(name, 0.3)
            outcome = "turned over" if won else "slid later"
            numbers = {metric: 0.01 + 0.02 * trial.values[1] for metric in METRICS}
            numbers |= {"max_torque_Nm": [1.0] * 6, "torque_use": 1.0 if trial.values[2] > 0.75 else 0.4}
            if name == "pd" and k % 48 == 5:
                outcome, numbers = ("timeout", None) if k % 96 == 5 else ("crashed", None)
            plain = (trial.overrides, list(trial.values), numbers, None, "c", {}, 1.0, "h", 1, 0.0)
            rows.append(Row(k, name, outcome, None if won else outcome, 1, "hash", *plain))
    return to_dataset(specification.as_dict(), rows)


@pytest.fixture(scope="module")
def data():
    return made()


@pytest.fixture(scope="module")
def summary(data):
    return analyse(data)


def test_rates_are_those_of_the_trials_that_count(data, summary):
    assert summary["flips"] == 192 * 4
    entry = summary["architectures"]["pd"]
    assert entry["flips"] == 192 and entry["counted"] == 188
    assert entry["modes"]["timeout"] == 2 and entry["modes"]["crashed"] == 2
    assert entry["rate"] == pytest.approx(0.1, abs=0.02) and entry["low"] < entry["rate"] < entry["high"]
    assert summary["architectures"]["pd+ff+dob"]["rate"] == pytest.approx(0.7, abs=0.01)
    assert entry["saturated"] == pytest.approx(0.25, abs=0.02)
    median = summary["architectures"]["pd+dob"]["quantiles"]["position_rmse_m"]["0.5"]
    assert median == pytest.approx(0.02, abs=2e-4)


def test_pairs_are_compared_over_the_trials_that_count_for_both(summary):
    pairs = {(pair["first"], pair["second"]): pair for pair in summary["pairs"]}
    assert len(pairs) == 6
    same = pairs["pd+ff+dob", "pd+dob"]
    assert same["difference"] == 0 and same["p"] == 1 and same["low"] < 0 < same["high"]
    apart = pairs["pd+ff+dob", "pd"]
    assert apart["trials"] == 188 and apart["second_only"] == 0
    assert apart["difference"] == pytest.approx(0.6, abs=0.02) and apart["p_holm"] < 1e-6 and apart["low"] > 0.5


def test_the_parameter_that_decides_comes_first_and_the_others_stay_below_chance(summary):
    found = summary["sensitivity"]["pd+ff+dob"]["success"]
    assert found[0]["parameter"] == "object.friction" and found[0]["rho"] > 0.7 and found[0]["p"] < 1e-10
    assert all(max((entry["rho"] or 0) ** 2, entry["explained"]) < 0.06 for entry in found[1:])
    errors = summary["sensitivity"]["pd"]["position_rmse_m"]
    assert errors[0]["parameter"] == "object.mass" and errors[0]["rho"] == pytest.approx(1)
    assert next(e for e in errors if e["parameter"] == "simulation.contact_model")["rho"] is None


def test_an_effect_that_is_not_monotonic_or_of_a_choice_is_seen():
    def rule(name, values):
        return abs(values[0] - 0.5) < 0.25 if name == "pd" else values[3] == "point"

    summary = analyse(made(rule=rule))
    band = summary["sensitivity"]["pd"]["success"][0]
    assert band["parameter"] == "object.friction" and abs(band["rho"]) < 0.2 and band["explained"] > 0.5
    choice = summary["sensitivity"]["pd+ff"]["success"][0]
    assert choice["parameter"] == "simulation.contact_model" and choice["explained"] == pytest.approx(1)


def test_sobol_indices_of_a_known_rule():
    # success where x > 0.5 and y > 0.5: by hand, first = 1/3 each, total = 2/3 each
    data = made("saltelli", 256 * 6, lambda name, values: values[0] > 0.5 and values[1] > 0.5)
    found = {entry["parameter"]: entry for entry in analyse(data)["sobol"]["pd+dob"]}
    for name in ("object.friction", "object.mass"):
        assert found[name]["first"] == pytest.approx(1 / 3, abs=0.06)
        assert found[name]["total"] == pytest.approx(2 / 3, abs=0.06)
    assert abs(found["table.friction"]["total"]) < 1e-12
    assert "pd" not in analyse(data)["sobol"]  # some of its trials timed out


def test_the_map_is_of_the_two_that_matter_most_and_counts_every_trial(summary):
    drawn = summary["map"]
    assert drawn["x"]["parameter"] == "object.friction"
    cells = drawn["architectures"]["pd+ff+dob"]
    assert np.sum(cells["trials"]) == 192 and np.sum(cells["successes"]) == 136
    assert np.sum(drawn["architectures"]["pd"]["trials"]) == 188
    rate = np.sum(cells["successes"], axis=0) / np.sum(cells["trials"], axis=0)
    assert rate[0] == 0 and rate[-1] == 1


def test_the_map_shows_counts_in_its_cells_each_trial_beside_them_and_units(summary, data):
    figure = campaign_figures.plot_map(summary, data)
    names, drawn = list(summary["architectures"]), summary["map"]
    above, below = figure.axes[: len(names)], figure.axes[len(names) : 2 * len(names)]
    for name, cells, trials in zip(names, above, below, strict=True):
        counts = drawn["architectures"][name]
        pairs = zip(np.ravel(counts["successes"]), np.ravel(counts["trials"]), strict=True)
        assert [text.get_text() for text in cells.texts] == [f"{won}/{all_}" for won, all_ in pairs if all_]
        lost, won = (len(marks.get_offsets()) for marks in trials.collections)
        assert won == np.sum(counts["successes"]) and lost + won == np.sum(counts["trials"])
    assert figure.get_supxlabel() == "object.friction [1]" and above[0].get_ylabel() == below[0].get_ylabel()
    assert campaign_figures._with_unit("object.mass") == "object.mass [kg]"
    assert campaign_figures._with_unit("simulation.contact_model") == "simulation.contact_model"


def test_modes_follow_the_text():
    assert mode_of(None) == "turned over"
    modes = {
        "slid at the start from 0.041 s, dropped at 0.2 s": "slid at the start",
        "slid later from 0.2 s, dropped at 0.3 s": "slid later",
        "tipped, dropped at 0.2 s": "tipped",
        "struck the table at 0.3 s, dropped at 0.4 s": "struck the table",
        "torque limit from 0.1 s, landed at 1.2 rad": "torque limit",
        "landed at 1.2 rad": "wrong angle",
        "never reached the table": "never landed",
        "folded, 12 % of its upper face look up": "folded",
        "not turned, 100 % of its upper face look up": "not turned",
        "off target by 3.4 cm": "off target",
        **{f"{kind}: x": kind for kind in ("no plan", "diverged", "no start", "refused", "timeout", "crashed")},
        "something else": "refused",
    }
    assert {text: mode_of(text) for text in modes} == modes
    assert set(campaign_figures.COLOURS) == set(MODES)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return run(from_text(QUIET), tmp_path_factory.mktemp("campaign"), jobs=2, work=WORK).file


def test_a_file_is_exported_whole_in_every_format(file, tmp_path):
    pandas = pytest.importorskip("pandas")
    data = load_dataset(file)
    assert parameters_of(data) == ["object.friction", "object.mass"] and dict(data.sizes)["trial"] == 30
    csv = pandas.read_csv(export(file, tmp_path / "a.csv"))
    assert len(csv) == 60 and csv["object.friction"].tolist() == np.repeat(data["object.friction"], 2).values.tolist()
    assert csv["outcome"].tolist() == data["outcome"].values.ravel().tolist()
    with xr.open_dataset(export(file, tmp_path / "a.nc"), engine="scipy") as back:
        assert back["outcome"].astype(str).values.tolist() == data["outcome"].values.tolist()
        assert np.array_equal(back["position_rmse_m"], data["position_rmse_m"])
        assert back["success"].values.tolist() == data["success"].values.astype(int).tolist()
    with pytest.raises(InputError, match=r"--export.*\.csv"):
        export(file, tmp_path / "a.xls")


def test_a_file_is_exported_to_parquet(file, tmp_path):
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    assert len(pandas.read_parquet(export(file, tmp_path / "a.parquet"))) == 60


def test_the_analysis_is_written_with_all_its_figures(file, tmp_path):
    summary = write_analysis(file, tmp_path)
    assert summary["schema"] == "flipdiagram/campaign/1" and summary["scenario"]["simulation"]["hold_time"] == 0.05
    assert summary == json.loads((tmp_path / "summary.json").read_text())
    page = (tmp_path / "campaign.md").read_text()
    for name, _ in campaign_tables.FIGURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 5000 and (tmp_path / f"{name}.svg").is_file()
        assert f"({name}.png)" in page
    assert "`pd+ff+dob` − `pd`" in page and "object.friction" in page
    assert "(campaign/campaign_map.png)" in campaign_tables.section(summary, "campaign")
    shutil.copy(file, tmp_path)
    assert f"({tmp_path.name}/campaign_map.png)" in report_section(tmp_path.parent, [tmp_path.name])


def test_python_flies_a_campaign_from_what_would_stand_in_its_file(file, monkeypatch):
    flown = load_dataset(file)
    mapping = yaml.safe_load(QUIET)
    scenario = Scenario().with_overrides(mapping["base"])
    again = run_campaign(mapping | {"base": scenario}, file.parent, jobs=1, resume=True)  # nothing is missing
    xr.testing.assert_identical(again, flown)
    monkeypatch.setitem(run.__kwdefaults__, "work", WORK)
    told = []
    kept_nowhere = run_campaign(mapping | {"trials": 2}, jobs=1, progress=told.append)
    assert kept_nowhere.sizes["trial"] == 2 and (kept_nowhere["outcome"] != "").all() and told
    xr.testing.assert_identical(open_campaign(file.parent), flown)
    xr.testing.assert_identical(open_campaign(str(file)), flown)
    assert compare(file, flown).same
    fewer = compare(flown, kept_nowhere)
    changed = {change.name: (change.a, change.b) for change in fewer.numbers}
    assert fewer.kind == "campaign data" and changed["trials"] == (30, 2)
    assert changed["architectures.pd.counted"] == (30, 2)
    recording().to_netcdf(file.parent / "pd.nc", engine="scipy")
    with pytest.raises(InputError, match=r"pd.nc' is a result of kind 'recording'; valid is the folder or"):
        open_campaign(file.parent / "pd.nc")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (3, "specification = 3; valid is the name of a file, or a mapping"),
        (
            {"vary": {"object.mas": {"uniform": [0, 1]}}, "trials": 2},
            "campaign 'specification': .* did you mean 'object.mass'",
        ),
        ({"vary": {"object.mass": {1, 2}}}, "a campaign's mapping cannot be written: .*set.*; valid is texts, numbers"),
        ("nowhere.yaml", "campaign 'nowhere.yaml' cannot be read: No such file"),
    ],
)
def test_a_bad_specification_in_python_is_one_line(given, words):
    with pytest.raises(InputError, match=words) as caught:
        run_campaign(given)
    assert "\n" not in str(caught.value)


def test_figures_of_hundreds_of_flips_and_of_none(summary, data, tmp_path):
    assert len(campaign_figures.write_figures(summary, data, tmp_path)) == 4
    specification = from_text(WORLD.replace("SAMPLER", "lhs").replace("TRIALS", "4"))
    nothing = to_dataset(specification.as_dict(), [])
    empty = analyse(nothing)
    assert campaign_figures.write_figures(empty, nothing, tmp_path) == ["campaign_success"]
    assert "0 flips" in campaign_tables.section(empty | {"figures": []})


def test_watching_shows_what_is_there_and_how_long_it_takes(file, tmp_path):
    grid, done = status_grid(file)
    assert done and "60 of 60 flips, finished" in grid.title
    assert [row[:2] for row in grid.rows] == [["`pd`", "30/30"], ["`pd+ff+dob`", "30/30"]]
    specification, path = from_text(QUIET), tmp_path / "campaign.sqlite"
    with open_to_write(
        path, {"digest": specification.digest, "specification": json.dumps(specification.as_dict())}
    ) as results:
        assert "0 of 60 flips" in status_grid(path)[0].title
        now = time.time()
        plain = ("h", {}, [1, 2], None, None, "c", {}, 1.0, "h", 1)
        results.put([Row(k, "pd", "timeout", "t", 1, *plain, now + k).packed() for k in range(11)])
        title = status_grid(path)[0].title
        assert "11 of 60 flips, 60 a minute, 0:00:49 left" in title
    assert "not running" in status_grid(path)[0].title
    screen = Console(file=io.StringIO(), width=120)
    watch(path, screen)
    assert "11/30" in screen.file.getvalue()
