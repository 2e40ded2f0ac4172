"""Kinematics of a serial chain of revolute joints along many samples, as loops that numba compiles.

The chain is described at q = 0 (robot/serial_chain.py); with joint i turning about the axis a_i through the point c_i,
    T_i(q) = T_{i-1}(q) · (rotation by q_i about a_i through c_i),
and at q the axis is where T_{i-1} brings it, the link where T_i does.  Nothing here calls what another file compiles,
as numba's cache would not notice that it has changed.
"""

import math
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.robot.jit import jit
from flipdiagram.robot.serial_chain import Along, Links, SerialChain
from flipdiagram.robot.task_space import COS_PITCH_MIN, UPRIGHT

TURN = 2 * math.pi
ITERATIONS = 12
"""Newton iterations per sample; more means that the path is hard, and the search in inverse_kinematics takes over."""
LONGEST_STEP = 0.3
"""Most that a joint turns from one sample to the next [rad], as in inverse_kinematics."""


@jit
def empty_links(count: int, n: int) -> Links:
    """Room for `count` samples of n joints."""
    w, o, c = np.empty((count, n, 3)), np.empty((count, n, 3)), np.empty((count, n, 3))
    return Links(w, o, c, np.empty((count, n, 3, 3)), np.empty((count, 4, 3)), np.empty((10, 3)))


@jit
def place(chain: SerialChain, q: Any, links: Links, k: int, massive: bool) -> None:
    """Fill sample k of `links` for joint angles q (n,): mass centres and inertias only where `massive`."""
    axes, points, tip, tip_turn = chain.axes, chain.points, chain.tip, chain.tip_turn
    w, o, end, scratch = links.axes[k], links.points[k], links.end[k], links.scratch
    c, inertia, centres, inertias = links.centres[k], links.inertias[k], chain.centres, chain.inertias
    R, E, S, p = scratch[:3], scratch[3:6], scratch[6:9], scratch[9]
    for r in range(3):
        p[r] = 0.0
        for s in range(3):
            R[r, s] = 1.0 if r == s else 0.0
    for i in range(q.size):
        for r in range(3):
            w[i, r] = R[r, 0] * axes[i, 0] + R[r, 1] * axes[i, 1] + R[r, 2] * axes[i, 2]
            o[i, r] = R[r, 0] * points[i, 0] + R[r, 1] * points[i, 1] + R[r, 2] * points[i, 2] + p[r]
        x, y, z = axes[i, 0], axes[i, 1], axes[i, 2]
        sine, cosine = math.sin(q[i]), math.cos(q[i])
        rest = 1.0 - cosine
        E[0, 0], E[0, 1], E[0, 2] = cosine + rest * x * x, rest * x * y - sine * z, rest * x * z + sine * y
        E[1, 0], E[1, 1], E[1, 2] = rest * x * y + sine * z, cosine + rest * y * y, rest * y * z - sine * x
        E[2, 0], E[2, 1], E[2, 2] = rest * x * z - sine * y, rest * y * z + sine * x, cosine + rest * z * z
        for r in range(3):
            for s in range(3):
                S[r, s] = R[r, 0] * E[0, s] + R[r, 1] * E[1, s] + R[r, 2] * E[2, s]
        for r in range(3):
            for s in range(3):
                R[r, s] = S[r, s]
            # the axis stays where it is: p = o − R c
            p[r] = o[i, r] - (R[r, 0] * points[i, 0] + R[r, 1] * points[i, 1] + R[r, 2] * points[i, 2])
        if not massive:
            continue
        for r in range(3):
            c[i, r] = R[r, 0] * centres[i, 0] + R[r, 1] * centres[i, 1] + R[r, 2] * centres[i, 2] + p[r]
            for s in range(3):
                S[r, s] = R[r, 0] * inertias[i, 0, s] + R[r, 1] * inertias[i, 1, s] + R[r, 2] * inertias[i, 2, s]
        for r in range(3):
            for s in range(3):
                inertia[i, r, s] = S[r, 0] * R[s, 0] + S[r, 1] * R[s, 1] + S[r, 2] * R[s, 2]
    for r in range(3):
        for s in range(3):
            end[r, s] = R[r, 0] * tip_turn[0, s] + R[r, 1] * tip_turn[1, s] + R[r, 2] * tip_turn[2, s]
        end[3, r] = R[r, 0] * tip[0] + R[r, 1] * tip[1] + R[r, 2] * tip[2] + p[r]


@jit
def rates(end: Any, w_y: float, w_x: float, w_z: float) -> tuple[float, float, float]:
    """θ', pitch', yaw' of an angular velocity: the rows of task_space.rate_map."""
    cos_pitch = math.hypot(end[0, 0], end[1, 0])
    cos_yaw, sin_yaw = end[0, 0] / cos_pitch, end[1, 0] / cos_pitch
    theta = (cos_yaw * w_x + sin_yaw * w_y) / cos_pitch
    return theta, cos_yaw * w_y - sin_yaw * w_x, w_z - end[2, 0] * theta


