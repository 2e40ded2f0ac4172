"""Is it physics or the solver?  The recorded motion of the tool, with the block in MuJoCo instead of Drake.

The blade is given: a free body, far heavier than the block, whose pose and velocity are set from the recording before
every step and whose mean acceleration over the step is applied as a force, so that contact sees the true velocity (a
mocap body would have none, and friction would brake the block).  The block is free; blade and table are the boxes that
collide in Drake, and each pair gets the friction coefficient that Drake combines.  What comes back is a Recording with
MuJoCo's block, so that `metrics` judges both engines alike.  MuJoCo is an optional extra, imported when it is used.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.robot.model_files import box_inertia, table_size
from flipdiagram.scenario.scenario import Scenario, from_yaml
from flipdiagram.simulation import metrics
from flipdiagram.simulation.recording import Recording, continuous, in_tool

BLADE_MASS = 1e4
"""Mass [kg] and moment of inertia about every axis [kg m2] of the blade: 10⁵ blocks, so that the block cannot push it;
the same about every axis, so that it has no gyroscopic torque."""


@dataclass(frozen=True)
class Settings:
    """How MuJoCo solves the contact; the defaults approach rigid Coulomb friction.  InputError for a bad value.

    timestep: longest step [s]; a whole number of steps fills the recording's period.
    cone: "elliptic" is Coulomb's cone; "pyramidal" has four faces and lets less friction through along the diagonals.
    integrator: "Euler" (semi-implicit) or "implicitfast"; nothing here has damping: they differ by rounding only, which
        the last moments before the release, on an edge of the block, amplify to 0.02 rad at touch-down.
    impratio: stiffness of friction over that of the normal direction; above 1 friction creeps less.
    noslip_iterations: passes that remove what creep is left; 0 for none: they cost sliding friction half a percent.
    time_constant: decay [s] of a penetration (solref); at least twice the step, or contact is no longer stable.
        2 ms lets the block sink 0.4 µm under its weight, as the rubber's modulus of 1 MPa lets it sink 0.7 µm.
    damping_ratio: 1 for critical damping: no rebound, as Drake's dissipation of 20 s/m leaves next to none.
    impedance: share of the contact force that is a constraint, 0 to 1 (solimp, constant); the rest is compliance.
    condim: 3 for normal and tangential forces, 4 adds friction against spinning, 6 against rolling; the corners of a
        face resist spinning by themselves, so 3 is enough.
    settle: time of the hold [s] in which the block comes to rest before the motion starts.
    """

    timestep: float = 1e-4
    cone: str = "elliptic"
    integrator: str = "Euler"
    impratio: float = 100.0
    noslip_iterations: int = 0
    time_constant: float = 2e-3
    damping_ratio: float = 1.0
    impedance: float = 0.99
    condim: int = 3
    settle: float = 0.3

    def __post_init__(self) -> None:
        choices = {"cone": ("elliptic", "pyramidal"), "integrator": ("Euler", "implicitfast"), "condim": (3, 4, 6)}
        ranges = {
            "timestep": (1e-6, 1e-2),
            "impratio": (1e-3, 1e3),
            "noslip_iterations": (0, 1000),
            "time_constant": (2 * self.timestep, 1.0),
            "damping_ratio": (1e-3, 1e3),
            "impedance": (0.01, 0.9999),
            "settle": (0.0, 100.0),
        }
        valid = {name: getattr(self, name) in among for name, among in choices.items()}
        valid |= {name: low <= getattr(self, name) <= high for name, (low, high) in ranges.items()}
        for name in [name for name, good in valid.items() if not good]:
            allowed = " or ".join(map(str, choices[name])) if name in choices else "{:g} to {:g}".format(*ranges[name])
            raise InputError(f"MuJoCo setting '{name}' = {getattr(self, name)!r} is not valid; valid is {allowed}")

    def settings_text(self) -> str:
        """The contact settings in one line, for a report."""
        return (
            f"MuJoCo, step {self.timestep * 1e3:g} ms, {self.integrator}, {self.cone} cone, impratio {self.impratio:g},"
            f" {self.noslip_iterations} noslip iterations, solref {self.time_constant * 1e3:g} ms /"
            f" {self.damping_ratio:g}, solimp {self.impedance:g}, condim {self.condim}"
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
    q = pose[:, :4] / np.linalg.norm(pose[:, :4], axis=1, keepdims=True)
    w, v = q[:, :1], q[:, 1:]
    place = pose[:, 4:] + point + 2 * np.cross(v, np.cross(v, point) + w * point)
    # vector part of 2 q* q' / h, for a small turn from q to q'
    spin = 2 * (w[:-1] * v[1:] - w[1:] * v[:-1] - np.cross(v[:-1], v[1:])) / step
    return np.hstack([place, q])[1:], np.hstack([np.diff(place, axis=0) / step, spin])


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
    data.qvel[6:] = [*qvel[0, :3], *_turned(mujoco, qvel[0, 3:], qpos[0, 3:], data.qpos[10:])]
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
    drake, mujoco = _verdict(recording), _verdict(replay_in_mujoco(recording, settings))
    agree = drake["success"] == mujoco["success"]
    return {"agree": agree, "settings": settings.settings_text(), "drake": drake, "mujoco": mujoco}


def _verdict(recording: Recording) -> dict[str, Any]:
    success, failure = metrics.judge(recording)
    landed = metrics.touchdown(recording)
    slip, lift = metrics.slip_and_lift(recording)
    return {
        "success": success,
        "failure": failure,
        "touchdown": None if landed is None else asdict(landed),
        "release_time_s": float(recording["time"].values[metrics.release_index(recording)]),
        "max_slip_m": slip,
        "max_lift_off_m": lift,
    }


def mjcf(scenario: Scenario, settings: Settings, step: float, origin: Floats) -> str:
    """MuJoCo's model of blade, block and table: the boxes that collide in Drake, in MJCF.

    step [s]; origin: of the blade's body, in the tool frame [m].
    """
    tool, thing, table = scenario.tool, scenario.object, scenario.table
    plate = table_size()
    block_size = np.array([thing.width, thing.length, thing.thickness])
    blade_size = np.array([tool.blade_length, tool.blade_width, tool.blade_thickness])
    blade_centre = np.array([0.0, 0.0, -tool.blade_thickness / 2])
    top = (scenario.task.start_x, scenario.task.target_y, table.height - plate[2] / 2)
    inertia = box_inertia(thing.mass, block_size.tolist())
    # 2ab/(a + b), as Drake combines them; the spatula has the friction of the object (`parts.add_parts`): a = b there
    on_table = 2 * thing.friction * table.friction / (thing.friction + table.friction)
    solref = _text((settings.time_constant, settings.damping_ratio))
    solimp = _text((settings.impedance, settings.impedance, 1e-3, 0.5, 2.0))
    contact = f'condim="{settings.condim}" solref="{solref}" solimp="{solimp}"'
    # torsional and rolling friction, which only condim 4 and 6 use, keep MuJoCo's defaults of 5 mm and 0.1 mm;
    # contype and conaffinity 0: nothing touches but the pairs that are named
    return f"""<mujoco>
  <option timestep="{step!r}" gravity="0 0 -9.81" integrator="{settings.integrator}" cone="{settings.cone}"
          impratio="{float(settings.impratio)!r}" noslip_iterations="{settings.noslip_iterations}" solver="Newton"
          iterations="100" tolerance="1e-12" noslip_tolerance="1e-12"><flag autoreset="disable"/></option>
  <default><geom type="box" contype="0" conaffinity="0"/></default>
  <worldbody>
    <geom name="table" size="{_text(plate / 2)}" pos="{_text(top)}"/>
    <body name="blade"><freejoint/>
      <inertial pos="0 0 0" mass="{BLADE_MASS!r}" diaginertia="{_text([BLADE_MASS] * 3)}"/>
      <geom name="blade" size="{_text(blade_size / 2)}" pos="{_text(blade_centre - origin)}"/></body>
    <body name="block"><freejoint/>
      <inertial pos="0 0 0" mass="{thing.mass!r}" diaginertia="{_text(inertia)}"/>
      <geom name="block" size="{_text(block_size / 2)}"/></body>
  </worldbody>
  <contact>
    <pair geom1="blade" geom2="block" friction="{thing.friction!r} {thing.friction!r}" {contact}/>
    <pair geom1="table" geom2="block" friction="{on_table!r} {on_table!r}" {contact}/>
  </contact>
</mujoco>"""


def _turned(mujoco: Any, vector: Floats, old: Floats, new: Floats) -> Floats:
    """A vector given in the axes of one quaternion, in those of another."""
    inverse, result = np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, new)
    mujoco.mju_mulQuat(inverse, inverse, old)
    mujoco.mju_rotVecQuat(result, vector, inverse)
    return result


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
        raise InputError(f"the recording lacks finite {', '.join(bad)}; valid is one that `simulate` returns")
    return from_yaml(recording.attrs["scenario"], "scenario of the recording")


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
