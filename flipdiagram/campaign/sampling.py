"""Points in the unit cube, one row a trial: grid, Latin hypercube, Sobol, Saltelli's design for Sobol indices."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import qmc

from flipdiagram.arrays import Floats


def points(sampler: str, trials: int, dimensions: int, seed: int) -> Floats:
    """Shape (trials, dimensions), each in [0, 1); the same for the same arguments.  Not for the grid."""
    if dimensions == 0:
        return np.zeros((trials, 0))
    if sampler == "random":
        return np.random.default_rng(seed).random((trials, dimensions))
    if sampler == "lhs":
        return qmc.LatinHypercube(dimensions, rng=seed).random(trials)
    if sampler == "sobol":
        # drawn to the next power of two, where the sequence is balanced; a shorter campaign is its beginning
        return qmc.Sobol(dimensions, rng=seed).random_base2(math.ceil(math.log2(trials)) if trials > 1 else 0)[:trials]
    return saltelli(trials // (dimensions + 2), dimensions, seed)


def saltelli(n: int, dimensions: int, seed: int) -> Floats:
    """Rows A, B, then for each dimension A with that column from B: n (dimensions + 2) rows; n a power of two."""
    both = qmc.Sobol(2 * dimensions, rng=seed).random_base2(round(math.log2(n)))
    a, b = both[:, :dimensions], both[:, dimensions:]
    mixed = [np.where(np.arange(dimensions) == k, b, a) for k in range(dimensions)]
    return np.concatenate([a, b, *mixed])


def grid(counts: Sequence[int]) -> Floats:
    """Every combination of `counts` values, the last changing fastest; each at the middle of its share."""
    steps = [[(k + 0.5) / count for k in range(count)] for count in counts]
    return np.array(list(itertools.product(*steps)), dtype=float).reshape(math.prod(counts), len(counts))


def seeds(seed: int, trials: int) -> list[int]:
    """A seed of its own for each trial, of 31 bits, from the campaign's."""
    state = np.random.SeedSequence(seed).generate_state(trials, np.uint32)
    return [int(value) % 2147483646 + 1 for value in state]
