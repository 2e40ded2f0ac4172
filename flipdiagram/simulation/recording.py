"""A recording: the signals of one simulated flip as an xarray.Dataset with units, every controller period.

Time 0 is the start of the motion, before it the arm holds the start pose.  Sample k of every signal belongs to the
instant t_k, before the plant steps from it: tau[k] is what the controller sends in response to q[k], qd[k]; contact
forces belong to the step that begins at t_k; a[k] = (v[k+1] − v[k]) / T is the mean acceleration until t_{k+1}.
q and what follows from it is the links'; x_meas, v_meas and a_meas are the same of the joints as the controller sees
them, at the motors; tau_cmd is tau before its limit.  qd_motor is there where the joints are elastic.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.files import versions
from flipdiagram.planning.command import Command
from flipdiagram.planning.plan import Plan
from flipdiagram.plants.handle import CONTACT_PAIRS
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory import contact

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

AXIS = ["y", "z", "theta"]
POSE = ["qw", "qx", "qy", "qz", "x", "y", "z"]

AXES, JOINTS, POSES = ("time", "axis"), ("time", "joint"), ("time", "pose")
SIGNALS = {
    **dict.fromkeys(("x_cmd", "x", "x_meas"), (AXES, "m, m, rad")),
    **dict.fromkeys(("v_cmd", "v", "v_meas"), (AXES, "m/s, m/s, rad/s")),
    **dict.fromkeys(("a_cmd", "a", "a_meas"), (AXES, "m/s2, m/s2, rad/s2")),
    "q": (JOINTS, "rad"),
    **dict.fromkeys(("qd", "qd_motor"), (JOINTS, "rad/s")),
    **dict.fromkeys(("tau", "tau_cmd", "tau_dis"), (JOINTS, "N m")),
    **dict.fromkeys(("tool_pose", "block_pose"), (POSES, "1, 1, 1, 1, m, m, m")),
    **dict.fromkeys(("sliding_angle", "sliding_angle_cmd"), (("time",), "rad")),
    "contact_force": (("time", "pair", "direction"), "N"),
    # of an MPC that replans; see `blocks.receding_horizon.Status` for the status
    "solve_time": (("time",), "s"),
    "iterations": (("time",), "1"),
    "status": (("time",), "1"),
    "cone_margin": (("time",), "rad"),
    **dict.fromkeys(("replanned", "failed", "late"), (("time",), "1")),
}
"""Dimensions and units of each signal; one unit per axis or entry of a pose where they differ."""

Recording = xr.Dataset
SCHEMA = "flipdiagram/recording/1"
FLIP, PLACE = "flip", "place"
KINDS = (FLIP, PLACE)
"""What a recording is of, in its attribute `kind`: by it the verdict and the metrics are chosen."""


def assemble(
    signals: Mapping[str, Floats],
    time: Floats,
    scenario: Scenario,
    architecture: str,
    arm: ArmModel,
    plan: Plan | Command,
) -> Recording:
    """The Dataset of logged signals; positions, velocities and poses of the tool come from q and qd.

    Args:
        signals: each (channels, samples): x_cmd, v_cmd, a_cmd, q, qd, tau, tau_cmd, block_pose, contact_force and,
            where the architecture has it, tau_dis; q_meas and qd_meas where the controller sees others than q and qd;
            solve_time and so on of an MPC that replans.
        time: (samples,) [s], 0 at the start of the motion.
        scenario: what was simulated.
        architecture: which of the four controllers.
        arm: the controller's model of the arm.
        plan: the motion that was followed in the end.
    """
    samples = len(time)
    x, v, a, tool = _motion(arm, signals["q"], signals["qd"], scenario.controller.period)
    values = {name: signals[name][:3].T for name in ("x_cmd", "v_cmd", "a_cmd")} | {"x": x, "v": v, "a": a}
    values |= dict(zip(("x_meas", "v_meas", "a_meas"), (x, v, a), strict=True))
    if "q_meas" in signals:
        seen = _motion(arm, signals["q_meas"], signals["qd_meas"], scenario.controller.period)
        values |= dict(zip(("x_meas", "v_meas", "a_meas"), seen, strict=False))
    values |= {name: signals[name].T for name in ("q", "qd", "qd_motor", "tau", "tau_cmd") if name in signals}
    values["tau_dis"] = signals.get("tau_dis", np.zeros((arm.n_joints, samples))).T
    values |= {"tool_pose": continuous(tool), "block_pose": continuous(signals["block_pose"].T)}
    values["sliding_angle"] = contact.sliding_angle(a[:, :2], x[:, 2])
    values["sliding_angle_cmd"] = contact.sliding_angle(values["a_cmd"][:, :2], x[:, 2])
    values["contact_force"] = signals["contact_force"].T.reshape(samples, 3, 3)
    values |= {name: signals[name][0] for name in SIGNALS if name in signals and name not in values}
    labels = {"joint": list(arm.joint_names), "pair": list(CONTACT_PAIRS), "direction": ["x", "y", "z"]}
    data = xr.Dataset(
        {
            name: (SIGNALS[name][0], np.array(array, order="C"), {"units": SIGNALS[name][1]})
            for name, array in values.items()
        },
        coords={"time": ("time", time, {"units": "s"}), "axis": AXIS, "pose": POSE, **labels},
        attrs=_attributes(scenario, architecture, plan),
    )
    data["tau"].attrs["limit"] = [float(limit) for limit in arm.tau_max]  # [N m], of each joint
    if "tau_dis" not in signals:
        data["tau_dis"].attrs["note"] = "this architecture has no disturbance observer"
    return data


def _motion(arm: ArmModel, q: Floats, qd: Floats, period: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Of the tool x, v, a (samples, 3), a the difference of v over the period [s], and its pose, from (n, samples)."""
    x, v, pose = arm.tool_motion(q.T, qd.T)
    return x[:, :3], v[:, :3], np.diff(v[:, :3], axis=0, append=v[-1:, :3]) / period, pose


def _attributes(scenario: Scenario, architecture: str, plan: Plan | Command) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "kind": FLIP,
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
    }


def kind_of(data: Recording) -> str:
    """One of `KINDS`; recordings of the first versions do not say it and are flips."""
    return str(data.attrs.get("kind", FLIP))


def continuous(poses: Floats) -> Floats:
    """Poses (N, 7) with the sign of each quaternion chosen next to the one before: q and −q are the same rotation."""
    flips = np.sum(poses[1:, :4] * poses[:-1, :4], axis=1) < 0
    sign = np.where(np.concatenate([[False], np.logical_xor.accumulate(flips)]), -1.0, 1.0)
    return np.hstack([poses[:, :4] * sign[:, None], poses[:, 4:]])


def rotations(poses: Floats) -> Rotation:
    """The rotations of poses (N, 7) into the world."""
    from scipy.spatial.transform import Rotation  # a tenth of a second, and planning does without

    return Rotation.from_quat(poses[:, :4], scalar_first=True)


def roll(poses: Floats) -> Floats:
    """Unwrapped roll about the base's x axis [rad] of poses (N, 7); starts in (−π, π]."""
    # as logged, not by `rotations`: the norm of the block's quaternions drifts by 4e-3, and published numbers keep it
    w, x, y, z = poses[:, :4].T
    return np.unwrap(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)))


def in_tool(data: Recording) -> Floats:
    """Position of the block's centre in the tool frame (x, s, n) [m], shape (time, 3)."""
    tool = data["tool_pose"].values
    return rotations(tool).apply(data["block_pose"].values[:, 4:] - tool[:, 4:], inverse=True)
