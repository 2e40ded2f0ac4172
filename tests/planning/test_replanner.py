"""Planning the rest of a motion again, on the real program."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ideal import IDEAL
from shared import ideal_plan

from flipdiagram.errors import PlanningError
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.parts import arm_of
from flipdiagram.theory import contact


@pytest.fixture(scope="module")
def scenario():
    return IDEAL


@pytest.fixture(scope="module")
def plan():
    return ideal_plan()


@pytest.fixture(scope="module")
def arm(scenario):
    return arm_of(scenario)


@pytest.fixture(scope="module")
def replanner(scenario, arm):
    return Replanner(scenario, arm)


def state_at(plan, t):
    return np.hstack(plan.sample(t)[:2])


def joints(scenario, arm, state):
    return arm.inverse_kinematics([*state[:3], scenario.task.start_x, 0, 0])


def same_motion(again, plan, elapsed):
    """Whether a plan is the rest of another, in position, velocity and acceleration, to the tolerance of both."""
    assert again.release_time == pytest.approx(plan.release_time - elapsed, abs=1e-9)
    assert again.touchdown_time == pytest.approx(plan.touchdown_time - elapsed, abs=1e-9)
    assert again.cost == pytest.approx(plan.cost, rel=2e-5)
    edges = plan.t[plan.t > elapsed + 1e-6] - elapsed  # the acceleration jumps there
    t = np.setdiff1d(np.linspace(0, again.release_time * 0.999, 100), edges)
    for one, other, tolerance in zip(again.sample(t), plan.sample(t + elapsed), (1e-4, 2e-3, 0.1), strict=True):
        np.testing.assert_allclose(one, other, atol=tolerance)


@settings(max_examples=20, deadline=None)
@given(share=st.floats(0, 1), step=st.sampled_from([0.001, 0.002, 0.01, 0.02, 0.04]))
@example(share=0.0, step=0.02)
@example(share=0.5, step=0.04)
def test_a_plan_begun_at_its_own_state_comes_out_again(scenario, arm, replanner, plan, share, step):
    """What is optimal stays optimal for the rest (Bellman), wherever in a sample that begins, and once more from there."""
    elapsed = share * (plan.release_time - 0.11)
    state = state_at(plan, elapsed)
    again = replanner.replan(state, plan, elapsed, joints(scenario, arm, state))
    assert again.iterations == 1
    same_motion(again, plan, elapsed)
    state = state_at(again, step)
    same_motion(replanner.replan(state, again, step, joints(scenario, arm, state), begun=elapsed), plan, elapsed + step)


def test_the_programs_of_drake_and_daqp_agree_inside_a_sample(scenario, arm, replanner, plan):
    """From states off the plan, with an acceleration before that is none of the plan's."""
    drake = Replanner(scenario.with_overrides({"planner.solver": "clarabel"}), arm)
    rng = np.random.default_rng(1)
    for elapsed in (0.013, 0.1, 0.2199):
        state = state_at(plan, elapsed) + rng.normal(size=6) * [0.002, 0.002, 0.01, 0.02, 0.02, 0.1]
        q = joints(scenario, arm, state)
        ours, theirs = (one.replan(state, plan, elapsed, q) for one in (replanner, drake))
        np.testing.assert_allclose(ours.states, theirs.states, atol=6e-3)  # the minimum is flat
        assert ours.cost == pytest.approx(theirs.cost, rel=1e-5)


def test_no_tool_can_put_off_the_release(scenario, arm, replanner, plan):
    """One that does not move at all: each new plan releases when the first one would, or there is none."""
    state, begun, followed, found = state_at(plan, 0.0), 0.0, plan, 0
    q = joints(scenario, arm, state)
    while followed.release_time > 0.06:
        elapsed = 0.007
        try:
            again = replanner.replan(state, followed, elapsed, q, begun=begun)
        except PlanningError:
            break
        begun, followed, found = begun + elapsed, again, found + 1
        assert begun + followed.release_time == pytest.approx(plan.release_time, abs=1e-9)
    assert found > 3


def test_a_disturbed_motion_starts_where_it_is_and_keeps_every_constraint(scenario, arm, replanner, plan):
    rng = np.random.default_rng(3)
    mu = scenario.object.friction * (1 - scenario.planner.friction_margin)
    for elapsed in (0.05, 0.15, 0.25):
        state = state_at(plan, elapsed) + rng.normal(size=6) * [0.005, 0.005, 0.02, 0.03, 0.03, 0.1]
        again = replanner.replan(state, plan, elapsed, joints(scenario, arm, state))
        np.testing.assert_allclose(again.states[0], state, atol=1e-6)
        k = np.arange(again.n_contact)
        for at in (k, k + 1):
            tangential, normal = contact.contact_force(again.inputs[k, :2], again.states[at, 2])
            assert np.all(np.abs(tangential) <= mu * normal * 1.02 + 0.05)
            assert normal.min() > scenario.planner.minimum_normal - 0.1
        assert again.release[2] >= np.pi / 2 + scenario.planner.release_angle - 1e-6
        np.testing.assert_allclose(
            np.diff(again.states[:, 3:], axis=0), again.inputs * np.diff(again.t)[:, None], atol=1e-9
        )


