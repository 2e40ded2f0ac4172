"""The plant of section III: a mass on one degree of freedom, m ẍ = f + m g_z + f_friction, stepped exactly."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import sampling
from flipdiagram.blocks._scalars import choose, sign
from flipdiagram.blocks.block import Block, convertible
from flipdiagram.errors import InputError
from flipdiagram.theory.contact import GRAVITY_Z

Friction = Literal["none", "signum", "stick-slip"]
FRICTIONS: tuple[Friction, ...] = ("none", "signum", "stick-slip")
LARGEST_DAMPING = 1e-3
"""Largest d T/m: the damper's exponentials are short series, exact to rounding up to here."""


def held_step(x: Any, v: Any, force: Any, mass: Any, T: Any) -> tuple[Any, Any]:
    """(x, v) after T seconds under a constant force [N]: v + T f/m, x + T v + T²/2 f/m."""
    a = force / mass
    return x + T * (v + 0.5 * T * a), v + T * a


def signum_step(x: Any, v: Any, force: Any, mass: Any, f_c: Any, d: Any, T: Any) -> tuple[Any, Any]:
    """One step with friction as the paper writes it, f(v) = −sgn(v) f_c − d v, sampled and held like the force.

    At rest, held friction never holds: |v| jumps across 0 by up to T f_c/m, so that a mass that should stick chatters
    from step to step with accelerations of up to ±f_c/m.
    """
    return held_step(x, v, force - f_c * sign(v) - d * v, mass, T)


def stick_slip_step(x: Any, v: Any, force: Any, mass: Any, f_c: Any, d: Any, T: Any) -> tuple[Any, Any]:
    """One step with true sticking, exact under a held force, for d T/m ≤ LARGEST_DAMPING.

    Sliding in the direction s, m v̇ = F − s f_c − d v.  Where v reaches 0 within the step, at
    t_0 = (m/d) ln(1 − v d/(F − s f_c)), the mass stays at rest if |F| ≤ f_c and slides the other way if not.
    """
    zero = 0.0 * force
    rest = choose(force > f_c, zero + 1.0, choose(force < -f_c, zero - 1.0, zero))
    s = choose(v > 0.0, zero + 1.0, choose(v < 0.0, zero - 1.0, rest))
    drive = force - s * f_c
    x_end, v_end = _slide(x, v, drive, mass, d, T)
    reverses = s * v_end < 0.0
    # computed in any case, used where v reverses: elsewhere it must not divide by zero
    quotient = choose(reverses, -v / choose(drive * drive > 0.0, drive, zero + 1.0), zero)
    t_0 = mass * quotient * _log1p_ratio(d * quotient)
    x_0, _ = _slide(x, v, drive, mass, d, t_0)
    x_back, v_back = _slide(x_0, zero, force - rest * f_c, mass, d, T - t_0)
    moves = rest * rest > 0.0
    x_back, v_back = choose(moves, x_back, x_0), choose(moves, v_back, zero)
    slides = s * s > 0.0
    x_end, v_end = choose(slides, x_end, x), choose(slides, v_end, zero)
    return choose(reverses, x_back, x_end), choose(reverses, v_back, v_end)


def _slide(x: Any, v: Any, drive: Any, mass: Any, d: Any, t: Any) -> tuple[Any, Any]:
    """m v̇ = drive − d v over t seconds: with y = d t/m, φ1 = (1 − e^{−y})/y and φ2 = (1 − φ1)/y,

    v → v + t φ1 (drive − d v)/m,  x → x + t v + t² φ2 (drive − d v)/m.
    """
    y, a = d * t / mass, (drive - d * v) / mass
    return x + t * (v + t * _phi(y, 2) * a), v + t * _phi(y, 1) * a


def _phi(y: Any, order: int) -> Any:
    """φ of an order: Σ (−y)^k/(k + order)! for k = 0 … 3, by Horner's rule."""
    total = 0.0 * y + 1.0
    for k in range(3, 0, -1):
        total = 1.0 - y / (k + order) * total
    return total / order


def _log1p_ratio(rho: Any) -> Any:
    """ln(1 + ρ)/ρ = 2/(2 + ρ) Σ q^{2k}/(2k + 1) with q = ρ/(2 + ρ); for 0 ≤ ρ ≤ e^LARGEST_DAMPING − 1."""
    q = rho / (2.0 + rho)
    total = 0.0 * q
    for k in range(1, -1, -1):
        total = total * q * q + 1.0 / (2 * k + 1)
    return 2.0 / (2.0 + rho) * total


@convertible()
class OneDofPlant(Block):
    """n masses, each on one degree of freedom: m ẍ = f + m g_z + friction (section III-A of the paper).

    `friction` chooses what acts besides: "none", "signum" (as the paper writes it, held over a step) or "stick-slip"
    (static force holds below f_c, reversals inside a step found exactly).  Numeric parameters of the Context, one
    number per channel: `mass` [kg] > 0, `f_c` [N] >= 0, `d` [N s/m] >= 0 with d period/mass <= 0.001, `gravity` g_z
    [m/s²].  `period` in [s]; exact for a force held over it.
    Input `f` [N]; outputs `x` [m], `v` [m/s] and `a` [m/s²], the mean acceleration of the step that begins, which alone
    feeds through: shape (n,).
    """

    def __init__(
        self,
        mass: ArrayLike,
        period: float,
        friction: Friction = "none",
        f_c: ArrayLike = 0.0,
        d: ArrayLike = 0.0,
        gravity: ArrayLike = GRAVITY_Z,
    ) -> None:
        if friction not in FRICTIONS:
            raise InputError.of("friction", friction, FRICTIONS)
        self.friction, (self.period, _) = friction, sampling(period)
        n = self.parameter("mass", mass, strict=True)
        self.parameter("f_c", f_c, n)
        self.parameter("d", d, n)
        self.parameter("gravity", gravity, n, minimum=-np.inf)
        if self.d.dtype != object and (self.d * self.period > LARGEST_DAMPING * self.mass).any():
            raise InputError.of("d", self.d.tolist(), f"at most {LARGEST_DAMPING} mass/period [N s/m]")
        self.input("f", n)
        self.state("x_and_v", 2 * n)
        self.update(self._step, self.period)
        self.output("x", n, lambda x_and_v: x_and_v[:n])
        self.output("v", n, lambda x_and_v: x_and_v[n:])
        self.output("a", n, self._acceleration)

    def _step(self, x_and_v: Array, f: Array, mass: Array, f_c: Array, d: Array, gravity: Array) -> Array:
        x, v = np.split(x_and_v, 2)
        after = []
        for i in range(len(x)):
            moving = (x[i], v[i], f[i] + mass[i] * gravity[i], mass[i])
            if self.friction == "none":
                after.append(held_step(*moving, self.period))
            else:
                law = signum_step if self.friction == "signum" else stick_slip_step
                after.append(law(*moving, f_c[i], d[i], self.period))
        return np.array(after).T.ravel()

    def _acceleration(self, x_and_v: Array, f: Array, mass: Array, f_c: Array, d: Array, gravity: Array) -> Array:
        n = len(f)
        after = self._step(x_and_v, f, mass, f_c, d, gravity)
        mean: Array = (after[n:] - x_and_v[n:]) / self.period
        return mean
