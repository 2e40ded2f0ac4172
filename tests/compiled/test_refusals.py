"""What has no compiled form says so: which block, and why. Drake's Simulator takes it then."""

import io
import sys
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.symbolic import Expression, Variable, uninterpreted_function
from pydrake.systems.framework import DiagramBuilder, LeafSystem, LeafSystem_
from pydrake.systems.primitives import Gain, Integrator, ZeroOrderHold
from pydrake.systems.scalar_conversion import TemplateSystem
from sampled_diagrams import PERIOD, PLANT_PARAMETERS, Stepper, expressions_block, one_axis_loop, saturated_loop, single

from flipdiagram.compiled import CompiledDiagram, NotCompilable, SimulatedDiagram, SlowWarning, compile_diagram
from flipdiagram.errors import InputError

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")


class PlainPython(LeafSystem):
    def __init__(self) -> None:
        super().__init__()
        self.DeclareVectorInputPort("u", 1)
        self.DeclareVectorOutputPort("y", 1, lambda context, output: output.set_value([0.0]))


@TemplateSystem.define("Branching_")
def Branching_(T: Any) -> Any:
    class Impl(LeafSystem_[T]):
        def _construct(self, broken: bool = False, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.broken = broken
            if broken and T is not float:
                raise ValueError("this block\ncannot be copied")
            self._u = self.DeclareVectorInputPort("u", 1)
            self.DeclareDiscreteState(1)
            self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, lambda context, values: None)
            self.DeclareVectorOutputPort("y", 1, self._calc, {self._u.ticket()})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.broken, converter=converter)

        def _calc(self, context: Any, output: Any) -> None:
            u = self._u.Eval(context)
            output.set_value(u if u[0] > 0.0 else -u)  # a Formula has no truth value

    return Impl


class Abstract(LeafSystem):
    def __init__(self) -> None:
        super().__init__()
        self.DeclareAbstractState(Value[object]())


def held(block: Any, name: str = "culprit", *periods: float) -> Any:
    """A block, its output sampled by a hold of each period."""
    builder = DiagramBuilder()
    builder.AddNamedSystem(name, block)
    for i in range(block.num_input_ports()):
        builder.ExportInput(block.get_input_port(i), f"in{i}")
    for i, period in enumerate(periods or (PERIOD,)):
        hold = builder.AddNamedSystem(f"hold{i}", ZeroOrderHold(period, 1))
        if block.num_output_ports():
            builder.Connect(block.get_output_port(0), hold.get_input_port())
        else:
            builder.ExportInput(hold.get_input_port(), f"hold{i}")
    return builder.Build()


def unprintable() -> Any:
    x = Variable("x")
    return expressions_block([x], [x], [uninterpreted_function("magic", [Expression(x)])])


REFUSED = [
    (lambda: held(PlainPython()), r"'culprit' \(PlainPython\) does not convert to symbolic; valid are"),
    (lambda: Branching_[None](True), "block .*does not convert to symbolic: .*this block$"),
    (lambda: held(Branching_[None]()), r"output 'y' of block 'culprit' .* cannot be evaluated symbolically: .+"),
    (lambda: held(Integrator(1)), r"'culprit' \(Integrator\) has continuous state; valid is discrete"),
    (lambda: held(Abstract()), r"'culprit' \(Abstract\) has abstract state"),
    (lambda: single(Gain(2.0, 1)), "no block has a periodic discrete update"),
    (lambda: held(Gain(2.0, 1), "gain", 0.1, 0.25), r"several periods \(0.1 s: hold0; 0.25 s: hold1\); valid is one"),
    (lambda: held(Stepper(("0.1+0", "0.1+0.05")), "culprit", 0.1), r"several periods .*0.1 s from 0.05 s: culprit"),
    (lambda: single(unprintable()), "SymbolicVectorSystem@0.*has no printed form: its update holds the uninterpreted"),
    (lambda: held(Stepper(("per step",))), "'culprit' at tick 0 is .*, Drake's Simulator says .*per-step"),
]


@pytest.mark.parametrize(("build", "message"), REFUSED, ids=[m[:35] for _, m in REFUSED])
def test_the_reason_is_one_line_that_names_the_block(build, message):
    with pytest.raises(NotCompilable, match=message) as caught:
        compile_diagram(build())
    assert "\n" not in str(caught.value) and caught.value.exit_code == 2


