"""Each architecture's diagram against Fig. 4: boxes, arrows, feed-through, rates."""

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from flipdiagram.blocks.mpc import ModelPredictiveController
from flipdiagram.diagrams import one_dof
from flipdiagram.diagrams.controller import build_controller, nominal_inertia
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.planning import plan_motion
from flipdiagram.plants.cell import add_cell
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES

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


COMMANDED = {("x_cmd", "pd.x_cmd"), ("v_cmd", "pd.v_cmd")}
MEASURED = {
    ("q", "tool_kinematics.q"),
    ("qd", "tool_kinematics.qd"),
    ("q", "inverse_jacobian.q"),
    ("qd", "inverse_jacobian.qd"),
}
ALONE = {
    ("tool_kinematics.x", "pd.x"),
    ("tool_kinematics.v", "pd.v"),
    ("inverse_jacobian.qdd_ref", "nominal_inertia.qdd_ref"),
    ("torque_limit.tau", "tau"),
} | (COMMANDED | MEASURED)
SUM_OF_A_REF = {
    ("a_cmd", "feedforward.a_cmd"),
    ("pd.a_ref", "a_ref_sum.u0"),
    ("feedforward.a_ff", "a_ref_sum.u1"),
    ("a_ref_sum.sum", "inverse_jacobian.a_ref"),
}
NOT_FED_FORWARD = {("a_cmd", "unused_a_cmd.u"), ("pd.a_ref", "inverse_jacobian.a_ref")}
OBSERVED = {
    ("nominal_inertia.tau_ref", "tau_sum.u0"),
    ("disturbance_observer.tau_dis", "tau_sum.u1"),
    ("tau_sum.sum", "torque_limit.tau_cmd"),
    ("torque_limit.tau", "disturbance_observer.tau"),
    ("qd", "disturbance_observer.qd"),
}
CONTROLLER = {
    "pd": ALONE | NOT_FED_FORWARD | WITHOUT_DOB,
    "pd+ff": ALONE | SUM_OF_A_REF | WITHOUT_DOB,
    "pd+dob": ALONE | NOT_FED_FORWARD | OBSERVED,
    "pd+ff+dob": ALONE | SUM_OF_A_REF | OBSERVED,
}
FEEDBACK_1 = COMMANDED | {("x", "pd.x"), ("v", "pd.v")}
FEEDFORWARD_1 = {("a_cmd", "feedforward.a_cmd"), ("pd.a_ref", "a_ref_sum.u0"), ("feedforward.a_ff", "a_ref_sum.u1")}
OBSERVER_1 = {
    ("nominal_inertia.tau_ref", "force_sum.u0"),
    ("disturbance_observer.tau_dis", "force_sum.u1"),
    ("force_sum.sum", "disturbance_observer.tau"),
    ("v", "disturbance_observer.qd"),
    ("force_sum.sum", "force"),
}
ONE_DOF = {
    "pd": FEEDBACK_1 | {("pd.a_ref", "nominal_inertia.qdd_ref"), ("nominal_inertia.tau_ref", "force")},
    "pd+ff": FEEDBACK_1
    | FEEDFORWARD_1
    | {("a_ref_sum.sum", "nominal_inertia.qdd_ref"), ("nominal_inertia.tau_ref", "force")},
    "pd+dob": FEEDBACK_1 | {("pd.a_ref", "nominal_inertia.qdd_ref")} | OBSERVER_1,
    "pd+ff+dob": FEEDBACK_1 | FEEDFORWARD_1 | {("a_ref_sum.sum", "nominal_inertia.qdd_ref")} | OBSERVER_1,
}


def edges_and_ports(diagram):
    """Arrows between boxes, and those from its inputs and to its outputs."""
    arrows = edges(diagram)
    for i in range(diagram.num_input_ports()):
        port = diagram.get_input_port(i)
        for box, k in diagram.GetInputPortLocators(port.get_index()):
            arrows.add((port.get_name(), f"{box.get_name()}.{box.get_input_port(k).get_name()}"))
    for i in range(diagram.num_output_ports()):
        port = diagram.get_output_port(i)
        box, k = diagram.get_output_port_locator(port.get_index())
        arrows.add((f"{box.get_name()}.{box.get_output_port(k).get_name()}", port.get_name()))
    return arrows


@pytest.fixture(scope="module", params=ARCHITECTURES)
def loop(request):
    return build_loop(IDEAL, request.param)


def edges(diagram):
    found = set()
    for (into, i), (out, o) in diagram.connection_map().items():
        source = f"{out.get_name()}.{out.get_output_port(o).get_name()}"
        found.add((source, f"{into.get_name()}.{into.get_input_port(i).get_name()}"))
    return {edge for edge in found if "scene_graph" not in edge[0] + edge[1]}


def test_the_arrows_are_those_of_fig_4(loop):
    assert edges(loop.diagram) == FIG_4[loop.architecture]


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_the_controller_alone_has_the_arrows_and_ports_of_fig_4(architecture):
    diagram = build_controller(IDEAL, architecture, arm_of(IDEAL))
    assert edges_and_ports(diagram) == CONTROLLER[architecture]
    inputs = [(port.get_name(), port.size()) for port in map(diagram.get_input_port, range(diagram.num_input_ports()))]
    assert inputs == [("x_cmd", 6), ("v_cmd", 6), ("a_cmd", 6), ("q", 6), ("qd", 6)]  # one may replace another
    assert (diagram.num_output_ports(), diagram.GetOutputPort("tau").size()) == (1, 6)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_with_one_degree_of_freedom_the_arrows_are_those_of_fig_4(architecture):
    assert edges_and_ports(one_dof.build_controller(architecture, OneDof())) == ONE_DOF[architecture]


