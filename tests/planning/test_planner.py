"""The planner as a whole: what it finds over scenarios, what it says where there is nothing to find."""

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from ideal import IDEAL
from planar import G, blade, block, flown, gap, placed, polar

from flipdiagram.errors import PlanningError
from flipdiagram.planning import Plan, Planner, constraints, convexification, plan_motion
from flipdiagram.planning import planner as planner_module
from flipdiagram.planning.limits import POSITION, SPEED, TORQUE
from flipdiagram.scenario.scenario import Scenario


def assert_all_constraints_hold(plan: Plan, scenario: Scenario) -> None:
    """At every sample what is planned, on a grid of 2 ms what physics needs."""
    settings, thing, table = scenario.planner, scenario.object, scenario.table.height
    n, dt, x, u = plan.n_contact, plan.sampling_time, plan.states[:, :3], plan.inputs
    assert plan.residual < 1e-6
    np.testing.assert_allclose(plan.states[0], [scenario.task.start_y, scenario.task.start_z, 0, 0, 0, 0], atol=1e-8)
    assert plan.n_brake == (0 if settings.stop == "immediate" else settings.brake_samples)
    if plan.n_brake:
        np.testing.assert_allclose(plan.states[-1, 3:], 0, atol=1e-8)
    np.testing.assert_allclose(x[1:], x[:-1] + plan.states[:-1, 3:] * dt + u * dt**2 / 2, atol=1e-9)
    np.testing.assert_allclose(plan.states[1:, 3:], plan.states[:-1, 3:] + u * dt, atol=1e-8)
    assert plan.release[2] > np.pi / 2 + settings.release_angle - 1e-6

    a, theta = np.vstack([u[:n], u[:n]]), np.concatenate([x[:n, 2], x[1 : n + 1, 2]])
    magnitude, phi = polar(a[:, :2], theta)
    assert np.abs(phi).max() < np.arctan(thing.friction * (1 - settings.friction_margin)) + 1e-4
    force = magnitude * np.cos(phi)
    assert force.min() > settings.minimum_normal - 1e-3
    k2 = (thing.length**2 + thing.thickness**2) / 12
    centre = (k2 * a[:, 2] + thing.thickness / 2 * magnitude * np.sin(phi)) / force
    assert np.abs(centre).max() < thing.length / 2 * (1 - settings.support_margin) + 1e-5

    assert placed(blade(scenario), x)[..., 1].min() > table + settings.table_clearance - 1e-5
    assert placed(block(scenario), x[: n + 1])[..., 1].min() > table + settings.table_clearance - 1e-5
    grid = np.arange(0, max(plan.duration, plan.touchdown_time), 0.002)
    assert placed(blade(scenario), plan.sample(grid)[0])[..., 1].min() > table
    flight = plan.touchdown_time - plan.release_time
    for t in grid[grid > plan.release_time]:
        flying = placed(block(scenario), flown(plan.release, min(t - plan.release_time, flight)))
        assert gap(flying, placed(blade(scenario), plan.sample(t)[0])) > -1e-5
        assert flying[:, 1].min() > table - 1e-4
    assert placed(block(scenario), flown(plan.release, flight))[:, 1].min() == pytest.approx(table, abs=1e-4)
    for component, (low, high) in enumerate((scenario.task.workspace_y, scenario.task.workspace_z)):
        assert low - 1e-6 < x[1:, component].min() and x[1:, component].max() < high + 1e-6

    assert set(plan.limit_use) == {POSITION, SPEED, TORQUE} and max(plan.limit_use.values()) <= 1
    landing = plan.release + np.concatenate([plan.release[3:], np.zeros(3)]) * flight
    landing[4] -= G * flight
    expected = (landing[2] - np.pi) ** 2 + settings.alpha * (landing[0] - scenario.task.target_y) ** 2
    assert plan.cost == pytest.approx(expected + settings.beta * (landing[3] ** 2 + landing[4] ** 2), rel=1e-6)


