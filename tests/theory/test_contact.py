import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flipdiagram.theory import contact
from flipdiagram.theory.contact import ContactState

G = 9.81
angles = st.floats(-10, 10)
accelerations = st.tuples(st.floats(-50, 50), st.floats(-50, 50))
coefficients = st.floats(0.01, 5)
ROOT_HALF, ROOT_3_HALF = np.sqrt(0.5), np.sqrt(3) / 2


@pytest.mark.parametrize(
    ("theta", "normal", "tangent"),
    [
        (0, (0, 1), (1, 0)),
        (np.pi / 6, (-0.5, ROOT_3_HALF), (ROOT_3_HALF, 0.5)),
        (np.pi / 2, (-1, 0), (0, 1)),
        (np.pi, (0, -1), (-1, 0)),
    ],
)
def test_normal_and_tangent_turn_with_the_tool(theta, normal, tangent):
    np.testing.assert_allclose(contact.tool_normal(theta), normal, atol=1e-15)
    np.testing.assert_allclose(contact.tool_tangent(theta), tangent, atol=1e-15)


@given(theta=angles)
def test_tangent_and_normal_are_a_right_handed_pair_of_unit_vectors(theta):
    s, n = contact.tool_tangent(theta), contact.tool_normal(theta)
    np.testing.assert_allclose(np.array([s, n]) @ np.array([s, n]).T, np.eye(2), atol=1e-14)
    assert s[0] * n[1] - s[1] * n[0] == pytest.approx(1)  # s × n = +x, so θ turns s towards n


def test_friction_angle_of_the_papers_block():
    assert contact.friction_angle(1.0) == pytest.approx(np.pi / 4)
    assert contact.friction_angle(1.86) == pytest.approx(1.0775, abs=5e-5)  # 61.7°


def test_at_the_friction_angle_a_still_block_just_holds():
    # weight along the slope equals the friction mu m g cos of eq. (6): what defines the angle
    tangential, normal = contact.contact_force([0, 0], contact.friction_angle(1.86))
    assert tangential == pytest.approx(1.86 * normal)


def test_resultant_is_eq_10():
    np.testing.assert_allclose(contact.resultant([3.0, 4.0]), [-3.0, -13.81])


@pytest.mark.parametrize(
    ("a", "theta", "phi"),
    [
        ((0, 0), 0, 0),  # at rest on a level tool: i points straight into it
        ((0, 0), 0.3, -0.3),  # at rest on a slope: |φ| is the slope
        ((-G, 0), 0, np.pi / 4),  # pushed sideways with 1 g
        ((-G, 0), np.pi / 4, 0),  # the same on a tool tilted to match
        ((0, -2 * G), np.pi, 0),  # upside down, pulled down with 2 g
        ((0, -2 * G), 0, -np.pi),  # the level tool would pull: released
    ],
)
def test_sliding_angle_against_hand_worked_values(a, theta, phi):
    assert contact.sliding_angle(a, theta) == pytest.approx(phi, abs=1e-12)


def test_eq_12_against_hand_worked_values():
    # I = 20, θ + φ = 30°: a = (−20 · ½, −9.81 + 20 · 0.8660254)
    np.testing.assert_allclose(contact.acceleration(20, 0.1, np.pi / 6 - 0.1), [-10, 7.510508], atol=1e-6)
    np.testing.assert_allclose(contact.acceleration(G, 0, 0), [0, 0], atol=1e-15)


def polar(a, theta):
    """I and φ of an acceleration."""
    return np.hypot(*contact.resultant(a)), contact.sliding_angle(a, theta)


@given(magnitude=st.floats(0.01, 100), phi=st.floats(-3.14, 3.14), theta=angles)
def test_eq_12_and_its_inverse_round_trip(magnitude, phi, theta):
    a = contact.acceleration(magnitude, phi, theta)
    np.testing.assert_allclose(polar(a, theta), [magnitude, phi], rtol=1e-9, atol=1e-9)


@given(a=accelerations, theta=angles)
def test_the_inverse_of_eq_12_round_trips_from_any_acceleration(a, theta):
    magnitude, phi = polar(a, theta)
    assert -np.pi <= phi < np.pi
    np.testing.assert_allclose(contact.acceleration(magnitude, phi, theta), a, atol=1e-10)


@given(a=accelerations, theta=angles)
def test_sliding_angle_is_the_angle_between_i_and_the_inward_normal(a, theta):
    i = np.array([0, -G]) - np.array(a)
    assume(np.hypot(*i) > 1e-3)
    inward = np.array([np.sin(theta), -np.cos(theta)])
    cosine = i @ inward / np.hypot(*i)
    assert np.cos(contact.sliding_angle(a, theta)) == pytest.approx(cosine, abs=1e-9)


