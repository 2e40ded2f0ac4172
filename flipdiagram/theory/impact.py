"""A mass that meets a spring: how much of its speed comes back, under two laws of damping.

* Hunt and Crossley, f = k x (1 + d ẋ): a mass that comes with v leaves with e v, where with w = d v
  w - ln(1 + w) = -e w - ln(1 - e w), the work in and out (K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42, 440, 1975).
* A linear damper, f = k x + 2 ζ √(k m) ẋ, that cannot pull: e = exp(-2 ζ / s · atan2(s, ζ)), s = √(1 - ζ²).

Neither depends on mass or stiffness.
"""

import math

from scipy.optimize import brentq


def restitution(dissipation: float, speed: float) -> float:
    """Speed after over speed before, 0 to 1, of a blow of `speed` [m/s] against Hunt and Crossley's spring, d [s/m]."""
    w = dissipation * speed
    if w < 1e-3:  # where the logarithm rounds
        return 1.0 - 2.0 / 3.0 * w
    work = w - math.log1p(w)
    exponent = brentq(lambda y: y + math.expm1(-y) - work, 0.0, work + 1.0)  # e w = 1 - exp(-y)
    return -math.expm1(-float(exponent)) / w


def damping_ratio(restitution: float) -> float:
    """ζ, 0 to 1, of the linear damper behind which a blow comes back with that share of its speed.

    1 for less than e^-2 of it, where no such damper swings back.
    """
    if restitution <= math.exp(-2.0):
        return 1.0
    return float(brentq(lambda zeta: _after(zeta) - restitution, 0.0, 1.0 - 1e-12))


def _after(zeta: float) -> float:
    root = math.sqrt(1.0 - zeta**2)
    return math.exp(-2.0 * zeta / root * math.atan2(root, zeta))
