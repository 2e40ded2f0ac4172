"""Each linearised constraint against the true one: same value at the linearisation point, same slope there.

The truth is recomputed from contact.py or from corner points turned by rotation matrices, as a function of the
decision vector [x̂_0, u_0, x̂_1, u_1, …, x̂_N].  Rows and truths are paired by value, so their order does not matter.
"""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ideal import IDEAL
from planar import blade, block, flown, placed

from flipdiagram.planning import constraints
from flipdiagram.planning.constraints import Geometry, Trajectory
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.rows import Linearisation, Rows, part
from flipdiagram.robot.model_files import box_inertia
from flipdiagram.theory import contact

SCENARIO = IDEAL
PLANNER, THING = SCENARIO.planner, SCENARIO.object
LAYOUT = Layout(release=6, n_brake=4)
R, N, DT = LAYOUT.release, LAYOUT.intervals, PLANNER.sampling_time
Truth = Callable[[np.ndarray, np.ndarray], np.ndarray]


@st.composite
def trajectories(draw):
    """Any trajectory on which the block is pressed on the blade; velocities need not fit the positions."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    states = rng.uniform([-0.3, 0.15, 0, -2, -2, -15], [0.3, 0.65, 0, 2, 2, 15], (N + 1, 6))
    states[:, 2] = rng.uniform(-1, 4) + np.cumsum(rng.uniform(-0.3, 0.3, N + 1))
    inputs = np.empty((N, 3))
    inputs[:, :2] = contact.acceleration(rng.uniform(3, 40, N), rng.uniform(-0.9, 0.9, N), states[:-1, 2])
    inputs[:, 2] = rng.uniform(-200, 200, N)
    return Trajectory(states, inputs, draw(st.integers(2, R)), draw(st.integers(1, 8)), DT)


def unpacked(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    body = w[: 9 * N].reshape(N, 9)
    return np.vstack([body[:, :6], w[9 * N :]]), body[:, 6:]


def agree(constraints_, point: Trajectory, truths: dict[str, Truth]) -> None:
    """The rows of each group are the linearisation of its truth(states, inputs) ≥ 0, and there are no others.

    Of the laws as NumPy evaluates them; what numba makes of the same lines differs by rounding only.
    """
    w = LAYOUT.pack(point.states, point.inputs)
    rows, machine = (Rows.about(w, [Linearisation(constraints_, native).at(w)]) for native in (False, True))
    np.testing.assert_allclose(machine.values, rows.values, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(machine.slack, rows.slack, rtol=1e-12, atol=1e-12)
    a, b = rows.matrix(LAYOUT.size), rows.upper
    groups = np.array(rows.names())
    assert set(groups) == set(truths)
    np.testing.assert_allclose(rows.slack, b - a @ w, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rows.left(w), rows.slack, rtol=1e-9, atol=1e-9)
    rng = np.random.default_rng(1)
    for group, truth in truths.items():
        of_group = groups == group
        margin, true = (b - a @ w)[of_group], truth(*unpacked(w))
        by_row, by_truth = np.argsort(margin), np.argsort(true)
        np.testing.assert_allclose(margin[by_row], true[by_truth], rtol=1e-9, atol=1e-9)
        for _ in range(2):
            way, step = rng.normal(size=w.size), 1e-6
            slope = (truth(*unpacked(w + step * way)) - truth(*unpacked(w - step * way))) / (2 * step)
            np.testing.assert_allclose(-(a @ way)[of_group][by_row], slope[by_truth], rtol=1e-5, atol=1e-5)


def moving(point: Trajectory):
    """Samples after the departure."""
    return np.arange(R - point.n_contact + 1, N + 1)


def both_ends(point: Trajectory, states, inputs):
    """a (.., 3) and θ of the contact phase at the start and at the end of each interval."""
    k = np.arange(R - point.n_contact, R)
    return np.vstack([inputs[k], inputs[k]]), np.concatenate([states[k, 2], states[k + 1, 2]])


@given(point=trajectories())
def test_contact_is_kept_at_both_ends_of_every_interval(point):
    mu = THING.friction * (1 - PLANNER.friction_margin)
    k2 = box_inertia(1.0, (THING.width, THING.length, THING.thickness))[0]
    reach = THING.length / 2 * (1 - PLANNER.support_margin)

    def friction(states, inputs):
        a, theta = both_ends(point, states, inputs)
        tangential, normal = contact.contact_force(a[:, :2], theta)
        return np.concatenate([mu * normal - tangential, mu * normal + tangential])

    def normal(states, inputs):
        a, theta = both_ends(point, states, inputs)
        return contact.contact_force(a[:, :2], theta)[1] - PLANNER.minimum_normal

    def support(states, inputs):
        a, theta = both_ends(point, states, inputs)
        force = contact.contact_force(a[:, :2], theta)[1]
        off = force * contact.centre_of_pressure(a, theta, THING.thickness / 2, k2) / reach
        # where nothing presses there is no centre of pressure; the moment balance still stands
        torque = (k2 * a[:, 2] - THING.thickness / 2 * contact.contact_force(a[:, :2], theta)[0]) / reach
        off = np.where(np.isnan(off), torque, off)
        return np.concatenate([force - off, force + off])

    k = np.arange(R - point.n_contact, R)
    agree(
        constraints.contact(LAYOUT, SCENARIO, k) + constraints.release(LAYOUT, SCENARIO),
        point,
        {
            constraints.FRICTION: friction,
            constraints.NORMAL: normal,
            constraints.SUPPORT: support,
            constraints.RELEASE: lambda states, _: states[[R], 2] - np.pi / 2 - PLANNER.release_angle,
        },
    )


@given(point=trajectories())
def test_the_object_stays_in_the_workspace_once_it_moves(point):
    def inside(states, _):
        moving = states[R - point.n_contact + 1 :, :2]
        low, high = np.transpose([SCENARIO.task.workspace_y, SCENARIO.task.workspace_z])
        return np.concatenate([moving - low, high - moving]).ravel()

    agree(constraints.workspace(LAYOUT, SCENARIO, moving(point)), point, {constraints.WORKSPACE: inside})


@given(point=trajectories(), shift=st.sampled_from([0.0, 0.01]))
def test_in_a_horizon_corners_of_blade_and_block_stay_above_the_table(point, shift):
    """The blade's and the carried block's at some clearance, the flying block's at least; shift: the block's on the blade."""
    floor = SCENARIO.table.height + PLANNER.table_clearance
    first = R - point.n_contact + 1

    def above(states, _):
        tool, carrying = states[first:, :3], states[first : R + 1, :3]
        lower, upper = blade(SCENARIO) - [shift, 0.0], block(SCENARIO)[2:]
        carried = np.concatenate([placed(lower, tool), placed(upper, carrying)], axis=None)[1::2] - floor
        pose = flown(states[R], np.arange(1, point.n_flight) * DT)
        return np.append(carried, placed(block(SCENARIO), pose)[..., 1].ravel() - SCENARIO.table.height)

    horizon = constraints.of_horizon(LAYOUT, SCENARIO, point.n_contact, point.n_flight, shift)
    agree([c for c in horizon if c.group == constraints.CLEARANCE], point, {constraints.CLEARANCE: above})


@given(theta=st.floats(-7, 7))
def test_no_corner_of_the_carried_block_is_lower_than_those_constrained(theta):
    pose = np.array([0, 0, theta])
    lowest = placed(np.vstack([blade(SCENARIO), block(SCENARIO)[2:]]), pose)[:, 1].min()
    assert placed(block(SCENARIO), pose)[:, 1].min() >= lowest - 1e-12


def distance_from_blade(point: Trajectory, states, last: int):
    """Height of the flying block's two lower corners over the blade's top, in the tool's own frame (last, 2)."""
    j = np.arange(1, last + 1)
    pose = flown(states[R], np.minimum(j, point.n_flight) * DT)
    tool = states[np.minimum(R + j, N)]
    corners = placed(block(SCENARIO)[:2], pose) - tool[:, None, :2]
    normal = placed(np.array([[0.0, 1.0]]), np.stack([0 * j, 0 * j, tool[:, 2]], axis=-1))
    return np.sum(corners * normal, axis=-1) + THING.thickness / 2


