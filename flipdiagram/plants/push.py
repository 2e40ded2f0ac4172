"""A push on the spatula: a force for a while, which nobody told the controller of."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, LeafSystem


class Push(LeafSystem):
    """Force (f_y, f_z) [N] on a body at a point of it p (3,) [m], from `begin` for `duration` [s]; output `force`.

    Not scalar-convertible: it writes forces for a plant over float.
    """

    def __init__(
        self, body: RigidBody, point: np.ndarray, force: tuple[float, float], begin: float, duration: float
    ) -> None:
        super().__init__()
        self.begin, self.end = float(begin), float(begin + duration)
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = body.index()
        applied.p_BoBq_B = point
        applied.F_Bq_W = SpatialForce(np.zeros(3), np.array([0.0, *force]))
        self._applied = applied
        self.DeclareAbstractOutputPort(
            "force", lambda: Value[list[ExternallyAppliedSpatialForce]](), self._calc, {self.time_ticket()}
        )

    def _calc(self, context: Context, value: Value) -> None:
        # a step that begins an instant before a sample, by rounding, belongs to that sample
        on = self.begin - 1e-9 <= context.get_time() < self.end - 1e-9
        value.set_value([self._applied] if on else [])
