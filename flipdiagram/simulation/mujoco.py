"""Is it physics or the solver?  The recorded motion of the tool, with the block in MuJoCo instead of Drake.

The blade is given: a free body, far heavier than the block, whose pose and velocity are set from the recording before
every step and whose mean acceleration over the step is applied as a force, so that contact sees the true velocity (a
mocap body would have none, and friction would brake the block).  The block is free; blade and table are the boxes that
collide in Drake, and each pair gets the friction coefficient that Drake combines.  What comes back is a Recording with
MuJoCo's block, so that `metrics` judges both engines alike.
"""

import math
from typing import Any

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from scipy.interpolate import CubicSpline

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants.handle import CONTACT_PAIRS, add_model
from flipdiagram.plants.mujoco_contact import (
    Settings,
    compiled,
    contact_boxes,
    free_body,
    head,
    import_mujoco,
    inertial,
    pairs,
)
from flipdiagram.scenario.scenario import Scenario, from_yaml
from flipdiagram.simulation import metrics
from flipdiagram.simulation.recording import Recording, continuous, in_tool, rotations

BLADE_MASS = 1e4
"""Mass [kg] and moment of inertia about every axis [kg m2] of the blade: 10⁵ blocks, so that the block cannot push it;
the same about every axis, so that it has no gyroscopic torque."""

COMPARED = ("success", "failure", "touchdown", "release_time_s", "max_slip_m", "max_lift_off_m")
"""Metrics that depend on the block, which is all that differs between the engines."""


def blade_motion(recording: Recording, time: Floats, point: Floats) -> tuple[Floats, Floats]:
    """The tool at equidistant times [s], as MuJoCo has it: qpos (n, 7), position of a point of the tool frame [m] and
    quaternion; and qvel (n, 6), its velocity in the world [m/s] and the angular velocity in the tool's axes [rad/s].

    A cubic spline goes through the samples of tool_pose.  Each velocity is the mean over the step that ends there:
    MuJoCo's semi-implicit steps then meet every pose, and block and blade move by the same rule.
    """
    step = float(time[1] - time[0])
    spline = CubicSpline(recording["time"].values, continuous(recording["tool_pose"].values))
    pose = spline(np.concatenate([[time[0] - step], time]))
    turns = rotations(pose)
    place = pose[:, 4:] + turns.apply(point)
    # 2 / h times the vector part of the turn from each pose to the next: small turns
    spin = 2 * (turns[:-1].inv() * turns[1:]).as_quat(canonical=True)[:, :3] / step
    qpos = np.hstack([place, turns.as_quat(scalar_first=True)])
    return qpos[1:], np.hstack([np.diff(place, axis=0) / step, spin])


