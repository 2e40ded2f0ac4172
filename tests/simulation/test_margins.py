"""Cone use, centre of pressure, power and energy: against numbers worked out by hand, and against the laws they obey."""

import numpy as np
import pytest
import xarray as xr
from ideal import IDEAL
from pydrake.multibody.plant import MultibodyPlant

from flipdiagram.planning import plan_motion
from flipdiagram.robot.parts import add_parts
from flipdiagram.simulation import verdict
from flipdiagram.simulation.margins import with_margins
from flipdiagram.simulation.recording import in_tool
from flipdiagram.simulation.simulate import simulate

G = 9.81
SCENARIO = IDEAL
MASS, HALF, MU = SCENARIO.object.mass, SCENARIO.object.thickness / 2, SCENARIO.object.friction
PERIOD = 1e-3


def made_up(theta, force, at, *, a_cmd=(0.0, 0.0, 0.0), slip=0.0, joints=None, release=1.0):
    """A recording of a blade tilted by theta (n,) whose origin stands still at (0.5, 0.1, 0.3).

    force (3,) or (n, 3) [N] acts on the block at `at` (x, s, n) of the tool [m]; the block's centre lies `slip` along s.
    Returns the recording and the moment of the force about the world's origin.
    """
    theta = np.asarray(theta, dtype=float)
    n = len(theta)
    time = np.arange(n) * PERIOD
    zero, one = np.zeros(n), np.ones(n)
    origin = np.tile([0.5, 0.1, 0.3], (n, 1))
    s = np.column_stack([zero, np.cos(theta), np.sin(theta)])
    normal = np.column_stack([zero, -np.sin(theta), np.cos(theta)])
    turn = np.column_stack([np.cos(theta / 2), np.sin(theta / 2), zero, zero])
    centre = origin + np.multiply.outer(np.broadcast_to(slip, n), [1, 1, 1]) * s + HALF * normal
    force = np.broadcast_to(force, (n, 3)).astype(float)
    point = origin + at[0] * np.array([1.0, 0, 0]) + at[1] * s + at[2] * normal
    contact = np.zeros((n, 3, 3))
    contact[:, 0] = force
    tau, qd = joints or (np.zeros((n, 6)), np.zeros((n, 6)))
    x_cmd = np.column_stack([zero, zero, theta])
    variables = {
        "x_cmd": (("time", "axis"), x_cmd),
        "a_cmd": (("time", "axis"), np.multiply.outer(one, np.asarray(a_cmd))),
        "tau": (("time", "joint"), tau),
        "qd": (("time", "joint"), qd),
        "tool_pose": (("time", "pose"), np.hstack([turn, origin])),
        "block_pose": (("time", "pose"), np.hstack([turn, centre])),
        "contact_force": (("time", "pair", "direction"), contact),
    }
    pairs = ["blade-block", "table-block", "table-blade"]
    data = xr.Dataset(variables, {"time": time, "pair": pairs}, {"release_time_s": release})
    return data, np.cross(point, force)


def margins(*arguments, scenario=SCENARIO, **settings):
    data, moment = made_up(*arguments, **settings)
    return with_margins(data, moment, scenario)


