"""Dynamics of a serial chain along many samples, as loops that numba compiles: recursive Newton-Euler equations.

They take what chain.along fills.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flipdiagram.planning.native.jit import jit


@jit
def newton_euler(
    qd: Any,
    qdd: Any,
    gravity: float,
    w: Any,
    o: Any,
    c: Any,
    links: Any,
    mass: Any,
    rotor: Any,
    damping: Any,
    F: Any,
    N: Any,
    tau: Any,
) -> None:
    """Fill τ (n,) of the motion: inertia, Coriolis, gravity along z, reflected inertia, damping; F, N are scratch."""
    n = qd.size
    vx = vy = vz = 0.0  # ω
    ax = ay = az = 0.0  # ω'
    bx, by, bz = 0.0, 0.0, -gravity  # acceleration of the last point on an axis, less gravity
    for i in range(n):
        if i > 0:
            x, y, z = o[i, 0] - o[i - 1, 0], o[i, 1] - o[i - 1, 1], o[i, 2] - o[i - 1, 2]
            dot, square = vx * x + vy * y + vz * z, vx * vx + vy * vy + vz * vz
            bx += ay * z - az * y + vx * dot - x * square
            by += az * x - ax * z + vy * dot - y * square
            bz += ax * y - ay * x + vz * dot - z * square
        s, t = qd[i], qdd[i]
        ax += w[i, 0] * t + (vy * w[i, 2] - vz * w[i, 1]) * s
        ay += w[i, 1] * t + (vz * w[i, 0] - vx * w[i, 2]) * s
        az += w[i, 2] * t + (vx * w[i, 1] - vy * w[i, 0]) * s
        vx += w[i, 0] * s
        vy += w[i, 1] * s
        vz += w[i, 2] * s
        x, y, z = c[i, 0] - o[i, 0], c[i, 1] - o[i, 1], c[i, 2] - o[i, 2]
        dot, square = vx * x + vy * y + vz * z, vx * vx + vy * vy + vz * vz
        F[i, 0] = mass[i] * (bx + ay * z - az * y + vx * dot - x * square)
        F[i, 1] = mass[i] * (by + az * x - ax * z + vy * dot - y * square)
        F[i, 2] = mass[i] * (bz + ax * y - ay * x + vz * dot - z * square)
        hx = links[i, 0, 0] * vx + links[i, 0, 1] * vy + links[i, 0, 2] * vz
        hy = links[i, 1, 0] * vx + links[i, 1, 1] * vy + links[i, 1, 2] * vz
        hz = links[i, 2, 0] * vx + links[i, 2, 1] * vy + links[i, 2, 2] * vz
        N[i, 0] = links[i, 0, 0] * ax + links[i, 0, 1] * ay + links[i, 0, 2] * az + vy * hz - vz * hy
        N[i, 1] = links[i, 1, 0] * ax + links[i, 1, 1] * ay + links[i, 1, 2] * az + vz * hx - vx * hz
        N[i, 2] = links[i, 2, 0] * ax + links[i, 2, 1] * ay + links[i, 2, 2] * az + vx * hy - vy * hx
    fx = fy = fz = 0.0
    nx = ny = nz = 0.0
    for i in range(n - 1, -1, -1):
        if i < n - 1:
            x, y, z = o[i + 1, 0] - o[i, 0], o[i + 1, 1] - o[i, 1], o[i + 1, 2] - o[i, 2]
            nx += y * fz - z * fy
            ny += z * fx - x * fz
            nz += x * fy - y * fx
        x, y, z = c[i, 0] - o[i, 0], c[i, 1] - o[i, 1], c[i, 2] - o[i, 2]
        nx += N[i, 0] + y * F[i, 2] - z * F[i, 1]
        ny += N[i, 1] + z * F[i, 0] - x * F[i, 2]
        nz += N[i, 2] + x * F[i, 1] - y * F[i, 0]
        fx += F[i, 0]
        fy += F[i, 1]
        fz += F[i, 2]
        tau[i] = w[i, 0] * nx + w[i, 1] * ny + w[i, 2] * nz + rotor[i] * qdd[i] + damping[i] * qd[i]


@jit
def torques(
    q_dot: Any,
    a: Any,
    P: Any,
    bias: Any,
    gravity: float,
    w: Any,
    o: Any,
    c: Any,
    links: Any,
    mass: Any,
    rotor: Any,
    damping: Any,
    tau: Any,
) -> None:
    """Fill τ (K, n) where the tool accelerates with a (K, 3)."""
    count, n = q_dot.shape
    F, N, qdd = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for k in range(count):
        for i in range(n):
            qdd[i] = 0.0
            for r in range(6):
                qdd[i] += P[k, i, r] * ((a[k, r] if r < 3 else 0.0) - bias[k, r])
        newton_euler(q_dot[k], qdd, gravity, w[k], o[k], c[k], links[k], mass, rotor, damping, F, N, tau[k])


@jit
def inertia_of_task(P: Any, w: Any, o: Any, c: Any, links: Any, mass: Any, rotor: Any, MP: Any) -> None:
    """Fill M P (K, n, 3): the torque that each acceleration of y, z, θ costs."""
    count, n = P.shape[0], P.shape[1]
    F, N, qdd, column, none = np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n), np.zeros(n)
    for k in range(count):
        for axis in range(3):
            for i in range(n):
                qdd[i] = P[k, i, axis]
            newton_euler(none, qdd, 0.0, w[k], o[k], c[k], links[k], mass, rotor, none, F, N, column)
            for i in range(n):
                MP[k, i, axis] = column[i]
