"""Prediction model and cost of the MPC, eqs. (2)–(5) of the paper.

The state is that of the object, x̂ = [y, z, θ, v_y, v_z, v_θ] (3), the input its acceleration (4).  While the object
sticks to the tool both move as one; after the release the object flies with input u = (0, g_z, 0).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.theory.contact import GRAVITY_Z


def transition(sampling_time: float) -> tuple[Floats, Floats]:
    """A (6, 6) and B (6, 3) of eq. (2) for a sampling time ΔT [s]: exact for an acceleration held over ΔT."""
    a = np.eye(6)
    a[:3, 3:] = sampling_time * np.eye(3)
    b = np.vstack([sampling_time**2 / 2 * np.eye(3), sampling_time * np.eye(3)])
    return a, b


@lru_cache(maxsize=256)
def flight(duration: float) -> tuple[Floats, Floats]:
    """Ballistic flight over a duration [s] as x̂(t) = F x̂(0) + f: returns F (6, 6), f (6,), which are read-only."""
    matrix, by_input = transition(duration)
    offset = by_input @ [0.0, GRAVITY_Z, 0.0]
    matrix.flags.writeable = offset.flags.writeable = False
    return matrix, offset


@dataclass(frozen=True)
class LandingCost:
    """The cost J of eq. (5) at touch-down: (θ − π)² + α (y − y_target)² + β (v_y² + v_z²).

    The paper's y counts from the place where the block shall land; here that origin is `target_y` [m].
    """

    alpha: float
    beta: float
    target_y: float = 0.0

    def __call__(self, landing: Floats) -> float:
        """J for the state x̂(k_g) at touch-down, shape (6,)."""
        residual = self.residual_matrix() @ (np.asarray(landing, dtype=float) - self.target())
        return float(residual @ residual)

    def target(self) -> Floats:
        """The landing state at which J = 0."""
        return np.array([self.target_y, 0.0, np.pi, 0.0, 0.0, 0.0])

    def residual_matrix(self) -> Floats:
        """W (4, 6) with J = |W (x̂ − target)|²."""
        w = np.zeros((4, 6))
        w[0, 2] = 1.0
        w[1, 0] = np.sqrt(self.alpha)
        w[2, 3] = w[3, 4] = np.sqrt(self.beta)
        return w
