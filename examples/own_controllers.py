"""Compare controllers of your own with the four of the paper on the frequencies of Figs 5-10.

A controller is a Drake System whose ports are among x_cmd, v_cmd, a_cmd, x, v (inputs) and force (output), each of
size 1.  Written over every scalar (TemplateSystem) it is compiled with its loop; others run slowly.

    python examples/own_controllers.py
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.math import max as larger
from pydrake.math import min as smaller
from pydrake.systems.framework import BasicVector_, LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram import Scenario, frequency_response


@TemplateSystem.define("Pid_")
def Pid_(T: Any) -> type:
    """``Pid`` over the scalar T."""

    class Impl(LeafSystem_[T]):
        """force = k_p e + k_i sum(e) period + k_d (v_cmd - v), e = x_cmd - x; gains in N/m, N/(m s) and N s/m."""

        def _construct(self, k_p: float, k_i: float, k_d: float, period: float, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.gains, self.period = (k_p, k_i, k_d), period
            self._gains = self.DeclareNumericParameter(BasicVector_[T](list(self.gains)))
            for name in ("x_cmd", "v_cmd", "x", "v"):
                self.DeclareVectorInputPort(name, 1)
            self.DeclareDiscreteState(1)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            self.DeclareVectorOutputPort("force", 1, self._calc_force)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, *other.gains, other.period, converter=converter)

        def _error(self, context: Any, command: str, response: str) -> Any:
            return (self.GetInputPort(command).Eval(context) - self.GetInputPort(response).Eval(context))[0]

        def _update(self, context: Any, values: Any) -> None:
            integral = context.get_discrete_state_vector()[0]
            values.set_value(np.array([integral + self.period * self._error(context, "x_cmd", "x")]))

        def _calc_force(self, context: Any, output: Any) -> None:
            k_p, k_i, k_d = context.get_numeric_parameter(self._gains).CopyToVector()
            integral = context.get_discrete_state_vector()[0]
            proportional = k_p * self._error(context, "x_cmd", "x")
            output[0] = proportional + k_i * integral + k_d * self._error(context, "v_cmd", "v")

    return Impl


@TemplateSystem.define("SlidingMode_")
def SlidingMode_(T: Any) -> type:
    """``SlidingMode`` over the scalar T."""

    class Impl(LeafSystem_[T]):
        """force = m (a_cmd + slope (v_cmd - v)) + reach sat(s / layer), s = (v_cmd - v) + slope (x_cmd - x).

        The switching force ``reach`` [N] must exceed what disturbs the mass; in the boundary layer [m/s] it is linear.
        """

        def _construct(self, mass: float, slope: float, reach: float, layer: float, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.numbers = (mass, slope, reach, layer)
            self._numbers = self.DeclareNumericParameter(BasicVector_[T](list(self.numbers)))
            for name in ("x_cmd", "v_cmd", "a_cmd", "x", "v"):
                self.DeclareVectorInputPort(name, 1)
            self.DeclareVectorOutputPort("force", 1, self._calc_force)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, *other.numbers, converter=converter)

        def _calc_force(self, context: Any, output: Any) -> None:
            mass, slope, reach, layer = context.get_numeric_parameter(self._numbers).CopyToVector()
            names = ("x_cmd", "v_cmd", "a_cmd", "x", "v")
            x_cmd, v_cmd, a_cmd, x, v = (self.GetInputPort(name).Eval(context)[0] for name in names)
            s = (v_cmd - v) + slope * (x_cmd - x)
            switching = smaller(larger(s / layer, T(-1.0)), T(1.0))
            output[0] = mass * (a_cmd + slope * (v_cmd - v)) + reach * switching

    return Impl


Pid = Pid_[None]
SlidingMode = SlidingMode_[None]

CONTROLLERS: dict[str, Any] = {
    "pd+ff+dob": "pd+ff+dob",
    "pid": lambda settings: Pid(900.0, 5000.0, 60.0, settings.step),
    "sliding mode": lambda settings: SlidingMode(settings.mass, 30.0, 200.0, 2.0),
}
"""The name of one of the paper's controllers, or a function that makes one of one's own."""


def main(omega: Sequence[float] = (1.0, 10.0, 30.0, 100.0, 1000.0)) -> None:
    """Print gain and phase of each controller, with friction, at a few frequencies [rad/s]."""
    settings = Scenario().one_dof
    print(f"m = {settings.mass:g} kg, gravity and {settings.friction_model} friction")
    for name, controller in CONTROLLERS.items():
        own = {} if isinstance(controller, str) else {"name": name}
        response = frequency_response(controller, omega=omega, friction=True, **own)
        cells = zip(response.omega, response.acceleration_gain, np.degrees(response.phase), strict=True)
        print(f"{name:>14}", *(f"{w:6g} rad/s: {gain:.3f}, {angle:6.1f} deg" for w, gain, angle in cells), sep="   ")


if __name__ == "__main__":
    main()
