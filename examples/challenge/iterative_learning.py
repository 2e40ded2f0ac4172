"""Iterative learning control: what the model lacks in the nominal world is learned from one flip to the next.

Under computed torque with PD the error e = x_cmd - x of the tool obeys e'' + K_V e' + K_P e = -(w + d), where w(t) is
an acceleration that we may add and d all that the model lacks: friction above all, late sensors.  After flip j

    w_j+1 = w_j + gamma Q [e_j'' + K_V e_j' + K_P e_j]

(Q: the part that is linear between knots 10 ms apart), so that w + d shrinks by 1 - gamma each time: the same motion is
made the same mistake again, and a mistake that comes again can be anticipated, which no feedback can.

The numbers below were learned by train_iterative_learning.py in the nominal world only, from starts at 0, 0.06 and
0.14 m; what is learned is an acceleration of the tool, which the starts have in common.  In other worlds it is added
as it is: it knows nothing of their payloads and friction, and PD has to do the rest.
"""

import numpy as np

NAME = "iterative learning"
AUTHOR = "flipdiagram"
REFERENCE = (
    "S. Arimoto, S. Kawamura, F. Miyazaki, Bettering operation of robots by learning, Journal of Robotic Systems 1(2),"
    " 123-140, 1984; D. Bristow, M. Tharayil, A. Alleyne, A survey of iterative learning control, IEEE Control Systems"
    " Magazine 26(3), 96-114, 2006"
)
SETTINGS = {
    "planner.friction_margin": 0.7,
    "planner.minimum_normal": 4.0,
    "planner.support_margin": 0.3,
    "planner.contact_samples": [10, 30],
    "planner.table_clearance": 0.02,
}
K_P, K_V = 900.0, 60.0
G = 250.0
"""Of the derivative G s/(s + G) of the angles [rad/s]."""
KNOTS = 0.01 * np.arange(51)
"""Times [s] of the numbers that are learned; after the last one nothing is added."""

# learned: begin
# fmt: off
LEARNED = np.array([
    [-0.12, 0.91, 4.40],
    [-0.93, 0.82, -6.31],
    [-1.25, 0.39, 2.90],
    [-1.36, 0.39, 14.85],
    [-1.47, 0.46, 24.90],
    [-1.33, 0.61, 42.94],
    [-1.38, 0.85, 45.32],
    [-1.12, 0.92, 58.88],
    [-1.05, 1.05, 41.71],
    [-0.84, 1.19, 42.99],
    [-0.76, 1.29, 34.31],
    [-0.69, 1.30, 21.76],
    [-0.42, 0.82, 1.08],
    [-0.58, 1.31, -22.45],
    [-0.36, 1.88, -35.19],
    [-0.73, 2.22, -50.65],
    [-0.47, 2.56, -58.32],
    [-1.07, 3.00, -72.83],
    [-0.86, 4.01, -75.15],
    [-1.28, 3.97, -84.62],
    [-1.30, 4.19, -83.51],
    [-2.00, 3.99, -72.75],
    [-1.10, 3.99, -60.62],
    [-1.84, 4.81, -60.22],
    [-1.86, 5.24, -34.58],
    [-2.67, 4.88, -22.55],
    [-2.79, 4.88, -6.40],
    [-3.00, 4.18, 23.90],
    [-3.23, 3.99, 35.52],
    [-3.18, 3.05, 54.68],
    [-3.32, 3.17, 63.89],
    [-2.99, 1.94, 81.06],
    [-3.13, 1.33, 84.93],
    [-2.56, 1.38, 93.92],
    [-2.67, 1.20, 95.19],
    [-1.93, 0.63, 99.17],
    [-1.97, 0.56, 99.53],
    [-1.19, 1.19, 100.63],
    [-1.13, 0.23, 101.63],
    [-0.20, 0.96, 102.89],
    [-0.10, 0.76, 103.84],
    [0.88, 0.86, 105.42],
    [1.03, 0.71, 106.08],
    [1.85, 0.63, 107.59],
    [1.93, -0.64, 106.48],
    [1.14, -0.81, 107.05],
    [2.36, -0.85, 103.52],
    [2.30, -0.71, 103.23],
    [2.63, -2.11, 104.56],
    [1.23, -2.20, 97.60],
    [4.50, -3.04, 133.49],
])
# fmt: on
# learned: end


def reset(memory):
    """No angle has been seen yet, and w is what has been learned, unless somebody is learning just now."""
    memory["late"] = None
    memory.setdefault("w", LEARNED)


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """Computed torque, and w."""
    arm, T = memory["arm"], memory["period"]
    if memory["late"] is None:
        memory["late"] = q
    share = 1 - np.exp(-G * T)
    speed = share / T * (q - memory["late"])
    memory["late"] = memory["late"] + share * (q - memory["late"])
    x, v, J, bias = arm.task_kinematics(q, speed)
    a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x) + added(t, memory["w"])
    return arm.inverse_dynamics(q, speed, np.linalg.solve(J, a - bias))


def added(t, w):
    """w(t) (6,) [m/s^2, rad/s^2]: of y, z, theta, linear between the knots, 0 before the motion and after the last."""
    place, all_axes = t / KNOTS[1], np.zeros(6)
    k = int(np.floor(place))
    if 0 <= k < len(KNOTS) - 1:
        all_axes[:3] = w[k] + (place - k) * (w[k + 1] - w[k])
    return all_axes
