"""The block in MuJoCo on a blade whose motion is given, against what Coulomb and Newton say, and against Drake."""

import sys

import numpy as np
import pytest
import xarray as xr
from pydrake.geometry import Box
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation
from shared import default_flip

from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants.mujoco_contact import Settings
from flipdiagram.robot.parts import add_parts
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import events, metrics
from flipdiagram.simulation import mujoco as second_engine
from flipdiagram.simulation.mujoco import blade_motion, compare, mjcf, replay_in_mujoco
from flipdiagram.simulation.recording import in_tool

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'flipdiagram[mujoco]'")

G = 9.81
MASS = Scenario().object.mass
HALF = Scenario().object.thickness / 2
NOW = Settings(settle=0.0)  # the block is put on the blade when the motion starts


def turn(vectors):
    """Quaternions (qw, qx, qy, qz) of rotation vectors (n, 3) [rad]."""
    return np.roll(Rotation.from_rotvec(vectors).as_quat(), 1, axis=1)


def recording(position, rotation=None, *, duration=0.2, hold=0.0, offset=(0.0, 0.0), **changes):
    """A recording of nothing but a blade at position(t) (n, 3) [m] and rotation vector rotation(t) (n, 3) [rad].

    The block lies on it at the offset along its x and y [m].
    """
    wide = {"table.height": -0.5, "tool.blade_width": 0.2, "tool.blade_length": 0.2, "tool.reach": 0.2}
    scenario = Scenario().with_overrides(wide | {name.replace("__", "."): value for name, value in changes.items()})
    t = np.arange(-round(hold * 1000), round(duration * 1000) + 1) * 1e-3
    vectors = np.zeros((len(t), 3)) if rotation is None else rotation(t)
    origin, poses = position(t), turn(vectors)
    centre = origin + Rotation.from_rotvec(vectors).apply([*offset, HALF])
    x = np.column_stack([origin[:, 1:], vectors[:, 0]])
    variables = {
        "x": (("time", "axis"), x),
        "tool_pose": (("time", "pose"), np.hstack([poses, origin])),
        "block_pose": (("time", "pose"), np.hstack([poses, centre])),
        "contact_force": (("time", "pair", "direction"), np.zeros((len(t), 3, 3))),
    }
    pairs = ["blade-block", "table-block", "table-blade"]
    return xr.Dataset(variables, {"time": t, "pair": pairs}, {"scenario": scenario.to_yaml()})


def at(x=0.5, y=0.0, z=0.35):
    """Positions (n, 3) of columns that may be numbers."""
    return lambda t: np.column_stack([np.broadcast_to(c(t) if callable(c) else c, t.shape) for c in (x, y, z)])


def acceleration(data, axis, start=0.05):
    """Acceleration of the block [m/s2] from the parabola through its path after `start`."""
    late = data.time.values > start
    return 2 * np.polyfit(data.time.values[late], data["block_pose"].values[late, 4 + axis], 2)[0]


def force(data, pair="blade-block"):
    return data["contact_force"].sel(pair=pair).values


def test_a_resting_block_is_carried_with_its_weight_and_does_not_creep():
    data = replay_in_mujoco(recording(at(), duration=0.5, hold=0.3))
    still = data.time.values > 0
    np.testing.assert_allclose(force(data)[still], np.tile([0, 0, MASS * G], (still.sum(), 1)), atol=1e-4 * MASS * G)
    assert np.all(force(data, "table-block") == 0)
    assert metrics.slip_and_lift(data)[0] < 1e-8
    assert 0 < HALF - in_tool(data)[-1, 2] < 2e-6


@pytest.mark.parametrize("friction", [0.3, 0.8])
def test_on_a_tilted_blade_the_block_sticks_below_the_friction_angle(friction):
    tilt = np.arctan(friction) - 0.02
    data = replay_in_mujoco(recording(at(), lambda t: np.outer(t**0, [tilt, 0, 0]), object__friction=friction), NOW)
    assert np.abs(np.diff(in_tool(data)[50:, 1])).max() < 1e-8
    np.testing.assert_allclose(force(data)[-1], [0, 0, MASS * G], atol=1e-3 * MASS * G)


@pytest.mark.parametrize("friction", [0.3, 0.8])
def test_on_a_tilted_blade_the_block_slides_above_the_friction_angle(friction):
    tilt = np.arctan(friction) + 0.1
    data = replay_in_mujoco(recording(at(), lambda t: np.outer(t**0, [tilt, 0, 0]), object__friction=friction), NOW)
    expected = -G * (np.sin(tilt) - friction * np.cos(tilt))
    along = np.array([0, np.cos(tilt), np.sin(tilt)])
    assert sum(acceleration(data, i) * along[i] for i in range(3)) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize(("share", "gained"), [(0.9, 0.9), (1.3, 1.0)])
