"""The rest of a motion planned again: the condensed program beside raw DAQP, Clarabel, and CasADi + IPOPT."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import daqp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from bench import raw
from bench.contenders import casadi_plan
from bench.resolve import AGREE
from bench.results import Section, Target
from bench.timing import SelfTimes, in_turn, timed
from flipdiagram.errors import PlanningError
from flipdiagram.planning import Planner, limits
from flipdiagram.planning.arm_motion import ArmMotion, task_pose
from flipdiagram.planning.condensed import CondensedProgram
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification, Program
from flipdiagram.planning.dense import EQUALITY, TOLERANCE
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.program import HorizonProgram, Solution
from flipdiagram.planning.replanner import Replanner
from flipdiagram.planning.rows import Rows
from flipdiagram.robot.parts import arm_of, loaded_arm_of
from flipdiagram.scenario.scenario import Scenario

PASSED, FLIGHT, BRAKE = 11, 5, 12
"""Samples of the motion that have passed when it is planned again; samples of its flight and braking."""
DEVIATION = np.array([0.002, 0.002, 0.01, 0.02, 0.02, 0.1])
"""Standard deviation of the state from the plan [m, m, rad; per second]: what the weaker architectures are off by."""
STARTS = 20
MEDIAN, WORST = {25: Target("<", 0.001), 50: Target("<", 0.004)}, {25: Target("<", 0.003)}
RAW, NONLINEAR = Target("<", 1.3), Target(">=", 20.0)
TEXT = (
    "A plan is followed for {passed} samples; from there, off by a random deviation, its remaining {n} intervals are"
    " planned again by Replanner, {starts} times with different deviations. Each QP that this took is then measured:"
    " new numbers written into the condensed program (update) and solved by DAQP, solution checked (solve). raw ="
    " DAQP's own Python interface on the very matrices of that program, all rows, without a guess. Clarabel = the same"
    " QP through HorizonProgram. IPOPT = the nonlinear problem, true cone, from the old plan, against all QPs of a"
    " replan. Whole replan ="
    " Replanner.replan: linearising with the arm's kinematics and dynamics, all its QPs until settled, the plan."
    " Alternating, in one process."
)

Array = NDArray[np.float64]


class Recorder:
    """A program that keeps what `update` was given."""

    def __init__(self, program: Program) -> None:
        self.program, self.calls = program, list[tuple[Any, ...]]()
        self.layout, self.sampling_time, self.cost = program.layout, program.sampling_time, program.cost

    def update(self, *arguments: Any) -> None:
        """Pass it on."""
        self.calls.append(arguments)
        self.program.update(*arguments)

    def solve(self) -> Solution:
        """Pass it on."""
        return self.program.solve()


@dataclass(frozen=True)
class Replan:
    """A replan that succeeded: where it began, what its QPs were given, and the plan found."""

    state: Array
    q: Array
    calls: list[tuple[Any, ...]]
    plan: Plan


def followed(intervals: int) -> tuple[Scenario, Plan]:
    """A scenario whose program has `intervals` intervals, and a plan of which as many are left after `PASSED`."""
    contact = intervals - BRAKE
    fixed = {"planner.flight_samples": (FLIGHT, FLIGHT), "planner.stop": "brake", "planner.brake_samples": BRAKE}
    longer = Scenario().with_overrides({"planner.contact_samples": (contact + PASSED,) * 2, **fixed})
    return Scenario().with_overrides({"planner.contact_samples": (contact, contact), **fixed}), Planner(longer).plan()


def replans(replanner: Replanner, plan: Plan, count: int, seed: int = 0) -> tuple[list[Replan], int]:
    """`count` replans from random deviations, with the condensed program; and how many others found no motion."""
    rng, found, failed = np.random.default_rng(seed), list[Replan](), 0
    recorder = Recorder(replanner.horizons.program("daqp"))
    replanner.horizons._program = recorder  # type: ignore[assignment]
    scenario = replanner.scenario
    q_path = replanner.arm.inverse_kinematics_path(
        task_pose(plan.states[: PASSED + 1], scenario.task.start_x), Planner(scenario, replanner.arm).q_start
    )
    while len(found) < count:
        state = plan.states[PASSED] + DEVIATION * rng.normal(size=6)
        recorder.calls.clear()
        try:
            new = replanner.replan(state, plan, PASSED * plan.sampling_time, q_path[-1])
        except PlanningError:
            failed += 1
            if failed > 5 * count:
                raise
            continue
        found.append(Replan(state, q_path[-1], list(recorder.calls), new))
    replanner.horizons._program = recorder.program  # type: ignore[assignment]
    return found, failed


def measure(intervals: int, repetitions: int, starts: int = STARTS) -> Section:
    """Each QP of the replans `repetitions` times.  Raises RuntimeError where a solve fails or the engines disagree."""
    scenario, plan = followed(intervals)
    replanner = Replanner(scenario, arm_of(scenario))
    found, failed = replans(replanner, plan, starts)
    fast, drake = (replanner.horizons.program(solver) for solver in ("daqp", "clarabel"))
    assert isinstance(fast, CondensedProgram) and isinstance(drake, HorizonProgram)
    worst, problems = 0.0, []
    for call in [call for item in found for call in item.calls]:
        drake.update(*call)
        fast.update(*call)
        problem = raw.matrices(drake.prog)
        problems.append((call, problem))
        worst = max(worst, _disagreement(fast, drake, problem))
    times: dict[str, list[float]] = {}
    processor = list[float](), list[float]()
    for _ in range(repetitions):
        for call, problem in problems:
            sparse = {
                "clarabel update": partial(_update, drake, call),
                "clarabel solve": partial(_solve, drake, problem),
            }
            condensed = {
                "update": partial(_update, fast, call, processor[0]),
                "solve": partial(_solve, fast, problem, processor[1]),
            }
            # Clarabel before both: the processor's caches are as cold for the one as for the other
            for tasks in (sparse, condensed, sparse, {"raw": partial(_raw, fast)}):
                for name, values in in_turn(tasks, 1).items():
                    times.setdefault(name, []).extend(values)
    section = Section(f"Replan at N = {intervals}", TEXT.format(n=intervals, passed=PASSED, starts=starts))
    both = [a + b for a, b in zip(times["update"], times["solve"], strict=True)]
    clarabel = [a + b for a, b in zip(times["clarabel update"][::2], times["clarabel solve"][::2], strict=True)]
    section.add("QP: update + solve", both, target=MEDIAN[intervals])
    section.add("update", times["update"], indent=1)
    section.add("solve", times["solve"], indent=1)
    section.add("99 of 100 within", [float(np.quantile(both, 0.99))], target=WORST.get(intervals))
    section.add("99 of 100 within, processor time", [float(np.quantile(np.sum(processor, axis=0), 0.99))])
    section.add("raw DAQP", times["raw"])
    section.add("(update + solve) / raw", [a / b for a, b in zip(both, times["raw"], strict=True)], "x", RAW)
    section.add("Clarabel: update + solve", clarabel)
    section.add("Clarabel / (update + solve)", [a / b for a, b in zip(clarabel, both, strict=True)], "x")
    if find_spec(casadi_plan.PACKAGE):
        _against_ipopt(section, replanner, plan, found, fast)
    else:
        section.checks.append(f"no nonlinear reference: pip install {casadi_plan.PACKAGE}")
    _whole(section, replanner, plan, found, fast, intervals, repetitions)
    section.checks.append(
        f"every timed solve, {len(both)} of DAQP and of Clarabel, was successful with no row violated by more than"
        f" {AGREE:.0e}; optimal costs differ by {worst:.0e} of J at most"
    )
    qps = [len(item.calls) for item in found]
    section.checks.append(
        f"{statistics.mean(qps):.1f} QPs a replan ({min(qps)} to {max(qps)});"
        f" {failed} more deviations of which none led to a motion were left out"
    )
    return section


def _update(program: Program, call: tuple[Any, ...], processor: list[float] | None = None) -> float:
    elapsed, (used, _) = timed(lambda: timed(lambda: program.update(*call), time.thread_time))
    if processor is not None:
        processor.append(used)
    return elapsed


def _solve(program: Program, problem: raw.Matrices, processor: list[float] | None = None) -> float:
    elapsed, (used, solution) = timed(lambda: timed(program.solve, time.thread_time))
    if processor is not None:
        processor.append(used)
    violation = max(solution.residual, problem.violation(solution.w / program.layout.units()))
    if not solution.success or violation > AGREE:
        raise RuntimeError(f"{type(program).__name__}: {solution.status}, residual {violation:.1e}")
    return elapsed


def _raw(program: CondensedProgram) -> float:
    """DAQP on the matrices that the last update made."""
    assert program.program is not None
    f, A, low, high, equalities, *_ = program.program
    unit, kind = np.eye(f.size), np.zeros(low.size, dtype=np.int32)
    kind[:equalities] = EQUALITY
    elapsed, (_, _, flag, _) = timed(lambda: daqp.solve(unit, f, A, high, low, kind, primal_tol=TOLERANCE))
    if flag != 1:
        raise RuntimeError(f"raw DAQP: exit flag {flag}")
    return elapsed


def _disagreement(fast: CondensedProgram, drake: HorizonProgram, problem: raw.Matrices) -> float:
    """Relative difference of the two optimal costs; raises RuntimeError where it is not that of one problem."""
    cost, other = (problem.objective(program.solve().w / program.layout.units()) for program in (fast, drake))
    if (difference := abs(cost - other) / max(1.0, abs(other))) > AGREE:
        raise RuntimeError(f"DAQP and Clarabel solve different problems: {cost} and {other}")
    return difference


def _against_ipopt(
    section: Section, replanner: Replanner, plan: Plan, found: list[Replan], fast: CondensedProgram
) -> None:
    slow, quick = [], []
    for item in found:
        old = Trajectory(
            plan.states[PASSED:].copy(), plan.inputs[PASSED:], item.plan.n_contact, plan.n_flight, plan.sampling_time
        )
        old.states[0] = item.state
        new = replace(old, states=item.plan.states, inputs=item.plan.inputs)
        solve = casadi_plan.prepare(replanner.scenario, old, joint_rows(replanner.horizons, new))
        reference = solve(decision(old))
        if not reference.success:
            raise RuntimeError(f"IPOPT: {reference.status}")
        slow.append(reference.time)
        quick.append(sum(_update(fast, call) + timed(fast.solve)[0] for call in item.calls))
    section.add("IPOPT, the nonlinear problem", slow)
    section.add("all QPs of a replan", quick)
    section.add("IPOPT / all QPs of a replan", [a / b for a, b in zip(slow, quick, strict=True)], "x", NONLINEAR)


def _whole(
    section: Section,
    replanner: Replanner,
    plan: Plan,
    found: list[Replan],
    fast: CondensedProgram,
    intervals: int,
    repetitions: int,
) -> None:
    """The time of Replanner.replan; then, in further calls whose clocks cost time themselves, of its parts."""
    replanner.horizons._program = fast  # type: ignore[assignment]
    elapsed, whole, residual = PASSED * plan.sampling_time, list[float](), 0.0
    calls = [partial(replanner.replan, item.state, plan, elapsed, item.q) for item in found]
    for _ in range(repetitions):
        for call in calls:
            seconds, new = timed(call)
            whole.append(seconds)
            residual = max(residual, new.residual)
    if residual > AGREE:
        raise RuntimeError(f"a whole replan left a residual of {residual:.1e}")
    names = ("linearised rows", "arm kinematics and dynamics", "QPs")
    own, parts = SelfTimes(), {name: list[float]() for name in names}
    with (
        own.of_method(Convexification, "rows", names[0]),
        own.of_method(ArmMotion, "follow", names[1]),
        own.of_method(CondensedProgram, "update", names[2]),
        own.of_method(CondensedProgram, "solve", names[2]),
    ):
        for call in calls:
            call()
            for name, seconds in own.take().items():
                parts[name].append(seconds)
    section.whole = section.add("whole replan", whole, target=MEDIAN[intervals])
    for name, values in parts.items():
        section.add(name, values, indent=1)
    section.add("99 of 100 within", [float(np.quantile(whole, 0.99))], target=WORST.get(intervals))
    slow = _by_numpy(replanner, calls)
    section.add("whole replan, rows by NumPy and Drake", slow)
    section.add("rows by NumPy and Drake / whole replan", [statistics.median(slow) / statistics.median(whole)], "x")


def _by_numpy(replanner: Replanner, calls: list[partial[Plan]]) -> list[float]:
    """The same without compiled loops: laws by NumPy, the arm by Drake."""
    horizons = replanner.horizons
    kept, scenario = horizons.motion, replanner.scenario
    horizons.motion = ArmMotion(replanner.arm, scenario.task.start_x, loaded_arm_of(scenario))
    horizons._native = False
    horizons._linearisation.cache_clear()
    try:
        return [timed(call)[0] for call in calls]
    finally:
        horizons.motion, horizons._native = kept, True
        horizons._linearisation.cache_clear()


def joint_rows(horizons: Convexification, motion: Trajectory) -> tuple[sp.csr_matrix, Array]:
    """The joint limits as rows on a motion without waiting samples, linearised about it."""
    layout, scenario = Layout(len(motion.inputs), 0), horizons.scenario
    arm, point = ArmMotion(horizons.arm, scenario.task.start_x, loaded_arm_of(scenario)), (motion.states, motion.inputs)
    along = arm.follow(*point, horizons.q_start, motion.n_contact)
    parts = limits.joint_rows(layout, along, point, arm, horizons.allowed, given_start=horizons._in_motion)
    rows = Rows.about(layout.pack(*point), parts)
    return rows.matrix(layout.size).tocsr(), rows.upper


def decision(point: Trajectory) -> Array:
    """The decision vector of a trajectory without waiting samples."""
    return np.append(np.hstack([point.states[:-1], point.inputs]).ravel(), point.states[-1])


def moving(horizons: Convexification, point: Trajectory) -> Trajectory:
    """A trajectory without its waiting samples."""
    first = horizons.layout.release - point.n_contact
    return replace(point, states=point.states[first:], inputs=point.inputs[first:])


def sections(repetitions: int, quick: bool) -> Iterator[Section]:
    """N = 25 and N = 50."""
    for intervals in MEDIAN:
        yield measure(intervals, repetitions, 4 if quick else STARTS)
