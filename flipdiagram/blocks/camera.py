"""A camera that sees where the object lies on the blade: sampled, late and noisy."""

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame, RigidBody

from flipdiagram.arrays import Floats
from flipdiagram.blocks._checks import channels, sampling
from flipdiagram.blocks.block import Block


class Camera(Block):
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
        self.period, self.offset = sampling(period, offset)
        self.noise, self.seed = float(channels("noise", noise, 1)[0]), int(seed)
        self.pictures = max(1, round(channels("delay", delay, 1)[0] / period))
        self._tool, self._object = tool, object_body.index()
        self.input("poses", Value[list[RigidTransform]]())
        self.state("pictures_on_their_way", self.pictures + 1)  # and how many were taken
        self.update(self._take, self.period, self.offset)
        self.output("shift", 1, self._newest)

    def _take(self, pictures_on_their_way: Floats, poses: list[RigidTransform]) -> Floats:
        k = int(pictures_on_their_way[-1])
        X_WT = poses[self._tool.body().index()] @ self._tool.GetFixedPoseInBodyFrame()
        seen = float((X_WT.inverse() @ poses[self._object].translation())[1])
        error = self.noise * np.random.default_rng([self.seed, k]).standard_normal() if self.noise else 0.0
        return np.array([*pictures_on_their_way[1:-1], seen + error, k + 1.0])

    def _newest(self, pictures_on_their_way: Floats) -> Floats:
        return pictures_on_their_way[:1] if pictures_on_their_way[-1] >= self.pictures else np.zeros(1)
