"""The box MPC of a scenario: which one it is, and what it measures where it plans again."""

from collections.abc import Callable

from pydrake.systems.framework import DiagramBuilder, OutputPort

from flipdiagram.blocks.camera import Camera
from flipdiagram.blocks.mpc import ModelPredictiveController
from flipdiagram.blocks.receding_horizon import RecedingHorizonController, Timing
from flipdiagram.diagrams.controller import ControllerBoxes
from flipdiagram.diagrams.native_controller import NativeController
from flipdiagram.diagrams.own_controller import OwnController
from flipdiagram.diagrams.start import Start
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.replanner import Replanning
from flipdiagram.plants.handle import Cell
from flipdiagram.scenario.scenario import Scenario


def mpc_of(
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


def close_horizon(
    builder: DiagramBuilder,
    scenario: Scenario,
    mpc: RecedingHorizonController,
    cell: Cell,
    boxes: ControllerBoxes | NativeController | OwnController,
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
