"""A camera that sees where the object lies on the blade: sampled, late and noisy."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame, RigidBody
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from flipdiagram.blocks._checks import sampling
from flipdiagram.errors import InputError


class Camera(LeafSystem):
    """Displacement of the object's centre along the tangent s of the blade [m], output `shift` (1,).

    Input `poses`: body poses of a MultibodyPlant.  Sampled every `period` [s], out `delay` later (whole periods, at
    least one), with normal noise of standard deviation `noise` [m]; 0 until the first picture is out.  The noise of
    picture k depends on `seed` and k alone.  Not scalar-convertible: it reads poses.
    """

    def __init__(
        self,
        tool: Frame,
        object_body: RigidBody,
        period: float,
        delay: float = 0.0,
        noise: float = 0.0,
        seed: int = 0,
        offset: float = 0.0,
    ) -> None:
        super().__init__()
        if not (noise >= 0 and delay >= 0):
            raise InputError(f"noise = {noise} m, delay = {delay} s; valid are numbers of at least 0")
        self.period, self.offset = sampling(period, offset)
        self.noise, self.seed = float(noise), int(seed)
        self.pictures = max(1, round(delay / period))
        self._tool_body, self._object = tool.body().index(), object_body.index()
        self._tool = tool
        self._poses = self.DeclareAbstractInputPort("poses", Value[list[RigidTransform]]())
        state = self.DeclareDiscreteState(self.pictures + 1)  # pictures on their way, and how many were taken
        self.DeclarePeriodicDiscreteUpdateEvent(self.period, self.offset, self._take)
        self.DeclareVectorOutputPort("shift", 1, self._calc, {self.discrete_state_ticket(state)})

    def _take(self, context: Context, values: DiscreteValues) -> None:
        old = context.get_discrete_state_vector().value()
        k = int(old[-1])
        poses = self._poses.Eval(context)
        X_WT = poses[self._tool_body] @ self._tool.GetFixedPoseInBodyFrame()
        seen = float((X_WT.inverse() @ poses[self._object].translation())[1])
        error = self.noise * np.random.default_rng([self.seed, k]).standard_normal() if self.noise else 0.0
        values.set_value(np.array([*old[1:-1], seen + error, k + 1.0]))

    def _calc(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state_vector()
        output[0] = state[0] if state[self.pictures] >= self.pictures else 0.0
