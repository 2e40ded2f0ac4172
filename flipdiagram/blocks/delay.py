"""A delay of whole periods, as buses and sensors have it."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks._parameters import ScalarContext, ScalarDiscreteValues, ScalarVector, channels, sampling
from flipdiagram.errors import InputError


@TemplateSystem.define("Delay_")
def Delay_(T: Any) -> type:
    """``Delay`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """y[k] = u[k − periods], for n channels; ``periods`` >= 1, ``period`` and ``offset`` in [s].

        Unlike Drake's DiscreteTimeDelay it samples with an offset, as our other sampled boxes do.  The state holds the
        last inputs, oldest first, 0 unless ``set_initial_value`` is called.  Input ``u``, which does not feed through,
        output ``y``: shape (n,).
        """

        def _construct(
            self, num_channels: int, periods: int, period: float, offset: float = 0.0, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            if periods < 1:
                raise InputError(f"periods = {periods} is not valid; valid is a whole number of at least 1")
            self.num_channels, self.periods = num_channels, periods
            self.period, self.offset = sampling(period, offset)
            self._u = self.DeclareVectorInputPort("u", num_channels)
            state = self.DeclareDiscreteState(num_channels * periods)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, self.offset, self._update)
            self.DeclareVectorOutputPort("y", num_channels, self._calc_y, {self.discrete_state_ticket(state)})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.num_channels, other.periods, other.period, other.offset, converter=converter)

        def set_initial_value(self, context: ScalarContext, u: ArrayLike) -> None:
            """Fills the delay with ``u``, shape (n,) or one number for all channels."""
            value = channels("u", u, self.num_channels, minimum=-np.inf)
            context.SetDiscreteState(np.tile(value, self.periods))

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            stored = context.get_discrete_state_vector().CopyToVector()
            discrete_values.set_value(np.concatenate([stored[self.num_channels :], self._u.Eval(context)]))

        def _calc_y(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(context.get_discrete_state_vector().CopyToVector()[: self.num_channels])

    return Impl


Delay = Delay_[None]