def replay_in_mujoco(recording: Recording, settings: Settings | None = None) -> Recording:
    """The recording with the block of MuJoCo: block_pose, and contact_force of blade-block and table-block.

    The block starts where Drake's lies on the blade, `settings.settle` before the motion, at rest on it; samples before
    that, the tool, and the force between table and blade stay Drake's.  contact_force is the mean over the step of the
    recording [N].  Attributes: `engine` (the settings in one line) and `blade_error_m`, the largest distance of the
    blade from the recording before it is set back to it [m].

    Raises InputError where MuJoCo is missing or the recording lacks a signal or its scenario, SimulationError where
    MuJoCo's state is not finite any more (MuJoCo then leaves its MUJOCO_LOG.TXT in the working directory).
    """
    settings = settings or Settings()
    mujoco = import_mujoco()
    scenario = _scenario_of(recording)
    time = recording["time"].values
    period = float(time[-1] - time[0]) / (len(time) - 1)
    first = int(np.searchsorted(time, -settings.settle - period / 2))
    substeps = math.ceil(period / settings.timestep - 1e-9)
    step = period / substeps
    # MuJoCo leaves ω × (ω × r), r from the blade's origin to the block's, out of the acceleration of a contact: a block
    # on a turntable would creep outwards.  With the origin where the block lies, r = 0.
    lies = in_tool(recording)[first]
    # to one period beyond the end, where the spline goes on: the last force belongs to the step that begins there
    model = compiled(mujoco, mjcf(scenario, settings, step, lies))
    data = mujoco.MjData(model)
    qpos, qvel = blade_motion(recording, time[first] + step * np.arange((len(time) - first) * substeps + 1), lies)
    weight = BLADE_MASS * np.array([0.0, 0.0, -model.opt.gravity[2], 0.0, 0.0, 0.0])
    push = BLADE_MASS * np.diff(qvel, axis=0) / step + weight

    data.qpos[:7], data.qvel[:6] = qpos[0], qvel[0]
    data.qpos[7:] = np.roll(recording["block_pose"].values[first], 3)
    blade, block = rotations(np.array([qpos[0, 3:], data.qpos[10:]]))
    data.qvel[6:] = [*qvel[0, :3], *(block.inv() * blade).apply(qvel[0, 3:])]  # at rest on the blade, in its own axes
    poses, forces = recording["block_pose"].values.copy(), recording["contact_force"].values.copy()
    blade_error = 0.0
    for k in range(first, len(time)):
        poses[k] = [*data.qpos[10:], *data.qpos[7:10]]
        total = np.zeros(12)
        for i in range((k - first) * substeps, (k - first + 1) * substeps):
            blade_error = max(blade_error, math.dist(data.qpos[:3], qpos[i, :3]))
            data.qpos[:7], data.qvel[:6], data.qfrc_applied[:6] = qpos[i], qvel[i], push[i]
            mujoco.mj_step(model, data)
            total += data.qfrc_constraint
        # what contact does to the blade is the reaction of what the blade does to the block
        forces[k, 0] = -total[:3] / substeps
        forces[k, 1] = (total[6:9] + total[:3]) / substeps
        if not np.all(np.isfinite(data.qpos)):
            raise SimulationError(f"MuJoCo diverged at {time[k]:.3f} s; a shorter timestep than {step:g} s may help")
    changed = {"block_pose": continuous(poses), "contact_force": forces}
    replayed = recording.assign({name: recording[name].copy(data=values) for name, values in changed.items()})
    return replayed.assign_attrs(engine=settings.settings_text(), blade_error_m=blade_error)


def compare(recording: Recording, settings: Settings | None = None) -> dict[str, Any]:
    """The verdict of both engines on one recorded flip, by the same judge.

    Keys: `agree` (both succeed or both fail), `settings` (one line), and for `drake` and `mujoco` each: success,
    failure, touchdown (time_s, y_m, z_m, theta_rad, or None), release_time_s, max_slip_m, max_lift_off_m.
    Raises the errors of `replay_in_mujoco`.
    """
    settings = settings or Settings()
    measured = [metrics.measure(data).as_dict() for data in (recording, replay_in_mujoco(recording, settings))]
    drake, mujoco = ({name: numbers[name] for name in COMPARED} for numbers in measured)
    agree = drake["success"] == mujoco["success"]
    return {"agree": agree, "settings": settings.settings_text(), "drake": drake, "mujoco": mujoco}


def mjcf(scenario: Scenario, settings: Settings, step: float, origin: Floats) -> str:
    """MuJoCo's model of blade, block and table: the boxes that collide in Drake, in MJCF.

    step [s]; origin: of the blade's body, in the tool frame [m].
    """
    plant, scene_graph = MultibodyPlant(step), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parts = add_model(plant, scenario)
    boxes = contact_boxes(plant, scene_graph, parts)
    # the body's axes are the tool's
    X_TS = parts.arm.tool.GetFixedPoseInBodyFrame().inverse()
    blade = "".join(box.geom(RigidTransform(-origin) @ X_TS) for box in boxes["blade"])
    X_WTable = parts.table.EvalPoseInWorld(plant.CreateDefaultContext())
    return f"""<mujoco>
  {head(settings, step, plant.gravity_field().gravity_vector())}
  <worldbody>
    {"".join(box.geom(X_WTable) for box in boxes["table"])}
    <body name="blade"><freejoint/>{inertial(BLADE_MASS, np.zeros(3), BLADE_MASS * np.eye(3))}{blade}</body>
    {free_body("block", parts.block, boxes["block"])}
  </worldbody>
  <contact>{pairs(boxes, CONTACT_PAIRS[:2], settings)}</contact>
</mujoco>"""


def _scenario_of(recording: Recording) -> Scenario:
    signals = ("block_pose", "contact_force", "tool_pose")
    bad = [name for name in signals if name not in recording or not np.isfinite(recording[name].values).all()]
    bad += ["scenario"] * ("scenario" not in recording.attrs)
    if bad:
        problem = f"the recording lacks finite {', '.join(bad)}"
        raise InputError.of("recording", bad, "one that `simulate` returns", problem)
    return from_yaml(recording.attrs["scenario"], "scenario of the recording")
