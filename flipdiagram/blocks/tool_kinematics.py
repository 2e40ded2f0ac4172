"""The forward kinematics of Fig. 4: joint positions and velocities to those of the tool."""

from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem_, ValueProducer
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.blocks._parameters import ScalarContext, ScalarVector


@TemplateSystem.define("ToolKinematics_")
def ToolKinematics_(T: Any) -> type:
    """``ToolKinematics`` over the scalar T: float, AutoDiffXd or Expression."""

    class Impl(LeafSystem_[T]):
        """Task coordinates of the tool and their time derivatives, x(q) and v = J_t(q) qd.

        ``arm`` has the method ``task_position_velocity(q, qd) -> (x, v)`` and, for scalars other than float,
        ``to_scalar(T)``, which returns an arm with the same method over T (or raises: not convertible to T).
        Inputs ``q`` [rad], ``qd`` [rad/s]: shape (n,), n = ``num_joints``; outputs ``x`` [m, rad],
        ``v`` [m/s, rad/s]: shape (m,), m = ``num_coordinates``. Both are computed at once, when the first is
        read; so both depend on both inputs.
        """

        def _construct(self, arm: Any, num_joints: int = 6, num_coordinates: int = 6, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.arm, self.num_joints, self.num_coordinates = arm, num_joints, num_coordinates
            self._scalar_arm = arm if T is float else arm.to_scalar(T)
            self._q = self.DeclareVectorInputPort("q", num_joints)
            self._qd = self.DeclareVectorInputPort("qd", num_joints)
            self._kinematics = self.DeclareCacheEntry(
                "x and v",
                ValueProducer(allocate=lambda: Value[object](), calc=self._calc_kinematics),
                {self._q.ticket(), self._qd.ticket()},
            )
            ticket = self._kinematics.ticket()
            self.DeclareVectorOutputPort("x", num_coordinates, self._calc_x, {ticket})
            self.DeclareVectorOutputPort("v", num_coordinates, self._calc_v, {ticket})

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.arm, other.num_joints, other.num_coordinates, converter=converter)

        def _calc_kinematics(self, context: ScalarContext, value: Any) -> None:
            value.set_value(self._scalar_arm.task_position_velocity(self._q.Eval(context), self._qd.Eval(context)))

        def _calc_x(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(self._kinematics.Eval(context)[0])

        def _calc_v(self, context: ScalarContext, output: ScalarVector) -> None:
            output.set_value(self._kinematics.Eval(context)[1])

    return Impl


ToolKinematics = ToolKinematics_[None]
