"""Inverse kinematics of an arm: damped Newton on the task error, and its continuation along a path.

Numerical rather than closed-form, so that it serves any arm a user brings; a redundant arm takes the shortest
step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from flipdiagram.arrays import Array
from flipdiagram.errors import PlanningError
from flipdiagram.robot import task_space

ITERATIONS = 80
STEP_MAX = 0.3  # [rad] largest Newton step: keeps the search on the branch of the seed
LINE_STEPS = 40  # poses on the line from seed to target
SEEDS = 96  # starts of `search`
MOST_POSES = 60_000  # that `search` computes before it makes do with what it has found; a UR5 takes 28,000
COMFORT = 0.4  # [rad] distance to a joint limit from which there is room enough
DAMPING_START, DAMPING_MIN, DAMPING_MAX = 1e-9, 1e-12, 1e3  # of J J^T; a regular pose has entries of 0.1 to 1


class Kinematics(Protocol):
    """What is needed of an arm: names and limits of its joints, and x (6,) with J (6, n) at q (n,)."""

    joint_names: tuple[str, ...]
    q_min: Array
    q_max: Array

    def task_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Task coordinates and Jacobian."""


def pose(arm: Kinematics, target: Array, seeds: Sequence[Array], tol: float) -> Array:
    """The first joint angles (n,) [rad] within the limits, at the task pose target (6,) within tol.

    Raises PlanningError naming the pose, and joint and limit if there are solutions, but none within the limits.
    """
    outside: Array | None = None
    for seed in seeds:
        for search in (newton, along_line):
            q = search(arm, target, seed, tol)
            if q is not None:
                q = turned_inside(arm, q)
                if _inside(arm, q).all():
                    return q
                outside = q if outside is None else outside
    reason = "no joint angles found" if outside is None else _limit_message(arm, outside)
    raise PlanningError(f"the arm cannot reach the pose {task_space.describe(target)}: {reason}")


class _Counted:
    """An arm that counts the poses asked of it."""

    def __init__(self, arm: Kinematics) -> None:
        self.joint_names, self.q_min, self.q_max = arm.joint_names, arm.q_min, arm.q_max
        self._arm, self.poses = arm, 0

    def task_jacobian(self, q: Array) -> tuple[Array, Array]:
        """See `Kinematics`."""
        self.poses += 1
        return self._arm.task_jacobian(q)


def search(arm: Kinematics, target: Array, tol: float, through: Sequence[Array] = ()) -> Array:
    """The best-conditioned joint angles (n,) [rad] at the task pose target (6,), from seeds spread over joint space.

    through: further poses (6,) that must be reachable from there, one after the other, within the limits.  Best: the
    largest smallest singular value of J over all of them, far from joint limits.  The seeds are a Halton sequence, the
    same in every run.  Raises PlanningError naming the pose where none leads there.
    """
    from scipy.stats import qmc  # a third of a second, and the MH3F knows its home

    seeds = qmc.Halton(len(arm.q_min), scramble=False).random(SEEDS + 1)[1:]  # the first is the corner
    arm = _Counted(arm)
    best: Array | None = None
    largest = 0.0
    for seed in arm.q_min + seeds * (arm.q_max - arm.q_min):
        if arm.poses > MOST_POSES:
            break
        q = newton(arm, target, seed, tol)
        if q is None:
            continue
        q = (q + np.pi) % (2 * np.pi) - np.pi
        # the margin keeps rounding from choosing between mirror images
        if (smallest := conditioned(arm, q, through, tol)) > 1.001 * largest:
            best, largest = q, smallest
    if best is None:
        reason = f"no joint angles found, {arm.poses:,} poses tried from all over joint space"
        raise PlanningError(f"the arm cannot reach the pose {task_space.describe(target)}: {reason}")
    return best


def conditioned(arm: Kinematics, q: Array, through: Sequence[Array], tol: float) -> float:
    """The smallest singular value of J at q and on the way through the poses, less where a joint is near its limit.

    0 where the way is lost or leaves the limits.
    """
    smallest = np.inf
    for pose_on_the_way in [None, *through]:
        reached = q if pose_on_the_way is None else along_line(arm, pose_on_the_way, q, tol)
        if reached is None or not _inside(arm, reached).all():
            return 0.0
        q = reached
        room = min(1.0, float(np.minimum(q - arm.q_min, arm.q_max - q).min()) / COMFORT)
        smallest = min(smallest, room * float(np.linalg.svd(arm.task_jacobian(q)[1], compute_uv=False)[-1]))
    return smallest


