"""The arm along a planned motion: by Drake's plant, sample by sample, or by the compiled loops of its chain of joints.

Both give the same numbers to rounding.  The second is some twenty times sooner, and only for serial chains.
"""

from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.serial_chain import SerialChain, serial_chain

REACHED = 1e-9
"""Largest error of a sample's task pose [m, rad], as in ArmModel.inverse_kinematics_path."""
SINGULAR = "the arm cannot follow the path: it passes a singular pose"


@dataclass(frozen=True)
class JointMotion:
    """The arm along a motion: q, qd at samples (N + 1, n); torque at both ends of each interval (2, N, n)."""

    q: Floats
    qd: Floats
    torque: Floats
    from_task: Floats
    """J⁻¹ restricted to (y, z, θ), shape (N + 1, n, 3)."""
    torque_from_task: Floats
    """dτ/da for a = (a_y, a_z, a_θ) at both ends of each interval, shape (2, N, n, 3)."""
    carried: int = 0
    """Intervals from the first on in which the object is on the blade and part of the torque."""


def task_pose(states: Floats, x: float) -> Floats:
    """Six task coordinates (y, z, θ, x, pitch, yaw) of planned states (..., ≥3) in the plane at x [m]."""
    states = np.asarray(states, dtype=float)
    pose = np.zeros((*states.shape[:-1], 6))
    pose[..., :3] = states[..., :3]
    pose[..., 3] = x
    return pose


