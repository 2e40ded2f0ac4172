"""Recordings made up for tests of pictures: smooth motions in the format of `simulate.py`, without any physics engine."""

from functools import lru_cache

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario

RELEASE, MOTION, TOUCHDOWN, END = 0.5, 0.75, 0.72, 1.2
DROP = {"pd": 0.15, "pd+ff": 0.20}  # [s] when these two lose the block
GRAVITY = 9.81


def smooth(t, duration):
    """Minimum-jerk ramp from 0 at t = 0 to 1 at t = duration."""
    s = np.clip(np.asarray(t) / duration, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def command(t):
    """y, z, theta of the control point, shape (n, 3)."""
    arc = np.sin(np.pi * smooth(t, MOTION))
    return np.column_stack([0.06 * arc, 0.35 + 0.12 * arc, 1.9 * smooth(t, 0.6)])


def quaternion(roll):
    """(qw, qx, qy, qz) of a turn about x."""
    return np.column_stack([np.cos(roll / 2), np.sin(roll / 2), 0 * roll, 0 * roll])


@lru_cache
def recording(architecture="pd+ff+dob"):
    scenario = Scenario()
    thickness, table = scenario.object.thickness, scenario.table.height
    t = np.arange(-300, int(END * 1000) + 1) * 1e-3
    lag = {"pd": 0.03, "pd+ff": 0.02, "pd+dob": 0.01, "pd+ff+dob": 0.004}[architecture]
    sag = {"pd": 0.03, "pd+ff": 0.025}.get(architecture, 0.0)
    x_cmd = command(t)
    x = command(t - lag) - np.array([0.0, sag, 0.0])

    knots = np.arange(t[0], t[-1] + 0.01, 0.02)
    at_knots = command(knots - lag) - np.array([0.0, sag, 0.0])
    rest = np.tile([scenario.task.start_x, 0.0, 0.0], (len(knots), 1))
    joints = arm_of(scenario).inverse_kinematics_path(np.hstack([at_knots, rest]), tol=1e-6)
    spline = CubicSpline(knots, joints)
    q, qd = spline(t), spline(t, 1)

    normal = np.column_stack([-np.sin(x[:, 2]), np.cos(x[:, 2])])
    across = np.full((len(t), 1), scenario.task.start_x)
    tool_pose = np.hstack([quaternion(x[:, 2]), across, x[:, :2] - normal * thickness / 2])

    leave = DROP.get(architecture, RELEASE)
    k = int(np.searchsorted(t, leave))
    v = np.gradient(x, 1e-3, axis=0)
    since = t - t[k]
    flight = x[k] + np.outer(since, v[k]) - np.outer(since**2, [0, GRAVITY / 2, 0])
    block = np.where((since < 0)[:, None], x, flight)
    lying = (since > 0) & (block[:, 1] <= table + thickness / 2)
    if lying.any():
        first = int(np.argmax(lying))
        turned = np.pi if block[first, 2] > np.pi / 2 else 0.0
        block[first:] = [block[first, 0], table + thickness / 2, turned]
    block_pose = np.hstack([quaternion(block[:, 2]), across, block[:, :2]])

    a_cmd = np.gradient(np.gradient(x_cmd, 1e-3, axis=0), 1e-3, axis=0)
    torque = np.cos(3 * np.outer(t, np.arange(1, 7))) * [20, 120, 40, 5, 8, 2]
    force = np.zeros((len(t), 3, 3))
    force[t < leave, 0] = [0.0, 0.2, 0.6]
    force[lying, 1] = [0.0, 0.0, 0.6]
    per_axis, per_joint, per_pose = ("time", "axis"), ("time", "joint"), ("time", "pose")
    variables = {
        "x_cmd": (per_axis, x_cmd, "m, m, rad"),
        "v_cmd": (per_axis, np.gradient(x_cmd, 1e-3, axis=0), "m/s, m/s, rad/s"),
        "a_cmd": (per_axis, a_cmd, "m/s^2, m/s^2, rad/s^2"),
        "x": (per_axis, x, "m, m, rad"),
        "v": (per_axis, v, "m/s, m/s, rad/s"),
        "a": (per_axis, np.gradient(v, 1e-3, axis=0), "m/s^2, m/s^2, rad/s^2"),
        "q": (per_joint, q, "rad"),
        "qd": (per_joint, qd, "rad/s"),
        "tau": (per_joint, torque, "N m"),
        "tau_dis": (per_joint, 0.3 * torque, "N m"),
        "tool_pose": (per_pose, tool_pose, "1, m"),
        "block_pose": (per_pose, block_pose, "1, m"),
        "sliding_angle": (("time",), np.where(t < leave, 0.6 * np.sin(6 * t), np.nan), "rad"),
        "contact_force": (("time", "pair", "direction"), force, "N"),
    }
    return xr.Dataset(
        {name: (dims, data, {"units": units}) for name, (dims, data, units) in variables.items()},
        coords={
            "time": ("time", t, {"units": "s"}),
            "axis": ["y", "z", "theta"],
            "joint": list("SLURBT"),
            "pose": ["qw", "qx", "qy", "qz", "x", "y", "z"],
            "pair": ["blade-block", "table-block", "table-blade"],
            "direction": ["x", "y", "z"],
        },
        attrs={
            "architecture": architecture,
            "start_y_m": 0.0,
            "release_time_s": RELEASE,
            "touchdown_time_s": TOUCHDOWN,
            "friction_angle_rad": float(np.arctan(scenario.object.friction)),
            "end_time_s": MOTION,
            "table_height_m": table,
        },
    )


def recordings():
    return {architecture: recording(architecture) for architecture in ARCHITECTURES}
