"""The saturation of Fig. 4: what the drives can deliver."""

from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels, declare_parameter, write_parameter


def limited_torque(tau_cmd: Array, tau_max: Array) -> Array:
    """tau = min(max(tau_cmd, -tau_max), tau_max) per channel; shapes (n,), [N m]."""
    if tau_cmd.dtype != object:
        return np.minimum(np.maximum(tau_cmd, -tau_max), tau_max)  # half the time of np.clip on small arrays
    clipped = [
        scalar_math.min(scalar_math.max(tau, -limit), limit) for tau, limit in zip(tau_cmd, tau_max, strict=True)
    ]
    return np.array(clipped, dtype=object)


@TemplateSystem.define("TorqueLimit_")
def TorqueLimit_(T: Any) -> type:
    """``TorqueLimit`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Torque limit of n channels: tau = sat(tau_cmd) between -tau_max and tau_max.

        ``tau_max`` [N m] >= 0, one number per channel, is a numeric parameter of the Context.
        Input ``tau_cmd``, output ``tau`` [N m]: shape (n,).
        """

        def _construct(self, tau_max: ArrayLike, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.tau_max = channels("tau_max", tau_max)
            n = self.tau_max.size
            self._tau_max, tau_max_ticket = declare_parameter(self, T, self.tau_max)
            self._tau_cmd = self.DeclareVectorInputPort("tau_cmd", n)
            self.DeclareVectorOutputPort("tau", n, self._calc_tau, {self._tau_cmd.ticket(), tau_max_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.tau_max, converter=converter)

        def set_limit(self, context: ScalarContext, tau_max: ArrayLike) -> None:
            """Sets tau_max [N m], shape (n,) or one number for all channels, in ``context``."""
            write_parameter(context, self._tau_max, channels("tau_max", tau_max, self.tau_max.size))

        def _calc_tau(self, context: ScalarContext, output: ScalarVector) -> None:
            tau_max = context.get_numeric_parameter(self._tau_max).CopyToVector()
            output.set_value(limited_torque(self._tau_cmd.Eval(context), tau_max))

    return Impl


TorqueLimit = TorqueLimit_[None]
