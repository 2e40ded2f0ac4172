"""Is it physics or the solver?  The recorded motion of the tool, with the block in MuJoCo instead of Drake.

The blade is given: a free body, far heavier than the block, whose pose and velocity are set from the recording before
every step and whose mean acceleration over the step is applied as a force, so that contact sees the true velocity (a
mocap body would have none, and friction would brake the block).  The block is free; blade and table are the boxes that
collide in Drake, and each pair gets the friction coefficient that Drake combines.  What comes back is a Recording with
MuJoCo's block, so that `metrics` judges both engines alike.  MuJoCo is an optional extra, imported when it is used.
"""

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.robot.model_files import box_inertia, spaced, table_size
from flipdiagram.scenario.scenario import Scenario, from_yaml
from flipdiagram.simulation import metrics
from flipdiagram.simulation.recording import Recording, continuous, in_tool, rotations

BLADE_MASS = 1e4
"""Mass [kg] and moment of inertia about every axis [kg m2] of the blade: 10⁵ blocks, so that the block cannot push it;
the same about every axis, so that it has no gyroscopic torque."""

COMPARED = ("success", "failure", "touchdown", "release_time_s", "max_slip_m", "max_lift_off_m")
"""Metrics that depend on the block, which is all that differs between the engines."""
CONES = ("elliptic", "pyramidal")
RANGES = {"timestep": (1e-6, 1e-2), "impratio": (1e-3, 1e3), "impedance": (0.01, 0.9999), "settle": (0.0, 100.0)}


@dataclass(frozen=True)
class Settings:
    """How MuJoCo solves the contact; the defaults approach rigid Coulomb friction.  InputError for a bad value.

    What has one value only stands in `mjcf`: the integrator is "Euler" (nothing has damping: "implicitfast" differs by
    rounding, which the last moments before the release, on an edge of the block, amplify to 0.02 rad at touch-down);
    no noslip iterations, which cost sliding friction half a percent; damping ratio 1, no rebound, as Drake's
    dissipation of 20 s/m leaves next to none; condim 3, as the corners of a face resist spinning by themselves.

    Args:
        timestep: longest step [s]; a whole number of steps fills the recording's period.
        cone: "elliptic" is Coulomb's; "pyramidal" has four faces and lets less friction through along the diagonals.
        impratio: stiffness of friction over that of the normal direction; above 1 friction creeps less.
        time_constant: decay [s] of a penetration (solref); at least twice the step, or contact is no longer stable.
            2 ms lets the block sink 0.4 µm under its weight, as the rubber's modulus of 1 MPa lets it sink 0.7 µm.
        impedance: share of the contact force that is a constraint, 0 to 1 (solimp, constant); the rest is compliance.
        settle: time of the hold [s] in which the block comes to rest before the motion starts.
    """

    timestep: float = 1e-4
    cone: str = "elliptic"
    impratio: float = 100.0
    time_constant: float = 2e-3
    impedance: float = 0.99
    settle: float = 0.3

    def __post_init__(self) -> None:
        if self.cone not in CONES:
            raise InputError.of("MuJoCo setting 'cone'", self.cone, CONES)
        for name, (low, high) in (RANGES | {"time_constant": (2 * self.timestep, 1.0)}).items():
            if not low <= getattr(self, name) <= high:
                raise InputError.of(f"MuJoCo setting '{name}'", getattr(self, name), f"{low:g} to {high:g}")

    def settings_text(self) -> str:
        """The contact settings in one line, for a report."""
        return (
            f"MuJoCo, step {self.timestep * 1e3:g} ms, Euler, {self.cone} cone, impratio {self.impratio:g}, 0 noslip"
            f" iterations, solref {self.time_constant * 1e3:g} ms / 1, solimp {self.impedance:g}, condim 3"
        )


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
    mujoco = _mujoco()
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
    model = mujoco.MjModel.from_xml_string(mjcf(scenario, settings, step, lies))
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
    tool, block, table = scenario.tool, scenario.object, scenario.table
    plate = table_size()
    blade_centre = np.array([0.0, 0.0, -tool.blade_thickness / 2])
    top = (scenario.task.start_x, scenario.task.target_y, table.height - plate[2] / 2)
    inertia = box_inertia(block.mass, block.size)
    # 2ab/(a + b), as Drake combines them; the spatula has the friction of the object (`parts.add_parts`): a = b there
    on_table = 2 * block.friction * table.friction / (block.friction + table.friction)
    solref = spaced((settings.time_constant, 1.0))
    solimp = spaced((settings.impedance, settings.impedance, 1e-3, 0.5, 2.0))
    contact = f'condim="3" solref="{solref}" solimp="{solimp}"'
    # contype and conaffinity 0: nothing touches but the pairs that are named
    return f"""<mujoco>
  <option timestep="{step!r}" gravity="0 0 -9.81" integrator="Euler" cone="{settings.cone}"
          impratio="{float(settings.impratio)!r}" solver="Newton"
          iterations="100" tolerance="1e-12"><flag autoreset="disable"/></option>
  <default><geom type="box" contype="0" conaffinity="0"/></default>
  <worldbody>
    <geom name="table" size="{spaced(plate / 2)}" pos="{spaced(top)}"/>
    <body name="blade"><freejoint/>
      <inertial pos="0 0 0" mass="{BLADE_MASS!r}" diaginertia="{spaced([BLADE_MASS] * 3)}"/>
      <geom name="blade" size="{spaced(np.array(tool.blade_size) / 2)}" pos="{spaced(blade_centre - origin)}"/></body>
    <body name="block"><freejoint/>
      <inertial pos="0 0 0" mass="{block.mass!r}" diaginertia="{spaced(inertia)}"/>
      <geom name="block" size="{spaced(np.array(block.size) / 2)}"/></body>
  </worldbody>
  <contact>
    <pair geom1="blade" geom2="block" friction="{block.friction!r} {block.friction!r}" {contact}/>
    <pair geom1="table" geom2="block" friction="{on_table!r} {on_table!r}" {contact}/>
  </contact>
</mujoco>"""


def _mujoco() -> Any:
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise InputError("the second engine needs MuJoCo: pip install 'flipdiagram[mujoco]'") from None


def _scenario_of(recording: Recording) -> Scenario:
    signals = ("block_pose", "contact_force", "tool_pose")
    bad = [name for name in signals if name not in recording or not np.isfinite(recording[name].values).all()]
    bad += ["scenario"] * ("scenario" not in recording.attrs)
    if bad:
        problem = f"the recording lacks finite {', '.join(bad)}"
        raise InputError.of("recording", bad, "one that `simulate` returns", problem)
    return from_yaml(recording.attrs["scenario"], "scenario of the recording")
