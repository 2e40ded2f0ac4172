"""The whole calibration over a robot made up so that the paper's numbers name its filter and its friction."""

import json
import os
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign.made_up import AS_PRINTED, MOTION, SLOW, metrics_of  # noqa: F401 - workers import them by name
from patience import HUNG

from flipdiagram.campaign.checks import specification
from flipdiagram.campaign.specification_file import parse
from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.run import Clock
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, load_scenario
from flipdiagram.studies.calibrate import figures, worlds
from flipdiagram.studies.calibrate import run as study
from flipdiagram.studies.calibrate.observations import (
    DATA,
    NOTHING,
    PAPER,
    QUANTITIES,
    Observation,
    agreements,
    deviations,
    distance,
    observe,
    stages,
)
from flipdiagram.studies.calibrate.section import load_calibration
from flipdiagram.studies.calibrate.tables import tables

PRIORS = """
base: {simulation: {hold_time: 0.05, settle_time: 0.05}, joint_friction: {transition_velocity: 0.1}}
vary:
  sensors.velocity_cutoff: {loguniform: [30.0, 200.0]}
  joint_friction.coulomb: {uniform: [0.0, 0.2]}
  object.mass: {uniform: [0.05, 0.07]}
sampler: lhs
trials: 60
seed: 3
calibrate:
  population: 36
  rounds: 1
  synthetic: 10
  sources: {object.mass: a pair of scales}
  compare: {defaults: null, slower: slower.yaml}
"""
SLOWER = "sensors: {velocity_cutoff: 31.4}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "priors.yaml").write_text(PRIORS)
    (folder / "slower.yaml").write_text(SLOWER)
    study.run(Scenario(), folder / "out", file=str(folder / "priors.yaml"), jobs=2, work=AS_PRINTED)
    return folder


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "out" / "summary.json").read_text())


def test_the_unknowns_that_made_the_numbers_are_found_and_the_others_stay_as_they_were(summary):
    found = {row["name"]: row for row in summary["unknowns"]}
    low, middle, high = found["sensors.velocity_cutoff"]["posterior"]
    # the mean over three starts is 0.9 % above the paper's over eight
    assert 0.97 * low < 62.8 < 1.03 * high and middle == pytest.approx(62.8, rel=0.1) and high / low < 1.6
    low, middle, high = found["joint_friction.coulomb"]["posterior"]
    assert low < 0.1 < high and middle == pytest.approx(0.1, abs=0.05)
    low, _, high = found["object.mass"]["posterior"]
    assert high - low > 0.008 and found["object.mass"]["source"] == "a pair of scales"
    # rejection says the same, less sharply
    low, middle, high = found["sensors.velocity_cutoff"]["rejection"]
    assert 0.9 * low < 62.8 < 1.1 * high and middle == pytest.approx(62.8, rel=0.25)


def test_its_worlds_print_what_the_paper_prints(summary):
    for row in summary["predictions"]:
        low, _, high = row["posterior"]
        assert low <= row["paper"] * 1.1 and high >= row["paper"] * 0.9
        assert row["prior"] is None or row["prior"][2] - row["prior"][0] > high - low
    assert {row["id"]: row["posterior"] for row in summary["claim_shares"]} == dict.fromkeys(
        (f"E{k}" for k in range(1, 9)), pytest.approx(1.0)
    )


def test_named_scenarios_stand_beside_them_start_by_start(summary, folder):
    """At half the filter's frequency the made-up robot errs twice as much: 2 (1.05 + 0.9 y) cm."""
    rows = {row["name"]: row["scenarios"] for row in summary["predictions"]}
    assert list(rows)[6:] == [f"position RMSE, y = {y} cm" for y in range(0, 16, 2)]
    for y in range(0, 16, 2):
        assert rows[f"position RMSE, y = {y} cm"]["slower"] == pytest.approx(2 * (1.05 + 0.009 * y))
    assert rows["position RMSE, mean over the starts"]["slower"] == pytest.approx(2 * (1.05 + 0.009 * 7))
    assert rows["acceleration RMSE, FF+DOB"]["slower"] == pytest.approx(4.65 * np.sqrt(2))
    assert summary["claim_shares"][5]["scenarios"]["slower"] is True
    # the world at the medians, which is written to be flown by its name
    found = {row["name"]: row["posterior"][1] for row in summary["unknowns"]}
    median = load_scenario(folder / "out" / "median.yaml")
    assert median.sensors.velocity_cutoff == pytest.approx(found["sensors.velocity_cutoff"])
    assert rows["acceleration RMSE, FF+DOB"]["median"] == pytest.approx(
        4.65 * np.sqrt(62.8 / median.sensors.velocity_cutoff)
    )
    # and the one nearest to the paper: no number is farther off than the distance of the nearest draw says
    nearest = load_scenario(folder / "out" / "nearest.yaml")
    assert rows["acceleration RMSE, FF+DOB"]["nearest"] == pytest.approx(
        4.65 * np.sqrt(62.8 / nearest.sensors.velocity_cutoff)
    )
    least = min(summary["draws"]["distance"])
    for row in summary["predictions"][:6]:
        assert abs(np.log(row["scenarios"]["nearest"] / row["paper"])) <= 1.01 * least * row["tolerance"]


