"""Untuned and hard to beat: a careful plan, followed exactly, by a controller that does not listen to noise.

1. The plan keeps 70 % of the friction in reserve and starts gently (SETTINGS).  This alone decides about the block:
   what is followed exactly holds where the true friction is above the one that was planned with.
2. The model is fed forward: inertia, Coriolis, gravity, joint friction of the arm as it is known.
3. An extended state observer on the joint *angles* gives angle, speed and the disturbance d that is left,
       q' = v,   M v' = tau - h(q, v) - f(v) + d,   d' = 0,
   corrected by what the encoders show, e = q_measured(t) - q(t - delay), with all three poles at -w.  The measured
   speed, late by its filter and noisy, is not used: so its noise does not reach the torque.
4. PD on the estimates, in the space of the tool:
       tau = M J^-1 (a_cmd + k_v (v_cmd - v) + k_p (x_cmd - x) - J' qd) + h + f - d

docs/explanation/robust-controller.md tells what each of these brings.
"""

import numpy as np

NAME = "robust"
AUTHOR = "flipdiagram"
REFERENCE = (
    "J. Han, From PID to Active Disturbance Rejection Control, IEEE Transactions on Industrial Electronics 56(3), "
    "900-906, 2009"
)
SETTINGS = {
    "planner.friction_margin": 0.7,
    "planner.minimum_normal": 4.0,
    "planner.support_margin": 0.3,
    "planner.contact_samples": [10, 30],
    "planner.table_clearance": 0.02,
}
K_P, K_V = 900.0, 60.0
"""Of the tool [1/s^2, 1/s]: two poles at -30 rad/s."""
OBSERVER = 120.0
"""w, the poles of the observer [rad/s]."""


def reset(memory):
    """Gains of the observer for samples, and the friction as known."""
    scenario, arm, T = memory["scenario"], memory["arm"], memory["period"]
    p = np.exp(-OBSERVER * T)
    memory["L"] = 1 - p**3, 1.5 * (1 - p) ** 2 * (1 + p) / T, (1 - p) ** 3 / T**2
    f = scenario.joint_friction
    memory["coulomb"], memory["viscous"] = f.coulomb * arm.tau_rated, f.viscous * arm.tau_rated
    memory["smooth"] = f.transition_velocity
    memory["past"] = None


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """Correct the estimate, feed back, predict the next instant."""
    arm, T = memory["arm"], memory["period"]
    if memory["past"] is None:
        memory["past"] = [q] * (memory["scenario"].sensors.delay + 1)
        memory["state"] = q, np.zeros_like(q), np.zeros_like(q)
    angle, speed, d = memory["state"]
    M = arm.mass_matrix(angle)
    e = q - memory["past"].pop(0)
    l1, l2, l3 = memory["L"]
    angle, speed, d = angle + l1 * e, speed + l2 * e, d + l3 * (M @ e)

    x, v, J, bias = arm.task_kinematics(angle, speed)
    a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x)
    qdd = np.linalg.solve(J, a - bias)
    forces = arm.inverse_dynamics(angle, speed, np.zeros_like(q)) + friction(speed, memory)
    tau = np.clip(M @ qdd + forces - d, -arm.tau_max, arm.tau_max)

    acceleration = np.linalg.solve(M, tau - forces + d)
    angle, speed = angle + T * speed + T**2 / 2 * acceleration, speed + T * acceleration
    memory["past"].append(angle)
    memory["state"] = angle, speed, d
    return tau


def friction(speed, memory):
    """Torque [N m] of the joints' friction at a speed (n,) [rad/s]."""
    return memory["coulomb"] * np.tanh(speed / memory["smooth"]) + memory["viscous"] * speed
