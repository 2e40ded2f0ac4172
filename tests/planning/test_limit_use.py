"""What a plan says it uses of each joint limit, recomputed from the path alone: differences in time, Drake's plant."""

import numpy as np
import pytest
from ideal import IDEAL
from robots import UR5, package_file
from shared import ideal_plan

from flipdiagram.planning.arm_motion import task_pose
from flipdiagram.planning.limits import POSITION, SPEED, TORQUE
from flipdiagram.planning.planner import Planner

STEP = 2e-4
"""Of the differences [s], a hundredth of a sample."""


@pytest.mark.parametrize("fields", [{}, UR5], ids=["MH3F", "UR5"])
def test_the_use_of_each_limit_is_that_of_the_path(fields):
    """q by inverse kinematics every 0.2 ms, q̇ and q̈ by central differences, τ by inverse dynamics.

    Not of a redundant arm, whose joint angles the path alone does not tell.
    """
    named = fields | ({"arm.file": package_file(fields["arm.file"])} if fields else {})
    planner = Planner(IDEAL.with_overrides(named))
    plan, arm = planner.plan() if fields else ideal_plan(), planner.arm
    t = np.arange(0.0, plan.duration, STEP)
    poses = task_pose(plan.sample(t)[0], planner.scenario.task.start_x)
    q = arm.inverse_kinematics_path(poses, planner.q_start, check_limits=False)
    qd = (q[2:] - q[:-2]) / (2 * STEP)
    qdd = (q[2:] - 2 * q[1:-1] + q[:-2]) / STEP**2
    # at a sample the acceleration jumps, and a difference over it is of neither side
    inside = np.abs((t[1:-1] / plan.sampling_time + 0.5) % 1 - 0.5) > 1.5 * STEP / plan.sampling_time
    tau = np.array([arm.inverse_dynamics(*at) for at in zip(q[1:-1][inside], qd[inside], qdd[inside], strict=True)])
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    uses = {POSITION: np.abs(q - middle) / half, SPEED: np.abs(qd) / arm.qd_max, TORQUE: np.abs(tau) / arm.tau_max}
    for kind, use in uses.items():
        assert use.max() == pytest.approx(plan.limit_use[kind], abs=0.015) and use.max() < 1
