"""What holds of every system in `blocks` and `plants`: no stale outputs, honest feed-through, state in the Context, the
same numbers each time, and every scalar its maths allows."""

import importlib
import inspect
import pkgutil
import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.common.value import Value
from pydrake.geometry import GeometryConfigurationVector, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ContactResults, ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem, PortDataType
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

import flipdiagram.blocks
import flipdiagram.plants
from flipdiagram.blocks.block import Block
from flipdiagram.blocks.camera import Camera
from flipdiagram.blocks.commands import BroadbandNoise, SinusoidalCommand, SinusoidalNoise
from flipdiagram.blocks.delay import Delay
from flipdiagram.blocks.feedforward import AccelerationFeedforward
from flipdiagram.blocks.friction import JointFriction
from flipdiagram.blocks.gravity import GravityCompensation
from flipdiagram.blocks.inertia import NominalInertia
from flipdiagram.blocks.inverse_jacobian import InverseJacobian
from flipdiagram.blocks.meters import LockIn, Peak, RootMeanSquare
from flipdiagram.blocks.mpc import ModelPredictiveController
from flipdiagram.blocks.noise import SensorNoise
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.blocks.plan_commands import PlanCommands
from flipdiagram.blocks.receding_horizon import RecedingHorizonController, Timing
from flipdiagram.blocks.ripple import TorqueRipple
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.blocks.sticking import ElastoPlasticFriction
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.blocks.torque_limit import TorqueLimit
from flipdiagram.errors import InputError
from flipdiagram.planning import plan_motion
from flipdiagram.plants.cell import ContactForces, add_cell
from flipdiagram.plants.handle import add_model
from flipdiagram.plants.mujoco_cell import CELL, MujocoPlant
from flipdiagram.plants.one_dof import OneDofPlant
from flipdiagram.plants.pancake_cell import Pancake, add_pancake_cell
from flipdiagram.plants.push import Push
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

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
        return q * np.array([1.0, 2.0]) + 0.1 * qd, q + qd

    def gravity_torque(self, q: Any) -> Any:
        return 9.81 * q * np.array([1.0, 2.0])


@cache
def cell_at_start() -> tuple[Any, Any]:
    """The cell at the start of a task, and its diagram."""
    scenario, builder = IDEAL, DiagramBuilder()
    arm = arm_of(scenario)
    start = [scenario.task.start_y, scenario.task.start_z, 0.0, scenario.task.start_x, 0.0, 0.0]
    cell = add_cell(builder, scenario, arm, arm.inverse_kinematics(start))
    builder.ExportInput(cell.tau, "tau")
    return cell, builder.Build()


@cache
def plan() -> Any:
    return plan_motion(IDEAL)


def camera() -> Camera:
    parts = cell_at_start()[0].parts
    return Camera(parts.arm.tool, parts.block, 0.01, 0.02, 1e-3, seed=3)


def receding() -> RecedingHorizonController:
    def again(*arguments: Any) -> Any:
        return plan()

    timing = Timing(period=0.1, delay=0.02, early=2.5e-4)
    return RecedingHorizonController(plan, again, np.zeros(6), timing, joints=6, gains=(350.0, 120.0), start_time=0.5)


def push() -> Push:
    return Push(cell_at_start()[0].parts.arm.spatula_body, np.zeros(3), (1.0, 2.0), 1.0, 1.5)


def contact_forces() -> ContactForces:
    cell = cell_at_start()[0]
    return ContactForces(cell.plant, cell.parts.arm.spatula_body, cell.parts.table, cell.parts.block)


@cache
def drakes_model() -> tuple[Any, Any, Any]:
    """What MuJoCo's cell is made of, the block on the blade."""
    plant, scene_graph = MultibodyPlant(0.01), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph, add_model(plant, IDEAL, arm_of(IDEAL).home)


def mujoco_plant() -> MujocoPlant:
    return MujocoPlant(*drakes_model(), arm_of(IDEAL).joint_names, 0.01, CELL, pushed=True)


@cache
def pancake_at_start() -> tuple[Any, Any]:
    """The cell with a pancake of the coarsest mesh on the blade, and its diagram."""
    scenario, builder = Scenario().with_overrides({"object.kind": "pancake", "object.refinement": 1}), DiagramBuilder()
    arm, task = arm_of(scenario), scenario.task
    q_start = arm.inverse_kinematics([task.start_y, task.start_z, 0.0, task.start_x, 0.0, 0.0])
    cell = add_pancake_cell(builder, scenario, arm, q_start)
    builder.ExportInput(cell.tau, "tau")
    return cell, builder.Build()


