"""bdsim: sampled blocks on one clock, a channel at a time.

Its clock makes the first update at T, with the signals of that instant: the command therefore runs one tick late.
"""

from __future__ import annotations

import contextlib
import io
import math
from importlib import import_module
from typing import Any

import numpy as np

from bench.one_dof import Array, Numbers, Stepper

NAME, PACKAGE = "bdsim", "bdsim"


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """A diagram per channel, built and compiled by bdsim before."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):  # it tells of toolboxes
        sim = import_module("bdsim").BDSim(banner=False, sysargs=False, graphics=False, progress=False, animation=False)
    diagrams = [_diagram(sim, numbers, float(w)) for w in omega]
    end = (ticks + 0.5) * numbers.settings.step

    def run() -> Array:
        rows = []
        for diagram, clock in diagrams:
            with contextlib.redirect_stdout(io.StringIO()):
                result = sim.run(diagram, T=end)
            rows.append(_positions(result, clock))
        found = np.array(rows)[:, : ticks + 1]
        return found if log else found[:, -1:]

    return run


def _diagram(sim: Any, numbers: Numbers, w: float) -> tuple[Any, Any]:
    s, T = numbers.settings, numbers.settings.step
    bd = sim.blockdiagram()
    clock = bd.clock(T, unit="s")
    time = bd.TIME()
    x_cmd = bd.FUNCTION(lambda t: -math.sin(w * (t - T)))
    v_cmd = bd.FUNCTION(lambda t: -w * math.cos(w * (t - T)))
    a_cmd = bd.FUNCTION(lambda t: w * w * math.sin(w * (t - T)))
    v = bd.INTEGRATOR_S(clock, gain=1 / s.mass, name="v")
    x = bd.INTEGRATOR_S(clock, name="x")  # of the mean velocity of the step, v + T/2 (force/m): exact
    mean, half_step = bd.SUM("++"), bd.GAIN(T / 2 / s.mass)
    observer = bd.LTI_SS_S(
        clock, A=np.array([[numbers.decay]]), B=np.array([[1 - numbers.decay]]), C=np.eye(1), x0=np.zeros(1)
    )
    e_x, e_v, a_ref, force = bd.SUM("+-"), bd.SUM("+-"), bd.SUM("+++"), bd.SUM("++-")
    k_p, k_v, inertia, damping = (bd.GAIN(value) for value in (s.k_p, s.k_v, s.mass, s.g_dis * numbers.nominal))
    total, inside = bd.SUM("++"), bd.SUM("++")
    gravity = bd.CONSTANT(s.mass * numbers.gravity)
    for block in (x_cmd, v_cmd, a_cmd):
        bd.connect(time, block)
    for source, target in (
        (x_cmd, e_x[0]),
        (x, e_x[1]),
        (v_cmd, e_v[0]),
        (v, e_v[1]),
        (e_x, k_p),
        (e_v, k_v),
        (k_p, a_ref[0]),
        (k_v, a_ref[1]),
        (a_cmd, a_ref[2]),
        (a_ref, inertia),
        (v, damping),
        (inertia, force[0]),
        (observer, force[1]),
        (damping, force[2]),
        (force, total[0]),
        (gravity, total[1]),
        (total, v),
        (total, half_step),
        (v, mean[0]),
        (half_step, mean[1]),
        (mean, x),
        (force, inside[0]),
        (damping, inside[1]),
        (inside, observer),
    ):
        bd.connect(source, target)
    bd.compile()
    return bd, clock


def _positions(result: Any, clock: Any) -> Array:
    """x at every tick, of the clock's record, which begins after its first update."""
    record = getattr(result, clock.name.replace(".", ""))
    column = next(i for i, name in enumerate(record.Xnames) if name.startswith("x"))
    return np.concatenate([[0.0], np.asarray(record.X)[:, column]])
