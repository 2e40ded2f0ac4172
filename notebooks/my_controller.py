import numpy as np

NAME = "computed torque"


def reset(memory):
    memory["k_p"], memory["k_v"] = 900.0, 60.0


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    arm = memory["arm"]
    x, v, J, bias = arm.task_kinematics(q, qd)
    a = a_cmd + memory["k_v"] * (v_cmd - v) + memory["k_p"] * (x_cmd - x)
    return 1 / 0 + arm.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias))
