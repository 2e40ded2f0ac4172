"""The MPC's quadratic program without its states, solved by DAQP: the same solution as `HorizonProgram`, sooner.

Eq. (2) makes the decision vector w = d + Γ u a linear function of the accelerations u of the intervals that move, d
being the drift from the start without any.  The smoothing cost ½ uᵀ T u is the same in every solve.  With T = U Uᵀ, U
upper triangular, and v = Uᵀ u it is ½ |v|²; leaving out the first intervals, which wait, leaves out the first columns
of Γ U⁻ᵀ, so one matrix made beforehand serves every horizon.  The landing cost adds ½ |S v + r|² of rank 4: with the
singular values S = P Σ Q the coordinates scaled by (1 + Σ²)^−½ along Q make the whole Hessian the identity.  What is
left for each solve is to multiply the rows by that matrix, and DAQP, which starts without a factorisation.
"""

import math
import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning import dense
from flipdiagram.planning.constraints import Trajectory
from flipdiagram.planning.dense import DenseProgram
from flipdiagram.planning.horizon import INPUTS, STATES, STRIDE, Layout
from flipdiagram.planning.model import LandingCost, flight
from flipdiagram.planning.program import FREE_TRUST, HOLD, LEVERS, TRUST_LENGTH, Solution, hold_of
from flipdiagram.planning.rows import Rows
from flipdiagram.robot.jit import compiled

AXES = 3
CACHED = 32
"""Pairs of contact and flight samples whose matrix is kept, the last ones used; another takes a few tenths of a ms."""


@dataclass(frozen=True)
class Horizon:
    """For one pair of contact and flight samples: w = d + map v, in whose coordinates v the Hessian is the identity.

    The landing residual of eq. (5) is weight · x̂(release) + residual; gradient (4, 3 n) = 2 weight · map(release).
    angles, poses: where θ, and (y, z, θ), of the samples that move stand in w.
    """

    map: Floats
    weight: Floats
    residual: Floats
    gradient: Floats
    angles: Indices
    poses: Indices