def path(arm: Kinematics, targets: Array, first: Array, tol: float, *, check_limits: bool) -> Array:
    """Joint angles (N, n) [rad] along targets (N, 6), beginning with first (n,), on one branch.

    Raises PlanningError naming the sample.
    """
    qs = np.empty((len(targets), len(first)))
    qs[0] = first
    for k in range(1, len(targets)):
        # the extrapolation of the last three samples, or as many as there are
        guess = qs[0] if k == 1 else 2 * qs[1] - qs[0] if k == 2 else 3 * (qs[k - 1] - qs[k - 2]) + qs[k - 3]
        q = newton(arm, targets[k], guess, tol)
        if q is None or np.abs(q - qs[k - 1]).max() > STEP_MAX:
            q = along_line(arm, targets[k], qs[k - 1], tol)
        if q is None:
            raise PlanningError(f"the arm cannot follow the path at sample {k}: {task_space.describe(targets[k])}")
        qs[k] = q
    inside = _inside(arm, qs).all(axis=1)
    if check_limits and not inside.all():
        k = int(np.argmin(inside))
        where = f"at sample {k}: {task_space.describe(targets[k])}"
        raise PlanningError(f"the arm cannot follow the path {where}: {_limit_message(arm, qs[k])}")
    return qs


def newton(arm: Kinematics, target: Array, q: Array, tol: float) -> Array | None:
    """Levenberg-Marquardt from q: step = J^T (J J^T + damping I)^-1 error; None if it does not converge."""
    damping = DAMPING_START
    error = J = None
    residual, trial = np.inf, q
    for _ in range(ITERATIONS):
        try:
            x, J_trial = arm.task_jacobian(trial)
            error_trial = task_space.difference(target, x)
            residual_trial = np.abs(error_trial).max()
        except PlanningError:  # pitch +-90 deg on the way: too long a step
            residual_trial = np.inf
        if residual_trial < tol:
            return trial
        if residual_trial < residual:
            q, error, J, residual = trial, error_trial, J_trial, residual_trial
            damping = max(damping / 10, DAMPING_MIN)
        elif error is None or J is None or damping > DAMPING_MAX:
            return None
        else:
            damping *= 10
        JJ = J @ J.T
        JJ.flat[:: len(JJ) + 1] += damping
        step = J.T @ np.linalg.solve(JJ, error)
        longest = np.abs(step).max()
        trial = q + (step if longest <= STEP_MAX else step * (STEP_MAX / longest))
    return None


def along_line(arm: Kinematics, target: Array, q: Array, tol: float) -> Array | None:
    """Newton along the straight line in task space from the pose of q; None where the line is lost."""
    start, _ = arm.task_jacobian(q)
    way = task_space.difference(target, start)
    for fraction in np.linspace(0, 1, LINE_STEPS + 1)[1:]:
        following = newton(arm, start + fraction * way, q, tol)
        if following is None or np.abs(following - q).max() > 2 * STEP_MAX:
            return None
        q = following
    return q


def turned_inside(arm: Kinematics, q: Array) -> Array:
    """q with each joint outside its limits turned by +-2 pi where that brings it inside."""
    for turn in (2 * np.pi, -2 * np.pi):
        q = np.where(~_inside(arm, q) & _inside(arm, q + turn), q + turn, q)
    return q


def _inside(arm: Kinematics, q: Array) -> Array:
    return (q >= arm.q_min) & (q <= arm.q_max)


def _limit_message(arm: Kinematics, q: Array) -> str:
    i = int(np.argmin(_inside(arm, q)))
    low, high, angle = np.degrees([arm.q_min[i], arm.q_max[i], q[i]])
    return f"joint {arm.joint_names[i]} would be at {angle:.1f} deg; valid is {low:.1f} to {high:.1f} deg"
