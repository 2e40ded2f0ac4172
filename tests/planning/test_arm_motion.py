"""The compiled loops of a chain of joints against Drake's multibody code."""

import subprocess
import sys

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.multibody.tree import PrismaticJoint
from robots import package_file

from flipdiagram.errors import PlanningError
from flipdiagram.planning.arm_motion import ArmMotion, ChainMotion, arm_motion
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.limits import SPEED, TORQUE
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import ArmSpec
from flipdiagram.robot.native_arm import NativeArm, native_arm
from flipdiagram.scenario.cell import Arm

X = 0.5

ROTORS = (0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2)
ARMS = {
    "MH3F": {},
    "turned base": {"base_pose": (0.1, -0.2, 0.3, 0.4), "link_inertia_scales": (1.5, 0.5, 1, 2, 1, 1)},
    "UR5": {
        "file": package_file("ur_description/urdf/ur5_joint_limited_robot.urdf"),
        "base": "base_link",
        "flange": "tool0",
    },
    "Panda": {
        "file": package_file("panda_description/urdf/panda.urdf"),
        "base": "panda_link0",
        "flange": "panda_link8",
        "reflected_inertia": ROTORS,
    },
}


@pytest.fixture(scope="module", params=ARMS)
def any_arm(request):
    return ArmModel(ArmSpec(Arm(**ARMS[request.param])))


def test_task_kinematics_and_gravity_as_machine_code_are_those_of_drake(any_arm):
    native, rng = native_arm(any_arm), np.random.default_rng(1)
    assert isinstance(native, NativeArm) and native.n_joints == any_arm.n_joints
    for _ in range(40):
        q, qd = any_arm.home + rng.uniform(-2.0, 2.0, any_arm.n_joints), rng.normal(size=any_arm.n_joints)
        expected = any_arm.task_kinematics(q, qd)
        for ours, theirs in zip(native.task_kinematics(q, qd), expected, strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12 * (1 + np.abs(theirs).max()))
        for ours, theirs in zip(native.task_position_velocity(q, qd), expected[:2], strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12 * (1 + np.abs(theirs).max()))
        weight = any_arm.gravity_torque(q)
        np.testing.assert_allclose(native.gravity_torque(q), weight, atol=1e-12 * (1 + np.abs(weight).max()))


def test_a_motion_of_the_tool_is_that_of_drake(any_arm):
    native, rng = native_arm(any_arm), np.random.default_rng(2)
    q = any_arm.home + rng.uniform(-2.0, 2.0, (60, any_arm.n_joints))
    for ours, theirs in zip(native.tool_motion(q, 0.3 * q), any_arm.tool_motion(q, 0.3 * q), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12 * (1 + np.abs(theirs).max()))


def test_kinematics_and_dynamics_are_those_of_drake(any_arm):
    rng, n = np.random.default_rng(0), any_arm.n_joints
    q = any_arm.home + rng.uniform(-0.5, 0.5, (40, n))
    v, a = rng.normal(size=(40, 3)), 10 * rng.normal(size=(40, 3))
    chain = arm_motion(any_arm, X, native=True)
    assert isinstance(chain, ChainMotion)
    qd, from_task, by_input, rest = chain.along(q, v)
    at, speeds = chain._kinematics.along(chain._chain, q, v), chain.speeds(q, v)
    tau = np.einsum("kij,kj->ki", by_input, a) + rest
    np.testing.assert_array_equal(at.from_task[:, :, :3], from_task)
    for k in range(40):
        inverse = np.linalg.pinv(any_arm.task_jacobian(q[k])[1])
        size = np.abs(inverse).max()
        np.testing.assert_allclose(at.from_task[k], inverse, atol=1e-10 * size**2)
        for found in (qd[k], speeds[k]):
            np.testing.assert_allclose(found, inverse[:, :3] @ v[k], atol=1e-10 * size**2)
        bias = any_arm.task_kinematics(q[k], qd[k])[3]
        np.testing.assert_allclose(at.bias[k], bias, atol=1e-11 * (1 + np.abs(bias).max()))
        for acceleration, found in ((a[k], tau[k]), (np.zeros(3), rest[k])):
            qdd = at.from_task[k] @ (np.array([*acceleration, 0, 0, 0]) - bias)
            expected = any_arm.inverse_dynamics(q[k], qd[k], qdd)
            np.testing.assert_allclose(found, expected, atol=1e-10 * (1 + np.abs(expected).max()))
        expected = any_arm.mass_matrix(q[k]) @ from_task[k]
        np.testing.assert_allclose(by_input[k], expected, atol=1e-11 * (1 + np.abs(expected).max()))