def pancake() -> Pancake:
    seen = pancake_at_start()[0].seen
    at = seen.geometry, seen.surfaces, seen.place
    return Pancake(seen.mesh, 0.1, *at, seen.mesh.vertices, 0.01)


def contacts_of_pancake(seed: int) -> ContactResults:
    """It rests on the blade, lower by some micrometres for another seed."""
    cell, diagram = pancake_at_start()
    context = diagram.CreateDefaultContext()
    diagram.get_input_port().FixValue(context, np.zeros(6))
    cell.stand(context, cell.plant.GetPositions(cell.plant.CreateDefaultContext(), cell.parts.arm.arm))
    mine, model = cell.robot.GetMyMutableContextFromRoot(context), cell.robot.deformable_model()
    vertices = np.array(model.GetPositions(mine, cell.pancake)) - [[0.0], [0.0], [2e-5 * (1 + seed)]]
    model.SetPositions(mine, cell.pancake, vertices)
    found = cell.robot.get_contact_results_output_port().Eval(mine)
    assert found.num_deformable_contacts() == 1
    return found


SYSTEMS = {
    "feedforward": lambda: AccelerationFeedforward(2),
    "pd": lambda: ProportionalDerivative([1.0, 2.0], [3.0, 4.0]),
    "inertia": lambda: NominalInertia([1.0, 2.0]),
    "inertia matrix": lambda: NominalInertia([[1.0, 0.1], [0.1, 2.0]]),
    "observer": lambda: DisturbanceObserver([20.0, 30.0], [1.0, 2.0], 0.01),
    "observer matrix": lambda: DisturbanceObserver([20.0, 30.0], [[1.0, 0.1], [0.1, 2.0]], 0.01),
    "limit": lambda: TorqueLimit([0.1, 5.0]),
    "friction": lambda: JointFriction([1.0, 2.0], [0.1, 0.2], [0.3, 0.4]),
    "sticking": lambda: ElastoPlasticFriction(
        [1.0, 2.0], [1.5, 1.2], [0.1, 0.2], [0.3, 0.4], [2.0, 3.0], [0.1, 0.2], 0.01
    ),
    "ripple": lambda: TorqueRipple([0.1, 0.2], [3.0, 4.0]),
    "encoder": lambda: Encoder([0.01, 0.0]),
    "derivative": lambda: PseudoDerivative([20.0, 30.0], 0.01),
    "inverse jacobian": lambda: InverseJacobian(DiagonalArm(), 2, 2),
    "delay": lambda: Delay(2, 1, 0.01),
    "longer delay": lambda: Delay(2, 3, 0.01),
    "gravity": lambda: GravityCompensation(DiagonalArm(), [0.5, 1.0], 2),
    "tool kinematics": lambda: ToolKinematics(DiagonalArm(), 2, 2),
    "sensor noise": lambda: SensorNoise([0.1, 0.2], 5, 0.01),
    "command": lambda: SinusoidalCommand([1.0, 2.0], [3.0, 4.0]),
    "sinusoidal noise": lambda: SinusoidalNoise([1.0, 2.0], [3.0, 4.0]),
    "broadband noise": lambda: BroadbandNoise([1.0, 2.0], 0.01, [3, 4]),
    "lock-in": lambda: LockIn([1.0, 2.0], 0.01),
    "peak": lambda: Peak(2, 0.01),
    "rms": lambda: RootMeanSquare(2, 0.01),
    "mass": lambda: OneDofPlant([1.0, 2.0], 0.01),
    "mass with signum": lambda: OneDofPlant([1.0, 2.0], 0.01, "signum", 0.1, 0.05),
    "mass with stick-slip": lambda: OneDofPlant([1.0, 2.0], 0.01, "stick-slip", 0.1, 0.05),
    "plan commands": lambda: PlanCommands(plan().states[:4], plan().inputs[:3], np.zeros(6), 0.5, start_time=0.5),
    "mpc": lambda: ModelPredictiveController(plan, np.zeros(6), 0.5),
    "receding horizon": receding,
    "camera": camera,
    "contact forces": contact_forces,
    "push": push,
    "mujoco": mujoco_plant,
    "pancake": pancake,
}
NOT_CONVERTIBLE = ("mpc", "receding horizon", "camera", "contact forces", "push", "mujoco", "pancake")
"""Each says why in its docstring; so does the one without a formula."""
NO_FORMULA = ("sensor noise",)
WITHOUT_EFFECT = {
    ("mass", "parameter1"): "f_c without friction",
    ("mass", "parameter2"): "d without friction",
    ("lock-in", "parameter1"): "both start times lie in the past",
    ("peak", "parameter0"): "both start times lie in the past",
    ("rms", "parameter0"): "both start times lie in the past",
    ("receding horizon", "input0"): "read at events only",
    ("receding horizon", "input1"): "read at events only",
    ("receding horizon", "input2"): "read at events only",
    ("receding horizon", "input3"): "read at events only",
}
"""Changes that must leave the results as they are, and why."""

