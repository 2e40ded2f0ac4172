"""Joint rows against the arm's own inverse kinematics and inverse dynamics at random points."""

import numpy as np
import pytest
from ideal import IDEAL

from flipdiagram.errors import PlanningError
from flipdiagram.planning import limits
from flipdiagram.planning.arm_motion import ArmMotion, JointMotion, arm_motion, task_pose
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.limits import POSITION, SPEED, TORQUE, Allowed
from flipdiagram.planning.rows import Rows
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import loaded_arm_of

LAYOUT, FIRST, X = Layout(release=4, n_brake=2), 2, 0.5
SEEDS = range(4)


def random_motion(arm: ArmModel, seed: int):
    """Five samples close together anywhere in the workspace, fast and strongly accelerated, and where q starts."""
    rng = np.random.default_rng(seed)
    count = LAYOUT.intervals - FIRST + 1
    states = np.empty((count, 6))
    states[:, :3] = rng.uniform([-0.15, 0.25, 0], [0.15, 0.45, 2.3]) + np.cumsum(
        rng.normal(0, 0.02, (count, 3)), axis=0
    )
    states[:, 3:] = rng.uniform(-1, 1, (count, 3)) * [1, 1, 6]
    inputs = rng.uniform(-1, 1, (count - 1, 3)) * [15, 15, 100]
    return states, inputs, arm.inverse_kinematics(task_pose(states[0], X))


def joints(arm: ArmModel, state, acceleration, q_near):
    """q, q̇, τ of one planned state, solved for directly: J q̇ = v, J q̈ + J̇ q̇ = a."""
    q = arm.inverse_kinematics_path([task_pose(state, X)], q_near, 1e-12, check_limits=False)[0]
    jacobian = arm.task_kinematics(q, np.zeros(6))[2]
    qd = np.linalg.solve(jacobian, [*state[3:], 0, 0, 0])
    bias = arm.task_kinematics(q, qd)[3]
    qdd = np.linalg.solve(jacobian, np.array([*acceleration, 0, 0, 0]) - bias)
    return q, qd, arm.inverse_dynamics(q, qd, qdd)


@pytest.mark.parametrize("seed", SEEDS)
def test_joint_motion_is_what_the_arm_says(arm, seed):
    states, inputs, q_start = random_motion(arm, seed)
    motion = ArmMotion(arm, X).follow(states, inputs, q_start)
    for k in range(len(inputs)):
        for end in (0, 1):
            q, qd, tau = joints(arm, states[k + end], inputs[k], motion.q[k + end])
            np.testing.assert_allclose(arm.task_position(motion.q[k + end]), task_pose(states[k + end], X), atol=1e-8)
            np.testing.assert_allclose(motion.qd[k + end], qd, atol=1e-6)
            np.testing.assert_allclose(motion.torque[end, k], tau, atol=1e-5)


@pytest.mark.parametrize(
    ("native", "carried"), [(False, 0), (True, 0), (False, 2), (True, 2)], ids=["plant", "chain", "loaded", "its chain"]
)
@pytest.mark.parametrize("seed", SEEDS)
def test_rows_are_the_linearised_limits_of_the_joints_near_them(arm, seed, native, carried):
    states, inputs, q_start = random_motion(arm, seed)
    loaded = loaded_arm_of(IDEAL.with_overrides({"object.mass": 5.0}))
    mover = arm_motion(arm, X, native, loaded)
    motion = mover.follow(states, inputs, q_start, carried)
    # limits of which this motion uses 20 to 120 %: some joints are near, some are not
    rng = np.random.default_rng(100 + seed)
    middle = (arm.q_min + arm.q_max) / 2
    allowed = Allowed(
        middle=middle,
        half=np.abs(motion.q - middle).max(axis=0) / rng.uniform(0.2, 1.2, 6),
        speed=np.abs(motion.qd).max(axis=0) / rng.uniform(0.2, 1.2, 6),
        torque=np.abs(motion.torque).max(axis=(0, 1)) / rng.uniform(0.2, 1.2, 6),
    )

    def packed(states, inputs):
        waiting = np.zeros(9 * FIRST)
        return np.concatenate([waiting, np.hstack([states[:-1], inputs]).ravel(), states[-1]])

    parts = limits.joint_rows(LAYOUT, motion, (states, inputs), mover, allowed)
    rows = Rows.about(packed(states, inputs), parts)
    a, b, groups = rows.matrix(LAYOUT.size), rows.upper, np.array(rows.names())

    def margins(states, inputs):
        """1 − use of what is allowed, per group; which rows there are is decided at the linearisation point."""
        found = {POSITION: [], SPEED: [], TORQUE: []}
        for k in range(len(states)):
            q, qd, _ = joints(arm, states[k], np.zeros(3), motion.q[k])
            for j in range(6):
                if abs(motion.q[k, j] - middle[j]) > limits.NEAR * allowed.half[j]:
                    use = (q[j] - middle[j]) / allowed.half[j]
                    found[POSITION] += [1 - use, 1 + use]
                if abs(motion.qd[k, j]) > limits.NEAR * allowed.speed[j]:
                    found[SPEED].append(1 - abs(qd[j]) / allowed.speed[j])
        for k in range(len(inputs)):
            for end in (0, 1):
                of = loaded if k < carried else arm
                tau = joints(of, states[k + end], inputs[k], motion.q[k + end])[2]
                near = np.abs(motion.torque[end, k]) > limits.NEAR * allowed.torque
                found[TORQUE] += (1 - np.abs(tau) / allowed.torque)[near].tolist()
        return {group: np.array(values) for group, values in found.items()}

    true = margins(states, inputs)
    way = rng.normal(size=states.shape) * [0.1, 0.1, 1, 1, 1, 5], rng.normal(size=inputs.shape) * 10
    step = 1e-5
    ahead, behind = (margins(states + s * way[0], inputs + s * way[1]) for s in (step, -step))
    for group in (POSITION, SPEED, TORQUE):
        of_group = groups == group
        assert 0 < of_group.sum() < 6 * 2 * len(states)
        margin = (b - a @ packed(states, inputs))[of_group]
        by_row, by_truth = np.argsort(margin), np.argsort(true[group])
        np.testing.assert_allclose(margin[by_row], true[group][by_truth], atol=1e-6)
        slope = (ahead[group] - behind[group]) / (2 * step)
        # forward differences in limits.py; torques are of order 10 to 100 N m
        np.testing.assert_allclose(-(a @ packed(*way))[of_group][by_row], slope[by_truth], rtol=1e-3, atol=1e-3)