@given(point=trajectories())
def test_released_block_and_blade_part(point):
    # after the samples of the tool it rests, yet a long flight goes on over it
    last = max(LAYOUT.n_brake, point.n_flight)
    after = np.arange(1, last + 1) * DT
    wanted = np.minimum(PLANNER.separation_gap, PLANNER.separation_acceleration * after**2 / 2)

    def apart(states, _):
        return (distance_from_blade(point, states, last) - wanted[:, None]).ravel()

    agree(constraints.separation(LAYOUT, SCENARIO, point.n_flight), point, {constraints.SEPARATION: apart})


@given(point=trajectories().filter(lambda p: p.n_flight > 1))
def test_no_corner_touches_down_before_its_sample(point):
    def above(states, _):
        pose = flown(states[R], np.arange(1, point.n_flight) * DT)
        return placed(block(SCENARIO), pose)[..., 1].ravel() - SCENARIO.table.height

    agree(constraints.in_flight(LAYOUT, SCENARIO, point.n_flight), point, {constraints.CLEARANCE: above})


@given(point=trajectories())
def test_the_lowest_corner_meets_the_table_at_touch_down(point):
    row, bound = constraints.landing_row(LAYOUT, point, SCENARIO)

    def height(released):
        pose = flown(released, point.n_flight * DT)
        return placed(block(SCENARIO), pose)[:, 1].min() - SCENARIO.table.height

    released = point.states[R]
    assert row @ released - bound == pytest.approx(height(released), abs=1e-12)
    slope = [(height(released + way) - height(released - way)) / 2e-7 for way in 1e-7 * np.eye(6)]
    np.testing.assert_allclose(row, slope, atol=1e-6)


