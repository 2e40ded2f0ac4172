"""The carrying of an object that is to be laid down, planned again."""

import numpy as np
import pytest

from flipdiagram.errors import PlanningError
from flipdiagram.planning.place_replanner import PlaceReplanner
from flipdiagram.planning.placing import Placer
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory import contact


@pytest.fixture(scope="module")
def placer():
    scenario = Scenario()
    return Placer(scenario, arm_of(scenario))


@pytest.fixture(scope="module")
def placing(placer):
    return placer.plan()


@pytest.fixture(scope="module")
def replanner(placer, placing):
    return PlaceReplanner(placer, placing.after_carry)


@pytest.mark.parametrize("elapsed", [0.0, 0.0573, 0.2, 0.311])
def test_a_carrying_begun_at_its_own_state_comes_out_again(replanner, placing, elapsed):
    plan = placing.plan
    again = replanner.replan(np.hstack(plan.sample(elapsed)[:2]), plan, elapsed, np.zeros(6))
    assert again.duration == pytest.approx(plan.duration - elapsed, abs=1e-9)
    t = np.linspace(0.0, again.duration * 0.999, 300)
    for one, other, tolerance in zip(again.sample(t)[:2], plan.sample(t + elapsed)[:2], (5e-4, 5e-3), strict=True):
        np.testing.assert_allclose(one, other, atol=tolerance)


def test_from_elsewhere_it_still_ends_where_the_tilting_begins_and_the_object_sticks(placer, replanner, placing):
    plan, elapsed = placing.plan, 0.105
    state = np.hstack(plan.sample(elapsed)[:2]) + [0.004, -0.003, 0.02, 0.01, 0.02, 0.05]
    again = replanner.replan(state, plan, elapsed, np.zeros(6))
    left = again.n_contact - placing.after_carry
    np.testing.assert_allclose(again.states[0], state, atol=1e-6)
    np.testing.assert_allclose(again.states[left:], plan.states[-len(again.states[left:]) :], atol=1e-6)
    mu = placer.scenario.object.friction * (1 - placer.scenario.planner.friction_margin)
    tangential, normal = contact.contact_force(again.inputs[1:left, :2], again.states[1:left, 2])
    assert np.all(np.abs(tangential) <= mu * normal + 0.05)


def test_the_end_of_the_carrying_is_not_planned_again(replanner, placing):
    plan = placing.plan
    carried = (plan.n_contact - placing.after_carry) * plan.sampling_time
    with pytest.raises(PlanningError, match="2 samples of the carrying are left; valid are at least 3"):
        replanner.replan(plan.states[0], plan, carried - 0.02, np.zeros(6))
