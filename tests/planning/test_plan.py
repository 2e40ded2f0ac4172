"""The default plan against the physics it promises, recomputed from its commands; and Plan as a data type."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar import G, blade, block, flown, gap, placed, polar

from flipdiagram.errors import InputError
from flipdiagram.planning import Plan
from flipdiagram.planning.arm_motion import task_pose
from flipdiagram.planning.limits import POSITION, SPEED, TORQUE
from flipdiagram.robot.arm import ArmModel

MS = 0.001


def made_up_plan(seed: int = 1, dt: float = 0.02) -> Plan:
    """A plan with arbitrary accelerations that obeys eq. (2)."""
    inputs = np.random.default_rng(seed).uniform(-20, 20, (7, 3))
    v = np.vstack([np.zeros(3), np.cumsum(inputs, axis=0) * dt])
    x = np.vstack([np.zeros(3), np.cumsum(v[:-1] * dt + inputs * dt**2 / 2, axis=0)]) + [0.1, 0.3, 0.0]
    return Plan(
        sampling_time=dt,
        n_contact=4,
        n_flight=2,
        n_brake=3,
        states=np.hstack([x, v]),
        inputs=inputs,
        cost=0.1 + 0.2,
        residual=1e-13,
        max_sliding_angle=0.5,
        friction_angle=1.0,
        limit_use={SPEED: 0.7},
        solver="none",
        iterations=3,
        solve_time=0.25,
        program_times=(0.1, 0.1 / 3),
    )


MADE_UP = made_up_plan()
times = st.floats(-0.1, 0.3) | st.integers(-3, 10).map(lambda k: k * 0.02)


@pytest.fixture(scope="module")
def grid(plan):
    """Every millisecond from the start until the tool rests."""
    return np.arange(round(plan.duration / MS) + 1) * MS


@pytest.fixture(scope="module")
def contact_phase(plan):
    """(t, a, θ) each ms of the contact phase, the samples twice: with the acceleration before and after them."""
    t = np.arange(round(plan.release_time / MS) + 1) * MS
    x, _, a = plan.sample(t)
    at = np.arange(plan.n_contact) + 1
    t = np.concatenate([t[:-1], at * plan.sampling_time])
    return t, np.vstack([a[:-1], plan.inputs[: plan.n_contact]]), np.concatenate([x[:-1, 2], plan.states[at, 2]])


# The physics of the default plan


def test_the_motion_obeys_eq_2_from_rest_to_rest(plan, scenario):
    dt, x, v = plan.sampling_time, plan.states[:, :3], plan.states[:, 3:]
    np.testing.assert_allclose(x[1:], x[:-1] + v[:-1] * dt + plan.inputs * dt**2 / 2, rtol=0, atol=1e-11)
    np.testing.assert_allclose(v[1:], v[:-1] + plan.inputs * dt, rtol=0, atol=1e-11)
    np.testing.assert_allclose(plan.states[0], [scenario.task.start_y, scenario.task.start_z, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(v[-1], 0, atol=1e-11)
    for t in (plan.duration, plan.duration + 1.0):
        assert [part.tolist() for part in plan.sample(t)[1:]] == [[0, 0, 0], [0, 0, 0]]


def test_the_sliding_angle_of_eq_11_stays_inside_the_cone(plan, scenario, contact_phase):
    _, a, theta = contact_phase
    magnitude, phi = polar(a[:, :2], theta)
    planned = np.arctan(scenario.object.friction * (1 - scenario.planner.friction_margin))
    assert np.abs(phi).max() < np.arctan(scenario.object.friction)
    assert np.abs(phi).max() < planned + 1e-6
    assert plan.max_sliding_angle == pytest.approx(np.abs(phi).max(), abs=1e-9)  # between samples φ is never larger
    assert plan.friction_angle == pytest.approx(np.arctan(1.86))
    assert np.all(magnitude * np.cos(phi) >= scenario.planner.minimum_normal - 1e-6)


def test_the_block_does_not_tip_over_its_edge(scenario, contact_phase):
    _, a, theta = contact_phase
    magnitude, phi = polar(a[:, :2], theta)
    thing = scenario.object
    # about the centre of the block: c N + h F_s = I_θ a_θ, with N = I cos φ and F_s = −I sin φ per unit mass
    k2 = (thing.length**2 + thing.thickness**2) / 12
    force, along = magnitude * np.cos(phi), -magnitude * np.sin(phi)
    centre = (k2 * a[:, 2] - thing.thickness / 2 * along) / force
    assert np.abs(centre).max() <= thing.length / 2 * (1 - scenario.planner.support_margin) + 1e-6


def test_the_block_is_released_beyond_the_vertical(plan, scenario):
    assert plan.release[2] >= np.pi / 2 + scenario.planner.release_angle - 1e-6
    assert plan.summary()["release_angle_rad"] == plan.release[2]
    np.testing.assert_array_equal(plan.release, plan.states[plan.n_contact])
    # and pressed on the blade until then
    assert np.all(
        np.abs(polar(plan.inputs[: plan.n_contact, :2], plan.states[1 : plan.n_contact + 1, 2])[1]) < np.pi / 2
    )


def test_the_released_block_never_touches_the_blade_again(plan, scenario):
    after = np.arange(MS, plan.touchdown_time - plan.release_time + 0.5, MS)
    tool = plan.sample(plan.release_time + after)[0]
    in_air = np.minimum(after, plan.touchdown_time - plan.release_time)
    gaps = np.array(
        [
            gap(placed(block(scenario), flying), placed(blade(scenario), held))
            for flying, held in zip(flown(plan.release, in_air), tool, strict=True)
        ]
    )
    assert gaps.min() > -1e-6
    settings = scenario.planner
    wanted = np.minimum(settings.separation_gap, settings.separation_acceleration * after**2 / 2)
    at_samples = np.isclose(after / plan.sampling_time, np.round(after / plan.sampling_time))
    assert np.all((gaps - wanted)[at_samples] > -1e-6)
    assert gaps[after > 0.1].min() > 0.9 * settings.separation_gap


def test_blade_and_block_stay_above_the_table_until_touch_down(plan, scenario, grid):
    floor = scenario.table.height
    edges = placed(blade(scenario), plan.sample(grid)[0])[..., 1]
    assert edges.min() > floor
    at_samples = placed(blade(scenario), plan.states[:, :3])[..., 1]
    assert at_samples.min() > floor + scenario.planner.table_clearance - 1e-6
    flying = grid[grid < plan.touchdown_time - MS / 2]
    corners = placed(block(scenario), plan.object_path(flying))[..., 1]
    assert corners.min() > floor
    landed = placed(block(scenario), plan.object_path(plan.touchdown_time))[:, 1].min()
    assert landed == pytest.approx(floor, abs=1e-5)


def test_the_tool_stays_in_the_workspace(plan, scenario, grid):
    y, z, _ = plan.sample(grid)[0].T
    for place, (low, high) in ((y, scenario.task.workspace_y), (z, scenario.task.workspace_z)):
        assert low - 1e-3 < place.min() and place.max() < high + 1e-3


def test_the_arm_can_do_it_at_every_millisecond(plan, scenario, arm: ArmModel, grid):
    x, v, a = plan.sample(grid)
    x6 = task_pose(x, scenario.task.start_x)
    q = arm.inverse_kinematics_path(x6, arm.inverse_kinematics(x6[0]))  # raises where a joint leaves its range
    qd, tau = np.empty_like(q), np.empty((2, *q.shape))
    last = np.clip(np.ceil(grid / plan.sampling_time - 1e-6).astype(int) - 1, 0, None)
    before = plan.inputs[last]  # at a sample, the acceleration of the interval that ends there
    for k in range(len(grid)):
        jacobian = arm.task_kinematics(q[k], np.zeros(6))[2]
        qd[k] = np.linalg.solve(jacobian, [*v[k], 0, 0, 0])
        bias = arm.task_kinematics(q[k], qd[k])[3]
        for end, acceleration in enumerate((before[k], a[k])):
            qdd = np.linalg.solve(jacobian, np.array([*acceleration, 0, 0, 0]) - bias)
            tau[end, k] = arm.inverse_dynamics(q[k], qd[k], qdd)
    middle, half = (arm.q_min + arm.q_max) / 2, (arm.q_max - arm.q_min) / 2
    uses = {
        POSITION: np.max(np.abs(q - middle) / half),
        SPEED: np.max(np.abs(qd) / arm.qd_max),
        TORQUE: np.max(np.abs(tau) / arm.tau_max),
    }
    for kind, use in uses.items():
        assert use < 1
        assert plan.limit_use[kind] == pytest.approx(use, abs=0.01)
    assert uses[SPEED] < 1 - scenario.planner.speed_margin + 0.01
    assert uses[TORQUE] < 1 - scenario.planner.torque_margin + 0.01


def test_j_is_eq_5_at_touch_down(plan, scenario):
    y, z, theta, v_y, v_z, spin = plan.release
    t = plan.n_flight * plan.sampling_time
    landing = [y + v_y * t, z + v_z * t - G * t**2 / 2, theta + spin * t, v_y, v_z - G * t, spin]
    np.testing.assert_allclose(plan.landing, landing, rtol=1e-12)
    expected = (landing[2] - np.pi) ** 2 + 20.0 * landing[0] ** 2 + 0.5 * (landing[3] ** 2 + landing[4] ** 2)
    assert plan.cost == pytest.approx(expected, rel=1e-12)
    assert (scenario.planner.alpha, scenario.planner.beta) == (20.0, 0.5)


def test_the_default_plan_turns_the_block_over_with_small_residuals(plan):
    assert plan.residual < 1e-8
    assert 0.8 * np.pi < plan.landing[2] < 1.2 * np.pi
    assert plan.cost < 0.7
    assert plan.n_flight >= 1 and len(plan.program_times) == plan.iterations
    assert 0 < sum(plan.program_times) < plan.solve_time


def test_the_object_path_is_the_tool_then_a_parabola_then_rest(plan):
    for t in (0.0, 0.1, plan.release_time - 1e-9):
        np.testing.assert_array_equal(plan.object_path(t), plan.sample(t)[0])
    after = np.linspace(0, plan.touchdown_time - plan.release_time, 7)
    np.testing.assert_allclose(plan.object_path(plan.release_time + after), flown(plan.release, after), atol=1e-12)
    np.testing.assert_allclose(plan.object_path(plan.touchdown_time + 1), plan.landing[:3], atol=1e-12)


def test_the_summary_repeats_the_plan(plan):
    summary = plan.summary()
    assert json.loads(json.dumps(summary)) == summary
    assert summary["release_time_s"] == plan.n_contact * plan.sampling_time
    assert summary["touchdown_time_s"] == (plan.n_contact + plan.n_flight) * plan.sampling_time
    assert summary["touchdown_angle_rad"] == plan.landing[2] and summary["touchdown_y_m"] == plan.landing[0]
    assert summary["touchdown_speed_m_s"] == pytest.approx(np.linalg.norm(plan.landing[3:5]))
    assert summary["cost_J"] == plan.cost


# Sampling


@given(t=times)
def test_at_is_sample_for_one_time(t):
    for one, many in zip(MADE_UP.at(t), MADE_UP.sample([t]), strict=True):
        np.testing.assert_allclose(one, many[0], rtol=1e-13, atol=1e-13)


@given(t=times)
def test_velocity_and_acceleration_are_derivatives(t):
    h = 1e-6
    x, v, a = MADE_UP.sample([t - h, t, t + h])
    k = np.floor(np.array([t - h, t + h]) / 0.02 + 1e-9)
    if k[0] == k[1]:  # inside an interval, or outside of the motion
        np.testing.assert_allclose((x[2] - x[0]) / (2 * h), v[1], atol=1e-8)
        np.testing.assert_allclose((v[2] - v[0]) / (2 * h), a[1], atol=1e-8)


@pytest.mark.parametrize("dt", [0.02, 0.03, 0.007])
def test_position_and_velocity_are_continuous_and_pass_through_the_samples(dt):
    plan = made_up_plan(2, dt)
    plan = replace(plan, states=np.vstack([plan.states[:-1], plan.states[-1] * [1, 1, 1, 0, 0, 0]]))  # comes to rest
    for k, t in enumerate(plan.t):
        x, v, _ = plan.sample([t - 1e-9, t, t + 1e-9])
        np.testing.assert_allclose(x, np.tile(plan.states[k, :3], (3, 1)), atol=1e-7)
        if k < len(plan.inputs):
            np.testing.assert_allclose(v, np.tile(plan.states[k, 3:], (3, 1)), atol=1e-6)
    # a sample belongs to the interval that starts there, though k ΔT is rounded
    np.testing.assert_array_equal(plan.sample(plan.t[:-1])[2], plan.inputs)
    np.testing.assert_array_equal([plan.at(float(t))[2] for t in plan.t[:-1]], plan.inputs)


def test_before_and_after_the_motion_the_tool_rests_at_its_ends():
    for t, state in ((-0.5, MADE_UP.states[0]), (MADE_UP.duration, MADE_UP.states[-1]), (9.0, MADE_UP.states[-1])):
        x, v, a = MADE_UP.sample(t)
        np.testing.assert_array_equal(x, state[:3])
        assert not v.any() and not a.any()


def test_what_at_returns_can_be_changed_without_harm():
    for t in (-1.0, 0.03, 9.0):
        before = [list(part) for part in MADE_UP.at(t)]
        for part in MADE_UP.at(t):
            part[0] = 1e9
        assert [list(part) for part in MADE_UP.at(t)] == before


def test_sample_takes_any_shape():
    t = np.linspace(-0.1, 0.2, 12).reshape(3, 4)
    for part in MADE_UP.sample(t):
        assert part.shape == (3, 4, 3)
    np.testing.assert_array_equal(MADE_UP.sample(t)[0][1, 2], MADE_UP.sample(t[1, 2])[0])


# Files


def same(a: Plan, b: Plan) -> bool:
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(Plan))


def test_json_round_trips_exactly(plan, tmp_path):
    for each in (plan, MADE_UP):
        path = tmp_path / "plan.json"
        path.write_text(each.to_json())
        again = Plan.load(path)
        assert same(again, each) and again.to_json() == each.to_json()
        assert isinstance(again.states, np.ndarray) and isinstance(again.program_times, tuple)


def changed(**values) -> str:
    data = json.loads(MADE_UP.to_json())
    data.update(values)
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not valid JSON"),
        ("{", "is not valid JSON"),
        ("[1, 2]", "is no plan file; valid is a file with schema 'flipdiagram/motion/1'"),
        ("{}", "is no plan file"),
        (changed(schema="flipdiagram/motion/0"), "is no plan file"),
        (changed(colour="red"), "lacks fields of a plan or has others"),
        ('{"schema": "flipdiagram/motion/1"}', "lacks fields of a plan or has others"),
        (changed(states="far"), "states"),
        (changed(states=[[1, 2], [3]]), "states"),
        (changed(states=MADE_UP.states[:-1].tolist()), "states"),
        (changed(states=[[None] * 6] * 8), "states"),
        (changed(inputs=MADE_UP.inputs[:, :2].tolist()), "inputs"),
        (changed(inputs=[[float("nan")] * 3] * 7), "inputs"),
        (changed(n_contact=4.0), "n_contact"),
        (changed(n_contact=3), "states, inputs"),
        (changed(n_flight=0), "n_flight"),
        (changed(sampling_time=-0.02), "sampling_time"),
        (changed(sampling_time="0.02"), "sampling_time"),
        (changed(cost=float("inf")), "cost"),
        (changed(limit_use=[1]), "limit_use"),
        (changed(solver=7), "solver"),
        (changed(program_times=3), "program_times"),
        (changed(states=10**400), "states"),
    ],
)
def test_a_bad_plan_file_is_refused_in_one_line(text, message, tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        Plan.load(path)
    line = str(error.value)
    assert message in line and f"plan file {str(path)!r}" in line and "\n" not in line


def test_a_plan_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"plan file '.*gone.json' cannot be read: No such file"):
        Plan.load(tmp_path / "gone.json")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        Plan.load(tmp_path)
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read: not UTF-8 text"):
        Plan.load(tmp_path / "bytes.json")
