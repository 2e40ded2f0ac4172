"""Friction of the joints, as a torque on them: of a URDF joint's friction Drake takes the damping only."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._parameters import ScalarContext, ScalarVector, channels, declare_parameter, write_parameter
from flipdiagram.errors import InputError


def friction_torque(qd: Array, tau_c: Array, d: Array, v_s: Array) -> Array:
    """tau_friction = -(tau_c tanh(qd / v_s) + d qd) [N m], shapes (n,).

    Section III-B of the paper has f(v) = -sgn(v) f_c - d v; tanh(qd / v_s) replaces the sign.
    """
    return -(tau_c * np.tanh(qd / v_s) + d * qd)


def stable_transition_velocity(tau_c: ArrayLike, inertia: ArrayLike, step: float) -> Array:
    """Smallest v_s [rad/s] with which explicit steps of ``step`` [s] do not chatter: tau_c step / inertia.

    Around zero velocity friction is a damper of slope tau_c / v_s (its largest). One explicit step multiplies
    the velocity by 1 - (tau_c / v_s) step / inertia: its sign stays while (tau_c / v_s) step / inertia <= 1.
    ``tau_c`` [N m] and the smallest ``inertia`` [kg m^2] felt at each joint: shape (n,) or one number.
    Viscous friction d adds to the slope and is meant to be small beside it (d step << inertia).

    What the regularisation loses: a stuck joint holds no torque at rest. Under a constant torque below
    tau_c it creeps, at qd = v_s artanh(tau / tau_c) without viscous friction, and it never quite stops;
    break-away is no higher than sliding friction. A larger v_s creeps more, a smaller one than this chatters.
    """
    if not (np.isfinite(step) and step > 0.0):
        raise InputError(f"step = {step} s; it must be finite and > 0")
    coulomb = channels("tau_c", tau_c)
    return coulomb * step / channels("inertia", inertia, coulomb.size, strict=True)


@TemplateSystem.define("JointFriction_")
def JointFriction_(T: Any) -> type:
    """``JointFriction`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Friction of n joints: tau_friction = -(tau_c tanh(qd / v_s) + d qd), never driving (qd tau <= 0).

        A stuck joint creeps, see ``stable_transition_velocity``, which also gives a v_s for a step.
        Numeric parameters of the Context, one number per joint: Coulomb torque ``tau_c`` [N m] >= 0,
        viscous ``d`` [N m s/rad] >= 0, transition velocity ``v_s`` [rad/s] > 0.
        Input ``qd`` [rad/s], output ``tau_friction`` [N m]: shape (n,).
        """

        def _construct(self, tau_c: ArrayLike, d: ArrayLike, v_s: ArrayLike, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.tau_c = channels("tau_c", tau_c)
            n = self.tau_c.size
            self.d, self.v_s = channels("d", d, n), channels("v_s", v_s, n, strict=True)
            self._tau_c, tau_c_ticket = declare_parameter(self, T, self.tau_c)
            self._d, d_ticket = declare_parameter(self, T, self.d)
            self._v_s, v_s_ticket = declare_parameter(self, T, self.v_s)
            self._qd = self.DeclareVectorInputPort("qd", n)
            self.DeclareVectorOutputPort(
                "tau_friction", n, self._calc_tau_friction, {self._qd.ticket(), tau_c_ticket, d_ticket, v_s_ticket}
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.tau_c, other.d, other.v_s, converter=converter)

        def set_friction(
            self,
            context: ScalarContext,
            tau_c: ArrayLike | None = None,
            d: ArrayLike | None = None,
            v_s: ArrayLike | None = None,
        ) -> None:
            """Sets the parameters given, shape (n,) or one number for all joints, in ``context``."""
            n = self.tau_c.size
            if tau_c is not None:
                write_parameter(context, self._tau_c, channels("tau_c", tau_c, n))
            if d is not None:
                write_parameter(context, self._d, channels("d", d, n))
            if v_s is not None:
                write_parameter(context, self._v_s, channels("v_s", v_s, n, strict=True))

        def _calc_tau_friction(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(
                friction_torque(
                    self._qd.Eval(context),
                    context.get_numeric_parameter(self._tau_c).CopyToVector(),
                    context.get_numeric_parameter(self._d).CopyToVector(),
                    context.get_numeric_parameter(self._v_s).CopyToVector(),
                )
            )

    return Impl


JointFriction = JointFriction_[None]
