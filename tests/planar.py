"""Block and blade as rectangles in the plane of the motion, from rotation matrices: what planning is compared with."""

import numpy as np

from flipdiagram.scenario.scenario import Scenario

G = 9.81


def rotation(theta):
    """R (..., 2, 2) that turns (s, n) coordinates into (y, z)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.moveaxis(np.array([[c, -s], [s, c]]), (0, 1), (-2, -1))


def placed(corners, pose):
    """Corners (m, 2) given in a frame at poses (..., 3) = (y, z, θ): their places (..., m, 2)."""
    pose = np.asarray(pose)
    return pose[..., None, :2] + corners @ np.swapaxes(rotation(pose[..., 2]), -1, -2)


def block(scenario: Scenario):
    """Corners (4, 2) of the block about its centre, in order round it, the two that touch the blade first."""
    along, across = scenario.object.length / 2, scenario.object.thickness / 2
    return np.array([[-along, -across], [along, -across], [along, across], [-along, across]])


def blade(scenario: Scenario):
    """Corners (4, 2) of the blade about the control point, which is the centre of the block lying on it."""
    side, top = scenario.tool.blade_width / 2, -scenario.object.thickness / 2
    bottom = top - scenario.tool.blade_thickness
    return np.array([[-side, bottom], [side, bottom], [side, top], [-side, top]])


def flown(state, t):
    """Pose (..., 3) of the released block t (...) seconds after x̂ = state (6,): a parabola, turning evenly."""
    t = np.asarray(t)[..., None]
    return state[:3] + state[3:] * t + np.array([0.0, -G / 2, 0.0]) * t**2


def gap(a, b):
    """Distance of two convex polygons (4, 2) along the best separating edge normal; negative: how deep they overlap."""
    best = -np.inf
    for polygon in (a, b):
        for edge in np.roll(polygon, -1, axis=0) - polygon:
            normal = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
            of_a, of_b = a @ normal, b @ normal
            best = max(best, of_b.min() - of_a.max(), of_a.min() - of_b.max())
    return best


def polar(acceleration, theta):
    """(I, φ) of eqs. (10) and (11) by hand: i = g − a makes the angle φ with the inward normal (sin θ, −cos θ)."""
    i_y, i_z = -acceleration[..., 0], -G - acceleration[..., 1]
    inward = i_y * np.sin(theta) - i_z * np.cos(theta)
    along = i_y * np.cos(theta) + i_z * np.sin(theta)
    return np.hypot(i_y, i_z), np.arctan2(along, inward)