every_system = pytest.mark.parametrize("name", SYSTEMS)
every_block = pytest.mark.parametrize("name", [name for name in SYSTEMS if name not in NOT_CONVERTIBLE])
every_offset = pytest.mark.parametrize("offset", [0.0, 0.0075])


def our_systems() -> set[type]:
    """All LeafSystem classes that modules of `blocks` and `plants` hold, by discovery."""
    classes = set()
    for package in (flipdiagram.blocks, flipdiagram.plants):
        for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            for value in vars(importlib.import_module(info.name)).values():
                if inspect.isclass(value) and issubclass(value, LeafSystem) and value.__module__ == info.name:
                    classes.add(value)
    return classes - {Block}


def test_no_system_escapes() -> None:
    assert our_systems() == {type(make()) for make in SYSTEMS.values()}
    assert len(our_systems()) >= 25


def fill(block: Any, context: Any, seed: int = 0, **other: int) -> None:
    """Time, inputs, state and parameters all positive and distinct; `other` seeds replace single ones."""
    context.SetTime(1.0 + numbers("time", 1, seed)[0])
    for i in range(block.num_input_ports()):
        fix_input(block, context, i, other.get(f"input{i}", seed))
    for i in range(context.num_numeric_parameter_groups()):
        parameter = context.get_mutable_numeric_parameter(i)
        parameter.SetFromVector(numbers(f"parameter{i}", parameter.size(), other.get(f"parameter{i}", seed)))
    set_state(block, context, other.get("state", seed))


def of_class(block: Any, *classes: type) -> bool:
    """Whether it is of one of these, over any scalar."""
    return type(block).__name__.split("_")[0] in [known.__name__.split("_")[0] for known in classes]


def numbers(key: str, size: int, seed: int) -> np.ndarray:
    return np.random.default_rng([seed, *key.encode()]).uniform(0.2, 1.0, size)


def fix_input(block: Any, context: Any, i: int, seed: int) -> None:
    port = block.get_input_port(i)
    if port.get_name() in ("poses", "body_poses"):
        turned = [RollPitchYaw(*numbers("angles", 3, seed + k)) for k in range(cell_at_start()[0].plant.num_bodies())]
        poses = [RigidTransform(angles, numbers("place", 3, seed + k)) for k, angles in enumerate(turned)]
        port.FixValue(context, Value[list[RigidTransform]](poses))
    elif port.get_name() == "applied":
        force = ExternallyAppliedSpatialForce()
        force.body_index, force.p_BoBq_B = drakes_model()[2].arm.spatula_body.index(), numbers("point", 3, seed)
        force.F_Bq_W = SpatialForce(numbers("moment", 3, seed), numbers("force", 3, seed))
        port.FixValue(context, Value[list[ExternallyAppliedSpatialForce]]([force]))
    elif port.get_name() == "shape":
        shape, mesh = GeometryConfigurationVector(), block.mesh
        bent = mesh.vertices + 1e-3 * numbers("shape", mesh.vertices.size, seed).reshape(-1, 3)
        shape.set_value(block.geometry, bent.ravel())
        port.FixValue(context, shape)
    elif port.get_name() == "contact_results" and of_class(block, Pancake):
        port.FixValue(context, Value[ContactResults](contacts_of_pancake(seed)))
    elif port.get_name() == "contact_results":
        cell, diagram = cell_at_start()
        own = diagram.CreateDefaultContext()
        diagram.get_input_port().FixValue(own, np.zeros(6))
        mine = cell.plant.GetMyMutableContextFromRoot(own)
        centre = cell.plant.GetFreeBodyPose(mine, cell.parts.block).translation()
        cell.plant.SetFreeBodyPose(mine, cell.parts.block, RigidTransform(centre - [0.0, 0.0, 1e-4 * (1 + seed)]))
        results = cell.plant.get_contact_results_output_port().Eval(mine)
        assert results.num_hydroelastic_contacts() == 1
        port.FixValue(context, Value[ContactResults](results))
    else:
        # an encoder's input spans several of its steps
        port.FixValue(context, numbers(f"input{i}", port.size(), seed) * (10.0 if of_class(block, Encoder) else 1.0))


