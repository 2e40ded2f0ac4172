"""sin, cos, exp and tanh of the compiled diagrams against 80-bit arithmetic, and at the ends of what they cover."""

import numpy as np
import pydrake.symbolic as ds
import pytest
from pydrake.symbolic import Variable
from sampled_diagrams import expressions_block, single

from flipdiagram.compiled import compile_diagram
from flipdiagram.compiled.functions import EXP_REACH, REACH

FUNCTIONS = {"sin": 1.7, "cos": 1.7, "exp": 1.1, "tanh": 2.7}
"""Name -> units in the last place that it may be wrong by."""
LARGEST = {"sin": REACH, "cos": REACH, "exp": EXP_REACH, "tanh": 800.0}
RNG = np.random.default_rng(7)
WIDE = np.exp(RNG.uniform(-700.0, np.log(REACH), 200_000)) * RNG.choice([-1.0, 1.0], 200_000)
QUARTERS = np.arange(1, 100_000) * (np.pi / 2)
ARGUMENTS = {
    "dense": np.linspace(-12.0, 12.0, 200_001),
    "random": RNG.uniform(-1e5, 1e5, 200_000),
    "up to the reach": np.r_[RNG.uniform(-REACH, REACH, 100_000), RNG.uniform(-EXP_REACH, EXP_REACH, 100_000)],
    "of every size": WIDE,
    "near multiples of pi/2": np.r_[QUARTERS, np.nextafter(QUARTERS, 0.0), np.nextafter(QUARTERS, np.inf)],
    "near changes of the rounded quotient": np.r_[
        (np.arange(20_000) + 0.5) * (np.pi / 2), (np.arange(2000) - 999.5) * np.log(2.0)
    ],
}


@pytest.fixture(scope="module")
def values():
    """What maps arguments (n,) to (n, 4), a column for each of the functions."""
    x = Variable("x")
    outputs = [getattr(ds, name)(x) for name in FUNCTIONS]
    compiled = compile_diagram(single(expressions_block(outputs, [x], [0.5 * x])))
    return lambda arguments: compiled.run(0, state=np.asarray(arguments)[:, None]).outputs["out0"]


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long double is no longer than double here")
@pytest.mark.parametrize("kind", ARGUMENTS)
def test_errors_in_units_in_the_last_place(values, kind):
    x = ARGUMENTS[kind]
    for column, found in enumerate(values(x).T):
        name = list(FUNCTIONS)[column]
        covered = abs(x) <= LARGEST[name]
        true = getattr(np, name)(x[covered].astype(np.longdouble))
        unit = np.spacing(abs(true).astype(float)).astype(np.longdouble)
        assert (abs(found[covered].astype(np.longdouble) - true) / unit).max() <= FUNCTIONS[name]


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
def test_zeros_infinities_nan_and_arguments_beyond_the_reach():
    x = Variable("x")
    outputs = [getattr(ds, name)(x) for name in FUNCTIONS]
    odd = np.array([0.0, -0.0, np.inf, -np.inf, 1e300, -1e10, 2.0 * REACH, 720.0, -720.0, -744.0, 5e-324, -1e-310])
    exact, own = (
        compile_diagram(single(expressions_block(outputs, [x], [0.5 * x])), exact=how)
        .run(0, state=odd[:, None])
        .outputs["out0"]
        for how in (True, False)
    )
    np.testing.assert_allclose(own, exact, rtol=5e-16, atol=0.0)
    assert (np.signbit(own) == np.signbit(exact))[np.arange(len(odd)) != 1].all()  # sin(-0.0) is 0.0
    assert np.isnan(own[2:4, :2]).all()


def test_a_channel_does_not_see_what_its_neighbours_arguments_are(values):
    x = RNG.uniform(-700.0, 700.0, 64)
    alone = values(x)
    for stranger in (np.inf, np.nan, 1e200, -800.0):
        mixed = x.copy()
        mixed[::3] = stranger
        kept = np.arange(64) % 3 != 0
        assert (values(mixed)[kept] == alone[kept]).all()
    assert np.isnan(values([np.nan, 1.0])[0]).all()
