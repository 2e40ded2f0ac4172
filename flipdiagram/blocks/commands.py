"""Sources for experiments: the sinusoidal command of eqs. (13)-(15), and noise on a measured signal."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import (
    ScalarContext,
    ScalarDiscreteValues,
    ScalarVector,
    channels,
    declare_parameter,
    sampling,
)
from flipdiagram.errors import InputError

MODULUS, MULTIPLIER = 2147483647.0, 16807.0
"""Park and Miller's minimal standard generator: every product stays below 2^53, so doubles compute it exactly."""


def next_random(state: Any) -> Any:
    """n[k+1] = 16807 n[k] mod (2^31 - 1), a whole number from 1 to 2^31 - 2, of period 2^31 - 2."""
    product = MULTIPLIER * state
    return product - MODULUS * scalar_math.floor(product / MODULUS)


def uniform_noise(state: Any, rms: Any) -> Any:
    """White noise, uniform within +-sqrt(3) rms, of a state of ``next_random``."""
    return rms * np.sqrt(3.0) * (2.0 * state / MODULUS - 1.0)


def _phase(context: ScalarContext, omega: Array) -> list[Any]:
    return [w * context.get_time() for w in omega]


@TemplateSystem.define("SinusoidalCommand_")
def SinusoidalCommand_(T: Any) -> type:
    """``SinusoidalCommand`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Commands of n channels, eqs. (13)-(15): x_cmd = -A sin wt, v_cmd = -A w cos wt, a_cmd = A w^2 sin wt.

        Numeric parameters of the Context, one number per channel: ``omega`` w [rad/s] > 0, ``amplitude`` A [m].
        Outputs ``x_cmd`` [m], ``v_cmd`` [m/s], ``a_cmd`` [m/s^2]: shape (n,), functions of time.
        """

        numeric_parameter_names = ("omega", "amplitude")

        def _construct(self, omega: ArrayLike, amplitude: ArrayLike = 1.0, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.omega = channels("omega", omega, strict=True)
            n = self.omega.size
            self.amplitude = channels("amplitude", amplitude, n)
            self._omega, omega_ticket = declare_parameter(self, T, self.omega)
            self._amplitude, amplitude_ticket = declare_parameter(self, T, self.amplitude)
            tickets = {self.time_ticket(), omega_ticket, amplitude_ticket}
            self.DeclareVectorOutputPort("x_cmd", n, self._calc_x_cmd, tickets)
            self.DeclareVectorOutputPort("v_cmd", n, self._calc_v_cmd, tickets)
            self.DeclareVectorOutputPort("a_cmd", n, self._calc_a_cmd, tickets)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.omega, other.amplitude, converter=converter)

        def _wave(self, context: ScalarContext) -> tuple[Array, Array, Array, Array]:
            omega = context.get_numeric_parameter(self._omega).CopyToVector()
            amplitude = context.get_numeric_parameter(self._amplitude).CopyToVector()
            angles = _phase(context, omega)
            sines = np.array([scalar_math.sin(angle) for angle in angles])
            return omega, amplitude, sines, np.array([scalar_math.cos(angle) for angle in angles])

        def _calc_x_cmd(self, context: ScalarContext, output: ScalarVector) -> None:
            _, amplitude, sine, _ = self._wave(context)
            output.set_value(-amplitude * sine)

        def _calc_v_cmd(self, context: ScalarContext, output: ScalarVector) -> None:
            omega, amplitude, _, cosine = self._wave(context)
            output.set_value(-amplitude * omega * cosine)

        def _calc_a_cmd(self, context: ScalarContext, output: ScalarVector) -> None:
            omega, amplitude, sine, _ = self._wave(context)
            output.set_value(amplitude * omega * omega * sine)

    return Impl


@TemplateSystem.define("SinusoidalNoise_")
def SinusoidalNoise_(T: Any) -> type:
    """``SinusoidalNoise`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Noise of n channels as a sinusoid, A sin wt (section III-B of the paper, Fig. 10).

        Numeric parameters of the Context, one number per channel: ``omega`` w [rad/s] > 0, ``amplitude`` A.
        Output ``noise``: shape (n,), in the unit of the amplitude, [m/s] for a velocity.
        """

        numeric_parameter_names = ("omega", "amplitude")

        def _construct(self, omega: ArrayLike, amplitude: ArrayLike = 1.0, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.omega = channels("omega", omega, strict=True)
            n = self.omega.size
            self.amplitude = channels("amplitude", amplitude, n)
            self._omega, omega_ticket = declare_parameter(self, T, self.omega)
            self._amplitude, amplitude_ticket = declare_parameter(self, T, self.amplitude)
            tickets = {self.time_ticket(), omega_ticket, amplitude_ticket}
            self.DeclareVectorOutputPort("noise", n, self._calc_noise, tickets)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.omega, other.amplitude, converter=converter)

        def _calc_noise(self, context: ScalarContext, output: ScalarVector) -> None:
            omega = context.get_numeric_parameter(self._omega).CopyToVector()
            amplitude = context.get_numeric_parameter(self._amplitude).CopyToVector()
            sines = np.array([scalar_math.sin(angle) for angle in _phase(context, omega)])
            output.set_value(amplitude * sines)

    return Impl


@TemplateSystem.define("BroadbandNoise_")
def BroadbandNoise_(T: Any) -> type:
    """``BroadbandNoise`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """White noise of n channels, uniform within +-sqrt(3) rms, a new number each ``period`` [s].

        The generator (``next_random``) is arithmetic on its state, exact in doubles: the same numbers in Drake's
        Simulator, in a symbolic form and in compiled code.  The state is the ``seed``, a whole number from 1 to
        2^31 - 2, one per channel; seeds in a ratio of small numbers give correlated channels.
        ``rms`` is a numeric parameter of the Context, one number per channel.
        Output ``noise``: shape (n,), in the unit of rms, [m/s] for a velocity.
        """

        numeric_parameter_names = ("rms",)

        def _construct(self, rms: ArrayLike, period: float, seed: ArrayLike = 1, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.rms = channels("rms", rms)
            n = self.rms.size
            self.seed = channels("seed", seed, n, minimum=1.0)
            if T is float and not ((self.seed < MODULUS) & (self.seed == np.floor(self.seed))).all():
                raise InputError(f"seed = {self.seed.tolist()}; valid are whole numbers from 1 to 2147483646")
            self.period, _ = sampling(period, 0.0)
            self._rms, rms_ticket = declare_parameter(self, T, self.rms)
            state = self.DeclareDiscreteState(np.array([T(seed) for seed in self.seed]))
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)
            self.DeclareVectorOutputPort("noise", n, self._calc_noise, {self.discrete_state_ticket(state), rms_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.rms, other.period, other.seed, converter=converter)

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            state = context.get_discrete_state_vector().CopyToVector()
            discrete_values.set_value(np.array([next_random(value) for value in state]))

        def _calc_noise(self, context: ScalarContext, output: ScalarVector) -> None:
            state = context.get_discrete_state_vector().CopyToVector()
            rms = context.get_numeric_parameter(self._rms).CopyToVector()
            output.set_value(uniform_noise(state, rms))

    return Impl


SinusoidalCommand = SinusoidalCommand_[None]
SinusoidalNoise = SinusoidalNoise_[None]
BroadbandNoise = BroadbandNoise_[None]
