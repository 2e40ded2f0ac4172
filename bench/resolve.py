"""A built program with new numbers solved again, N = 50 intervals, beside the raw solver on the same matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any
from unittest.mock import patch

from bench import raw
from bench.results import Section, Target
from bench.timing import in_turn, ratios, timed
from flipdiagram.planning import Planner
from flipdiagram.planning.program import HorizonProgram
from flipdiagram.scenario.scenario import Scenario

TIME_LIMIT, RATIO_LIMIT = Target("<", 0.010), Target("<", 1.5)
INTERVALS = {"planner.contact_samples": (38, 38), "planner.flight_samples": (5, 5), "planner.stop": "brake"}
"""One horizon of N = 38 + 12 intervals."""
AGREE = 1e-6
"""Relative difference of two optimal costs, and violation of a row, up to which both solved the same problem."""
TEXT = (
    "The program is built once for N = {n} intervals. Each repetition writes new numbers into it, those of another"
    " of the planner's own linearisations from first guess to settled motion, and solves. program.solve() = Drake's"
    " MathematicalProgram with its Clarabel backend, solution read back and checked. raw = P, q, A, b taken from that"
    " same program (without rows that have no finite bound), handed to Clarabel's own Python interface in the settings"
    " that Drake uses (its defaults): set up and solve, as Drake must too. Alternating, in one process."
)


@dataclass(frozen=True)
class Numbers:
    """What one `HorizonProgram.update` wrote, and the QP that came of it as matrices."""

    arguments: tuple[Any, ...]
    problem: raw.Matrices


def measure(repetitions: int, overrides: dict[str, Any] | None = None) -> Section:
    """Solve each of the planner's programs `repetitions` times, by Drake and raw in turn.

    overrides: of the default scenario, `INTERVALS` unless given.  Raises RuntimeError where a solve fails or the two
    do not agree.
    """
    chosen = {"planner.solver": "clarabel"} | (INTERVALS if overrides is None else overrides)
    scenario = Scenario().with_overrides(chosen)
    program, numbers = problems(scenario)
    n, first = program.layout.intervals, numbers[0].problem
    section = Section(f"Re-solve at N = {n}", TEXT.format(n=n))
    with_raw = find_spec("clarabel") is not None
    worst = 0.0
    for item in numbers:
        program.update(*item.arguments)
        if with_raw:
            worst = max(worst, _disagreement(program, item.problem))
    times: dict[str, list[float]] = {}
    for k in range(repetitions * len(numbers)):
        item = numbers[k % len(numbers)]
        tasks: dict[str, Callable[[], float]] = {
            "update": partial(_update, program, item.arguments),
            "solve": partial(_solve, program, item.problem),
        }
        if with_raw:
            tasks["raw"] = partial(_solve_raw, item.problem)
        for name, values in in_turn(tasks, 1).items():
            times.setdefault(name, []).extend(values)
    solve = times["solve"]
    section.add("program.solve()", solve, target=TIME_LIMIT)
    both = [a + b for a, b in zip(times["update"], solve, strict=True)]
    section.add("update + solve", both, target=TIME_LIMIT)
    if with_raw:
        section.add("raw Clarabel", times["raw"])
        section.add("program.solve() / raw", ratios(solve, times["raw"]), "x", RATIO_LIMIT)
        section.add("(update + solve) / raw", ratios(both, times["raw"]), "x", RATIO_LIMIT)
        section.checks.append(
            f"same problem: optimal costs differ by {worst:.0e} of J at most (allowed {AGREE:.0e});"
            f" every timed solve, {len(solve)} each, was successful with no row violated by more than {AGREE:.0e}"
        )
    else:
        section.checks.append("no ratio: the raw solver is not installed (pip install clarabel)")
    section.checks.append(
        f"{len(numbers)} linearisations; {first.A.shape[1]} variables,"
        f" {first.equalities} equalities, {first.b.size - first.equalities} inequalities"
    )
    return section


def problems(scenario: Scenario) -> tuple[HorizonProgram, list[Numbers]]:
    """The program that plans this scenario's motion, and the numbers it was solved with, in order."""
    calls: list[tuple[HorizonProgram, tuple[Any, ...]]] = []
    update = HorizonProgram.update

    def spy(program: HorizonProgram, *arguments: Any) -> None:
        calls.append((program, arguments))
        update(program, *arguments)

    planner = Planner(scenario)
    with patch.object(HorizonProgram, "update", spy):
        planner.plan()
    program = calls[-1][0]
    found = []
    for other, arguments in calls:
        if other is program:  # else the elastic one, which names what an infeasible program lacks
            program.update(*arguments)
            if program.solve().success:
                found.append(Numbers(arguments, raw.matrices(program.prog)))
    return program, found


def _update(program: HorizonProgram, arguments: tuple[Any, ...]) -> float:
    return timed(lambda: program.update(*arguments))[0]


def _solve(program: HorizonProgram, problem: raw.Matrices) -> float:
    elapsed, solution = timed(program.solve)
    violation = max(solution.residual, problem.violation(solution.w / program.layout.units()))
    if not solution.success or violation > AGREE:
        raise RuntimeError(f"program.solve(): {solution.status}, residual {violation:.1e}")
    return elapsed


def _solve_raw(problem: raw.Matrices) -> float:
    elapsed, solution = timed(lambda: raw.solve(problem))
    violation = problem.violation(solution.x)
    if str(solution.status) != "Solved" or violation > AGREE:
        raise RuntimeError(f"raw Clarabel: {solution.status}, residual {violation:.1e}")
    return elapsed


def _disagreement(program: HorizonProgram, problem: raw.Matrices) -> float:
    """Relative difference of the two optimal costs; raises RuntimeError where it is not that of one problem."""
    w = program.solve().w / program.layout.units()
    cost, raw_cost = problem.objective(w), raw.solve(problem).obj_val + problem.constant
    difference = abs(cost - raw_cost) / max(1.0, abs(raw_cost))
    if difference > AGREE:
        raise RuntimeError(f"Drake and raw Clarabel solve different problems: {cost} and {raw_cost}")
    return difference
