"""The arm as a model: limits, kinematics and inertia, used by planning, blocks and the cell alike.

Task coordinates x, shape (6,), in the order `AXES` = (y, z, theta, x, pitch, yaw) [m, rad]: position of the
control point C in the base frame, and the tool's orientation as R_WT = Rz(yaw) Ry(pitch) Rx(theta), theta
unwrapped into (-pi/2, 3 pi/2]. v is the time derivative of these six numbers (angle rates, not angular
velocity); a of v. C lies `tool_height` above the centre of the blade's top surface along the blade's normal:
the centre of the object as it rests there.

Joint angles q are the modified Denavit-Hartenberg angles of urdf/mh3f.urdf [rad], not the numbers on the
teach pendant.
"""

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, MultibodyForces_, RigidBody
from pydrake.symbolic import Expression

from flipdiagram.arrays import Array
from flipdiagram.errors import InputError
from flipdiagram.robot import inverse_kinematics, task_space
from flipdiagram.robot.arm_spec import ArmSpec, file_error
from flipdiagram.robot.assembly import add_arm
from flipdiagram.robot.task_space import AXES


class ArmModel:
    """Arm and spatula as a plant of their own, with what controller and planner need of it.

    Keeps one private Context: not for two threads at once. All vectors of joints are in the order of
    `joint_names`.

    Attributes: plant (finalized, continuous, no scene graph); n_joints; joint_names; q_min, q_max, home
    [rad]; qd_max [rad/s]; tau_max, tau_rated [N m]; each of shape (n_joints,), read from the URDF and scaled.
    """

    def __init__(
        self, spec: ArmSpec | None = None, add_load: Callable[[MultibodyPlant], RigidBody] | None = None
    ) -> None:
        """The arm of a spec, by default mh3f.urdf with spatula.urdf; add_load adds a body, which is welded on at C."""
        plant, spec = MultibodyPlant(0.0), spec or ArmSpec()
        handles = self.handles = add_arm(plant, spec)
        self._load: FixedOffsetFrame | None = None
        if add_load is not None:
            self._load = plant.AddFrame(FixedOffsetFrame("load", handles.control_point, RigidTransform()))
            plant.WeldFrames(self._load, add_load(plant).body_frame())
        plant.Finalize()
        by_name = {name: plant.GetJointByName(name, handles.arm) for name in handles.rated_torques}
        self.joint_names = tuple(sorted(by_name, key=lambda name: by_name[name].velocity_start()))
        self.n_joints = plant.num_velocities()
        if self.n_joints != len(by_name):
            raise file_error(spec.arm, "has links that float", "links that the base carries")
        if self.n_joints < len(AXES):
            raise InputError(f"the arm has {self.n_joints} moving joints; valid are at least {len(AXES)}")
        # a joint that turns without end may turn once either way
        self.q_min = np.maximum(np.array(plant.GetPositionLowerLimits(), dtype=float), -2 * np.pi)
        self.q_max = np.minimum(np.array(plant.GetPositionUpperLimits(), dtype=float), 2 * np.pi)
        self.qd_max = np.array(plant.GetVelocityUpperLimits(), dtype=float)
        self.tau_max = np.array(plant.GetEffortUpperLimits(), dtype=float)
        self.tau_rated = np.array([handles.rated_torques[name] for name in self.joint_names])
        actuators = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
        ratios = {actuator.joint().name(): actuator.default_gear_ratio() for actuator in actuators}
        of_file = [ratios.get(name, 1.0) for name in self.joint_names]
        given = spec.arm.gear_ratios
        self._gear_ratios = np.array(of_file if given is None else given)
        self._bind(plant, float)
        self.knows_home = handles.home is not None
        home = handles.home or dict(zip(self.joint_names, (self.q_min + self.q_max) / 2, strict=True))
        self.home = np.array([home[name] for name in self.joint_names])

    def _bind(self, plant: Any, scalar: Any) -> None:
        self.plant = plant
        self._context = plant.CreateDefaultContext()
        self._world = plant.world_frame()
        self._tool = plant.get_frame(self.handles.tool.index())
        self._control_point = plant.get_frame(self.handles.control_point.index())
        self._forces = MultibodyForces_[scalar](plant)
        self._zero3 = np.zeros(3)

    def shift_load(self, shift: float) -> None:
        """Let the load sit this far from C along the blade's tangent s [m]."""
        if self._load is not None:
            self._load.SetPoseInParentFrame(self._context, RigidTransform([0.0, shift, 0.0]))

    def own_context(self) -> Any:
        """A copy of its Context: with the load where it sits."""
        return self._context.Clone()

    def gear_ratios(self, field: str) -> Array:
        """Turns of each motor per turn of its joint (n,) [1], for a field that needs them.

        Raises InputError, naming the field, where neither the arm's file nor the scenario gives them: a reader of files
        takes 1 where there is none.
        """
        if np.all(self._gear_ratios == 1.0):
            valid = f"arm.gear_ratios with one per joint, {' '.join(self.joint_names)}, or a file that has them"
            raise InputError(f"{field} needs the gear ratios of the arm; valid is {valid}", field=field, valid=valid)
        return self._gear_ratios

    def to_scalar(self, scalar: Any) -> "ArmModel":
        """The same arm over float, AutoDiffXd or Expression, with a Context of its own."""
        convert = {float: self.plant.Clone, AutoDiffXd: self.plant.ToAutoDiffXd, Expression: self.plant.ToSymbolic}.get(
            scalar
        )
        if convert is None:
            raise InputError(f"scalar type {scalar!r} is not valid; choose from float, AutoDiffXd, Expression")
        model = copy.copy(self)
        model._bind(convert(), scalar)
        return model

    # Kinematics

    def X_WT(self, q: ArrayLike) -> RigidTransform:
        """Pose of the tool frame T (centre of the blade's top surface) in the base frame; q (n,) [rad]."""
        self.plant.SetPositions(self._context, self._joints("q", q))
        return self._tool.CalcPoseInWorld(self._context)

    def task_position(self, q: ArrayLike) -> Array:
        """Task coordinates x (6,) [m, rad] of joint angles q (n,) [rad]."""
        self.plant.SetPositions(self._context, self._joints("q", q))
        return self._pose()[0]

    def task_position_velocity(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """x and v (6,) [m, rad; per second] of joint angles q [rad] and speeds qd [rad/s], both (n,)."""
        self._set_state(q, qd)
        x, R = self._pose()
        V_WC = self._control_point.CalcSpatialVelocityInWorld(self._context).get_coeffs()
        return x, task_space.product(task_space.rate_map(R), V_WC)

    def tool_motion(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """x, v (K, 6) [m, rad; per second] and poses of the tool frame T (K, 7), quaternion (w first) and position [m],
        of joint angles and speeds (K, n).
        """
        x, v, tool = np.empty((len(q), 6)), np.empty((len(q), 6)), np.empty((len(q), 7))
        for k in range(len(q)):
            x[k], v[k] = self.task_position_velocity(q[k], qd[k])
            X_WT = self._tool.CalcPoseInWorld(self._context)
            tool[k] = [*X_WT.rotation().ToQuaternion().wxyz(), *X_WT.translation()]
        return x, v, tool

    def task_kinematics(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """x (6,), v (6,), J (6, n), bias (6,) with v = J qd, a = J qdd + bias; q, qd (n,) [rad, rad/s].

        J, the J_t of Fig. 4, is the Jacobian of the task coordinates themselves; bias = J' qd, exactly.
        """
        qd = self._set_state(q, qd)
        x, R, N, J = self._pose_and_jacobian()
        A_bias = self.plant.CalcBiasSpatialAcceleration(
            self._context, JacobianWrtVariable.kV, self._control_point, self._zero3, self._world, self._world
        )
        v = task_space.product(J, qd)
        bias = task_space.product(N, A_bias.get_coeffs())
        for axis, rate_bias in zip((2, 4, 5), task_space.rate_bias(R, v), strict=True):
            bias[axis] += rate_bias
        return x, v, J, bias

    def _pose(self) -> tuple[Array, Array]:
        X_WC = self._control_point.CalcPoseInWorld(self._context)
        R = X_WC.rotation().matrix()
        return task_space.coordinates(R, X_WC.translation()), R

    def _pose_and_jacobian(self) -> tuple[Array, Array, Array, Array]:
        x, R = self._pose()
        N = task_space.rate_map(R)
        J_V = self.plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._control_point, self._zero3, self._world, self._world
        )
        return x, R, N, task_space.product(N, J_V)

    # Dynamics: M(q) qdd + C(q, qd) qd + gravity_torque(q) = tau; reflected inertia in M, no joint friction

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M(q) (n, n) [kg m^2], reflected inertia of rotors and gears on its diagonal; q (n,) [rad]."""
        self.plant.SetPositions(self._context, self._joints("q", q))
        return self.plant.CalcMassMatrix(self._context)

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Joint torques tau (n,) [N m] of the motion q, qd, qdd (n,) [rad, s]: inertia, Coriolis, gravity."""
        self._set_state(q, qd)
        self.plant.CalcForceElementsContribution(self._context, self._forces)
        return self.plant.CalcInverseDynamics(self._context, self._joints("qdd", qdd), self._forces)

    def gravity_torque(self, q: ArrayLike) -> Array:
        """Joint torques (n,) [N m] that hold the arm still at q (n,) [rad]: minus what gravity does."""
        self.plant.SetPositions(self._context, self._joints("q", q))
        return -self.plant.CalcGravityGeneralizedForces(self._context)

    # Inverse kinematics: the searches are in inverse_kinematics.py

    def inverse_kinematics(
        self, x_task: ArrayLike, q_seed: ArrayLike | None = None, tol: float = 1e-10, through: Sequence[ArrayLike] = ()
    ) -> Array:
        """Joint angles q (n,) [rad] of the task pose x_task (6,), on the branch of the seed, error below tol.

        Each search goes first directly, then along the straight line in task space.  Raises PlanningError naming the
        pose, and the joint and its limit where one stands in the way.

        Args:
            x_task: the pose (6,) [m, rad].
            q_seed: where the search starts (n,) [rad], before `home`; an arm that knows no home is searched over all
                its joint space where no seed is given.
            tol: largest error of a coordinate [m, rad].
            through: further poses, each (6,), that such a search must be able to reach from there.
        """
        target = self._task("x_task", x_task, 1)
        seed = self.home if q_seed is None else self._joints("q_seed", q_seed)
        if q_seed is None and not self.knows_home:
            return inverse_kinematics.search(self, target, tol, [self._task("through", pose, 1) for pose in through])
        return inverse_kinematics.pose(self, target, [seed, self.home], tol)

    def inverse_kinematics_path(
        self, xs: ArrayLike, q_seed: ArrayLike | None = None, tol: float = 1e-9, *, check_limits: bool = True
    ) -> Array:
        """Joint angles (N, n) [rad] along the task poses xs (N, 6), each sample continuing the one before.

        Raises PlanningError naming sample and pose where the path is lost (a singular pose, out of reach,
        samples too far apart) or, with check_limits, where it leaves the joint limits.  q_seed and tol as in
        `inverse_kinematics`.
        """
        targets = self._task("xs", xs, 2)
        first = self.inverse_kinematics(targets[0], q_seed, tol)
        return inverse_kinematics.path(self, targets, first, tol, check_limits=check_limits)

    def task_jacobian(self, q: ArrayLike) -> tuple[Array, Array]:
        """x (6,) and J (6, n) of joint angles q (n,) [rad]."""
        self.plant.SetPositions(self._context, self._joints("q", q))
        x, _, _, J = self._pose_and_jacobian()
        return x, J

    # Inputs

    def _set_state(self, q: ArrayLike, qd: ArrayLike) -> Array:
        speeds = self._joints("qd", qd)
        self.plant.SetPositions(self._context, self._joints("q", q))
        self.plant.SetVelocities(self._context, speeds)
        return speeds

    def _joints(self, name: str, value: ArrayLike) -> Array:
        vector = np.asarray(value)
        if vector.shape != (self.n_joints,):
            valid = f"({self.n_joints},): {' '.join(self.joint_names)}"
            raise InputError.of(name, value, valid, f"{name} has shape {vector.shape}")
        return vector

    def _task(self, name: str, value: ArrayLike, dimensions: int) -> Array:
        poses = np.array(value, dtype=float)
        if poses.ndim != dimensions or poses.shape[-1] != len(AXES) or not len(poses):
            valid = f"{'(6,)' if dimensions == 1 else '(N, 6)'}, {', '.join(AXES)}"
            raise InputError.of(name, value, valid, f"{name} has shape {poses.shape}")
        if not np.isfinite(poses).all():
            raise InputError.of(name, value, "finite numbers in m and rad", f"{name} has entries that are not finite")
        return poses