def set_state(block: Any, context: Any, seed: int) -> None:
    if context.num_discrete_state_groups():
        state = numbers("state", context.num_total_states(), seed)
        counts = of_class(block, Camera, SensorNoise, BroadbandNoise)
        if of_class(block, MujocoPlant):  # touching, or no torque would change the contact
            plant, _, parts = drakes_model()
            X_WB = parts.arm.control_point.CalcPoseInWorld(plant.CreateDefaultContext())
            block.put(context, arm_of(IDEAL).home, RigidTransform([0.0, 0.0, -1e-5 * (1 + seed)]) @ X_WB)
        else:
            if of_class(block, ElastoPlasticFriction):
                state *= [10.0, 0.1]  # the first joint slides, the second sticks
            context.SetDiscreteState(np.floor(100 * state) if counts else state)
    if context.num_abstract_states():
        block.set_plan(context, replace(plan(), states=plan().states + 0.1 * seed, solve_time=0.1 + seed))


def number_of(port: Any, context: Any) -> np.ndarray:
    """What an output is, forces and poses as arrays."""
    value = port.Eval(context)
    if port.get_data_type() == PortDataType.kVectorValued:
        return np.array(value)
    poses = port.get_name() == "poses"
    return np.concatenate([x.GetAsMatrix34().ravel() if poses else x.F_Bq_W.translational() for x in value])


def results(block: Any, context: Any) -> np.ndarray:
    """All outputs and the state after the next update."""
    values = [number_of(block.get_output_port(i), context) for i in range(block.num_output_ports())]
    if context.num_discrete_state_groups():
        values.append(block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector())
    return np.concatenate(values)


def keys_of(block: Any, context: Any) -> list[str]:
    keys = [f"input{i}" for i in range(block.num_input_ports())]
    keys += [f"parameter{i}" for i in range(context.num_numeric_parameter_groups())]
    return keys + ["state"] * (context.num_discrete_state_groups() + context.num_abstract_states())


def change(block: Any, context: Any, key: str) -> None:
    """Change that one thing alone, so that nothing else invalidates the cache."""
    if key == "state":
        set_state(block, context, 1)
    elif key.startswith("input"):
        fix_input(block, context, int(key[-1]), 1)
    else:
        parameter = context.get_mutable_numeric_parameter(int(key[-1]))
        parameter.SetFromVector(numbers(key, parameter.size(), 1))


@every_system
def test_no_result_is_stale(name: str) -> None:
    """After any one change a context that was evaluated before agrees with a fresh one, and differs from itself."""
    block = SYSTEMS[name]()
    used = block.CreateDefaultContext()
    for key in keys_of(block, used):
        fill(block, used)
        before = results(block, used)
        change(block, used, key)
        fresh = block.CreateDefaultContext()
        fill(block, fresh, **{key: 1})
        after = results(block, used)
        assert np.array_equal(after, results(block, fresh), equal_nan=True), key
        assert np.array_equal(after, before) == ((name, key) in WITHOUT_EFFECT), key


@every_system
def test_feedthrough_is_declared_exactly_where_it_is(name: str) -> None:
    """Without caching, an output changes at once with those inputs alone that Drake is told of."""
    block = SYSTEMS[name]()
    for i in range(block.num_input_ports()):
        context = block.CreateDefaultContext()
        context.DisableCaching()
        for j in range(block.num_output_ports()):
            port = block.get_output_port(j)
            fill(block, context)
            before = number_of(port, context)
            fix_input(block, context, i, 1)
            real = not np.array_equal(number_of(port, context), before, equal_nan=True)
            assert block.HasDirectFeedthrough(i, j) == real, (block.get_input_port(i).get_name(), port.get_name())


@every_system
def test_the_state_is_in_the_context_and_all_is_deterministic(name: str) -> None:
    """Contexts of one system, and two systems made alike, give the same, whatever was evaluated between."""
    block, twin = SYSTEMS[name](), SYSTEMS[name]()
    kept = attributes(block)
    one, other = block.CreateDefaultContext(), block.CreateDefaultContext()
    for context in (one, other):
        context.DisableCaching()
    fill(block, one)
    before = results(block, one)
    fill(block, other, seed=1)
    results(block, other)
    assert np.array_equal(results(block, one), before, equal_nan=True)
    alike = twin.CreateDefaultContext()
    fill(twin, alike)
    assert np.array_equal(results(twin, alike), before, equal_nan=True)
    assert attributes(block) == kept


