"""How near a flip comes to its limits: signals derived from a recording and added to it.

Planned signals (`_cmd`) take the command for the motion and the object as the planner knows it; realised ones take the
forces that acted.  Both are nan where blade and block do not touch (planned: after the planned release).
"""

import numpy as np
import xarray as xr

from flipdiagram.arrays import Floats
from flipdiagram.robot.model_files import object_inertia
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.recording import Recording, in_tool, rotations
from flipdiagram.theory import contact

LEAST_FORCE = 1e-3
"""Normal force [N] below which a ratio of forces says noblock."""


def with_margins(data: Recording, blade_moment: Floats, scenario: Scenario) -> Recording:
    """The recording with cone use, normal force, centre of pressure, slip, power and energy per joint.

    blade_moment (time, 3) [N·m]: moment of the blade's force on the block about the world's origin.
    """
    realised = _realised(data, blade_moment, scenario.object.friction)
    planned = _planned(data, scenario)
    time = data["time"].values
    torque, velocity = data["tau"].values, data["qd_motor" if "qd_motor" in data else "qd"].values
    power = torque * velocity
    # tau[k] acts through the whole step from qd[k] to qd[k+1]: power at its ends alone is 10 % off in a flip
    steps = torque[:-1] * (velocity[:-1] + velocity[1:]) / 2 * np.diff(time)[:, None]
    energy = np.vstack([np.zeros_like(torque[:1]), np.cumsum(steps, axis=0)])
    at_start = int(np.searchsorted(time, 0.0))
    joint = ("time", "joint")
    added = {
        **{name: (("time",), values, {"units": units}) for name, (values, units) in (realised | planned).items()},
        "power": (joint, power, {"units": "W"}),
        "energy": (joint, energy - energy[at_start], {"units": "J", "note": "work of the drives since time 0"}),
    }
    return data.assign({name: xr.Variable(dims, values, attrs) for name, (dims, values, attrs) in added.items()})


def _realised(data: Recording, moment: Floats, friction: float) -> dict[str, tuple[Floats, str]]:
    """From the contact forces and poses that the physics produced."""
    force, pose = data["contact_force"].sel(pair="blade-block").values, data["tool_pose"].values
    tool, about_tool = rotations(pose), moment - np.cross(pose[:, 4:], force)
    f_x, f_s, f_n = tool.apply(force, inverse=True).T  # along the tool's x, s and n
    m_x = tool.apply(about_tool, inverse=True)[:, 0]
    touching = f_n > LEAST_FORCE
    relative = in_tool(data)
    rest = relative[int(np.searchsorted(data["time"].values, 0.0))]
    with np.errstate(divide="ignore", invalid="ignore"):
        use = np.where(touching, np.hypot(f_x, f_s) / (friction * f_n), np.nan)
        # the tangential moment vanishes at the centre of pressure: s · f_n = m_x on the blade's surface
        pressure = np.where(touching, m_x / f_n - relative[:, 1], np.nan)
    slip = np.hypot(*(relative[:, :2] - rest[:2]).T)
    return {
        "normal_force": (f_n, "N"),
        "cone_use": (use, "1"),
        "centre_of_pressure": (pressure, "m"),
        "slip": (np.where(touching, slip, np.nan), "m"),
        "lift_off": (relative[:, 2] - rest[2], "m"),
    }


def _planned(data: Recording, scenario: Scenario) -> dict[str, tuple[Floats, str]]:
    """What the command asks of the contact, by eqs. (10) and (11)."""
    block, time = scenario.object, data["time"].values
    a, theta = data["a_cmd"].values, data["x_cmd"].values[:, 2]
    carried = time <= data.attrs["release_time_s"]
    tangential, normal = contact.contact_force(a[:, :2], theta)
    gyration = object_inertia(1.0, block)[0]
    pressure = contact.centre_of_pressure(a, theta, block.thickness / 2, gyration)
    with np.errstate(divide="ignore", invalid="ignore"):
        use = np.abs(tangential) / (block.friction * normal)
    return {
        "normal_force_cmd": (np.where(carried, block.mass * normal, np.nan), "N"),
        "cone_use_cmd": (np.where(carried & (normal > 0), use, np.nan), "1"),
        "centre_of_pressure_cmd": (np.where(carried, pressure, np.nan), "m"),
    }
