"""Drawn cases end cleanly, and so do those that `make fuzz` once found."""

import contextlib
import random
from pathlib import Path

import pytest
import yaml
from hostile.draws import KINDS, drawn, ending, fields
from hostile.table import Case, make
from hypothesis import given, settings
from hypothesis import strategies as st

from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario, from_mapping, from_yaml
from flipdiagram.scenario.work import check_work, flip_work, frequency_work, place_work

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.yaml"))
seeds = st.integers(0, 2**32)


@given(seed=seeds)
@settings(max_examples=100)
def test_a_drawn_scenario_is_taken_or_refused_in_one_line_and_its_work_is_a_number(seed):
    try:
        scenario = from_mapping(fields(random.Random(seed)))
        assert from_yaml(scenario.to_yaml()) == scenario
        for work in (flip_work, place_work, frequency_work):
            assert all(0 <= seconds < 1e12 for seconds in work(scenario).values())
            with contextlib.suppress(InputError):
                check_work(scenario, work)
    except InputError as error:
        assert len(str(error).splitlines()) == 1 and error.field


def test_the_default_asks_for_little_and_costs_what_a_field_says():
    default = Scenario()
    assert 1 < sum(flip_work(default).values()) < 5
    slow = default.with_overrides({"simulation.settle_time": 600.0, "simulation.step": 2**-6 * 0.001})
    with pytest.raises(InputError, match="about 320 min") as caught:
        check_work(slow, flip_work)
    assert (caught.value.field, caught.value.value) == ("simulation.settle_time", 600.0)


def ends_well(case, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    make(case.files, folder)
    _, wrong = ending(case, lambda: capfd.readouterr().err)
    assert wrong is None, f"{case.words} {dict(case.files)}"


@pytest.mark.parametrize("kind", ["scenario", "specification", "words"])
@pytest.mark.parametrize("seed", range(4))
def test_a_drawn_command_ends_cleanly(kind, seed, tmp_path, monkeypatch, capfd):
    ends_well(drawn(random.Random(seed), {kind: KINDS[kind]}), tmp_path, monkeypatch, capfd)


@pytest.mark.parametrize("file", CORPUS, ids=lambda path: path.stem)
def test_a_case_that_was_found_ends_cleanly(file, tmp_path, monkeypatch, capfd):
    found = yaml.safe_load(file.read_text(encoding="utf-8"))
    ends_well(Case(file.stem, found["words"], 0, (), found["files"]), tmp_path, monkeypatch, capfd)
