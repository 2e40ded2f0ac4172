"""A pancake as a flex of MuJoCo's: against closed forms, and as a recording."""

import numpy as np
import pytest
import xarray as xr

from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants import mujoco_contact, mujoco_flex
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import flex as flex_module
from flipdiagram.simulation.flex import course_of, replay_in_flex
from flipdiagram.simulation.recording import in_tool
from flipdiagram.theory.rigid_fit import rigid_fit, spin

mujoco = pytest.importorskip("mujoco", "4.0", reason="MuJoCo 4 is not installed: pip install 'mujoco>=4'")

G, PERIOD, REST, END = 9.81, 1e-3, 0.02, 0.1
COARSE = {"object.kind": "pancake", "object.refinement": 1, "tool.blade_length": 0.24, "tool.blade_width": 0.3}
STIFF = Scenario().with_overrides({**COARSE, "object.youngs_modulus": 1e7, "table.height": 0.0})
LEVEL = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4])
AWAY = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])


@pytest.fixture(autouse=True)
def _no_warnings():
    with mujoco_flex.quiet():
        yield


def recording(scenario, acceleration, offset=0.0):
    """A blade that stands and then is accelerated along y [m/s²], as `simulate` records it, without an arm."""
    t = np.arange(round(END / PERIOD) + 1) * PERIOD - REST
    tool = np.tile(LEVEL, (len(t), 1))
    tool[:, 5] = acceleration * np.maximum(t, 0) ** 2 / 2
    block = tool + np.r_[np.zeros(5), offset, scenario.object.thickness / 2]
    axis, joint = np.zeros((len(t), 3)), np.zeros((len(t), 6))
    force = np.zeros((len(t), 3, 3))
    force[:, 2, 2] = np.arange(len(t))
    return xr.Dataset(
        {
            **{name: (("time", "pose"), pose) for name, pose in {"tool_pose": tool, "block_pose": block}.items()},
            **{name: (("time", "axis"), axis) for name in ("x", "x_cmd", "a_cmd")},
            **{name: (("time", "joint"), joint) for name in ("tau", "qd")},
            "contact_force": (("time", "pair", "direction"), force),
            "contact_area": (("time", "surface"), np.ones((len(t), 2))),
        },
        coords={"time": t, "pair": ["blade-block", "table-block", "table-blade"], "surface": ["blade", "table"]},
        attrs={"scenario": scenario.to_yaml(), "release_time_s": 1.0, "engine": "Drake"},
    )


def slip(data):
    """Of the centre along the blade from the start of the motion [m]."""
    along = in_tool(data)[:, 1]
    return along[-1] - along[round(REST / PERIOD)]


@pytest.fixture(scope="module")
def carried():
    """Accelerated at 0.9 μ g, twice as heavy as planned, 1 cm beside the middle."""
    scenario = STIFF.with_overrides({"disturbance.object_mass_scale": 2.0})
    with mujoco_flex.quiet():
        return replay_in_flex(recording(scenario, 0.9 * 0.6 * G, offset=0.01))


@pytest.mark.parametrize("nu", [0.0, 0.4])
def test_stress_is_that_of_hooke_and_damping_is_its_rate(nu):
    """Σ f xᵀ = −V σ for forces f of a uniform strain; with damping, σ of the rate times the coefficient."""
    scenario = STIFF.with_overrides({"object.poissons_ratio": nu})
    pancake, mesh = scenario.object, pancake_mesh(scenario.object)
    flex = mujoco_flex.Flex(scenario, mesh.vertices, AWAY)
    strain = 1e-6 * np.array([[1, 0.5, 0.3], [0.5, -0.3, 0.2], [0.3, 0.2, 0.4]])
    E = mesh_modulus(pancake)
    stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * np.trace(strain) * np.eye(3))
    moved = (mesh.vertices @ strain).ravel()
    for state, force, factor in (("qpos", "qfrc_spring", 1.0), ("qvel", "qfrc_damper", pancake.damping)):
        mujoco.mj_resetData(flex.model, flex.data)
        getattr(flex.data, state)[-moved.size :] = moved
        mujoco.mj_forward(flex.model, flex.data)
        f = getattr(flex.data, force)[6:].reshape(-1, 3)
        np.testing.assert_allclose(-f.T @ mesh.vertices, mesh.volumes.sum() * factor * stress, rtol=1e-4)


@pytest.mark.parametrize("E", [1e6, 1e7])
def test_a_free_pancake_flies_a_parabola_and_keeps_its_spin(E):
    scenario = STIFF.with_overrides({"object.youngs_modulus": E})
    mesh, T = pancake_mesh(scenario.object), 0.2
    flex = mujoco_flex.Flex(scenario, mesh.vertices, AWAY)
    v, omega = np.array([0.0, 0.3, 1.5]), np.array([8.0, 0.0, 0.0])
    flex.velocities[:] = v + np.cross(omega, mesh.vertices)
    for _ in range(round(T / flex.period)):
        flex.advance(AWAY, np.zeros(6))
    fit = rigid_fit(flex.vertices, mesh.vertices, flex.masses)
    # the exact sum of semi-implicit steps
    np.testing.assert_allclose(fit.centre, v * T - [0, 0, G * T * (T + flex.period) / 2], atol=1e-5)
    assert spin(flex.vertices, flex.velocities, flex.masses)[0][0] == pytest.approx(8.0, rel=0.01)
    assert np.arctan2(fit.rotation[2, 1], fit.rotation[1, 1]) == pytest.approx(8.0 * T, rel=0.01)


