"""Which program solves a horizon: Drake's MathematicalProgram with one of its solvers, or the condensed one by DAQP;
and what linearises for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from flipdiagram.arrays import Floats
from flipdiagram.planning.condensed import CondensedProgram
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import LandingCost
from flipdiagram.planning.program import HorizonProgram, Solution
from flipdiagram.planning.rows import Rows
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.serial_chain import serial_chain
from flipdiagram.scenario.scenario import Scenario

if TYPE_CHECKING:
    from flipdiagram.planning.native.linearisation import Linearisation

CONDENSED = "daqp"
"""`planner.solver` by which the condensed program is chosen."""
ELASTIC = "clarabel"
"""Solver of the elastic program where the plain one is the condensed program."""


class Program(Protocol):
    """What successive convexification needs of a program."""

    layout: Layout
    sampling_time: float
    cost: LandingCost

    def update(
        self,
        start: Floats,
        n_contact: int,
        n_flight: int,
        landing: tuple[Floats, float],
        rows: Rows,
        near: Floats,
        trust: float,
    ) -> None:
        """New numbers, as in `HorizonProgram.update`."""

    def solve(self) -> Solution:
        """Solve with the current numbers."""


def compiled_rows(scenario: Scenario, arm: ArmModel, layout: Layout) -> Linearisation | None:
    """The compiled loops that linearise for an arm; None where it is not one chain of revolute joints."""
    from flipdiagram.planning.native.linearisation import Linearisation  # imports numba

    chain = serial_chain(arm)
    return Linearisation(scenario, arm, chain, layout) if chain else None


def make_program(
    layout: Layout,
    sampling_time: float,
    cost: LandingCost,
    smoothing: float,
    solver: str = "clarabel",
    elastic_groups: Sequence[str] = (),
) -> Program:
    """The program of that `planner.solver`, built once for a layout and ΔT [s]; smoothing [s⁵/m²].

    An elastic program has slacks, which only Drake's programs offer: for "daqp" it is one with Clarabel.  Raises
    InputError where the solver is not built in, has no licence, or its package is not installed.
    """
    if solver != CONDENSED:
        return HorizonProgram(layout, sampling_time, cost, smoothing, solver, elastic_groups)
    if elastic_groups:
        return HorizonProgram(layout, sampling_time, cost, smoothing, ELASTIC, elastic_groups)
    return CondensedProgram(layout, sampling_time, cost, smoothing)
