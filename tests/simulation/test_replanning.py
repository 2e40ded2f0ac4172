"""The MPC at the control rate, in the running loop: a new plan every millisecond of the contact phase."""

import numpy as np
import pytest

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.planning.planner import plan_motion
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.replans import replans, solve_times
from flipdiagram.simulation.simulate import simulate

EVERY_MS = {"planner.replan_period": 0.001, "planner.compute_delay": 0.001}
SCENARIO = Scenario().with_overrides({"simulation.engine": "mujoco"})


@pytest.fixture(scope="module")
def plan():
    return plan_motion(SCENARIO)


@pytest.fixture(scope="module")
def once(plan):
    return simulate(SCENARIO, "pd+ff+dob", plan).recording


@pytest.fixture(scope="module")
def measured(plan):
    return simulate(SCENARIO.with_overrides(EVERY_MS), "pd+ff+dob", plan).recording


def test_a_new_plan_every_millisecond_until_too_little_is_left(measured, plan):
    counts, (t, taken) = replans(measured), solve_times(measured)
    attempts = round((plan.release_time - 3 * plan.sampling_time) / 0.001)
    assert counts["replanned"] + counts["failed"] == pytest.approx(attempts, abs=1) and counts["late"] == 0
    assert counts["failed"] <= 0.02 * attempts
    assert len(t) == counts["replanned"] and 0 <= t[0] <= 0.0015 and np.all(taken > 0)
    assert counts["solve_time_p50_s"] <= counts["solve_time_p99_s"] <= counts["solve_time_max_s"] == taken.max()
    assert measured.attrs["release_time_s"] == pytest.approx(plan.release_time, abs=1e-9)


def test_the_command_does_not_jump_from_plan_to_plan(measured):
    """x_cmd and v_cmd move by what their rates account for, 1000 times a second."""
    moving = measured.sel(time=slice(0.0, float(measured.attrs["release_time_s"]) - 0.002))
    x, v = moving["x_cmd"].values, moving["v_cmd"].values
    np.testing.assert_allclose(np.diff(x, axis=0), 0.001 * (v[1:] + v[:-1]) / 2, atol=5e-4 * 0.1)
    assert np.abs(np.diff(v, axis=0)).max(axis=0) == pytest.approx([0, 0, 0], abs=0.4)


def test_replanning_from_the_measured_tool_lands_nearer_to_the_plan(once, measured):
    before, after = measure(once), measure(measured)
    assert before.success and after.success
    assert after.landing_cost_J < 0.95 * before.landing_cost_J and after.position_rmse_m < before.position_rmse_m


def test_from_the_command_undisturbed_it_is_the_plan_made_once(once, plan):
    settings = EVERY_MS | {"planner.replan_from": "commanded"}
    again = simulate(SCENARIO.with_overrides(settings), "pd+ff+dob", plan).recording
    until = slice(0.0, float(plan.release_time))
    for name, tolerance in (("x_cmd", 1e-3), ("v_cmd", 2e-2)):
        difference = again[name].sel(time=until).values - once[name].sel(time=until).values
        assert np.abs(difference).max() < tolerance


def test_planned_once_there_is_nothing_to_tell(once):
    assert replans(once) is None


def test_it_plans_by_what_it_believes():
    truth = SCENARIO.with_overrides(EVERY_MS | {"object.friction": 0.7})
    believed = SCENARIO.with_overrides(EVERY_MS)
    for loop, friction in (
        (build_loop(truth), 0.7),
        (build_loop(truth, replanner=lambda: Replanner(believed, arm_of(believed))), 1.86),
    ):
        assert loop.mpc._again.__self__.scenario.object.friction == friction
