"""The robot as joints alone: M qdd = tau - g - G (q - q0) about where the arm rests, the block on its blade."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.primitives import AffineSystem

from flipdiagram.arrays import Floats
from flipdiagram.plants.handle import Rest, add_model, block_on_blade, load, put_arm
from flipdiagram.robot.arm_at_pose import slope
from flipdiagram.scenario.scenario import Scenario


@dataclass(frozen=True)
class JointModel:
    """Arm, tool and block as one rigid chain, linear about q0; friction and drives are other boxes.

    The block counts as a part of the tool: while it neither slides nor lifts off, contact is that to first order.
    """

    q0: Floats
    """Where the arm rests (n,) [rad]."""
    M: Floats
    """Inertia (n, n) [kg m^2]."""
    gravity: Floats
    """Torque that holds it at q0 (n,) [N m]."""
    stiffness: Floats
    """G, by how much that torque changes with q (n, n) [N m/rad]."""

    def sampled(self, period: float) -> AffineSystem:
        """q and qd (2 n,) every `period` [s] under a torque (n,) [N m] held over it, in the steps of Drake's plant:

        qd[k+1] = qd[k] + T M^-1 (tau - g - G (q[k] - q0)),  q[k+1] = q[k] + T qd[k+1].
        """
        n, one = len(self.q0), np.eye(len(self.q0))
        gain = period * np.linalg.inv(self.M)
        pull = gain @ self.stiffness
        A = np.block([[one - period * pull, period * one], [-pull, one]])
        B = np.vstack([period * gain, gain])
        f0 = B @ (self.stiffness @ self.q0 - self.gravity)
        zero = np.zeros((2 * n, n))
        plant = AffineSystem(A, B, f0, np.eye(2 * n), zero, np.zeros(2 * n), period)
        plant.configure_default_state(np.concatenate([self.q0, np.zeros(n)]))
        return plant


def joint_model(scenario: Scenario, q_start: Floats, rest: Rest) -> JointModel:
    """The model of a scenario's robot with rigid joints, where it rests by `rest`, at q_start (n,) [rad] if nowhere."""
    plant = MultibodyPlant(scenario.simulation.step)
    parts = add_model(plant, scenario, q_start)
    X_TB, context = block_on_blade(plant, parts), plant.CreateDefaultContext()

    def holding_torque(q: Floats) -> Floats:
        put_arm(plant, parts, X_TB, context, q)
        return load(plant, parts, X_TB, context)

    at_rest = rest(holding_torque)
    q0 = q_start if at_rest is None else at_rest
    gravity = holding_torque(q0)
    arm, world = parts.arm, plant.world_frame()
    of_arm = plant.GetVelocitiesFromArray(arm.arm, np.arange(plant.num_velocities(), dtype=float)).astype(int)
    J = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, arm.tool, X_TB.translation(), world, world)[
        :, of_arm
    ]
    turn = (arm.tool.CalcPoseInWorld(context) @ X_TB).rotation()
    block = parts.block.default_spatial_inertia().ReExpress(turn).CopyToFullMatrix6()
    M = plant.CalcMassMatrix(context)[np.ix_(of_arm, of_arm)] + J.T @ block @ J
    return JointModel(np.array(q0), M, gravity, slope(holding_torque, np.array(q0)))
