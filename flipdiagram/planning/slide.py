"""Sliding on purpose, eq. (8): an object that slides down a blade held at a constant tilt beyond the friction angle.

On a blade at rest the object slides when tan θ > μ.  Along the tangent s, downwards:  σ̈ = −|g| (sin θ − μ cos θ).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.theory.contact import GRAVITY_Z


@dataclass(frozen=True)
class Slide:
    """An object that starts to slide at rest: tilt θ [rad], friction coefficient μ, way down the blade [m]."""

    tilt: float
    friction: float
    way: float

    def __post_init__(self) -> None:
        if self.acceleration <= 0:
            angle = math.degrees(math.atan(self.friction))
            raise PlanningError(
                f"at a tilt of {math.degrees(self.tilt):.1f} deg nothing slides; valid is above the friction angle,"
                f" {angle:.1f} deg"
            )

    @property
    def acceleration(self) -> float:
        """|σ̈| = |g| (sin θ − μ cos θ) [m/s²]."""
        return -GRAVITY_Z * (math.sin(self.tilt) - self.friction * math.cos(self.tilt))

    @property
    def duration(self) -> float:
        """Time for the way [s]."""
        return math.sqrt(2 * self.way / self.acceleration)

    @property
    def final_speed(self) -> float:
        """Speed along the blade at the end of the way [m/s]."""
        return math.sqrt(2 * self.way * self.acceleration)

    def displacement(self, t: ArrayLike) -> Floats:
        """σ(t) ≤ 0 [m] from the start of sliding at t = 0, held after the way is done."""
        time = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        return np.asarray(-self.acceleration * time**2 / 2, dtype=np.float64)


def tilt_for(friction: float, way: float, speed: float, least: float) -> float:
    """The tilt [rad] at which an object reaches `speed` [m/s] after `way` [m], at least `least` beyond atan μ.

    Solves 2 · way · |g| (sin θ − μ cos θ) = speed²: with ϕ = atan μ, sin(θ − ϕ) = speed² cos ϕ / (2 · way · |g|).
    """
    angle = math.atan(friction)
    ratio = speed**2 * math.cos(angle) / (2 * way * -GRAVITY_Z)
    return angle + max(least, math.asin(min(1.0, ratio)))
