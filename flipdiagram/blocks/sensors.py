"""What the controller sees of the joints: quantised positions, and velocities derived from them."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike
from pydrake.symbolic import Formula, if_then_else
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
    write_parameter,
)


def _choose(condition: Any, yes: Any, no: Any) -> Any:
    return if_then_else(condition, yes, no) if isinstance(condition, Formula) else (yes if condition else no)


def quantised(q: Array, resolution: Array) -> Array:
    """The multiple of ``resolution`` next to q, halves upwards; q itself where the resolution is 0.

    Shapes (n,), [rad] or [m]. The derivative with respect to q is 0 where the resolution is not.
    """
    if q.dtype != object:
        on = resolution > 0.0
        step = np.where(on, resolution, 1.0)
        return np.where(on, step * np.floor(q / step + 0.5), q)
    rounded = []
    for position, size in zip(q, resolution, strict=True):
        step = _choose(size > 0.0, size, type(size)(1.0))  # no division by zero in the branch not taken
        rounded.append(_choose(size > 0.0, step * scalar_math.floor(position / step + 0.5), position))
    return np.array(rounded, dtype=object)


def next_filter_state(z: Array, g_v: Array, period: float, q: Array) -> Array:
    """z[k+1] = e^(-g_v T) z[k] + (1 - e^(-g_v T)) q[k], T the ``period`` [s]; shapes (n,).

    The low-pass g_v/(s+g_v), exact for q held over T.
    """
    decay = np.exp(-g_v * period)
    return decay * z + (1.0 - decay) * q


def filtered_velocity(z: Array, g_v: Array, period: float, q: Array) -> Array:
    """v[k] = G_v (q[k] - z[k]) [rad/s], G_v = (1 - e^(-g_v T))/T; shapes (n,), g_v [rad/s], T the ``period`` [s].

    G_v in the place of g_v makes the velocity of a ramp exact for any T; for g_v T -> oo it is the backward difference.
    """
    return (1.0 - np.exp(-g_v * period)) / period * (q - z)


@TemplateSystem.define("Encoder_")
def Encoder_(T: Any) -> type:
    """``Encoder`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Encoder of n joints: q rounded to a multiple of ``resolution`` (0: not rounded), see ``quantised``.

        ``resolution`` [rad] >= 0, one number per joint, is a numeric parameter of the Context.
        Input ``q``, output ``q_measured`` [rad]: shape (n,).
        """

        def _construct(self, resolution: ArrayLike, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.resolution = channels("resolution", resolution)
            n = self.resolution.size
            self._resolution, resolution_ticket = declare_parameter(self, T, self.resolution)
            self._q = self.DeclareVectorInputPort("q", n)
            self.DeclareVectorOutputPort("q_measured", n, self._calc_q_measured, {self._q.ticket(), resolution_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.resolution, converter=converter)

        def set_resolution(self, context: ScalarContext, resolution: ArrayLike) -> None:
            """Sets the resolution [rad], shape (n,) or one number for all joints, in ``context``."""
            n = self.resolution.size
            write_parameter(context, self._resolution, channels("resolution", resolution, n))

        def _calc_q_measured(self, context: ScalarContext, output: ScalarVector) -> None:
            resolution = context.get_numeric_parameter(self._resolution).CopyToVector()
            output.set_value(quantised(self._q.Eval(context), resolution))

    return Impl


@TemplateSystem.define("PseudoDerivative_")
def PseudoDerivative_(T: Any) -> type:
    """``PseudoDerivative`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Velocity of n joints from their positions: v = g_v s/(s+g_v) q, sampled.

        ``g_v`` [rad/s] >= 0, one number per joint, is a numeric parameter of the Context; ``period`` and
        ``offset`` in [s]; of a ramp it gives the exact velocity. The state z, low-passed q, is 0 by default:
        a start elsewhere than q = 0 shows as the velocity G_v q(0) unless ``set_initial_position`` is called.
        Input ``q`` [rad], which feeds through, output ``v`` [rad/s]: shape (n,).
        """

        def _construct(self, g_v: ArrayLike, period: float, offset: float = 0.0, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.g_v = channels("g_v", g_v)
            n = self.g_v.size
            self.period, self.offset = sampling(period, offset)
            self._g_v, g_v_ticket = declare_parameter(self, T, self.g_v)
            self._q = self.DeclareVectorInputPort("q", n)
            state = self.DeclareDiscreteState(n)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, self.offset, self._update)
            self.DeclareVectorOutputPort(
                "v", n, self._calc_v, {self._q.ticket(), self.discrete_state_ticket(state), g_v_ticket}
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.g_v, other.period, other.offset, converter=converter)

        def set_cutoff(self, context: ScalarContext, g_v: ArrayLike) -> None:
            """Sets g_v [rad/s], shape (n,) or one number for all joints, in ``context``."""
            write_parameter(context, self._g_v, channels("g_v", g_v, self.g_v.size))

        def set_initial_position(self, context: ScalarContext, q: ArrayLike) -> None:
            """Sets the state to ``q`` [rad], shape (n,): a start there is seen with velocity 0."""
            context.SetDiscreteState(channels("q", q, self.g_v.size, minimum=-np.inf))

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            g_v = context.get_numeric_parameter(self._g_v).CopyToVector()
            z = context.get_discrete_state_vector().CopyToVector()
            discrete_values.set_value(next_filter_state(z, g_v, self.period, self._q.Eval(context)))

        def _calc_v(self, context: ScalarContext, output: ScalarVector) -> None:
            g_v = context.get_numeric_parameter(self._g_v).CopyToVector()
            z = context.get_discrete_state_vector().CopyToVector()
            output.set_value(filtered_velocity(z, g_v, self.period, self._q.Eval(context)))

    return Impl


Encoder = Encoder_[None]
PseudoDerivative = PseudoDerivative_[None]
