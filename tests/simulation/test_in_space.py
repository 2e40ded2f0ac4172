"""Motions in 3-D: the plane of the planar problem turned about the vertical axis through the start."""

import math

import numpy as np
import pytest
from ideal import IDEAL

from flipdiagram.planning import plan_motion
from flipdiagram.robot.parts import arm_of, base_in_plane
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.simulate import simulate


def to_world(scenario, point):
    """From the frame of the motion to the world: turned by yaw about the vertical axis through the start."""
    c, s = math.cos(scenario.task.yaw), math.sin(scenario.task.yaw)
    pivot = np.array([scenario.task.start_x, scenario.task.start_y])
    return pivot + np.array([[c, -s], [s, c]]) @ (np.asarray(point) - pivot)


def test_without_yaw_nothing_is_moved():
    assert base_in_plane(IDEAL) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("yaw", [-0.5, 0.3, 1.2])
def test_the_base_in_the_frame_of_the_motion_is_the_origin_of_the_world(yaw):
    scenario = IDEAL.with_overrides({"task.yaw": yaw, "task.start_y": 0.05})
    x, y, z, turned = base_in_plane(scenario)
    np.testing.assert_allclose(to_world(scenario, [x, y]), 0, atol=1e-12)
    assert (z, turned) == (0.0, -yaw)


def test_the_arm_reaches_the_same_places_with_a_turned_blade():
    """Joint angles for a pose in the turned frame put the unturned arm at that place, its blade turned by yaw."""
    scenario = IDEAL.with_overrides({"task.yaw": 0.4})
    turned, plain = arm_of(scenario), arm_of(IDEAL)
    q = turned.inverse_kinematics([0.05, 0.3, 0.7, 0.45, 0.0, 0.0])
    y, z, theta, x, pitch, yaw = plain.task_position(q)
    np.testing.assert_allclose([x, y], to_world(scenario, [0.45, 0.05]), atol=1e-9)
    np.testing.assert_allclose([z, theta, pitch, yaw], [0.3, 0.7, 0.0, 0.4], atol=1e-9)


@pytest.mark.parametrize(
    ("start", "target"),
    [((0.5, 0.0), (0.5, 0.0)), ((0.5, 0.1), (0.4, 0.0)), ((0.45, -0.05), (0.5, 0.05)), ((0.5, 0.0), (0.42, 0.0))],
)
def test_between_puts_start_and_target_into_the_plane(start, target):
    scenario = IDEAL.between(start, target)
    assert (scenario.task.start_x, scenario.task.start_y) == start
    reached = to_world(scenario, [scenario.task.start_x, scenario.task.target_y])
    np.testing.assert_allclose(reached, target, atol=1e-12)
    assert abs(scenario.task.yaw) <= math.pi / 2 + 1e-12


def test_a_flip_towards_another_x_lands_there():
    scenario = IDEAL.between((0.5, 0.08), (0.46, 0.0))
    scenario = scenario.with_overrides({"simulation.hold_time": 1.0})
    plan = plan_motion(scenario)
    flip = simulate(scenario, "pd+ff+dob", plan)
    found = measure(flip.recording)
    assert found.success, found.failure
    block = flip.recording["block_pose"].values[-1]
    k = int(np.searchsorted(flip.recording["time"].values, found.touchdown.time_s))
    landed = to_world(scenario, flip.recording["block_pose"].values[k, 4:6])
    planned = to_world(scenario, [scenario.task.start_x, plan.landing[0]])
    assert np.linalg.norm(landed - planned) < 0.02
    assert np.linalg.norm(planned - [0.46, 0.0]) < 0.06
    assert block[6] < scenario.table.height + 0.02
