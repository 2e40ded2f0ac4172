"""What to move where an arm cannot be at the start of its motion: the start, its base, or the spatula on its flange."""

import math
from collections.abc import Sequence

import numpy as np

from flipdiagram.arrays import Array
from flipdiagram.errors import FlipdiagramError
from flipdiagram.robot import inverse_kinematics
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.inverse_kinematics import Kinematics
from flipdiagram.robot.parts import arm_of
from flipdiagram.robot.task_space import AXES
from flipdiagram.scenario.scenario import Scenario

SEEDS = 24
"""Starts of each search, spread over joint space."""
TRIED = 4
"""Solutions, the nearest first, from which the way to the other poses is tried."""
HALVINGS = 6
MARGIN = 0.02
"""Metres beyond the border of what is reachable: on it the arm is stretched, and cannot move as fast as it must."""
TOLERANCE = 1e-6
MOUNT_ANGLES = tuple(k * math.pi / 4 for k in (1, -1, 2, -2, 3, -3, 4))
"""Turns of the spatula on the flange that are tried, the smallest first."""


class _Free:
    """An arm of which one task coordinate may be anything: it always has the value wanted."""

    def __init__(self, arm: Kinematics, axis: int, wanted: float) -> None:
        self.joint_names, self.q_min, self.q_max = arm.joint_names, arm.q_min, arm.q_max
        self.arm, self.axis, self.wanted = arm, axis, wanted

    def task_jacobian(self, q: Array) -> tuple[Array, Array]:
        """See `Kinematics`."""
        x, J = self.arm.task_jacobian(q)
        x, J = np.array(x), np.array(J)
        x[self.axis], J[self.axis] = self.wanted, 0.0
        return x, J


def shifts(arm: ArmModel, pose: Array, through: Sequence[Array]) -> dict[str, float]:
    """By how much [m] x, y or z of a pose (6,) must change, each alone, for the arm to be there and go on through
    further poses (6,), which move along; with a margin, away from zero to a centimetre.  Without what does not help.
    """
    found = {name: _shift(arm, pose, through, AXES.index(name)) for name in ("x", "y", "z")}
    return {name: shift for name, shift in found.items() if shift is not None}


def remedy(scenario: Scenario, arm: ArmModel, pose: Array, through: Sequence[Array]) -> str:
    """What to change in a scenario whose start pose (6,) its arm cannot take and turn through further poses (6,).

    Names fields and values that were found to do, one change at a time; takes about a second.
    """
    nearest = sorted(shifts(arm, pose, through).items(), key=lambda item: abs(item[1]))
    ways = [_moved(scenario, name, shift) for name, shift in nearest]
    if (angle := _mount_angle(scenario, pose, through)) is not None:
        ways.insert(0, f"arm.mount_angle = {angle:.4g}")
    if not ways:
        return "moving the start or turning the spatula alone does not help; valid is another arm.base_pose or arm.home"
    return f"it can with {' or '.join(ways)}"


def _moved(scenario: Scenario, name: str, shift: float) -> str:
    """A coordinate of the start, or the base the other way: where the start would leave its workspace, in a plane that
    is turned, and in z, where the table would have to come along.
    """
    task, how = scenario.task, f"{abs(shift):.2f} m"
    start, (low, high) = getattr(task, f"start_{name}") + shift, getattr(task, f"workspace_{name}")
    if name != "z" and task.yaw == 0 and low <= start <= high:
        return f"task.start_{name} = {start:.4g} ({how} {'more' if shift > 0 else 'less'})"
    x, y, z, yaw = scenario.arm.base_pose
    dx, dy, dz = (-shift if name == axis else 0.0 for axis in "xyz")
    c, s = math.cos(task.yaw), math.sin(task.yaw)
    base = (x + c * dx - s * dy, y + s * dx + c * dy, z + dz, yaw)
    return f"arm.base_pose = [{', '.join(f'{number:.4g}' for number in base)}] ({how} in {name})"


def _seeds(arm: Kinematics) -> Array:
    from scipy.stats import qmc

    spread = qmc.Halton(len(arm.q_min), scramble=False).random(SEEDS + 1)[1:]
    return np.asarray(arm.q_min + spread * (arm.q_max - arm.q_min))


def _goes_on(arm: ArmModel, q: Array | None, through: Sequence[Array]) -> bool:
    return q is not None and inverse_kinematics.conditioned(arm, q, through, TOLERANCE) > 0


def _wrapped(q: Array) -> Array:
    """Angles [rad] between -pi and pi."""
    return np.asarray((q + np.pi) % (2 * np.pi) - np.pi)


def _shift(arm: ArmModel, pose: Array, through: Sequence[Array], axis: int) -> float | None:
    def moved(by: float) -> list[Array]:
        return [p + by * np.eye(len(AXES))[axis] for p in (pose, *through)]

    free = _Free(arm, axis, float(pose[axis]))
    solutions = [inverse_kinematics.newton(free, pose, seed, TOLERANCE) for seed in (arm.home, *_seeds(arm))]
    turned = [inverse_kinematics.turned_inside(arm, _wrapped(q)) for q in solutions if q is not None]
    inside = [q for q in turned if _goes_on(arm, q, ())]
    by_distance = sorted(inside, key=lambda q: abs(arm.task_position(q)[axis] - pose[axis]))
    for q in by_distance[:TRIED]:
        good, bad = float(arm.task_position(q)[axis] - pose[axis]), 0.0
        if not _goes_on(arm, q, moved(good)[1:]):
            continue
        for _ in range(HALVINGS):
            middle = (good + bad) / 2
            there, *others = moved(middle)
            nearer = inverse_kinematics.newton(arm, there, q, TOLERANCE)
            if nearer is not None and _goes_on(arm, nearer, others):
                good, q = middle, nearer
            else:
                bad = middle
        return math.copysign(math.ceil(100 * (abs(good) + MARGIN)) / 100, good)
    return None


def _mount_angle(scenario: Scenario, pose: Array, through: Sequence[Array]) -> float | None:
    """A turn of the spatula [rad] with which an own arm can be at the pose and go on; None where none is found."""
    if scenario.arm.file is None:
        return None
    for turn in MOUNT_ANGLES:
        angle = scenario.arm.mount_angle + turn
        try:
            arm = arm_of(scenario.with_overrides({"arm.mount_angle": angle}))
        except FlipdiagramError:  # beyond the field's range
            continue
        for seed in _seeds(arm):
            q = inverse_kinematics.newton(arm, pose, seed, TOLERANCE)
            if q is not None and _goes_on(arm, inverse_kinematics.turned_inside(arm, _wrapped(q)), through):
                return angle
    return None
