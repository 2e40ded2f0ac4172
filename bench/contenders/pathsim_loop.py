"""pathsim: blocks that its scheduled events update, a channel at a time.

An event sees the signals as they stood before any block was updated at its instant; pathsim's own discrete blocks thus
add a delay of one sample around a loop.  To have the same samples here, a block steps from the signals that it
sees to the next state and puts that out at once; the command runs one tick late, so that it is seen with its state.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np

from bench.one_dof import Array, Numbers, Stepper

NAME, PACKAGE = "pathsim", "pathsim"


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """A simulation per channel, built before."""
    channels = [_simulation(numbers, float(w)) for w in omega]
    step = numbers.settings.step

    def run() -> Array:
        rows = []
        for simulation, plant in channels:
            simulation.run((ticks + 0.5) * step, reset=True, adaptive=False)
            rows.append(plant.history[: ticks + 1])
        found = np.array(rows)
        return found if log else found[:, -1:]

    return run


def _simulation(numbers: Numbers, w: float) -> tuple[Any, Any]:
    pathsim, blocks = import_module("pathsim"), import_module("pathsim.blocks")
    schedule = import_module("pathsim.events.schedule").Schedule
    held = _held_block(blocks)
    s, T = numbers.settings, numbers.settings.step
    A, B = numbers.plant
    x_cmd = blocks.Source(lambda t: -math.sin(w * (t - T)))
    v_cmd = blocks.Source(lambda t: -w * math.cos(w * (t - T)))
    a_cmd = blocks.Source(lambda t: w * w * math.sin(w * (t - T)))
    weight = blocks.Constant(s.mass * numbers.gravity)
    plant, observer = held(A, B), held([[numbers.decay]], [[1 - numbers.decay]])
    e_x, e_v, a_ref, force = (blocks.Adder(signs) for signs in ("+-", "+-", "+++", "++-"))
    total, inside = blocks.Adder("++"), blocks.Adder("++")
    k_p, k_v, inertia, damping = (
        blocks.Amplifier(value) for value in (s.k_p, s.k_v, s.mass, s.g_dis * numbers.nominal)
    )
    connect = pathsim.Connection
    connections = [
        connect(x_cmd, e_x[0]),
        connect(plant[0], e_x[1]),
        connect(v_cmd, e_v[0]),
        connect(plant[1], e_v[1], damping),
        connect(e_x, k_p),
        connect(e_v, k_v),
        connect(k_p, a_ref[0]),
        connect(k_v, a_ref[1]),
        connect(a_cmd, a_ref[2]),
        connect(a_ref, inertia),
        connect(inertia, force[0]),
        connect(observer, force[1]),
        connect(damping, force[2], inside[1]),
        connect(force, total[0], inside[0]),
        connect(weight, total[1]),
        connect(total, plant),
        connect(inside, observer),
    ]
    own = [x_cmd, v_cmd, a_cmd, weight, plant, observer, e_x, e_v, a_ref, force, total, inside]
    own += [k_p, k_v, inertia, damping]

    def step(t: float) -> None:
        after = [block.after() for block in (plant, observer)]
        for block, state in zip((plant, observer), after, strict=True):
            block.move(state)

    clock = schedule(t_start=T, t_period=T, func_act=step)
    return pathsim.Simulation(own, connections, [clock], dt=T, log=False), plant


def _held_block(blocks: Any) -> Any:
    """x <- A x + B u as a block whose output is x; no output depends on u."""

    class Held(blocks.Block):  # type: ignore[misc, name-defined]
        def __init__(self, A: Any, B: Any) -> None:
            super().__init__()
            self.A, self.B = np.asarray(A), np.asarray(B)
            self.reset()

        def __len__(self) -> int:
            return 0

        def reset(self) -> None:
            super().reset()
            self.value = np.zeros(len(self.A))
            self.history = [0.0]
            self.outputs.update_from_array(self.value)

        def after(self) -> Array:
            return np.asarray(self.A @ self.value + self.B @ self.inputs.to_array())

        def move(self, state: Array) -> None:
            self.value = state
            self.history.append(state[0])
            self.outputs.update_from_array(state)

    return Held
