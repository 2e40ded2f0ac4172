"""Each architecture's diagram against Fig. 4: boxes, arrows, feed-through, rates."""

import numpy as np
import pytest

from flipdiagram.diagrams.controller import nominal_inertia
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

ALWAYS = {
    ("mpc.x_cmd", "pd.x_cmd"),
    ("mpc.v_cmd", "pd.v_cmd"),
    ("tool_kinematics.x", "pd.x"),
    ("tool_kinematics.v", "pd.v"),
    ("joint_state.y0", "tool_kinematics.q"),
    ("joint_state.y1", "tool_kinematics.qd"),
    ("joint_state.y0", "inverse_jacobian.q"),
    ("joint_state.y1", "inverse_jacobian.qd"),
    ("inverse_jacobian.qdd_ref", "nominal_inertia.qdd_ref"),
    ("torque_limit.tau", "joint_torque.u0"),
    ("joint_friction.tau_friction", "joint_torque.u1"),
    ("joint_state.y1", "joint_friction.qd"),
    ("joint_torque.sum", "robot.mh3f_actuation"),
    ("robot.mh3f_state", "joint_state.u0"),
    ("robot.contact_results", "contact_forces.contact_results"),
}
WITH_FF = {
    ("mpc.a_cmd", "feedforward.a_cmd"),
    ("pd.a_ref", "a_ref_sum.u0"),
    ("feedforward.a_ff", "a_ref_sum.u1"),
    ("a_ref_sum.sum", "inverse_jacobian.a_ref"),
}
WITHOUT_FF = {("pd.a_ref", "inverse_jacobian.a_ref")}
WITH_DOB = {
    ("nominal_inertia.tau_ref", "tau_sum.u0"),
    ("disturbance_observer.tau_dis", "tau_sum.u1"),
    ("tau_sum.sum", "torque_limit.tau_cmd"),
    ("torque_limit.tau", "disturbance_observer.tau"),
    ("joint_state.y1", "disturbance_observer.qd"),
}
WITHOUT_DOB = {("nominal_inertia.tau_ref", "torque_limit.tau_cmd")}
FIG_4 = {
    "pd": ALWAYS | WITHOUT_FF | WITHOUT_DOB,
    "pd+ff": ALWAYS | WITH_FF | WITHOUT_DOB,
    "pd+dob": ALWAYS | WITHOUT_FF | WITH_DOB,
    "pd+ff+dob": ALWAYS | WITH_FF | WITH_DOB,
}


@pytest.fixture(scope="module", params=ARCHITECTURES)
def loop(request):
    return build_loop(Scenario(), request.param)


def edges(diagram):
    found = set()
    for (into, i), (out, o) in diagram.connection_map().items():
        source = f"{out.get_name()}.{out.get_output_port(o).get_name()}"
        found.add((source, f"{into.get_name()}.{into.get_input_port(i).get_name()}"))
    return {edge for edge in found if "scene_graph" not in edge[0] + edge[1]}


def test_the_arrows_are_those_of_fig_4(loop):
    assert edges(loop.diagram) == FIG_4[loop.architecture]


def test_absent_boxes_are_absent(loop):
    parts = loop.architecture.split("+")
    assert loop.diagram.HasSubsystemNamed("feedforward") == ("ff" in parts)
    assert loop.diagram.HasSubsystemNamed("disturbance_observer") == ("dob" in parts)
    assert (loop.boxes.feedforward is None) == ("ff" not in parts)
    assert (loop.boxes.disturbance_observer is None) == ("dob" not in parts)


def test_all_sampled_boxes_share_the_controllers_period(loop):
    timing = loop.diagram.GetUniquePeriodicDiscreteUpdateAttribute()
    assert timing is not None
    assert (timing.period_sec(), timing.offset_sec()) == (0.001, 0.0)


def test_nothing_feeds_through_the_mpc_and_torque_only_later_through_the_observer(loop):
    assert not loop.mpc.HasAnyDirectFeedthrough()
    observer = loop.boxes.disturbance_observer
    if observer is not None:
        index = {observer.get_input_port(i).get_name(): i for i in range(observer.num_input_ports())}
        assert not observer.HasDirectFeedthrough(index["tau"], 0)
        assert observer.HasDirectFeedthrough(index["qd"], 0)


def test_the_boxes_have_the_scenarios_gains(loop):
    pd = loop.boxes.pd
    np.testing.assert_array_equal(pd.k_p, np.full(6, 350.0))
    np.testing.assert_array_equal(pd.k_v, np.full(6, 120.0))
    if loop.boxes.disturbance_observer is not None:
        np.testing.assert_array_equal(loop.boxes.disturbance_observer.g_dis, np.full(6, 12.6))


def test_a_run_starts_with_arm_and_block_at_the_start(loop):
    context = loop.context()
    other = loop.context()
    plant = loop.cell.plant
    mine = plant.GetMyContextFromRoot(context)
    task = loop.scenario.task
    X_WB = plant.EvalBodyPoseInWorld(mine, loop.cell.parts.block)
    np.testing.assert_allclose(X_WB.translation(), [task.start_x, task.start_y, task.start_z], atol=1e-12)
    q = plant.GetPositions(mine, loop.cell.parts.arm.arm)
    np.testing.assert_allclose(loop.arm.task_position(q), [0.0, 0.35, 0, 0.5, 0, 0], atol=1e-9)
    # two contexts of one diagram share nothing
    plant.SetPositions(plant.GetMyMutableContextFromRoot(other), loop.cell.parts.arm.arm, np.zeros(6))
    np.testing.assert_array_equal(plant.GetPositions(mine, loop.cell.parts.arm.arm), q)


def test_nominal_inertia_is_the_scenarios_or_that_of_the_start_pose():
    scenario = Scenario()
    arm = arm_of(scenario)
    np.testing.assert_array_equal(nominal_inertia(scenario, arm, arm.home), np.diag(arm.mass_matrix(arm.home)))
    given = [0.5, 1.5, 0.8, 0.4, 0.5, 0.01]
    changed = scenario.with_overrides({"controller.nominal_inertia": given, "controller.nominal_inertia_scale": 2.0})
    np.testing.assert_array_equal(nominal_inertia(changed, arm, arm.home), 2 * np.array(given))


def test_an_unknown_architecture_is_refused_by_name():
    with pytest.raises(InputError, match=r"unknown architecture 'pid'; choose from pd, pd\+ff"):
        build_loop(Scenario(), "pid")


def test_sensors_and_a_finer_plant_step_add_their_boxes():
    scenario = Scenario().with_overrides(
        {"sensors.encoder_resolution": 1e-5, "sensors.velocity_cutoff": 62.8, "simulation.step": 0.0005}
    )
    loop = build_loop(scenario)
    found = edges(loop.diagram)
    assert ("joint_state.y0", "encoder.q") in found
    assert ("encoder.q_measured", "velocity.q") in found
    assert ("encoder.q_measured", "tool_kinematics.q") in found
    assert ("velocity.v", "disturbance_observer.qd") in found
    assert ("torque_limit.tau", "hold.u") in found or ("torque_limit.tau", "hold.u0") in found
