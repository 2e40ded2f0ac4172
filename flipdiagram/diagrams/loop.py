"""Controller and cell closed into one diagram: the whole of Fig. 4."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import VectorLogSink

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS, ModelPredictiveController
from flipdiagram.blocks.receding_horizon import RecedingHorizonController
from flipdiagram.diagrams.controller import ControllerBoxes, add_controller
from flipdiagram.diagrams.drive import Drive, add_drive, ripple_at_rest
from flipdiagram.diagrams.equilibrium import Equilibrium, equilibrium, no_equilibrium
from flipdiagram.diagrams.horizon import close_horizon, mpc_of
from flipdiagram.diagrams.native_controller import NativeController, add_native_controller, add_native_sensing
from flipdiagram.diagrams.own_controller import OwnController, add_own_controller
from flipdiagram.diagrams.ports import export_ports
from flipdiagram.diagrams.replacement import WHOLE, Box, build_diagram
from flipdiagram.diagrams.rest import Resting
from flipdiagram.diagrams.sensing import Sensing, add_sensing
from flipdiagram.diagrams.start import start_of
from flipdiagram.errors import InputError
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import Planner
from flipdiagram.planning.replanner import Replanner, Replanning
from flipdiagram.plants.cell import add_cell
from flipdiagram.plants.handle import Cell, Rest
from flipdiagram.plants.mujoco_cell import add_mujoco_cell
from flipdiagram.plants.pancake_cell import add_pancake_cell
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

Controller = ControllerBoxes | NativeController | OwnController
ENGINES: dict[str, Callable[[DiagramBuilder, Scenario, ArmModel, Floats, Rest | None], Cell]] = {
    "drake": add_cell,
    "mujoco": add_mujoco_cell,
}
"""What adds a cell with a rigid block, by `simulation.engine`."""
SATURATED = 1e-6
"""Relative distance to a torque limit below which a joint counts as too weak."""
REPLANNING = ("solve_time", "iterations", "status", "cone_margin", "replanned", "failed", "late")
"""Signals of an MPC that replans, beside the commands."""


@dataclass(frozen=True)
class Loop:
    """The closed loop and handles to its boxes; `context()` starts a run as the scenario's `simulation.start` says.

    `diagram` has the figure's signals as output ports, see `ports.export_ports`, and may stand in a larger one.
    """

    diagram: Diagram
    scenario: Scenario
    architecture: str
    arm: ArmModel
    mpc: ModelPredictiveController | None
    """None where the commands come from outside."""
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
    rest: Equilibrium | None = None
    """The equilibrium of the default context, where that stands at one."""

    @property
    def ports(self) -> tuple[str, ...]:
        """Ports of the diagram that the figure shows too."""
        return COMMANDS if self.mpc is None else ()

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Systems that a drawing shows as one box, by its name: all of the cell as `robot`."""
        return {"robot": self.cell.systems}

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Where an endless hold of the start pose ends; raises NoEquilibriumError where it ends nowhere."""
        return self._equilibrium(self._root(None))

    def _equilibrium(self, context: Context) -> Equilibrium:
        """The same in a root Context, which is changed."""
        found = self.rest
        if found is None:
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

    def context(self, plan: Plan | None = None, root: Context | None = None) -> Context:
        """A context to start a run from: arm at rest, block on the blade; with `plan` the MPC need not solve.

        Commands from outside hold the start pose until they are connected or fixed anew.

        Args:
            plan: the motion to follow.
            root: the context of a larger diagram that holds `diagram`: the loop's part of it is set, nothing else.

        Returns: `root`, or a fresh context of `diagram`.

        Raises:
            InputError: where `root` is no context of a diagram that holds the loop, or is left out and needed.
            NoEquilibriumError: where the run shall start at an equilibrium and there is none.
        """
        context = self._root(root)
        if plan is not None and self.mpc is None:
            raise InputError.of("plan", plan, "None", "a loop with external commands follows no plan")
        if self.scenario.simulation.start == "equilibrium":
            found = self.equilibrium if root is None else self._equilibrium(root.Clone())
            self._stand(context, found.q)
            found.put(self.boxes.systems, context)
            self.drive.have_sent(context, self._tau.Eval(self._tau.get_system().GetMyContextFromRoot(context)))
        elif self.cell.parts.gears is not None:
            self._stand(context, self.q_start)  # brakes hold the rotors: the gears carry the arm already
        if plan is not None and self.mpc is not None:
            self.mpc.set_plan(self.mpc.GetMyMutableContextFromRoot(context), plan)
        return context

    def _root(self, root: Context | None) -> Context:
        context = self.diagram.CreateDefaultContext() if root is None else root
        try:
            self._tau.get_system().GetMyContextFromRoot(context)
        except (RuntimeError, TypeError):
            problem = "root is no context of the diagram that the loop is part of"
            if root is None:
                problem = "the loop is part of a larger diagram, whose context it needs"
            valid = "loop.context(root=diagram.CreateDefaultContext()) with the outermost diagram"
            raise InputError.of("root", root, valid, problem) from None
        if root is None and self.mpc is None:
            still = {"x_cmd": self.arm.task_position(self.q_start), "v_cmd": np.zeros(6), "a_cmd": np.zeros(6)}
            for name, value in still.items():
                self.diagram.GetInputPort(name).FixValue(context, value)
        return context

    @property
    def _tau(self) -> OutputPort:
        tau = self.boxes.output("tau")
        assert tau is not None
        return tau

    def _holding_torque(self, q: Floats) -> Floats:
        return self.cell.holding_torque(q) - ripple_at_rest(self.scenario, self.arm, q)

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
    external_commands: bool = False,
) -> Loop:
    """Wire MPC, controller, sensors and cell of a scenario into one diagram, boxes named as in Fig. 4.

    Its default context, and so `Simulator(loop.diagram)`, starts where the arm rests, if the scenario starts at an
    equilibrium and the boxes are all ours, not native; any other loop starts from `Loop.context`.

    Args:
        scenario: what is simulated.
        architecture: one of `ARCHITECTURES`.
        planner: what the MPC calls at the start of a run, by default the scenario's own.
        record: add sinks that log the signals every controller period.
        replace: boxes of the user's own by name, {"pd": MyBox}, see `replacement.with_replaced`, or {"controller":
            MyController} in the place of all of them, see `own_controller.add_own_controller`.
        meshcat: where to show the cell.
        native: sensors and controller as one box that computes the same, to rounding, in a fraction of the time; its
            boxes are then none of the diagram's.  Of the sensors alone beside a whole controller of the user's own, not
            with other boxes of the user's own.
        replanner: what makes that by which an MPC plans again, by default a `Replanner` of the scenario.
        external_commands: no MPC; `x_cmd`, `v_cmd`, `a_cmd` are input ports of the diagram.

    Raises:
        InputError: for an unknown architecture, a bad number, a box that does not fit, or external commands where
            something needs the MPC: a recording, planning again.
        PlanningError: where the arm cannot be at the start pose.
    """
    replace = replace or {}
    whole = WHOLE in replace
    native = native and (whole or not replace)
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

    builder, mpc = DiagramBuilder(), None
    commands: dict[str, OutputPort | int] = dict.fromkeys(COMMANDS, CHANNELS)
    if external_commands:
        _check_external(scenario, record, native)
    else:
        planning = mpc_of(scenario, architecture, start, planner or motion.plan, replanner or motion_again)
        mpc = builder.AddNamedSystem("mpc", planning)
        commands |= {name: mpc.GetOutputPort(name) for name in COMMANDS}
    resting = Resting(scenario, architecture, arm, start)
    stands = scenario.simulation.start == "equilibrium" and not (native or replace)
    bends = scenario.object.kind == "pancake"
    add = add_pancake_cell if bends else ENGINES[scenario.simulation.engine]
    cell = add(builder, scenario, arm, start.q, resting.at_rest if stands else None)
    seen: Sensing
    boxes: Controller
    joints = {"q": cell.q, "qd": cell.qd}
    if native and mpc is not None and not whole:
        ports = {name: mpc.GetOutputPort(name) for name in COMMANDS} | joints
        seen, boxes = add_native_controller(builder, scenario, architecture, arm, start.q, ports, offset)
        signals = {**commands, "q": seen.q, "qd": seen.qd}
    else:
        if native:
            seen = add_native_sensing(builder, scenario, arm, start.q, joints, offset)
        else:
            seen = add_sensing(builder, scenario, arm, cell.q, cell.qd, resting.q, offset)
        signals = {**commands, "q": seen.q, "qd": seen.qd}
        if whole:
            boxes = add_own_controller(builder, replace, arm, signals)
        else:
            boxes = add_controller(
                builder, scenario, architecture, arm, start.q, signals, offset, replace, resting.observed
            )
    if isinstance(mpc, RecedingHorizonController):
        close_horizon(builder, scenario, mpc, cell, boxes, seen.q)
    tau = boxes.output("tau")
    drive = add_drive(builder, scenario, arm, tau, cell.q, offset, resting.tau)
    builder.Connect(drive.tau, cell.tau)

    logs = _record(builder, mpc, boxes, cell, seen, drive.sent, period) if record and mpc is not None else {}
    if meshcat is not None:
        cell.show(builder, meshcat)
    export_ports(builder, {**signals, **boxes.signals}, cell)
    diagram = build_diagram(builder, replace)
    diagram.set_name(architecture)
    own = tuple(replace)
    return Loop(
        diagram, scenario, architecture, arm, mpc, seen, drive, boxes, cell, start.q, logs, own, resting.equilibrium
    )


def _check_external(scenario: Scenario, record: bool, native: bool) -> None:
    needs = {"record": record, "native": native, "planner.replan_period": scenario.planner.replan_period is not None}
    for name, needed in needs.items():
        if needed:
            raise InputError.of(
                "external_commands", True, "False", f"{name} needs the MPC, not external_commands = True"
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
    signals |= {**cell.recorded, "tau": tau} | ({"qd_motor": cell.qd} if elastic else {})
    if seen.boxes or elastic:
        signals |= {"q_meas": seen.q, "qd_meas": seen.qd}
    logs = {}
    for name, port in signals.items():
        logs[name] = builder.AddNamedSystem(f"log_{name}", VectorLogSink(port.size(), period))
        builder.Connect(port, logs[name].get_input_port())
    return logs
