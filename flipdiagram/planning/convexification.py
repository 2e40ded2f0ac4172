"""Successive convexification of one horizon: linearise, solve the quadratic program, again until θ settles."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import constraints, limits
from flipdiagram.planning.arm_motion import ArmMotion, JointMotion, arm_motion, task_pose
from flipdiagram.planning.condensed import CondensedProgram
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import LandingCost, flight
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.program import HorizonProgram, Solution
from flipdiagram.planning.rows import Linearisation, Rows
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import loaded_arm_of
from flipdiagram.robot.reach import remedy
from flipdiagram.scenario.scenario import Scenario, farthest
from flipdiagram.theory import contact

Program = HorizonProgram | CondensedProgram
CONDENSED = "daqp"
"""`planner.solver` by which the condensed program is chosen."""
ELASTIC = "clarabel"
"""Solver of the elastic program where the plain one is the condensed program."""
PLANNED = ("tool", "object", "table", "task", "planner")
"""Sections whose numbers stand in the program."""
GROUPS = (*constraints.GROUPS, *limits.KINDS)
FIRST_TRUST = 1.0
"""Trust radius on θ [rad] of the first linearisation; halved whenever the iterates move apart."""
LEAST_TRUST = 1e-3
"""Trust radius [rad] below which a path that the arm cannot follow is given up."""
SWING = 0.4
"""A change of θ back against the last one, by more than this fraction of it, is a swing, and damped."""
SLACK_TOLERANCE = 1e-4
CACHED = 32
"""Horizons of which is kept on what variables their constraints depend, the last ones used."""


@dataclass(frozen=True)
class Outcome:
    """One horizon, settled or not: its trajectory, J, and the slack that remained (0 where all constraints hold)."""

    point: Trajectory
    linearised_at: Trajectory
    cost: float
    settled: bool
    slack: dict[str, float]
    solution: Solution
    motion: JointMotion

    @property
    def shortfall(self) -> float:
        """Sum of the slacks, 0 where all constraints hold."""
        total = sum(self.slack.values())
        return total if total > SLACK_TOLERANCE else 0.0

    @property
    def rank(self) -> tuple[float, float]:
        """Smaller is better: first whether the constraints hold, then J."""
        return (self.shortfall, self.cost)


TURN = (0.8, 1.6, 2.4)
"""Angles θ [rad] to which an arm that knows no home must be able to turn at the start."""


class Convexification:
    """Solves single horizons of a scenario.  The program is built here, once; `settle` changes its numbers.

    native: linearise by machine code, equal to rounding; None: where the solver is the condensed program's.
    """

    def __init__(self, scenario: Scenario, arm: ArmModel, native: bool | None = None) -> None:
        self.scenario, self.arm = scenario, arm
        settings, task = scenario.planner, scenario.task
        self.layout = Layout(settings.contact_samples[1], settings.samples_to_rest)
        self.cost = LandingCost(settings.alpha, settings.beta, task.target_y)
        self.allowed = limits.Allowed.of(arm, scenario)
        self.start = np.array([task.start_y, task.start_z, 0.0, 0.0, 0.0, 0.0])
        self.shift, self._in_motion = 0.0, False
        self.program_times: list[float] = []
        self.deadline = math.inf  # of time.process_time()
        self._native = settings.solver == CONDENSED if native is None else native
        self._linearisation = lru_cache(CACHED)(self._make_linearisation)

    def compile(self) -> None:
        """Compile now, not in the middle of a motion, whatever is to be compiled; else that is at the first need."""
        assert self.motion and self._program
        self._linearisation(self.layout.release, 1, 0.0).at(np.zeros(self.layout.size))

    @cached_property
    def _program(self) -> Program:
        return self.program(self.scenario.planner.solver)

    @cached_property
    def motion(self) -> ArmMotion:
        """How the arm moves."""
        return arm_motion(self.arm, self.scenario.task.start_x, self._native, loaded_arm_of(self.scenario))

    def program(self, solver: str, elastic_groups: Sequence[str] = ()) -> Program:
        """The program of a `planner.solver`; with elastic groups it has slacks, which only Drake's programs offer.

        Raises InputError where the solver is not built in or has no licence.
        """
        numbers = self.layout, self.scenario.planner.sampling_time, self.cost, self.scenario.planner.smoothing
        if solver == CONDENSED and not elastic_groups:
            return CondensedProgram(*numbers)
        return HorizonProgram(*numbers, ELASTIC if solver == CONDENSED else solver, elastic_groups)

    @cached_property
    def _elastic(self) -> Program:
        return self.program(self.scenario.planner.solver, GROUPS)

    @cached_property
    def q_start(self) -> Floats:
        """Joint angles at the start of the motion [rad]; raises PlanningError where the arm cannot be there."""
        pose = task_pose(self.start, self.scenario.task.start_x)
        turned = [pose + [0.0, 0.0, angle, 0.0, 0.0, 0.0] for angle in TURN]
        try:
            return self.arm.inverse_kinematics(pose, through=turned)
        except PlanningError as error:
            raise PlanningError(f"{error}; {remedy(self.scenario, self.arm, pose, turned)}") from None

    def restart(
        self, state: Floats, q_seed: Floats, shift: float = 0.0, divisors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ) -> None:
        """Begin at another state x̂ (6,) of the object, in motion; q_seed (n,) [rad] are joint angles near it.

        shift: how far the object sits from the middle of the blade along s [m]; divisors: of the joints' limits.
        Raises PlanningError where the arm cannot be there.
        """
        self.allowed = limits.Allowed.of(self.arm, self.scenario, divisors)
        self.motion.shift_load(shift)
        self.start, self.shift, self._in_motion = state, shift, True
        tool = self._tool(state[None, :])[0]
        self.q_start = self.motion.joint_angles(task_pose(tool, self.scenario.task.start_x), q_seed)

    def _tool(self, states: Floats) -> Floats:
        """States (..., 6) of the tool's control point under an object with these states; velocities as they are."""
        if not self.shift:
            return states
        tool = states.copy()
        tool[..., :2] -= self.shift * contact.tool_tangent(states[..., 2])
        return tool

    def guess(self, n_contact: int, n_flight: int) -> Trajectory:
        """First linearisation that the arm can follow: the tool turns with constant angular acceleration, the object
        held by I = |g|, in place or else while it moves towards the middle of the workspace.

        Raises PlanningError where the arm can follow neither.
        """
        lost: PlanningError | None = None
        for share in (0.0, 0.5, 1.0):
            point = self._turn(n_contact, n_flight, share)
            try:
                self._follow(point)
            except PlanningError as error:
                lost = lost or error
            else:
                return point
        raise PlanningError(f"reachability cannot be met: {lost}")

    def _turn(self, n_contact: int, n_flight: int, share_of_way: float) -> Trajectory:
        layout, dt, task = self.layout, self.scenario.planner.sampling_time, self.scenario.task
        elapsed = np.arange(layout.intervals + 1) - (layout.release - n_contact)
        share = np.clip(elapsed / n_contact, 0.0, 1.0)
        states = np.tile(self.start, (layout.intervals + 1, 1))
        turn = np.pi / 2 + 0.2
        states[:, 2] = turn * share**2
        states[:, 5] = np.where((share > 0) & (elapsed <= n_contact), 2 * turn * share / (n_contact * dt), 0.0)
        middle = np.array([np.mean(task.workspace_y), np.mean(task.workspace_z)])
        states[:, :2] += share_of_way * share[:, None] ** 2 * (middle - self.start[:2])
        inputs = np.zeros((layout.intervals, 3))
        inputs[:, :2] = contact.acceleration(abs(contact.GRAVITY_Z), 0.0, states[:-1, 2])
        return Trajectory(states, inputs, n_contact, n_flight, dt)

    def _follow(self, point: Trajectory) -> JointMotion:
        states, inputs = self.moving(point)
        return self.motion.follow(self._tool(states), inputs, self.q_start, point.n_contact)

    def rows(self, point: Trajectory) -> tuple[Rows, JointMotion]:
        """All inequality rows, linearised about a trajectory, and the arm's motion along it."""
        motion, w = self._follow(point), self.layout.pack(point.states, point.inputs)
        others = self._linearisation(point.n_contact, point.n_flight, self.shift).at(w)
        joints = limits.joint_rows(self.layout, motion, self.moving(point), self.motion, self.allowed, self._in_motion)
        return Rows.about(w, [others, *joints]), motion

    def _make_linearisation(self, n_contact: int, n_flight: int, shift: float) -> Linearisation:
        """That of the constraints other than joint limits."""
        horizon = constraints.of_horizon(self.layout, self.scenario, n_contact, n_flight, shift)
        return Linearisation(horizon, self._native)

    def solve(self, point: Trajectory, trust: float, elastic: bool = False) -> tuple[Solution, JointMotion]:
        """One quadratic program, linearised about a trajectory."""
        rows, motion = self.rows(point)
        program = self._elastic if elastic else self._program
        landing = constraints.landing_row(self.layout, point, self.scenario)
        start, waiting = self.start.copy(), self.layout.release - point.n_contact
        start[:3] -= waiting * point.sampling_time * start[3:]  # the waiting samples lead up to it at constant speed
        program.update(start, point, landing, rows, trust)
        solution = program.solve()
        self.program_times.append(solution.solve_time)
        return solution, motion

    def settle(self, point: Trajectory, tolerance: float, iterations: int, rescue: bool = True) -> Outcome:
        """Re-linearise and re-solve until no θ moves more than the tolerance [rad].

        Where the plain program has no solution the elastic one leads on, unless `rescue` is off.  Raises PlanningError
        where the arm loses the path, the solver gives up, or the deadline has passed.
        """
        trust, last_step, last_change, elastic = FIRST_TRUST, np.zeros(1), np.inf, False
        outcome: Outcome | None = None
        for number in range(iterations):
            if time.process_time() > self.deadline:
                at = f"linearisation {number + 1} of {point.n_contact} contact and {point.n_flight} flight samples"
                raise PlanningError(f"planning took too long: it gave up at {at}")
            try:
                solution, motion = self.solve(point, trust, elastic)
            except PlanningError as error:
                if not rescue:
                    raise
                trust /= 2
                if outcome is None:
                    point = self.guess(point.n_contact, point.n_flight)
                elif trust > LEAST_TRUST:
                    # the arm lost the path: go back half-way to where it could follow, and step less far
                    point = outcome.linearised_at.between(point)
                elif outcome.slack:
                    return outcome
                else:
                    raise PlanningError(f"reachability cannot be met: {error}") from None
                continue
            if not solution.success:
                if not rescue:
                    raise PlanningError(f"the program has no solution: {solution.status}")
                if elastic:
                    far = ", ".join(farthest(self.scenario, PLANNED)) or "every number is at its default"
                    raise PlanningError(f"the solver gave up: {solution.status}; farthest from the defaults: {far}")
                elastic = True
                continue
            states, inputs = self.layout.unpack(solution.w)
            following = replace(point, states=states, inputs=inputs)
            landing, offset = flight(point.n_flight * point.sampling_time)
            cost = self.cost(landing @ states[self.layout.release] + offset)
            step = states[:, 2] - point.states[:, 2]
            change = float(np.max(np.abs(step)))
            slack = {name: value for name, value in solution.slack.items() if value > SLACK_TOLERANCE}
            settled = change < tolerance and not elastic
            outcome = Outcome(following, point, cost, settled, slack, solution, motion)
            if change < tolerance and (settled or slack):
                break
            # once the slacks are gone the plain program has a solution too
            elastic = bool(slack)
            if change > last_change:
                trust = max(trust / 2, 2 * tolerance)
            # far from the last trajectory a linearisation errs and the iterates swing; half-way damps it
            swings = change > SWING * last_change and float(np.sum(step * last_step)) < 0
            point = point.between(following) if swings else following
            last_step, last_change = step, change
        if outcome is None:
            raise PlanningError(f"no motion found within {iterations} linearisations")
        return outcome

    def moving(self, point: Trajectory) -> tuple[Floats, Floats]:
        """States and inputs without the waiting samples."""
        first = self.layout.release - point.n_contact
        return point.states[first:], point.inputs[first:]

    def plan_of(self, outcome: Outcome, uses: Mapping[str, Floats], begin: float) -> Plan:
        """The plan of an outcome; uses: of the joint limits; begin: of planning, by time.perf_counter() [s]."""
        point, (states, inputs) = outcome.point, self.moving(outcome.point)
        k = np.arange(point.n_contact)
        phi = [contact.sliding_angle(inputs[k, :2], states[at, 2]) for at in (k, k + 1)]
        return Plan(
            sampling_time=point.sampling_time,
            n_contact=point.n_contact,
            n_flight=point.n_flight,
            n_brake=self.layout.n_brake,
            states=states,
            inputs=inputs,
            cost=outcome.cost,
            residual=outcome.solution.residual,
            max_sliding_angle=float(np.max(np.abs(phi))),
            friction_angle=float(contact.friction_angle(self.scenario.object.friction)),
            limit_use={kind: float(use.max()) for kind, use in uses.items()},
            solver=self.scenario.planner.solver,
            iterations=len(self.program_times),
            solve_time=time.perf_counter() - begin,
            program_times=tuple(self.program_times),
            passed=point.passed,
            limit_divisors=self.allowed.divisors,
        )