def test_a_blade_that_accelerates_sideways_carries_the_block_up_to_mu_g(share, gained):
    friction = 0.6
    moving = at(y=lambda t: share * friction * G * t**2 / 2)
    data = replay_in_mujoco(recording(moving, object__friction=friction), NOW)
    assert acceleration(data, 1) == pytest.approx(gained * friction * G, rel=3e-3)
    # a sliding block hops by micrometres: only the mean is Coulomb's
    assert force(data)[30:, 1].mean() == pytest.approx(gained * friction * MASS * G, rel=1e-2)
    assert force(data)[30:, 2].mean() == pytest.approx(MASS * G, rel=1e-2)
    if share < 1:
        assert np.abs(in_tool(data)[:, 1]).max() < 1e-6


def test_a_blade_at_constant_speed_does_not_brake_the_block():
    # a mocap body would: its velocity is zero for friction
    data = replay_in_mujoco(recording(at(y=lambda t: 1.0 * t)), NOW)
    assert np.abs(in_tool(data)[:, :2]).max() < 1e-8
    assert np.abs(force(data)[20:, :2]).max() < 1e-4 * MASS * G


def test_a_turntable_pulls_the_block_towards_its_axis():
    rate, radius = 8.0, 0.05
    data = replay_in_mujoco(
        recording(at(), lambda t: np.outer(rate * t, [0, 0, 1]), offset=(radius, 0.0), object__friction=0.9), NOW
    )
    assert np.abs(in_tool(data) - [radius, 0, HALF]).max() < 3e-6
    along = [np.cos(rate * 0.1005), np.sin(rate * 0.1005)]  # middle of the step of the recording
    assert force(data)[100, :2] @ along == pytest.approx(-MASS * rate**2 * radius, rel=5e-3)


def test_after_the_blade_drops_away_the_block_flies_a_parabola_and_lands():
    # the blade leaves sideways too: falling, it would come between block and table
    moving = at(y=lambda t: 0.5 * t, z=lambda t: 0.35 - 15 * t**2)
    height = 0.35 + HALF - 0.15
    given = recording(moving, duration=0.6, table__height=0.15 - HALF)
    data = replay_in_mujoco(given, Settings(settle=0, timestep=5e-5))
    t = data.time.values
    assert np.all(force(data)[1:] == 0)
    free = t < 0.19
    # the block starts with the velocity the blade has half a step before, and falls g h t / 2 farther than in truth
    expected = 0.35 + HALF - G * t**2 / 2 + (15 - G / 2) * 5e-5 * t
    np.testing.assert_allclose(data["block_pose"].values[free, 6], expected[free], atol=1e-7)
    np.testing.assert_allclose(data["block_pose"].values[free, 5], 0.5 * t[free], atol=1e-7)
    landed = events.touchdown(data)
    assert landed.time_s == pytest.approx(np.sqrt(2 * height / G), abs=2e-3)
    assert force(data, "table-block")[-1, 2] == pytest.approx(MASS * G, rel=1e-2)


def test_a_block_that_lies_askew_starts_to_turn_with_the_blade():
    given = recording(at(), lambda t: np.outer(6 * t, [1, 0.4, 0.2]), duration=0.02)
    askew = Rotation.from_rotvec([0, 0, 0.7])
    given["block_pose"][0, :4] = np.roll(askew.as_quat(), 1)
    data = replay_in_mujoco(given, NOW)
    blade, block = (Rotation.from_quat(np.roll(data[f"{n}_pose"].values[:, :4], -1, axis=1)) for n in ("tool", "block"))
    assert (askew.inv() * blade.inv() * block).magnitude().max() < 1e-3


def test_the_velocity_of_the_blade_is_the_rate_of_its_pose():
    def swing(t):
        return np.column_stack([2.5 * np.sin(3 * t), 0.4 * np.cos(5 * t), 0.3 * t])

    t = np.arange(0.01, 0.18, 1e-4)
    data = recording(at(y=lambda t: 0.1 * np.sin(7 * t)), swing)
    point = np.array([0.02, -0.01, 0.03])
    qpos, qvel = blade_motion(data, t, point)

    def place(t):
        return at(y=lambda t: 0.1 * np.sin(7 * t))(t) + Rotation.from_rotvec(swing(t)).apply(point)

    small, middle = 1e-6, t - (t[1] - t[0]) / 2  # a velocity is the mean over the step before
    turned = Rotation.from_rotvec(swing(middle - small)).inv() * Rotation.from_rotvec(swing(middle + small))
    np.testing.assert_allclose(qvel[:, 3:], turned.as_rotvec() / (2 * small), atol=1e-5)
    np.testing.assert_allclose(qvel[:, :3], (place(middle + small) - place(middle - small)) / (2 * small), atol=1e-5)
    np.testing.assert_allclose(qpos[:, :3], place(t), atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(qpos[:, 3:] * turn(swing(t)), axis=1)), 1, atol=1e-10)


@pytest.mark.parametrize("mass", [0.061, 0.5])
def test_the_block_does_not_push_the_blade_off_its_motion(mass):
    moving = at(y=lambda t: 0.05 * np.sin(20 * t), z=lambda t: 0.35 + 0.02 * np.cos(20 * t))
    data = replay_in_mujoco(recording(moving, lambda t: np.outer(np.sin(10 * t), [1, 0.2, 0]), object__mass=mass), NOW)
    assert np.abs(force(data)).max() > mass * G
    assert data.attrs["blade_error_m"] < 1e-9