class ArmMotion:
    """An arm whose tool moves in the plane at x [m], by its plant.

    loaded: the same arm with the object welded to its blade; without one the object weighs nothing.
    """

    def __init__(self, arm: ArmModel, x: float, loaded: ArmModel | None = None) -> None:
        self.arm, self.x, self.shift = arm, x, 0.0
        self.loaded = None if loaded is None else self._of_load(loaded)

    def _of_load(self, loaded: ArmModel) -> "ArmMotion":
        return ArmMotion(loaded, self.x)

    def shift_load(self, shift: float) -> None:
        """Let the object sit this far from the middle of the blade along s [m]."""
        if self.loaded is not None and shift != self.shift:
            self.shift = shift
            self.loaded.carry_at(shift)

    def carry_at(self, shift: float) -> None:
        """`shift_load`, of the arm with the object."""
        self.arm.shift_load(shift)

    def joint_angles(self, pose: Floats, seed: Floats) -> Floats:
        """q (n,) [rad] at a task pose (6,), near the seed; raises PlanningError where the arm cannot be there."""
        return self.arm.inverse_kinematics(pose, seed)

    def follow(self, states: Floats, inputs: Floats, q_start: Floats, carried: int = 0) -> JointMotion:
        """The arm along states (N + 1, 6) and inputs (N, 3) of its tool; raises PlanningError where it cannot reach.

        carried: intervals, from the first on, in which the object is on the blade.
        """
        q, v = self.path(task_pose(states, self.x), q_start), np.ascontiguousarray(states[:, 3:])
        carried, n = carried if self.loaded else 0, len(inputs)
        parts = [self.along(q[carried:], v[carried:])]
        by_input, rest = (np.stack([part[k : k + n - carried] for k in (0, 1)]) for part in parts[0][2:])
        if self.loaded and carried:  # at the release both: with the object before, without it after
            parts.insert(0, self.loaded.along(q[: carried + 1], v[: carried + 1]))
            heavy, weight = (np.stack([part[k : k + carried] for k in (0, 1)]) for part in parts[0][2:])
            by_input, rest = np.concatenate([heavy, by_input], axis=1), np.concatenate([weight, rest], axis=1)
        qd, from_task = (np.concatenate([*(part[i][:carried] for part in parts[:-1]), parts[-1][i]]) for i in (0, 1))
        torque = (by_input @ inputs[None, :, :, None])[..., 0] + rest
        return JointMotion(q, qd, torque, from_task, by_input, carried)

    def path(self, poses: Floats, q_start: Floats) -> Floats:
        """q (K, n) along task poses (K, 6); raises PlanningError where the arm cannot reach."""
        return self.arm.inverse_kinematics_path(poses, q_start, check_limits=False)

    def along(self, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """q̇ (K, n) of a tool that moves with v (K, 3), P = J⁻¹ for (y, z, θ) and M P (K, n, 3), τ (K, n) at a = 0."""
        from_task, by_input = np.empty((2, *q.shape, 3))
        qd, rest = np.empty((2, *q.shape))
        for k in range(len(q)):
            inverse = self._inverse(q[k])
            from_task[k] = inverse[:, :3]
            qd[k] = from_task[k] @ v[k]
            bias = self.arm.task_kinematics(q[k], qd[k])[3]
            by_input[k] = self.arm.mass_matrix(q[k]) @ from_task[k]
            rest[k] = self.arm.inverse_dynamics(q[k], qd[k], -inverse @ bias)
        return qd, from_task, by_input, rest

    def speeds(self, q: Floats, v: Floats) -> Floats:
        """q̇ (K, n) at joint angles q (K, n) of a tool that moves with v (K, 3)."""
        return np.array([self._inverse(at)[:, :3] @ velocity for at, velocity in zip(q, v, strict=True)])

    def _inverse(self, q: Floats) -> Floats:
        jacobian = self.arm.task_jacobian(q)[1]
        square = jacobian.shape[0] == jacobian.shape[1]
        return np.asarray(np.linalg.inv(jacobian) if square else np.linalg.pinv(jacobian), dtype=np.float64)


class ChainMotion(ArmMotion):
    """The same by compiled loops; everything is compiled here, not in the middle of a motion."""

    def __init__(self, arm: ArmModel, x: float, chain: SerialChain, loaded: ArmModel | None = None) -> None:
        super().__init__(arm, x, loaded)
        from flipdiagram.robot import chain as kinematics  # imports numba
        from flipdiagram.robot import dynamics

        self._chain, self._kinematics, self._dynamics = chain, kinematics, dynamics
        home = np.array([arm.home, arm.home], dtype=float)  # may be singular
        kinematics.follow(chain, arm.task_position(arm.home)[None], REACHED, home)
        kinematics.speeds(chain, home, np.zeros((2, 3)), np.empty_like(home))
        dynamics.task_dynamics(chain, kinematics.along(chain, home, np.zeros((2, 3))))

    def _of_load(self, loaded: ArmModel) -> ArmMotion:
        chain = serial_chain(loaded)
        assert chain is not None, "what is welded to its end makes an arm no less a chain"
        return ChainMotion(loaded, self.x, chain)

    def carry_at(self, shift: float) -> None:
        """As of `ArmMotion`."""
        super().carry_at(shift)
        self._chain = serial_chain(self.arm) or self._chain

    def joint_angles(self, pose: Floats, seed: Floats) -> Floats:
        """As of `ArmMotion`, which is asked where Newton's method finds none."""
        q = np.array([seed, seed], dtype=float)
        reached = self._kinematics.follow(self._chain, np.array([pose, pose]), REACHED, q)
        inside = np.all((q[1] >= self.arm.q_min) & (q[1] <= self.arm.q_max))
        return q[1] if reached == len(q) and inside else super().joint_angles(pose, seed)

    def path(self, poses: Floats, q_start: Floats) -> Floats:
        """As of `ArmMotion`, which is asked where Newton's method finds none."""
        q = np.empty((len(poses), len(q_start)))
        q[0] = q_start
        reached = self._kinematics.follow(self._chain, poses, REACHED, q) == len(q)
        return q if reached else super().path(poses, q_start)

    def along(self, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """As of `ArmMotion`; raises PlanningError where a pose is singular."""
        at = self._kinematics.along(self._chain, q, v)
        if not at.regular:
            raise PlanningError(SINGULAR)
        return at.qd, at.from_task[:, :, :3], *self._dynamics.task_dynamics(self._chain, at)

    def speeds(self, q: Floats, v: Floats) -> Floats:
        """As of `ArmMotion`; raises PlanningError where a pose is singular."""
        qd = np.empty_like(q)
        if not self._kinematics.speeds(self._chain, q, v, qd):
            raise PlanningError(SINGULAR)
        return qd


def arm_motion(arm: ArmModel, x: float, native: bool, loaded: ArmModel | None = None) -> ArmMotion:
    """The motion of an arm; native: by compiled loops, where it is one chain of revolute joints.

    loaded: the arm with the object, for the torque while it carries it.
    """
    chain = serial_chain(arm) if native else None
    return ChainMotion(arm, x, chain, loaded) if chain else ArmMotion(arm, x, loaded)
