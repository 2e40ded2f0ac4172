"""Random worlds, planned once and again: statistics of made-up outcomes, against numbers worked out by hand."""

from dataclasses import fields

import numpy as np
import pytest

from flipdiagram.campaign.statistics import mcnemar
from flipdiagram.flips.outcome import Outcome
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.studies.replanning.worlds import against_first


def outcome(success, cost=0.0, error=0.0):
    numbers = dict.fromkeys((field.name for field in fields(FlipMetrics)), 0.0)
    texts = {"success": success, "failure": None if success else "tipped"}
    return Outcome(
        FlipMetrics(**numbers | texts | {"landing_cost_J": cost, "position_rmse_m": error}), texts["failure"]
    )


def test_worlds_are_compared_in_pairs_where_both_succeed():
    """Six pairs, J smaller in all: p of the signed ranks is 2 / 2^6; the others count as successes only."""
    costs = np.array([0.9, 1.0, 1.1, 1.2, 1.3, 1.4])
    once = [*(outcome(True, cost, 0.01) for cost in costs), outcome(False), outcome(False)]
    gained = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    again = [*(outcome(True, a - b, 0.01) for a, b in zip(costs, gained, strict=True)), outcome(True), outcome(False)]
    found = against_first(again, once)
    assert found["success"]["first_only"] == 1 and found["success"]["second_only"] == 0
    assert found["success"]["p"] == mcnemar(1, 0) == 1.0
    assert found["landing_cost_J"] == {
        "pairs": 6,
        "median_difference": pytest.approx(-0.35),
        "p": pytest.approx(2 / 64),
    }
    assert found["position_rmse_m"] == {"pairs": 6, "median_difference": 0.0, "p": 1.0}


def test_without_a_pair_there_is_no_difference():
    found = against_first([outcome(True)], [outcome(False)])
    assert found["landing_cost_J"] == {"pairs": 0, "median_difference": None, "p": 1.0}
