"""An entry for `flipdiagram challenge`: a torque for every millisecond in which an arm turns a block over.

Fly it with:     flipdiagram challenge my_controller.py

What is here is computed torque: the inverse dynamics of the arm as planned, with PD on the tool.  Change `control`,
or write one of the others in its place:

    def controller(scenario): ...   returns a pydrake System with output port "tau" and any of the input ports
                                    x_cmd, v_cmd, a_cmd, x, v (6 each), q, qd (one per joint)
    def plan(scenario): ...         returns a flipdiagram.Plan, what the controller follows; beside a controller too
    ARCHITECTURE = "pd+ff+dob"      one of the paper's (pd, pd+ff, pd+dob, pd+ff+dob), where there is neither
    SETTINGS = {"controller.k_p": 500}    fields of planner and controller (flipdiagram scenario prints them)
"""

import numpy as np

NAME = "computed torque"
AUTHOR = "your name"
REFERENCE = "where the idea comes from: a paper, a book, a page"


def reset(memory):
    """Called once before each flip (leave it out if there is nothing to do).

    memory is a dict of your own, which every call of `control` gets.  In it already:
      memory["arm"]       the arm as planned: task_kinematics(q, qd) -> x, v, J, bias; mass_matrix(q);
                          inverse_dynamics(q, qd, qdd); gravity_torque(q); tau_max, q_min, q_max, qd_max, n_joints
      memory["scenario"]  what is known of the world; what else is true there nobody tells
      memory["period"]    seconds between two calls, 0.001
    """
    memory["k_p"], memory["k_v"] = 900.0, 60.0


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """The torque of each joint [N m] until the next call.

    t [s]: 0 when the motion starts, below 0 while the arm holds the start.
    x_cmd, v_cmd, a_cmd (6,): y, z [m], theta [rad], x [m], pitch, yaw [rad] of the tool, where the block's centre rests
        on it; per s; per s^2.
    q, qd (6,): joint angles [rad], late, and speeds [rad/s], late, filtered and noisy, as the sensors show them.
    The drives limit what is returned, an array or a list, to tau_max.
    """
    arm = memory["arm"]
    x, v, J, bias = arm.task_kinematics(q, qd)
    a = a_cmd + memory["k_v"] * (v_cmd - v) + memory["k_p"] * (x_cmd - x)
    return arm.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias))