def test_the_blade_bears_the_weight_where_the_pancake_lies(carried):
    """Of the mass that it has, not of the one that was planned for."""
    still = carried.isel(time=slice(0, round(REST / PERIOD)))
    force = still["contact_force"].sel(pair="blade-block").values
    assert force[:, 2].mean() == pytest.approx(0.2 * G, rel=0.01)
    assert np.abs(force[:, :2]).max() < 0.02 * 0.2 * G
    assert still["centre_of_pressure"].mean() == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose(in_tool(still), [[0.0, 0.01, 0.006]] * len(force), atol=1e-4)


def test_what_mujoco_does_not_move_is_as_it_was(carried):
    asked = recording(STIFF, 0.9 * 0.6 * G)
    for name in ("tool_pose", "tau", "x"):
        np.testing.assert_array_equal(carried[name], asked[name])
    np.testing.assert_array_equal(carried["contact_force"].sel(pair="table-blade")[:, 2], np.arange(len(asked["time"])))
    assert "contact_area" not in carried
    assert carried.attrs["engine"].startswith("MuJoCo ")
    assert "flex" in carried.attrs["engine"]


def test_frames_show_the_vertices_whose_centre_is_recorded(carried):
    masses = pancake_mesh(STIFF.object).masses(1.0)
    np.testing.assert_array_equal(carried["frame_time"], carried["time"][::4])
    np.testing.assert_allclose(masses @ carried["vertices"].values, carried["block_pose"][::4, 4:], atol=1e-6)
    assert carried["overhang"].max() == 0.0
    assert carried["deformation_energy"].max() < 1e-3


def test_it_sticks_below_the_friction_cone(carried):
    assert abs(slip(carried)) < 3e-4


def test_it_slides_above_the_friction_cone():
    moved = replay_in_flex(recording(STIFF, 1.5 * 0.6 * G))
    assert slip(moved) == pytest.approx(-0.5 * 0.6 * G * (END - REST) ** 2 / 2, rel=0.03)


def test_on_the_table_it_slides_as_far_as_the_combined_friction_lets_it():
    table, mesh = STIFF.table.height, pancake_mesh(STIFF.object)
    flex = mujoco_flex.Flex(STIFF, mesh.vertices + [STIFF.task.start_x, 0.0, table + 0.006], AWAY)
    for _ in range(40):
        flex.advance(AWAY, np.zeros(6))
    flex.velocities[:, 1] += 0.5
    begin = flex.vertices[:, 1].mean()
    for _ in range(200):
        flex.advance(AWAY, np.zeros(6))
    friction = 2 * 0.7 * 0.6 / (0.7 + 0.6)
    assert flex.vertices[:, 1].mean() - begin == pytest.approx(0.5**2 / (2 * friction * G), rel=0.03)
    assert flex.forces[1, 2] == pytest.approx(0.1 * G, rel=0.1)
    np.testing.assert_array_equal(flex.forces[0], 0.0)


def test_the_blade_passes_through_every_sample():
    t = np.arange(6) * PERIOD
    turn = 3.0 * t + 200 * t**2
    tool = np.column_stack([np.cos(turn / 2), np.sin(turn / 2), 0 * t, 0 * t, 0 * t, t**2, 0.4 + t])
    poses, velocities = course_of(tool, 2, PERIOD / 2)
    np.testing.assert_allclose(poses[::2], tool, atol=1e-14)
    halves = np.arange(11) * PERIOD / 2
    np.testing.assert_allclose(velocities[:-2, 3], np.diff(3.0 * halves + 200 * halves**2) / (PERIOD / 2), atol=1e-6)
    np.testing.assert_allclose(np.cumsum(velocities[:-2, 2]) * PERIOD / 2, poses[1:-1, 6] - 0.4, atol=1e-14)
    np.testing.assert_array_equal(velocities[-2:], 0.0)


@pytest.mark.parametrize(("wild", "what"), [(np.nan, "MuJoCo's state is not finite"), (1.0, "stretched to 1.0")])
def test_divergence_names_the_time(monkeypatch, wild, what):
    step = mujoco.mj_step

    def diverging(model, data):
        step(model, data)
        if data.qvel[1] > 0.1:
            data.qpos[-1] = wild

    monkeypatch.setattr(mujoco, "mj_step", diverging)
    with pytest.raises(SimulationError, match=rf"diverged before 0\.021 s: .*{what}"):
        replay_in_flex(recording(STIFF, 5.0))


def test_what_does_not_come_to_rest_is_told(monkeypatch):
    monkeypatch.setattr(flex_module, "AT_REST", 0.0)
    monkeypatch.setattr(flex_module, "LONGEST", 0.04)
    with pytest.raises(SimulationError, match="does not come to rest on the blade within 0.04 s"):
        replay_in_flex(recording(STIFF, 0.0))


def test_a_block_is_refused():
    with pytest.raises(InputError, match=r"object\.kind = 'block'; valid is pancake"):
        replay_in_flex(recording(Scenario(), 0.0))


def test_an_old_mujoco_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco, "__version__", "3.3.6")
    with pytest.raises(InputError, match=r"needs MuJoCo 4\.0 or newer, not 3\.3\.6"):
        replay_in_flex(recording(STIFF, 0.0))


def test_without_mujoco_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(mujoco_contact.importlib, "import_module", _missing)
    with pytest.raises(InputError, match=r"pip install 'flipdiagram\[mujoco\]'"):
        replay_in_flex(recording(STIFF, 0.0))


def _missing(name):
    raise ImportError(name)
