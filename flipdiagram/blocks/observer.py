"""The box DOB of Fig. 4: disturbance observer on torque and velocity."""

from typing import Any

import numpy as np
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
    nominal_inertia,
    same_form,
    sampling,
    times_inertia,
    write_parameter,
)


def next_observer_state(w: Array, g_dis: Array, inertia: Array, period: float, tau: Array, qd: Array) -> Array:
    """w[k+1] = e^(-g T) w[k] + (1 - e^(-g T)) (tau[k] + g M_n qd[k]), T the ``period`` [s].

    The low-pass g/(s+g), exact for inputs held over T.
    Shapes (n,), M_n (n,) or (n, n); w and tau [N m], g [rad/s], qd [rad/s].
    """
    decay = np.exp(-g_dis * period)
    return decay * w + (1.0 - decay) * (tau + g_dis * times_inertia(inertia, qd))


def disturbance_estimate(w: Array, g_dis: Array, inertia: Array, qd: Array) -> Array:
    """tau_dis[k] = w[k] - g M_n qd[k] [N m], shape (n,)."""
    return w - g_dis * times_inertia(inertia, qd)


@TemplateSystem.define("DisturbanceObserver_")
def DisturbanceObserver_(T: Any) -> type:
    """``DisturbanceObserver`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Disturbance observer of n channels: tau_dis = g/(s+g) [tau + g M_n qd] - g M_n qd (Fig. 4).

        A plant M qdd = tau - d gives tau_dis -> d with the time constant 1/g: adding tau_dis to the torque
        cancels gravity, friction and whatever else the controller does not know.

        Sampled with ``period`` [s], the first sample at ``offset`` [s]; exact for inputs held over the period
        (see ``next_observer_state``). Two properties of this sampling:

        * ``tau`` (the torque as sent, after the limit) enters one sample old: no feed-through from it,
          so tau_dis may be added to the torque without an algebraic loop. ``qd`` feeds through.
        * between samples a velocity is a ramp, not held. While the body accelerates, the estimate's limit is
          d + (1 - gT/(1 - e^(-gT))) (tau - d), off by about -gT/2 of the accelerating torque
          (0.6 % at g = 12.6 rad/s, T = 1 ms); at constant velocity it is exact.

        ``g_dis`` [rad/s], one number per channel, and ``inertia`` M_n [kg m^2] (or [kg]), shape (n,) for a
        diagonal or (n, n), are numeric parameters of the Context. M_n is the observer's own: it may differ
        from the one that makes tau_ref. The state w = 0 [N m] is the observer at rest.
        Inputs ``tau`` [N m], ``qd`` [rad/s], output ``tau_dis`` [N m]: shape (n,).
        """

        def _construct(
            self, g_dis: ArrayLike, inertia: ArrayLike, period: float, offset: float = 0.0, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.inertia = nominal_inertia(inertia)
            n = len(self.inertia)
            self.g_dis = channels("g_dis", g_dis, n)
            self.period, self.offset = sampling(period, offset)
            self._g_dis, g_dis_ticket = declare_parameter(self, T, self.g_dis)
            self._inertia, inertia_ticket = declare_parameter(self, T, self.inertia)
            self._tau = self.DeclareVectorInputPort("tau", n)
            self._qd = self.DeclareVectorInputPort("qd", n)
            state = self.DeclareDiscreteState(n)
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, self.offset, self._update)
            self.DeclareVectorOutputPort(
                "tau_dis",
                n,
                self._calc_tau_dis,
                {self._qd.ticket(), self.discrete_state_ticket(state), g_dis_ticket, inertia_ticket},
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.g_dis, other.inertia, other.period, other.offset, converter=converter)

        def set_gain(self, context: ScalarContext, g_dis: ArrayLike) -> None:
            """Sets g_dis [rad/s], shape (n,) or one number for all channels, in ``context``."""
            write_parameter(context, self._g_dis, channels("g_dis", g_dis, self.g_dis.size))

        def set_inertia(self, context: ScalarContext, inertia: ArrayLike) -> None:
            """Sets M_n [kg m^2] in ``context``; a matrix only where the block was built with a matrix."""
            write_parameter(context, self._inertia, same_form(nominal_inertia(inertia), self.inertia))

        def set_initial_estimate(self, context: ScalarContext, qd: ArrayLike, tau_dis: ArrayLike = 0.0) -> None:
            """Sets the state: at the velocity ``qd`` [rad/s] tau_dis is ``tau_dis`` [N m], shapes (n,)."""
            n = self.g_dis.size
            qd = channels("qd", qd, n, minimum=-np.inf)
            tau_dis = channels("tau_dis", tau_dis, n, minimum=-np.inf)
            g_dis, inertia = self._parameters(context)
            context.SetDiscreteState(tau_dis + g_dis * times_inertia(inertia, qd))

        def _parameters(self, context: ScalarContext) -> tuple[Array, Array]:
            g_dis = context.get_numeric_parameter(self._g_dis).CopyToVector()
            inertia = context.get_numeric_parameter(self._inertia).CopyToVector()
            return g_dis, inertia.reshape(self.inertia.shape)

        def _update(self, context: ScalarContext, discrete_values: ScalarDiscreteValues) -> None:
            g_dis, inertia = self._parameters(context)
            w = context.get_discrete_state_vector().CopyToVector()
            discrete_values.set_value(
                next_observer_state(w, g_dis, inertia, self.period, self._tau.Eval(context), self._qd.Eval(context))
            )

        def _calc_tau_dis(self, context: ScalarContext, output: ScalarVector) -> None:
            g_dis, inertia = self._parameters(context)
            w = context.get_discrete_state_vector().CopyToVector()
            output.set_value(disturbance_estimate(w, g_dis, inertia, self._qd.Eval(context)))

    return Impl


DisturbanceObserver = DisturbanceObserver_[None]
