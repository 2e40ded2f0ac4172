"""Approximate Bayesian computation in the unit cube: which unknowns make a simulator's output like the data.

The prior is uniform there; `campaign.distributions` maps the cube to the unknowns.  Rejection keeps the nearest of what
the prior gave; the sequential sampler goes on about those (adaptive population Monte Carlo: Lenormand, Jabot, Deffuant,
Computational Statistics & Data Analysis 2013).  Both are corrected by local linear regression (Beaumont, Zhang,
Balding, Genetics 162, 2002).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats

EDGE = 1e-3
"""Distance from a face of the cube up to which logit(u) is followed."""
DRAWS_PER_NUMBER = 5
"""Draws for each coefficient of the regression, at least: fewer are fitted so well that their intervals vanish."""
KERNEL = 2.0
"""Covariance of a step over the population's."""
INTERVAL = (0.05, 0.5, 0.95)
"""Quantiles that are reported."""


@dataclass(frozen=True)
class Population:
    """Draws u (n, d) of the cube, which simulations they are (n,), their distances (n,) and weights (n,), sum 1."""

    u: Floats
    index: np.ndarray
    distance: Floats
    weight: Floats

    @property
    def size(self) -> float:
        """Effective number of draws, 1 / Σ w²."""
        return float(1.0 / np.sum(self.weight**2)) if self.weight.size else 0.0

    def nearest(self, count: int) -> "Population":
        """The `count` draws nearest to the data, none that is infinitely far, their weights scaled to the sum 1."""
        order = np.argsort(self.distance, kind="stable")[:count]
        order = order[np.isfinite(self.distance[order])]
        weight = self.weight[order]
        return Population(self.u[order], self.index[order], self.distance[order], weight / max(weight.sum(), 1e-300))


def rejection(u: Floats, distance: Floats, count: int) -> Population:
    """The `count` nearest of draws u (n, d) from the prior."""
    n = len(u)
    return Population(u, np.arange(n), distance, np.full(n, 1.0 / n)).nearest(count)


def step(population: Population, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """`count` new draws about a population, and their weights up to a factor: prior over proposal."""
    d = population.u.shape[1]
    spread = KERNEL * np.atleast_2d(np.cov(population.u.T, aweights=population.weight, ddof=0)) + 1e-9 * np.eye(d)
    root = np.linalg.cholesky(spread)
    new = np.empty((0, d))
    while len(new) < count:
        chosen = rng.choice(len(population.u), 2 * count, p=population.weight)
        moved = population.u[chosen] + rng.standard_normal((2 * count, d)) @ root.T
        new = np.vstack([new, moved[np.all((moved >= 0) & (moved < 1), axis=1)]])
    new = new[:count]
    away = np.linalg.solve(root, (new[:, None, :] - population.u[None, :, :]).reshape(-1, d).T).T
    density = np.exp(-0.5 * np.sum(away**2, axis=1)).reshape(count, -1) @ population.weight
    return new, 1.0 / np.maximum(density, 1e-300)


def sequential(
    first: Population,
    drawn: int,
    simulate: Callable[[Floats], tuple[np.ndarray, Floats]],
    rounds: int,
    rng: np.random.Generator,
    least: float = 0.05,
) -> tuple[Population, list[dict[str, float]]]:
    """Adaptive population Monte Carlo: `rounds` times as many new draws as the population has, keeping the nearest.

    Args:
        first: the nearest of `drawn` draws from the prior.
        drawn: how many those were.
        simulate: (index, distance) of new draws u.
        rounds: at most so many; fewer where less than a share `least` of the new draws are nearer than the last kept.
        rng: of the draws.
        least: see rounds.

    Returns the population, and of each round its largest distance, effective size and share of new draws kept.
    """
    population, history = first, [_state(first, len(first.u) / max(drawn, 1))]
    for _ in range(rounds):
        count = len(population.u)
        u, weight = step(population, count, rng)
        index, distance = simulate(u)
        # both parts estimate the same density with `count` draws each
        scale = np.mean(weight)
        both = Population(
            np.vstack([population.u, u]),
            np.concatenate([population.index, index]),
            np.concatenate([population.distance, distance]),
            np.concatenate([population.weight * count, weight / scale]) / (2 * count),
        )
        limit = population.distance.max(initial=0.0)
        population = both.nearest(count)
        share = float(np.mean(distance < limit))
        history.append(_state(population, share))
        if share < least:
            break
    return population, history


def _state(population: Population, share: float) -> dict[str, float]:
    return {"distance": float(population.distance.max(initial=0.0)), "size": population.size, "kept": share}


def adjusted(population: Population, deviation: Floats, smooth: np.ndarray | None = None) -> tuple[Floats, Floats]:
    """Draws and weights after local linear regression: each moved to where the data are met exactly.

    deviation (n, s): of the simulated numbers from the data.  smooth (d,): which unknowns are numbers, by default all;
    a choice stays what was flown.  logit(u) is regressed on it with Epanechnikov's weights in the distance, so that no
    draw leaves the cube; with too few draws for that they stay as they are.
    """
    u, weight = population.u, population.weight
    if len(u) < DRAWS_PER_NUMBER * (deviation.shape[1] + 1):
        return u, weight
    reach = population.distance.max() * (1 + 1e-9)
    weight = weight * (1 - (population.distance / reach) ** 2 if reach > 0 else 1.0)
    weight = weight / weight.sum()
    inside = np.clip(u, EDGE, 1 - EDGE)
    theta = np.log(inside / (1 - inside))
    design = np.column_stack([np.ones(len(u)), deviation])
    root = np.sqrt(weight)[:, None]
    slope = np.linalg.lstsq(design * root, theta * root, rcond=None)[0][1:]
    moved = 1.0 / (1.0 + np.exp(-(theta - deviation @ slope)))
    return np.where(True if smooth is None else smooth, moved, u), weight


def quantiles(values: Floats, weight: Floats, at: tuple[float, ...] = INTERVAL) -> Floats:
    """Weighted quantiles (len(at), d) of values (n, d), the weights at the middle of their steps."""
    values = np.atleast_2d(values.T).T
    found = np.empty((len(at), values.shape[1]))
    for k, column in enumerate(values.T):
        order = np.argsort(column, kind="stable")
        share = np.cumsum(weight[order]) - weight[order] / 2
        found[:, k] = np.interp(at, share, column[order])
    return found


def covered(
    u: Floats,
    deviation_from: Callable[[int], tuple[Floats, Floats]],
    worlds: np.ndarray,
    count: int,
    smooth: np.ndarray | None = None,
) -> Floats:
    """Whether the 90 % intervals hold the truth, (worlds, d): each world's own output is the data for all others.

    deviation_from(k): distances (n,) and deviations (n, s) of all simulations from those of k; smooth: see `adjusted`.
    """
    found = np.zeros((len(worlds), u.shape[1]))
    for row, k in enumerate(worlds):
        distance, deviation = deviation_from(int(k))
        others = np.arange(len(u)) != k
        population = rejection(u[others], distance[others], count)
        moved, weight = adjusted(population, deviation[others][population.index], smooth)
        low, _, high = quantiles(moved, weight)
        found[row] = (low <= u[k]) & (u[k] <= high)
    return found
