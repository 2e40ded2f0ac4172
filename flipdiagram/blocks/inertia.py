"""The box M_n of Fig. 4: from the acceleration asked for to a torque."""

from typing import Any

from numpy.typing import ArrayLike
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks._parameters import (
    ScalarContext,
    ScalarVector,
    declare_parameter,
    nominal_inertia,
    same_form,
    times_inertia,
    write_parameter,
)


@TemplateSystem.define("NominalInertia_")
def NominalInertia_(T: Any) -> type:
    """``NominalInertia`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Nominal inertia of n channels: tau_ref = M_n qdd_ref (Fig. 4 of the paper).

        ``inertia`` M_n [kg m^2] (or [kg]) is a numeric parameter of the Context: the diagonal, shape (n,),
        or a symmetric positive definite matrix, shape (n, n), stored row by row.
        Input ``qdd_ref`` [rad/s^2], output ``tau_ref`` [N m]: shape (n,).
        """

        def _construct(self, inertia: ArrayLike, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.inertia = nominal_inertia(inertia)
            n = len(self.inertia)
            self._inertia, inertia_ticket = declare_parameter(self, T, self.inertia)
            self._qdd_ref = self.DeclareVectorInputPort("qdd_ref", n)
            self.DeclareVectorOutputPort("tau_ref", n, self._calc_tau_ref, {self._qdd_ref.ticket(), inertia_ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.inertia, converter=converter)

        def set_inertia(self, context: ScalarContext, inertia: ArrayLike) -> None:
            """Sets M_n [kg m^2] in ``context``; a matrix only where the block was built with a matrix."""
            write_parameter(context, self._inertia, same_form(nominal_inertia(inertia), self.inertia))

        def _calc_tau_ref(self, context: ScalarContext, output: ScalarVector) -> None:
            inertia = context.get_numeric_parameter(self._inertia).CopyToVector().reshape(self.inertia.shape)
            output.set_value(times_inertia(inertia, self._qdd_ref.Eval(context)))

    return Impl


NominalInertia = NominalInertia_[None]
