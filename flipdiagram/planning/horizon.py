"""Layout of the horizon: where each quantity of the motion stands in the vector of decision variables.

Samples 0 … N of the tool carry x̂ (6), the intervals between them the acceleration u (3).  The release is always
sample `release` = the largest number of contact samples, so a shorter contact phase is a later departure: the first
`release − n_contact` intervals wait at rest.  One program thus serves every horizon of the search.
"""

from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats, Indices

STATES, INPUTS = 6, 3
STRIDE = STATES + INPUTS
# typical magnitudes of [y, z, θ, v_y, v_z, v_θ, a_y, a_z, a_θ]: an interior-point solver needs them near one
UNITS = np.array([0.3, 0.3, 2.0, 1.0, 1.0, 5.0, 10.0, 10.0, 100.0])


@dataclass(frozen=True)
class Layout:
    """Indices into the decision vector [x̂_0, u_0, x̂_1, u_1, …, x̂_N] for N = release + n_brake."""

    release: int
    n_brake: int

    @property
    def intervals(self) -> int:
        """Number of intervals N."""
        return self.release + self.n_brake

    @property
    def size(self) -> int:
        """Number of decision variables of the motion."""
        return STRIDE * self.intervals + STATES

    def x(self, sample: int | Indices, component: int) -> Indices:
        """Column of component 0…5 of x̂ at samples."""
        return np.asarray(STRIDE * np.asarray(sample) + component)

    def u(self, interval: int | Indices, component: int) -> Indices:
        """Column of component 0…2 of u in intervals."""
        return np.asarray(STRIDE * np.asarray(interval) + STATES + component)

    def units(self) -> Floats:
        """Magnitude of each decision variable, shape (size,): the program works on variables divided by it."""
        return np.append(np.tile(UNITS, self.intervals), UNITS[:STATES])

    def pack(self, states: Floats, inputs: Floats) -> Floats:
        """The decision vector of states (N + 1, 6) and inputs (N, 3), in SI."""
        w = np.empty(self.size)
        body = w[: STRIDE * self.intervals].reshape(self.intervals, STRIDE)
        body[:, :STATES], body[:, STATES:] = states[:-1], inputs
        w[STRIDE * self.intervals :] = states[-1]
        return w

    def unpack(self, w: Floats) -> tuple[Floats, Floats]:
        """States (N + 1, 6) and inputs (N, 3) from a decision vector in SI."""
        body = w[: STRIDE * self.intervals].reshape(self.intervals, STRIDE)
        states = np.vstack([body[:, :STATES], w[STRIDE * self.intervals : self.size]])
        return states, body[:, STATES:].copy()
