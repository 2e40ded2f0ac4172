"""J of the convex programs' solution beside that of the nonlinear program, from random starts."""

from __future__ import annotations

import statistics
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.contenders import casadi_plan
from bench.replan import DEVIATION, Array, decision, joint_rows, moving
from bench.results import Section, Target
from flipdiagram.errors import PlanningError
from flipdiagram.planning import Planner
from flipdiagram.planning.arm_motion import task_pose
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.horizon import STRIDE, Layout
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario

STARTS = 50
WITHIN = 1e-3
"""J may be above the reference's by this fraction."""
REACH = 0.14
"""Starts at rest lie within this distance of the target [m], those of the paper."""
FEASIBLE = 1e-6
PASSES = 8
"""Most problems that IPOPT is given per reference, each with joint rows about the last solution."""
REGION, SETTLED = 0.5, 1e-3
"""θ [rad] within which joint rows are used, and within which they have settled."""
NEAR = 0.05
"""Difference of θ [rad] up to which two motions are the same optimum."""
TEXT = (
    "Half of the starts are states of the default plan on its way, off by a random deviation, planned again; the other"
    " half are at rest at a random y within {reach} m, on the default plan's samples. Ours = successive convexification"
    " with the condensed program, settled to planner.angle_tolerance. Reference = the nonlinear program by CasADi and"
    " IPOPT, true cone, from our motion and from the first guess, the better of the two; its joint limits are rows"
    " about its own motion, settled. J is eq. (5); what is minimised is J + smoothing."
)


@dataclass(frozen=True)
class Case:
    """One start: how J and J + smoothing compare with the reference, as ratios less one, and why."""

    name: str
    cost: float
    excess: float
    objective_excess: float
    violation: float
    reason: str
    beyond: int
    """Attempts of IPOPT that gave no reference."""
    replanned: float | None
    """J as Replanner left it, not settled further, as a ratio to the settled one less one."""


def measure(starts: int = STARTS) -> Section:
    """Compare the optima from `starts` starts that have a motion."""
    section = Section(f"J beside a nonlinear reference, {starts} starts", TEXT.format(reach=REACH))
    scenario = Scenario()
    arm = arm_of(scenario)
    planner = Planner(scenario, arm)
    plan, failed = planner.plan(), [0, 0]
    cases: list[Case] = []
    sources = (_in_motion(planner, plan, failed), _at_rest(scenario, arm, plan, failed))
    while len(cases) < starts:
        cases.append(next(sources[len(cases) % 2]))
    good = [case.excess <= WITHIN for case in cases]
    section.add("share of starts with J within 0.1 %", [sum(good) / len(good)], "x", Target(">=", 1.0))
    total = [case.objective_excess <= WITHIN for case in cases]
    section.add("the same of J + smoothing", [sum(total) / len(total)], "x")
    excess = [100 * case.excess for case in cases]
    section.checks.append(
        f"J less the reference's: median {statistics.median(excess):+.4f} %, from {min(excess):+.4f} % to"
        f" {max(excess):+.4f} %; J from {min(c.cost for c in cases):.3f} to {max(c.cost for c in cases):.3f};"
        f" our motions violate the true constraints by {max(c.violation for c in cases):.0e} at most"
    )
    beyond = sum(case.beyond for case in cases)
    section.checks.append(
        f"{beyond} of {2 * len(cases)} attempts of IPOPT gave no reference: infeasible, out of the arm's reach, or not"
        f" settled in {PASSES} passes"
    )
    early = [abs(case.replanned) for case in cases if case.replanned is not None]
    section.checks.append(f"J as Replanner leaves it differs from the settled one by {100 * max(early):.4f} % at most")
    section.checks.append(f"left out, without a motion: {failed[0]} starts on the way, {failed[1]} at rest")
    for case in cases:
        if case.excess > WITHIN:
            section.checks.append(f"NOT within: {case.name}, J {100 * case.excess:+.2f} %: {case.reason}")
    return section