@pytest.mark.parametrize("solver", ["daqp", "clarabel"])
def test_a_command_that_stops_at_the_release_keeps_all_constraints_and_its_velocity_until_then(solver):
    scenario = IDEAL.with_overrides({"planner.stop": "immediate", "planner.solver": solver})
    plan = plan_motion(scenario)
    assert_all_constraints_hold(plan, scenario)
    assert plan.duration == plan.release_time and plan.release[5] > 1.0
    for sample in (plan.sample, plan.at):
        before, after = sample(plan.duration - 1e-6), sample(plan.duration)
        np.testing.assert_allclose(before[1], plan.release[3:], atol=1e-3)
        np.testing.assert_array_equal(after[1:], np.zeros((2, 3)))
        np.testing.assert_allclose(after[0], plan.release[:3], atol=1e-12)
    assert Plan.from_json(plan.to_json()).n_brake == 0
    # what the brakes had to keep to is gone, and nothing else: it lands no worse than with them, but for the grid
    assert plan.cost == pytest.approx(0.6316, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_from_any_start_all_constraints_hold(seed):
    rng = np.random.default_rng(seed)
    start = {"task.start_y": float(rng.uniform(-0.1, 0.14)), "task.start_z": float(rng.uniform(0.3, 0.4))}
    scenario = IDEAL.with_overrides(start)
    plan = plan_motion(scenario)
    assert_all_constraints_hold(plan, scenario)
    assert plan.cost < 0.7


@pytest.fixture(scope="module")
def slippery():
    """Plans by friction coefficient."""
    scenarios = {mu: IDEAL.with_overrides({"object.friction": mu}) for mu in (0.6, 0.35, 0.12)}
    return {mu: (plan_motion(scenario), scenario) for mu, scenario in scenarios.items()}


@pytest.mark.parametrize("mu", [0.6, 0.35, 0.12])
def test_a_slippery_block_is_turned_over_too(slippery, mu):
    assert_all_constraints_hold(*slippery[mu])


def test_the_more_slippery_the_dearer(slippery, plan):
    costs = [plan.cost, *(slippery[mu][0].cost for mu in (0.6, 0.35, 0.12))]
    assert costs == sorted(costs) and min(np.diff(costs)) > 0.05


@pytest.mark.parametrize(
    "overrides",
    [
        {"table.height": -0.3},  # the block flies on after the tool has come to rest
        {"arm.torque_scale": 0.15, "planner.flight_samples": (4, 8)},  # torque limits bind
        {
            "task.start_z": 0.6,
            "planner.flight_samples": (8, 12),
        },  # past the wrist's singularity: speeds peak between samples
    ],
    ids=lambda overrides: next(iter(overrides)),
)
def test_at_the_edge_of_what_the_arm_can_do_all_constraints_hold(overrides):
    scenario = IDEAL.with_overrides(overrides)
    plan = plan_motion(scenario)
    assert_all_constraints_hold(plan, scenario)
    if "table.height" in overrides:
        assert plan.n_flight > plan.n_brake
    else:
        assert max(plan.limit_use[TORQUE] / 0.8, plan.limit_use[SPEED]) > 0.94


def test_every_kind_of_constraint_enters_the_program(planner, plan):
    """Rows of the whole horizon per group, as counted by hand, and joint rows where near a limit."""
    horizons, (n, flight) = planner.horizons, (plan.n_contact, plan.n_flight)
    found = Counter(horizons.rows(horizons.guess(n, flight))[0].names())
    joints = {kind: found.pop(kind, 0) for kind in (POSITION, SPEED, TORQUE)}
    moving = n + plan.n_brake
    assert found == {
        constraints.NORMAL: 2 * n,
        constraints.FRICTION: 4 * n,
        constraints.SUPPORT: 4 * n,
        constraints.RELEASE: 1,
        constraints.WORKSPACE: 4 * moving,
        constraints.CLEARANCE: 4 * moving + 2 * n + 4 * (flight - 1),
        constraints.SEPARATION: 2 * max(plan.n_brake, flight),
    }
    assert {*found, *joints} == set(convexification.GROUPS)
    assert joints[POSITION] > 0 and joints[SPEED] > 0


def test_planning_is_deterministic_to_the_bit(planner, plan, scenario):
    for again in (planner.plan(), Planner(scenario).plan()):
        np.testing.assert_array_equal(again.states, plan.states)
        np.testing.assert_array_equal(again.inputs, plan.inputs)
        assert (again.cost, again.residual, again.limit_use) == (plan.cost, plan.residual, plan.limit_use)
        assert (again.n_contact, again.n_flight, again.iterations) == (plan.n_contact, plan.n_flight, plan.iterations)


def test_a_joint_limit_exceeded_between_samples_is_fed_back(scenario, plan, monkeypatch):
    """The limit is tightened and the motion settled again; the next plan starts afresh."""
    planner, true_use, calls = Planner(scenario), Planner._limit_use, []

    def first_too_fast(self, outcome):
        calls.append(outcome)
        use = true_use(self, outcome)
        return use if len(calls) > 1 else {**use, SPEED: use[SPEED] * 1.1}

    monkeypatch.setattr(Planner, "_limit_use", first_too_fast)
    slower, peak = planner.plan(), plan.limit_use[SPEED]
    assert len(calls) == 2 and slower.limit_use[SPEED] == pytest.approx(0.95 / (1.1 * peak), abs=0.01)
    assert slower.cost > plan.cost
    np.testing.assert_array_equal(planner.plan().states, plan.states)

    monkeypatch.setattr(
        Planner, "_limit_use", lambda self, outcome: {**true_use(self, outcome), SPEED: np.full(6, 1.001)}
    )
    with pytest.raises(
        PlanningError, match=r"^joint speed limit cannot be met: joint S would need 1.00 x .* between samples$"
    ):
        planner.plan()


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"table.height": 0.4}, r"^table clearance cannot be met: at the start the blade is -0.057 m above the table"),
        (
            {"table.height": 0.34},
            r"^table clearance cannot be met: at the start the blade is 0.003 m .* wanted 0.01 m$",
        ),
        (
            {"arm.speed_scale": 0.05},
            r"^no motion found: joint speed limit cannot be met \(joint [SLURBT] would need [\d.]+ x",
        ),
        (
            {"arm.torque_scale": 0.05},
            r"^no motion found: joint torque limit cannot be met \(joint [SLURBT] would need [\d.]+ x",
        ),
        # level it is within reach, but not tilted: the object may not go lower, where the arm could follow
        (
            {"task.start_z": 0.6, "task.workspace_z": (0.57, 0.65)},
            r"^no motion found: .*joint (position|speed|torque) limit",
        ),
        (
            {"task.start_x": 0.6, "task.start_y": 0.35, "task.start_z": 0.65},
            r"^the arm cannot reach the pose y = 0.35 m, z = 0.65 m",
        ),
        (
            {"planner.contact_samples": (2, 3)},
            r"^no motion found: release angle cannot be met \(short by [\d.]+\) while joint",
        ),
        (
            {"task.workspace_y": (-0.02, 0.02), "planner.contact_samples": (10, 10)},
            r"^no motion found: workspace cannot be met",
        ),
    ],
    ids=lambda case: ",".join(case) if isinstance(case, dict) else "",
)
def test_the_impossible_is_refused_in_one_line_naming_the_constraint(overrides, message):
    # few flight samples: what is impossible is so for any of them
    scenario = IDEAL.with_overrides({"planner.flight_samples": (5, 6), **overrides})
    with pytest.raises(PlanningError) as error:
        plan_motion(scenario)
    assert re.search(message, str(error.value)), str(error.value)
    assert "\n" not in str(error.value) and error.value.exit_code == 3


