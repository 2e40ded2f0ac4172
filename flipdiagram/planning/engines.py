"""Which program solves a horizon: Drake's MathematicalProgram with one of its solvers, or the condensed one by DAQP."""

from __future__ import annotations

from collections.abc import Sequence

from flipdiagram.planning.condensed import CondensedProgram
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import LandingCost
from flipdiagram.planning.program import HorizonProgram

CONDENSED = "daqp"
"""`planner.solver` by which the condensed program is chosen."""
ELASTIC = "clarabel"
"""Solver of the elastic program where the plain one is the condensed program."""
Program = HorizonProgram | CondensedProgram


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
    if solver == CONDENSED and not elastic_groups:
        return CondensedProgram(layout, sampling_time, cost, smoothing)
    solver = ELASTIC if solver == CONDENSED else solver
    return HorizonProgram(layout, sampling_time, cost, smoothing, solver, elastic_groups)
