"""A box of the user's own in the place of one of Fig. 4."""

import re

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.systems.framework import LeafSystem
from shared import ideal_plan

from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.diagrams.controller import build_controller
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.robot.parts import arm_of
from flipdiagram.simulation.simulate import simulate, simulate_loop

SHORT = IDEAL.with_overrides({"simulation.hold_time": 0.05, "simulation.settle_time": 0.0})


class Box(LeafSystem):
    """Ports as told; the output is a sum over the inputs of the size wanted, times a gain."""

    def __init__(self, inputs, outputs, gain=0.0):
        super().__init__()
        self.ports = {name: self.DeclareVectorInputPort(name, size) for name, size in inputs.items()}
        for name, size in outputs.items():
            self.DeclareVectorOutputPort(
                name,
                size,
                lambda context, output, size=size: output.set_value(
                    gain
                    * sum((port.Eval(context) for port in self.ports.values() if port.size() == size), np.zeros(size))
                ),
            )


@pytest.fixture(scope="module")
def plan():
    return ideal_plan()


def run(plan, architecture, replace):
    return simulate(SHORT, architecture, plan, replace=replace).recording


def test_our_own_pd_in_its_own_place_changes_no_bit(plan):
    gains = np.full(6, SHORT.controller.k_p), np.full(6, SHORT.controller.k_v)
    same = run(plan, "pd+dob", {"pd": lambda: ProportionalDerivative(*gains)})
    ours = simulate_loop(build_loop(SHORT, "pd+dob", record=True), plan).recording
    np.testing.assert_array_equal(same["tau"].values, ours["tau"].values)


def test_a_box_acts_in_the_loop_and_may_read_other_signals(plan):
    """Feed-forward replaced by a box that passes twice the command through; it reads the speed of the joints too."""

    class Doubled(LeafSystem):
        def __init__(self):
            super().__init__()
            a_cmd = self.DeclareVectorInputPort("a_cmd", 6)
            self.DeclareVectorInputPort("qd", 6)
            self.DeclareVectorOutputPort("a_ff", 6, lambda context, output: output.set_value(2 * a_cmd.Eval(context)))

    loop = build_loop(SHORT, "pd+ff", replace={"feedforward": Doubled})
    context = loop.context(plan)
    loop.diagram.ExecuteInitializationEvents(context)
    context.SetTime(0.05 + 0.03)
    a_cmd = loop.mpc.GetOutputPort("a_cmd").Eval(loop.mpc.GetMyContextFromRoot(context))
    total = loop.diagram.GetSubsystemByName("a_ref_sum")
    pd = loop.boxes.pd.GetOutputPort("a_ref").Eval(loop.boxes.pd.GetMyContextFromRoot(context))
    assert np.abs(a_cmd).max() > 1
    np.testing.assert_allclose(total.get_output_port().Eval(total.GetMyContextFromRoot(context)), pd + 2 * a_cmd)


def test_a_controller_that_does_nothing_drops_everything(plan):
    scenario = SHORT.with_overrides({"simulation.start": "hold"})
    idle = simulate(scenario, "pd", plan, replace={"pd": Box({"x_cmd": 6}, {"a_ref": 6})}).recording
    assert idle["x"].values[-1, 1] < 0.3


MISFITS = {
    "absent box": (
        "pd",
        {"disturbance_observer": Box({}, {})},
        "'pd' has no box 'disturbance_observer'",
        "tool_kinematics",
    ),
    "the mpc": ("pd", {"mpc": Box({}, {})}, "no box 'mpc'", "choose from pd"),
    "missing output": (
        "pd",
        {"pd": Box({"x": 6}, {"force": 6})},
        "box for 'pd' has no output port 'a_ref' but force",
        "a_ref of size 6",
    ),
    "output of another size": ("pd", {"pd": Box({"x": 6}, {"a_ref": 3})}, "'a_ref' of size 3", "valid is 6"),
    "input of another size": ("pd", {"pd": Box({"x": 3}, {"a_ref": 6})}, "'x' has size 3", "valid is 6"),
    "unknown input": ("pd", {"pd": Box({"u": 6}, {"a_ref": 6})}, "input port 'u', which is no signal", "x_cmd, v_cmd"),
    "no system": ("pd", {"pd": 3}, "'pd' = 3 is no Drake System", ""),
    "algebraic loop": ("pd", {"pd": Box({"tau": 6}, {"a_ref": 6})}, "pd closes an algebraic loop", ""),
}


@pytest.mark.parametrize(("architecture", "replace", "what", "valid"), MISFITS.values(), ids=MISFITS)
def test_a_box_that_does_not_fit_is_refused_by_port(architecture, replace, what, valid):
    with pytest.raises(InputError) as refused:
        build_loop(SHORT, architecture, replace=replace)
    assert what in str(refused.value) and valid in str(refused.value) and "\n" not in str(refused.value)


def test_all_of_fig_4_as_one_box_of_ones_own_changes_nothing(plan):
    arm = arm_of(SHORT)
    whole = run(plan, "pd+ff+dob", {"controller": lambda: build_controller(SHORT, "pd+ff+dob", arm)})
    ours = simulate_loop(build_loop(SHORT, "pd+ff+dob", record=True), plan).recording
    np.testing.assert_allclose(whole["tau"].values, ours["tau"].values, rtol=0, atol=1e-6)
    assert whole.attrs["replaced"] == "controller"


def test_the_drives_limit_what_a_controller_of_ones_own_asks_for(plan):
    class Strong(LeafSystem):
        def __init__(self):
            super().__init__()
            self.DeclareVectorOutputPort("tau", 6, lambda context, output: output.set_value(np.full(6, 1e4)))

    scenario = SHORT.with_overrides({"simulation.start": "hold"})
    strong = simulate(scenario, "pd", plan, replace={"controller": Strong}).recording
    np.testing.assert_array_equal(strong["tau_cmd"].values, 1e4)
    np.testing.assert_array_equal(strong["tau"].values[-1], strong["tau"].attrs["limit"])


def test_a_controller_of_ones_own_may_stand_behind_an_mpc_that_replans(plan):
    scenario = SHORT.with_overrides({"planner.replan_period": 0.05})
    arm = arm_of(scenario)
    loop = build_loop(scenario, replace={"controller": build_controller(scenario, "pd+ff+dob", arm)})
    assert loop.boxes.output("x") is not None and loop.boxes.output("tau_dis") is None


@pytest.mark.parametrize(
    ("replace", "text"),
    [
        ({"controller": Box({}, {"tau": 6}), "pd": Box({}, {"a_ref": 6})}, "'controller' stands for all boxes"),
        ({"controller": Box({}, {"torque": 6})}, "no output port 'tau' but torque; valid is tau of size 6"),
        ({"controller": Box({}, {"tau": 5})}, "output port 'tau' of size 5; valid is 6"),
        ({"controller": Box({"a_ref": 6}, {"tau": 6})}, "input port 'a_ref', which is no signal; choose from x_cmd"),
        ({"controller": Box({"q": 7}, {"tau": 6})}, "input port 'q' has size 7; valid is 6"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused_in_one_line(replace, text):
    with pytest.raises(InputError, match=re.escape(text)):
        build_loop(SHORT, replace=replace)
