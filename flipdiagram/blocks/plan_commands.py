"""A plan as commands, with its numbers in parameters: what the box MPC plays out, over every scalar."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.symbolic import Expression

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks._scalars import choose
from flipdiagram.blocks.block import Block, convertible
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.errors import InputError
from flipdiagram.planning.plan import Plan

EARLY = 1e-9
"""Fraction of an interval by which a time may miss a sample and still be that sample: rounding."""


def planned_commands(
    t: Any, states: Array, inputs: Array, hold: Array, sampling_time: float, passed: float, start_time: float
) -> tuple[Array, Array, Array]:
    """x_cmd, v_cmd, a_cmd (6,) at t [s], those of `Plan.at`: eq. (2) between samples, at rest before and after.

    Shapes and units as of `PlanCommands`.  Of an Expression every interval is evaluated to one.
    """
    elapsed = t - start_time

    def interval(k: int) -> Array:
        if not 0 <= k < len(inputs):
            still = np.zeros(3)
            return np.concatenate([states[0 if k < 0 else -1, :3], still, still])
        tau = elapsed - (k * sampling_time - passed) if k else elapsed
        x, v, a = states[k, :3], states[k, 3:], inputs[k]
        return np.concatenate([x + v * tau + a * (tau * tau / 2), v + a * tau, a])

    if isinstance(t, Expression):
        rows = interval(-1)
        for k in range(len(inputs) + 1):
            begin = (k - EARLY) * sampling_time - (passed if k else 0.0)
            rows = np.array([choose(elapsed >= begin, new, old) for new, old in zip(interval(k), rows, strict=True)])
    else:
        now = elapsed if isinstance(elapsed, float) else elapsed.value()
        k = math.floor((now + passed) / sampling_time + EARLY) if now >= -EARLY * sampling_time else -1
        rows = interval(k)
    rest = np.zeros(CHANNELS - 3)
    x, v, a = np.split(rows, 3)
    return np.concatenate([x, hold[3:]]), np.concatenate([v, rest]), np.concatenate([a, rest])


def _samples(name: str, value: ArrayLike, size: int | None = None, *, columns: int) -> Array:
    """Rows of a plan; raises InputError for another shape or what is not finite."""
    table = np.array(value)
    if table.ndim != 2 or table.shape[1] != columns or not len(table):
        raise InputError.of(name, value, f"(samples, {columns})", f"{name} has shape {table.shape}")
    if table.dtype != object and not np.isfinite(table.astype(float)).all():
        raise InputError.of(name, value, "finite numbers", f"{name} has entries that are not finite")
    return table


@convertible()
class PlanCommands(Block):
    """Commands of a plan that is frozen into numeric parameters; the outputs of the box MPC, no event, no state.

    Parameters of the Context: `states` (N + 1, 6) [m, rad; per s] and `inputs` (N, 3) [m/s^2, rad/s^2] as in `Plan`,
    `hold` (6,), of which the last three coordinates (x, pitch, yaw) are held [m, rad].  `sampling_time`, `passed`,
    `start_time` and `solve_time` in [s].
    Outputs `x_cmd`, `v_cmd`, `a_cmd` (6,), `solve_time` [s], `status` = 1.
    """

    def __init__(
        self,
        states: ArrayLike,
        inputs: ArrayLike,
        hold: ArrayLike,
        sampling_time: float,
        passed: float = 0.0,
        start_time: float = 0.0,
        solve_time: float = 0.0,
    ) -> None:
        n = self.parameter("states", states, check=_samples, columns=6)
        if self.parameter("inputs", inputs, check=_samples, columns=3) != n - 1:
            raise InputError.of("inputs", np.shape(inputs), f"({n - 1}, 3)", "there is one input for each interval")
        self.parameter("hold", hold, CHANNELS, minimum=-np.inf)
        self.sampling_time = float(channels("sampling_time", sampling_time, 1, strict=True)[0])
        self.passed = float(channels("passed", passed, 1)[0])
        self.start_time = float(channels("start_time", start_time, 1)[0])
        self.solve_time = float(channels("solve_time", solve_time, 1)[0])
        self.outputs(COMMANDS, CHANNELS, planned_commands)
        self.output("solve_time", 1, lambda: np.array([self.scalar(self.solve_time)]))
        self.output("status", 1, lambda: np.array([self.scalar(1.0)]))


def plan_commands(plan: Plan, hold: ArrayLike, start_time: float = 0.0) -> PlanCommands:
    """The block that plays out a plan from start_time [s] on; hold (6,) as the MPC has it [m, rad]."""
    timing = plan.sampling_time, plan.passed, start_time, plan.solve_time
    return PlanCommands(plan.states, plan.inputs, hold, *timing)
