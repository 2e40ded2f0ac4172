"""Controller and cell closed into one diagram: the whole of Fig. 4."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import VectorLogSink

from flipdiagram.arrays import Floats
from flipdiagram.blocks.camera import Camera
from flipdiagram.blocks.mpc import COMMANDS, ModelPredictiveController
from flipdiagram.blocks.receding_horizon import RecedingHorizonController, Timing
from flipdiagram.diagrams.controller import ControllerBoxes, add_controller
from flipdiagram.diagrams.drive import Drive, add_drive
from flipdiagram.diagrams.equilibrium import Equilibrium, equilibrium, no_equilibrium
from flipdiagram.diagrams.native_controller import NativeController, add_native_controller
from flipdiagram.diagrams.replacement import Box, build_diagram
from flipdiagram.diagrams.sensing import Sensing, add_sensing
from flipdiagram.diagrams.start import Start, start_of
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import Planner
from flipdiagram.planning.replanner import Replanner, Replanning
from flipdiagram.plants.cell import add_cell
from flipdiagram.plants.handle import Cell
from flipdiagram.plants.mujoco_cell import add_mujoco_cell
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

Controller = ControllerBoxes | NativeController
ENGINES: dict[str, Callable[[DiagramBuilder, Scenario, ArmModel, Floats], Cell]] = {
    "drake": add_cell,
    "mujoco": add_mujoco_cell,
}
"""What adds a cell, by `simulation.engine`."""
SATURATED = 1e-6
"""Relative distance to a torque limit below which a joint counts as too weak."""
REPLANNING = ("solve_time", "iterations", "status", "cone_margin", "replanned", "failed", "late")
"""Signals of an MPC that replans, beside the commands."""


@dataclass(frozen=True)
class Loop:
    """The closed loop and handles to its boxes; `context()` starts a run as the scenario's `simulation.start` says."""

    diagram: Diagram
    scenario: Scenario
    architecture: str
    arm: ArmModel
    mpc: ModelPredictiveController
    sensing: Sensing
    drive: Drive
    boxes: Controller
    cell: Cell
    q_start: Floats
    """Joint angles of the start pose (n,) [rad]."""
    logs: dict[str, VectorLogSink]
    """Sinks by signal name, where the loop was built with `record`."""
    replaced: tuple[str, ...] = ()
    """Boxes that are of the user's own."""

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Systems that a drawing shows as one box, by its name: all of the cell as `robot`."""
        return {"robot": self.cell.systems}

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Where an endless hold of the start pose ends; raises NoEquilibriumError where it ends nowhere."""
        context = self.diagram.CreateDefaultContext()
        self.sensing.without_error(context)
        found = equilibrium(self.boxes.systems, self._tau, context, self._stand, self._holding_torque, self.q_start)
        weak = np.abs(self._holding_torque(found.q)) >= self.arm.tau_max * (1 - SATURATED)
        if weak.any():
            joint = int(np.argmax(weak))
            limit = f"{self.arm.tau_max[joint]:.3g} N m"
            raise no_equilibrium(f"joint {self.arm.joint_names[joint]} would need more than its {limit}")
        self._stand(context, found.q)
        wrench = self.cell.contact_wrench.Eval(self.cell.contact_wrench.get_system().GetMyContextFromRoot(context))
        if np.any(wrench[3:9]):
            raise no_equilibrium("the table would carry the blade or the block")
        return found

    def context(self, plan: Plan | None = None) -> Context:
        """A fresh context: arm at rest, block on the blade; with `plan` the MPC need not solve.

        Raises NoEquilibriumError where the run shall start at an equilibrium and there is none.
        """
        context = self.diagram.CreateDefaultContext()
        if self.scenario.simulation.start == "equilibrium":
            self._stand(context, self.equilibrium.q)
            self.equilibrium.put(self.boxes.systems, context)
            self.drive.have_sent(context, self._tau.Eval(self._tau.get_system().GetMyContextFromRoot(context)))
        elif self.cell.parts.gears is not None:
            self._stand(context, self.q_start)  # brakes hold the rotors: the gears carry the arm already
        if plan is not None:
            self.mpc.set_plan(self.mpc.GetMyMutableContextFromRoot(context), plan)
        return context

    @property
    def _tau(self) -> OutputPort:
        tau = self.boxes.output("tau")
        assert tau is not None
        return tau

    def _holding_torque(self, q: Floats) -> Floats:
        return self.cell.holding_torque(q) - self.drive.ripple(q)

    def _stand(self, context: Context, q: Floats) -> None:
        self.cell.stand(context, q)
        self.sensing.have_seen(context, q)


