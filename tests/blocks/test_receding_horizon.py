"""The MPC that replans: continuity of its commands, late and failed plans, and what it hands to the planner."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from scipy.linalg import expm

from flipdiagram.blocks.receding_horizon import RecedingHorizonController, Status, Timing
from flipdiagram.errors import InputError, PlanningError
from flipdiagram.planning.command import Command, decay, of_object, on_tool
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.replanner import inside

EARLY = 0.00025
START = 0.1
GAINS = (400.0, 40.0)


def plan_of(states0, inputs, n_contact, dt=0.02, solve_time=0.001, lengths=None, passed=0.0):
    """A plan whose states follow from eq. (2)."""
    states = [np.array(states0, dtype=float)]
    for u, h in zip(inputs, np.full(len(inputs), dt) if lengths is None else lengths, strict=True):
        x, v = states[-1][:3], states[-1][3:]
        states.append(np.concatenate([x + v * h + u * h**2 / 2, v + u * h]))
    return Plan(
        dt,
        n_contact,
        4,
        len(inputs) - n_contact,
        np.array(states),
        np.array(inputs, dtype=float),
        1.0,
        0.0,
        0.5,
        1.0,
        {},
        "none",
        1,
        solve_time,
        passed=passed,
    )


def first_plan(n_contact=20, n_brake=5):
    t = np.arange(n_contact + n_brake)
    inputs = np.column_stack([3 * np.cos(0.3 * t), -2 * np.sin(0.2 * t), 5 * np.cos(0.25 * t)])
    return plan_of([0.0, 0.35, 0.0, 0, 0, 0], inputs, n_contact)


class Again:
    """Plans the rest as the old plan went, from the state it is given; remembers how it was asked."""

    def __init__(self, solve_time=0.001, fail_at=()):
        self.asked, self.solve_time, self.fail_at = [], solve_time, fail_at

    def __call__(self, state, plan, elapsed, q, shift, begun):
        self.asked.append((np.array(state), elapsed, np.array(q), shift))
        if len(self.asked) in self.fail_at:
            raise PlanningError("no solution")
        k, passed = inside(plan, elapsed)
        inputs, lengths = plan.inputs[k:], np.full(len(plan.inputs) - k, plan.sampling_time)
        lengths[0] -= passed
        return plan_of(state, inputs, plan.n_contact - k, solve_time=self.solve_time, lengths=lengths, passed=passed)


def controller(again, timing, measured=True, plan=None, hold=None):
    plan = plan or first_plan()
    hold = np.array([*plan.states[0, :3], 0.5, 0, 0]) if hold is None else hold
    box = RecedingHorizonController(
        lambda: plan, again, hold, timing, joints=2, gains=GAINS, start_time=START, measured=measured, fewest=1
    )
    context = box.CreateDefaultContext()
    return box, context


def fix(box, context, x, v, q=(0.1, 0.2), shift=None):
    box.GetInputPort("x").FixValue(context, np.array([*x, 0.5, 0, 0]))
    box.GetInputPort("v").FixValue(context, np.array([*v, 0, 0, 0]))
    box.GetInputPort("q").FixValue(context, np.array(q))
    if shift is not None:
        box.GetInputPort("shift").FixValue(context, np.array([shift]))


def run(box, context, until, step=0.0005):
    """Times since the start and x_cmd, v_cmd (n, 3) of a run."""
    simulator = Simulator(box, context)
    simulator.Initialize()
    times = START + np.arange(round((until - START) / step)) * step
    x, v = [], []
    for t in times:
        simulator.AdvanceTo(t)
        x.append(box.GetOutputPort("x_cmd").Eval(context)[:3])
        v.append(box.GetOutputPort("v_cmd").Eval(context)[:3])
    return times - START, np.array(x), np.array(v)


offsets = st.tuples(*[st.floats(-0.02, 0.02)] * 3)


@settings(max_examples=8, deadline=None)
@given(
    delay=st.floats(0.0, 0.05),
    period=st.sampled_from([0.001, 0.02, 0.03, 0.05, 0.08]),
    x=offsets,
    v=offsets,
    start=offsets,
)
def test_x_cmd_and_v_cmd_are_continuous_whatever_the_delay_and_the_error(delay, period, x, v, start):
    """Between samples h apart a continuous motion moves by v h + a h²/2: more would be a jump.  The tool is off by as
    much all the time; a plan that is still under way is not replaced by the next one, which follows it."""
    plan, again = first_plan(), Again()
    hold = np.array([*(plan.states[0, :3] + start), 0.5, 0, 0])
    box, context = controller(again, Timing(period, delay, EARLY), plan=plan, hold=hold)
    h, count = 0.001, 250
    simulator = Simulator(box, context)
    fix(box, context, hold[:3], [0, 0, 0])
    simulator.Initialize()
    x_cmd, v_cmd = np.zeros((2, count, 3))
    for k in range(count):
        simulator.AdvanceTo(START + k * h)
        x_cmd[k], v_cmd[k] = (box.GetOutputPort(name).Eval(context)[:3] for name in ("x_cmd", "v_cmd"))
        fix(box, context, x_cmd[k] + x, v_cmd[k] + v)
    assert len(again.asked) > 3
    np.testing.assert_allclose(x_cmd[0], hold[:3], atol=1e-9)
    largest = 60 + 5 * GAINS[0] * 0.02 + 5 * GAINS[1] * 0.02  # of any acceleration: the plan's and the decay's
    assert np.abs(np.diff(v_cmd, axis=0)).max() < largest * h
    mean = (v_cmd[1:] + v_cmd[:-1]) / 2
    assert np.abs(np.diff(x_cmd, axis=0) - mean * h).max() < largest * h**2


def test_a_plan_from_the_command_itself_changes_nothing():
    plan, again = first_plan(), Again()
    box, context = controller(again, Timing(0.04, 0.02, EARLY), measured=False, plan=plan)
    fix(box, context, [9, 9, 9], [9, 9, 9])
    t, x_cmd, v_cmd = run(box, context, START + 0.5)
    x, v, _ = plan.sample(t)
    np.testing.assert_allclose(x_cmd, x, atol=1e-12)
    np.testing.assert_allclose(v_cmd, v, atol=1e-11)
    assert len(again.asked) == 10, "every 40 ms of 0.4 s of contact, the last with its 20 ms of delay"
    for k, (state, elapsed, _, shift) in enumerate(again.asked):
        # each plan begins where the one before took effect: the elapsed time is one period of it, the first one delay
        assert elapsed == pytest.approx(0.02 if k == 0 else 0.04) and shift == 0
        np.testing.assert_allclose(state, np.hstack(plan.sample(0.04 * k + 0.02)[:2]), atol=1e-11)


def test_the_measured_error_is_carried_on_to_when_the_plan_takes_effect():
    plan, again = first_plan(), Again()
    box, context = controller(again, Timing(0.04, 0.02, EARLY), plan=plan)
    error_x, error_v = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3])
    fix(box, context, plan.states[0, :3] + error_x, plan.states[0, 3:] + error_v, q=(0.7, 0.8))
    run(box, context, START + 0.01)
    ((state, elapsed, q, _),) = again.asked
    x, v, _ = plan.sample(0.02)
    np.testing.assert_allclose(state, np.concatenate([x + error_x, v + error_v]), atol=1e-12)
    np.testing.assert_array_equal(q, [0.7, 0.8])


def test_a_plan_takes_effect_one_delay_later_and_the_command_reaches_it_as_an_error_decays():
    plan, again = first_plan(), Again()
    box, context = controller(again, Timing(1.0, 0.04, EARLY), plan=plan)
    fix(box, context, plan.states[0, :3] + 0.01, plan.states[0, 3:])
    t, x_cmd, _ = run(box, context, START + 0.4)
    old, _, _ = plan.sample(t)
    np.testing.assert_allclose(x_cmd[t < 0.04 - 1e-9], old[t < 0.04 - 1e-9], atol=1e-12)
    new = plan_of(np.hstack(plan.sample(0.04)[:2]) + np.array([0.01] * 3 + [0] * 3), plan.inputs[2:], 18)
    after = t > 0.04
    tau = t[after] - 0.04
    left = -0.01 * (1 + 20 * tau) * np.exp(-20 * tau)  # K_p = 400, K_v = 40: both poles at -20 rad/s
    np.testing.assert_allclose(x_cmd[after], new.sample(tau)[0] + left[:, None], atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(k_p=st.floats(0, 2000), k_v=st.floats(0, 200), t=st.floats(0, 0.5))
@example(k_p=400.0, k_v=40.0, t=0.1)
@example(k_p=0.0, k_v=0.0, t=0.3)
@example(k_p=1.0, k_v=1e5, t=5.0)
def test_an_error_decays_as_the_feedback_lets_it(k_p, k_v, t):
    """p'' = -k_v p' - k_p p by its matrix exponential."""
    by_offset, by_rate = decay(k_p, k_v, t)
    exact = expm(np.array([[0.0, 1.0], [-k_p, -k_v]]) * t)
    np.testing.assert_allclose(np.transpose([by_offset[:2], by_rate[:2]]), exact, rtol=1e-6, atol=1e-7 * (1 + k_p))
    for p, dp, ddp in (by_offset, by_rate):
        assert ddp == pytest.approx(-k_v * dp - k_p * p, abs=1e-9 * (1 + k_p + k_v))


