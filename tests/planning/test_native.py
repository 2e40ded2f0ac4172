"""The compiled loops against Drake's multibody code and against the rows that NumPy makes."""

import numpy as np
import pytest
from pydrake.multibody.tree import PrismaticJoint
from robots import package_file

from flipdiagram.errors import PlanningError
from flipdiagram.planning import limits
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.native.along import Along, speeds
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import ArmFile, ArmSpec
from flipdiagram.robot.serial_chain import serial_chain
from flipdiagram.scenario.scenario import Scenario

ROTORS = (0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2)
ARMS = {
    "MH3F": {},
    "turned base": {"base_pose": (0.1, -0.2, 0.3, 0.4), "link_inertia_scales": (1.5, 0.5, 1, 2, 1, 1)},
    "UR5": {"own": ArmFile(package_file("ur_description/urdf/ur5_joint_limited_robot.urdf"), "base_link", "tool0")},
    "Panda": {
        "own": ArmFile(
            package_file("panda_description/urdf/panda.urdf"), "panda_link0", "panda_link8", reflected_inertia=ROTORS
        )
    },
}


@pytest.fixture(scope="module", params=ARMS)
def any_arm(request):
    return ArmModel(ArmSpec(**ARMS[request.param]))


def test_kinematics_and_dynamics_are_those_of_drake(any_arm):
    rng, n = np.random.default_rng(0), any_arm.n_joints
    q = any_arm.home + rng.uniform(-0.5, 0.5, (40, n))
    v, a = rng.normal(size=(40, 3)), 10 * rng.normal(size=(40, 3))
    along = Along(serial_chain(any_arm), q, v)
    tau, by_input = along.torques(a), along.inertia_of_task()
    for k in range(40):
        inverse = np.linalg.pinv(any_arm.task_jacobian(q[k])[1])
        size = np.abs(inverse).max()
        np.testing.assert_allclose(along.from_task[k], inverse, atol=1e-10 * size**2)
        qd = along.qd[k]
        np.testing.assert_allclose(qd, inverse[:, :3] @ v[k], atol=1e-10 * size**2)
        bias = any_arm.task_kinematics(q[k], qd)[3]
        np.testing.assert_allclose(along.bias[k], bias, atol=1e-11 * (1 + np.abs(bias).max()))
        qdd = along.from_task[k] @ (np.array([*a[k], 0, 0, 0]) - bias)
        expected = any_arm.inverse_dynamics(q[k], qd, qdd)
        np.testing.assert_allclose(tau[k], expected, atol=1e-10 * (1 + np.abs(expected).max()))
        expected = any_arm.mass_matrix(q[k]) @ along.from_task[k, :, :3]
        np.testing.assert_allclose(by_input[k], expected, atol=1e-11 * (1 + np.abs(expected).max()))


def test_the_wrist_of_the_mh3f_is_singular_when_straight(arm):
    straight = arm.home.copy()
    straight[4] = 0.0
    assert np.linalg.svd(arm.task_jacobian(straight)[1], compute_uv=False)[-1] < 1e-9
    for function in (lambda *given: Along(*given).checked(), speeds):
        with pytest.raises(PlanningError, match="singular pose"):
            function(serial_chain(arm), straight[None], np.zeros((1, 3)))


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
def test_all_rows_are_those_of_numpy(fields, shift):
    scenario = Scenario().with_overrides({**fields, "planner.solver": "daqp"})
    horizons = Convexification(
        scenario, ArmModel(ArmSpec(tool_height=scenario.object.thickness / 2, torque_scale=scenario.arm.torque_scale))
    )
    point = horizons.guess(24, 5)
    rng = np.random.default_rng(1)
    first = horizons.layout.release - 24
    point.states[first + 1 :] += rng.normal(size=(len(point.states) - first - 1, 6)) * [0.003, 0.003, 0.02, 0.1, 0.1, 1]
    point.inputs[first:] += rng.normal(size=(len(point.inputs) - first, 3)) * [3, 3, 30]
    if shift:
        state = point.states[first]
        horizons.restart(state, horizons.q_start, shift)
    (compiled, motion), (rows, expected) = horizons.rows(point, grouped=False), horizons.rows(point)
    for name in ("q", "qd", "torque", "from_task", "torque_from_task"):
        np.testing.assert_allclose(getattr(motion, name), getattr(expected, name), rtol=1e-9, atol=1e-10)
    (A, b), (A_numpy, b_numpy) = (found.matrix(horizons.layout.size) for found in (compiled, rows))
    assert A.shape == A_numpy.shape
    if "arm.torque_scale" in fields:
        assert limits.TORQUE in rows.groups()
    group = np.array(rows.groups())
    for name in set(group):  # derivatives by differences keep half of the digits
        near = 1e-6 if name in (limits.SPEED, limits.TORQUE) else 1e-11
        at = np.flatnonzero(group == name)
        np.testing.assert_allclose(A[at].toarray(), A_numpy[at].toarray(), rtol=near, atol=near, err_msg=name)
        np.testing.assert_allclose(b[at], b_numpy[at], rtol=near, atol=10 * near, err_msg=name)


