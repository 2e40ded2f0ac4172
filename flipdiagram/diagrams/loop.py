"""Controller and cell closed into one diagram: the whole of Fig. 4."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import VectorLogSink, ZeroOrderHold

from flipdiagram.arrays import Floats
from flipdiagram.blocks.camera import Camera
from flipdiagram.blocks.delay import Delay
from flipdiagram.blocks.mpc import COMMANDS, ModelPredictiveController
from flipdiagram.blocks.noise import SensorNoise
from flipdiagram.blocks.receding_horizon import RecedingHorizonController, Timing
from flipdiagram.blocks.sensors import Encoder, PseudoDerivative
from flipdiagram.diagrams.controller import ControllerBoxes, add_controller
from flipdiagram.diagrams.replacement import Box, build_diagram
from flipdiagram.diagrams.start import Start, start_of
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import Planner
from flipdiagram.planning.replanner import FEWEST, Replanner
from flipdiagram.plants.cell import BESIDE_THE_PLANT, Cell, add_cell
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

REPLANNING = ("solve_time", "iterations", "status", "cone_margin")
"""Signals of an MPC that replans, beside the commands."""


@dataclass(frozen=True)
class Loop:
    """The closed loop and handles to its boxes; `context()` starts a run at rest with the block on the blade."""

    diagram: Diagram
    scenario: Scenario
    architecture: str
    arm: ArmModel
    mpc: ModelPredictiveController
    boxes: ControllerBoxes
    cell: Cell
    q_start: Floats
    logs: dict[str, VectorLogSink]
    """Sinks by signal name, where the loop was built with `record`."""
    replaced: tuple[str, ...] = ()
    """Boxes that are of the user's own."""

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Systems that a drawing shows as one box, by its name: all of the cell as `robot`."""
        return {"robot": (self.cell.plant.get_name(), *BESIDE_THE_PLANT)}

    def context(self, plan: Plan | None = None) -> Context:
        """A fresh context: arm at rest at the start pose, block on the blade; with `plan` the MPC need not solve."""
        context = self.diagram.CreateDefaultContext()
        if plan is not None:
            self.mpc.set_plan(self.mpc.GetMyMutableContextFromRoot(context), plan)
        return context


def build_loop(
    scenario: Scenario,
    architecture: str = "pd+ff+dob",
    planner: Callable[[], Plan] | None = None,
    record: bool = False,
    replace: Mapping[str, Box] | None = None,
    meshcat: Meshcat | None = None,
) -> Loop:
    """Wire MPC, controller, sensors and cell of a scenario into one diagram, boxes named as in Fig. 4.

    Args:
        scenario: what is simulated.
        architecture: one of `ARCHITECTURES`.
        planner: what the MPC calls at the start of a run, by default the scenario's own.
        record: add sinks that log the signals every controller period.
        replace: boxes of the user's own by name, {"pd": MyController}, see `replacement.with_replaced`.
        meshcat: where to show the cell.

    Raises:
        InputError: for an unknown architecture, a bad number or a box that does not fit.
        PlanningError: where the arm cannot be at the start pose.
    """
    arm, period = arm_of(scenario), scenario.controller.period
    motion = Planner(scenario, arm)
    start = start_of(motion)
    # A plant with a finer step takes the torque of the sample before its own: sampling between two of its steps, after
    # the one that led to t and before the one that leaves it, adds no delay.
    fine = scenario.simulation.step < period
    offset = period - scenario.simulation.step / 2 if fine else 0.0

    builder = DiagramBuilder()
    mpc = builder.AddNamedSystem("mpc", _mpc(scenario, motion, start, planner or motion.plan))
    cell = add_cell(builder, scenario, arm, start.q)
    q, qd = _sensed(builder, scenario, cell, start.q, offset)
    signals = {**{name: mpc.GetOutputPort(name) for name in COMMANDS}, "q": q, "qd": qd}
    boxes = add_controller(builder, scenario, architecture, arm, start.q, signals, offset, replace)
    if isinstance(mpc, RecedingHorizonController):
        _close_horizon(builder, scenario, mpc, cell, boxes, q)
    tau = boxes.torque_limit.GetOutputPort("tau")
    if fine:
        hold = builder.AddNamedSystem("hold", ZeroOrderHold(period, arm.n_joints, offset))
        builder.Connect(tau, hold.get_input_port())
        tau = hold.get_output_port()
    builder.Connect(tau, cell.tau)

    logs = _record(builder, mpc, boxes, cell, tau, period) if record else {}
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, cell.scene_graph, meshcat)
    diagram = build_diagram(builder, replace)
    diagram.set_name(architecture)
    return Loop(diagram, scenario, architecture, arm, mpc, boxes, cell, start.q, logs, tuple(replace or ()))


def _record(
    builder: DiagramBuilder, mpc: LeafSystem, boxes: ControllerBoxes, cell: Cell, tau: OutputPort, period: float
) -> dict[str, VectorLogSink]:
    """Sinks for what a recording is made of, by signal name."""
    names = (*COMMANDS, *REPLANNING) if isinstance(mpc, RecedingHorizonController) else COMMANDS
    signals = {name: mpc.GetOutputPort(name) for name in names}
    signals |= {"state": cell.plant.get_state_output_port(), "tau": tau, "contact_wrench": cell.contact_wrench}
    if boxes.disturbance_observer is not None:
        signals["tau_dis"] = boxes.disturbance_observer.GetOutputPort("tau_dis")
    logs = {}
    for name, port in signals.items():
        logs[name] = builder.AddNamedSystem(f"log_{name}", VectorLogSink(port.size(), period))
        builder.Connect(port, logs[name].get_input_port())
    return logs


def _mpc(scenario: Scenario, motion: Planner, start: Start, planner: Callable[[], Plan]) -> ModelPredictiveController:
    """The MPC of the scenario: it plans once, or again and again."""
    settings, start_time = scenario.planner, scenario.simulation.hold_time
    if settings.replan_period is None:
        off = scenario.disturbance.start_error != 0
        return ModelPredictiveController(planner, start.pose, start_time, stand=off)
    timing = Timing(
        settings.replan_period,
        settings.compute_delay,
        settings.blend_time,
        scenario.controller.period / 4,
        settings.replan_deadline,
    )
    return RecedingHorizonController(
        planner,
        Replanner(scenario, motion.arm).replan,
        start.pose,
        timing,
        joints=motion.arm.n_joints,
        start_time=start_time,
        measured=settings.replan_from == "measured",
        fewest=FEWEST,
    )


def _close_horizon(
    builder: DiagramBuilder,
    scenario: Scenario,
    mpc: RecedingHorizonController,
    cell: Cell,
    boxes: ControllerBoxes,
    q: OutputPort,
) -> None:
    """What a replanning MPC measures: the tool, the joints and, where there is a camera, the object on the blade."""
    for name in ("x", "v"):
        builder.Connect(boxes.tool_kinematics.GetOutputPort(name), mpc.GetInputPort(name))
    builder.Connect(q, mpc.GetInputPort("q"))
    sensors = scenario.sensors
    if sensors.camera_period is not None:
        camera = Camera(
            cell.parts.arm.tool,
            cell.parts.block,
            sensors.camera_period,
            sensors.camera_delay,
            sensors.camera_noise,
            sensors.camera_seed,
            offset=scenario.controller.period / 2,
        )
        builder.AddNamedSystem("camera", camera)
        builder.Connect(cell.plant.get_body_poses_output_port(), camera.get_input_port())
        builder.Connect(camera.get_output_port(), mpc.GetInputPort("shift"))


def _sensed(
    builder: DiagramBuilder, scenario: Scenario, cell: Cell, q_start: Floats, offset: float
) -> tuple[OutputPort, OutputPort]:
    """q and qd as the controller sees them: through what the scenario has of noise, encoder, delay, velocity filter.

    The encoder rounds angles that are noisy already.  Noise of the velocities comes before their delay, or after the
    filter where there is one: it belongs to the velocity, however that is measured.
    """
    sensors, period, n = scenario.sensors, scenario.controller.period, len(q_start)

    def through(box: LeafSystem, name: str, signal: OutputPort) -> OutputPort:
        builder.AddNamedSystem(name, box)
        builder.Connect(signal, box.get_input_port())
        return box.get_output_port()

    def noisy(signal: OutputPort, name: str, deviation: float, stream: int) -> OutputPort:
        if deviation == 0:
            return signal
        return through(SensorNoise(np.full(n, deviation), sensors.noise_seed, period, offset, stream), name, signal)

    q, qd = noisy(cell.q, "position_noise", sensors.position_noise, 0), cell.qd
    if sensors.encoder_resolution > 0:
        q = through(Encoder(np.full(n, sensors.encoder_resolution)), "encoder", q)
    if sensors.delay > 0:
        q = through(Delay(n, sensors.delay, period, offset, q_start), "delayed_q", q)
    if sensors.velocity_cutoff is not None:
        g_v = np.full(n, sensors.velocity_cutoff)
        qd = through(PseudoDerivative(g_v, period, offset, q_start), "velocity", q)
    qd = noisy(qd, "velocity_noise", sensors.velocity_noise, 1)
    if sensors.velocity_cutoff is None and sensors.delay > 0:
        qd = through(Delay(n, sensors.delay, period, offset), "delayed_qd", qd)
    return q, qd
