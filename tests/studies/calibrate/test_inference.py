"""The sampler against posteriors that are known in closed form, and the coverage of its intervals."""

import numpy as np
import pytest

from flipdiagram.studies.calibrate import inference
from flipdiagram.studies.calibrate.inference import (
    Population,
    adjusted,
    covered,
    quantiles,
    rejection,
    sequential,
    step,
)

NOISE = 0.05


def linear(u, rng):
    """Two numbers seen of two unknowns, with noise: u0 + u1 and u0 − u1."""
    mixed = np.column_stack([u[:, 0] + u[:, 1], u[:, 0] - u[:, 1]])
    return mixed + NOISE * rng.standard_normal(mixed.shape)


def exact(seen):
    """Mean and standard deviation of both unknowns given what is seen, far from the faces of the cube."""
    return np.array([(seen[0] + seen[1]) / 2, (seen[0] - seen[1]) / 2]), NOISE / np.sqrt(2)


def test_sequential_sampling_and_rejection_find_the_known_posterior():
    rng, data = np.random.default_rng(3), np.array([1.0, 0.1])
    u = rng.random((3000, 2))
    output = linear(u, rng)
    first = rejection(u, np.linalg.norm(output - data, axis=1), 200)

    def simulate(new):
        seen = linear(new, rng)
        start = sum(map(len, everything))
        everything.append(seen)
        return np.arange(start, start + len(new)), np.linalg.norm(seen - data, axis=1)

    everything = [output]
    population, history = sequential(first, len(u), simulate, 6, rng)
    mean, deviation = exact(data)
    distances = [entry["distance"] for entry in history]
    assert distances == sorted(distances, reverse=True) and distances[-1] < distances[0]
    for found, tolerance in ((population, 0.35), (first, 0.35)):
        shown = np.vstack(everything)[found.index] - data
        moved, weight = adjusted(found, shown)
        low, middle, high = quantiles(moved, weight)
        np.testing.assert_allclose(middle, mean, atol=0.5 * deviation)
        np.testing.assert_allclose((high - low) / (2 * 1.645 * deviation), 1.0, atol=tolerance)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(5)
    u = rng.random((2000, 2))
    output = linear(u, rng)
    inside = np.flatnonzero(np.all(np.abs(u - 0.5) < 0.3, axis=1))[:150]

    def seen_from(k):
        away = output - output[k]
        return np.linalg.norm(away, axis=1), away

    share = covered(u, seen_from, inside, 100).mean()
    assert 0.85 < share < 0.95


def test_what_the_data_say_nothing_of_stays_as_wide_as_its_prior():
    rng = np.random.default_rng(7)
    u = rng.random((2000, 2))
    seen = u[:, :1] + NOISE * rng.standard_normal((2000, 1))
    population = rejection(u, np.abs(seen[:, 0] - 0.4), 200)
    moved, weight = adjusted(population, seen[population.index] - 0.4)
    low, middle, high = quantiles(moved, weight)
    assert middle[0] == pytest.approx(0.4, abs=0.02) and high[0] - low[0] < 0.25
    assert (low[1], high[1]) == pytest.approx((0.05, 0.95), abs=0.05)


def test_new_draws_weigh_as_prior_over_proposal():
    """Weighted with their own weights, draws about a lopsided population are spread evenly again."""
    rng = np.random.default_rng(11)
    old = Population(0.5 + 0.2 * rng.random((400, 1)), np.arange(400), np.zeros(400), np.full(400, 1 / 400))
    u, weight = step(old, 20_000, rng)
    assert u.shape == (20_000, 1) and u.min() >= 0 and u.max() < 1
    near = (u[:, 0] > 0.45) & (u[:, 0] < 0.75)  # where there are draws enough
    counts, _ = np.histogram(u[near, 0], 6, (0.45, 0.75), weights=weight[near])
    np.testing.assert_allclose(counts / counts.mean(), 1.0, atol=0.12)


def test_draws_that_cannot_be_measured_are_never_kept():
    population = rejection(np.random.default_rng(0).random((50, 2)), np.array([np.inf] * 45 + [1.0] * 5), 20)
    assert len(population.u) == 5 and population.index.tolist() == [45, 46, 47, 48, 49]
    assert population.weight.sum() == pytest.approx(1.0) and population.size == pytest.approx(5.0)


def test_weighted_quantiles_are_those_of_repeated_values():
    values, times = np.array([[3.0], [1.0], [2.0], [10.0]]), np.array([2, 5, 3, 1])
    repeated = np.repeat(values[:, 0], times)
    found = quantiles(values, times / times.sum(), (0.25, 0.5, 0.75))
    assert found[1, 0] == pytest.approx(np.median(repeated), abs=0.6)
    assert np.all(np.diff(found[:, 0]) > 0) and found.min() >= 1.0 and found.max() <= 10.0


def test_no_draw_leaves_the_cube():
    rng = np.random.default_rng(2)
    u = rng.random((500, 3))
    seen = 5 * u @ np.ones((3, 1)) + 0.01 * rng.standard_normal((500, 1))
    population = rejection(u, np.abs(seen[:, 0] - 0.01), 60)  # in a corner
    moved, weight = adjusted(population, seen[population.index] - 0.01)
    assert np.all((moved > 0) & (moved < 1)) and weight.sum() == pytest.approx(1.0)
    assert inference.INTERVAL == (0.05, 0.5, 0.95)


def test_draws_too_few_for_the_regression_stay_as_they_are():
    """Fitted to a dozen draws, half a dozen numbers would explain unknowns that they say nothing of."""
    rng = np.random.default_rng(4)
    population = rejection(rng.random((24, 3)), rng.random(24), 12)
    moved, weight = adjusted(population, rng.standard_normal((12, 6)))
    np.testing.assert_array_equal(moved, population.u)
    np.testing.assert_array_equal(weight, population.weight)


def test_a_choice_stays_what_was_flown():
    rng = np.random.default_rng(4)
    u = rng.random((300, 2))
    seen = u.sum(axis=1, keepdims=True) + 0.01 * rng.standard_normal((300, 1))
    population = rejection(u, np.abs(seen[:, 0] - 1.0), 60)
    moved, _ = adjusted(population, seen[population.index] - 1.0, np.array([True, False]))
    np.testing.assert_array_equal(moved[:, 1], population.u[:, 1])
    assert np.abs(moved[:, 0] - population.u[:, 0]).max() > 0.01
