"""The plant of section III: a mass on one degree of freedom, m ẍ = f + m g_z + f_friction, stepped exactly."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks._parameters import (
    ScalarContext,
    ScalarDiscreteValues,
    ScalarVector,
    channels,
    declare_parameter,
    sampling,
    write_parameter,
)
from flipdiagram.blocks._scalars import choose, sign
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


@TemplateSystem.define("OneDofPlant_")
def OneDofPlant_(T: Any) -> type:
    """``OneDofPlant`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """n masses, each on one degree of freedom: m ẍ = f + m g_z + friction (section III-A of the paper).

        ``friction`` chooses what acts besides: "none", "signum" (as the paper writes it, held over a step) or
        "stick-slip" (static force holds below f_c, reversals inside a step found exactly).  Numeric parameters of the
        Context, one number per channel: ``mass`` [kg] > 0, ``f_c`` [N] >= 0, ``d`` [N s/m] >= 0 with
        d period/mass <= 0.001, ``gravity`` g_z [m/s²].  ``period`` in [s]; exact for a force held over it.
        Input ``f`` [N]; outputs ``x`` [m], ``v`` [m/s] and ``a`` [m/s²], the mean acceleration of the step that begins,
        which alone feeds through: shape (n,).
        """

        numeric_parameter_names = ("mass", "f_c", "d", "gravity")

        def _construct(
            self,
            mass: ArrayLike,
            period: float,
            friction: Friction = "none",
            f_c: ArrayLike = 0.0,
            d: ArrayLike = 0.0,
            gravity: ArrayLike = GRAVITY_Z,
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            if friction not in FRICTIONS:
                raise InputError(f"friction = '{friction}'; choose from {', '.join(FRICTIONS)}")
            self.friction, (self.period, _) = friction, sampling(period, 0.0)
            self.mass = channels("mass", mass, strict=True)
            n = self.mass.size
            self.f_c, self.d = channels("f_c", f_c, n), channels("d", d, n)
            self.gravity = channels("gravity", gravity, n, minimum=-np.inf)
            if T is float and (self.d * self.period > LARGEST_DAMPING * self.mass).any():
                valid = f"at most {LARGEST_DAMPING} mass/period"
                raise InputError(f"d = {self.d.tolist()} N s/m; it must be {valid}")
            tickets = set()
            self._parameters = []
            for values in (self.mass, self.f_c, self.d, self.gravity):
                index, ticket = declare_parameter(self, T, values)
                self._parameters.append(index)
                tickets.add(ticket)
            self._f = self.DeclareVectorInputPort("f", n)
            state = self.DeclareDiscreteState(2 * n)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)
            moving = {self.discrete_state_ticket(state)}
            self.DeclareVectorOutputPort("x", n, self._calc_x, moving)
            self.DeclareVectorOutputPort("v", n, self._calc_v, moving)
            self.DeclareVectorOutputPort("a", n, self._calc_a, moving | tickets | {self._f.ticket()})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self, other.mass, other.period, other.friction, other.f_c, other.d, other.gravity, converter=converter
            )

        def set_initial_state(self, context: ScalarContext, x: ArrayLike, v: ArrayLike = 0.0) -> None:
            """Sets x [m] and v [m/s], shapes (n,) or one number for all channels, in ``context``."""
            n = self.mass.size
            both = [channels(name, value, n, minimum=-np.inf) for name, value in (("x", x), ("v", v))]
            context.SetDiscreteState(np.concatenate(both))

        def set_mass(self, context: ScalarContext, mass: ArrayLike) -> None:
            """Sets the mass [kg] in ``context``."""
            write_parameter(context, self._parameters[0], channels("mass", mass, self.mass.size, strict=True))

        def _state(self, context: ScalarContext) -> tuple[Any, Any]:
            n = self.mass.size
            state = context.get_discrete_state_vector().CopyToVector()
            return state[:n], state[n:]

        def _step(self, context: ScalarContext) -> tuple[list[Any], list[Any]]:
            mass, f_c, d, gravity = (context.get_numeric_parameter(i).CopyToVector() for i in self._parameters)
            x, v = self._state(context)
            f = self._f.Eval(context)
            after = []
            for i in range(len(x)):
                arguments = (x[i], v[i], f[i] + mass[i] * gravity[i], mass[i])
                if self.friction == "none":
                    after.append(held_step(*arguments, self.period))
                else:
                    law = signum_step if self.friction == "signum" else stick_slip_step
                    after.append(law(*arguments, f_c[i], d[i], self.period))
            return [x for x, _ in after], [v for _, v in after]

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            x, v = self._step(context)
            discrete_values.set_value(np.array([*x, *v]))

        def _calc_x(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(self._state(context)[0])

        def _calc_v(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(self._state(context)[1])

        def _calc_a(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value((np.array(self._step(context)[1]) - self._state(context)[1]) / self.period)

    return Impl


OneDofPlant = OneDofPlant_[None]
