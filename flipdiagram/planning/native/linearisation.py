"""All rows about a trajectory, and the arm's motion along it, by compiled loops: some twenty times sooner than NumPy.

The same numbers as constraints.py and limits.py give, to rounding; tests compare the two.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import product

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import limits
from flipdiagram.planning.constraints import Geometry, Trajectory
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.limits import NEAR, STEP, Allowed, JointMotion
from flipdiagram.planning.native import chain as kinematics
from flipdiagram.planning.native import rows as row_kernels
from flipdiagram.planning.native.along import Along, speeds
from flipdiagram.planning.rows import Buffer, FilledRows
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.serial_chain import SerialChain
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.contact import GRAVITY_Z

REACHED = 1e-9
"""Largest error of a sample's task pose [m, rad], as in ArmModel.inverse_kinematics_path."""


class Linearisation:
    """Rows and joint motion of one scenario's trajectories; chain: that of the arm."""

    def __init__(self, scenario: Scenario, arm: ArmModel, chain: SerialChain, layout: Layout) -> None:
        self.scenario, self.arm, self.layout, self.chain = scenario, arm, layout, chain
        self._geometry = geometry = Geometry.of(scenario)
        task, h = scenario.task, geometry.half_thickness
        self._workspace = np.array([task.workspace_y, task.workspace_z], dtype=float)
        lower = (-h, -h - geometry.blade_thickness)
        self._blade = np.array([(sign * geometry.half_blade, n) for sign, n in product((1.0, -1.0), lower)])
        self._block = np.array([(sign * geometry.half_length, h) for sign in (1.0, -1.0)])
        self._corners = np.array([(s * geometry.half_length, n * h) for s, n in product((1.0, -1.0), repeat=2)])
        self._most_flight = scenario.planner.flight_samples[1]
        self._buffer = Buffer(*_most(layout, self._most_flight, arm.n_joints))
        self._compile()

    def _compile(self) -> None:
        """Call everything once, so that nothing is compiled in the middle of a motion; the numbers do not matter."""
        layout, home = self.layout, np.array(self.arm.home, dtype=float)
        self.joint_angles(self.arm.task_position(home), home)
        along, n = Along(self.chain, np.array([home, home]), np.zeros((2, 3))), self.arm.n_joints
        by_input = along.inertia_of_task()
        along.torques(np.zeros((2, 3)))
        with suppress(PlanningError):  # where the middle of the joint limits serves as home it may be singular
            speeds(self.chain, np.array([home, home]), np.zeros((2, 3)))
        motion = JointMotion(np.array([home, home]), along.qd, np.zeros((2, 1, n)), along.from_task[:, :, :3], by_input)
        still = Trajectory(
            np.zeros((layout.intervals + 1, 6)),
            np.zeros((layout.intervals, 3)),
            layout.release,
            1,
            self.scenario.planner.sampling_time,
        )
        allowed = Allowed.of(self.arm, self.scenario)
        self._contact_rows(still, self._buffer, 0.0)
        self._joint_rows(still.states[:2], still.inputs[:1], motion, along, allowed, 0, 0, self._buffer)

    def joint_angles(self, pose: Floats, seed: Floats) -> Floats | None:
        """q (n,) [rad] within the limits at a task pose (6,), near the seed; None where Newton's method finds none."""
        q = np.array([seed, seed], dtype=float)
        chain, target = self.chain, np.array([pose, pose])
        reached = kinematics.follow(target, REACHED, chain.axes, chain.points, chain.tip, chain.tip_turn, q)
        inside = np.all((q[1] >= self.arm.q_min) & (q[1] <= self.arm.q_max))
        return q[1] if reached == len(q) and inside else None

    def follow(self, tool: Floats, inputs: Floats, q_start: Floats) -> tuple[JointMotion, Along]:
        """limits.joint_motion for states of the tool (K, 6) and inputs (K − 1, 3); raises PlanningError alike."""
        chain = self.chain
        poses = limits.task_pose(tool, self.scenario.task.start_x)
        q = np.empty((len(tool), len(q_start)))
        q[0] = q_start
        if kinematics.follow(poses, REACHED, chain.axes, chain.points, chain.tip, chain.tip_turn, q) < len(q):
            q = self.arm.inverse_kinematics_path(poses, q_start, check_limits=False)
        along = Along(chain, q, np.ascontiguousarray(tool[:, 3:])).checked()
        by_input, rest = along.inertia_of_task(), along.torques(np.zeros((len(q), 3)))
        torque = np.empty((2, len(inputs), q.shape[1]))
        for end in (0, 1):
            at = slice(end, end + len(inputs))
            torque[end] = (by_input[at] @ inputs[:, :, None])[..., 0] + rest[at]
        return JointMotion(q, along.qd, torque, along.from_task[:, :, :3], by_input), along

    def rows(
        self, point: Trajectory, tool: Floats, q_start: Floats, allowed: Allowed, shift: float, given_start: bool
    ) -> tuple[FilledRows, JointMotion]:
        """All inequality rows about a trajectory and the arm's motion along it, as Convexification.rows."""
        if point.n_flight > self._most_flight:  # a plan made elsewhere may fly longer than this scenario's own
            self._most_flight = point.n_flight
            self._buffer = Buffer(*_most(self.layout, point.n_flight, self.arm.n_joints))
        out = self._buffer
        out.start()
        self._contact_rows(point, out, shift)
        first = self.layout.release - point.n_contact
        states, inputs = point.states[first:], np.ascontiguousarray(point.inputs[first:])
        motion, along = self.follow(tool[first:], inputs, q_start)
        self._joint_rows(states, inputs, motion, along, allowed, first, int(given_start), out)
        return out.finish(), motion

    def _contact_rows(self, point: Trajectory, out: Buffer, shift: float) -> None:
        layout, scenario, g = self.layout, self.scenario, self._geometry
        planner, states, inputs, dt = scenario.planner, point.states, point.inputs, point.sampling_time
        first, release, last = layout.release - point.n_contact, layout.release, layout.intervals
        mu = scenario.object.friction * (1 - planner.friction_margin)
        reach = g.half_length * (1 - planner.support_margin)
        row_kernels.contact(
            states,
            inputs,
            first,
            release,
            GRAVITY_Z,
            mu,
            reach,
            g.half_thickness,
            g.gyration,
            planner.minimum_normal,
            planner.release_angle,
            *out.arrays,
        )
        row_kernels.workspace(first, last, self._workspace, *out.arrays)
        floor, table = scenario.table.height + planner.table_clearance, scenario.table.height
        row_kernels.clearance(states, first, last, self._blade - [shift, 0.0], floor, *out.arrays)
        row_kernels.clearance(states, first, release, self._block, floor, *out.arrays)
        row_kernels.separation(
            states,
            release,
            point.n_flight,
            dt,
            GRAVITY_Z,
            g.half_length,
            g.half_thickness,
            planner.separation_gap,
            planner.separation_acceleration,
            *out.arrays,
        )
        row_kernels.flying(states, release, point.n_flight, dt, GRAVITY_Z, self._corners, table, *out.arrays)

    def _joint_rows(
        self,
        states: Floats,
        inputs: Floats,
        motion: JointMotion,
        along: Along,
        allowed: Allowed,
        first: int,
        decided: int,
        out: Buffer,
    ) -> None:
        P = along.from_task
        row_kernels.joint_positions(
            motion.q, P, states, first, decided, allowed.middle, allowed.half, NEAR, *out.arrays
        )
        by_pose = self._speed_by_pose(states, motion, along, allowed)
        row_kernels.joint_speeds(motion.qd, P, by_pose, states, first, decided, allowed.speed, NEAR, *out.arrays)
        by_state = self._torque_by_state(states, inputs, motion, along, allowed)
        for end in (0, 1):
            row_kernels.joint_torques(
                motion.torque[end],
                by_state[end],
                motion.torque_from_task,
                states,
                inputs,
                first,
                end,
                allowed.torque,
                NEAR,
                *out.arrays,
            )

    def _speed_by_pose(self, states: Floats, motion: JointMotion, along: Along, allowed: Allowed) -> Floats:
        """∂q̇/∂(y, z, θ) at constant v (K, n, 3) by differences, at samples where a joint is near its limit."""
        found = np.zeros((*motion.q.shape, 3))
        near = np.flatnonzero((np.abs(motion.qd) > NEAR * allowed.speed).any(axis=1))
        if near.size:
            n, P = motion.q.shape[1], along.from_task[near, :, :3].transpose(0, 2, 1)
            q = motion.q[near, None] + STEP * P
            moved = speeds(self.chain, q.reshape(-1, n), np.repeat(states[near, 3:], 3, axis=0))
            found[near] = ((moved.reshape(-1, 3, n) - motion.qd[near, None]) / STEP).transpose(0, 2, 1)
        return found

    def _torque_by_state(
        self, states: Floats, inputs: Floats, motion: JointMotion, along: Along, allowed: Allowed
    ) -> Floats:
        """∂τ/∂x̂ at constant a (2, K − 1, n, 6) at both ends of the intervals, by differences, where near the limit."""
        found = np.zeros((2, *motion.torque.shape[1:], 6))
        n = motion.q.shape[1]
        for end in (0, 1):
            near = np.flatnonzero((np.abs(motion.torque[end]) > NEAR * allowed.torque).any(axis=1))
            if not near.size:
                continue
            at = near + end
            q, v = np.repeat(motion.q[at], 6, axis=0), np.repeat(states[at, 3:], 6, axis=0)
            q.reshape(-1, 6, n)[:, :3] += STEP * along.from_task[at, :, :3].transpose(0, 2, 1)
            v.reshape(-1, 6, 3)[:, [3, 4, 5], [0, 1, 2]] += STEP
            tau = Along(self.chain, q, v).checked().torques(np.repeat(inputs[near], 6, axis=0)).reshape(-1, 6, n)
            found[end, near] = ((tau - motion.torque[end, near, None]) / STEP).transpose(0, 2, 1)
        return found


def _most(layout: Layout, n_flight: int, joints: int) -> tuple[int, int]:
    """Rows and entries that a trajectory has at most."""
    samples, apart, n = layout.intervals + 1, max(layout.n_brake, n_flight), joints
    rows = samples * (10 + 4 + 6 + 2 * n + n + 2 * n) + 2 * apart + 4 * n_flight + 1
    entries = samples * (36 + 4 + 12 + 6 * n + 6 * n + 18 * n) + 18 * apart + 16 * n_flight + 1
    return rows, entries