def test_an_impossible_state_is_refused(scenario, arm, replanner, plan):
    state = state_at(plan, 0.3)
    q = joints(scenario, arm, state)
    with pytest.raises(PlanningError):
        replanner.replan(state + [0, 0, 0, 0, -6.0, 0], plan, 0.3, q)


def test_too_late_is_refused(scenario, arm, replanner, plan):
    state = state_at(plan, plan.release_time - 0.04)
    with pytest.raises(PlanningError, match="2 contact samples are left; valid are at least 3"):
        replanner.replan(state, plan, plan.release_time - 0.04, joints(scenario, arm, state))


def test_an_object_off_centre_lets_the_blade_keep_its_distance(scenario, arm, replanner, plan):
    """The blade's corners, 1 cm nearer on one side, stay above the table by the clearance."""
    shift, state = 0.01, state_at(plan, 0.1)
    again = replanner.replan(state, plan, 0.1, joints(scenario, arm, state), shift)
    theta = again.states[1:, 2]
    half, h, thick = scenario.tool.blade_width / 2, scenario.object.thickness / 2, scenario.tool.blade_thickness
    floor = scenario.table.height + scenario.planner.table_clearance
    for s in (half - shift, -half - shift):
        lowest = again.states[1:, 1] + s * np.sin(theta) - (h + thick) * np.cos(theta)
        assert lowest.min() > floor - 2e-4


@pytest.fixture(scope="module")
def searching(scenario, arm):
    return Replanner(scenario.with_overrides({"planner.replan_search": 2, "planner.solver": "daqp"}), arm)


def test_other_horizons_are_searched_where_the_old_one_costs_much_more(scenario, arm, searching, replanner, plan):
    """Thrown far off its way, the block flies better for longer; near it the old horizon is kept."""
    rng, changed = np.random.default_rng(0), 0
    for scale in (0.2, 8.0, 12.0):
        for k in (6, 8, 10, 12):
            state = plan.states[k] + scale * rng.normal(size=6) * [0.002, 0.002, 0.01, 0.02, 0.02, 0.1]
            q = joints(scenario, arm, state)
            old, new = (one.replan(state, plan, k * 0.02, q) for one in (replanner, searching))
            same = (old.n_contact, old.n_flight) == (new.n_contact, new.n_flight)
            assert (
                new.cost <= old.cost * (1 + 1e-4)
                if same
                else new.cost < old.cost / (1 + scenario.planner.search_tolerance)
            )
            assert abs(new.n_contact - (plan.n_contact - k)) <= 2 and abs(new.n_flight - plan.n_flight) <= 2
            np.testing.assert_allclose(new.states[0], state, atol=1e-6)
            np.testing.assert_allclose(new.landing[1], 0.2 + scenario.object.thickness / 2, atol=0.05)
            changed += not same
            assert same or scale > 1
    assert changed >= 2


def test_another_horizon_begins_from_the_old_motion_at_another_pace(searching, plan):
    """Same path, stretched in time: ends where the old contact phase ends, with its velocity scaled."""
    state = plan.states[8]
    left = plan.n_contact - 8
    for n_contact in (left - 2, left, left + 2):
        guess = searching._guess(state, plan, 8 * 0.02, n_contact, plan.n_flight)
        release = searching.horizons.layout.release
        np.testing.assert_allclose(guess.states[release, :3], plan.release[:3], atol=1e-12)
        np.testing.assert_allclose(guess.states[release, 3:], plan.release[3:] * left / n_contact, atol=1e-12)
        np.testing.assert_allclose(guess.states[release - n_contact], state, atol=1e-12)
        assert guess.n_contact == n_contact
        np.testing.assert_allclose(guess.states[-1, :3], plan.states[-1, :3], atol=1e-12)


def test_a_searched_replan_stays_within_the_horizons_that_are_allowed(scenario, arm, plan):
    narrow = scenario.with_overrides({"planner.replan_search": 5, "planner.flight_samples": (5, 6)})
    found = Replanner(narrow, arm)._candidates(24, 5, 1)
    assert found[0] == (24, 5)
    assert {flight for _, flight in found} == {5, 6}
    late = Replanner(narrow, arm)._candidates(4, 5, 25)  # 30 at most: 25 have passed, 5 may come
    assert {contact for contact, _ in late} == {3, 4, 5}
    assert max(contact for contact, _ in found) <= 29 and min(contact for contact, _ in found) == 19
    assert Replanner(scenario, arm)._candidates(24, 5, 0) == [(24, 5)]