def test_too_few_linearisations_are_named():
    with pytest.raises(PlanningError, match=r"not settled within 1 linearisations \(planner.max_iterations\)"):
        plan_motion(IDEAL.with_overrides({"planner.max_iterations": 1, "planner.flight_samples": (5, 5)}))


def test_a_plan_that_takes_too_long_says_where_it_was(monkeypatch):
    monkeypatch.setattr(planner_module, "LONGEST", -1.0)
    with pytest.raises(
        PlanningError, match=r"took too long: it gave up at linearisation 1 of \d+ contact and \d+ flight"
    ):
        plan_motion(IDEAL)


def test_the_chosen_horizon_is_no_worse_than_others(planner, plan):
    """Flight samples to either side, and contact samples at random, each settled with the full tolerance."""
    settings, horizons = planner.scenario.planner, planner.horizons
    waiting = horizons.layout.release - plan.n_contact
    states = np.vstack([np.tile(plan.states[0], (waiting, 1)), plan.states])
    inputs = np.vstack([np.zeros((waiting, 3)), plan.inputs])
    here = convexification.Trajectory(states, inputs, plan.n_contact, plan.n_flight, plan.sampling_time)
    (fewest, most), rng = settings.contact_samples, np.random.default_rng(3)
    others = {(n_contact, plan.n_flight + step) for step in (-1, 1, 2) for n_contact in (plan.n_contact, most)}
    others |= {(int(n), int(f)) for n, f in zip(rng.integers(fewest, most, 4), rng.integers(4, 9, 4), strict=True)}
    for n_contact, n_flight in sorted(others):
        start = replace(here, n_contact=n_contact, n_flight=n_flight)
        outcome = horizons.settle(start, settings.angle_tolerance, settings.max_iterations)
        if not outcome.shortfall:
            assert plan.cost <= outcome.cost * (1 + settings.search_tolerance), (n_contact, n_flight)
    # and no shorter contact phase does as well
    shorter = replace(here, n_contact=plan.n_contact - 1)
    outcome = horizons.settle(shorter, settings.angle_tolerance, settings.max_iterations)
    assert outcome.shortfall or outcome.cost > plan.cost * (1 - settings.search_tolerance)


def test_the_settled_motion_does_not_depend_on_where_it_was_linearised_first(planner, plan):
    """From the guess, a slow turn in place, to the plan that the search reached from its neighbours."""
    settings, horizons = planner.scenario.planner, planner.horizons
    guess = horizons.guess(plan.n_contact, plan.n_flight)
    outcome = horizons.settle(guess, settings.angle_tolerance, settings.max_iterations)
    assert outcome.settled and not outcome.slack
    assert outcome.cost == pytest.approx(plan.cost, rel=1e-4)
    first = horizons.layout.release - plan.n_contact
    np.testing.assert_allclose(outcome.point.states[first:, :3], plan.states[:, :3], atol=2e-3)
