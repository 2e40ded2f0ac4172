"""The box FF of Fig. 4: acceleration feed-forward from the planner."""

from typing import Any

from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels, declare_parameter, write_parameter


def feedforward_acceleration(k_ff: Array, a_cmd: Array) -> Array:
    """a_ff = k_ff a_cmd per channel; the paper's feed-forward has k_ff = 1. Shapes (n,)."""
    return k_ff * a_cmd


@TemplateSystem.define("AccelerationFeedforward_")
def AccelerationFeedforward_(T: Any) -> type:
    """``AccelerationFeedforward`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Acceleration feed-forward of n channels: a_ff = k_ff a_cmd (section II-C of the paper).

        ``k_ff`` [-], one number per channel, is a numeric parameter of the Context, 1 unless given.
        Input ``a_cmd``, output ``a_ff``: shape (n,) [m/s^2 or rad/s^2].
        """

        def _construct(self, num_channels: int, k_ff: ArrayLike = 1.0, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.k_ff = channels("k_ff", k_ff, num_channels)
            self._k_ff, k_ff_ticket = declare_parameter(self, T, self.k_ff)
            self._a_cmd = self.DeclareVectorInputPort("a_cmd", num_channels)
            self.DeclareVectorOutputPort("a_ff", num_channels, self._calc_a_ff, {self._a_cmd.ticket(), k_ff_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.k_ff.size, other.k_ff, converter=converter)

        def set_gain(self, context: ScalarContext, k_ff: ArrayLike) -> None:
            """Sets k_ff [-], shape (n,) or one number for all channels, in ``context``."""
            write_parameter(context, self._k_ff, channels("k_ff", k_ff, self.k_ff.size))

        def _calc_a_ff(self, context: ScalarContext, output: ScalarVector) -> None:
            k_ff = context.get_numeric_parameter(self._k_ff).CopyToVector()
            output.set_value(feedforward_acceleration(k_ff, self._a_cmd.Eval(context)))

    return Impl


AccelerationFeedforward = AccelerationFeedforward_[None]