@jit
def jacobian(links: Links, k: int, J: Any) -> bool:
    """Fill J (6, n) of the task coordinates (y, z, θ, x, pitch, yaw); False where pitch is ±90°."""
    w, o, end = links.axes[k], links.points[k], links.end[k]
    if math.hypot(end[0, 0], end[1, 0]) < COS_PITCH_MIN:
        return False
    for i in range(w.shape[0]):
        x, y, z = end[3, 0] - o[i, 0], end[3, 1] - o[i, 1], end[3, 2] - o[i, 2]
        J[3, i] = w[i, 1] * z - w[i, 2] * y
        J[0, i] = w[i, 2] * x - w[i, 0] * z
        J[1, i] = w[i, 0] * y - w[i, 1] * x
        J[2, i], J[4, i], J[5, i] = rates(end, w[i, 1], w[i, 0], w[i, 2])
    return True


@jit
def coordinates(end: Any, x: Any) -> None:
    """Fill x (6,), the task coordinates of a pose, as of task_space."""
    theta = math.atan2(end[2, 1], end[2, 2])
    x[0], x[1], x[2], x[3] = end[3, 1], end[3, 2], theta if theta > -TURN / 4 else theta + TURN, end[3, 0]
    x[4], x[5] = math.atan2(-end[2, 0], math.hypot(end[0, 0], end[1, 0])), math.atan2(end[1, 0], end[0, 0])


@jit
def pose_error(target: Any, end: Any, error: Any) -> float:
    """Fill target − x (6,), angles the short way round; returns the largest of them."""
    error[0], error[1], error[3] = target[0] - end[3, 1], target[1] - end[3, 2], target[3] - end[3, 0]
    error[2] = target[2] - math.atan2(end[2, 1], end[2, 2])
    error[4] = target[4] - math.atan2(-end[2, 0], math.hypot(end[0, 0], end[1, 0]))
    error[5] = target[5] - math.atan2(end[1, 0], end[0, 0])
    largest = 0.0
    for i in range(6):
        if i == 2 or i > 3:
            error[i] -= TURN * np.rint(error[i] / TURN)
        largest = max(largest, abs(error[i]))
    return largest


@jit
def factorise(J: Any, G: Any) -> bool:
    """Fill the lower triangle of G (6, 6) with G Gᵀ = J Jᵀ; False where J has lost its rank."""
    n = J.shape[1]
    for r in range(6):
        for s in range(r + 1):
            total = 0.0
            for j in range(n):
                total += J[r, j] * J[s, j]
            for k in range(s):
                total -= G[r, k] * G[s, k]
            if r == s:
                if total <= 1e-14:
                    return False
                G[r, r] = math.sqrt(total)
            else:
                G[r, s] = total / G[s, s]
    return True


@jit
def back(G: Any, y: Any) -> None:
    """Replace y (6,) by (G Gᵀ)⁻¹ y."""
    for r in range(6):
        for k in range(r):
            y[r] -= G[r, k] * y[k]
        y[r] /= G[r, r]
    for r in range(5, -1, -1):
        for k in range(r + 1, 6):
            y[r] -= G[k, r] * y[k]
        y[r] /= G[r, r]


@jit
def bias_acceleration(qd: Any, w: Any, o: Any, end: Any, bias: Any) -> None:
    """Fill J' q̇ (6,): the acceleration of the task coordinates without any of the joints."""
    vx = vy = vz = ax = ay = az = bx = by = bz = 0.0
    n = qd.size
    for i in range(n + 1):
        if i > 0:
            x, y, z = (end[3, 0], end[3, 1], end[3, 2]) if i == n else (o[i, 0], o[i, 1], o[i, 2])
            x, y, z = x - o[i - 1, 0], y - o[i - 1, 1], z - o[i - 1, 2]
            dot, square = vx * x + vy * y + vz * z, vx * vx + vy * vy + vz * vz
            bx += ay * z - az * y + vx * dot - x * square
            by += az * x - ax * z + vy * dot - y * square
            bz += ax * y - ay * x + vz * dot - z * square
        if i < n:
            s = qd[i]
            ax += (vy * w[i, 2] - vz * w[i, 1]) * s
            ay += (vz * w[i, 0] - vx * w[i, 2]) * s
            az += (vx * w[i, 1] - vy * w[i, 0]) * s
            vx, vy, vz = vx + w[i, 0] * s, vy + w[i, 1] * s, vz + w[i, 2] * s
    bias[0], bias[1], bias[3] = by, bz, bx
    theta_a, pitch_a, yaw_a = rates(end, ay, ax, az)
    theta_v, pitch_v, yaw_v = rates(end, vy, vx, vz)
    cos_pitch = math.hypot(end[0, 0], end[1, 0])
    theta = pitch_v * (yaw_v - end[2, 0] * theta_v) / cos_pitch  # N' [ω; p'], as in task_space.rate_bias
    bias[2] = theta_a + theta
    bias[4] = pitch_a - yaw_v * theta_v * cos_pitch
    bias[5] = yaw_a + pitch_v * theta_v * cos_pitch - end[2, 0] * theta


