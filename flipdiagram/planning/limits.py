"""Joint position, speed and torque along a motion, on the arm's own model, fed back to the plan as linear rows.

At sample k of the last trajectory, q̄ from inverse kinematics and P = J⁻¹ for the planned y, z, θ give to first order
    q ≈ q̄ + P (x − x̄),   q̇ ≈ P v + ∂q̇/∂x (x − x̄),   τ ≈ τ̄ + M P (a − ā) + ∂τ/∂x (x − x̄) + ∂τ/∂v (v − v̄).
Only joints that come near a limit enter the program; the last three derivatives are differences, taken there alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.rows import Rows
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario

POSITION = "joint position limit"
SPEED = "joint speed limit"
TORQUE = "joint torque limit"

NEAR = 0.5
"""Fraction of a limit above which a joint's rows enter the program."""
STEP = 1e-6
"""Step of the differences [m, rad; per second]."""


@dataclass(frozen=True)
class Allowed:
    """What a plan may use of the joints: |q − middle| ≤ half, |q̇| ≤ speed, |τ| ≤ torque, all (n,)."""

    middle: Floats
    half: Floats
    speed: Floats
    torque: Floats

    @classmethod
    def of(cls, arm: ArmModel, scenario: Scenario) -> Allowed:
        """The arm's limits less the scenario's margins."""
        planner, middle = scenario.planner, (arm.q_min + arm.q_max) / 2
        return cls(
            middle=middle,
            half=arm.q_max - middle - planner.position_margin,
            speed=arm.qd_max * (1 - planner.speed_margin),
            torque=arm.tau_max * (1 - planner.torque_margin),
        )

    def shares(self, arm: ArmModel) -> dict[str, Floats]:
        """Per kind of limit, the fraction of it that is allowed, by joint."""
        return {
            POSITION: self.half / (arm.q_max - self.middle),
            SPEED: self.speed / arm.qd_max,
            TORQUE: self.torque / arm.tau_max,
        }

    def tightened(self, uses: Mapping[str, Floats]) -> Allowed:
        """Less of each kind of limit that a motion exceeds (use > 1) between its samples."""
        position, speed, torque = (max(1.0, float(np.max(uses[kind]))) for kind in (POSITION, SPEED, TORQUE))
        return replace(self, half=self.half / position, speed=self.speed / speed, torque=self.torque / torque)


@dataclass(frozen=True)
class JointMotion:
    """The arm along a motion: q, qd at samples (N + 1, n); torque at both ends of each interval (2, N, n)."""

    q: Floats
    qd: Floats
    torque: Floats
    from_task: Floats
    """J⁻¹ restricted to (y, z, θ), shape (N + 1, n, 3)."""
    torque_from_task: Floats
    """dτ/da for a = (a_y, a_z, a_θ) at samples, shape (N + 1, n, 3)."""


def task_pose(states: Floats, x: float) -> Floats:
    """Six task coordinates (y, z, θ, x, pitch, yaw) of planned states (..., ≥3) in the plane at x [m]."""
    states = np.asarray(states, dtype=float)
    pose = np.zeros((*states.shape[:-1], 6))
    pose[..., :3] = states[..., :3]
    pose[..., 3] = x
    return pose


def joint_motion(arm: ArmModel, states: Floats, inputs: Floats, x: float, q_start: Floats) -> JointMotion:
    """Follow planned states (N + 1, 6) and inputs (N, 3) with the arm; raises PlanningError where it cannot reach."""
    count, n = len(states), arm.n_joints
    q = arm.inverse_kinematics_path(task_pose(states, x), q_start, check_limits=False)
    from_task, torque_from_task = np.empty((count, n, 3)), np.empty((count, n, 3))
    qd, rest = np.empty((count, n)), np.empty((count, n))
    for k in range(count):
        inverse = _inverse(arm.task_jacobian(q[k])[1])
        from_task[k] = inverse[:, :3]
        qd[k] = from_task[k] @ states[k, 3:]
        bias = arm.task_kinematics(q[k], qd[k])[3]
        torque_from_task[k] = arm.mass_matrix(q[k]) @ from_task[k]
        rest[k] = arm.inverse_dynamics(q[k], qd[k], -inverse @ bias)
    torque = np.stack(
        [np.einsum("kij,kj->ki", torque_from_task[at], inputs) + rest[at] for at in (slice(0, -1), slice(1, None))]
    )
    return JointMotion(q, qd, torque, from_task, torque_from_task)


def _inverse(jacobian: Floats) -> Floats:
    square = jacobian.shape[0] == jacobian.shape[1]
    return np.asarray(np.linalg.inv(jacobian) if square else np.linalg.pinv(jacobian), dtype=np.float64)


def _speed(arm: ArmModel, q: Floats, v: Floats) -> Floats:
    """q̇ (n,) of an arm at q whose tool moves with v (3,)."""
    return _inverse(arm.task_jacobian(q)[1])[:, :3] @ v