@pytest.mark.parametrize("theta", [0.0, 0.3, -0.8, 1.0, 2.0])
def test_a_block_that_lies_on_a_tilted_blade_uses_tan_theta_over_mu_of_the_cone(theta):
    """Its weight acts through its centre: the pressure moves down the slope by h tan θ."""
    at = HALF * np.tan(-theta)  # the vertical through the centre meets the surface here
    data = margins([theta] * 5, [0.0, 0.0, MASS * G], (0.0, at, 0.0))
    if np.cos(theta) > 0:
        np.testing.assert_allclose(data["normal_force"], MASS * G * np.cos(theta), rtol=1e-12)
        np.testing.assert_allclose(data["cone_use"], abs(np.tan(theta)) / MU, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(data["centre_of_pressure"], at, rtol=1e-9, atol=1e-12)
        # at rest the plan asks for just the same
        for name in ("normal_force", "cone_use", "centre_of_pressure"):
            np.testing.assert_allclose(data[f"{name}_cmd"], data[name], rtol=1e-9, atol=1e-12)
    else:  # a blade cannot pull
        assert np.isnan(data["cone_use"]).all() and np.isnan(data["cone_use_cmd"]).all()
        assert np.isnan(data["centre_of_pressure"]).all()
        assert np.isnan(data["slip"]).all()


def test_the_centre_of_pressure_is_where_the_force_acts_whatever_its_direction():
    rng = np.random.default_rng(4)
    for _ in range(20):
        theta, place, slip = rng.uniform(-1, 1), rng.uniform(-0.03, 0.03), rng.uniform(-0.01, 0.01)
        across, tangential, normal = rng.uniform(-0.5, 0.5, 3) + [0, 0, 1.0]
        force = [
            across,
            tangential * np.cos(theta) - normal * np.sin(theta),
            tangential * np.sin(theta) + normal * np.cos(theta),
        ]
        data = margins([theta] * 3, force, (rng.uniform(-0.03, 0.03), place, 0.0), slip=slip)
        # counted from the block's centre, which has slipped
        np.testing.assert_allclose(data["centre_of_pressure"], place - slip, atol=1e-12)
        np.testing.assert_allclose(data["normal_force"], normal, rtol=1e-12)
        np.testing.assert_allclose(data["cone_use"], np.hypot(across, tangential) / (MU * normal), rtol=1e-12)


def test_slip_counts_from_where_the_block_lies_when_the_motion_starts():
    slip = np.array([0.002, 0.002, 0.005, -0.001])
    data = margins([0.2] * 4, [0.0, 0.0, 1.0], (0.0, 0.0, 0.0), slip=slip)
    np.testing.assert_allclose(data["slip"], [0.0, 0.0, 0.003, 0.003], atol=1e-15)
    np.testing.assert_allclose(data["lift_off"], 0.0, atol=1e-15)


def test_the_plan_asks_for_the_forces_of_newton_and_euler():
    """Level blade, a = (2, 3) m/s² and θ'' = 40 rad/s²: every number by hand."""
    data = margins([0.0] * 5, [0.0, 0.0, 1.0], (0.0, 0.0, 0.0), a_cmd=(2.0, 3.0, 40.0), release=2.5 * PERIOD)
    normal = 12.81  # 3 + 9.81 m/s²
    gyration = (0.065**2 + 0.010**2) / 12  # 3.604e-4 m² of the cuboid about x
    carried = [True, True, True, False, False]
    expected = {
        "normal_force_cmd": 0.061 * normal,
        "cone_use_cmd": 2.0 / (1.86 * normal),
        "centre_of_pressure_cmd": (gyration * 40.0 - 0.005 * 2.0) / normal,
    }
    for name, number in expected.items():
        np.testing.assert_allclose(data[name], np.where(carried, number, np.nan), rtol=1e-12)


def test_without_contact_there_is_no_cone_and_no_pressure():
    data = margins([0.1] * 3, [0.0, 0.0, 1e-4], (0.0, 0.0, 0.0))
    for name in ("cone_use", "centre_of_pressure", "slip"):
        assert np.isnan(data[name]).all()
    np.testing.assert_allclose(data["normal_force"], 1e-4 * np.cos(0.1), rtol=1e-12)


def test_power_and_energy_of_a_constant_torque_are_torque_times_speed_and_angle():
    n = 101
    torque = np.tile([1.0, -2.0, 0.0, 3.0, 0.5, 1.0], (n, 1))
    acceleration = np.array([1.0, 2.0, 3.0, -4.0, 0.0, 5.0])
    speed = np.multiply.outer(np.arange(n) * PERIOD, acceleration)
    data = margins([0.0] * n, [0.0, 0.0, 1.0], (0.0, 0.0, 0.0), joints=(torque, speed))
    np.testing.assert_allclose(data["power"], torque * speed, rtol=1e-12)
    angle = np.multiply.outer((np.arange(n) * PERIOD) ** 2 / 2, acceleration)
    np.testing.assert_allclose(data["energy"], torque * angle, rtol=1e-9, atol=1e-15)


QUIET = SCENARIO.with_overrides(
    {
        "joint_friction.coulomb": 0.0,
        "joint_friction.viscous": 0.0,
        "controller.gravity_compensation": 1.0,
        "simulation.hold_time": 0.3,
        "simulation.settle_time": 0.1,
    }
)


@pytest.fixture(scope="module")
def flip():
    """A real flip of an arm without joint friction whose weight is compensated: it follows its plan closely."""
    data = simulate(QUIET, "pd+ff+dob", plan_motion(QUIET)).recording
    assert verdict.judge(data) == (True, None)
    return data


def test_the_drives_work_becomes_the_energy_of_arm_tool_and_block(flip):
    """Work–energy theorem; the energies come from a plant built here, not from the recording's margins."""
    plant = MultibodyPlant(0.0)
    parts = add_parts(plant, QUIET)
    plant.Finalize()
    context, block = plant.CreateDefaultContext(), parts.block.model_instance()
    time, pose = flip["time"].values, flip["block_pose"].values
    velocity = np.gradient(pose[:, 4:], PERIOD, axis=0)
    spin = np.gradient(np.unwrap(2 * np.arctan2(pose[:, 1], pose[:, 0])), PERIOD)
    start, end = np.searchsorted(time, [0.0, flip.attrs["release_time_s"]])
    stored = []
    for k in range(start, end + 1):
        plant.SetPositions(context, parts.arm.arm, flip["q"].values[k])
        plant.SetVelocities(context, parts.arm.arm, flip["qd"].values[k])
        plant.SetPositions(context, block, pose[k])
        plant.SetVelocities(context, block, [spin[k], 0.0, 0.0, *velocity[k]])
        v = plant.GetVelocities(context)
        stored.append(plant.CalcPotentialEnergy(context) + v @ plant.CalcMassMatrix(context) @ v / 2)
    gained = np.array(stored) - stored[0]
    work = flip["energy"].sum("joint").values[start : end + 1]
    assert np.ptp(gained) > 4.0  # [J]: a test of something
    # what the contact dissipates is a few mJ
    np.testing.assert_allclose(work, gained, atol=0.01 * np.ptp(gained))
    assert flip["energy"].values[start] == pytest.approx(np.zeros(6), abs=0)


def test_work_is_the_torque_times_the_way_of_the_joint(flip):
    """The way from the recorded angles instead of the velocities."""
    way = np.diff(flip["q"].values, axis=0)
    work = np.vstack([np.zeros(6), np.cumsum(flip["tau"].values[:-1] * way, axis=0)])
    start = int(np.searchsorted(flip["time"].values, 0.0))
    np.testing.assert_allclose(
        flip["energy"], work - work[start], atol=0.3
    )  # the step end alone: first order in the step


def usual(off):
    """What 90 % of the samples stay below: a bounce of the block, a peak of 4.5 N for 1 ms, comes or not by rounding."""
    return float(np.quantile(np.abs(off), 0.9))


def test_the_blade_pushes_as_planned_and_newton_gives_the_same_force(flip):
    moving = flip.sel(time=slice(0.02, flip.attrs["release_time_s"] - 0.02))
    for name, tolerance in (("normal_force", 0.1), ("cone_use", 0.15), ("centre_of_pressure", 1.5e-3)):
        off = moving[name].values - moving[f"{name}_cmd"].values
        assert usual(off) < tolerance, name
    # F = m (a − g) of the block itself; the mean over 10 ms, as the block sits on a spring
    velocity = np.gradient(flip["block_pose"].values[:, 4:], PERIOD, axis=0)
    acceleration = np.gradient(velocity, PERIOD, axis=0)
    needed = MASS * (acceleration + [0.0, 0.0, G])
    pushed = flip["contact_force"].sel(pair="blade-block").values
    smooth = np.ones(10) / 10
    inside = (flip["time"].values > 0.02) & (flip["time"].values < flip.attrs["release_time_s"] - 0.02)
    for axis in (1, 2):
        off = np.convolve(pushed[:, axis] - needed[:, axis], smooth, mode="same")[inside]
        assert usual(off) < 0.02, axis


def test_the_pressure_stays_under_the_block_and_the_force_in_the_cone_while_it_is_carried(flip):
    carried = flip.sel(time=slice(0.0, flip.attrs["release_time_s"] - 0.01))
    assert float(np.abs(carried["centre_of_pressure"]).max()) < SCENARIO.object.length / 2
    assert float(carried["cone_use"].max()) <= 1.0 + 1e-3
    slip = np.hypot(*(in_tool(carried)[:, :2] - in_tool(carried)[0, :2]).T)
    np.testing.assert_allclose(carried["slip"], slip, atol=1e-15)
    assert np.isnan(flip["cone_use_cmd"].sel(time=slice(flip.attrs["release_time_s"] + 2 * PERIOD, None))).all()
