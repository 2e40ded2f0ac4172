"""Model-free control, an intelligent PD: what the arm does in the next milliseconds is all that is known of it.

For a short while each joint is an ultra-local model with one number alpha = 1/M_n that is roughly right,

    qdd = F + alpha tau,

and F, all of gravity, friction, coupling and payload, is estimated from the last T seconds of angles and torques.
Multiplying by powers of s and integrating leaves no derivative to be measured (Fliess & Join, sec. 3):

    F = 60/T^5 int (T^2 - 6 T s + 6 s^2) q ds - 30 alpha/T^5 int (T - s)^2 s^2 tau ds,    over s = 0 ... T

It then is taken away, and a PD moves what is left, qdd = u:

    tau = (J^-1 (a - J' qd) - F) / alpha,    a = a_cmd + K_V (v_cmd - v) + K_P (x_cmd - x)

Of the arm it uses the kinematics and M_n, no mass, no friction.
"""

from collections import deque

import numpy as np

NAME = "model-free"
AUTHOR = "flipdiagram"
REFERENCE = "M. Fliess, C. Join, Model-free control, International Journal of Control 86(12), 2228-2252, 2013"
SETTINGS = {
    "planner.friction_margin": 0.7,
    "planner.minimum_normal": 4.0,
    "planner.support_margin": 0.3,
    "planner.contact_samples": [10, 30],
    "planner.table_clearance": 0.02,
}
K_P, K_V = 900.0, 60.0
WINDOW = 30
"""T, in periods."""
G = 250.0
"""Of the derivative G s/(s + G) of the angles [rad/s]."""
INERTIA = 1.2
"""M_n over the diagonal of M at the start."""


def windows(samples, period):
    """Weights (samples,) of angles and of accelerations in the formula, the oldest first.

    The sums are made exact: of angles b + c t + F t^2/2 they give F, whatever b and c, and of an acceleration itself.
    """
    s = (np.arange(samples) + 0.5) / samples
    of_angle = 1 - 6 * s + 6 * s**2
    of_angle -= of_angle.mean()
    of_angle /= of_angle @ (s * samples * period) ** 2 / 2
    of_acceleration = (1 - s) ** 2 * s**2
    return of_angle, of_acceleration / of_acceleration.sum()


def reset(memory):
    """Nothing has been seen yet."""
    memory["weights"] = windows(WINDOW, memory["period"])
    memory["angles"] = None


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """Estimate F, take it away, move the rest."""
    arm, T = memory["arm"], memory["period"]
    if memory["angles"] is None:
        memory["M_n"] = INERTIA * np.diag(arm.mass_matrix(q))
        hold = arm.gravity_torque(q) / memory["M_n"]  # the arm stands, so that much must be there
        length = WINDOW + memory["scenario"].sensors.delay
        memory["angles"] = deque([q] * WINDOW, WINDOW)
        memory["sent"] = deque([hold] * length, length)
        memory["late"] = q
    of_angle, of_acceleration = memory["weights"]
    memory["angles"].append(q)
    sent = np.array(memory["sent"])[:WINDOW]  # those that had acted when the angle was read
    F = of_angle @ np.array(memory["angles"]) - of_acceleration @ sent

    share = 1 - np.exp(-G * T)
    speed = share / T * (q - memory["late"])
    memory["late"] = memory["late"] + share * (q - memory["late"])
    x, v, J, bias = arm.task_kinematics(q, speed)
    a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x)
    tau = memory["M_n"] * (np.linalg.solve(J, a - bias) - F)
    tau = np.clip(tau, -arm.tau_max, arm.tau_max)
    memory["sent"].append(tau / memory["M_n"])
    return tau
