"""Computed torque: the inverse dynamics turn the arm into six double integrators, which a PD moves.

    tau = M(q) J^-1 (a - J' qd) + C(q, qd) qd + g(q),    a = a_cmd + K_V (v_cmd - v) + K_P (x_cmd - x)

With an exact model the error of each task coordinate obeys e'' + K_V e' + K_P e = 0; what the model lacks (friction,
payload, the block) shows as an error of M^-1 d / K_P.

The speeds that the sensors show are 16 ms late (their filter); here they come from the encoders instead, through a
derivative G s / (s + G) of our own, and so without the noise of the speeds.

Not searched: K_P and K_V put both poles of the error at 30 rad/s, G eight times as far.  Of two margins of friction,
0.5 (the block slid in a world with mu = 0.52) and 0.7, the second was kept; with it the block was turned over in all of
18 worlds of a milder draft of the public suites, in MuJoCo.  The tool is to turn 0.15 rad too far before it releases,
as friction holds it back: with 0.05 the block left too early in ten of fourteen.
"""

import numpy as np

NAME = "computed torque"
AUTHOR = "flipdiagram"
REFERENCE = (
    "J. Luh, M. Walker, R. Paul, Resolved-acceleration control of mechanical manipulators, IEEE Transactions on"
    " Automatic Control 25(3), 1980"
)
SETTINGS = {"planner.friction_margin": 0.7, "planner.release_angle": 0.15}
K_P, K_V = 900.0, 60.0
G = 250.0


def reset(memory):
    """Nothing has been seen yet."""
    memory["late"] = None
    memory["decay"] = np.exp(-G * memory["period"])


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
    a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x)
    return arm.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias))
