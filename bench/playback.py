"""The diagrams that are stepped side by side: the closed loop, and the cell alone with the torques of a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from bench.timing import timed
from flipdiagram.diagrams.loop import Loop
from flipdiagram.planning import Plan
from flipdiagram.plants.cell import add_cell
from flipdiagram.simulation.simulate import Run

PROCESSOR = time.thread_time
"""Stepping uses one thread: its processor time is the wall time, less what other work on the machine took away."""


@dataclass
class Stepped:
    """A built diagram that is run again and again from the same start."""

    diagram: Diagram
    plant: MultibodyPlant
    start: Callable[[], Context]
    """Makes the context in which a run begins."""
    final_state: NDArray[Any] = field(default_factory=lambda: np.zeros(0))
    """Positions and velocities of the plant at the end of the last run."""

    def advance(self, end: float) -> float:
        """Simulate until `end` [s]; processor time of the stepping alone [s]."""
        context = self.start()
        simulator = Simulator(self.diagram, context)
        simulator.Initialize()
        elapsed, _ = timed(lambda: simulator.AdvanceTo(end), PROCESSOR)
        self.final_state = self.plant.GetPositionsAndVelocities(self.plant.GetMyContextFromRoot(context))
        return elapsed


def closed_loop(loop: Loop, plan: Plan) -> Stepped:
    """The loop itself."""
    return Stepped(loop.diagram, loop.cell.plant, lambda: loop.context(plan))


def torques_alone(loop: Loop, run: Run) -> Stepped:
    """The loop's cell without MPC and controller: its torque input is fed with what the run recorded."""
    period = loop.scenario.controller.period
    tau = run.recording["tau"].values.T
    # the sample at t_k is the one held around t_k: rounding of the times cannot pick a neighbour
    breaks = (np.arange(tau.shape[1] + 1) - 0.5) * period
    held = PiecewisePolynomial.ZeroOrderHold(breaks, np.hstack([tau, tau[:, -1:]]))
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("torques", TrajectorySource(held))
    cell = add_cell(builder, loop.scenario, loop.arm)
    builder.Connect(source.get_output_port(), cell.tau)
    diagram = builder.Build()

    def start() -> Context:
        theirs = loop.context()
        state = loop.cell.plant.GetPositionsAndVelocities(loop.cell.plant.GetMyContextFromRoot(theirs))
        context = diagram.CreateDefaultContext()
        cell.plant.SetPositionsAndVelocities(cell.plant.GetMyMutableContextFromRoot(context), state)
        return context

    return Stepped(diagram, cell.plant, start)