def test_data_held_out_are_predicted_and_synthetic_worlds_found_again(summary):
    last, sign = summary["held_out"]
    assert last["inside"] and last["interval"][0] < 1.18 < last["interval"][2]
    assert sign == {"name": "E5", "paper": True, "share": pytest.approx(1.0)}
    assert summary["recovered"]["worlds"] == 10 and summary["recovered"]["coverage"] >= 0.7


def test_rounds_come_nearer(summary):
    distances = [entry["distance"] for entry in summary["rounds"]]
    assert distances == sorted(distances, reverse=True) and distances[-1] < distances[0]
    assert summary["worlds"] == 60 + 36 * (len(distances) - 1)


def test_an_interrupted_calibration_goes_on_and_ends_the_same(folder, summary, tmp_path):
    """Killed at once, after a third of the worlds or so; what had ended is not flown again."""
    out, file = tmp_path / "out", folder / "priors.yaml"
    code = (
        "from campaign.made_up import AS_PRINTED\nfrom flipdiagram.scenario.scenario import Scenario\n"
        "from flipdiagram.studies.calibrate.run import run\n"
        f"run(Scenario(), {str(out)!r}, file={str(file)!r}, jobs=2, work=AS_PRINTED)"
    )
    path = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    run = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path})
    kept, deadline = 0, time.monotonic() + HUNG
    while kept < 100 and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
        kept = rows(out)
    run.kill()
    run.wait()
    assert 0 < rows(out) < 6 * summary["worlds"]
    study.run(Scenario(), out, file=str(file), jobs=2, work=AS_PRINTED)
    assert json.loads((out / "summary.json").read_text()) == summary


def rows(out):
    """Flips kept so far."""
    import sqlite3

    file = out / study.FILE
    if not file.exists():
        return 0
    with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database, database:
        try:
            return database.execute("SELECT count(*) FROM trials").fetchone()[0]
        except sqlite3.OperationalError:  # not made yet
            return 0


def test_pictures_and_tables_say_it(summary, tmp_path):
    figures.write_figures(summary, tmp_path)
    assert (tmp_path / "posterior.png").stat().st_size > 10_000
    assert (tmp_path / "predictions.svg").stat().st_size > 5_000
    unknowns, predictions, claims, checks, _ = tables(summary)
    assert [row[0] for row in unknowns.rows][2] == "`object.mass [kg]`" and unknowns.rows[2][-1] == "a pair of scales"
    told = [(f"[{row[0].rpartition('[')[2]}", row[1]) for row in predictions.rows][:6]
    assert told == [(f"[{q.unit}]", f"{q.paper:g}") for q in QUANTITIES]
    assert predictions.headings[2:6] == ["defaults", "slower", "median", "nearest"] == claims.headings[1:5]
    assert claims.rows[0][3:] == ["yes", "yes", "100 %", "100 %"] and checks.rows[-1][0] == "10 synthetic worlds"


def test_distances_are_counted_in_tolerances_and_signs():
    assert distance(PAPER) == 0 and distance(NOTHING) == np.inf
    numbers = PAPER.numbers.copy()
    numbers[0] *= np.exp(0.15)
    numbers[4] *= np.exp(-2 * 0.30)
    world = Observation(numbers, (True, False), (True,) * 4 + (False,) + (True,) * 3)
    np.testing.assert_allclose(deviations(world), [1, 0, 0, 0, -2, 0], atol=1e-12)
    assert distance(world) == pytest.approx(np.sqrt(1 + 4 + 1 + 1))
    assert distance(world, without=("E5", QUANTITIES[4].name)) == pytest.approx(np.sqrt(1 + 1))
    # within the tolerance is counted on the number itself: exp(0.15) is more than 15 % above
    off = {name for name, agrees in zip(DATA, agreements(world), strict=True) if not agrees}
    assert off == {QUANTITIES[0].name, QUANTITIES[4].name, "FF slides off", "E5"}


