"""Recordings made up for tests of pictures: smooth motions, written as `simulate` writes them, without any physics."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np
from ideal import IDEAL
from scipy.interpolate import CubicSpline

from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.simulation.recording import assemble

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
    scenario = IDEAL
    thickness, table = scenario.object.thickness, scenario.table.height
    t = np.arange(-300, int(END * 1000) + 1) * 1e-3
    lag = {"pd": 0.03, "pd+ff": 0.02, "pd+dob": 0.01, "pd+ff+dob": 0.004}[architecture]
    sag = {"pd": 0.03, "pd+ff": 0.025}.get(architecture, 0.0)
    x_cmd = command(t)
    x = command(t - lag) - np.array([0.0, sag, 0.0])

    knots = np.arange(t[0], t[-1] + 0.01, 0.02)
    at_knots = command(knots - lag) - np.array([0.0, sag, 0.0])
    rest = np.tile([scenario.task.start_x, 0.0, 0.0], (len(knots), 1))
    arm = arm_of(scenario)
    joints = arm.inverse_kinematics_path(np.hstack([at_knots, rest]), tol=1e-6)
    spline = CubicSpline(knots, joints)
    q, qd = spline(t), spline(t, 1)

    across = np.full((len(t), 1), scenario.task.start_x)
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

    v_cmd = np.gradient(x_cmd, 1e-3, axis=0)
    torque = np.cos(3 * np.outer(t, np.arange(1, 7))) * [20, 120, 40, 5, 8, 2]
    force = np.zeros((len(t), 3, 3))
    force[t < leave, 0] = [0.0, 0.2, 0.6]
    force[lying, 1] = [0.0, 0.0, 0.6]
    signals = {"x_cmd": x_cmd, "v_cmd": v_cmd, "a_cmd": np.gradient(v_cmd, 1e-3, axis=0), "q": q, "qd": qd}
    signals |= {
        "tau": torque,
        "tau_cmd": torque,
        "tau_dis": 0.3 * torque,
        "block_pose": block_pose,
        "contact_force": force.reshape(-1, 9),
    }
    plan = SimpleNamespace(release_time=RELEASE, touchdown_time=TOUCHDOWN, end_time=MOTION)
    logs = {name: values.T for name, values in signals.items() if name != "tau_dis" or "dob" in architecture}
    return assemble(logs, t, scenario, architecture, arm, plan)


def recordings():
    return {architecture: recording(architecture) for architecture in ARCHITECTURES}
