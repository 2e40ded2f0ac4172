"""Friction of the joints, as a torque on them: of a URDF joint's friction Drake takes the damping only."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels
from flipdiagram.blocks.block import Block, convertible


def friction_torque(qd: Array, tau_c: Array, d: Array, v_s: Array) -> Array:
    """tau_friction = -(tau_c tanh(qd / v_s) + d qd) [N m], shapes (n,).

    Section III-B of the paper has f(v) = -sgn(v) f_c - d v; tanh(qd / v_s) replaces the sign.
    """
    return -(tau_c * np.tanh(qd / v_s) + d * qd)


def stable_transition_velocity(tau_c: ArrayLike, inertia: ArrayLike, step: float) -> Array:
    """Smallest v_s [rad/s] with which explicit steps of `step` [s] do not chatter: tau_c step / inertia.

    Around zero velocity friction is a damper of slope tau_c / v_s (its largest). One explicit step multiplies
    the velocity by 1 - (tau_c / v_s) step / inertia: its sign stays while (tau_c / v_s) step / inertia <= 1.
    `tau_c` [N m] and the smallest `inertia` [kg m^2] felt at each joint: shape (n,) or one number.
    Viscous friction d adds to the slope and is meant to be small beside it (d step << inertia).

    What the regularisation loses: a stuck joint holds no torque at rest. Under a constant torque below
    tau_c it creeps, at qd = v_s artanh(tau / tau_c) without viscous friction, and it never quite stops;
    break-away is no higher than sliding friction. A larger v_s creeps more, a smaller one than this chatters.
    """
    coulomb = channels("tau_c", tau_c)
    return coulomb * channels("step", step, 1, strict=True) / channels("inertia", inertia, coulomb.size, strict=True)


@convertible()
class JointFriction(Block):
    """Friction of n joints: tau_friction = -(tau_c tanh(qd / v_s) + d qd), never driving (qd tau <= 0).

    A stuck joint creeps, see `stable_transition_velocity`, which also gives a v_s for a step.
    Numeric parameters of the Context, one number per joint: Coulomb torque `tau_c` [N m] >= 0,
    viscous `d` [N m s/rad] >= 0, transition velocity `v_s` [rad/s] > 0.
    Input `qd` [rad/s], output `tau_friction` [N m]: shape (n,).
    """

    def __init__(self, tau_c: ArrayLike, d: ArrayLike, v_s: ArrayLike) -> None:
        n = self.parameter("tau_c", tau_c)
        self.parameter("d", d, n)
        self.parameter("v_s", v_s, n, strict=True)
        self.input("qd", n)
        self.output("tau_friction", n, friction_torque)