def test_a_path_out_of_reach_is_refused_as_by_numpy(scenario, arm):
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    point = horizons.guess(24, 5)
    point.states[:, 0] += 3.0
    messages = []
    for grouped in (True, False):
        with pytest.raises(PlanningError) as caught:
            horizons.rows(point, grouped=grouped)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


def test_angles_at_a_pose_are_found_from_near_and_refused_outside_the_limits(scenario, arm):
    native = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)._native
    q = arm.home + 0.05
    pose = arm.task_position(q)
    np.testing.assert_allclose(native.joint_angles(pose, arm.home), q, atol=1e-8)
    assert native.joint_angles(pose + [5.0, 0, 0, 0, 0, 0], arm.home) is None
    over = np.array(arm.home)
    over[5] = arm.q_max[5] + 0.1
    assert native.joint_angles(arm.task_position(over), over) is None


def test_what_is_no_chain_of_revolute_joints_falls_back(scenario, arm, monkeypatch):
    monkeypatch.setattr("flipdiagram.robot.serial_chain.RevoluteJoint", PrismaticJoint)
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    assert horizons._native is None
    rows, _ = horizons.rows(horizons.guess(24, 5), grouped=False)
    assert rows.groups()


def test_the_first_plan_of_other_solvers_is_left_to_drake(scenario, arm):
    assert Convexification(scenario, arm)._native is None


def test_a_trajectory_is_not_changed(scenario, arm):
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    point = horizons.guess(24, 5)
    before = Trajectory(point.states.copy(), point.inputs.copy(), 24, 5, point.sampling_time)
    first, _ = horizons.rows(point, grouped=False)
    kept = [array.copy() for array in first.entries()]
    horizons.rows(before, grouped=False)
    for array, copy in zip(first.entries(), kept, strict=True):  # rows outlive the next linearisation
        np.testing.assert_array_equal(array, copy)
    np.testing.assert_array_equal(point.states, before.states)
    np.testing.assert_array_equal(point.inputs, before.inputs)


def test_a_plan_from_elsewhere_may_fly_longer_than_the_scenario_allows(scenario, arm):
    """The arrays that the loops fill hold its rows too."""
    narrow = scenario.with_overrides({"planner.solver": "daqp", "planner.flight_samples": (4, 6)})
    horizons = Convexification(narrow, arm)
    point = horizons.guess(24, 300)
    (compiled, _), (rows, _) = horizons.rows(point, grouped=False), horizons.rows(point)
    (A, b), (A_numpy, b_numpy) = (found.matrix(horizons.layout.size) for found in (compiled, rows))
    assert A.shape == A_numpy.shape and np.abs(A - A_numpy).max() < 1e-6 and np.abs(b - b_numpy).max() < 1e-6


def test_no_trajectory_needs_more_room_than_there_is(scenario, arm):
    """Every joint near every limit at every sample: the most rows that there can be."""
    horizons = Convexification(scenario.with_overrides({"planner.solver": "daqp"}), arm)
    point = horizons.guess(30, 20)
    native = horizons._native
    tight = limits.Allowed(np.full(6, 9.0), np.full(6, 1e-3), np.full(6, 1e-9), np.full(6, 1e-9))
    found, motion = native.rows(point, point.states, horizons.q_start, tight, 0.0, False)
    rows, columns, values, upper = native._buffer.arrays[:4]
    assert found.count <= upper.size and found.entries()[0].size <= values.size
    near = int(np.sum(np.abs(motion.qd) > limits.NEAR * 1e-9)) + 2 * motion.q.size
    assert found.count > near + 2 * motion.torque[0].size
