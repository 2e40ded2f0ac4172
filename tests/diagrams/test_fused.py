"""A diagram of Blocks as one box: equal to it tick by tick, and refused where a law is not known."""

import subprocess
import sys

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import PassThrough
from robots import PANDA, package_file
from shared import ideal_flip, ideal_plan

from flipdiagram.blocks.commands import SinusoidalCommand
from flipdiagram.blocks.observer import DisturbanceObserver
from flipdiagram.blocks.pd import ProportionalDerivative
from flipdiagram.diagrams.controller import add_controller, build_controller
from flipdiagram.diagrams.fused import Fused, NotFusible
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.native_controller import add_native_controller
from flipdiagram.diagrams.sensing import add_sensing
from flipdiagram.errors import SimulationError
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.simulate import simulate

SIGNALS = ("x_cmd", "v_cmd", "a_cmd", "q", "qd")


def controller(architecture, arm, **fields):
    return build_controller(IDEAL.with_overrides(fields), architecture, arm)


def sent(system, ticks):
    """The torques of a controller that sees these inputs, one dict a period."""
    context = system.CreateDefaultContext()
    simulator, torques = Simulator(system, context), []
    simulator.Initialize()
    for k, inputs in enumerate(ticks):
        for name, value in inputs.items():
            system.GetInputPort(name).FixValue(context, value)
        torques.append(system.GetOutputPort("tau").Eval(context).copy())
        simulator.AdvanceTo((k + 1) * 0.001)
    return np.array(torques)


def _about(name, arm):
    return {"q": arm.home, "x_cmd": arm.task_position(arm.home)}.get(name, 0.0)


def random_ticks(arm, count=40):
    rng = np.random.default_rng(3)
    sizes = {"x_cmd": 6, "v_cmd": 6, "a_cmd": 6, "q": arm.n_joints, "qd": arm.n_joints}
    return [
        {name: _about(name, arm) + 0.01 * rng.normal(size=size) for name, size in sizes.items()} for _ in range(count)
    ]


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("fields", [{}, {"controller.gravity_compensation": 0.7}], ids=["figure", "gravity"])
def test_it_has_the_bits_of_the_diagram(architecture, fields):
    arm = arm_of(IDEAL)
    torques = [
        sent(system, random_ticks(arm))
        for system in (controller(architecture, arm, **fields), Fused(controller(architecture, arm, **fields)))
    ]
    np.testing.assert_array_equal(*torques)
    assert np.ptp(torques[0], axis=0).min() > 0.01


def flip_ticks():
    """What the controller sees in the default flip."""
    flip, hold, ticks = ideal_flip().recording, np.array([0.5, 0.0, 0.0]), []
    for k in range(flip.sizes["time"]):
        commands = {
            name: np.append(flip[name].values[k], hold if name == "x_cmd" else np.zeros(3)) for name in SIGNALS[:3]
        }
        ticks.append(commands | {name: flip[name].values[k] for name in ("q", "qd")})
    return ticks


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_the_native_controller_sends_the_torques_of_the_boxes_over_a_flip(architecture):
    """Along one recording: in the loop contact would amplify the rounding."""
    arm, ticks = arm_of(IDEAL), flip_ticks()
    boxes = sent(controller(architecture, arm), ticks)
    box = Fused(controller(architecture, native_arm(arm)), native=True)
    assert box.is_native
    native = sent(box, ticks)
    np.testing.assert_allclose(native, boxes, atol=1e-12 * np.abs(boxes).max())
    assert np.abs(boxes).max() > 10.0


@pytest.mark.parametrize("architecture", ["pd", "pd+ff+dob"])
def test_so_does_that_of_an_arm_of_seven_joints(architecture):
    scenario = IDEAL.with_overrides(PANDA | {"arm.file": package_file(PANDA["arm.file"])})
    arm = arm_of(scenario)
    ticks = random_ticks(arm, 400)
    boxes, native = (
        sent(box, ticks)
        for box in (
            build_controller(scenario, architecture, arm),
            Fused(build_controller(scenario, architecture, native_arm(arm)), native=True),
        )
    )
    np.testing.assert_allclose(native, boxes, atol=1e-12 * np.abs(boxes).max())
    assert np.ptp(boxes, axis=0).min() > 0.01


