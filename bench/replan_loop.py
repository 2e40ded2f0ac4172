"""A new plan every millisecond in the running simulation, its time by part; and its QPs by CasADi's solvers."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any
from unittest.mock import patch

import numpy as np

from bench.contenders import casadi_qp
from bench.results import Section, Target
from bench.timing import SelfTimes, timed
from flipdiagram.planning import dense, limits
from flipdiagram.planning.condensed import CondensedProgram
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.dense import DenseProgram
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import plan_motion
from flipdiagram.planning.program import Solution
from flipdiagram.planning.replanner import Replanner
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.replans import solve_times
from flipdiagram.simulation.simulate import simulate

EVERY_MS = {"planner.replan_period": 0.001, "planner.compute_delay": 0.001}
WORST, MEDIAN = Target("<", 0.001), Target("<", 0.001)
AGREE = 1e-4
"""Difference in the cost of a QP that is still the same minimum."""
TEXT = (
    "The default flip by pd+ff+dob in Drake, planned again every millisecond of the contact phase: the solve time of"
    " each replan as the recording has it. Parts: in another such flip whose clocks cost time themselves. CasADi: every"
    " tenth QP of a flip, started cold, the program that DAQP is given, by CasADi's qpOASES and OSQP; linearising"
    " and building the program are not in their times. acados is in no registry of Python packages."
)


def measure(repetitions: int, quick: bool) -> Section:
    """Raises RuntimeError where another solver finds another minimum."""
    scenario = Scenario().with_overrides(EVERY_MS)
    plan, section = plan_motion(Scenario()), Section("Replanning every millisecond, in the loop", TEXT)
    taken = [solve_times(simulate(scenario, "pd+ff+dob", plan).recording)[1] for _ in range(repetitions)]
    section.whole = section.add("a replan", np.concatenate(taken).tolist(), target=MEDIAN)
    section.add("99 of 100 within", [float(np.quantile(each, 0.99)) for each in taken], target=WORST)
    section.add("the longest", [float(each.max()) for each in taken])
    for name, values in _parts(scenario, plan).items():
        section.add(name, values, indent=1)
    section.checks.append(f"{len(taken[0])} replans a flip")
    if find_spec(casadi_qp.PACKAGE):
        programs = _programs(scenario, plan)[:: 40 if quick else 10]
        for solver in casadi_qp.SOLVERS:
            _against(section, solver, programs)
    else:
        section.checks.append(f"no qpOASES and OSQP: pip install {casadi_qp.PACKAGE}")
    return section


def _parts(scenario: Scenario, plan: Plan) -> dict[str, list[float]]:
    """The time of each replan by part."""
    own, each, replan = SelfTimes(), list[dict[str, float]](), Replanner.replan

    def with_parts(self: Replanner, *arguments: Any) -> Plan:
        own.take()
        new = replan(self, *arguments)
        each.append(own.take())
        return new

    with (
        own.of_method(Convexification, "rows", "linearising: contact, kinematics and dynamics of the arm"),
        own.of_method(limits, "joint_rows", "rows of the joint limits"),
        own.of_method(CondensedProgram, "update", "building the program"),
        own.of_method(CondensedProgram, "solve", "DAQP"),
        patch.object(Replanner, "replan", with_parts),
    ):
        simulate(scenario, "pd+ff+dob", plan)
    return {name: [parts[name] for parts in each] for name in each[0]}


def _programs(scenario: Scenario, plan: Plan) -> list[tuple[DenseProgram, float]]:
    """The quadratic programs of a flip, and how long DAQP took for each."""
    kept, solve = list[tuple[DenseProgram, float]](), CondensedProgram.solve

    def keeping(self: CondensedProgram) -> Solution:
        elapsed, solution = timed(lambda: solve(self))
        if self.program is not None:
            kept.append((DenseProgram(*map(np.copy, self.program[:4]), *self.program[4:]), elapsed))
        return solution

    with patch.object(CondensedProgram, "solve", keeping):
        simulate(scenario, "pd+ff+dob", plan)
    return kept


def _against(section: Section, solver: str, programs: list[tuple[DenseProgram, float]]) -> None:
    """The same programs by another solver."""
    times, ours = list[float](), list[float]()
    for program, elapsed in programs:
        f, A, low, high, *_ = program
        best, solve = dense.minimise(program).v, casadi_qp.prepare(solver, A)
        seconds, v = solve(f, A, low, high)
        cost, least = ((x @ x) / 2 + f @ x for x in (v, best))
        if abs(cost - least) > AGREE * (1 + abs(least)):
            raise RuntimeError(f"{solver}: cost {cost}, ours {least}")
        times.append(seconds)
        ours.append(elapsed)
    section.add(f"CasADi + {solver}, one QP", times)
    section.add(f"CasADi + {solver} / DAQP, one QP", [a / b for a, b in zip(times, ours, strict=True)], "x")


def sections(repetitions: int, quick: bool) -> Iterator[Section]:
    """The loop."""
    yield measure(1 if quick else min(repetitions, 3), quick)