def test_the_plants_own_motion_is_made_of_the_same_numbers(any_arm):
    """The one that serves where there is no such chain."""
    rng, n = np.random.default_rng(1), any_arm.n_joints
    q, v = any_arm.home + rng.uniform(-0.5, 0.5, (5, n)), rng.normal(size=(5, 3))
    plant, chain = (arm_motion(any_arm, X, native) for native in (False, True))
    pairs = [*zip(plant.along(q, v), chain.along(q, v), strict=True), (plant.speeds(q, v), chain.speeds(q, v))]
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9 * (1 + np.abs(other).max()))


def test_the_wrist_of_the_mh3f_is_singular_when_straight(arm):
    straight = arm.home.copy()
    straight[4] = 0.0
    assert np.linalg.svd(arm.task_jacobian(straight)[1], compute_uv=False)[-1] < 1e-9
    chain = arm_motion(arm, X, native=True)
    for function in (chain.along, chain.speeds):
        with pytest.raises(PlanningError, match="singular pose"):
            function(straight[None], np.zeros((1, 3)))


def test_an_arm_whose_middle_is_singular_can_still_be_linearised_for(scenario):
    """As of an arm without a home of its own, whose joint limits are symmetric about a straight wrist."""
    straight = ArmModel(ArmSpec(tool_height=scenario.object.thickness / 2))
    straight.home = np.where(np.arange(6) == 4, 0.0, straight.home)
    Convexification(scenario, straight, native=True)


SCENARIOS = {
    "default": {},
    "low friction": {"object.friction": 0.5},
    "weak": {"arm.torque_scale": 0.25, "arm.speed_scale": 1.2},
    "other sizes": {"object.length": 0.08, "object.thickness": 0.02, "task.start_x": 0.48, "table.height": 0.02},
}


@pytest.mark.parametrize("shift", [0.0, 0.01])
@pytest.mark.parametrize("fields", SCENARIOS.values(), ids=SCENARIOS)
def test_all_rows_by_machine_code_are_those_by_numpy_and_drake(fields, shift):
    scenario = IDEAL.with_overrides({**fields, "planner.solver": "daqp"})
    horizons = Convexification(scenario, ArmModel(ArmSpec(scenario.arm, scenario.object.thickness / 2)))
    point = horizons.guess(24, 5)
    rng = np.random.default_rng(1)
    first = horizons.layout.release - 24
    point.states[first + 1 :] += rng.normal(size=(len(point.states) - first - 1, 6)) * [0.003, 0.003, 0.02, 0.1, 0.1, 1]
    point.inputs[first:] += rng.normal(size=(len(point.inputs) - first, 3)) * [3, 3, 30]
    if shift:
        state = point.states[first]
        horizons.restart(state, horizons.q_start, shift)
    by_plant = Convexification(scenario, horizons.arm, native=False)
    by_plant.start, by_plant.shift, by_plant._in_motion = horizons.start, horizons.shift, horizons._in_motion
    by_plant.q_start = horizons.q_start
    by_plant.motion.shift_load(horizons.shift)
    (rows, motion), (expected, by_drake) = horizons.rows(point), by_plant.rows(point)
    for name in ("q", "qd", "torque", "from_task", "torque_from_task"):
        np.testing.assert_allclose(getattr(motion, name), getattr(by_drake, name), rtol=1e-9, atol=1e-10)
    assert rows.groups == expected.groups
    if "arm.torque_scale" in fields:
        assert TORQUE in rows.names()
    group, (a, b) = np.array(rows.names()), (each.matrix(horizons.layout.size) for each in (rows, expected))
    for name in set(group):  # derivatives by differences keep half of the digits
        near = 1e-6 if name in (SPEED, TORQUE) else 1e-11
        at = np.flatnonzero(group == name)
        np.testing.assert_allclose(a[at].toarray(), b[at].toarray(), rtol=near, atol=near, err_msg=name)
        np.testing.assert_allclose(rows.upper[at], expected.upper[at], rtol=near, atol=10 * near, err_msg=name)