def test_two_replays_are_the_same_to_the_bit():
    given = recording(at(y=lambda t: 0.05 * np.sin(20 * t)), lambda t: np.outer(4 * t, [1, 0, 0]))
    before = given.copy(deep=True)
    first, second = replay_in_mujoco(given, NOW), replay_in_mujoco(given, NOW)
    assert first.identical(second)
    assert given.identical(before)
    assert first["tool_pose"].identical(given["tool_pose"])


def test_the_boxes_and_coefficients_are_drakes():
    scenario = Scenario().with_overrides({"object.friction": 1.2, "table.friction": 0.4, "tool.blade_width": 0.08})
    model = mujoco.MjModel.from_xml_string(mjcf(scenario, Settings(), 1e-4, np.zeros(3)))
    plant, graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 1e-3)
    parts = add_parts(plant, scenario)
    plant.Finalize()
    inspector = graph.model_inspector()
    T_in_spatula = parts.arm.tool.GetFixedPoseInBodyFrame().translation()
    for name, body in {"blade": parts.arm.spatula_body, "block": parts.block, "table": parts.table}.items():
        (geometry,) = plant.GetCollisionGeometriesForBody(body)
        box, place = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry).translation()
        assert isinstance(box, Box)
        np.testing.assert_allclose(2 * model.geom(name).size, box.size(), rtol=1e-12)
        origin = {"blade": T_in_spatula, "block": np.zeros(3), "table": -np.array([0.5, 0.0, scenario.table.height])}
        np.testing.assert_allclose(model.geom(name).pos, place - origin[name], atol=1e-12)
    inertia = parts.block.default_rotational_inertia().get_moments()
    np.testing.assert_allclose(model.body("block").inertia, inertia, rtol=1e-5)
    table = model.geom("table").id
    on_table = [table in pair for pair in zip(model.pair_geom1, model.pair_geom2, strict=True)]
    assert sorted(on_table) == [False, True]
    np.testing.assert_allclose(model.pair_friction[:, 0], np.where(on_table, 0.6, 1.2))
    np.testing.assert_allclose(model.pair_friction[:, 1], np.where(on_table, 0.6, 1.2))


def test_drakes_flip_succeeds_in_mujoco_too_and_what_is_not_the_blocks_stays():
    data = default_flip().recording
    result = compare(data)
    assert result["agree"] and result["mujoco"]["success"]
    drake, second = result["drake"], result["mujoco"]
    assert abs(drake["touchdown"]["theta_rad"] - second["touchdown"]["theta_rad"]) < 0.1
    assert second["max_slip_m"] < 1e-3
    assert "elliptic" in result["settings"]
    replayed = replay_in_mujoco(data, Settings(cone="pyramidal"))
    assert replayed.attrs["blade_error_m"] < 1e-9
    changed = {name for name in data if not replayed[name].equals(data[name])}
    assert changed == {"block_pose", "contact_force"}
    assert np.array_equal(force(replayed, "table-blade"), force(data, "table-blade"))
    assert metrics.measure(replayed).success


def test_without_mujoco_the_error_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"pip install 'flipdiagram\[mujoco\]'"):
        replay_in_mujoco(recording(at()))


def test_a_recording_without_its_scenario_or_signals_is_refused():
    data = recording(at())
    with pytest.raises(InputError, match="lacks finite block_pose, scenario;"):
        replay_in_mujoco(data.drop_vars("block_pose").drop_attrs())


def test_a_recording_that_is_not_finite_is_refused():
    data = recording(at())
    data["tool_pose"].values[7, 4] = np.nan
    with pytest.raises(InputError, match="lacks finite tool_pose;"):
        replay_in_mujoco(data, NOW)


def test_a_state_that_is_not_finite_ends_in_an_error(monkeypatch, tmp_path):
    def broken(*given):
        qpos, qvel = blade_motion(*given)
        qvel[100:] = np.nan
        return qpos, qvel

    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    monkeypatch.setattr(second_engine, "blade_motion", broken)
    with pytest.raises(SimulationError, match="diverged at 0.009 s"):
        replay_in_mujoco(recording(at()), NOW)


@pytest.mark.parametrize(
    ("name", "value", "valid"),
    [
        ("cone", "round", "elliptic, pyramidal"),
        ("timestep", 0.0, "1e-06 to 0.01"),
        ("time_constant", 1e-4, "0.0002 to 1"),
        ("impedance", float("nan"), "0.01 to 0.9999"),
    ],
)
def test_a_bad_setting_is_named(name, value, valid):
    with pytest.raises(InputError, match=f"'{name}' = .*(valid is|choose from) {valid}"):
        Settings(**{name: value})


def test_a_step_fills_the_period_of_the_recording(monkeypatch):
    steps = []
    text = second_engine.mjcf
    monkeypatch.setattr(second_engine, "mjcf", lambda *given: (steps.append(given[2]), text(*given))[1])
    replay_in_mujoco(recording(at(), duration=0.01), Settings(timestep=np.float64(3e-4), impratio=1, settle=0))
    assert steps == [pytest.approx(2.5e-4)]
