"""The pancake in Drake, against statics, plate theory, momentum, and the rigid block it becomes when it is stiff."""

import numpy as np
import pytest
from pydrake.geometry import GeometryConfigurationVector, GeometryId
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.errors import SimulationError
from flipdiagram.plants import pancake_cell
from flipdiagram.plants.pancake import _come_to_rest, add_pancake
from flipdiagram.plants.pancake_cell import Pancake
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.events import strike_index
from flipdiagram.simulation.lying import lying
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.recording import roll
from flipdiagram.simulation.simulate import simulate

G = 9.81
COARSE = {"object.kind": "pancake", "object.refinement": 1}
BLOCK = {"diameter": None, "length": 0.065, "width": 0.062, "thickness": 0.01, "mass": 0.061, "friction": 1.86}
STIFF = {**COARSE, **{f"object.{name}": value for name, value in BLOCK.items()}, "object.youngs_modulus": 1e7}
STIFF |= {"tool.blade_length": 0.1, "tool.blade_width": 0.09}


def pancake(**fields):
    return Scenario().with_overrides({"object.kind": "pancake", **{f"object.{k}": v for k, v in fields.items()}})


@pytest.mark.parametrize("refinement", [2, 3, 4])
def test_a_cantilever_sags_between_beam_and_plate(refinement):
    edges = {"diameter": None, "length": 0.12, "width": 0.12, "refinement": refinement, "youngs_modulus": 1e6}
    scenario = pancake(**edges)
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.002, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(config, builder)
    body = add_pancake(plant, scenario, RigidTransform(), settling=30.0)
    model = plant.mutable_deformable_model()
    model.SetWallBoundaryCondition(body, [0, -0.06 + 1e-6, 0], [0, 1, 0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.6)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    x = np.array(model.GetPositions(context, body)).T
    assert np.abs(model.GetVelocities(context, body)).max() < 1e-4
    tip = x[pancake_mesh(scenario.object).vertices[:, 1] > 0.06 - 1e-9, 2].mean()
    # q L⁴ / 8 E I for the weight q of a length; a plate is stiffer by 1 / (1 − ν²), a wide cantilever is between them
    beam = 0.1 * G / 0.12 * 0.12**4 / (8 * 1e6 * 0.12 * 0.012**3 / 12)
    assert (1 - 0.4**2) * beam < -tip < beam


def test_a_strip_that_hangs_over_the_blade_sags_as_a_beam_that_lifts_behind_its_edge():
    length, width, h, blade, E, mass = 0.12, 0.03, 0.006, 0.06, 2e5, 0.03
    size = {"diameter": None, "length": length, "width": width, "thickness": h, "mass": mass, "refinement": 3}
    scenario = pancake(**size, youngs_modulus=E, poissons_ratio=0.0).with_overrides({"tool.blade_width": blade})
    vertices = _come_to_rest(scenario, RigidTransform([0, 0, h / 2]))
    ends = np.abs(pancake_mesh(scenario.object).vertices[:, 1]) > 0.06 - 1e-9
    tip = vertices[ends, 2].mean() - h / 2
    # A beam of weight q on a rigid plane, overhang a: it lifts over a length b behind the edge, where w = w' = w'' = 0
    # at the far end and w = 0 at the edge: b = √2 a, slope at the edge √2 q a³ / 12 E I.
    a, q, stiffness = (length - blade) / 2, mass * G / length, E * width * h**3 / 12
    assert tip == pytest.approx(-q * a**4 / stiffness * (1 / 8 + np.sqrt(2) / 12), rel=0.08)


@pytest.mark.parametrize(("modulus", "friction"), [(1e5, 0.45), (1e6, 0.45), (1e7, 0.6)])
def test_a_stiff_one_on_a_coarse_mesh_comes_to_rest_though_it_trembles(modulus, friction):
    scenario = pancake(refinement=1, youngs_modulus=modulus, friction=friction)
    vertices = _come_to_rest(scenario, RigidTransform([0, 0, 0.006]))
    assert np.abs(vertices - pancake_mesh(scenario.object).vertices - [0, 0, 0.006]).max() < 1e-3


def test_a_pancake_that_slides_off_the_blade_never_comes_to_rest_there():
    with pytest.raises(SimulationError, match="does not come to rest on the blade within 4 s"):
        _come_to_rest(pancake(refinement=1), RigidTransform([0, 0.12, 0.006]))


def test_a_pancake_that_is_torn_apart_ends_the_simulation_with_the_time():
    geometry, mesh = GeometryId.get_new_id(), pancake_mesh(Scenario().with_overrides(COARSE).object)
    seen = Pancake(mesh, 0.1, geometry, ([], []), 0, mesh.vertices, 0.001)
    context = seen.CreateDefaultContext()
    context.SetTime(0.312)
    shape, port = GeometryConfigurationVector(), seen.GetInputPort("shape")
    for scale, problem in ((2.9, None), (3.1, "the pancake is stretched to 0.39"), (np.nan, "the state is not finite")):
        shape.set_value(geometry, scale * mesh.vertices.ravel())
        port.FixValue(context, shape)
        if problem is None:
            assert seen.GetOutputPort("vertices").Eval(context)[0] == scale * mesh.vertices[0, 0]
        else:
            with pytest.raises(SimulationError, match=f"the simulation diverged at 0.312 s: {problem}"):
                seen.GetOutputPort("vertices").Eval(context)


@pytest.fixture(scope="module")
def flip():
    return simulate(Scenario().with_overrides(COARSE), "pd+ff+dob").recording


def test_the_default_pancake_is_turned_over_even_on_a_coarse_mesh(flip):
    measured = measure(flip)
    assert measured.success, measured.failure
    assert measured.touchdown.theta_rad == pytest.approx(2.55, abs=0.15)


def test_at_rest_it_stays_and_weighs_what_it_weighs(flip):
    before = flip.sel(time=slice(None, 0))
    force = before["contact_force"].sel(pair="blade-block").values[20:]
    np.testing.assert_allclose(force.mean(axis=0), [0, 0, 0.1 * G], atol=0.01 * 0.1 * G)
    vertices = flip["vertices"].values[flip["frame_time"].values <= 0].astype(float)
    assert np.abs(vertices - vertices[0]).max() < 5e-4  # the rim of the coarse mesh spreads by 0.3 mm
    area = before["contact_area"].sel(surface="blade").values
    assert 0.5 < np.median(area) / (np.pi * 0.06**2) < 1.01  # where it touches by less than a micrometre, it may not


def test_in_flight_the_centre_falls_and_the_spin_stays(flip):
    blade, table = (
        np.abs(flip["contact_force"].sel(pair=p)).sum("direction").values for p in ("blade-block", "table-block")
    )
    landed = int(np.argmax((table > 0) & (flip["time"].values > 0.3)))
    last = int(np.flatnonzero(blade[:landed] > 0)[-1])
    t, z = flip["time"].values[last + 2 : landed], flip["block_pose"].values[last + 2 : landed, 6]
    assert len(t) > 60
    fall = np.polyfit(t, z, 2)
    assert 2 * fall[0] == pytest.approx(-G, rel=0.01)
    assert np.abs(np.polyval(fall, t) - z).max() < 1e-4


def test_what_is_recorded_agrees_with_itself(flip):
    mesh, frames = pancake_mesh(Scenario().with_overrides(COARSE).object), flip["vertices"].values.astype(float)
    centre = mesh.masses(1.0) @ frames
    np.testing.assert_allclose(centre, flip["block_pose"].values[::4, 4:], atol=1e-6)
    energy = flip["deformation_energy"].values
    assert (energy >= 0).all()
    assert 1e-4 < energy.max() < 0.1  # of the 0.2 J with which it flies
    assert np.nanmax(flip["overhang"].values) == 0  # the blade is larger than the pancake


@pytest.mark.parametrize("architecture", ["pd", "pd+ff+dob"])
def test_a_stiff_one_of_the_blocks_size_does_what_the_block_does(architecture):
    rigid = simulate(Scenario(), architecture).recording
    bent = simulate(Scenario().with_overrides(STIFF), architecture).recording
    one, other = measure(rigid), measure(bent)
    if one.success:
        assert other.touchdown.time_s == pytest.approx(one.touchdown.time_s, abs=0.01)
        assert other.touchdown.theta_rad == pytest.approx(one.touchdown.theta_rad, abs=0.1)
        assert other.touchdown.y_m == pytest.approx(one.touchdown.y_m, abs=0.01)
        # both come to lie turned over, 3.3 cm from the target: for a pancake that is too far
        there, lies = rigid["block_pose"].values[-1, 4:6], lying(bent)
        assert lies.turned == 1
        np.testing.assert_allclose(bent["block_pose"].values[-1, 4:6], there, atol=0.02)
        assert lies.away_m == pytest.approx(np.hypot(there[0] - 0.5, there[1]), abs=0.02)
    else:
        # the blow throws the block off, and either may fall as it likes: until then they go the same way
        hit = strike_index(rigid)
        assert strike_index(bent) == pytest.approx(hit, abs=1)
        np.testing.assert_allclose(bent["block_pose"][:hit, 4:], rigid["block_pose"][:hit, 4:], atol=0.005)
        np.testing.assert_allclose(
            roll(bent["block_pose"].values[:hit]), roll(rigid["block_pose"].values[:hit]), atol=0.02
        )


def test_a_flip_that_diverges_says_when(monkeypatch):
    monkeypatch.setattr(pancake_cell, "STRETCHED", 0.5)
    with pytest.raises(
        SimulationError, match=r"the simulation diverged at 0\.000 s: the pancake is stretched to 0\.12"
    ) as told:
        simulate(Scenario().with_overrides(COARSE), "pd")
    assert told.value.exit_code == 3
