"""The loop that the contenders run: one mass, PD + feed-forward + observer, sinusoidal command, 0.1 ms, gravity."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder

from flipdiagram.blocks.commands import SinusoidalCommand
from flipdiagram.blocks.meters import LockIn, Peak, RootMeanSquare
from flipdiagram.compiled import CompiledDiagram, compile_diagram
from flipdiagram.diagrams.one_dof import COMMANDS, build_controller
from flipdiagram.plants.one_dof import OneDofPlant
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.theory.contact import GRAVITY_Z

Array = NDArray[np.float64]
Stepper = Callable[[], Array]
"""Runs all channels from rest; x [m], shape (n, ticks + 1) where every tick is logged, (n, 1) at the end else."""
ARCHITECTURE = "pd+ff+dob"


@dataclass(frozen=True)
class Numbers:
    """The numbers of the loop, those of section III unless given; every contender is written from these.

    At tick k, t = k step: x_cmd = -sin wt, v_cmd = -w cos wt, a_cmd = w^2 sin wt;
    f = mass (a_cmd + k_p (x_cmd - x) + k_v (v_cmd - v)) + w - g_dis nominal v;
    w <- decay w + (1 - decay) (f + g_dis nominal v);  m x'' = f + m gravity with f held, exactly.
    """

    settings: OneDof = field(default_factory=OneDof)
    gravity: float = GRAVITY_Z

    @property
    def nominal(self) -> float:
        """Mass inside the observer [kg]."""
        return self.settings.nominal_mass_ratio * self.settings.mass

    @property
    def decay(self) -> float:
        """Observer's pole e^(-g_dis step)."""
        return math.exp(-self.settings.g_dis * self.settings.step)

    @property
    def plant(self) -> tuple[Array, Array]:
        """A (2, 2) and B (2, 1) of the plant for x, v and the total force [N]."""
        T, m = self.settings.step, self.settings.mass
        return np.array([[1.0, T], [0.0, 1.0]]), np.array([[T * T / 2 / m], [T / m]])


def build_loop(numbers: Numbers, meters: bool) -> Diagram:
    """The loop from the blocks of the project; outputs `x`, and with meters those of the study."""
    settings = numbers.settings
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    plant = add("plant", OneDofPlant([settings.mass], settings.step, gravity=numbers.gravity))
    command = add("command", SinusoidalCommand([1.0], [1.0]))
    controller = add("controller", build_controller(ARCHITECTURE, settings))
    for name in COMMANDS:
        connect(command.GetOutputPort(name), controller.GetInputPort(name))
    for name in ("x", "v"):
        connect(plant.GetOutputPort(name), controller.GetInputPort(name))
    force = controller.GetOutputPort("force")
    connect(force, plant.GetInputPort("f"))
    builder.ExportOutput(plant.GetOutputPort("x"), "x")
    if meters:
        x, T = plant.GetOutputPort("x"), settings.step
        boxes = {"lockin": (x, LockIn([1.0], T)), "peak": (x, Peak(1, T)), "peak_force": (force, Peak(1, T))}
        boxes["rms_error"] = (x, RootMeanSquare(1, T))
        for name, (port, meter) in boxes.items():
            add(name, meter)
            connect(port, meter.GetInputPort("y"))
            builder.ExportOutput(meter.get_output_port(), name)
        connect(command.GetOutputPort("x_cmd"), boxes["rms_error"][1].GetInputPort("reference"))
    return builder.Build()


def compile_loop(numbers: Numbers, meters: bool, **options: Any) -> CompiledDiagram:
    """The loop compiled, `omega` [rad/s] as its parameter, and `start` [s] of the meters."""
    tie = {"omega": ["command.omega", *(["lockin.omega"] if meters else [])]}
    if meters:
        tie["start"] = [f"{name}.start_time" for name in ("lockin", "peak", "peak_force", "rms_error")]
    return compile_diagram(build_loop(numbers, meters), tie=tie, **options)


def trajectories(loop: CompiledDiagram, omega: Array, ticks: int) -> Array:
    """x at every tick, (n, ticks + 1)."""
    found: Array = loop.run(ticks, parameters={"omega": omega}, log=("x",), threads=1).log["x"][:, :, 0]
    return found
