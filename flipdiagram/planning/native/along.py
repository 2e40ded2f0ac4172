"""A chain of joints along many samples at once: where it is, how fast, and what torques a motion costs."""

from __future__ import annotations

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning.native import chain as kinematics
from flipdiagram.planning.native import dynamics
from flipdiagram.robot.serial_chain import SerialChain


class Along:
    """What chain.along fills for joint angles q (K, n) and tool velocities v (K, 3).

    regular: no pose is singular; else the numbers mean nothing.
    """

    def __init__(self, chain: SerialChain, q: Floats, v: Floats) -> None:
        count, n = q.shape
        self.chain = chain
        self.w, self.o, self.c = np.empty((3, count, n, 3))
        self.links, self.from_task = np.empty((count, n, 3, 3)), np.empty((count, n, 6))
        self.qd, self.bias = np.empty((count, n)), np.empty((count, 6))
        self.regular = kinematics.along(
            q,
            v,
            chain.axes,
            chain.points,
            chain.centres,
            chain.inertias,
            chain.tip,
            chain.tip_turn,
            self.w,
            self.o,
            self.c,
            self.links,
            self.from_task,
            self.qd,
            self.bias,
        )

    def checked(self) -> Along:
        """Itself; raises PlanningError where a pose is singular."""
        _check(self.regular)
        return self

    def torques(self, a: Floats) -> Floats:
        """τ (K, n) for tool accelerations a (K, 3)."""
        chain, tau = self.chain, np.empty_like(self.qd)
        dynamics.torques(
            self.qd,
            a,
            self.from_task,
            self.bias,
            chain.gravity,
            self.w,
            self.o,
            self.c,
            self.links,
            chain.mass,
            chain.rotor,
            chain.damping,
            tau,
        )
        return tau

    def inertia_of_task(self) -> Floats:
        """∂τ/∂a (K, n, 3)."""
        chain, found = self.chain, np.empty((*self.qd.shape, 3))
        dynamics.inertia_of_task(self.from_task, self.w, self.o, self.c, self.links, chain.mass, chain.rotor, found)
        return found


def speeds(chain: SerialChain, q: Floats, v: Floats) -> Floats:
    """q̇ (K, n) alone, for joint angles q (K, n), tool velocities v (K, 3); raises PlanningError where q is singular."""
    qd = np.empty_like(q)
    _check(kinematics.speeds(q, v, chain.axes, chain.points, chain.tip, chain.tip_turn, qd))
    return qd


def _check(regular: bool) -> None:
    if not regular:
        raise PlanningError("the arm cannot follow the path: it passes a singular pose")
