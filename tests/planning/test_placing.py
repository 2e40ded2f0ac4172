"""Sliding on purpose: closed form against integration, the smooth segments, and the plan that lays the object down."""

import numpy as np
import planar
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ideal import IDEAL
from scipy.integrate import solve_ivp

from flipdiagram.errors import PlanningError
from flipdiagram.planning.constraints import bound_law
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.placing import Placer
from flipdiagram.planning.rows import Constraint
from flipdiagram.planning.segment import segment
from flipdiagram.planning.slide import Slide, tilt_for
from flipdiagram.robot.parts import arm_of
from flipdiagram.theory import contact

G = 9.81


@given(mu=st.floats(0.1, 2.0), beyond=st.floats(0.02, 0.3), way=st.floats(0.005, 0.05))
def test_the_slide_is_that_of_coulomb_friction_on_an_incline(mu, beyond, way):
    """Against an integration of forces on the object: gravity, normal force, friction up the incline."""
    slide = Slide(float(np.arctan(mu)) + beyond, mu, way)
    s, n = contact.tool_tangent(slide.tilt), contact.tool_normal(slide.tilt)

    def motion(t, state):
        normal = -np.dot([0, -G], n)
        return [*state[2:], *(np.array([0, -G]) + normal * n + mu * normal * s)]

    run = solve_ivp(motion, (0, slide.duration), [0, 0, 0, 0], rtol=1e-9, atol=1e-12)
    assert run.y[:2, -1] @ s == pytest.approx(-way, rel=1e-6)
    assert run.y[:2, -1] @ n == pytest.approx(0, abs=1e-9)
    assert run.y[2:, -1] @ s == pytest.approx(-slide.final_speed, rel=1e-6)
    assert slide.displacement([0, slide.duration, 99]) == pytest.approx([0, -way, -way])


@given(mu=st.floats(0.1, 2.0), speed=st.floats(0.08, 0.25))
def test_the_tilt_for_a_speed_gives_that_speed(mu, speed):
    tilt = tilt_for(mu, 0.02, speed, least=1e-4)
    assert Slide(tilt, mu, 0.02).final_speed == pytest.approx(speed, rel=1e-6)
    assert tilt_for(mu, 0.02, 1e-3, least=0.05) == pytest.approx(np.arctan(mu) + 0.05)


def test_below_the_friction_angle_nothing_slides():
    with pytest.raises(
        PlanningError, match="at a tilt of 30.0 deg nothing slides; valid is above the friction angle, 45.0"
    ):
        Slide(np.radians(30), 1.0, 0.02)


def at_most(layout, speed):
    """v_y ≤ speed [m/s] at all samples between the rests."""
    return [Constraint.of("speed", bound_law, [layout.x(np.arange(1, layout.intervals), 3)], -1.0, -speed)]


def test_a_free_segment_is_the_smoothest_motion():
    """Min Σ|Δu|² from rest to rest; with many samples it tends to the closed form with least jerk and free ends of a."""
    n, dt = 100, 0.005
    layout = Layout(n, 0)
    states, inputs = segment(np.zeros(3), np.array([0.2, 0.0, 0.0]), at_most(layout, 99.0), layout, dt)
    t = np.linspace(0, 1, n + 1)
    smooth = 0.2 * (
        10 * t**3 - 15 * t**4 + 6 * t**5
    )  # ends of zero acceleration, which the price of the first Δu wants
    np.testing.assert_allclose(states[:, 0], smooth, atol=2e-3)
    np.testing.assert_allclose(states[[0, -1], 3:], 0, atol=1e-6)
    np.testing.assert_allclose(np.diff(states[:, 3:], axis=0), inputs * dt, atol=1e-8)


def test_a_segment_keeps_its_rows_or_says_that_it_cannot():
    layout = Layout(50, 0)
    ceiling = at_most(layout, 0.5)
    states, _ = segment(np.zeros(3), np.array([0.2, 0.0, 0.0]), ceiling, layout, 0.01)
    assert states[:, 3].max() == pytest.approx(0.5, abs=1e-4)
    with pytest.raises(PlanningError, match="no motion in 0.50 s"):
        segment(np.zeros(3), np.array([0.3, 0.0, 0.0]), ceiling, layout, 0.01)


@pytest.fixture(scope="module", params=[1.86, 0.5])
def placed(request):
    scenario = IDEAL.with_overrides({"object.friction": request.param})
    return scenario, Placer(scenario, arm_of(scenario)).plan()


def test_the_object_sticks_while_it_is_carried_and_slides_when_it_shall(placed):
    scenario, plan = placed
    mu, dt = scenario.object.friction, plan.plan.sampling_time
    phi = np.abs(contact.sliding_angle(plan.plan.inputs[:, :2], plan.plan.states[:-1, 2]))
    t = np.arange(len(phi)) * dt
    carried = t < plan.slide_begins - scenario.place.tilt_time
    assert phi[carried].max() < np.arctan(mu)
    waiting = (t > plan.slide_begins + scenario.place.tilt_time) & (t < plan.retreat_begins)
    assert waiting.sum() > 10
    assert np.all((phi[waiting] > np.arctan(mu)) & (phi[waiting] < np.pi / 2)), "eq. (8)"
    np.testing.assert_array_equal(contact.contact_state(phi[waiting], mu), contact.ContactState.SLIDE)


def test_the_blade_never_touches_the_table_and_the_object_is_aimed_at_the_target(placed):
    scenario, plan = placed
    states, tool, thing = plan.plan.states, scenario.tool, scenario.object
    theta = states[:, 2]
    for side in (0.5, -0.5):
        s, n = side * tool.blade_width, -thing.thickness / 2 - tool.blade_thickness
        assert (states[:, 1] + s * np.sin(theta) + n * np.cos(theta)).min() > scenario.table.height
    # the lower corner of the object, slid down by the way, stands on the table half a length before the target
    k = round(plan.retreat_begins / plan.plan.sampling_time)
    along = -plan.slide.way - thing.length / 2
    y = states[k, 0] + along * np.cos(theta[k]) + thing.thickness / 2 * np.sin(theta[k])
    z = states[k, 1] + along * np.sin(theta[k]) - thing.thickness / 2 * np.cos(theta[k])
    assert z == pytest.approx(scenario.table.height, abs=5e-4)
    assert y + thing.length / 2 == pytest.approx(scenario.place.target_y, abs=1e-3)


def test_while_it_carries_the_blade_keeps_the_clearance_of_a_flip(placed):
    """There the servo errs most: by up to 4 mm, at the end of the fast motion."""
    scenario, plan = placed
    end = plan.plan.n_contact - plan.after_carry
    corners = planar.placed(planar.blade(scenario), plan.plan.states[: end + 1, :3])[..., 1].min(axis=-1)
    lowest = corners - scenario.table.height
    assert lowest[-1] == pytest.approx(scenario.planner.table_clearance, abs=1e-6)
    assert lowest.min() > scenario.planner.table_clearance - scenario.place.edge_clearance / 2 - 1e-6
    held = planar.placed(planar.blade(scenario), plan.plan.states[plan.plan.n_contact, :3])[:, 1].min()
    assert held - scenario.table.height == pytest.approx(scenario.place.edge_clearance, abs=1e-6)


def test_what_is_out_of_reach_is_refused():
    scenario = IDEAL.with_overrides({"place.target_y": 0.9, "task.workspace_y": (-0.35, 1.5)})
    with pytest.raises(PlanningError, match="the object cannot be laid down"):
        Placer(scenario, arm_of(scenario)).plan()