@jit
def follow(chain: SerialChain, targets: Any, tolerance: float, q: Any) -> int:
    """Fill q (K, n) along the task poses (K, 6) by steps Jᵀ (J Jᵀ)⁻¹ error; q[0] is given.

    Each sample starts from the quadratic extrapolation of the three before.  Returns the first sample that Newton's
    method does not reach, K where it reaches all.
    """
    count, n = q.shape
    links, J, G, error = empty_links(1, n), np.empty((6, n)), np.zeros((6, 6)), np.empty(6)
    for k in range(1, count):
        for i in range(n):
            if k == 1:
                q[k, i] = q[0, i]
            elif k == 2:
                q[k, i] = 2 * q[1, i] - q[0, i]
            else:
                q[k, i] = 3 * (q[k - 1, i] - q[k - 2, i]) + q[k - 3, i]
        reached = False
        for _ in range(ITERATIONS):
            place(chain, q[k], links, 0, False)
            if pose_error(targets[k], links.end[0], error) < tolerance:
                reached = True
                break
            if not jacobian(links, 0, J) or not factorise(J, G):
                break
            back(G, error)
            longest = 0.0
            for i in range(n):
                step = 0.0
                for r in range(6):
                    step += J[r, i] * error[r]
                q[k, i] += step
                longest = max(longest, abs(step))
            if not longest < LONGEST_STEP:
                break
        for i in range(n):
            reached = reached and abs(q[k, i] - q[k - 1, i]) <= LONGEST_STEP
        if not reached:
            return k
    return count


@jit
def along(chain: SerialChain, q: Any, v: Any) -> Along:
    """The chain at joint angles q (K, n), its tool moving with v (K, 3)."""
    count, n = q.shape
    links, J, G = empty_links(count, n), np.empty((6, n)), np.zeros((6, 6))
    P, qd, bias = np.empty((count, n, 6)), np.empty((count, n)), np.empty((count, 6))
    for k in range(count):
        place(chain, q[k], links, k, True)
        if not jacobian(links, k, J) or not factorise(J, G):
            return Along(links, P, qd, bias, False)
        for i in range(n):
            P[k, i] = J[:, i]
            back(G, P[k, i])  # a row of Jᵀ (J Jᵀ)⁻¹, the matrix being symmetric
            qd[k, i] = P[k, i, 0] * v[k, 0] + P[k, i, 1] * v[k, 1] + P[k, i, 2] * v[k, 2]
        bias_acceleration(qd[k], links.axes[k], links.points[k], links.end[k], bias[k])
    return Along(links, P, qd, bias, True)


@jit
def speeds(chain: SerialChain, q: Any, v: Any, qd: Any) -> bool:
    """Fill q̇ (K, n) alone, as `along`; False where a pose is singular."""
    count, n = q.shape
    links, J, G, y = empty_links(1, n), np.empty((6, n)), np.zeros((6, 6)), np.empty(6)
    for k in range(count):
        place(chain, q[k], links, 0, False)
        if not jacobian(links, 0, J) or not factorise(J, G):
            return False
        y[:3], y[3:] = v[k], 0.0
        back(G, y)
        for i in range(n):
            qd[k, i] = 0.0
            for r in range(6):
                qd[k, i] += J[r, i] * y[r]
    return True


@jit
def tool_along(chain: SerialChain, q: Any, qd: Any) -> tuple[Floats, Floats, Floats]:
    """x, v (K, 6) at joint angles and speeds (K, n), and `end` of `Links` (K, 4, 3); PlanningError at pitch ±90°."""
    count, n = q.shape
    links, J, end = empty_links(1, n), np.empty((6, n)), np.empty((count, 4, 3))
    x, v = np.empty((count, 6)), np.zeros((count, 6))
    for k in range(count):
        place(chain, q[k], links, 0, False)
        coordinates(links.end[0], x[k])
        if not jacobian(links, 0, J):
            raise PlanningError(UPRIGHT)
        for i in range(n):
            v[k] += J[:, i] * qd[k, i]
        end[k] = links.end[0]
    return x, v, end


@jit
def task_position_velocity(chain: SerialChain, q: Any, qd: Any) -> tuple[Floats, Floats]:
    """x, v (6,) at joint angles and speeds (n,), as of ArmModel."""
    x, v, _ = tool_along(chain, q.reshape((1, q.size)), qd.reshape((1, q.size)))
    return x[0], v[0]


@jit
def task_kinematics(chain: SerialChain, q: Any, qd: Any) -> tuple[Floats, Floats, Floats, Floats]:
    """x, v (6,), J (6, n), J' q̇ (6,) at joint angles and speeds (n,), as of ArmModel."""
    links, x, v, J, bias = empty_links(1, q.size), np.empty(6), np.zeros(6), np.empty((6, q.size)), np.empty(6)
    place(chain, q, links, 0, False)
    coordinates(links.end[0], x)
    if not jacobian(links, 0, J):
        raise PlanningError(UPRIGHT)
    for i in range(q.size):
        v += J[:, i] * qd[i]
    bias_acceleration(qd, links.axes[0], links.points[0], links.end[0], bias)
    return x, v, J, bias
