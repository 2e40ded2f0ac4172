"""A recording: the signals of one simulated flip as an xarray.Dataset with units, every controller period.

Time 0 is the start of the motion, before it the arm holds the start pose.  Sample k of every signal belongs to the
instant t_k, before the plant steps from it: tau[k] is what the controller sends in response to q[k], qd[k]; contact
forces belong to the step that begins at t_k; a[k] = (v[k+1] − v[k]) / T is the mean acceleration until t_{k+1}.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.files import versions
from flipdiagram.planning.command import Command
from flipdiagram.planning.plan import Plan
from flipdiagram.plants.cell import CONTACT_PAIRS
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory import contact

AXIS = ["y", "z", "theta"]
POSE = ["qw", "qx", "qy", "qz", "x", "y", "z"]

REPLANNING = {"solve_time": "s", "iterations": "1", "status": "1", "cone_margin": "rad"}
"""Signals of an MPC that replans, with their units; see `blocks.receding_horizon.Status` for the status."""

Recording = xr.Dataset
SCHEMA = "flipdiagram/recording/1"


def assemble(
    signals: Mapping[str, Floats],
    time: Floats,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    plan: Plan | Command,
) -> Recording:
    """Build the Dataset from logged signals, each (channels, samples): x_cmd, v_cmd, a_cmd, q, qd, tau, block_pose,
    contact_force and, where the architecture has it, tau_dis.
    """
    n = arm.n_joints
    q, qd = signals["q"].T, signals["qd"].T
    samples = len(time)
    x, v = np.empty((samples, 3)), np.empty((samples, 3))
    tool = np.empty((samples, 7))
    for k in range(samples):
        six_x, six_v = arm.task_position_velocity(q[k], qd[k])
        x[k], v[k] = six_x[:3], six_v[:3]
        pose = arm.X_WT(q[k])
        tool[k] = [*pose.rotation().ToQuaternion().wxyz(), *pose.translation()]
    a = np.diff(v, axis=0, append=v[-1:]) / scenario.controller.period
    a_cmd = signals["a_cmd"][:3].T
    joint, axis = ("time", "joint"), ("time", "axis")
    mixed = "m, m, rad"
    variables = {
        "x_cmd": (axis, signals["x_cmd"][:3].T, mixed),
        "v_cmd": (axis, signals["v_cmd"][:3].T, "m/s, m/s, rad/s"),
        "a_cmd": (axis, a_cmd, "m/s2, m/s2, rad/s2"),
        "x": (axis, x, mixed),
        "v": (axis, v, "m/s, m/s, rad/s"),
        "a": (axis, a, "m/s2, m/s2, rad/s2"),
        "q": (joint, q, "rad"),
        "qd": (joint, qd, "rad/s"),
        "tau": (joint, signals["tau"].T, "N m"),
        "tau_dis": (joint, signals.get("tau_dis", np.zeros((n, samples))).T, "N m"),
        "tool_pose": (("time", "pose"), continuous(tool), "1, 1, 1, 1, m, m, m"),
        "block_pose": (("time", "pose"), continuous(signals["block_pose"].T), "1, 1, 1, 1, m, m, m"),
        "sliding_angle": (("time",), contact.sliding_angle(a[:, :2], x[:, 2]), "rad"),
        "sliding_angle_cmd": (("time",), contact.sliding_angle(a_cmd[:, :2], x[:, 2]), "rad"),
        "contact_force": (("time", "pair", "direction"), signals["contact_force"].T.reshape(samples, 3, 3), "N"),
    }
    data = xr.Dataset(
        {
            name: (dims, np.ascontiguousarray(values), {"units": units})
            for name, (dims, values, units) in variables.items()
        },
        coords={
            "time": ("time", time, {"units": "s"}),
            "axis": AXIS,
            "joint": list(arm.joint_names),
            "pose": POSE,
            "pair": list(CONTACT_PAIRS),
            "direction": ["x", "y", "z"],
        },
        attrs={
            "schema": SCHEMA,
            **{f"{name}_version": number for name, number in versions().items()},
            "architecture": architecture,
            "start_y_m": scenario.task.start_y,
            "release_time_s": plan.release_time,
            "touchdown_time_s": plan.touchdown_time,
            "end_time_s": plan.end_time,
            "friction_angle_rad": float(contact.friction_angle(scenario.object.friction)),
            "table_height_m": scenario.table.height,
            "target_y_m": scenario.task.target_y,
            "alpha_1_m2": scenario.planner.alpha,
            "beta_s2_m2": scenario.planner.beta,
            "scenario": scenario.to_yaml(),
        },
    )
    for name, units in REPLANNING.items():
        if name in signals:
            data[name] = (("time",), signals[name][0].copy(), {"units": units})
    data["tau"].attrs["limit"] = [float(limit) for limit in arm.tau_max]  # [N m], of each joint
    if "tau_dis" not in signals:
        data["tau_dis"].attrs["note"] = "this architecture has no disturbance observer"
    return data


def continuous(poses: Floats) -> Floats:
    """Poses (N, 7) with the sign of each quaternion chosen next to the one before: q and −q are the same rotation."""
    flips = np.sum(poses[1:, :4] * poses[:-1, :4], axis=1) < 0
    sign = np.where(np.concatenate([[False], np.logical_xor.accumulate(flips)]), -1.0, 1.0)
    return np.hstack([poses[:, :4] * sign[:, None], poses[:, 4:]])


def roll(poses: Floats) -> Floats:
    """Unwrapped roll about the base's x axis [rad] of poses (N, 7); starts in (−π, π]."""
    w, x, y, z = poses[:, :4].T
    return np.unwrap(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)))


def tool_axes(data: Recording) -> Floats:
    """The tool's axes x, s, n as rows, in world axes, shape (time, 3, 3)."""
    w, x, y, z = data["tool_pose"].values[:, :4].T
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.moveaxis(axes, -1, 0)


def in_tool(data: Recording) -> Floats:
    """Position of the block's centre in the tool frame (x, s, n) [m], shape (time, 3)."""
    offset = data["block_pose"].values[:, 4:] - data["tool_pose"].values[:, 4:]
    return np.einsum("tij,tj->ti", tool_axes(data), offset)