class CondensedProgram:
    """min J + smoothing over the horizon in the accelerations alone; `update` and `solve` are `HorizonProgram`'s.

    Each solve depends on the last `update` alone, to the bit: the guess from which it starts is the trajectory about
    which the rows were linearised.  Slacks are not offered: an infeasible program ends with success False.
    """

    def __init__(self, layout: Layout, sampling_time: float, cost: LandingCost, smoothing: float) -> None:
        self.layout, self.sampling_time, self.cost = layout, sampling_time, cost
        self._released = slice(STRIDE * layout.release, STRIDE * layout.release + STATES)
        self._equalities = 1 + (AXES if layout.n_brake else 0)
        """Landing height, and the tool's last velocity where it brakes."""
        self._jumps = smoothing / sampling_time
        self._basis, self._diagonal = unit_smoothing_basis(layout, sampling_time, smoothing)
        self._drift = drift_basis(layout, sampling_time)
        self._lengths = np.tile([TRUST_LENGTH, TRUST_LENGTH, 1.0], layout.intervals)
        self._horizon = lru_cache(CACHED)(self._make_horizon)
        self._current: tuple[Rows, Floats, tuple[Floats, float], Floats] | None = None
        self.program: DenseProgram | None = None
        """What the last update made of its numbers."""
        self._store = np.zeros(0)
        # compiled now, not in the middle of a motion
        none, places, matrix = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 0))
        compiled(condense, sums=True)(places, places, none, matrix, 0, matrix, none)

    def update(self, start: Floats, point: Trajectory, landing: tuple[Floats, float], rows: Rows, trust: float) -> None:
        """New numbers, all as in `HorizonProgram.update`; the waiting samples pass at the start's constant velocity."""
        horizon, drift = self._horizon(point.n_contact, point.n_flight, point.passed), self._drift @ start
        map_, released = horizon.map, self._released
        if point.passed:  # samples after the first that moves come sooner
            drift[horizon.poses.reshape(-1, AXES)] -= point.passed * start[AXES:]
        f = (horizon.weight @ drift[released] + horizon.residual) @ horizon.gradient
        if point.before is not None:
            at = self.layout.u(self.layout.release - point.n_contact, 0)
            f -= 2 * self._jumps * hold_of(point) * (np.square(LEVERS) * point.before) @ map_[at : at + AXES]
        # θ, and y and z once the trust has shrunk, at the samples that move; waiting ones follow from the start
        free = trust >= FREE_TRUST
        at, radius = (horizon.angles, trust) if free else (horizon.poses, trust * self._lengths[: horizon.poses.size])
        equalities = self._equalities
        m = equalities + at.size
        total, n = m + rows.count, map_.shape[1]
        if self._store.size < total * n:  # kept: fresh memory costs as much as what is written into it
            self._store = np.empty(2 * total * n)
        A = self._store[: total * n].reshape(total, n)
        low, high, norm = np.full(total, -np.inf), np.empty(total), np.empty(total)
        A[0], high[0] = landing[0] @ map_[released], landing[1] - landing[0] @ drift[released]
        if equalities > 1:
            A[1:equalities], high[1:equalities] = map_[-AXES:], -drift[-AXES:]
        low[:equalities] = high[:equalities]
        near = point.states[-len(horizon.angles) :, :AXES]
        centre = (near[:, 2] if free else near.ravel()) - drift[at]
        A[equalities:m], low[equalities:m], high[equalities:m] = map_[at], centre - radius, centre + radius
        high[m:] = rows.left(drift)
        compiled(condense, sums=True)(rows.rows, rows.columns, rows.values, map_, m, A, norm)
        slack = np.concatenate([np.zeros(equalities), np.full(at.size, radius) if free else radius, rows.slack])
        self.program = DenseProgram(f, A, low, high, equalities, slack, norm)
        self._current = rows, drift, landing, map_

    def solve(self) -> Solution:
        """Solve with the current numbers; the residual is that of rows, landing height and last velocity, in SI."""
        if self.program is None or self._current is None:
            raise ValueError("solve() needs the numbers of an update() first")
        rows, drift, (row, bound), map_ = self._current
        begin = time.perf_counter()
        minimum = dense.minimise(self.program)
        elapsed = time.perf_counter() - begin
        w = drift + map_ @ minimum.v
        last = map(abs, w[-AXES:].tolist()) if self.layout.n_brake else ()
        missed = max(abs(float(row @ w[self._released]) - bound), *last, 0.0)
        return Solution(
            success=minimum.success,
            w=w,
            slack={},
            status=minimum.status,
            solve_time=elapsed,
            iterations=minimum.iterations,
            residual=max(missed, rows.excess(w)),
        )

    def _begun_inside(self, basis: Floats, first: int, passed: float) -> Floats:
        """The basis where `passed` [s] of the interval `first` are gone and its acceleration is held.

        The first column of U⁻ᵀ is that of the others over U's first number, which alone depends on the hold.
        """
        dt, before = self.sampling_time, self._diagonal[first]
        held = math.sqrt(before**2 + HOLD - 1.0)
        basis = basis.copy()
        basis[:, :AXES] *= before / held
        after = np.arange(self.layout.intervals - first) * dt  # from the end of the interval to the samples after it
        samples = np.arange(first + 1, self.layout.intervals + 1)
        for axis, lever in enumerate(LEVERS):
            unit = lever * held * math.sqrt(2.0 * self._jumps)
            basis[self.layout.x(samples, AXES + axis), axis] -= passed / unit
            sooner = dt**2 / 2 - (dt - passed) ** 2 / 2 + passed * after
            basis[self.layout.x(samples, axis), axis] -= sooner / unit
        return basis

    def _make_horizon(self, n_contact: int, n_flight: int, passed: float) -> Horizon:
        """What depends on contact and flight samples, and on what has passed of the first [s], alone."""
        first = self.layout.release - n_contact
        basis = self._basis[:, INPUTS * first :]
        if passed:
            basis = self._begun_inside(basis, first, passed)
        matrix, offset = flight(n_flight * self.sampling_time)
        weight = self.cost.residual_matrix() @ matrix
        _, sigma, q = np.linalg.svd(np.sqrt(2.0) * weight @ basis[self._released], full_matrices=False)
        map_ = np.ascontiguousarray(basis - (basis @ q.T * (1.0 - 1.0 / np.sqrt(1.0 + sigma**2))) @ q)
        residual = self.cost.residual_matrix() @ (offset - self.cost.target())
        gradient = 2.0 * weight @ map_[self._released]
        samples = np.arange(self.layout.release - n_contact + 1, self.layout.intervals + 1)
        poses = STRIDE * samples[:, None] + np.arange(AXES)
        return Horizon(map_, weight, residual, gradient, poses[:, 2], poses.ravel())


def unit_smoothing_basis(layout: Layout, sampling_time: float, smoothing: float) -> tuple[Floats, Floats]:
    """Γ U⁻ᵀ (size, 3 N): the decision vector by coordinates in which the smoothing cost over all N intervals is ½ |v|².

    Columns 3 k … belong to interval k and those after it: the columns from 3 m on are the basis where the first m
    intervals wait.  With it the diagonal (N,) of U of Σ |Δu|².
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
    for axis, lever in enumerate(LEVERS):
        basis[layout.x(samples, axis), axis::AXES] = places / lever
        basis[layout.x(samples, AXES + axis), axis::AXES] = velocities / lever
        basis[layout.u(intervals, axis), axis::AXES] = accelerations / lever
    return basis, np.diagonal(upper)


def drift_basis(layout: Layout, sampling_time: float) -> Floats:
    """(size, 6): the decision vector of a motion without any acceleration by its first state x̂."""
    basis, k = np.zeros((layout.size, STATES)), np.arange(layout.intervals + 1)
    for axis in range(AXES):
        basis[layout.x(k, axis), axis] = basis[layout.x(k, AXES + axis), AXES + axis] = 1.0
        basis[layout.x(k, axis), AXES + axis] = k * sampling_time
    return basis


def condense(rows: Any, columns: Any, values: Any, map_: Any, first: int, A: Any, norm: Any) -> None:
    """Fill A (m, n) from row `first` on with Σ value · map[column], and the norm (m,) of every row."""
    m, n = A.shape
    for r in range(first, m):
        for j in range(n):
            A[r, j] = 0.0
    for e in range(values.size):
        value, r, column = values[e], first + rows[e], columns[e]
        if value != 0.0:
            for j in range(n):
                A[r, j] += value * map_[column, j]
    for r in range(m):
        total = 0.0
        for j in range(n):
            total += A[r, j] * A[r, j]
        norm[r] = math.sqrt(total)
