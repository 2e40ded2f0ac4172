"""The box DOB of Fig. 4: disturbance observer on torque and velocity."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels, nominal_inertia, times_inertia
from flipdiagram.blocks.block import Block, convertible


def next_observer_state(w: Array, g_dis: Array, inertia: Array, period: float, tau: Array, qd: Array) -> Array:
    """w[k+1] = e^(-g T) w[k] + (1 - e^(-g T)) (tau[k] + g M_n qd[k]), T the `period` [s].

    The low-pass g/(s+g), exact for inputs held over T.
    Shapes (n,), M_n (n,) or (n, n); w and tau [N m], g [rad/s], qd [rad/s].
    """
    decay = np.exp(-g_dis * period)
    return decay * w + (1.0 - decay) * (tau + g_dis * times_inertia(inertia, qd))


def disturbance_estimate(w: Array, g_dis: Array, inertia: Array, qd: Array) -> Array:
    """tau_dis[k] = w[k] - g M_n qd[k] [N m], shape (n,)."""
    return w - g_dis * times_inertia(inertia, qd)


@convertible()
class DisturbanceObserver(Block):
    """Disturbance observer of n channels: tau_dis = g/(s+g) [tau + g M_n qd] - g M_n qd (Fig. 4).

    A plant M qdd = tau - d gives tau_dis -> d with the time constant 1/g: adding tau_dis to the torque
    cancels gravity, friction and whatever else the controller does not know.

    Sampled with `period` [s], the first sample at `offset` [s]; exact for inputs held over the period
    (see `next_observer_state`). Two properties of this sampling:

    * `tau` (the torque as sent, after the limit) enters one sample old: no feed-through from it,
      so tau_dis may be added to the torque without an algebraic loop. `qd` feeds through.
    * between samples a velocity is a ramp, not held. While the body accelerates, the estimate's limit is
      d + (1 - gT/(1 - e^(-gT))) (tau - d), off by about -gT/2 of the accelerating torque
      (0.6 % at g = 12.6 rad/s, T = 1 ms); at constant velocity it is exact.

    `g_dis` [rad/s], one number per channel, and `inertia` M_n [kg m^2] (or [kg]), shape (n,) for a
    diagonal or (n, n), are numeric parameters of the Context. M_n is the observer's own: it may differ
    from the one that makes tau_ref. The state w starts at `initial` [N m], by default 0: the observer at rest.
    Inputs `tau` [N m], `qd` [rad/s], output `tau_dis` [N m]: shape (n,).
    """

    def __init__(
        self, g_dis: ArrayLike, inertia: ArrayLike, period: float, offset: float = 0.0, initial: ArrayLike = 0.0
    ) -> None:
        n = len(nominal_inertia("inertia", inertia))
        self.parameter("g_dis", g_dis, n)
        self.parameter("inertia", inertia, check=nominal_inertia)
        self.input("tau", n)
        self.input("qd", n)
        self.initial = channels("initial", initial, n, minimum=-np.inf)
        self.state("w", self.initial)
        self.update(next_observer_state, period, offset)
        self.output("tau_dis", n, disturbance_estimate)