def test_a_path_out_of_reach_is_refused_alike(scenario, arm):
    messages = []
    for native in (False, True):
        horizons = Convexification(scenario, arm, native)
        point = horizons.guess(24, 5)
        point.states[:, 0] += 3.0
        with pytest.raises(PlanningError) as caught:
            horizons.rows(point)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


def test_angles_at_a_pose_are_found_from_near_and_refused_outside_the_limits(arm):
    chain, plant = arm_motion(arm, X, native=True), ArmMotion(arm, X)
    q = arm.home + 0.05
    pose = arm.task_position(q)
    np.testing.assert_allclose(chain.joint_angles(pose, arm.home), q, atol=1e-8)
    over = np.array(arm.home)
    over[5] = arm.q_max[5] + 0.1
    for target, seed in ((pose + [5.0, 0, 0, 0, 0, 0], arm.home), (arm.task_position(over), over)):
        answers = []
        for motion in (chain, plant):
            try:
                answers.append(motion.joint_angles(target, seed).tolist())
            except PlanningError as error:
                answers.append(str(error))
        assert answers[0] == answers[1]  # the plant's word, whatever it is
        assert isinstance(answers[0], str) or np.all(np.array(answers[0]) <= arm.q_max)


def test_what_is_no_chain_of_revolute_joints_falls_back(scenario, arm, monkeypatch):
    monkeypatch.setattr("flipdiagram.robot.serial_chain.RevoluteJoint", PrismaticJoint)
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    assert type(horizons.motion) is ArmMotion
    assert horizons.rows(horizons.guess(24, 5))[0].count > 300


def test_the_first_plan_of_other_solvers_needs_no_numba(scenario, arm):
    code = (
        "import sys; from flipdiagram.planning import Planner; from flipdiagram.scenario.scenario import Scenario;"
        " scenario = Scenario(planner={'solver': 'clarabel', 'contact_samples': (10, 30)}); horizons = Planner(scenario).horizons; horizons.rows(horizons.guess(24, 5)); sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_trajectory_is_not_changed_and_rows_outlive_the_next_linearisation(scenario, arm):
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    point = horizons.guess(24, 5)
    before = Trajectory(point.states.copy(), point.inputs.copy(), 24, 5, point.sampling_time)
    first, _ = horizons.rows(point)
    arrays = (first.rows, first.columns, first.values, first.upper, first.slack)
    kept = [array.copy() for array in arrays]
    before.states[:, 0] += 0.01
    horizons.rows(before)
    for array, copy in zip(arrays, kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    before.states[:, 0] -= 0.01
    np.testing.assert_allclose(point.states, before.states, atol=1e-15)
    np.testing.assert_array_equal(point.inputs, before.inputs)


def test_only_the_last_horizons_are_kept(scenario, arm):
    horizons = Convexification(scenario, arm)
    for n_flight in range(1, 60):
        horizons._linearisation(24, n_flight, 0.0)
    assert horizons._linearisation.cache_info().currsize == 32
    assert horizons._linearisation(24, 59, 0.0) is horizons._linearisation(24, 59, 0.0)
