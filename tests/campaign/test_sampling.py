"""Samplers and distributions: what they promise, and the same again for the same seed."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from flipdiagram.campaign.distributions import Distribution, distribution
from flipdiagram.campaign.sampling import grid, points, saltelli, seeds
from flipdiagram.errors import InputError


@pytest.mark.parametrize("trials", [1, 7, 40])
def test_a_latin_hypercube_has_one_point_in_each_stratum_of_each_dimension(trials):
    u = points("lhs", trials, 5, seed=3)
    assert u.shape == (trials, 5)
    for column in u.T:
        assert sorted((column * trials).astype(int)) == list(range(trials))


@pytest.mark.parametrize("trials", [1, 2, 3, 33, 64])
def test_a_sobol_sequence_of_any_length_is_the_beginning_of_the_balanced_one(trials):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # scipy warns where the length is no power of two
        u = points("sobol", trials, 4, seed=3)
    assert u.shape == (trials, 4)
    assert np.array_equal(u, points("sobol", 64, 4, seed=3)[:trials])
    if trials == 64:  # one point in each of 64 strata
        assert all(sorted((column * 64).astype(int)) == list(range(64)) for column in u.T)


@pytest.mark.parametrize("sampler", ["random", "lhs", "sobol"])
def test_a_seed_gives_the_same_points_and_another_seed_others(sampler):
    a, b, c = (points(sampler, 16, 3, seed) for seed in (1, 1, 2))
    assert np.array_equal(a, b) and not np.array_equal(a, c)
    assert ((a >= 0) & (a < 1)).all()


def test_saltellis_design_exchanges_one_column_at_a_time():
    u = saltelli(8, 3, seed=1)
    assert u.shape == (8 * 5, 3)
    a, b, *mixed = u.reshape(5, 8, 3)
    for k, block in enumerate(mixed):
        assert np.array_equal(block[:, k], b[:, k])
        others = [j for j in range(3) if j != k]
        assert np.array_equal(block[:, others], a[:, others])


def test_the_grid_has_every_combination_once():
    u = grid([2, 3])
    assert [tuple((row * [2, 3]).astype(int)) for row in u] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]


def test_every_trial_has_a_seed_of_its_own():
    found = seeds(5, 5000)
    assert len(set(found)) > 4990 and found == seeds(5, 5000) and found != seeds(6, 5000)
    assert all(1 <= seed < 2**31 for seed in found)
    assert found[:10] == seeds(5, 10)


@pytest.mark.parametrize(
    ("data", "reference"),
    [
        ({"uniform": [2, 5]}, stats.uniform(2, 3)),
        ({"loguniform": [0.1, 10]}, stats.loguniform(0.1, 10)),
        ({"normal": [1.0, 0.2]}, stats.norm(1.0, 0.2)),
    ],
)
def test_a_share_of_the_values_lies_below(data, reference):
    drawn = distribution(data)
    u = np.linspace(0.01, 0.99, 25)
    assert [drawn.value(x) for x in u] == pytest.approx(reference.ppf(u), rel=1e-8)
    assert [drawn.position(drawn.value(x)) for x in u] == pytest.approx(u, abs=1e-6)


def test_discrete_values_are_drawn_equally_often():
    drawn = distribution({"integers": [2, 4]})
    values = [drawn.value(u) for u in np.linspace(0, 1, 300, endpoint=False)]
    assert all(type(value) is int for value in values)
    assert [values.count(k) for k in (2, 3, 4)] == [100, 100, 100]
    assert distribution({"choice": ["sap", [1, 2]]}).values == ("sap", (1, 2))


@given(u=st.floats(0, 1, exclude_max=True), low=st.floats(-1e3, 1e3), width=st.floats(1e-3, 1e3))
def test_no_value_is_beyond_the_ends(u, low, width):
    drawn = Distribution("uniform", (low, low + width))
    low, high = drawn.ends()
    assert low <= drawn.value(u) <= high
    clipped = Distribution("normal", (low, width), (low, low + width / 2))
    assert low <= clipped.value(u) <= low + width / 2 + 1e-6


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (5, "uniform"),
        ({}, "uniform"),
        ({"gauss": [1, 2]}, "'gauss' is no distribution"),
        ({"uniform": [1, 2], "normal": [1, 2]}, "one distribution"),
        ({"uniform": [2, 1]}, "low < high"),
        ({"uniform": [1]}, "low < high"),
        ({"uniform": ["a", 1]}, "low < high"),
        ({"uniform": [0, float("inf")]}, "low < high"),
        ({"loguniform": [0, 1]}, "0 < low"),
        ({"normal": [1, 0]}, "above 0"),
        ({"integers": [0.5, 2]}, "whole numbers"),
        ({"choice": []}, "at least one"),
        ({"choice": [1, 1]}, "each once"),
        ({"choice": [1, 2], "clip": [0, 1]}, "does not go with"),
        ({"normal": [0, 1], "clip": [1, 0]}, "clip of normal"),
    ],
)
def test_a_distribution_that_makes_no_sense_is_refused(data, words):
    with pytest.raises(InputError, match=words):
        distribution(data)
