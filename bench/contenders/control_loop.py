"""python-control: interconnect and input_output_response, a channel at a time; the command as an array."""

from __future__ import annotations

from importlib import import_module

import numpy as np

from bench.one_dof import Array, Numbers, Stepper

NAME, PACKAGE = "python-control (interconnect)", "control"


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """The interconnected system and the samples of the command, made before; all else is input_output_response."""
    control = import_module("control")
    s, T = numbers.settings, numbers.settings.step
    A, B = numbers.plant
    damping = s.g_dis * numbers.nominal
    d = numbers.decay
    plant = control.ss(
        A, B @ np.ones((1, 2)), np.eye(2), 0, T, inputs=["f", "weight"], outputs=["x", "v"], name="plant"
    )
    pd = control.ss(
        [],
        [],
        [],
        [[s.k_p, s.k_v, 1.0, -s.k_p, -s.k_v]],
        T,
        inputs=["x_cmd", "v_cmd", "a_cmd", "x", "v"],
        outputs=["a_ref"],
        name="pd",
    )
    observer = control.ss(
        [[d]], [[1 - d, (1 - d) * damping]], [[1.0]], [[0.0, 0.0]], T, inputs=["f", "v"], outputs=["w"], name="observer"
    )
    force = control.ss(
        [], [], [], [[s.mass, 1.0, -damping]], T, inputs=["a_ref", "w", "v"], outputs=["f"], name="force"
    )
    inputs = ["x_cmd", "v_cmd", "a_cmd", "weight"]
    loop = control.interconnect([plant, pd, observer, force], inputs=inputs, outputs=["x"], dt=T)
    time = np.arange(ticks + 1) * T
    commands = []
    for w in omega:
        sine, cosine = np.sin(w * time), np.cos(w * time)
        commands.append(np.array([-sine, -w * cosine, w * w * sine, np.full_like(time, s.mass * numbers.gravity)]))

    def run() -> Array:
        rows = [control.input_output_response(loop, time, u, np.zeros(3)).outputs for u in commands]
        found = np.array(rows).reshape(len(rows), -1)
        return found if log else found[:, -1:]

    return run
