"""Computed torque on the tool, with the generalised-momentum observer's torque r taken off again.

    u = M J^-1 (a_cmd + k_v (v_cmd - v) + k_p (x_cmd - x) - dJ/dt qd) + h(q, qd),   tau = u - r
    p = M(q) qd,   dp/dt = tau - h + dM/dt qd + (what disturbs)
    r = k_o (p - p_hat),   dp_hat/dt = tau - h + dM/dt qd + r

h holds Coriolis, centrifugal and gravity torques.  p_hat is a discrete state, updated every millisecond.
"""

import numpy as np
from pydrake.systems.framework import LeafSystem

from flipdiagram.robot.parts import arm_of

NAME = "computed torque with a momentum observer"
AUTHOR = "a stranger"
REFERENCE = (
    "A. De Luca and R. Mattone, Actuator failure detection and isolation using generalized momenta, "
    "IEEE International Conference on Robotics and Automation, 2003, pp. 634-639"
)

K_P, K_V, K_O = 900.0, 60.0, 15.0  # 1/s2, 1/s, 1/s
PERIOD = 0.001  # s


class MomentumObserver(LeafSystem):
    """Takes x_cmd, v_cmd, a_cmd, q, qd; gives tau.  State: p_hat, and whether it has begun."""

    def __init__(self, arm):
        """Ports, and the state with its update."""
        super().__init__()
        self.arm = arm
        n = arm.n_joints
        self.ports = [self.DeclareVectorInputPort(name, 6) for name in ("x_cmd", "v_cmd", "a_cmd")]
        self.ports += [self.DeclareVectorInputPort(name, n) for name in ("q", "qd")]
        self.state = self.DeclareDiscreteState(n + 1)
        self.DeclarePeriodicDiscreteUpdateEvent(period_sec=PERIOD, offset_sec=0.0, update=self.update)
        self.DeclareVectorOutputPort("tau", n, self.torque)

    def disturbance(self, context, q, qd):
        """The observer's torque r, and its state p_hat."""
        *p_hat, begun = context.get_discrete_state(self.state).value()
        p = self.arm.mass_matrix(q) @ qd
        p_hat = np.array(p_hat) if begun else p
        return K_O * (p - p_hat), p_hat

    def law(self, context):
        """The torque and, for the update, what else was computed on the way."""
        x_cmd, v_cmd, a_cmd, q, qd = (port.Eval(context) for port in self.ports)
        x, v, J, bias = self.arm.task_kinematics(q, qd)
        a = a_cmd + K_V * (v_cmd - v) + K_P * (x_cmd - x)
        r, p_hat = self.disturbance(context, q, qd)
        tau = self.arm.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias)) - r
        return np.clip(tau, -self.arm.tau_max, self.arm.tau_max), q, qd, r, p_hat

    def torque(self, context, output):
        """Output tau [N m]."""
        output.SetFromVector(self.law(context)[0])

    def update(self, context, state):
        """One Euler step of p_hat."""
        tau, q, qd, r, p_hat = self.law(context)
        h = self.arm.inverse_dynamics(q, qd, np.zeros_like(qd))
        step = 1e-3
        dM = (self.arm.mass_matrix(q + step * qd) - self.arm.mass_matrix(q - step * qd)) / (2 * step)
        state.get_mutable_vector(self.state).SetFromVector([*(p_hat + PERIOD * (tau - h + dM @ qd + r)), 1.0])


def controller(scenario):
    """The entry."""
    return MomentumObserver(arm_of(scenario))