def build_loop(
    scenario: Scenario,
    architecture: str = "pd+ff+dob",
    planner: Callable[[], Plan] | None = None,
    record: bool = False,
    replace: Mapping[str, Box] | None = None,
    meshcat: Meshcat | None = None,
    native: bool = False,
    replanner: Callable[[], Replanning] | None = None,
) -> Loop:
    """Wire MPC, controller, sensors and cell of a scenario into one diagram, boxes named as in Fig. 4.

    Args:
        scenario: what is simulated.
        architecture: one of `ARCHITECTURES`.
        planner: what the MPC calls at the start of a run, by default the scenario's own.
        record: add sinks that log the signals every controller period.
        replace: boxes of the user's own by name, {"pd": MyController}, see `replacement.with_replaced`.
        meshcat: where to show the cell.
        native: the controller as one box that computes the same, to rounding, in a fraction of the time; its boxes are
            then none of the diagram's.  Not with boxes of the user's own.
        replanner: what makes that by which an MPC plans again, by default a `Replanner` of the scenario.

    Raises:
        InputError: for an unknown architecture, a bad number or a box that does not fit.
        PlanningError: where the arm cannot be at the start pose.
    """
    native = native and not replace
    arm, period = arm_of(scenario), scenario.controller.period
    arm = native_arm(arm) if native else arm
    motion = Planner(scenario, arm)
    start = start_of(motion)
    # A plant with a finer step takes the torque of the sample before its own: sampling between two of its steps, after
    # the one that led to t and before the one that leaves it, adds no delay.
    fine = scenario.simulation.step < period
    offset = period - scenario.simulation.step / 2 if fine else 0.0

    def motion_again() -> Replanning:
        return Replanner(scenario, arm)

    builder = DiagramBuilder()
    mpc = builder.AddNamedSystem(
        "mpc", _mpc(scenario, architecture, start, planner or motion.plan, replanner or motion_again)
    )
    cell = ENGINES[scenario.simulation.engine](builder, scenario, arm, start.q)
    seen = add_sensing(builder, scenario, arm, cell.q, cell.qd, start.q, offset)
    signals = {**{name: mpc.GetOutputPort(name) for name in COMMANDS}, "q": seen.q, "qd": seen.qd}
    boxes: Controller
    if native:
        boxes = add_native_controller(builder, scenario, architecture, arm, start.q, signals, offset)
    else:
        boxes = add_controller(builder, scenario, architecture, arm, start.q, signals, offset, replace)
    if isinstance(mpc, RecedingHorizonController):
        _close_horizon(builder, scenario, mpc, cell, boxes, seen.q)
    tau = boxes.output("tau")
    drive = add_drive(builder, scenario, arm, tau, cell.q, offset)
    builder.Connect(drive.tau, cell.tau)

    logs = _record(builder, mpc, boxes, cell, seen, drive.sent, period) if record else {}
    if meshcat is not None:
        cell.show(builder, meshcat)
    diagram = build_diagram(builder, replace)
    diagram.set_name(architecture)
    return Loop(
        diagram, scenario, architecture, arm, mpc, seen, drive, boxes, cell, start.q, logs, tuple(replace or ())
    )


def _record(
    builder: DiagramBuilder,
    mpc: LeafSystem,
    boxes: Controller,
    cell: Cell,
    seen: Sensing,
    tau: OutputPort,
    period: float,
) -> dict[str, VectorLogSink]:
    """Sinks for what a recording is made of, by signal name."""
    names = (*COMMANDS, *REPLANNING) if isinstance(mpc, RecedingHorizonController) else COMMANDS
    signals = {name: mpc.GetOutputPort(name) for name in names}
    signals |= {"q": cell.q_link, "qd": cell.qd_link, "block": cell.block, "contact_wrench": cell.contact_wrench}
    signals |= {name: port for name in ("tau_cmd", "tau_dis") if (port := boxes.output(name)) is not None}
    elastic = cell.q_link is not cell.q
    signals |= {"tau": tau} | ({"qd_motor": cell.qd} if elastic else {})
    if seen.boxes or elastic:
        signals |= {"q_meas": seen.q, "qd_meas": seen.qd}
    logs = {}
    for name, port in signals.items():
        logs[name] = builder.AddNamedSystem(f"log_{name}", VectorLogSink(port.size(), period))
        builder.Connect(port, logs[name].get_input_port())
    return logs


def _mpc(
    scenario: Scenario,
    architecture: str,
    start: Start,
    planner: Callable[[], Plan],
    replanner: Callable[[], Replanning],
) -> ModelPredictiveController:
    """The MPC of the scenario: it plans once, or again and again."""
    settings, start_time = scenario.planner, scenario.simulation.lead_time
    if settings.replan_period is None:
        off = scenario.disturbance.start_error != 0
        return ModelPredictiveController(planner, start.pose, start_time, stand=off)
    timing = Timing(
        settings.replan_period, settings.compute_delay, scenario.controller.period / 4, settings.replan_deadline
    )
    again = replanner()
    return RecedingHorizonController(
        planner,
        again.replan,
        start.pose,
        timing,
        joints=len(start.q),
        gains=(scenario.controller.k_p, scenario.controller.k_v),
        start_time=start_time,
        # without feed-forward the error of the tool is what accelerates it: a plan from the tool would take it away
        measured=settings.replan_from == "measured" and "ff" in architecture.split("+"),
        fewest=again.fewest,
    )


def _close_horizon(
    builder: DiagramBuilder,
    scenario: Scenario,
    mpc: RecedingHorizonController,
    cell: Cell,
    boxes: Controller,
    q: OutputPort,
) -> None:
    """What a replanning MPC measures: the tool, the joints and, where there is a camera, the object on the blade."""
    for name in ("x", "v"):
        builder.Connect(boxes.output(name), mpc.GetInputPort(name))
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
        builder.Connect(cell.poses, camera.get_input_port())
        builder.Connect(camera.get_output_port(), mpc.GetInputPort("shift"))
