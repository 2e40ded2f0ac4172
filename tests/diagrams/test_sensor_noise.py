"""Noise of the joint sensors in a flip: where it enters, that it is reproducible, and absent by default."""

import numpy as np
import pytest
from diagrams.test_controller import edges
from ideal import IDEAL
from shared import ideal_plan

from flipdiagram.blocks.noise import white_noise
from flipdiagram.diagrams.controller import nominal_inertia
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import from_yaml
from flipdiagram.simulation.simulate import simulate

SHORT = {"simulation.start": "hold", "simulation.hold_time": 0.02, "simulation.settle_time": 0.0}
NOISY = {"sensors.position_noise": 1e-4, "sensors.velocity_noise": 1e-2}


def flown(**changes):
    fields = {path.replace("__", "."): value for path, value in changes.items()}
    return simulate(IDEAL.with_overrides(SHORT | fields), "pd+ff+dob", ideal_plan()).recording


def noisy(**changes):
    return flown(sensors__position_noise=1e-4, sensors__velocity_noise=1e-2, **changes)


@pytest.fixture(scope="module")
def quiet():
    return flown()


@pytest.fixture(scope="module")
def first():
    return noisy(sensors__noise_seed=1)


def same(one, other):
    return all(np.array_equal(one[name].values, other[name].values) for name in ("x", "a", "tau", "block_pose"))


def test_without_noise_nothing_changes_to_the_bit(quiet):
    assert same(quiet, flown(sensors__noise_seed=5))
    diagram = build_loop(IDEAL.with_overrides({"sensors.noise_seed": 5})).diagram
    assert not any(diagram.HasSubsystemNamed(name) for name in ("position_noise", "velocity_noise"))


def test_the_same_seed_gives_the_same_run_and_another_another(first, quiet):
    assert same(first, noisy(sensors__noise_seed=1))
    other = noisy(sensors__noise_seed=2)
    assert not any(same(a, b) for a, b in ((first, other), (first, quiet), (other, quiet)))
    assert np.abs(first["tau"].values - other["tau"].values).max() > 0.1


def test_the_boxes_stand_between_the_state_and_the_other_sensors():
    def found(**changes):
        fields = {f"sensors.{name}": value for name, value in changes.items()}
        return edges(build_loop(IDEAL.with_overrides(fields)).diagram)

    both = found(position_noise=1e-4, velocity_noise=1e-2)
    assert {("joint_state.y0", "position_noise.u"), ("joint_state.y1", "velocity_noise.u")} <= both
    assert {("position_noise.y", "tool_kinematics.q"), ("velocity_noise.y", "tool_kinematics.qd")} <= both
    assert ("velocity_noise.y", "disturbance_observer.qd") in both
    assert ("joint_state.y1", "joint_friction.qd") in both  # physics feels the true velocity
    one = found(velocity_noise=1e-2)
    assert ("joint_state.y0", "tool_kinematics.q") in one and not any("position_noise" in a + b for a, b in one)
    late = found(position_noise=1e-4, velocity_noise=1e-2, encoder_resolution=1e-5, delay=2)
    assert {("position_noise.y", "encoder.q"), ("encoder.q_measured", "delayed_q.u")} <= late
    assert {("velocity_noise.y", "delayed_qd.u"), ("delayed_qd.y", "tool_kinematics.qd")} <= late
    derived = found(position_noise=1e-4, velocity_noise=1e-2, velocity_cutoff=100.0)
    assert {("position_noise.y", "velocity.q"), ("velocity.v", "velocity_noise.u")} <= derived
    assert ("velocity_noise.y", "tool_kinematics.qd") in derived


@pytest.mark.parametrize("step", [0.001, 0.0005])
@pytest.mark.parametrize("delay", [0, 2])
def test_the_controller_answers_to_the_state_with_the_noise_of_that_tick(delay, step):
    """Its law computed a second time from the recorded state and the numbers drawn."""
    changes = {"sensors.noise_seed": 3, "sensors.delay": delay, "simulation.step": step}
    scenario = IDEAL.with_overrides(SHORT | NOISY | changes)
    plan, arm = ideal_plan(), arm_of(scenario)
    run = simulate(scenario, "pd", plan).recording
    q, qd, tau = (run[name].values for name in ("q", "qd", "tau"))
    inertia, gains = nominal_inertia(scenario, arm, q[0]), scenario.controller
    fine = step < 0.001  # the torque of a sample is computed half a step before, at the tick before

    def law(k, i, tick):
        noise = 1e-4 * white_noise(3, 0, tick, 6), 1e-2 * white_noise(3, 1, tick, 6)
        position, velocity, jacobian, bias = arm.task_kinematics(q[i] + noise[0], qd[i] + noise[1])
        x, v, _ = plan.at(run["time"].values[k] - (step / 2 if fine else 0.0))
        a_ref = gains.k_p * (np.array([*x, scenario.task.start_x, 0, 0]) - position)
        a_ref += gains.k_v * (np.array([*v, 0, 0, 0]) - velocity)
        return np.clip(inertia * np.linalg.solve(jacobian, a_ref - bias), -arm.tau_max, arm.tau_max)

    for k in range(30, len(q), 29):
        tick = k - delay - (1 if fine else 0)
        np.testing.assert_allclose(tau[k], law(k, k - delay, tick), rtol=1e-6, atol=1e-6)
        assert np.abs(tau[k] - law(k, k - delay, tick - 1)).max() > 1e-3  # another draw would have been seen


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sensors: {position_noise: -1e-4}", ["'sensors.position_noise'", "from 0 to 1 [rad]"]),
        ("sensors: {position_noise: null}", ["'sensors.position_noise' = null"]),
        ("sensors: {velocity_noise: .inf}", ["'sensors.velocity_noise' = inf", "[rad/s]"]),
        ("sensors: {noise_seed: -1}", ["'sensors.noise_seed' = -1", "a whole number from 0 to 4294967295"]),
        ("sensors: {noise_seed: 0.5}", ["'sensors.noise_seed' = 0.5", "whole number"]),
    ],
)
def test_a_value_that_makes_no_sense_is_one_line(text, words):
    with pytest.raises(InputError) as caught:
        from_yaml(text)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)
