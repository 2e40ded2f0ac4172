"""Which parameter matters: by ranks from any sample, and Sobol indices where the sampler was made for them."""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import kruskal, rankdata, sobol_indices, spearmanr

from flipdiagram.arrays import Floats, Indices
from flipdiagram.campaign.dataset import counted, parameters_of
from flipdiagram.flips.outcome import SUCCESS

FEWEST = 8
"""Trials below which nothing is said."""
BINS = 5
"""Into which a parameter's range is cut to see effects that are not monotonic."""
TARGETS = {"success": SUCCESS, "position_rmse_m": "position RMSE", "torque_use": "torque"}
"""Variable of the dataset → what it is called."""


def sensitivities(data: xr.Dataset, architecture: str, target: str) -> list[dict[str, Any]]:
    """For each parameter what it says about a target, the strongest first.

    rho: Spearman's rank correlation with its p-value (null for a parameter that is no number, or a target that never
    varies); explained: share of the variance of the target's ranks that goes with the parameter, corrected for chance.
    """
    part = data.sel(architecture=architecture)
    measured = np.asarray(part[target].values, dtype=float)
    among = counted(part) & np.isfinite(measured)
    entries = [{"parameter": p} | _sensitivity(part[p].values[among], measured[among]) for p in parameters_of(data)]
    return sorted(entries, key=lambda entry: -strength(entry))


def strength(entry: Mapping[str, Any]) -> float:
    """By which parameters are ordered: the larger of rho² and the share explained."""
    return max((entry["rho"] or 0.0) ** 2, entry["explained"] or 0.0)


def strengths(sensitivity: Mapping[str, Any], targets: Collection[str]) -> dict[str, float]:
    """Parameter → its strength, summed over the architectures of a summary's sensitivity and some targets."""
    total: dict[str, float] = {}
    for entry in (entry for by_target in sensitivity.values() for target in targets for entry in by_target[target]):
        total[entry["parameter"]] = total.get(entry["parameter"], 0.0) + strength(entry)
    return total


def chance(trials: int) -> float:
    """Share of the variance of ranks that a parameter without any effect stays below in 95 % of campaigns."""
    return min(3.84 / max(trials - 1, 1), 1.0)


def _sensitivity(values: np.ndarray, target: Floats) -> dict[str, Any]:
    if len(target) < FEWEST or np.ptp(target) == 0 or len(set(values.tolist())) < 2:
        return {"rho": None, "p": None, "explained": None}
    share = explained(groups_of(values), target)
    if values.dtype.kind != "f":
        return {"rho": None, "p": None, "explained": share}
    result = spearmanr(values, target)
    return {"rho": float(result.statistic), "p": float(result.pvalue), "explained": share}


def groups_of(values: np.ndarray) -> Indices:
    """The group of each value: itself where there are few, else its fifth of the range of ranks."""
    distinct, index = np.unique(values, return_inverse=True)
    if len(distinct) <= BINS or values.dtype.kind != "f":
        return np.asarray(index, dtype=np.int64)
    ranks = (rankdata(values) - 0.5) / len(values)
    return np.minimum((ranks * BINS).astype(np.int64), BINS - 1)


def explained(groups: Indices, target: Floats) -> float:
    """Share of the variance of the target's ranks between groups, less what chance would give (ε² of Kelley)."""
    members = [target[groups == group] for group in np.unique(groups)]
    freedom = len(target) - len(members)
    # Kruskal and Wallis's H is (n - 1) times the share between groups
    return max((float(kruskal(*members).statistic) - len(members) + 1) / freedom, 0.0) if freedom else 0.0


def sobol(data: xr.Dataset, architecture: str) -> list[dict[str, Any]] | None:
    """First and total Sobol indices of success; None unless every trial of a saltelli campaign counts."""
    names = parameters_of(data)
    if data.attrs["sampler"] != "saltelli" or data.sizes["trial"] != data.attrs["trials"]:
        return None
    part = data.sel(architecture=architecture)
    if not counted(part).all():
        return None
    won = part["success"].values.astype(float)
    n = len(won) // (len(names) + 2)
    if np.ptp(won) == 0 or not math.log2(n).is_integer():
        return None
    blocks = won.reshape(len(names) + 2, 1, n)
    result = sobol_indices(func={"f_A": blocks[0], "f_B": blocks[1], "f_AB": blocks[2:]}, n=n)
    indices = zip(names, np.ravel(result.first_order), np.ravel(result.total_order), strict=True)
    return [{"parameter": name, "first": float(first), "total": float(total)} for name, first, total in indices]