def test_a_world_is_measured_from_all_of_its_flips():
    class Flight:
        truth, architecture = Scenario(), "pd"

    starts = (0.0, 0.14)
    needed = [question for stage in stages(starts) for question in stage]
    assert set(needed) == {*((name, 0.0) for name in ARCHITECTURES), ("pd+ff+dob", 0.14)}
    measured = metrics_of(Flight, won=True)
    flown = {(name, y): Outcome(replace(measured, architecture=name), None, MOTION) for name, y in needed}
    assert np.isfinite(observe(flown, starts).numbers).all()
    lost = flown | {("pd+ff+dob", 0.14): Outcome(None, "no plan: far")}
    assert np.isnan(observe(lost, starts).numbers).tolist() == [True, True, False, False, False, False]
    slid = flown | {("pd", 0.0): Outcome(measured, "slid at the start from 0.100 s, dropped at 0.200 s")}
    assert observe(slid, starts).verdicts == (True, False)


@pytest.mark.parametrize(("lost", "flips"), [("pd+ff+dob", 1), ("pd+dob", 2), ("pd", 6)])
def test_a_world_is_flown_as_far_as_both_with_observer_turn_the_block_over(lost, flips, monkeypatch):
    asked = []

    def fly_kept(flights, flying, told):
        asked.extend((flight.architecture, flight.truth.task.start_y) for flight in flights)
        outcomes = [metrics_of(flight, won=flight.architecture != lost) for flight in flights]
        told(len(flights))
        return [Outcome(measured, measured.failure, MOTION) for measured in outcomes]

    monkeypatch.setattr(worlds, "fly_kept", fly_kept)
    priors = specification(parse(PRIORS), Path("."))
    clock = Clock(600)
    flown = worlds.Worlds(priors, (0.0, 0.06, 0.14), None, clock)
    assert flown.fly(priors.points[:10]).tolist() == list(range(10))
    assert len(asked) == 10 * flips == 10 * len(set(asked)) and clock.total == 600 - 10 * (6 - flips)
    assert all((observation is NOTHING) == ("dob" in lost) for observation in flown.observations)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("rounds: 1", "rounds: -1"), "line 12: calibrate: rounds = -1 is not valid; valid is a whole number from 0"),
        (("population: 36", "population: 500"), "population = 500 is not valid; valid is at most the trials, 60"),
        (("rounds: 1", "starts: [0.0]"), "calibrate: starts = [0.0] is not valid; valid is at least two starts"),
        (("rounds: 1", "starts: [0.0, 9.0]"), "task.start_y"),
        (("slower.yaml", "nowhere.yaml"), "nowhere.yaml"),
        (("slower: slower.yaml", "median: slower.yaml"), "compare = 'median' is not valid; valid is another name"),
        (("slower: slower.yaml", "nearest: slower.yaml"), "compare = 'nearest' is not valid; valid is another name"),
        (("rounds: 1", "hold_out: [E9]"), "hold_out = 'E9' is not valid; valid is one of position RMSE"),
        (("object.mass: a", "object.size: a"), "sources = 'object.size' is not valid; valid is one of sensors"),
        (("lhs", "grid"), "the grid needs values"),
        (("calibrate:", "tune:"), "calibrate = null is not valid; valid is a mapping of starts, population"),
        (("rounds: 1", "turns: 2"), "calibrate: unknown key 'turns'; valid are starts, population, rounds"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(change, message, tmp_path):
    file = tmp_path / "bad.yaml"
    (tmp_path / "slower.yaml").write_text(SLOWER)
    file.write_text(PRIORS.replace(*change))
    with pytest.raises(InputError) as error:
        load_calibration(file)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_the_example_is_valid():
    file = Path(__file__).parents[3] / "examples" / "calibration.yaml"
    priors, settings, _ = load_calibration(file)
    assert set(settings.sources) == {dimension.name for dimension in priors.dimensions}
    assert parse(file.read_text()).data["calibrate"]["population"] == settings.population


def test_no_file_is_one_line():
    with pytest.raises(InputError, match="calibrate needs a FILE; see examples/calibration.yaml"):
        study.run(Scenario(), "nowhere", file=None)


def test_one_that_would_take_too_long_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "slower.yaml").write_text(SLOWER)
    (tmp_path / "long.yaml").write_text(PRIORS.replace("seed: ", "limit_hours: 0.001\nseed: "))
    with pytest.raises(InputError, match="would take about .* limit_hours is 0.001"):
        study.run(Scenario(), tmp_path / "out", file=str(tmp_path / "long.yaml"), jobs=1, work=AS_PRINTED)
    assert not (tmp_path / "out").exists()