SENSORS = {
    "documented": {},
    "noisy": {"sensors.position_noise": 1e-4, "sensors.velocity_noise": 0.01, "sensors.delay": 3},
    "exact velocity": {"sensors.velocity_cutoff": None, "sensors.velocity_noise": 0.01, "sensors.delay": 2},
}


def sensed_controller(scenario, native):
    """Sensors and controller with the figure's inputs, as boxes or as one."""
    builder, arm = DiagramBuilder(), arm_of(scenario)
    arm = native_arm(arm) if native else arm
    ports = {}
    for name, size in {"x_cmd": 6, "v_cmd": 6, "a_cmd": 6, "q": arm.n_joints, "qd": arm.n_joints}.items():
        entry = builder.AddNamedSystem(name, PassThrough(size))
        builder.ExportInput(entry.get_input_port(), name)
        ports[name] = entry.get_output_port()
    if native:
        seen, boxes = add_native_controller(builder, scenario, "pd+ff+dob", arm, arm.home, ports)
    else:
        seen = add_sensing(builder, scenario, arm, ports["q"], ports["qd"], arm.home, 0.0)
        signals = ports | {"q": seen.q, "qd": seen.qd}
        boxes = add_controller(builder, scenario, "pd+ff+dob", arm, arm.home, signals)
    builder.ExportOutput(boxes.output("tau"), "tau")
    return builder.Build(), seen


@pytest.mark.parametrize("fields", SENSORS.values(), ids=SENSORS.keys())
def test_sensors_are_in_the_box_too(fields):
    scenario = Scenario().with_overrides(fields)
    ticks = flip_ticks()[::5]
    systems = [sensed_controller(scenario, native)[0] for native in (False, True)]
    assert systems[1].GetSubsystemByName("controller").is_native
    boxes, native = (sent(system, ticks) for system in systems)
    np.testing.assert_allclose(native, boxes, atol=1e-12 * np.abs(boxes).max())
    assert np.abs(boxes).max() > 10.0


def test_sensors_in_the_box_have_seen_and_measure_exactly_as_boxes_do():
    scenario, torques = Scenario().with_overrides(SENSORS["noisy"]), []
    for native in (False, True):
        system, seen = sensed_controller(scenario, native)
        context, arm = system.CreateDefaultContext(), arm_of(scenario)
        for name, value in random_ticks(arm, 1)[0].items():
            system.GetInputPort(name).FixValue(context, value)
        told = []
        for change in (seen.without_error, lambda context, seen=seen, q=arm.home + 0.003: seen.have_seen(context, q)):
            change(context)
            told.append(system.GetOutputPort("tau").Eval(context).copy())
        torques.append(told)
    np.testing.assert_allclose(torques[1], torques[0], atol=1e-10)
    assert np.abs(np.diff(torques[0], axis=0)).max() > 1.0


def test_laws_that_cannot_be_compiled_are_called_as_they_are():
    """The kinematics of Drake's own arm."""
    arm = arm_of(IDEAL)
    box = Fused(controller("pd+dob", arm), native=True)
    assert not box.is_native
    np.testing.assert_array_equal(
        sent(box, random_ticks(arm, 5)), sent(controller("pd+dob", arm), random_ticks(arm, 5))
    )


def test_gravity_is_compensated_by_machine_code_too():
    arm, fields = arm_of(IDEAL), {"controller.gravity_compensation": 0.7}
    box = Fused(controller("pd+dob", native_arm(arm), **fields), native=True)
    assert box.is_native
    expected = sent(controller("pd+dob", arm, **fields), random_ticks(arm, 5))
    np.testing.assert_allclose(sent(box, random_ticks(arm, 5)), expected, atol=1e-9)
    assert np.abs(expected - sent(controller("pd+dob", arm), random_ticks(arm, 5))).max() > 1.0


