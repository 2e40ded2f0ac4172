"""Joint position, speed and torque along a motion, on the arm's own model, fed back to the plan as linear rows.

At sample k of the last trajectory, q̄ from inverse kinematics and P = J⁻¹ for the planned y, z, θ give to first order
    q ≈ q̄ + P (x − x̄),   q̇ ≈ P v + ∂q̇/∂x (x − x̄),   τ ≈ τ̄ + M P (a − ā) + ∂τ/∂x (x − x̄) + ∂τ/∂v (v − v̄).
Only joints that come near a limit enter the program; the last three derivatives are differences, taken there alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning.horizon import STATES, STRIDE, Layout
from flipdiagram.planning.rows import Part, part
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario

if TYPE_CHECKING:
    from flipdiagram.planning.arm_motion import ArmMotion

POSITION = "joint position limit"
SPEED = "joint speed limit"
TORQUE = "joint torque limit"

NEAR = 0.5
"""Fraction of a limit above which a joint's rows enter the program."""
STEP = 1e-6
"""Step of the differences [m, rad; per second]."""
COLUMNS = np.arange(STRIDE)[:, None]
"""Of x̂ and u of a sample, after its first."""


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


def joint_rows(
    layout: Layout,
    motion: JointMotion,
    point: tuple[Floats, Floats],
    arm: ArmMotion,
    allowed: Allowed,
    first: int = 0,
    given_start: bool = False,
) -> list[Part]:
    """Constraints that keep position, speed and torque of each joint inside what is allowed, near a motion of the arm.

    Margins are fractions of what is allowed, so a slack reads as the fraction by which it is exceeded.

    Args:
        layout: of the decision vector.
        motion: the arm's along `point`.
        point: states and inputs of the tool from sample `first` of the layout on.
        arm: what moves so.
        allowed: positions, speeds and torques.
        first: where the motion starts.
        given_start: in motion, with position and speed that no row could change.
    """
    near_position = np.abs(motion.q - allowed.middle) > NEAR * allowed.half
    near_speed = np.abs(motion.qd) > NEAR * allowed.speed
    if given_start:
        near_position[0] = near_speed[0] = False
    k, j = np.nonzero(near_position)
    use = (motion.q[k, j] - allowed.middle[j]) / allowed.half[j]
    slope, columns = motion.from_task[k, j].T / allowed.half[j], STRIDE * (first + k) + COLUMNS[:3]
    parts = [part(POSITION, columns, -sign * slope, 1 - sign * use) for sign in (1.0, -1.0)]

    k, j = np.nonzero(near_speed)
    if k.size:
        scale = np.sign(motion.qd[k, j]) / allowed.speed[j]
        by_state = np.vstack([_speed_by_pose(motion, point[0], arm, k, j), motion.from_task[k, j].T])
        columns = STRIDE * (first + k) + COLUMNS[:STATES]
        parts.append(part(SPEED, columns, -scale * by_state, 1 - scale * motion.qd[k, j]))

    for end in (0, 1):
        k, j = np.nonzero(np.abs(motion.torque[end]) > NEAR * allowed.torque)
        if k.size:
            scale = np.sign(motion.torque[end, k, j]) / allowed.torque[j]
            slope = np.vstack([_torque_by_state(motion, point, arm, k, j, end), motion.torque_from_task[k + end, j].T])
            columns = STRIDE * (first + k) + COLUMNS
            columns[:STATES] += STRIDE * end
            parts.append(part(TORQUE, columns, -scale * slope, 1 - scale * motion.torque[end, k, j]))
    return parts


def _speed_by_pose(motion: JointMotion, states: Floats, arm: ArmMotion, k: Indices, j: Indices) -> Floats:
    """∂q̇_j/∂(y, z, θ) at samples k and constant v, shape (3, k.size), by differences; k ascends."""
    near, n = np.unique(k), motion.q.shape[1]
    q = motion.q[near, None] + STEP * motion.from_task[near].transpose(0, 2, 1)
    moved = arm.speeds(q.reshape(-1, n), np.repeat(states[near, 3:], 3, axis=0)).reshape(-1, 3, n)
    return ((moved - motion.qd[near, None]) / STEP)[np.searchsorted(near, k), :, j].T


def _torque_by_state(
    motion: JointMotion, point: tuple[Floats, Floats], arm: ArmMotion, k: Indices, j: Indices, end: int
) -> Floats:
    """∂τ_j/∂x̂ at constant a, at start (end = 0) or end (1) of intervals k, shape (6, k.size), by differences."""
    near, n = np.unique(k), motion.q.shape[1]
    q, v = np.repeat(motion.q[near + end], 6, axis=0), np.repeat(point[0][near + end, 3:], 6, axis=0)
    q.reshape(-1, 6, n)[:, :3] += STEP * motion.from_task[near + end].transpose(0, 2, 1)
    v.reshape(-1, 6, 3)[:, [3, 4, 5], [0, 1, 2]] += STEP
    moved = arm.torques(q, v, np.repeat(point[1][near], 6, axis=0)).reshape(-1, 6, n)
    return ((moved - motion.torque[end, near, None]) / STEP)[np.searchsorted(near, k), :, j].T


def limit_use(motion: JointMotion, arm: ArmModel) -> dict[str, Floats]:
    """Per kind of limit, the largest use of it along the motion by joint; 1 = at the limit."""
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    return {
        POSITION: np.max(np.abs(motion.q - middle) / half, axis=0),
        SPEED: np.max(np.abs(motion.qd) / arm.qd_max, axis=0),
        TORQUE: np.max(np.abs(motion.torque) / arm.tau_max, axis=(0, 1)),
    }