def test_depth_of_the_lowest_corner_against_hand_worked_values():
    geometry = Geometry(half_length=0.03, half_thickness=0.01, half_blade=0.05, blade_thickness=0.002)
    root = np.sqrt(0.5)
    for theta, depth, slope in (
        (0.0, 0.01, 0.03),
        (np.pi, 0.01, -0.03),
        (np.pi / 2, 0.03, -0.01),
        (np.pi / 4, 0.04 * root, 0.02 * root),
        (3 * np.pi / 4, 0.04 * root, -0.02 * root),
    ):
        # lying flat or standing the corner changes: either side's slope may be meant
        found = geometry.depth(theta)
        assert found[0] == pytest.approx(depth, abs=1e-15)
        assert abs(found[1]) == pytest.approx(abs(slope), abs=1e-15)
        if theta % (np.pi / 2):
            assert found[1] == pytest.approx(slope)


def test_gyration_is_that_of_a_homogeneous_box():
    mass = THING.mass
    inertia = box_inertia(mass, (THING.width, THING.length, THING.thickness))[0]
    assert Geometry.of(SCENARIO).gyration == pytest.approx(inertia / mass, rel=1e-12)


@pytest.mark.parametrize("n_contact", [3, 4])
def test_what_is_before_the_departure_enters_no_row(n_contact):
    point = Trajectory(np.zeros((N + 1, 6)), np.zeros((N, 3)), n_contact, 2, DT)
    w = LAYOUT.pack(point.states, point.inputs)
    rows = Rows.about(w, [Linearisation(constraints.of_horizon(LAYOUT, SCENARIO, n_contact, 2)).at(w)])
    departure = 9 * (R - n_contact)
    assert rows.matrix(LAYOUT.size)[:, :departure].nnz == 0


@pytest.mark.parametrize("sample", [0, 3, N])
def test_layout_finds_states_and_inputs_where_they_stand(sample):
    w = np.arange(LAYOUT.size, dtype=float)
    states, inputs = LAYOUT.unpack(w)
    assert LAYOUT.size == 9 * N + 6 and LAYOUT.units().shape == (LAYOUT.size,)
    np.testing.assert_array_equal(states[sample], w[9 * sample : 9 * sample + 6])
    assert [w[LAYOUT.x(sample, c)] for c in range(6)] == states[sample].tolist()
    if sample < N:
        np.testing.assert_array_equal(inputs[sample], w[9 * sample + 6 : 9 * sample + 9])
        assert [w[LAYOUT.u(sample, c)] for c in range(3)] == inputs[sample].tolist()


def test_rows_are_margins_and_slopes_about_a_point_and_remember_their_groups():
    w = np.array([1.0, 2.0, 3.0, 4.0])
    two = part("two", np.array([[0, 1], [3, 3]]), np.array([[2.0, 2.0], [5.0, 7.0]]), np.array([0.5, -1.0]))
    one = part("one", np.array([[0], [0]]), np.array([[1.0], [0.5]]), np.array([4.0]))  # a column twice adds up
    rows = Rows.about(w, [two, one])
    a = [[-2, 0, 0, -5], [0, -2, 0, -7], [-1.5, 0, 0, 0]]
    np.testing.assert_array_equal(rows.matrix(4).toarray(), a)
    np.testing.assert_array_equal(rows.upper, np.array([0.5, -1.0, 4.0]) + a @ w)
    np.testing.assert_array_equal(rows.slack, [0.5, -1.0, 4.0])
    assert rows.names() == ["two", "two", "one"] and rows.count == 3
    assert rows.excess(w) == 1.0 and rows.excess(w + [0.0, 1.0, 0.0, 1.0]) == 0.0


def test_a_decision_vector_is_packed_as_it_is_unpacked():
    w = np.arange(LAYOUT.size, dtype=float)
    np.testing.assert_array_equal(LAYOUT.pack(*LAYOUT.unpack(w)), w)