def test_at_a_singular_pose_it_says_what_the_boxes_say():
    arm = arm_of(IDEAL)
    tick = {name: 0.0 * value for name, value in random_ticks(arm, 1)[0].items()}
    messages = []
    for box in (controller("pd", arm), Fused(controller("pd", native_arm(arm)), native=True)):
        with pytest.raises(SimulationError) as error:
            sent(box, [tick])
        messages.append(str(error.value))
    assert messages[0] == messages[1]


FRESH = """
import numpy as np
from flipdiagram.diagrams.fused import Fused
from flipdiagram.diagrams.controller import add_controller, build_controller
from flipdiagram.errors import SimulationError
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from numba.core import event
with event.install_recorder("numba:compile") as compiled:
    assert Fused(build_controller(Scenario(), "pd", native_arm(arm_of(Scenario()))), native=True).is_native
print(len(compiled.buffer))
"""


def test_a_fresh_process_finds_the_machine_code():
    counts = [
        int(subprocess.run([sys.executable, "-c", FRESH], capture_output=True, text=True, check=True).stdout)
        for _ in range(2)
    ]
    assert counts[1] == 0


def test_runs_use_it_unless_a_box_is_the_users_own():
    plan = ideal_plan()
    scenario = IDEAL.with_overrides({"simulation.hold_time": 0.02, "simulation.settle_time": 0.0})
    gains = np.full(6, 350.0), np.full(6, 120.0)
    own = {"pd": lambda: ProportionalDerivative(*gains)}
    runs = [simulate(scenario, "pd+dob", plan, replace=replace).recording for replace in (None, own)]
    np.testing.assert_allclose(*(run["tau"].values[:40] for run in runs), atol=1e-9)
    assert build_loop(scenario, "pd+dob", native=True).diagram.HasSubsystemNamed("controller")
    assert not build_loop(scenario, "pd+dob", native=True, replace=own).diagram.HasSubsystemNamed("controller")


def test_a_tick_of_its_law_stands_in_its_state():
    """Two Contexts of one box share nothing."""
    arm = arm_of(IDEAL)
    box, ticks = Fused(controller("pd+dob", arm)), random_ticks(arm, 5)
    first = sent(box, ticks)
    np.testing.assert_array_equal(first, sent(box, ticks))


class Foreign(LeafSystem):
    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("u", 1)
        self.DeclareVectorOutputPort("y", 1, lambda context, output: output.set_value([0.0]))


def observers(*periods):
    builder = DiagramBuilder()
    for k, period in enumerate(periods):
        box = builder.AddNamedSystem(f"observer{k}", DisturbanceObserver(1.0, 1.0, period))
        for i in range(2):
            builder.ExportInput(box.get_input_port(i), f"u{k}{i}")
        builder.ExportOutput(box.get_output_port(), f"y{k}")
    return builder.Build()


def alone(box):
    builder = DiagramBuilder()
    builder.AddNamedSystem("box", box)
    for i in range(box.num_input_ports()):
        builder.ExportInput(box.get_input_port(i), f"u{i}")
    builder.ExportOutput(box.get_output_port(0), "y")
    return builder.Build()


@pytest.mark.parametrize(
    "diagram, name",
    [
        (lambda: alone(Foreign()), "box"),
        (lambda: alone(SinusoidalCommand(1.0, 1.0)), "box"),
        (lambda: observers(0.001, 0.002), "observer0, observer1"),
    ],
    ids=["no Block", "reads the time", "two sample times"],
)
def test_what_cannot_be_fused_is_named(diagram, name):
    with pytest.raises(NotFusible, match=name):
        Fused(diagram())
