"""The tuner: it finds what it can, judges on trials it has not seen, and goes on where it was."""

import json
import shutil

import pytest
from campaign import made_up
from campaign.made_up import QUIET

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.specification_file import parse
from flipdiagram.campaign.study import report_section, write_tuning
from flipdiagram.campaign.tuner import held_out_trials, tune
from flipdiagram.campaign.tuning import Goal, tuning
from flipdiagram.flips.flight import Work

pytest.importorskip("optuna")

TEXT = (
    QUIET.replace("trials: 30", "trials: 12")
    + """
tune:
  architecture: pd+ff+dob
  over:
    controller.k_p: {loguniform: [100, 4000]}
  budget: 240
  held_out: 40
"""
)
GAINS = Work(made_up.plan, made_up.fly_like_gains)


def wanted(text=TEXT):
    specification = from_text(text)
    return specification, tuning(parse(text), specification)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tune")
    return folder, tune(*wanted(), folder, jobs=2, work=GAINS)


def test_the_gains_found_are_near_the_best_and_hold_on_trials_not_seen(found):
    _, result = found
    k_p = result["gains"]["controller.k_p"]
    assert k_p["default"] == 350.0 and abs(k_p["tuned"] - 900) < 100
    assert result["candidates"] == 20 and result["flips"] == 240 and len(result["history"]) == 20
    assert result["search"]["tuned"]["rate"] > result["search"]["default"]["rate"]
    held = result["held_out"]
    assert held["trials"] == 40 and held["tuned"]["rate"] > held["default"]["rate"] + 0.3
    assert held["difference"]["low"] > 0 and held["difference"]["p"] < 0.01


def test_the_search_is_the_same_on_one_process_and_goes_on_where_it_was(found, tmp_path, monkeypatch):
    folder, result = found

    def stop(text):
        if text.startswith("9 of"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(*wanted(), tmp_path, jobs=1, work=GAINS, progress=stop)
    assert tune(*wanted(), tmp_path, jobs=1, work=GAINS) == result
    monkeypatch.setattr("flipdiagram.flips.run.fly_all", lambda jobs, *rest: list(jobs) and 1 / 0)
    assert tune(*wanted(), folder, jobs=1, work=GAINS) == result  # nothing is flown again


def test_held_out_trials_are_drawn_from_the_same_distributions_and_are_others():
    specification, goal = wanted()
    held = held_out_trials(specification, goal)
    assert held.trials == 40 and held.dimensions == specification.dimensions
    drawn = {specification.trial(k).values for k in range(12)}
    assert not drawn & {held.trial(k).values for k in range(40)}


def test_a_goal_prefers_success_then_the_smaller_error():
    goal, alone = Goal(), Goal(False, 0.5, "position_rmse_m")
    few, more = ([True, False, False], [0.1, 0.1, 0.1]), ([True, True, False], [0.9, 0.9, 0.9])
    assert goal.score(*more) > goal.score(*few)
    assert goal.score([True] * 3, [0.01] * 3) > goal.score([True] * 3, [0.02] * 3)
    assert alone.quantile_of(*few) is None and alone.quantile_of(*more) == 0.9
    assert alone.score(*more) > alone.score(*few) > alone.score([False] * 3, [0.1] * 3)
    assert "50 % quantile" in alone.text and goal.text == "the highest success rate"


def test_the_result_is_written_with_its_figure(found, tmp_path):
    write_tuning(found[1], wanted()[0].base, tmp_path)
    summary = json.loads((tmp_path / "tuning.json").read_text())
    assert summary["schema"] == "flipdiagram/tuning/1"
    page = (tmp_path / "tuning.md").read_text()
    assert "`controller.k_p [1/s2]`" in page and "held out (40 trials)" in page
    assert (tmp_path / "tuning.png").stat().st_size > 5000
    assert "of rates Wilson's" in page
    held = found[1]["held_out"]
    assert sum(held["default"]["modes"].values()) == 40
    lost = 40 - held["default"]["modes"]["turned over"]
    assert f"{lost} slid later" in page or f"{lost} tipped" in page
    assert report_section(tmp_path.parent, ["nothing"]) == ""
    text = report_section(tmp_path.parent, ["nothing", tmp_path.name])
    assert "Default gains against tuned ones" in text
    assert "`controller.k_p [1/s2]`" in text and f"({tmp_path.name}/tuning.png)" in text
    shutil.copytree(tmp_path, tmp_path / "tuning", ignore=lambda *_: ["tuning"])
    assert "(tuning/tuning.png)" in report_section(tmp_path)  # the folder that the report looks into


def test_the_time_left_is_that_of_the_flips_that_are_missing(tmp_path):
    def said(text):
        if text.startswith("flips"):
            lines.append(text)

    for expected in (320, 0):
        lines: list[str] = []
        tune(*wanted(), tmp_path, jobs=2, work=GAINS, progress=said)
        assert len(lines) == expected
    assert not lines
