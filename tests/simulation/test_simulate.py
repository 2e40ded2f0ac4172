"""Whole flips: what the issue of the main job demands of the simulated block and arm."""

import numpy as np
import pytest
from ideal import IDEAL
from shared import ideal_flip, ideal_plan

from flipdiagram.errors import SimulationError
from flipdiagram.robot.parts import arm_of
from flipdiagram.simulation import events, metrics, verdict
from flipdiagram.simulation.recording import roll
from flipdiagram.simulation.simulate import simulate
from flipdiagram.theory import contact


@pytest.fixture(scope="module")
def plan():
    return ideal_plan()


@pytest.fixture(scope="module")
def flip():
    return ideal_flip()


def test_the_proposed_controller_turns_the_block_over(flip):
    assert verdict.judge(flip.recording) == (True, None)
    landed = events.touchdown(flip.recording)
    assert np.pi / 2 < landed.theta_rad < 3 * np.pi / 2
    # it lies flat on its other side in the end
    assert roll(flip.recording["block_pose"].values)[-1] == pytest.approx(np.pi, abs=1e-3)
    assert flip.recording["block_pose"].values[-1, 6] == pytest.approx(0.205, abs=1e-4)


def test_the_block_neither_slips_nor_touches_the_blade_again(flip):
    slip, lift = metrics.slip_and_lift(flip.recording)
    assert slip < 0.002
    assert lift < 0.001
    assert metrics.contact_after_release(flip.recording) == 0
    assert not events.touching(flip.recording, "table-blade").any()


def test_every_joint_stays_inside_its_limits(flip):
    arm, data = arm_of(IDEAL), flip.recording
    assert (data["q"].values > arm.q_min).all() and (data["q"].values < arm.q_max).all()
    assert (np.abs(data["qd"].values) < arm.qd_max).all()
    assert (np.abs(data["tau"].values) <= arm.tau_max).all()


def test_the_hold_ends_settled_with_the_observer_carrying_gravity(flip):
    scenario, data = IDEAL, flip.recording
    k = int(np.searchsorted(data["time"].values, 0.0))
    assert np.abs(data["x"].values[k] - data["x_cmd"].values[k]).max() < 1e-3
    assert np.abs(data["v"].values[k]).max() < 1e-3
    # gravity of arm and block less what joint friction may hold: at most its Coulomb level
    arm, q = arm_of(scenario), data["q"].values[k]
    jacobian = arm.task_kinematics(q, np.zeros(6))[2]
    carried = arm.gravity_torque(q) + jacobian[1] * scenario.object.mass * 9.81
    stuck = scenario.joint_friction.coulomb * arm.tau_rated
    assert (np.abs(data["tau_dis"].values[k] - carried) < stuck + 0.05).all()
    # sample k already belongs to the first step of the motion
    weight = [0, 0, scenario.object.mass * 9.81]
    np.testing.assert_allclose(data["contact_force"].values[k - 1, 0], weight, atol=0.01)


def test_kinematic_signals_agree_with_each_other(flip):
    data, arm = flip.recording, arm_of(IDEAL)
    for k in range(0, data.sizes["time"], 500):
        x, v = arm.task_position_velocity(data["q"].values[k], data["qd"].values[k])
        np.testing.assert_allclose(data["x"].values[k], x[:3], atol=1e-13)
        np.testing.assert_allclose(data["v"].values[k], v[:3], atol=1e-12)
        blade = arm.X_WT(data["q"].values[k])
        np.testing.assert_allclose(data["tool_pose"].values[k, 4:], blade.translation(), atol=1e-12)
        # the control point lies half a block above the blade
        up = data["x"].values[k, :2] - data["tool_pose"].values[k, 5:]
        np.testing.assert_allclose(up, 0.005 * contact.tool_normal(x[2]), atol=1e-4)
    np.testing.assert_allclose(np.diff(data["v"].values, axis=0) / 1e-3, data["a"].values[:-1], atol=1e-9)


def test_commands_are_the_plan_at_the_time(flip, plan):
    data = flip.recording
    x, v, a = plan.sample(data["time"].values)
    np.testing.assert_allclose(data["x_cmd"].values, x, atol=1e-9)
    np.testing.assert_allclose(data["v_cmd"].values, v, atol=1e-7)
    # an acceleration jumps at a sample: compare away from them
    away = np.abs((data["time"].values + 1e-6) % plan.sampling_time) > 2e-6
    np.testing.assert_allclose(data["a_cmd"].values[away], a[away], atol=1e-9)


