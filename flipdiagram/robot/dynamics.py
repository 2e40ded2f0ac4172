"""Dynamics of a serial chain, as loops that numba compiles: recursive Newton-Euler equations."""

from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.robot.chain import empty_links, place
from flipdiagram.robot.jit import jit
from flipdiagram.robot.serial_chain import Along, Links, SerialChain

Vector = tuple[float, float, float]


@jit
def vector(rows: Any, i: int) -> Vector:
    """Row i."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@jit
def plus(a: Vector, b: Vector, s: float) -> Vector:
    """a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@jit
def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def times(I: Any, v: Vector) -> Vector:
    """I v."""
    return (
        I[0, 0] * v[0] + I[0, 1] * v[1] + I[0, 2] * v[2],
        I[1, 0] * v[0] + I[1, 1] * v[1] + I[1, 2] * v[2],
        I[2, 0] * v[0] + I[2, 1] * v[1] + I[2, 2] * v[2],
    )


@jit
def carried(a: Vector, omega: Vector, alpha: Vector, r: Vector) -> Vector:
    """Acceleration of a point r away on a body that turns with ω, ω':  a + ω' × r + ω × (ω × r)."""
    return plus(plus(a, cross(alpha, r), 1.0), cross(omega, cross(omega, r)), 1.0)


@jit
def newton_euler(
    chain: SerialChain, links: Links, k: int, qd: Any, qdd: Any, gravity: float, F: Any, N: Any, tau: Any
) -> None:
    """Fill τ (n,) of a motion at sample k: inertia, Coriolis, gravity along z, reflected inertia, damping.

    F, N (n, 3): room for the force and the moment that each link needs.
    """
    axes, points, centres, inertias = links.axes[k], links.points[k], links.centres[k], links.inertias[k]
    n, rest = qd.size, (0.0, 0.0, 0.0)
    omega, alpha, a = rest, rest, (0.0, 0.0, -gravity)  # a: of the last point on an axis, less gravity
    for i in range(n):
        axis, point, I = vector(axes, i), vector(points, i), inertias[i]
        if i > 0:
            a = carried(a, omega, alpha, plus(point, vector(points, i - 1), -1.0))
        alpha = plus(plus(alpha, axis, qdd[i]), cross(omega, axis), qd[i])
        omega = plus(omega, axis, qd[i])
        force = carried(a, omega, alpha, plus(vector(centres, i), point, -1.0))
        moment = plus(times(I, alpha), cross(omega, times(I, omega)), 1.0)
        for r in range(3):
            F[i, r], N[i, r] = chain.mass[i] * force[r], moment[r]
    force = moment = rest
    for i in range(n - 1, -1, -1):
        axis, point, needed = vector(axes, i), vector(points, i), vector(F, i)
        if i < n - 1:
            moment = plus(moment, cross(plus(vector(points, i + 1), point, -1.0), force), 1.0)
        moment = plus(moment, vector(N, i), 1.0)
        moment = plus(moment, cross(plus(vector(centres, i), point, -1.0), needed), 1.0)
        force = plus(force, needed, 1.0)
        tau[i] = axis[0] * moment[0] + axis[1] * moment[1] + axis[2] * moment[2]
        tau[i] += chain.rotor[i] * qdd[i] + chain.damping[i] * qd[i]


@jit
def task_dynamics(chain: SerialChain, at: Along) -> tuple[Floats, Floats]:
    """M P (K, n, 3), the torque that each acceleration of y, z, θ costs, and the torque (K, n) without any."""
    count, n = at.qd.shape
    F, N, MP, tau = np.empty((n, 3)), np.empty((n, 3)), np.empty((count, n, 3)), np.empty((count, n))
    qdd, column, rest = np.empty(n), np.empty(n), np.zeros(n)
    for k in range(count):
        for axis in range(3):
            for i in range(n):
                qdd[i] = at.from_task[k, i, axis]
            newton_euler(chain, at.links, k, rest, qdd, 0.0, F, N, column)
            for i in range(n):
                MP[k, i, axis] = column[i]
        for i in range(n):
            qdd[i] = 0.0
            for r in range(6):
                qdd[i] -= at.from_task[k, i, r] * at.bias[k, r]
        newton_euler(chain, at.links, k, at.qd[k], qdd, chain.gravity, F, N, tau[k])
    return MP, tau


@jit
def gravity_torque(chain: SerialChain, q: Any) -> Floats:
    """Torques (n,) that hold the arm still at joint angles q (n,), as of ArmModel."""
    n = q.size
    links, F, N, tau, rest = empty_links(1, n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.zeros(n)
    place(chain, q, links, 0, True)
    newton_euler(chain, links, 0, rest, rest, chain.gravity, F, N, tau)
    return tau