def test_rows_keep_to_the_allowed_shares_of_the_limits(arm):
    margins = {"planner.position_margin": 0.1, "planner.speed_margin": 0.25, "planner.torque_margin": 0.4}
    allowed = Allowed.of(arm, IDEAL.with_overrides(margins))
    np.testing.assert_allclose(allowed.middle - allowed.half, arm.q_min + 0.1)
    np.testing.assert_allclose(allowed.middle + allowed.half, arm.q_max - 0.1)
    np.testing.assert_allclose(allowed.speed, 0.75 * arm.qd_max)
    np.testing.assert_allclose(allowed.torque, 0.6 * arm.tau_max)
    shares = allowed.shares(arm)
    np.testing.assert_allclose(shares[SPEED], 0.75)
    np.testing.assert_allclose(shares[TORQUE], 0.6)
    tightened = allowed.tightened(
        {POSITION: np.full(6, 0.9), SPEED: np.array([0.1, 1.25, 1, 1, 1, 1]), TORQUE: np.ones(6)}
    )
    np.testing.assert_allclose(tightened.speed, 0.6 * arm.qd_max)
    np.testing.assert_array_equal(tightened.half, allowed.half)
    np.testing.assert_array_equal(tightened.torque, allowed.torque)


def test_an_arm_at_rest_needs_no_speed_rows(arm):
    states, inputs = np.tile([0, 0.35, 0, 0, 0, 0.0], (5, 1)), np.zeros((4, 3))
    q = arm.inverse_kinematics(task_pose(states[0], X))
    motion = ArmMotion(arm, X).follow(states, inputs, q)
    np.testing.assert_allclose(motion.torque[0], np.tile(arm.gravity_torque(q), (4, 1)), atol=1e-9)
    parts = limits.joint_rows(LAYOUT, motion, (states, inputs), ArmMotion(arm, X), Allowed.of(arm, IDEAL))
    assert {name for each in parts for name, _ in each.groups} == {POSITION}
    uses = limits.limit_use(motion, arm)
    np.testing.assert_allclose(uses[SPEED], 0, atol=1e-12)
    np.testing.assert_allclose(uses[TORQUE], np.abs(arm.gravity_torque(q)) / arm.tau_max, atol=1e-9)
    np.testing.assert_allclose(uses[POSITION] * (arm.q_max - arm.q_min) / 2, np.abs(q - (arm.q_min + arm.q_max) / 2))


def test_a_start_in_motion_has_no_rows_of_its_own_position_and_speed(arm):
    states, inputs, q_start = random_motion(arm, 0)
    mover = arm_motion(arm, X, native=True)
    motion, tight = mover.follow(states, inputs, q_start), np.full(6, 1e-9)
    allowed = Allowed(np.full(6, 9.0), np.full(6, 1e-3), tight, np.full(6, np.inf))
    counts = []
    for given_start in (False, True):
        parts = limits.joint_rows(LAYOUT, motion, (states, inputs), mover, allowed, given_start)
        columns = np.concatenate([each.columns for each in parts])
        assert columns.min() == 9 * (FIRST + given_start)
        counts.append(sum(each.margin.size for each in parts))
    assert counts[0] - counts[1] == 6 * 3  # both sides of each position, and each speed


def test_limit_use_names_the_worst_sample_of_each_joint(arm):
    q = np.tile((arm.q_min + arm.q_max) / 2, (3, 1))
    q[1, 2] = arm.q_max[2]
    qd, torque = np.zeros((3, 6)), np.zeros((2, 2, 6))
    qd[2, 4], torque[1, 0, 5] = -0.5 * arm.qd_max[4], -2 * arm.tau_max[5]
    empty = np.zeros((3, 6, 3))
    uses = limits.limit_use(JointMotion(q, qd, torque, empty, empty), arm)
    np.testing.assert_allclose(uses[POSITION], [0, 0, 1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(uses[SPEED], [0, 0, 0, 0, 0.5, 0])
    np.testing.assert_allclose(uses[TORQUE], [0, 0, 0, 0, 0, 2])


def test_a_motion_out_of_reach_raises(arm):
    states = np.tile([0, 0.35, 0, 0, 0, 0.0], (3, 1))
    q = arm.inverse_kinematics(task_pose(states[0], X))
    states[1:, 1] = 1.5
    with pytest.raises(PlanningError, match="cannot follow the path at sample 1"):
        ArmMotion(arm, X).follow(states, np.zeros((2, 3)), q)
