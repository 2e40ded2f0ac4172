"""A disturbance observer whose model of the arm is estimated while it moves, by recursive least squares.

The torque of each joint is taken to be linear in three numbers theta that nobody knows exactly,

    tau = theta_1 ID(q, qd, qdd) + theta_2 tanh(qd/v_0) + theta_3 qd + d = phi . theta + d,

a factor on the inverse dynamics ID of the arm as planned, Coulomb and viscous friction.  Torque and regressor pass the
same filter G^2/(s + G)^2, so that no acceleration need be measured, and theta follows by least squares with forgetting:

    k = P phi / (lambda + phi . P phi),    theta += k (tau - phi . theta),    P = (P - k phi . P) / lambda

What this model leaves over is d, seen through a low-pass g/(s + g): the observer.  Both go into the torque:

    tau = theta_1 ID(q, qd, J^-1 (a - J' qd)) + friction + d,    a = a_cmd + K_V (v_cmd - v) + K_P (x_cmd - x)

While the arm stands nothing is learned: a joint that does not move cannot tell inertia from friction, and forgetting
would let P grow without end.  Speeds come from the angles by G s/(s + G), not from the late and noisy sensor.
"""

import numpy as np

NAME = "adaptive DOB"
AUTHOR = "flipdiagram"
REFERENCE = (
    "J.-J. E. Slotine, W. Li, Composite adaptive control of robot manipulators, Automatica 25(4), 509-519, 1989 (the"
    " filtered regressor and least squares with forgetting)"
)
SETTINGS = {
    "planner.friction_margin": 0.7,
    "planner.minimum_normal": 4.0,
    "planner.support_margin": 0.3,
    "planner.contact_samples": [10, 30],
    "planner.table_clearance": 0.02,
}
K_P, K_V = 900.0, 60.0
G, OBSERVER = 250.0, 40.0
"""Filter of speeds and regressor; cut-off of the observer [rad/s]."""
FORGET, DOUBT = 0.995, (0.1, 0.05, 0.05)
"""lambda, a memory of 0.2 s; standard deviations of theta before anything is seen, in units of the rated torque."""
MOVING = 0.05
"""Speed [rad/s] from which a joint learns."""
LOWEST, HIGHEST = np.array([0.5, 0.0, 0.0]), np.array([2.0, 0.3, 0.3])


def least_squares(theta, P, phi, y, forget):
    """One sample for each of n joints: theta, phi (n, m), P (n, m, m), y (n,); returns the next theta and P."""
    P_phi = np.einsum("nij,nj->ni", P, phi)
    k = P_phi / (forget + np.sum(phi * P_phi, axis=1))[:, None]
    error = y - np.sum(phi * theta, axis=1)
    return theta + k * error[:, None], (P - k[:, :, None] * P_phi[:, None, :]) / forget


def reset(memory):
    """What is known before anything is seen."""
    scenario, arm = memory["scenario"], memory["arm"]
    n, known = arm.n_joints, scenario.joint_friction
    memory["theta"] = np.tile([1.0, known.coulomb, known.viscous], (n, 1))
    memory["P"] = np.tile(np.diag(np.square(DOUBT)) / 0.01**2, (n, 1, 1))  # torques to 1 % of the rated ones
    memory["late"], memory["d"] = None, np.zeros(n)
    memory["v_0"] = known.transition_velocity


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """Filter, learn, observe, act."""
    arm, T, rated = memory["arm"], memory["period"], memory["arm"].tau_rated
    if memory["late"] is None:
        hold = arm.gravity_torque(q)
        memory["late"] = [q, q, np.zeros_like(q), hold, hold]
        memory["sent"] = [hold] * (memory["scenario"].sensors.delay + 1)
    speed, q_2, v_2, a_2, tau_2 = filtered(q, memory["sent"].pop(0), memory["late"], 1 - np.exp(-G * T), T)

    phi = regressor(arm.inverse_dynamics(q_2, v_2, a_2), v_2, memory)
    moves = np.abs(v_2) > MOVING
    theta, P = least_squares(memory["theta"], memory["P"], phi, tau_2 / rated, FORGET)
    theta = np.where(moves[:, None], np.clip(theta, LOWEST, HIGHEST), memory["theta"])
    memory["theta"], memory["P"] = theta, np.where(moves[:, None, None], P, memory["P"])
    left = tau_2 - rated * np.sum(phi * theta, axis=1)
    memory["d"] = memory["d"] + OBSERVER * T * (left - memory["d"])

    x, v, J, bias = arm.task_kinematics(q, speed)
    a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x)
    phi = regressor(arm.inverse_dynamics(q, speed, np.linalg.solve(J, a - bias)), speed, memory)
    tau = np.clip(rated * np.sum(phi * theta, axis=1) + memory["d"], -arm.tau_max, arm.tau_max)
    memory["sent"].append(tau)
    return tau


def filtered(q, tau, late, share, T):
    """The speed G s/(s + G) q, and q, its two derivatives and tau through G^2/(s + G)^2; `late` are the states."""
    q_1, q_2, v_1, tau_1, tau_2 = late
    speed = share / T * (q - q_1)
    q_1 = q_1 + share * (q - q_1)
    q_2 = q_2 + share * (q_1 - q_2)
    a_2 = share / T * (speed - v_1)
    v_1 = v_1 + share * (speed - v_1)
    tau_1 = tau_1 + share * (tau - tau_1)
    tau_2 = tau_2 + share * (tau_1 - tau_2)
    late[:] = q_1, q_2, v_1, tau_1, tau_2
    return speed, q_2, v_1, a_2, tau_2


def regressor(dynamics, speed, memory):
    """phi (n, 3), in units of the rated torque."""
    return np.column_stack([dynamics / memory["arm"].tau_rated, np.tanh(speed / memory["v_0"]), speed])
