"""The rows of constraints.py and limits.py, linearised about a trajectory, as loops that numba compiles.

Each function appends rows Σ value·w[column] ≤ upper, in the order in which their NumPy twins add them; `at` = (rows,
entries) counts what is there.  Angles come as sin θ and cos θ from outside.
"""

from __future__ import annotations

import math
from typing import Any

from flipdiagram.planning.horizon import STATES, STRIDE
from flipdiagram.planning.native.jit import jit

THETA = 2


@jit
def put(rows: Any, columns: Any, values: Any, at: Any, column: int, value: float) -> None:
    """One more entry in the row that is being written."""
    e = at[1]
    rows[e], columns[e], values[e] = at[0], column, value
    at[1] = e + 1


@jit
def end_row(upper: Any, at: Any, bound: float) -> None:
    """The row that is being written is complete."""
    upper[at[0]] = bound
    at[0] += 1


@jit
def contact(
    states: Any,
    inputs: Any,
    first: int,
    release: int,
    gravity: float,
    mu: float,
    reach: float,
    half_thickness: float,
    gyration: float,
    least_normal: float,
    release_angle: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """constraints.contact_rows."""
    for side in range(2):
        for kind in range(5):  # normal force; then with either sign friction, centre of pressure
            sign = 1.0 if kind < 3 else -1.0
            for k in range(first, release):
                theta, a_y, a_z = states[k + side, THETA], inputs[k, 0], inputs[k, 1] - gravity
                s, c = math.sin(theta), math.cos(theta)
                f_s, f_n = a_y * c + a_z * s, -a_y * s + a_z * c
                f_s0, f_n0 = -gravity * s - f_n * theta, -gravity * c + f_s * theta
                u, x = STRIDE * k + STATES, STRIDE * (k + side) + THETA
                if kind == 0:
                    along, across, bound = 0.0, -1.0, f_n0 - least_normal
                elif kind % 2 == 1:
                    along, across, bound = sign, -mu, mu * f_n0 - sign * f_s0
                else:
                    along, across = -sign * half_thickness / reach, -1.0
                    bound = f_n0 + sign * half_thickness / reach * f_s0
                    put(rows, columns, values, at, u + 2, sign * gyration / reach)
                put(rows, columns, values, at, u, along * c - across * s)
                put(rows, columns, values, at, u + 1, along * s + across * c)
                put(rows, columns, values, at, x, along * f_n - across * f_s)
                end_row(upper, at, bound)
    put(rows, columns, values, at, STRIDE * release + THETA, -1.0)
    end_row(upper, at, -(math.pi / 2 + release_angle))


@jit
def workspace(first: int, last: int, limits: Any, rows: Any, columns: Any, values: Any, upper: Any, at: Any) -> None:
    """constraints.workspace_rows; limits (2, 2): low and high of y, then of z."""
    for axis in range(2):
        for sign in (1.0, -1.0):
            bound = limits[axis, 1] if sign > 0 else -limits[axis, 0]
            for k in range(first + 1, last + 1):
                put(rows, columns, values, at, STRIDE * k + axis, sign)
                end_row(upper, at, bound)


@jit
def clearance(
    states: Any,
    first: int,
    last: int,
    corners: Any,
    floor: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """constraints.clearance_rows for the corners (m, 2) of one thing, at samples first + 1 to last."""
    for corner in range(corners.shape[0]):
        s, n = corners[corner, 0], corners[corner, 1]
        for k in range(first + 1, last + 1):
            theta = states[k, THETA]
            sine, cosine = math.sin(theta), math.cos(theta)
            slope = s * cosine - n * sine
            put(rows, columns, values, at, STRIDE * k + 1, -1.0)
            put(rows, columns, values, at, STRIDE * k + THETA, -slope)
            end_row(upper, at, s * sine + n * cosine - slope * theta - floor)


@jit
def separation(
    states: Any,
    release: int,
    n_flight: int,
    dt: float,
    gravity: float,
    half_length: float,
    h: float,
    most_gap: float,
    away: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """constraints.separation_rows; away: the acceleration with which the gap demanded grows."""
    intervals = states.shape[0] - 1
    r = STRIDE * release
    for side in (1.0, -1.0):
        for j in range(1, max(intervals - release, n_flight) + 1):
            k = min(release + j, intervals)
            t = min(j, n_flight) * dt
            gap = min(most_gap, away * (j * dt) ** 2 / 2)
            block_y = states[release, 0] + states[release, 3] * t
            block_z = states[release, 1] + states[release, 4] * t
            turned, angle = states[release, 2] + states[release, 5] * t, states[k, 2]
            bs, bc, ts, tc = math.sin(turned), math.cos(turned), math.sin(angle), math.cos(angle)
            y = block_y - states[k, 0] + side * half_length * bc + h * bs
            z = block_z + gravity * t**2 / 2 - states[k, 1] + side * half_length * bs - h * bc
            d_y, d_z = -side * half_length * bs + h * bc, side * half_length * bc + h * bs
            by_block, by_tool = -d_y * ts + d_z * tc, -(y * tc + z * ts)
            put(rows, columns, values, at, r, ts)
            put(rows, columns, values, at, r + 1, -tc)
            put(rows, columns, values, at, r + 3, ts * t)
            put(rows, columns, values, at, r + 4, -tc * t)
            put(rows, columns, values, at, r + 2, -by_block)
            put(rows, columns, values, at, r + 5, -by_block * t)
            put(rows, columns, values, at, STRIDE * k, -ts)
            put(rows, columns, values, at, STRIDE * k + 1, tc)
            put(rows, columns, values, at, STRIDE * k + 2, -by_tool)
            linear = -(block_y - states[k, 0]) * ts + (block_z - states[k, 1]) * tc
            linear += by_block * turned + by_tool * angle
            end_row(upper, at, -y * ts + z * tc + h - linear - gap)


@jit
def flying(
    states: Any,
    release: int,
    n_flight: int,
    dt: float,
    gravity: float,
    corners: Any,
    table: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """constraints.flight_rows; corners (4, 2) of the block."""
    r = STRIDE * release
    for corner in range(corners.shape[0]):
        s, n = corners[corner, 0], corners[corner, 1]
        for j in range(1, n_flight):
            t = j * dt
            theta = states[release, 2] + states[release, 5] * t
            sine, cosine = math.sin(theta), math.cos(theta)
            slope = s * cosine - n * sine
            put(rows, columns, values, at, r + 1, -1.0)
            put(rows, columns, values, at, r + 4, -t)
            put(rows, columns, values, at, r + 2, -slope)
            put(rows, columns, values, at, r + 5, -slope * t)
            end_row(upper, at, s * sine + n * cosine - slope * theta + gravity * t**2 / 2 - table)


@jit
def joint_positions(
    q: Any,
    P: Any,
    states: Any,
    first: int,
    decided: int,
    middle: Any,
    half: Any,
    near: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """The first part of limits.joint_rows; sample k of the motion is `first` + k of the layout."""
    for sign in (1.0, -1.0):
        for k in range(decided, q.shape[0]):
            for j in range(q.shape[1]):
                if abs(q[k, j] - middle[j]) > near * half[j]:
                    here = (q[k, j] - middle[j]) / half[j]
                    for c in range(3):
                        p = P[k, j, c] / half[j]
                        here -= p * states[k, c]
                        put(rows, columns, values, at, STRIDE * (first + k) + c, sign * p)
                    end_row(upper, at, 1 - sign * here)


@jit
def joint_speeds(
    qd: Any,
    P: Any,
    by_pose: Any,
    states: Any,
    first: int,
    decided: int,
    limit: Any,
    near: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """The second part; by_pose (K, n, 3) = ∂q̇/∂(y, z, θ) where a joint is near its limit."""
    for k in range(decided, qd.shape[0]):
        for j in range(qd.shape[1]):
            if abs(qd[k, j]) > near * limit[j]:
                scale = (1.0 if qd[k, j] > 0 else -1.0) / limit[j]
                here = qd[k, j] * scale
                for c in range(STATES):
                    g = scale * (by_pose[k, j, c] if c < 3 else P[k, j, c - 3])
                    here -= g * states[k, c]
                    put(rows, columns, values, at, STRIDE * (first + k) + c, g)
                end_row(upper, at, 1 - here)


@jit
def joint_torques(
    torque: Any,
    by_state: Any,
    by_input: Any,
    states: Any,
    inputs: Any,
    first: int,
    side: int,
    limit: Any,
    near: float,
    rows: Any,
    columns: Any,
    values: Any,
    upper: Any,
    at: Any,
) -> None:
    """limits._torque_rows; by_state (N, n, 6), by_input (K, n, 3) = ∂τ/∂x̂ of each interval, ∂τ/∂a of each sample."""
    for k in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            if abs(torque[k, j]) > near * limit[j]:
                scale = (1.0 if torque[k, j] > 0 else -1.0) / limit[j]
                here = torque[k, j] * scale
                for c in range(STATES):
                    g = scale * by_state[k, j, c]
                    here -= g * states[k + side, c]
                    put(rows, columns, values, at, STRIDE * (first + k + side) + c, g)
                for c in range(3):
                    p = scale * by_input[k + side, j, c]
                    here -= p * inputs[k, c]
                    put(rows, columns, values, at, STRIDE * (first + k) + STATES + c, p)
                end_row(upper, at, 1 - here)