def _torque(arm: ArmModel, q: Floats, v: Floats, a: Floats) -> Floats:
    """τ (n,) of an arm at q whose tool moves with v (3,) and a (3,)."""
    inverse = _inverse(arm.task_jacobian(q)[1])
    qd = inverse[:, :3] @ v
    bias = arm.task_kinematics(q, qd)[3]
    return arm.inverse_dynamics(q, qd, inverse[:, :3] @ a - inverse @ bias)


def _speed_by_pose(arm: ArmModel, q: Floats, v: Floats, from_task: Floats) -> Floats:
    """∂q̇/∂(y, z, θ) at constant v, shape (n, 3)."""
    here = _speed(arm, q, v)
    return np.column_stack([_speed(arm, q + STEP * way, v) - here for way in from_task.T]) / STEP


def _torque_by_state(arm: ArmModel, q: Floats, v: Floats, a: Floats, from_task: Floats) -> Floats:
    """∂τ/∂x̂ at constant a, shape (n, 6)."""
    here = _torque(arm, q, v, a)
    by_pose = [_torque(arm, q + STEP * way, v, a) - here for way in from_task.T]
    by_velocity = [_torque(arm, q, v + STEP * way, a) - here for way in np.eye(3)]
    return np.column_stack(by_pose + by_velocity) / STEP


def _picked(k: Indices, j: Indices, columns: int, derivative: Callable[[int], Floats]) -> Floats:
    """Row j of the matrix (n, columns) at k for each pair k, j; each matrix is computed once."""
    matrices = {i: derivative(i) for i in np.unique(k).tolist()}
    rows = [matrices[i][row] for i, row in zip(k.tolist(), j.tolist(), strict=True)]
    return np.array(rows).reshape(k.size, columns)


def joint_rows(
    rows: Rows,
    layout: Layout,
    motion: JointMotion,
    states: Floats,
    inputs: Floats,
    arm: ArmModel,
    allowed: Allowed,
    first: int = 0,
    given_start: bool = False,
) -> None:
    """Rows that keep each joint's position, speed and torque inside what is allowed.

    The motion starts at sample `first` of the layout; given_start: in motion, with position and speed that no row could
    change.  Rows are divided by what is allowed, so a slack reads as the fraction by which it is exceeded.
    """
    middle, half, speed = allowed.middle, allowed.half, allowed.speed
    decided = np.arange(len(motion.q))[:, None] >= int(given_start)
    k, j = np.nonzero((np.abs(motion.q - middle) > NEAR * half) & decided)
    p = motion.from_task[k, j] / half[j, None]
    here = (motion.q[k, j] - middle[j]) / half[j] - np.sum(p * states[k, :3], axis=-1)
    for sign in (1.0, -1.0):
        rows.add(POSITION, [(layout.x(first + k, c), sign * p[:, c]) for c in range(3)], 1 - sign * here)

    k, j = np.nonzero((np.abs(motion.qd) > NEAR * speed) & decided)
    scale = np.sign(motion.qd[k, j]) / speed[j]
    by_pose = _picked(k, j, 3, lambda i: _speed_by_pose(arm, motion.q[i], states[i, 3:], motion.from_task[i]))
    g = np.hstack([by_pose, motion.from_task[k, j]]) * scale[:, None]
    here = motion.qd[k, j] * scale - np.sum(g * states[k], axis=-1)
    rows.add(SPEED, [(layout.x(first + k, c), g[:, c]) for c in range(6)], 1 - here)

    for end in (0, 1):
        _torque_rows(rows, layout, motion, states, inputs, arm, allowed.torque, first, end)


def _torque_rows(
    rows: Rows,
    layout: Layout,
    motion: JointMotion,
    states: Floats,
    inputs: Floats,
    arm: ArmModel,
    limit: Floats,
    first: int,
    end: int,
) -> None:
    """Torque at the start (end = 0) or end (1) of every interval."""
    k, j = np.nonzero(np.abs(motion.torque[end]) > NEAR * limit)
    scale = np.sign(motion.torque[end, k, j]) / limit[j]
    q, v, from_task = motion.q[end:], states[end:, 3:], motion.from_task[end:]
    g = _picked(k, j, 6, lambda i: _torque_by_state(arm, q[i], v[i], inputs[i], from_task[i])) * scale[:, None]
    p = motion.torque_from_task[k + end, j] * scale[:, None]
    here = motion.torque[end, k, j] * scale
    here = here - np.sum(g * states[k + end], axis=-1) - np.sum(p * inputs[k], axis=-1)
    terms = [(layout.x(first + k + end, c), g[:, c]) for c in range(6)]
    terms += [(layout.u(first + k, c), p[:, c]) for c in range(3)]
    rows.add(TORQUE, terms, 1 - here)


def limit_use(motion: JointMotion, arm: ArmModel) -> dict[str, Floats]:
    """Per kind of limit, the largest use of it along the motion by joint; 1 = at the limit."""
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    return {
        POSITION: np.max(np.abs(motion.q - middle) / half, axis=0),
        SPEED: np.max(np.abs(motion.qd) / arm.qd_max, axis=0),
        TORQUE: np.max(np.abs(motion.torque) / arm.tau_max, axis=(0, 1)),
    }