def last_status(box, context):
    return Status(int(box.GetOutputPort("status").Eval(context)[0]))


def test_a_failed_plan_leaves_the_last_in_force_and_is_reported():
    plan, again = first_plan(), Again(fail_at=(2,))
    box, context = controller(again, Timing(0.04, 0.0, EARLY), measured=False, plan=plan)
    fix(box, context, [0] * 3, [0] * 3)
    simulator = Simulator(box, context)
    simulator.Initialize()
    assert last_status(box, context) == Status.PLANNED
    seen = []
    for k in range(4):
        simulator.AdvanceTo(START + 0.04 * k + 0.01)
        seen.append(last_status(box, context))
    assert seen == [Status.REPLANNED, Status.FAILED, Status.REPLANNED, Status.REPLANNED]
    np.testing.assert_allclose(box.GetOutputPort("x_cmd").Eval(context)[:3], plan.sample(0.13)[0], atol=1e-12)


def test_a_late_plan_is_dropped_and_its_time_reported():
    plan, again = first_plan(), Again(solve_time=0.5)
    box, context = controller(again, Timing(0.04, 0.0, EARLY, deadline=0.01), plan=plan)
    fix(box, context, plan.states[0, :3] + 0.1, [0] * 3)
    _, x_cmd, _ = run(box, context, START + 0.1)
    assert last_status(box, context) == Status.LATE
    assert box.GetOutputPort("solve_time").Eval(context)[0] == 0.5
    assert box.GetOutputPort("iterations").Eval(context)[0] == 1
    np.testing.assert_allclose(x_cmd[-1], plan.sample(0.1 - 0.0005)[0], atol=1e-12)


