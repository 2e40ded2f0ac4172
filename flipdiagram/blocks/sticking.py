"""Friction that sticks: a bristle that bends before a joint slides, and breaks away above the sliding friction."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks._scalars import maximum, minimum
from flipdiagram.blocks.block import Block, convertible


def next_deflection(z: Array, qd: Array, breakaway: Array, v_s: Array, presliding: Array, period: float) -> Array:
    """z[k+1] = min(max(z[k] + T qd, -z_ss), z_ss) [rad], shapes (n,): exact for a speed held over T, the `period` [s].

    It solves z' = qd (1 - alpha sgn(qd) z / z_ss(qd)) of Dupont, Hayward, Armstrong, Altpeter, "Single state
    elasto-plastic friction models", IEEE Trans. Automatic Control 47 (2002), for an alpha that is 0 where |z| < z_ss or
    where the bristle straightens, and 1 at z_ss: all presliding is elastic, so no load below the breakaway moves the
    joint for good, also none that oscillates; in the LuGre model, alpha = 1, such a one does.

    z_ss(qd) = presliding (1 + (breakaway - 1) exp(-(qd / v_s)^2)) / breakaway is the Stribeck curve over the stiffness.
    """
    z_ss = presliding * (1.0 + (breakaway - 1.0) * np.exp(-((qd / v_s) ** 2))) / breakaway
    return minimum(maximum(z + period * qd, -z_ss), z_ss)


def sticking_torque(
    z: Array,
    after: Array,
    qd: Array,
    tau_c: Array,
    breakaway: Array,
    d: Array,
    presliding: Array,
    sigma_1: Array,
    period: float,
) -> Array:
    """tau_friction = -(sigma_0 z[k+1] + sigma_1 w + d qd) [N m], sigma_0 = tau_c breakaway / presliding; shapes (n,).

    `after` is z[k+1], see `next_deflection`; with z[k] in its place the stuck joint would swing up, as by the explicit
    Euler method.  w = (z[k+1] - z[k]) / T as far as it has the direction of qd, else 0: in the published models the
    term sigma_1 z' drives the joint while the bristle relaxes after a breakaway, and so creates energy (Barabanov,
    Ortega, "Necessary and sufficient conditions for passivity of the LuGre friction model", IEEE Trans. Automatic
    Control 45, 2000).
    """
    w = minimum(maximum((after - z) / period, minimum(qd, 0.0 * qd)), maximum(qd, 0.0 * qd))
    return -(tau_c * breakaway / presliding * after + sigma_1 * w + d * qd)


def presliding_damping(tau_b: ArrayLike, presliding: ArrayLike, inertia: ArrayLike) -> Array:
    """sigma_1 = sqrt(sigma_0 J) [N m s/rad], sigma_0 = tau_b / presliding: a damping ratio of 1/2 while a joint sticks.

    `tau_b` [N m], `presliding` [rad], inertia J [kg m^2] felt at each joint: shape (n,) or one number.
    """
    level = channels("tau_b", tau_b)
    return np.sqrt(
        level / channels("presliding", presliding, level.size, strict=True) * channels("J", inertia, level.size)
    )


def stable_presliding(tau_b: ArrayLike, d: ArrayLike, inertia: ArrayLike, step: float) -> Array:
    """Smallest presliding displacement [rad] at which explicit steps of `step` h [s] are stable, with a margin of 2.

    A stuck joint of inertia J follows J (v[k+1] - v[k]) = -h (sigma_0 z[k+1] + (sigma_1 + d) v[k]), z[k+1] = z[k] +
    h v[k], which is stable where a + 2 b < 4 for a = h^2 sigma_0 / J, b = h (sigma_1 + d) / J (Jury's criterion at
    -1).  Here a + 2 b <= 2, with sigma_1 of `presliding_damping`: a <= (sqrt(3 - 2 h d / J) - 1)^2.  Joints that are
    coupled by a mass matrix M are stable together where M - diag(J) is positive semidefinite.

    Infinite where h d >= J: the viscous friction alone is too strong for the step.
    """
    level = channels("tau_b", tau_b)
    J = channels("inertia", inertia, level.size, strict=True)
    rest = 3.0 - 2.0 * channels("step", step, 1, strict=True) * channels("d", d, level.size) / J
    most = np.square(np.sqrt(np.maximum(rest, 1.0)) - 1.0)
    with np.errstate(divide="ignore"):
        return np.where(most > 0.0, step**2 * level / J / most, np.inf)


@convertible()
class ElastoPlasticFriction(Block):
    """Friction of n joints that stick below tau_b = breakaway tau_c and slide above it, see `sticking_torque`.

    The state z, the bristles' deflection [rad], starts at 0: unloaded.  They store sigma_0 z^2 / 2 [J], over each
    period at most the work -tau_friction qd T that the motion puts in.

    Numeric parameters of the Context, one number per joint: Coulomb torque `tau_c` [N m] >= 0, `breakaway` [1] >= 1,
    viscous `d` [N m s/rad] >= 0, Stribeck velocity `v_s` [rad/s] > 0, `presliding` displacement at the breakaway [rad]
    > 0, damping `sigma_1` [N m s/rad] >= 0 of the bristles; `period`, the plant's step, and `offset` in [s].
    Input `qd` [rad/s], which feeds through, output `tau_friction` [N m]: shape (n,).
    """

    def __init__(
        self,
        tau_c: ArrayLike,
        breakaway: ArrayLike,
        d: ArrayLike,
        v_s: ArrayLike,
        presliding: ArrayLike,
        sigma_1: ArrayLike,
        period: float,
        offset: float = 0.0,
    ) -> None:
        n = self.parameter("tau_c", tau_c)
        self.parameter("breakaway", breakaway, n, minimum=1.0)
        self.parameter("d", d, n)
        self.parameter("v_s", v_s, n, strict=True)
        self.parameter("presliding", presliding, n, strict=True)
        self.parameter("sigma_1", sigma_1, n)
        self.input("qd", n)
        self.state("z", n)
        self.period = period  # which the law below takes
        self.intermediate("after", next_deflection)
        self.update(lambda after: after, period, offset)
        self.output("tau_friction", n, sticking_torque)
