"""Where the arm stands before the motion: at the start of the plan, or off it by an error that nobody knows of."""

from typing import NamedTuple

from flipdiagram.arrays import Floats
from flipdiagram.planning.arm_motion import task_pose
from flipdiagram.planning.planner import Planner


class Start(NamedTuple):
    """The tool's pose (y, z, θ, x, pitch, yaw) (6,) [m, rad] and the joint angles (n,) [rad]."""

    pose: Floats
    q: Floats


def start_of(planner: Planner) -> Start:
    """The start of a planner's scenario; raises PlanningError where the arm cannot be there."""
    scenario, q = planner.scenario, planner.q_start
    pose = task_pose(planner.horizons.start, scenario.task.start_x)
    if scenario.disturbance.start_error:
        pose[0] += scenario.disturbance.start_error
        q = planner.arm.inverse_kinematics(pose, q)
    return Start(pose, q)