def test_it_stops_when_the_block_is_about_to_leave():
    again = Again()
    box, context = controller(again, Timing(0.05, 0.02, EARLY), measured=False)
    fix(box, context, [0] * 3, [0] * 3)
    run(box, context, START + 0.6)
    assert last_status(box, context) == Status.OVER
    assert len(again.asked) == 8, "0.00 to 0.35 s; at 0.40 s, the release, nothing is left"
    assert box.GetOutputPort("cone_margin").Eval(context)[0] == pytest.approx(0.5)


def test_plans_under_way_take_effect_one_after_another():
    """A new plan every 10 ms, each in force 30 ms later: none is dropped for the next one."""
    plan, again = first_plan(), Again()
    box, context = controller(again, Timing(0.01, 0.03, EARLY), measured=False, plan=plan)
    fix(box, context, [0] * 3, [0] * 3)
    simulator = Simulator(box, context)
    simulator.Initialize()
    simulator.AdvanceTo(START + 0.1 + 0.001)
    begun = [command.begins for command in box.horizon(context).commands]
    np.testing.assert_allclose(begun, [0.10, 0.11, 0.12, 0.13], atol=1e-9)
    assert [box.GetOutputPort(name).Eval(context)[0] for name in ("replanned", "failed", "late")] == [11, 0, 0]
    np.testing.assert_allclose(box.GetOutputPort("x_cmd").Eval(context)[:3], plan.sample(0.101)[0], atol=1e-12)


