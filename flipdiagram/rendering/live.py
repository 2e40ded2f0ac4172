"""The flip while it is being simulated, in a browser through Meshcat.

A pancake bends there with every version of Drake: its surface is sent as meshes of our own, coloured as in the replay.
Drake's visualizer shows deformable bodies since 1.55, in one colour; before, it warns and leaves them out.
"""

import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams, Rgba, Role, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from flipdiagram.diagrams.loop import Loop, build_loop
from flipdiagram.errors import SimulationError
from flipdiagram.planning import plan_motion
from flipdiagram.plants.pancake_cell import PancakeCell
from flipdiagram.rendering.pancake import add_surface
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.pancake_surface import surface_over
from flipdiagram.simulation.simulate import simulate_loop
from flipdiagram.simulation.verdict import judge

SPEED = 0.5
"""Simulated seconds per second of wall time; the simulation itself runs at about twice real time."""
PATIENCE = 20.0
"""Seconds that it waits for a browser."""
HOLD_SHOWN = 1.0
"""Seconds of the hold that are shown at most: longer ones pass as fast as they can."""


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def show_live(
    scenario: Scenario, architectures: Sequence[str], *, port: int | None = None, announce: Callable[[str], None] = _say
) -> None:
    """Simulate the architectures one after the other while a browser watches; without one nothing is simulated.

    Args:
        scenario: what is simulated.
        architectures: in this order.
        port: of the server on this machine, by default the first free one from 7000.
        announce: told the address and each verdict, by default on stderr.

    Raises SimulationError where the port is taken.
    """
    try:
        meshcat = Meshcat(MeshcatParams(host="localhost", port=port, show_stats_plot=False))
    except RuntimeError as error:
        raise SimulationError(f"Meshcat cannot listen on port {port}: {error}") from None
    announce(f"watch at {meshcat.web_url()} (waiting {PATIENCE:g} s for a browser)")
    latest = time.monotonic() + PATIENCE
    plan = plan_motion(scenario)
    task = scenario.task
    meshcat.SetObject("target", Sphere(0.006), Rgba(0.0, 0.62, 0.45, 1.0))  # where the block shall land
    meshcat.SetTransform("target", RigidTransform([task.start_x, task.target_y, scenario.table.height]))
    meshcat.SetCameraPose([task.start_x + 0.8, 0.25, 0.5], [task.start_x, 0.0, 0.3])
    while meshcat.GetNumActiveConnections() == 0:
        if time.monotonic() > latest:
            announce(f"no browser came within {PATIENCE:g} s; going on without")
            return
        time.sleep(0.1)
    for name in architectures:
        loop = build_loop(scenario, name, record=True, meshcat=meshcat)
        pace = _Pace(scenario.simulation.lead_time - HOLD_SHOWN, _bending(loop, meshcat))
        flip = simulate_loop(loop, plan, pace=pace)
        success, failure = judge(flip.recording)
        announce(f"{name}: {'turned over' if success else failure}")


def _bending(loop: Loop, meshcat: Meshcat) -> Callable[[Context], None]:
    """What shows a pancake as it is in a context of the loop's diagram, in the place of Drake's own picture of it."""
    cell = loop.cell
    if not isinstance(cell, PancakeCell):
        return lambda context: None
    mesh = pancake_mesh(loop.scenario.object)
    geometry = cell.robot.deformable_model().GetGeometryId(cell.pancake)
    cell.scene_graph.RemoveRole(cell.robot.get_source_id(), geometry, Role.kIllustration)
    port = cell.recorded["vertices"]

    def show(context: Context) -> None:
        vertices = port.Eval(port.get_system().GetMyContextFromRoot(context)).reshape(1, -1, 3)
        add_surface(meshcat, "", surface_over(np.zeros(1), vertices, mesh.tetrahedra, mesh.upper, mesh.lower))

    return show


class _Pace:
    """Progress that holds the simulation back to `SPEED`, from a simulated time on, and shows what bends."""

    def __init__(self, start: float, show: Callable[[Context], None]) -> None:
        self.start, self.begin, self.show = start, 0.0, show

    def __call__(self, simulated: float, context: Context) -> None:
        self.show(context)
        if simulated <= self.start:
            self.begin = time.monotonic()
            return
        ahead = (simulated - self.start) / SPEED - (time.monotonic() - self.begin)
        if ahead > 0:
            time.sleep(ahead)
