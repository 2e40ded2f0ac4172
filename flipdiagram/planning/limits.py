"""Joint position, speed and torque along a motion, on the arm's own model, fed back to the plan as linear rows.

At sample k of the last trajectory, q̄ from inverse kinematics and P = J⁻¹ for the planned y, z, θ give to first order
    q ≈ q̄ + P (x − x̄),   q̇ ≈ P v + ∂q̇/∂x (x − x̄),   τ ≈ τ̄ + M P (a − ā) + ∂τ/∂x (x − x̄) + ∂τ/∂v (v − v̄).
Only joints that come near a limit enter the program; the last three derivatives are differences, taken there alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning.arm_motion import ArmMotion, JointMotion
from flipdiagram.planning.horizon import STATES, STRIDE, Layout
from flipdiagram.planning.rows import Part, part
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario

POSITION = "joint position limit"
SPEED = "joint speed limit"
TORQUE = "joint torque limit"
KINDS = (POSITION, SPEED, TORQUE)

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
    divisors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """What position, speed and torque were divided by."""

    @classmethod
    def of(cls, arm: ArmModel, scenario: Scenario, divisors: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> "Allowed":
        """The arm's limits less the scenario's margins, divided."""
        planner, middle = scenario.planner, (arm.q_min + arm.q_max) / 2
        whole = cls(
            middle=middle,
            half=arm.q_max - middle - planner.position_margin,
            speed=arm.qd_max * (1 - planner.speed_margin),
            torque=arm.tau_max * (1 - planner.torque_margin),
        )
        return whole._divided(divisors)

    def shares(self, arm: ArmModel) -> dict[str, Floats]:
        """Per kind of limit, the fraction of it that is allowed, by joint."""
        return {
            POSITION: self.half / (arm.q_max - self.middle),
            SPEED: self.speed / arm.qd_max,
            TORQUE: self.torque / arm.tau_max,
        }

    def tightened(self, uses: Mapping[str, Floats]) -> "Allowed":
        """Less of each kind of limit that a motion exceeds (use > 1) between its samples."""
        position, speed, torque = (max(1.0, float(np.max(uses[kind]))) for kind in KINDS)
        return self._divided((position, speed, torque))

    def _divided(self, by: tuple[float, float, float]) -> "Allowed":
        position, speed, torque = by
        before = self.divisors
        return Allowed(
            self.middle,
            self.half / position,
            self.speed / speed,
            self.torque / torque,
            (before[0] * position, before[1] * speed, before[2] * torque),
        )


def joint_rows(
    layout: Layout,
    motion: JointMotion,
    point: tuple[Floats, Floats],
    arm: ArmMotion,
    allowed: Allowed,
    given_start: bool = False,
) -> list[Part]:
    """Constraints that keep position, speed and torque of each joint inside what is allowed, near a motion of the arm.

    Margins are fractions of what is allowed, so a slack reads as the fraction by which it is exceeded.

    Args:
        layout: of the decision vector.
        motion: the arm's along `point`.
        point: states and inputs of the tool in the last intervals of the layout, those that move.
        arm: what moves so.
        allowed: positions, speeds and torques.
        given_start: in motion, with position and speed that no row could change.
    """
    states, first, skip = point[0], layout.intervals - len(point[1]), int(given_start)
    use = (motion.q - allowed.middle) / allowed.half
    near = np.abs(use) > NEAR
    near[:skip] = False
    columns = STRIDE * (first + np.nonzero(near)[0]) + COLUMNS[:3]
    slope, use = (motion.from_task / allowed.half[:, None])[near].T, use[near]
    parts = [part(POSITION, columns, -sign * slope, 1 - sign * use) for sign in (1.0, -1.0)]

    use = motion.qd / allowed.speed
    near = np.abs(use) > NEAR
    near[:skip] = False
    if near.any():
        (k, j), use = np.nonzero(near), use[near]
        slope = np.vstack([_speed_by_pose(motion, states, arm, k, j), motion.from_task[k, j].T])
        columns = STRIDE * (first + k) + COLUMNS[:STATES]
        parts.append(part(SPEED, columns, -np.sign(use) / allowed.speed[j] * slope, 1 - np.abs(use)))

    use = motion.torque / allowed.torque
    near = np.abs(use) > NEAR
    if near.any():
        (end, k, j), use = np.nonzero(near), use[near]
        slope = np.vstack([_torque_by_state(motion, point, arm, end, k, j), motion.torque_from_task[end, k, j].T])
        columns = STRIDE * (first + k) + COLUMNS
        columns[:STATES] += STRIDE * end
        parts.append(part(TORQUE, columns, -np.sign(use) / allowed.torque[j] * slope, 1 - np.abs(use)))
    return parts


def _speed_by_pose(motion: JointMotion, states: Floats, arm: ArmMotion, k: Indices, j: Indices) -> Floats:
    """∂q̇_j/∂(y, z, θ) at samples k and constant v, shape (3, k.size), by differences; k ascends."""
    at, n = k[np.append(True, k[1:] > k[:-1])], motion.q.shape[1]
    q = motion.q[at, None] + STEP * motion.from_task[at].transpose(0, 2, 1)
    moved = arm.speeds(q.reshape(-1, n), states[at, 3:].repeat(3, axis=0)).reshape(-1, 3, n)
    return (moved[np.searchsorted(at, k), :, j].T - motion.qd[k, j]) / STEP


def _torque_by_state(
    motion: JointMotion, point: tuple[Floats, Floats], arm: ArmMotion, end: Indices, k: Indices, j: Indices
) -> Floats:
    """∂τ_j/∂x̂ at constant a, at start (end = 0) or end (1) of intervals k, shape (6, k.size), as the other."""
    (at, place), n = np.unique(k + end, return_inverse=True), motion.q.shape[1]
    q, v = motion.q[at, None].repeat(6, axis=1), point[0][at, None, 3:].repeat(6, axis=1)
    q[:, :3] += STEP * motion.from_task[at].transpose(0, 2, 1)
    v[:, [3, 4, 5], [0, 1, 2]] += STEP
    moved = np.empty((k.size, 6))
    for mover, of_it in ((arm, k >= motion.carried), (arm.loaded, k < motion.carried)):
        if mover is None or not of_it.any():
            continue
        used = np.unique(place[of_it])
        _, _, by_input, rest = mover.along(q[used].reshape(-1, n), v[used].reshape(-1, 3))
        here = np.searchsorted(used, place[of_it])
        by_input = by_input.reshape(-1, 6, n, 3)[here, :, j[of_it]]
        rest = rest.reshape(-1, 6, n)[here, :, j[of_it]]
        moved[of_it] = (by_input @ point[1][k[of_it], :, None])[..., 0] + rest
    return (moved.T - motion.torque[end, k, j]) / STEP


def largest_mass(bare: JointMotion, loaded: JointMotion, mass: float, arm: ArmModel) -> float:
    """The largest mass of the object [kg] with which the torques of a motion stay within the arm's limits.

    Torque is affine in the mass: bare, loaded: the same motion without the object and with one of this mass [kg].
    0 where the arm alone exceeds them, inf where the object costs no torque.
    """
    by_mass = (loaded.torque - bare.torque) / mass
    left = arm.tau_max - np.sign(by_mass) * bare.torque
    rows = by_mass != 0
    return float(np.maximum(left[rows] / np.abs(by_mass[rows]), 0.0).min(initial=np.inf))


def limit_use(motion: JointMotion, arm: ArmModel) -> dict[str, Floats]:
    """Per kind of limit, the largest use of it along the motion by joint; 1 = at the limit."""
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    return {
        POSITION: np.max(np.abs(motion.q - middle) / half, axis=0),
        SPEED: np.max(np.abs(motion.qd) / arm.qd_max, axis=0),
        TORQUE: np.max(np.abs(motion.torque) / arm.tau_max, axis=(0, 1)),
    }