def _in_motion(planner: Planner, plan: Plan, failed: list[int]) -> Iterator[Case]:
    rng, scenario, arm = np.random.default_rng(1), planner.scenario, planner.arm
    path = arm.inverse_kinematics_path(task_pose(plan.states, scenario.task.start_x), planner.q_start)
    replanner = Replanner(scenario, arm)
    replanner.horizons._program = replanner.horizons.program("daqp")  # type: ignore[assignment]
    while True:
        passed = int(rng.integers(2, plan.n_contact - 4))
        state = plan.states[passed] + DEVIATION * rng.normal(size=6)
        old = Trajectory(
            plan.states[passed:].copy(),
            plan.inputs[passed:],
            plan.n_contact - passed,
            plan.n_flight,
            plan.sampling_time,
        )
        old.states[0] = state
        try:
            again = replanner.replan(state, plan, passed * plan.sampling_time, path[passed])
            waiting = replanner.horizons.layout.release - again.n_contact
            point = Trajectory(
                np.vstack([np.tile(again.states[0], (waiting, 1)), again.states]),
                np.vstack([np.zeros((waiting, 3)), again.inputs]),
                again.n_contact,
                again.n_flight,
                plan.sampling_time,
            )
            yield compare(replanner.horizons, point, old, f"on the way, sample {passed}", again.cost)
        except PlanningError:
            failed[0] += 1


def _at_rest(scenario: Scenario, arm: ArmModel, plan: Plan, failed: list[int]) -> Iterator[Case]:
    rng = np.random.default_rng(2)
    horizons = Convexification(scenario, arm)
    while True:
        y = float(rng.uniform(-REACH, REACH)) + scenario.task.target_y
        moved = scenario.with_overrides({"task.start_y": y})
        horizons = Convexification(moved, arm)
        horizons._program = horizons.program("daqp")  # type: ignore[assignment]
        try:
            guess = horizons.guess(plan.n_contact, plan.n_flight)
            yield compare(horizons, guess, moving(horizons, guess), f"at rest, y = {y:+.3f} m", None)
        except PlanningError:
            failed[1] += 1


def compare(
    horizons: Convexification, point: Trajectory, guess: Trajectory, name: str, replanned: float | None
) -> Case:
    """Settle from `point`, solve the nonlinear program from there and from `guess`, and compare.

    Raises PlanningError where no motion is found.
    """
    settings = horizons.scenario.planner
    outcome = horizons.settle(point, settings.angle_tolerance, settings.max_iterations)
    if outcome.shortfall or not outcome.settled:
        raise PlanningError("no motion")
    ours = moving(horizons, outcome.point)
    here = casadi_plan.prepare(horizons.scenario, ours, joint_rows(horizons, ours))(decision(ours), only_evaluate=True)
    found = [reference for reference in (_reference(horizons, motion) for motion in (ours, guess)) if reference]
    if not found:
        return Case(name, outcome.cost, np.inf, np.inf, here.violation, "no reference: IPOPT did not settle", 2, None)
    best = min(found, key=lambda reference: reference.objective)
    difference = float(np.max(np.abs(motion_of(best.w)[0][:, 2] - ours.states[:, 2])))
    kind = "another local optimum" if difference > NEAR else "the same optimum"
    total = here.objective / best.objective - 1
    early = None if replanned is None else replanned / outcome.cost - 1
    reason = f"{kind} (θ differs by {difference:.3f} rad), J + smoothing {100 * total:+.2f} %"
    return Case(name, outcome.cost, here.cost / best.cost - 1, total, here.violation, reason, 2 - len(found), early)


def _reference(horizons: Convexification, motion: Trajectory) -> casadi_plan.Reference | None:
    """The nonlinear optimum that is reached from a motion, its joint rows taken about itself; None if there is none."""
    for _ in range(PASSES):
        try:
            joints = joint_rows(horizons, motion)
        except PlanningError:  # the arm cannot follow
            return None
        found = casadi_plan.prepare(horizons.scenario, motion, joints, REGION)(decision(motion))
        if found.violation > FEASIBLE:
            return None
        states, inputs = motion_of(found.w)
        change = float(np.max(np.abs(states[:, 2] - motion.states[:, 2])))
        motion = replace(motion, states=states, inputs=inputs)
        if change < SETTLED:
            return found
    return None


def motion_of(w: Array) -> tuple[Array, Array]:
    """States and inputs of a decision vector."""
    return Layout(len(w) // STRIDE, 0).unpack(w)