def test_signals_have_the_contracts_dimensions_and_units(flip):
    data = flip.recording
    dims = {
        ("time", "axis"): ("x_cmd", "v_cmd", "a_cmd", "x", "v"),
        ("time", "joint"): ("q", "qd", "tau", "tau_dis"),
        ("time", "pose"): ("tool_pose", "block_pose"),
        ("time",): ("sliding_angle",),
    }
    for wanted, names in dims.items():
        for name in names:
            assert data[name].dims == wanted
            assert data[name].attrs["units"]
            assert np.isfinite(data[name].values).all()
    assert list(data["axis"].values) == ["y", "z", "theta"]
    assert list(data["joint"].values) == list("SLURBT")
    np.testing.assert_allclose(np.diff(data["time"].values), 1e-3)


def test_the_same_run_gives_the_same_bits(flip, plan):
    again = simulate(IDEAL, "pd+ff+dob", plan)
    assert again.recording.identical(flip.recording)
    assert again.recording.to_netcdf(engine="scipy") == flip.recording.to_netcdf(engine="scipy")


def test_the_mpc_plans_when_the_run_starts(plan):
    brief = IDEAL.with_overrides({"simulation.hold_time": 0.01, "simulation.settle_time": 0.0})
    flip = simulate(brief, "pd+ff+dob")
    np.testing.assert_array_equal(flip.plan.states, plan.states)
    np.testing.assert_allclose(flip.recording["x_cmd"].values[-1], plan.states[-1, :3], atol=1e-9)


def test_a_finer_plant_step_adds_no_delay_to_the_loop(plan):
    """With half and quarter the step the motion converges: what remains is the stepper's order, not a lost sample."""
    brief = IDEAL.with_overrides({"simulation.hold_time": 0.2, "simulation.settle_time": 0.0})
    steps = (0.001, 0.0005, 0.00025)
    runs = [simulate(brief.with_overrides({"simulation.step": step}), "pd+ff+dob", plan) for step in steps]
    coarse, half, quarter = (run.recording.sel(time=slice(0.1, 0.4))["x"].values for run in runs)
    assert np.abs(half - quarter).max() < 1e-3
    assert np.abs(coarse - half).max() < 6e-3
    # a delay of one period would shift the velocity by 1 ms
    delays = [metrics.velocity_delay(run.recording) for run in runs]
    assert np.ptp(delays) < 5e-4


def test_progress_runs_to_one(plan):
    seen = []
    brief = IDEAL.with_overrides({"simulation.hold_time": 0.0, "simulation.settle_time": 0.0})
    simulate(brief, "pd", plan, progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == 1.0


def test_a_diverging_loop_ends_with_one_line(plan):
    scenario = IDEAL.with_overrides({"controller.k_v": 1e6, "arm.torque_scale": 1e4, "simulation.hold_time": 0.5})
    with pytest.raises(SimulationError, match="diverged before") as caught:
        simulate(scenario, "pd", plan)
    assert "\n" not in str(caught.value)


def test_a_motion_that_takes_longer_when_planned_again_is_simulated_to_its_end():
    """Other horizons are allowed, and from 2 cm off a longer contact phase costs less."""
    longer = IDEAL.with_overrides(
        {
            "planner.replan_period": 0.04,
            "planner.replan_search": 2,
            "disturbance.start_error": 0.02,
            "simulation.hold_time": 0.1,
            "simulation.settle_time": 0.05,
        }
    )
    run = simulate(longer, "pd+ff+dob")
    data = run.recording
    assert data.attrs["end_time_s"] > run.plan.duration + 0.01
    needed = max(data.attrs["end_time_s"], data.attrs["touchdown_time_s"]) + 0.05
    assert data["time"].values[-1] == pytest.approx(needed, abs=2e-3)


def test_an_arm_that_does_not_follow_cannot_put_off_the_release_for_ever():
    """PD sags onto a table that is higher than planned; contact ends after planner.contact_samples at the latest."""
    fields = {
        "planner.replan_period": 0.04,
        "planner.replan_search": 5,
        "planner.solver": "daqp",
        "disturbance.table_error": 0.03,
        "simulation.hold_time": 0.3,
        "simulation.settle_time": 0.05,
    }
    scenario = IDEAL.with_overrides(fields)
    data = simulate(scenario, "pd").recording
    longest = scenario.planner.contact_samples[1] * scenario.planner.sampling_time
    assert data.attrs["release_time_s"] <= longest + scenario.planner.sampling_time
