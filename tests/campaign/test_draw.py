"""What the driver hands out is small, and the worker makes the same trial of it."""

import pickle

import pytest

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.draw import missing_draws

TEXT = """
vary:
  object.friction: {uniform: [1.2, 2.4]}
  sensors.position_noise: {loguniform: [1.0e-5, 1.0e-3]}
  planner.contact_samples: {choice: [[11, 30], [15, 30]]}
sampler: lhs
trials: 1000
seed: 4
architectures: [pd, pd+dob]
"""


@pytest.fixture(scope="module")
def specification():
    return from_text(TEXT)


def test_a_draw_is_the_trial_of_its_number_and_travels_without_the_points_of_the_others(specification):
    draws = list(missing_draws(specification, {(0, "pd"): ""}))
    assert len(draws) == specification.rows - 1 and draws[0][1:] == (0, *draws[0][2:4], "pd+dob")
    for draw in (draws[0], draws[777], draws[-1]):
        sent = pickle.dumps(draw)
        assert len(sent) < 10_000
        assert pickle.loads(sent).flight() == specification.flight(specification.trial(draw.trial), draw.architecture)


def test_draws_share_a_motion_exactly_where_the_plan_is_the_same(specification):
    draws = list(missing_draws(specification, {}))[:20]
    assert len({draw.motion for draw in draws}) == 2
    assert len({(draw.motion, draw.flight().plan_key) for draw in draws}) == 2
