"""The loop in a larger diagram, and on its own default context."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from shared import ideal_plan

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.drawing import draw
from flipdiagram.errors import InputError
from flipdiagram.planning import plan_motion
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.simulate import simulate_loop

MUJOCO = Scenario().with_overrides({"simulation.engine": "mujoco"})


def states(context):
    return [context.get_discrete_state(k).CopyToVector() for k in range(context.num_discrete_state_groups())]


@pytest.fixture(scope="module")
def plan():
    return plan_motion(Scenario())


@pytest.mark.parametrize(
    ("fields", "architecture"),
    [
        ({}, "pd"),
        ({}, "pd+ff+dob"),
        ({"drive.delay": 0.001}, "pd+dob"),
        ({"simulation.engine": "mujoco"}, "pd+dob"),
        ({"joints.model": "elastic"}, "pd+dob"),
        ({"joints.model": "elastic", "simulation.engine": "mujoco"}, "pd+dob"),
    ],
)
def test_the_default_context_is_the_one_that_a_run_starts_from(fields, architecture):
    loop = build_loop(Scenario().with_overrides(fields), architecture)
    given, default = states(loop.context()), states(loop.diagram.CreateDefaultContext())
    for own, other in zip(given, default, strict=True):
        np.testing.assert_allclose(own, other, atol=1e-11)


def test_a_simulator_on_the_default_context_holds_the_start(plan):
    loop = build_loop(MUJOCO, "pd+ff+dob", planner=lambda: plan)
    simulator, x = Simulator(loop.diagram), loop.diagram.GetOutputPort("x")
    start = x.Eval(simulator.get_context()).copy()
    simulator.AdvanceTo(0.1)
    np.testing.assert_allclose(x.Eval(simulator.get_context()), start, atol=1e-5)
    simulator.AdvanceTo(0.3)
    assert np.abs(x.Eval(simulator.get_context()) - start).max() > 0.1  # and then it moves


def test_in_a_larger_diagram_it_runs_as_alone(plan):
    alone = build_loop(MUJOCO, "pd+ff", native=True)
    context = alone.context(plan)
    Simulator(alone.diagram, context).AdvanceTo(0.2)

    inside, builder = build_loop(MUJOCO, "pd+ff", native=True), DiagramBuilder()
    builder.AddSystem(ConstantVectorSource([1.0]))
    builder.AddNamedSystem("loop", inside.diagram)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    assert inside.context(plan, root=root) is root
    Simulator(diagram, root).AdvanceTo(0.2)
    for own, other in zip(states(inside.diagram.GetMyContextFromRoot(root)), states(context), strict=True):
        np.testing.assert_array_equal(own, other)


def test_without_the_context_of_the_larger_diagram_it_says_what_to_do():
    loop, builder = build_loop(MUJOCO, "pd"), DiagramBuilder()
    builder.AddNamedSystem("loop", loop.diagram)
    diagram = builder.Build()
    for root in (None, loop.diagram.CreateDefaultContext(), diagram):
        with pytest.raises(InputError, match=r"valid is loop\.context\(root=diagram\.CreateDefaultContext\(\)\)"):
            loop.context(root=root)


def test_the_ports_are_the_figures_signals():
    loop = build_loop(Scenario(), "pd+ff+dob")
    ports = {loop.diagram.get_output_port(i).get_name() for i in range(loop.diagram.num_output_ports())}
    figure = {"x_cmd", "v_cmd", "a_cmd", "x", "v", "q", "qd", "a_ref", "qdd_ref", "tau_ref", "tau_dis", "tau_cmd"}
    assert ports == figure | {"tau", "block", "poses", "contact_wrench", "query_object"}
    context = loop.context()
    for name in ("a_ref", "tau"):  # the sum's a_ref, not the PD's
        port = loop.boxes.signals[name]
        expected = port.Eval(port.get_system().GetMyContextFromRoot(context))
        np.testing.assert_array_equal(loop.diagram.GetOutputPort(name).Eval(context), expected)
    assert loop.boxes.signals["a_ref"].get_system().get_name() == "a_ref_sum"
    assert "tau_dis" not in build_loop(MUJOCO, "pd").boxes.signals


def test_a_force_from_outside_acts_on_the_arm():
    loop = build_loop(Scenario(), "pd", planner=ideal_plan)
    context, force = loop.context(), np.zeros(loop.cell.plant.num_velocities())
    joint = loop.cell.plant.GetJointByName(loop.arm.joint_names[0])
    force[joint.velocity_start()] = 5.0
    loop.diagram.GetInputPort("applied_generalized_force").FixValue(context, force)
    q = loop.diagram.GetOutputPort("q").Eval(context).copy()
    Simulator(loop.diagram, context).AdvanceTo(0.02)
    moved = loop.diagram.GetOutputPort("q").Eval(context) - q
    assert moved[0] > 1e-4 and np.argmax(np.abs(moved)) == 0


def test_commands_from_outside_lead_the_tool():
    loop = build_loop(MUJOCO, "pd+ff+dob", external_commands=True)
    context, x = loop.context(), loop.diagram.GetOutputPort("x")
    command = x.Eval(context) + [0.0, 0.002, 0.0, 0.0, 0.0, 0.0]
    Simulator(loop.diagram, context).AdvanceTo(0.05)
    np.testing.assert_allclose(x.Eval(context), command - [0.0, 0.002, 0.0, 0.0, 0.0, 0.0], atol=1e-5)
    loop.diagram.GetInputPort("x_cmd").FixValue(context, command)
    Simulator(loop.diagram, context).AdvanceTo(0.4)
    assert 0.001 < x.Eval(context)[1] - command[1] + 0.002 < 0.002  # the observer takes its time against friction
    assert {box.name for box in draw(loop).graph.boxes} >= {"x_cmd", "v_cmd", "a_cmd"}


def test_what_needs_an_mpc_refuses_external_commands(plan):
    for given in ({"record": True}, {"native": True}):
        with pytest.raises(InputError, match=f"{next(iter(given))} needs the MPC"):
            build_loop(MUJOCO, "pd", external_commands=True, **given)
    with pytest.raises(InputError, match=r"planner\.replan_period needs the MPC"):
        build_loop(MUJOCO.with_overrides({"planner.replan_period": 0.02}), "pd", external_commands=True)
    loop = build_loop(MUJOCO, "pd", external_commands=True)
    with pytest.raises(InputError, match="follows no plan"):
        loop.context(plan)
    with pytest.raises(InputError, match="records nothing"):
        simulate_loop(loop)
