"""The box PD of Fig. 4: position and velocity feedback that asks for an acceleration."""

from typing import Any

from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels, declare_parameter, write_parameter


def feedback_acceleration(k_p: Array, k_v: Array, x_cmd: Array, v_cmd: Array, x: Array, v: Array) -> Array:
    """a_ref = K_p (x_cmd - x) + K_v (v_cmd - v) with diagonal gains; shapes (n,), k_p [1/s^2], k_v [1/s]."""
    return k_p * (x_cmd - x) + k_v * (v_cmd - v)


@TemplateSystem.define("ProportionalDerivative_")
def ProportionalDerivative_(T: Any) -> type:
    """``ProportionalDerivative`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """PD feedback of n channels: a_ref = K_p (x_cmd - x) + K_v (v_cmd - v) (Fig. 4 of the paper).

        ``k_p`` [1/s^2] and ``k_v`` [1/s], one number per channel, are numeric parameters of the Context;
        a single number stands for all channels of the other gain.
        Inputs ``x_cmd``, ``x`` [m or rad] and ``v_cmd``, ``v`` [m/s or rad/s], output ``a_ref``
        [m/s^2 or rad/s^2]: shape (n,).
        """

        def _construct(self, k_p: ArrayLike, k_v: ArrayLike, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            n = max(channels("k_p", k_p).size, channels("k_v", k_v).size)
            self.k_p, self.k_v = channels("k_p", k_p, n), channels("k_v", k_v, n)
            self._k_p, k_p_ticket = declare_parameter(self, T, self.k_p)
            self._k_v, k_v_ticket = declare_parameter(self, T, self.k_v)
            self._x_cmd = self.DeclareVectorInputPort("x_cmd", n)
            self._v_cmd = self.DeclareVectorInputPort("v_cmd", n)
            self._x = self.DeclareVectorInputPort("x", n)
            self._v = self.DeclareVectorInputPort("v", n)
            inputs = {port.ticket() for port in (self._x_cmd, self._v_cmd, self._x, self._v)}
            self.DeclareVectorOutputPort("a_ref", n, self._calc_a_ref, inputs | {k_p_ticket, k_v_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.k_p, other.k_v, converter=converter)

        def set_gains(self, context: ScalarContext, k_p: ArrayLike | None = None, k_v: ArrayLike | None = None) -> None:
            """Sets the gains given, k_p [1/s^2] and k_v [1/s], shape (n,) or one number, in ``context``."""
            if k_p is not None:
                write_parameter(context, self._k_p, channels("k_p", k_p, self.k_p.size))
            if k_v is not None:
                write_parameter(context, self._k_v, channels("k_v", k_v, self.k_v.size))

        def _calc_a_ref(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(
                feedback_acceleration(
                    context.get_numeric_parameter(self._k_p).CopyToVector(),
                    context.get_numeric_parameter(self._k_v).CopyToVector(),
                    self._x_cmd.Eval(context),
                    self._v_cmd.Eval(context),
                    self._x.Eval(context),
                    self._v.Eval(context),
                )
            )

    return Impl


ProportionalDerivative = ProportionalDerivative_[None]
