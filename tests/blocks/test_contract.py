"""What holds of every block: no stale outputs, state in the Context, and every scalar its maths allows."""

from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from flipdiagram.blocks.delay import Delay
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.friction import JointFriction
from flipdiagram.blocks.gravity import GravityCompensation
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.inverse_jacobian import InverseJacobian
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.errors import InputError

# NumPy reports the floating-point flags that Drake's symbolic scalars leave behind.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")


class DiagonalArm:
    """Two sliding joints along the axes of the task, one geared 2 : 1; it has a form over every scalar."""

    def __init__(self, T: type = float) -> None:
        self.jacobian = np.array([[T(1.0), T(0.0)], [T(0.0), T(2.0)]])

    def to_scalar(self, T: type) -> "DiagonalArm":
        return DiagonalArm(T)

    def task_kinematics(self, q: Any, qd: Any) -> Any:
        return q, qd, self.jacobian, 0.1 * q * qd

    def task_position_velocity(self, q: Any, qd: Any) -> Any:
        return q * np.array([1.0, 2.0]), q + qd

    def gravity_torque(self, q: Any) -> Any:
        return 9.81 * q * np.array([1.0, 2.0])


BLOCKS = {
    "feedforward": lambda: AccelerationFeedforward(2),
    "pd": lambda: ProportionalDerivative([1.0, 2.0], [3.0, 4.0]),
    "inertia": lambda: NominalInertia([1.0, 2.0]),
    "inertia matrix": lambda: NominalInertia([[1.0, 0.1], [0.1, 2.0]]),
    "observer": lambda: DisturbanceObserver([20.0, 30.0], [1.0, 2.0], 0.01),
    "observer matrix": lambda: DisturbanceObserver([20.0, 30.0], [[1.0, 0.1], [0.1, 2.0]], 0.01),
    "limit": lambda: TorqueLimit([0.1, 5.0]),
    "friction": lambda: JointFriction([1.0, 2.0], [0.1, 0.2], [0.3, 0.4]),
    "encoder": lambda: Encoder([0.01, 0.0]),
    "derivative": lambda: PseudoDerivative([20.0, 30.0], 0.01),
    "inverse jacobian": lambda: InverseJacobian(DiagonalArm(), 2, 2),
    "delay": lambda: Delay(2, 1, 0.01),
    "longer delay": lambda: Delay(2, 3, 0.01),
    "gravity": lambda: GravityCompensation(DiagonalArm(), [0.5, 1.0], 2),
    "tool kinematics": lambda: ToolKinematics(DiagonalArm(), 2, 2),
}
every_block = pytest.mark.parametrize("name", BLOCKS)
every_offset = pytest.mark.parametrize("offset", [0.0, 0.0075])


def fill(block: Any, context: Any, seed: int = 0, **other: int) -> None:
    """Inputs, state and parameters all positive and distinct; ``other`` seeds replace single ones."""

    def numbers(key: str, size: int) -> np.ndarray:
        return np.random.default_rng([other.get(key, seed), *key.encode()]).uniform(0.2, 1.0, size)

    for i in range(block.num_input_ports()):
        block.get_input_port(i).FixValue(context, numbers(f"input{i}", 2))
    for i in range(context.num_numeric_parameter_groups()):
        parameter = context.get_mutable_numeric_parameter(i)
        parameter.SetFromVector(numbers(f"parameter{i}", parameter.size()))
    if context.num_discrete_state_groups():
        context.SetDiscreteState(numbers("state", context.num_total_states()))


def results(block: Any, context: Any) -> list[np.ndarray]:
    values = [block.get_output_port(i).Eval(context) for i in range(block.num_output_ports())]
    if context.num_discrete_state_groups():
        values.append(block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector())
    return values


@every_block
def test_no_result_is_stale(name: str) -> None:
    """After any one change a context that was evaluated before agrees with a fresh one."""
    block = BLOCKS[name]()
    used = block.CreateDefaultContext()
    keys = [f"input{i}" for i in range(block.num_input_ports())]
    keys += [f"parameter{i}" for i in range(used.num_numeric_parameter_groups())]
    keys += ["state"] * used.num_discrete_state_groups()
    for key in keys:
        fill(block, used)
        before = results(block, used)
        fresh = block.CreateDefaultContext()
        fill(block, fresh, **{key: 1})
        # change that one thing alone, so that nothing else invalidates the cache
        if key.startswith("input"):
            port = block.get_input_port(int(key[-1]))
            port.FixValue(used, port.Eval(fresh))
        elif key.startswith("parameter"):
            number = int(key[-1])
            value = fresh.get_numeric_parameter(number).CopyToVector()
            used.get_mutable_numeric_parameter(number).SetFromVector(value)
        else:
            used.SetDiscreteState(fresh.get_discrete_state_vector().CopyToVector())
        after = results(block, used)
        assert np.array_equal(np.concatenate(after), np.concatenate(results(block, fresh))), key
        assert not np.array_equal(np.concatenate(after), np.concatenate(before)) or name == "encoder", key


