"""Slotine and Li's passivity-based law on the tool, with their adaptation of a constant torque for each joint.

    s = qd_r - qd,   qd_r = J^-1 (v_cmd + lam e),   e = x_cmd - x,   J qdd_r = a_cmd + lam (v_cmd - v) - dJ/dt qd_r
    tau = M(q) qdd_r + C(q, qd) qd_r + g(q) + lam_s M(q) s + d,   dd/dt = gamma M(q) s

C is the one of the Christoffel symbols, C(q, a) b = C(q, b) a, so that dM/dt - 2 C is skew-symmetric: it comes from the
inverse dynamics by polarisation, 2 C(q, a) b = c(a + b) - c(a) - c(b) with c(a) = C(q, a) a, and dJ/dt qd_r likewise.
"""

import numpy as np

NAME = "Slotine-Li with an adapted joint torque"
AUTHOR = "a stranger"
REFERENCE = (
    "J.-J. E. Slotine and W. Li, On the adaptive control of robot manipulators, "
    "International Journal of Robotics Research 6(3), 1987, pp. 49-59"
)

LAM, LAM_S, GAMMA = 30.0, 30.0, 150.0  # 1/s, 1/s, 1/s2


def reset(memory):
    """No torque is unknown at the beginning."""
    memory["d"] = np.zeros(memory["arm"].n_joints)


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """The torque of each joint [N m]."""
    arm = memory["arm"]
    zero = np.zeros(arm.n_joints)
    x, v, J, bias = arm.task_kinematics(q, qd)
    qd_r = np.linalg.solve(J, v_cmd + LAM * (x_cmd - x))
    s = qd_r - qd

    bias_sum, bias_r = arm.task_kinematics(q, qd + qd_r)[3], arm.task_kinematics(q, qd_r)[3]
    qdd_r = np.linalg.solve(J, a_cmd + LAM * (v_cmd - v) - (bias_sum - bias - bias_r) / 2)

    g, M = arm.gravity_torque(q), arm.mass_matrix(q)

    def c(velocity):
        return arm.inverse_dynamics(q, velocity, zero) - g

    coriolis = (c(qd + qd_r) - c(qd) - c(qd_r)) / 2
    memory["d"] = memory["d"] + memory["period"] * GAMMA * (M @ s)
    return M @ (qdd_r + LAM_S * s) + coriolis + g + memory["d"]
