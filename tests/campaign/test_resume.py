"""Going on with a campaign's file: not with other code, nor with trials that would be others now."""

import sqlite3
from contextlib import closing

import pytest
from campaign.made_up import QUIET, WORK, contents

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.run import run
from flipdiagram.errors import InputError, SimulationError


def test_other_code_is_refused_unless_told(tmp_path):
    few = from_text(QUIET.replace("trials: 30", "trials: 2"))
    file = run(few, tmp_path, jobs=1, work=WORK).file
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("UPDATE meta SET value = 'older' WHERE key = 'code'")
        database.execute("DELETE FROM trials WHERE trial = 1")
    database.close()
    with pytest.raises(InputError, match="other code or versions"):
        run(few, tmp_path, jobs=1, resume=True, work=WORK)
    assert run(few, tmp_path, jobs=1, resume=True, any_version=True, work=WORK).flown == 2


def test_a_worker_with_other_code_ends_the_campaign(tmp_path, monkeypatch):
    monkeypatch.setattr("flipdiagram.flips.driver.provenance", lambda: ("mine", {}, "here"))
    with pytest.raises(SimulationError, match="was changed"):
        run(from_text(QUIET), tmp_path, jobs=1, work=WORK)


def test_trials_that_are_drawn_differently_now_are_refused(tmp_path):
    few = from_text(QUIET.replace("trials: 30", "trials: 2"))
    file = run(few, tmp_path, jobs=1, work=WORK).file
    before = contents(file)
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("UPDATE trials SET scenario_hash = 'other' WHERE trial = 1")
    database.close()
    with pytest.raises(InputError, match="trial 1 that is drawn differently"):
        run(few, tmp_path, jobs=1, resume=True, work=WORK)
    assert len(contents(file)) == len(before)
