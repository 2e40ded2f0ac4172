"""Super-twisting sliding mode on top of the inverse dynamics, in the coordinates of the tool.

    s = (v_cmd - v) + SLOPE (x_cmd - x)
    a = a_cmd + SLOPE (v_cmd - v) + k1 phi(s) + z,    z' = k2 phi'(s) phi(s),    phi(s) = |s|^(1/2) sgn(s) + MU s
    tau = M J^-1 (a - J' qd) + C qd + g

Of an acceleration w that the model lacks, s' = -w - k1 phi(s) - z.  With k1 = 1.5 sqrt(L), k2 = 2.2 L, where L bounds
|w'|, s is zero after a finite time, not only in the limit, and z is then -w: the discontinuity stands behind an
integral, so the torque is continuous.  MU, the linear term of Moreno and Osorio, pulls harder where s is large.

What is left of finite time here: the angles come 1 ms late, their derivative through G s / (s + G) later still, and s
stays within what changes in that time.  L is small for that reason.

Not searched: the numbers are those of the first flip.  Only the margin of friction was raised, from 0.5 to 0.7; with it
the block was turned over in all of 18 worlds of a milder draft of the public suites, in MuJoCo.
"""

import numpy as np

NAME = "super-twisting"
AUTHOR = "flipdiagram"
REFERENCE = (
    "A. Levant, Sliding order and sliding accuracy in sliding mode control, International Journal of Control 58(6),"
    " 1993; J. Moreno, M. Osorio, Strict Lyapunov functions for the super-twisting algorithm, IEEE Transactions on"
    " Automatic Control 57(4), 2012"
)
SETTINGS = {"planner.friction_margin": 0.7, "planner.release_angle": 0.15}
SLOPE, MU = 25.0, 8.0
L, L_ANGLE = 10.0, 60.0
G = 300.0


def super_twisting(s, z, bound, mu, period):
    """(u, next z): s' = -w - u with u = k1 phi(s) + z; `bound` L of |w'|, one per channel; shapes of s."""
    root = np.sqrt(np.abs(s)) * np.sign(s)
    u = 1.5 * np.sqrt(bound) * (root + mu * s) + z
    return u, z + period * 2.2 * bound * (0.5 * np.sign(s) + 1.5 * mu * root + mu**2 * s)


def reset(memory):
    """Nothing has been seen yet."""
    memory["late"], memory["z"] = None, np.zeros(6)
    memory["decay"] = np.exp(-G * memory["period"])
    memory["bound"] = np.array([L, L, L_ANGLE, L, L_ANGLE, L_ANGLE])


def speeds(q, memory):
    """The derivative of q (n,) [rad/s]: G times what its low-pass lags behind."""
    if memory["late"] is None:
        memory["late"] = q
    qd = G * (q - memory["late"])
    memory["late"] = memory["decay"] * memory["late"] + (1 - memory["decay"]) * q
    return qd


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """The torque of each joint [N m]."""
    arm, qd = memory["arm"], speeds(q, memory)
    x, v, J, bias = arm.task_kinematics(q, qd)
    s = (v_cmd - v) + SLOPE * (x_cmd - x)
    u, memory["z"] = super_twisting(s, memory["z"], memory["bound"], MU, memory["period"])
    a = a_cmd + SLOPE * (v_cmd - v) + u
    return arm.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias))
