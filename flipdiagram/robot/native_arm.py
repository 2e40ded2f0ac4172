"""The arm's kinematics by compiled loops, for what asks for them every millisecond."""

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.errors import PlanningError
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.serial_chain import SerialChain, serial_chain
from flipdiagram.robot.task_space import UPRIGHT


class NativeArm(ArmModel):
    """An ArmModel whose task kinematics are machine code, equal to rounding; plant and Context are those of `arm`.

    Asked again for the same q and qd, the same unchanged arrays, it answers from before.
    """

    def __init__(self, arm: ArmModel, chain: SerialChain) -> None:
        vars(self).update(vars(arm))
        from flipdiagram.robot.chain import task_kinematics  # imports numba

        self._chain, self._compute = chain, task_kinematics
        self._asked: tuple[ArrayLike | None, ArrayLike | None] = (None, None)
        self.task_kinematics(self.home, np.zeros(self.n_joints))  # compiled now, not in the middle of a motion

    def task_position_velocity(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """As of ArmModel."""
        return self.task_kinematics(q, qd)[:2]

    def task_kinematics(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """As of ArmModel; raises PlanningError where pitch is ±90 deg."""
        if self._asked[0] is not q or self._asked[1] is not qd:
            x, v, J, bias, regular = self._compute(self._chain, q, qd)
            if not regular:
                raise PlanningError(UPRIGHT)
            self._asked, self._answer = (q, qd), (x, v, J, bias)
        return self._answer


def native_arm(arm: ArmModel) -> ArmModel:
    """The arm with its kinematics compiled, itself where it is no chain of revolute joints."""
    chain = serial_chain(arm)
    return NativeArm(arm, chain) if chain else arm