def test_what_is_no_system_is_a_bad_input():
    with pytest.raises(InputError, match="str is no System"):
        compile_diagram("diagram")
    with pytest.raises(InputError, match="check = -1"):
        compile_diagram(saturated_loop(), check=-1)


def test_two_updates_of_one_timing_are_one_period():
    compiled = compile_diagram(single(Stepper(("0.5+0", "0.5+0"))))
    assert compiled.run(3).outputs["out0"] == 3.0  # as in Drake, both write the same state


def test_the_self_check_can_be_left_out():
    compiled = compile_diagram(held(Stepper(("per step",))), check=0)
    assert compiled.run(5).state["culprit"] == 0.0  # which is why it should not be


def test_fallback_equals_compiled():
    diagram = one_axis_loop()
    compiled = compile_diagram(diagram, fallback=True)
    assert isinstance(compiled, CompiledDiagram)
    simulated = SimulatedDiagram(compiled.layout)
    arguments: dict[str, Any] = {
        "parameters": {**PLANT_PARAMETERS, "pd.0": [400.0, 900.0]},
        "inputs": {"x_cmd": np.linspace(0.0, 0.1, 20)[None], "v_cmd": 0.0, "a_cmd": [0.1, 0.2]},
        "start": [0, 500],
        "ticks": [150, 100],
        "log": ["x", "dob"],
        "every": 13,
    }
    ours, drakes = compiled.run(**arguments), simulated.run(**arguments)
    np.testing.assert_allclose(ours.final, drakes.final, rtol=1e-10, atol=1e-14)
    for name in ("x", "dob"):
        assert ours.log[name].shape == drakes.log[name].shape == (2, 12, 1)
        np.testing.assert_allclose(ours.log[name], drakes.log[name], rtol=1e-10, atol=1e-14)
    for name in ("x", "f"):
        np.testing.assert_allclose(ours.outputs[name], drakes.outputs[name], rtol=1e-9)
    assert (ours.ticks == drakes.ticks).all() and (ours.log_ticks == drakes.log_ticks).all()
    assert simulated.parameters == compiled.parameters and simulated.state_names == compiled.state_names


def test_a_diagram_without_compiled_form_falls_back_to_the_simulator():
    diagram = held(Integrator(1), "integrator")
    with pytest.warns(SlowWarning, match="integrator.*; Drake's Simulator runs it, thousands of times slower"):
        simulated = compile_diagram(diagram, fallback=True)
    assert isinstance(simulated, SimulatedDiagram) and simulated.period == PERIOD
    run = simulated.run(2000, inputs={"in0": [1.0, -2.0]}, log=["integrator"], every=500)
    np.testing.assert_allclose(run.state["integrator"][:, 0], [2.0, -4.0], rtol=1e-9)
    np.testing.assert_allclose(run.log["integrator"][0, :, 0], [0.0, 0.5, 1.0, 1.5, 2.0], rtol=1e-9, atol=1e-12)
    with pytest.raises(NotCompilable, match="cannot be linearised"):
        simulated.linearize()


def test_a_terminal_sees_how_far_the_simulator_is(monkeypatch):
    with pytest.warns(SlowWarning):
        simulated = compile_diagram(held(Integrator(1), "integrator"), fallback=True)
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", screen)
    simulated.run(2, inputs={"in0": [1.0, -2.0]})
    assert "channel 1 of 2" in screen.getvalue() and "channel 2 of 2" in screen.getvalue()


def test_several_periods_fall_back_with_a_tick_of_the_callers():
    diagram = held(Gain(2.0, 1), "gain", 0.125, 0.25)
    with pytest.raises(InputError, match="several periods.*give the period of a tick"):
        compile_diagram(diagram, fallback=True)
    with pytest.warns(SlowWarning, match="several periods"):
        simulated = compile_diagram(diagram, fallback=True, period=0.125)
    assert simulated.run(4, inputs={"in0": 3.0}).final.tolist() == [[6.0, 6.0]]
    with pytest.raises(InputError, match="period = 0.0"):
        compile_diagram(diagram, fallback=True, period=0.0)
