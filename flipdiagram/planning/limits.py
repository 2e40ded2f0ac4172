"""Joint position, speed and torque along a motion, on the arm's own model, fed back to the plan as linear rows.

At sample k of the last trajectory, q̄ from inverse kinematics and P = J⁻¹ for the planned y, z, θ give
    q ≈ q̄ + P (x − x̄),   q̇ ≈ P v,   τ ≈ M (P a − J⁻¹ J̇ q̇) + τ(q̄, q̇, 0),
each linear in the unknowns.  Only joints that come near a limit enter the program.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flipdiagram.arm import ArmModel
from flipdiagram.contact import Floats
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.rows import Rows
from flipdiagram.scenario import Scenario

POSITION = "joint position limit"
SPEED = "joint speed limit"
TORQUE = "joint torque limit"

NEAR = 0.5
"""Fraction of a limit above which a joint's rows enter the program."""


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
        jacobian = arm.task_kinematics(q[k], np.zeros(n))[2]
        inverse = np.linalg.pinv(jacobian) if n != 6 else np.linalg.inv(jacobian)
        from_task[k] = inverse[:, :3]
        qd[k] = from_task[k] @ states[k, 3:]
        bias = arm.task_kinematics(q[k], qd[k])[3]
        torque_from_task[k] = arm.mass_matrix(q[k]) @ from_task[k]
        rest[k] = arm.inverse_dynamics(q[k], qd[k], -inverse @ bias)
    torque = np.stack(
        [np.einsum("kij,kj->ki", torque_from_task[at], inputs) + rest[at] for at in (slice(0, -1), slice(1, None))]
    )
    return JointMotion(q, qd, torque, from_task, torque_from_task)


def joint_rows(rows: Rows, layout: Layout, motion: JointMotion, states: Floats, inputs: Floats,
               arm: ArmModel, scenario: Scenario, first: int = 0) -> None:  # fmt: skip
    """Rows that keep each joint's position, speed and torque inside its limits less the scenario's margins.

    The motion starts at sample `first` of the layout.  Rows are divided by the limit, so a slack reads as the
    fraction by which it is exceeded.
    """
    planner = scenario.planner
    speed = arm.qd_max * (1 - planner.speed_margin)
    torque = arm.tau_max * (1 - planner.torque_margin)
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2 - planner.position_margin

    k, j = np.nonzero(np.abs(motion.q - middle) > NEAR * half)
    p = motion.from_task[k, j] / half[j, None]
    here = (motion.q[k, j] - middle[j]) / half[j] - np.sum(p * states[k, :3], axis=-1)
    for sign in (1.0, -1.0):
        rows.add(POSITION, [(layout.x(first + k, c), sign * p[:, c]) for c in range(3)], 1 - sign * here)

    k, j = np.nonzero(np.abs(motion.qd) > NEAR * speed)
    p = motion.from_task[k, j] / speed[j, None]
    side = np.sign(motion.qd[k, j])
    rows.add(SPEED, [(layout.x(first + k, 3 + c), side * p[:, c]) for c in range(3)], np.ones(k.size))

    for end in (0, 1):
        k, j = np.nonzero(np.abs(motion.torque[end]) > NEAR * torque)
        p = motion.torque_from_task[k + end, j] / torque[j, None]
        rest = motion.torque[end, k, j] / torque[j] - np.sum(p * inputs[k], axis=-1)
        side = np.sign(motion.torque[end, k, j])
        rows.add(TORQUE, [(layout.u(first + k, c), side * p[:, c]) for c in range(3)], 1 - side * rest)


def largest_use(motion: JointMotion, arm: ArmModel) -> dict[str, tuple[float, str]]:
    """Per kind of limit, the largest use of it (1 = at the limit) and the joint that has it."""
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    uses = {
        POSITION: np.max(np.abs(motion.q - middle) / half, axis=0),
        SPEED: np.max(np.abs(motion.qd) / arm.qd_max, axis=0),
        TORQUE: np.max(np.abs(motion.torque) / arm.tau_max, axis=(0, 1)),
    }
    return {kind: (float(use.max()), arm.joint_names[int(use.argmax())]) for kind, use in uses.items()}