def test_contact_states_at_the_borders_of_eqs_7_to_9():
    limit = float(contact.friction_angle(1.86))
    below = np.nextafter(limit, 0)
    phi = [0, below, limit, np.nextafter(np.pi / 2, 0), np.pi / 2, 3.0]
    states = [ContactState(s) for s in contact.contact_state(phi, 1.86)]
    stick, slide, release = ContactState.STICK, ContactState.SLIDE, ContactState.RELEASE
    assert states == [stick, stick, slide, slide, release, release]


@given(phi=st.floats(-3.14, 3.14), mu=coefficients)
def test_contact_state_does_not_depend_on_the_side(phi, mu):
    assert contact.contact_state(phi, mu) == contact.contact_state(-phi, mu)


def test_contact_force_against_hand_worked_values():
    # at rest on a 30° slope the tool holds half the weight along s and cos 30° of it along n
    np.testing.assert_allclose(contact.contact_force([0, 0], np.pi / 6), [G / 2, G * ROOT_3_HALF])
    np.testing.assert_allclose(contact.contact_force([3, 1], 0.0), [3, G + 1])


@given(a=accelerations, theta=angles)
def test_contact_force_in_terms_of_eq_11(a, theta):
    magnitude, phi = polar(a, theta)
    expected = [-magnitude * np.sin(phi), magnitude * np.cos(phi)]
    np.testing.assert_allclose(contact.contact_force(a, theta), expected, atol=1e-9)


@given(a=accelerations, theta=angles, turn=angles)
def test_contact_force_does_not_change_when_the_world_turns(a, theta, turn):
    cosine, sine = np.cos(turn), np.sin(turn)
    lift = np.array(a) + [0, G]
    turned = np.array([[cosine, -sine], [sine, cosine]]) @ lift - [0, G]
    np.testing.assert_allclose(
        contact.contact_force(turned, theta + turn), contact.contact_force(a, theta), rtol=0, atol=1e-9
    )


@given(a=accelerations, theta=angles, mu=coefficients)
def test_the_block_sticks_where_the_force_lies_in_the_cone(a, theta, mu):
    tangential, normal = contact.contact_force(a, theta)
    margin = mu * normal - abs(tangential)
    assume(abs(margin) > 1e-9)
    sticks = contact.contact_state(contact.sliding_angle(a, theta), mu) == ContactState.STICK
    assert (margin > 0) == sticks


def test_centre_of_pressure_against_hand_worked_values():
    h, k2 = 0.005, 4e-4
    # level, pushed with a_y = 4: the force leans, the block is held back below its centre: c = −h a_y / g
    assert contact.centre_of_pressure([4, 0, 0], 0.0, h, k2) == pytest.approx(-0.005 * 4 / G)
    # turned up with 50 rad/s² at rest: c = k² a_θ / g
    assert contact.centre_of_pressure([0, 0, 50], 0.0, h, k2) == pytest.approx(4e-4 * 50 / G)
    # at rest on a slope the force passes vertically through the centre: c = −h tan θ
    assert contact.centre_of_pressure([0, 0, 0], 0.4, h, k2) == pytest.approx(-h * np.tan(0.4))
    assert np.isnan(contact.centre_of_pressure([0, -G - 1, 0], 0.0, h, k2))  # no contact


@given(a=accelerations, spin=st.floats(-300, 300), theta=angles, h=st.floats(0.001, 0.05), k2=st.floats(1e-5, 1e-2))
def test_centre_of_pressure_balances_the_moments(a, spin, theta, h, k2):
    x, up = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    s = np.array([0, np.cos(theta), np.sin(theta)])
    n = np.array([0, -np.sin(theta), np.cos(theta)])
    force = np.array([0, *a]) + G * up  # Newton, per unit mass: force + gravity = a
    assume(force @ n > 0.1)
    c = contact.centre_of_pressure([*a, spin], theta, h, k2)
    moment = np.cross(c * s - h * n, force)  # about the centre of the object
    np.testing.assert_allclose(moment, k2 * spin * x, atol=1e-9)


def test_all_functions_broadcast_over_samples():
    a, theta = np.linspace(-5, 5, 21).reshape(7, 3), np.linspace(0, 2, 7)
    plane = a[:, :2]
    for rows, single in (
        (contact.sliding_angle(plane, theta), lambda k: contact.sliding_angle(plane[k], theta[k])),
        (np.transpose(contact.contact_force(plane, theta)), lambda k: contact.contact_force(plane[k], theta[k])),
        (
            contact.centre_of_pressure(a, theta, 0.005, 4e-4),
            lambda k: contact.centre_of_pressure(a[k], theta[k], 0.005, 4e-4),
        ),
    ):
        np.testing.assert_array_equal(rows, [single(k) for k in range(7)])
    assert contact.acceleration(np.ones(7), 0.1, theta).shape == (7, 2)
