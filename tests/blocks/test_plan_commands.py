"""A plan frozen into parameters against the plan itself, over every scalar."""

import dataclasses

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression, Variable
from shared import ideal_plan

from flipdiagram.blocks.mpc import COMMANDS, ModelPredictiveController
from flipdiagram.blocks.plan_commands import PlanCommands, plan_commands
from flipdiagram.errors import InputError

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")

START, HOLD = 0.25, np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])


@pytest.fixture(scope="module", params=[0.0, 0.007])
def plan(request):
    return dataclasses.replace(ideal_plan(), passed=request.param)


def times(plan):
    """Before, between and after the samples, and the samples themselves but for rounding."""
    grid = np.append(plan.t[:-1], plan.duration)
    return START + np.concatenate([[-0.25, -0.01], grid, grid[:-1] + 0.006, [plan.duration + 0.1]])


def commands(block, context):
    return [block.GetOutputPort(name).Eval(context) for name in COMMANDS]


def test_it_sends_what_the_mpc_sends(plan):
    ours, mpc = plan_commands(plan, HOLD, START), ModelPredictiveController(lambda: plan, HOLD, START)
    contexts = ours.CreateDefaultContext(), mpc.CreateDefaultContext()
    mpc.set_plan(contexts[1], plan)
    for t in times(plan):
        for context in contexts:
            context.SetTime(t)
        np.testing.assert_allclose(commands(ours, contexts[0]), commands(mpc, contexts[1]), rtol=1e-13, atol=1e-15)
    for name in ("solve_time", "status"):
        assert ours.GetOutputPort(name).Eval(contexts[0]) == mpc.GetOutputPort(name).Eval(contexts[1])


def test_its_slope_over_time_is_the_velocity(plan):
    block = plan_commands(plan, HOLD, START).ToAutoDiffXd()
    context = block.CreateDefaultContext()
    for t in START + plan.t[:-1] + 0.006:
        context.SetTime(AutoDiffXd(t, [1.0]))
        x, v, a = commands(block, context)
        for value, slope in ((x, v), (v, a)):
            found = [e.derivatives()[0] if e.derivatives().size else 0.0 for e in value]
            np.testing.assert_allclose(found, [e.value() for e in slope], rtol=1e-12, atol=1e-12)


def test_one_expression_holds_the_whole_motion(plan):
    block, of_float = plan_commands(plan, HOLD, START).ToSymbolic(), plan_commands(plan, HOLD, START)
    context, other, t = block.CreateDefaultContext(), of_float.CreateDefaultContext(), Variable("t")
    context.SetTime(Expression(t))
    formulas = np.ravel(commands(block, context))
    for moment in times(plan)[::3]:
        other.SetTime(moment)
        values = [formula.Evaluate({t: moment}) for formula in formulas]
        np.testing.assert_allclose(values, np.ravel(commands(of_float, other)), rtol=1e-13, atol=1e-15)


def test_numbers_that_are_no_plan_are_refused():
    states, inputs = np.zeros((3, 6)), np.zeros((2, 3))
    for given, words in (
        ((states[:, :5], inputs, HOLD, 0.1), r"states has shape \(3, 5\)"),
        ((states, inputs[:1], HOLD, 0.1), "one input for each interval"),
        ((states * np.nan, inputs, HOLD, 0.1), "states has entries that are not finite"),
        ((states, inputs, HOLD, 0.0), "sampling_time"),
    ):
        with pytest.raises(InputError, match=words):
            PlanCommands(*given)
