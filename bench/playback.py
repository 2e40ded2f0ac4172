"""The diagrams that are stepped side by side: the closed loop, and the cell alone with the torques of a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from bench.timing import timed
from flipdiagram.diagrams.loop import ENGINES, Loop
from flipdiagram.planning import Plan
from flipdiagram.plants.handle import Cell
from flipdiagram.simulation.simulate import Run

PROCESSOR = time.thread_time
"""Stepping uses one thread: its processor time is the wall time, less what other work on the machine took away."""


@dataclass
class Stepped:
    """A built diagram that is run again and again from the same start."""

    diagram: Diagram
    cell: Cell
    start: Callable[[], Context]
    """Makes the context in which a run begins."""
    final_state: NDArray[Any] = field(default_factory=lambda: np.zeros(0))
    """Angles and speeds of the arm, pose and velocity of the block at the end of the last run."""

    def advance(self, end: float) -> float:
        """Simulate until `end` [s]; processor time of the stepping alone [s]."""
        context = self.start()
        simulator = Simulator(self.diagram, context)
        simulator.Initialize()
        elapsed, _ = timed(lambda: simulator.AdvanceTo(end), PROCESSOR)
        ports = self.cell.q, self.cell.qd, self.cell.block
        self.final_state = np.concatenate([p.Eval(p.get_system().GetMyContextFromRoot(context)) for p in ports])
        return elapsed


def closed_loop(loop: Loop, plan: Plan) -> Stepped:
    """The loop itself."""
    return Stepped(loop.diagram, loop.cell, lambda: loop.context(plan))


def torques_alone(loop: Loop, run: Run) -> Stepped:
    """The loop's cell without MPC and controller: its torque input is fed with what the run recorded."""
    period = loop.scenario.controller.period
    tau = run.recording["tau"].values.T
    # the sample at t_k is the one held around t_k: rounding of the times cannot pick a neighbour
    breaks = (np.arange(tau.shape[1] + 1) - 0.5) * period
    held = PiecewisePolynomial.ZeroOrderHold(breaks, np.hstack([tau, tau[:, -1:]]))
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("torques", TrajectorySource(held))
    cell = ENGINES[loop.scenario.simulation.engine](builder, loop.scenario, loop.arm, loop.q_start, None)
    builder.Connect(source.get_output_port(), cell.tau)
    diagram = builder.Build()

    def start() -> Context:
        context = diagram.CreateDefaultContext()
        cell.stand(context, loop.equilibrium.q)
        return context

    return Stepped(diagram, cell, start)