@every_block
@pytest.mark.parametrize("form", ["ToAutoDiffXd", "ToSymbolic"])
def test_other_scalars_give_the_same_numbers(name: str, form: str) -> None:
    block = BLOCKS[name]()
    context = block.CreateDefaultContext()
    fill(block, context)
    converted = getattr(block, form)()
    other = converted.CreateDefaultContext()
    fill(converted, other)
    for value, expected in zip(results(converted, other), results(block, context), strict=True):
        numbers = [v.value() if form == "ToAutoDiffXd" else v.Evaluate() for v in value]
        assert numbers == pytest.approx(expected, rel=1e-14, abs=1e-15)


@every_block
def test_converted_blocks_keep_ports_sampling_and_defaults(name: str) -> None:
    block = BLOCKS[name]()
    converted = block.ToAutoDiffXd().ToSymbolic() if name == "pd" else block.ToSymbolic()
    for side in ("input", "output"):
        names = [
            [getattr(s, f"get_{side}_port")(i).get_name() for i in range(getattr(s, f"num_{side}_ports")())]
            for s in (block, converted)
        ]
        assert names[0] == names[1]
    assert block.num_continuous_states() == 0
    context, other = block.CreateDefaultContext(), converted.CreateDefaultContext()
    for i in range(context.num_numeric_parameter_groups()):
        values = [e.Evaluate() for e in other.get_numeric_parameter(i).CopyToVector()]
        assert values == context.get_numeric_parameter(i).CopyToVector().tolist()
    if context.num_discrete_state_groups():
        timings = [s.GetUniquePeriodicDiscreteUpdateAttribute() for s in (block, converted)]
        assert timings[0].period_sec() == timings[1].period_sec() == 0.01


@every_block
def test_every_block_says_what_it_is(name: str) -> None:
    doc = str(type(BLOCKS[name]()).__doc__)
    assert "output" in doc and "[" in doc and "(n,)" in doc


@every_offset
def test_a_delay_gives_back_its_input_after_exactly_so_many_periods(offset: float) -> None:
    """Random inputs through a simulated diagram, seen by a sampled reader of the same offset."""
    period, periods, ticks = 0.01, 3, 12
    sent = np.random.default_rng(7).uniform(-1.0, 1.0, (2, ticks + 1))
    builder = DiagramBuilder()
    # each value stands from a period before its sample, so that no rounding of k·T decides which one is read
    breaks = period * (np.arange(ticks + 1) - 0.5) + offset
    source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.ZeroOrderHold(breaks, sent)))
    delay = builder.AddSystem(Delay(2, periods, period, offset))
    reader = builder.AddSystem(Delay(2, 1, period, offset))
    builder.Connect(source.get_output_port(), delay.get_input_port())
    builder.Connect(delay.get_output_port(), reader.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    delay.set_initial_value(delay.GetMyMutableContextFromRoot(context), [5.0, 6.0])
    seen = []
    for k in range(ticks):
        simulator.AdvanceTo(k * period + offset + 0.3 * period)
        seen.append(reader.get_output_port().Eval(reader.GetMyContextFromRoot(context)))
    before = np.tile([5.0, 6.0], (periods, 1))
    np.testing.assert_array_equal(seen, np.vstack([before, sent.T])[:ticks])


@pytest.mark.parametrize("periods", [0, -1])
def test_a_delay_of_no_period_is_refused(periods: int) -> None:
    with pytest.raises(InputError, match="periods = .* at least 1"):
        Delay(1, periods, 0.01)


def test_gravity_compensation_is_a_fraction_of_the_arms_torque(context_of: Any, feedthrough_of: Any) -> None:
    block = GravityCompensation(DiagonalArm(), 0.5, 2)
    context = context_of(block, q=[1.0, -3.0])
    assert block.GetOutputPort("tau_gravity").Eval(context) == pytest.approx([4.905, -29.43])
    block.set_fraction(context, [1.0, 0.0])
    assert block.GetOutputPort("tau_gravity").Eval(context) == pytest.approx([9.81, 0.0])
    assert feedthrough_of(block) == {("q", "tau_gravity")}
    with pytest.raises(InputError, match="fraction"):
        block.set_fraction(context, -0.1)
