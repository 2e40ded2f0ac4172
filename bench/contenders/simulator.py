"""The same diagram, not compiled: its Python blocks in Drake's Simulator, a channel at a time."""

from __future__ import annotations

import numpy as np
from pydrake.systems.analysis import Simulator

from bench.one_dof import Array, Numbers, Stepper, build_loop

NAME, PACKAGE = "uncompiled diagram, Drake's Simulator", None


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """The diagram, built before; each run makes a Simulator per channel."""
    step, diagram = numbers.settings.step, build_loop(numbers, meters=False)

    def run() -> Array:
        out = np.zeros((omega.size, ticks + 1 if log else 1))
        for c, w in enumerate(omega):
            simulator = Simulator(diagram)
            context = simulator.get_mutable_context()
            command = diagram.GetSubsystemByName("command").GetMyMutableContextFromRoot(context)
            command.get_mutable_numeric_parameter(0).SetFromVector([w])
            x = diagram.GetOutputPort("x")
            simulator.Initialize()
            for k in range(1, ticks + 1) if log else [ticks]:  # at k = 0 it is at rest, as in `out`
                simulator.AdvanceTo(k * step)
                out[c, k if log else 0] = x.Eval(context)[0]
        return out

    return run