def test_two_contexts_of_one_box_do_not_disturb_each_other():
    plan, again = first_plan(), Again()
    box, one = controller(again, Timing(0.04, 0.02, EARLY), plan=plan)
    two = box.CreateDefaultContext()
    fix(box, one, plan.states[0, :3] + 0.05, [0] * 3)
    fix(box, two, plan.states[0, :3], [0] * 3)
    _, first, _ = run(box, one, START + 0.2)
    _, second, _ = run(box, two, START + 0.2)
    fresh = box.CreateDefaultContext()
    fix(box, fresh, plan.states[0, :3] + 0.05, [0] * 3)
    _, again_first, _ = run(box, fresh, START + 0.2)
    np.testing.assert_array_equal(first, again_first)
    assert np.abs(first - second).max() > 0.01


def test_no_output_depends_on_an_input():
    box, _ = controller(Again(), Timing(0.04, 0.02, EARLY))
    assert not box.HasAnyDirectFeedthrough()


@pytest.mark.parametrize("bad", [{"period": 0.0}, {"delay": -0.1}, {"early": 0.0}])
def test_times_that_make_no_sense_are_refused(bad):
    with pytest.raises(InputError, match="valid is period and early above 0"):
        Timing(**({"period": 0.04, "delay": 0.01, "early": EARLY} | bad))


@settings(max_examples=50, deadline=None)
@given(d=st.floats(-0.03, 0.03), theta=st.floats(-1, 4), w=st.floats(-8, 8), alpha=st.floats(-90, 90))
def test_an_object_off_centre_and_the_tool_move_as_one_rigid_body(d, theta, w, alpha):
    """Velocity and acceleration by differences of the position, and back again."""
    x, v, a = [0.1, 0.3, theta], [0.4, -0.2, w], [3.0, 4.0, alpha]

    def position(h):
        angle = theta + w * h + alpha * h * h / 2
        object_at = [x[i] + v[i] * h + a[i] * h * h / 2 for i in (0, 1)]
        return np.array([object_at[0] - d * math.cos(angle), object_at[1] - d * math.sin(angle)])

    h = 1e-5
    tool_x, tool_v, tool_a = on_tool(x, v, a, d)
    np.testing.assert_allclose(tool_x[:2], position(0), atol=1e-12)
    np.testing.assert_allclose(tool_v[:2], (position(h) - position(-h)) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(tool_a[:2], (position(h) - 2 * position(0) + position(-h)) / h**2, atol=2e-3)
    np.testing.assert_allclose(of_object(np.array(tool_x), np.array(tool_v), d), [*x, *v], atol=1e-12)


def test_a_command_of_a_shifted_object_is_that_of_the_tool():
    command = Command(first_plan(), shift=0.01)
    x, v, a = command.at(0.13)
    plain = replace(command, shift=0.0).at(0.13)
    for got, want in zip((x, v, a), on_tool(*plain, 0.01), strict=True):
        np.testing.assert_allclose(got, want)
