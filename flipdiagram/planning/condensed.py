"""The MPC's quadratic program without its states, solved by DAQP: the same solution as `HorizonProgram`, sooner.

Eq. (2) makes the decision vector w = d + Γ u a linear function of the accelerations u of the intervals that move, d
being the drift from the start without any.  The smoothing cost ½ uᵀ T u is the same in every solve.  With T = U Uᵀ, U
upper triangular, and v = Uᵀ u it is ½ |v|²; leaving out the first intervals, which wait, leaves out the first columns
of Γ U⁻ᵀ, so one matrix made beforehand serves every horizon.  The landing cost adds ½ |S v + r|² of rank 4: with the
singular values S = P Σ Q the coordinates scaled by (1 + Σ²)^−½ along Q make the whole Hessian the identity.  What is
left for each solve is to multiply the rows by that matrix, and DAQP, which starts without a factorisation.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.planning import active_set
from flipdiagram.planning.horizon import INPUTS, STATES, STRIDE, Layout
from flipdiagram.planning.model import LandingCost, flight
from flipdiagram.planning.native import condensing as kernels
from flipdiagram.planning.native.condensing import AXES
from flipdiagram.planning.program import FREE_TRUST, TRUST_LENGTH, TURNING_RADIUS, Solution
from flipdiagram.planning.rows import Rows

CACHED = 32
"""Pairs of contact and flight samples whose matrix is kept, the last ones used; another takes a few tenths of a ms."""


@dataclass(frozen=True)
class Horizon:
    """For one pair of contact and flight samples: w = d + map v, in whose coordinates v the Hessian is the identity.

    The landing residual of eq. (5) is weight · x̂(release) + residual; gradient (4, 3 n) = 2 weight · map(release).
    """

    map: Floats
    weight: Floats
    residual: Floats
    gradient: Floats


class CondensedProgram:
    """min J + smoothing over the horizon in the accelerations alone; `update` and `solve` are `HorizonProgram`'s.

    Each solve depends on the last `update` alone, to the bit: the guess from which it starts is the trajectory about
    which the rows were linearised.  Slacks are not offered: an infeasible program ends with success False.  Raises
    InputError where the package daqp is missing.
    """

    def __init__(self, layout: Layout, sampling_time: float, cost: LandingCost, smoothing: float) -> None:
        active_set.load_daqp()
        kernels.compiled()  # not in the middle of a motion
        self.layout, self.sampling_time, self.cost = layout, sampling_time, cost
        self._released = STRIDE * layout.release
        self._basis = unit_smoothing_basis(layout, sampling_time, smoothing)
        self._horizons: OrderedDict[tuple[int, int], Horizon] = OrderedDict()
        self._drift, self._guess = np.zeros(layout.size), np.zeros(layout.size)
        self._entries = Rows().entries()
        self._landing: tuple[Floats, float] = (np.zeros(STATES), 0.0)
        self._map = np.zeros((layout.size, 0))
        self._store = np.zeros(0)
        self._problem: tuple[Floats, Floats, Floats, Floats, int, Floats] | None = None

    def update(
        self,
        start: Floats,
        n_contact: int,
        n_flight: int,
        landing: tuple[Floats, float],
        rows: Rows,
        near: Floats,
        trust: float,
    ) -> None:
        """New numbers: start (6,), horizon, landing row on x̂(release) and its bound, rows, trust about `near`.

        All as in `HorizonProgram.update`; the waiting samples pass at the start's constant velocity.
        """
        layout, loops, first = self.layout, kernels.compiled(), self.layout.release - n_contact
        horizon = self._horizon(n_contact, n_flight)
        start, near = np.ascontiguousarray(start, dtype=float), np.ascontiguousarray(near, dtype=float)
        loops.drift_and_guess(start, near, first, self.sampling_time, self._drift, self._guess)
        released = self._drift[self._released : self._released + STATES]
        f = (horizon.weight @ released + horizon.residual) @ horizon.gradient

        entries, moving = rows.entries(), layout.intervals - first
        most, n = kernels.EQUALITIES + AXES * moving + rows.count, horizon.map.shape[1]
        if self._store.size < most * n:  # kept: fresh memory costs as much as what is written into it
            self._store = np.empty(2 * most * n)
        A, low, high, slack = self._store[: most * n].reshape(most, n), np.empty(most), np.empty(most), np.empty(most)
        length = trust * TRUST_LENGTH if trust < FREE_TRUST else np.inf
        row = np.ascontiguousarray(landing[0], dtype=float)
        count = loops.condense(
            *entries,
            horizon.map,
            self._drift,
            self._guess,
            near,
            np.array([length, length, trust]),
            first,
            self._released,
            row,
            float(landing[1]),
            A,
            low,
            high,
            slack,
        )
        self._problem = (f, A[:count], low[:count], high[:count], kernels.EQUALITIES, slack[:count])
        self._entries, self._landing, self._map = entries, (row, float(landing[1])), horizon.map

    def solve(self) -> Solution:
        """Solve with the current numbers; the residual is that of rows, landing height and last velocity, in SI."""
        if self._problem is None:
            raise ValueError("solve() needs the numbers of an update() first")
        begin = time.perf_counter()
        found = active_set.minimise(*self._problem)
        elapsed = time.perf_counter() - begin
        w = self._drift + self._map @ found.v
        row, bound = self._landing
        missed = abs(float(row @ w[self._released : self._released + STATES]) - bound)
        missed = max(missed, *map(abs, w[-AXES:].tolist()))
        return Solution(
            success=found.success,
            w=w,
            slack={},
            status=found.status,
            solve_time=elapsed,
            iterations=found.iterations,
            residual=max(missed, float(kernels.compiled().excess(*self._entries[:3], self._entries[3].copy(), w))),
        )

    def _horizon(self, n_contact: int, n_flight: int) -> Horizon:
        """What depends on contact and flight samples alone."""
        key = (n_contact, n_flight)
        if key not in self._horizons:
            basis = self._basis[:, INPUTS * (self.layout.release - n_contact) :]
            matrix, offset = flight(n_flight * self.sampling_time)
            weight = self.cost.residual_matrix() @ matrix
            landed = slice(self._released, self._released + STATES)
            _, sigma, q = np.linalg.svd(np.sqrt(2.0) * weight @ basis[landed], full_matrices=False)
            map_ = basis - (basis @ q.T * (1.0 - 1.0 / np.sqrt(1.0 + sigma**2))) @ q
            residual = self.cost.residual_matrix() @ (offset - self.cost.target())
            self._horizons[key] = Horizon(np.ascontiguousarray(map_), weight, residual, 2.0 * weight @ map_[landed])
            if len(self._horizons) > CACHED:
                self._horizons.popitem(last=False)
        self._horizons.move_to_end(key)
        return self._horizons[key]


def unit_smoothing_basis(layout: Layout, sampling_time: float, smoothing: float) -> Floats:
    """Γ U⁻ᵀ (size, 3 N): the decision vector by coordinates in which the smoothing cost over all N intervals is ½ |v|².

    Columns 3 k … belong to interval k and those after it: the columns from 3 m on are the basis where the first m
    intervals wait.
    """
    n, dt = layout.intervals, sampling_time
    # of Σ |Δu|²: tridiagonal; its trailing blocks are those of shorter motions, and so are U's
    gram = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    upper = np.linalg.cholesky(gram[::-1, ::-1])[::-1, ::-1]
    accelerations = np.linalg.inv(upper).T / np.sqrt(2.0 * smoothing / dt)
    k, j = np.arange(n + 1)[:, None], np.arange(n)
    velocities = np.where(j < k, dt, 0.0) @ accelerations
    places = np.where(j < k, (k - j - 0.5) * dt**2, 0.0) @ accelerations
    basis, samples, intervals = np.zeros((layout.size, AXES * n)), np.arange(n + 1), np.arange(n)
    for axis, lever in enumerate((1.0, 1.0, TURNING_RADIUS)):
        basis[layout.x(samples, axis), axis::AXES] = places / lever
        basis[layout.x(samples, AXES + axis), axis::AXES] = velocities / lever
        basis[layout.u(intervals, axis), axis::AXES] = accelerations / lever
    return basis