def test_measured_acceleration_is_fed_forward_where_asked_for():
    settings = OneDof().model_copy(update={"feedforward": "measured"})
    arrows = edges_and_ports(one_dof.build_controller("pd+ff", settings))
    assert {("v", "measured_acceleration.q"), ("measured_acceleration.v", "feedforward.a_cmd")} <= arrows
    assert not any(source == "a_cmd" for source, _ in arrows)


def test_what_is_fed_forward_against_gravity_is_not_observed():
    scenario = IDEAL.with_overrides({"controller.gravity_compensation": 1.0})
    arrows = edges_and_ports(build_controller(scenario, "pd+dob", arm_of(scenario)))
    assert arrows == (CONTROLLER["pd+dob"] - {("torque_limit.tau", "disturbance_observer.tau")}) | {
        ("q", "gravity_compensation.q"),
        ("gravity_compensation.tau_gravity", "tau_sum.u2"),
        ("gravity_compensation.tau_gravity", "minus_gravity.u0"),
        ("torque_limit.tau", "tau_observed.u0"),
        ("minus_gravity.y0", "tau_observed.u1"),
        ("tau_observed.sum", "disturbance_observer.tau"),
    }


class Stubborn(LeafSystem):
    """A box of the user's own that asks for nothing but takes a signal."""

    def __init__(self, signal):
        super().__init__()
        self.DeclareVectorInputPort(signal, 6)
        self.DeclareVectorOutputPort("a_ref", 6, lambda context, output: output.set_value(np.zeros(6)))


def test_a_replaced_box_takes_the_signals_that_it_has_inputs_for():
    arm = arm_of(IDEAL)
    diagram = build_controller(IDEAL, "pd", arm, replace={"pd": lambda: Stubborn("a_cmd")})
    left_out = {
        ("x_cmd", "pd.x_cmd"),
        ("v_cmd", "pd.v_cmd"),
        ("tool_kinematics.x", "pd.x"),
        ("tool_kinematics.v", "pd.v"),
    }
    arrows = edges_and_ports(diagram)
    assert not arrows & left_out
    assert {("x_cmd", "unused_x_cmd.u"), ("v_cmd", "unused_v_cmd.u"), ("a_cmd", "pd.a_cmd")} <= arrows
    with pytest.raises(InputError, match="'pd' has input port 'tau_dis', which is absent here"):
        build_controller(IDEAL, "pd", arm, replace={"pd": lambda: Stubborn("tau_dis")})


def test_a_users_own_loop_around_the_controller_turns_as_ours_does():
    """build_controller in a builder of one's own, between an MPC and a cell: the torques of 50 ms to rounding."""
    scenario = IDEAL.with_overrides({"simulation.start": "hold", "simulation.hold_time": 0.01})
    plan, ours = plan_motion(scenario), build_loop(scenario)
    builder = DiagramBuilder()
    hold = np.array([*plan.states[0, :3], scenario.task.start_x, 0.0, 0.0])
    mpc = builder.AddNamedSystem("mpc", ModelPredictiveController(lambda: plan, hold, scenario.simulation.hold_time))
    cell = add_cell(builder, scenario, ours.arm, ours.q_start)
    controller = builder.AddNamedSystem("controller", build_controller(scenario, "pd+ff+dob", ours.arm))
    for name in ("x_cmd", "v_cmd", "a_cmd"):
        builder.Connect(mpc.GetOutputPort(name), controller.GetInputPort(name))
    builder.Connect(cell.q, controller.GetInputPort("q"))
    builder.Connect(cell.qd, controller.GetInputPort("qd"))
    builder.Connect(controller.GetOutputPort("tau"), cell.tau)
    torques = []
    for diagram, context, tau in (
        (builder.Build(), None, controller.GetOutputPort("tau")),
        (ours.diagram, ours.context(plan), ours.boxes.torque_limit.GetOutputPort("tau")),
    ):
        simulator = Simulator(diagram, context)
        simulator.AdvanceTo(0.05)
        torques.append(tau.Eval(tau.get_system().GetMyContextFromRoot(simulator.get_context())))
    np.testing.assert_allclose(torques[0], torques[1], rtol=1e-12)
    assert np.abs(torques[0]).max() > 1.0


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


def test_a_hold_starts_with_arm_and_block_at_the_start(loop):
    loop = build_loop(IDEAL.with_overrides({"simulation.start": "hold"}), loop.architecture)
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
    scenario = IDEAL
    arm = arm_of(scenario)
    np.testing.assert_array_equal(nominal_inertia(scenario, arm, arm.home), np.diag(arm.mass_matrix(arm.home)))
    given = [0.5, 1.5, 0.8, 0.4, 0.5, 0.01]
    changed = scenario.with_overrides({"controller.nominal_inertia": given, "controller.nominal_inertia_scale": 2.0})
    np.testing.assert_array_equal(nominal_inertia(changed, arm, arm.home), 2 * np.array(given))


def test_an_unknown_architecture_is_refused_by_name():
    with pytest.raises(InputError, match=r"unknown architecture 'pid'; choose from pd, pd\+ff"):
        build_loop(IDEAL, "pid")


def test_sensors_and_a_finer_plant_step_add_their_boxes():
    scenario = IDEAL.with_overrides(
        {"sensors.encoder_resolution": 1e-5, "sensors.velocity_cutoff": 62.8, "simulation.step": 0.0005}
    )
    loop = build_loop(scenario)
    found = edges(loop.diagram)
    assert ("joint_state.y0", "encoder.q") in found
    assert ("encoder.q_measured", "velocity.q") in found
    assert ("encoder.q_measured", "tool_kinematics.q") in found
    assert ("velocity.v", "disturbance_observer.qd") in found
    assert ("torque_limit.tau", "hold.u") in found or ("torque_limit.tau", "hold.u0") in found