def attributes(block: Any) -> dict[str, Any]:
    """What is on `self`: the numbers of arrays, and which object each other attribute is."""
    own = {key: value for key, value in vars(block).items() if not key.startswith("_pydrake")}
    return {key: value.tolist() if isinstance(value, np.ndarray) else id(value) for key, value in own.items()}


@every_block
@pytest.mark.parametrize("form", ["ToAutoDiffXd", "ToSymbolic"])
def test_other_scalars_give_the_same_numbers(name: str, form: str) -> None:
    block = SYSTEMS[name]()
    if form == "ToSymbolic" and name in NO_FORMULA:
        assert block.ToSymbolicMaybe() is None and "Expression" in str(type(block).__doc__)
        return
    context = block.CreateDefaultContext()
    fill(block, context)
    converted = getattr(block, form)()
    other = converted.CreateDefaultContext()
    fill(converted, other)
    values = [v.value() if form == "ToAutoDiffXd" else v.Evaluate() for v in results(converted, other)]
    assert values == pytest.approx(results(block, context), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("name", NOT_CONVERTIBLE)
def test_what_is_not_converted_says_why(name: str) -> None:
    block = SYSTEMS[name]()
    assert block.ToAutoDiffXdMaybe() is None and block.ToSymbolicMaybe() is None
    assert "Not scalar-convertible: " in str(type(block).__doc__)


@every_block
def test_converted_blocks_keep_ports_sampling_and_defaults(name: str) -> None:
    block = SYSTEMS[name]()
    converted = block.ToAutoDiffXd() if name in NO_FORMULA else block.ToAutoDiffXd().ToSymbolic()
    for side in ("input", "output"):
        names = [
            [getattr(s, f"get_{side}_port")(i).get_name() for i in range(getattr(s, f"num_{side}_ports")())]
            for s in (block, converted)
        ]
        assert names[0] == names[1]
    assert block.num_continuous_states() == 0
    context, other = block.CreateDefaultContext(), converted.CreateDefaultContext()
    for i in range(context.num_numeric_parameter_groups()):
        values = [
            e.Evaluate() if hasattr(e, "Evaluate") else e.value() for e in other.get_numeric_parameter(i).CopyToVector()
        ]
        assert values == context.get_numeric_parameter(i).CopyToVector().tolist()
    if context.num_discrete_state_groups():
        timings = [s.GetUniquePeriodicDiscreteUpdateAttribute() for s in (block, converted)]
        assert timings[0].period_sec() == timings[1].period_sec() == 0.01


@every_system
def test_every_system_says_what_it_is(name: str) -> None:
    """Its ports by their names, with units and shapes."""
    block = SYSTEMS[name]()
    doc = str(type(block).__doc__)
    assert "utput" in doc and "[" in doc and re.search(r"\((n|m|\d+( n)?),\)|p \(3,\)", doc)
    ports = [block.get_input_port(i) for i in range(block.num_input_ports())]
    ports += [block.get_output_port(i) for i in range(block.num_output_ports())]
    assert not [port.get_name() for port in ports if not re.search(rf"\b{port.get_name()}\b", doc)]


@every_offset
def test_a_delay_gives_back_its_input_after_exactly_so_many_periods(offset: float) -> None:
    """Random inputs through a simulated diagram, seen by a sampled reader of the same offset."""
    period, periods, ticks = 0.01, 3, 12
    sent = np.random.default_rng(7).uniform(-1.0, 1.0, (2, ticks + 1))
    builder = DiagramBuilder()
    # each value stands from a period before its sample, so that no rounding of k·T decides which one is read
    breaks = period * (np.arange(ticks + 1) - 0.5) + offset
    source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.ZeroOrderHold(breaks, sent)))
    delay = builder.AddSystem(Delay(2, periods, period, offset, [5.0, 6.0]))
    reader = builder.AddSystem(Delay(2, 1, period, offset))
    builder.Connect(source.get_output_port(), delay.get_input_port())
    builder.Connect(delay.get_output_port(), reader.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
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
    block.set_parameters(context, fraction=[1.0, 0.0])
    assert block.GetOutputPort("tau_gravity").Eval(context) == pytest.approx([9.81, 0.0])
    assert feedthrough_of(block) == {("q", "tau_gravity")}
    with pytest.raises(InputError, match="fraction"):
        block.set_parameters(context, fraction=-0.1)
