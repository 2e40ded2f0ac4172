"""The robot cell in MuJoCo: the ports of Drake's cell, another engine behind them."""

import math
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Block
from flipdiagram.errors import SimulationError
from flipdiagram.plants.handle import Cell, Rest, add_joint_torque, add_model, add_push, block_on_blade, rest_by_default
from flipdiagram.plants.mujoco_contact import CELL, Settings, compiled, give_way, import_mujoco
from flipdiagram.plants.mujoco_model import cell_model
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import Parts
from flipdiagram.scenario.scenario import Scenario

BLOCK = 13
"""Numbers of the block's state: quaternion, position, angular and translational velocity."""


@dataclass(frozen=True)
class MujocoCell(Cell):
    """The cell in MuJoCo: `plant` stands outside the diagram and knows the kinematics."""

    scene_graph: SceneGraph
    robot: "MujocoPlant"
    deflection: OutputPort | None
    """What the gears give way (n,) [rad]; None where the joints are rigid."""

    def stand(self, context: Context, q: Floats) -> None:
        """See `Cell`."""
        own, gears = self._own_context, self.parts.gears
        self.put_arm(own, q)
        X_WB = self.parts.arm.tool.CalcPoseInWorld(own) @ self.X_TB
        deflection = np.zeros(0) if gears is None else self.plant.GetPositions(own, gears.model)
        self.robot.put(self.robot.GetMyMutableContextFromRoot(context), q, X_WB, deflection)

    def show(self, builder: DiagramBuilder, meshcat: Meshcat) -> None:
        """See `Cell`."""
        builder.AddNamedSystem("scene_graph", self.scene_graph)
        split = builder.AddNamedSystem("block_pose", Demultiplexer([7, BLOCK - 7]))
        builder.Connect(self.block, split.get_input_port())
        models, parts = [self.parts.arm.arm, self.parts.block.model_instance()], [self.q, split.get_output_port(0)]
        if self.parts.gears is not None and self.deflection is not None:
            models, parts = [*models, self.parts.gears.model], [*parts, self.deflection]
        joined = builder.AddNamedSystem("joined", Multiplexer([part.size() for part in parts]))
        for i, part in enumerate(parts):
            builder.Connect(part, joined.get_input_port(i))
        # in the order of Drake's plant, where a gear follows its joint
        order, ends = np.zeros(self.plant.num_positions()), np.cumsum([0, *(part.size() for part in parts)])
        for model, first, last in zip(models, ends, ends[1:], strict=False):
            self.plant.SetPositionsInArray(model, np.arange(first, last), order)
        positions = builder.AddNamedSystem("positions", MatrixGain(np.eye(ends[-1])[order.astype(int)]))
        builder.Connect(joined.get_output_port(), positions.get_input_port())
        poses = builder.AddNamedSystem("geometry_poses", MultibodyPositionToGeometryPose(self.plant))
        builder.Connect(positions.get_output_port(), poses.get_input_port())
        builder.Connect(poses.get_output_port(), self.scene_graph.get_source_pose_port(self.plant.get_source_id()))
        MeshcatVisualizer.AddToBuilder(builder, self.scene_graph, meshcat)


class MujocoPlant(Block):
    """Arm, block and table in MuJoCo.  Not scalar-convertible: MuJoCo computes over float.

    Inputs `tau` (n,) [N m], all torques on the joints, and where it is `pushed` `applied`, forces on the spatula as a
    MultibodyPlant takes them.  Outputs: `state` (3 n + 19,): q [rad], qd [rad/s], the block as in `Cell`, and MuJoCo's
    accelerations of the last step, from which its solver starts; before these, where gears give way, their deflections
    and speeds (6 n + 19 in all); `poses` of all bodies of Drake's model [m];
    `contact_wrench` (12,) [N, N m] as in `Cell`, its mean over the step that begins at t.

    All that decides the next step is the state, in the Context.  Every `period` [s] it makes as many steps of MuJoCo's
    as the settings ask for; `contact_wrench` and the update share them.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        parts: Parts,
        joint_names: tuple[str, ...],
        period: float,
        settings: Settings,
        pushed: bool = False,
    ) -> None:
        super().__init__()
        self._mujoco = import_mujoco()
        n = self.joints = len(joint_names)
        self.substeps = math.ceil(period / settings.timestep - 1e-9)
        text, self._X_LS, springs = cell_model(plant, scene_graph, parts, joint_names, settings, period / self.substeps)
        self.model = compiled(self._mujoco, text)
        give_way(self.model, springs)
        self._link = self.model.body("blade").id
        self._drake, self._parts = plant, parts
        self._work = _Workspace(self._mujoco, self.model, plant, self.substeps, n)
        # where the numbers of MuJoCo's qpos and qvel stand in the state, and the accelerations begin
        block, gear = 2 * n, 2 * n + BLOCK
        own, self._gears = np.arange(n), 0 if parts.gears is None else n
        warm = gear + 2 * self._gears
        angles = [own] if parts.gears is None else [own, gear + own]
        speeds = [n + own] if parts.gears is None else [n + own, gear + n + own]
        qpos = np.r_[np.ravel(angles, "F"), block + 4 : block + 7, block : block + 4]
        qvel = np.r_[np.ravel(speeds, "F"), block + 10 : block + 13, block + 7 : block + 10]
        from flipdiagram.plants import mujoco_state  # numba takes half a second, and a drawing does without

        self._native, self._places = mujoco_state, (qpos, qvel, warm)
        self.input("tau", n)
        self.applied: list[ExternallyAppliedSpatialForce] = []
        if pushed:
            self.input("applied", Value[list[ExternallyAppliedSpatialForce]]())
        context = plant.CreateDefaultContext()
        X_WB = plant.GetFreeBodyPose(context, parts.block)
        q, gears = plant.GetPositions(context, parts.arm.arm), parts.gears
        deflection = np.zeros(0) if gears is None else plant.GetPositions(context, gears.model)
        index = self.state("state", self._at_rest(q, X_WB, deflection))
        self.DeclareStateOutputPort("state", index)
        self.DeclareAbstractOutputPort(
            "poses", lambda: Value[list[RigidTransform]](), self._poses, {self.discrete_state_ticket(index)}
        )
        self.intermediate("step", self._step)
        self.output("contact_wrench", 12, lambda step: step[1])
        self.update(lambda step: step[0], period)

    def put(self, context: Context, q: Floats, X_WB: RigidTransform, deflection: Floats | None = None) -> None:
        """Set the state of its own Context: at rest, the arm at q and its gears deflected (n,) [rad], block at X_WB."""
        context.SetDiscreteState(self._at_rest(q, X_WB, np.zeros(self._gears) if deflection is None else deflection))

    def _at_rest(self, q: Floats, X_WB: RigidTransform, deflection: Floats) -> Floats:
        pose = [*X_WB.rotation().ToQuaternion().wxyz(), *X_WB.translation()]
        rest = np.zeros(self._gears + self.joints + self._gears + 6)
        return np.concatenate([q, np.zeros(self.joints), pose, np.zeros(6), deflection, rest])

    def _step(self, state: Floats, tau: Floats, applied: list[ExternallyAppliedSpatialForce]) -> tuple[Floats, Floats]:
        """The state one period later, and the mean contact wrench until then."""
        work, mj_step, native = self._work, self._mujoco.mj_step, self._native
        model, data, sensors = self.model, work.data, work.sensors
        native.put(state, *self._places, work.qpos, work.qvel, work.warm)
        work.torque[:] = tau
        work.push[:] = self._push(work, applied) if applied else 0.0
        for k in range(self.substeps):
            mj_step(model, data)
            work.sensed[k] = sensors
        after = native.taken(*self._places, work.qpos, work.qvel, work.warm)
        if not math.isfinite(after.dot(after)):
            raise SimulationError("the simulation diverged: MuJoCo's state is not finite")
        return after, native.mean_wrench(work.sensed, native.FORCES)

    def _push(self, work: "_Workspace", applied: list[ExternallyAppliedSpatialForce]) -> Floats:
        """Force and moment about the last link's centre (6,) [N, N m], in the pose where the step begins."""
        data, link = work.data, self._link
        self._mujoco.mj_kinematics(self.model, data)
        total = np.zeros(6)
        for force in applied:
            point = data.xpos[link] + data.xmat[link].reshape(3, 3) @ (self._X_LS @ force.p_BoBq_B)
            total[:3] += force.F_Bq_W.translational()
            arm = point - data.xipos[link]
            total[3:] += force.F_Bq_W.rotational() + np.cross(arm, force.F_Bq_W.translational())
        return total

    def _poses(self, context: Context, poses: Value) -> None:
        """By the kinematics of Drake's model."""
        n, state = self.joints, context.get_discrete_state_vector().value()
        own, quaternion = self._work.context, state[2 * n : 2 * n + 4]
        self._drake.SetPositions(own, self._parts.arm.arm, state[:n])
        if self._parts.gears is not None:
            self._drake.SetPositions(own, self._parts.gears.model, state[2 * n + BLOCK : 3 * n + BLOCK])
        turn = RotationMatrix(Quaternion(quaternion / np.linalg.norm(quaternion)))
        X_WB = RigidTransform(turn, state[2 * n + 4 : 2 * n + 7])
        self._drake.SetFreeBodyPose(own, self._parts.block, X_WB)
        poses.set_value(self._drake.get_body_poses_output_port().Eval(own))


class _Workspace(threading.local):
    """Where one thread computes a step: MuJoCo's data and views of it.  Nothing here outlives the step."""

    def __init__(self, mujoco: Any, model: Any, plant: MultibodyPlant, substeps: int, joints: int) -> None:
        n = model.nv - 6
        data = self.data = mujoco.MjData(model)
        self.qpos, self.qvel, self.warm = data.qpos, data.qvel, data.qacc_warmstart
        self.torque, self.sensors = data.qfrc_applied[: n : n // joints], data.sensordata  # past the gears
        self.push = data.xfrc_applied[model.body("blade").id]
        self.sensed = np.empty((substeps, model.nsensordata))
        self.context = plant.CreateDefaultContext()


def add_mujoco_cell(
    builder: DiagramBuilder, scenario: Scenario, arm: ArmModel, q_start: Floats | None = None, rest: Rest | None = None
) -> MujocoCell:
    """Add the cell to a diagram, at rest with the block on the blade at the start of the task, level there.

    Args:
        builder: the diagram.
        scenario: what the cell is made of.
        arm: the controller's model of the same arm, for rated torques and inertia.
        q_start: joint angles (n,) [rad] of the default context; by default those of the arm's files.
        rest: by which the default context is where the arm rests instead, see `handle.Rest`.

    Raises:
        InputError: where MuJoCo is missing, cannot represent the cell, or the joint friction's transition velocity is
            too small for the step.
    """
    step, pushed = scenario.simulation.step, any(scenario.disturbance.push)
    plant, scene_graph = MultibodyPlant(step), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parts = add_model(plant, scenario, q_start)
    X_TB = block_on_blade(plant, parts)
    if rest is not None:
        rest_by_default(plant, parts, X_TB, rest)
    n = arm.n_joints
    robot = MujocoPlant(plant, scene_graph, parts, arm.joint_names, step, CELL, pushed)
    builder.AddNamedSystem("robot", robot)
    gears = [] if parts.gears is None else [n, n]
    state = builder.AddNamedSystem("joint_state", Demultiplexer([n, n, BLOCK, *gears, n + len(gears) // 2 * n + 6]))
    builder.Connect(robot.GetOutputPort("state"), state.get_input_port())
    q, qd = state.get_output_port(0), state.get_output_port(1)
    of_links = ("link_position", "link_velocity") if gears else ()
    links = [builder.AddNamedSystem(name, Adder(2, n)).get_output_port() for name in of_links] or [q, qd]
    for i, link in enumerate(links if gears else []):
        builder.Connect(state.get_output_port(i), link.get_system().get_input_port(0))
        builder.Connect(state.get_output_port(3 + i), link.get_system().get_input_port(1))
    torque = add_joint_torque(builder, scenario, arm, qd)
    builder.Connect(torque.get_output_port(), robot.GetInputPort("tau"))
    if pushed:
        add_push(builder, scenario, parts.arm, robot.GetInputPort("applied"))
    return MujocoCell(
        plant,
        parts,
        X_TB,
        tau=torque.get_input_port(0),
        q=q,
        qd=qd,
        q_link=links[0],
        qd_link=links[1],
        block=state.get_output_port(2),
        poses=robot.GetOutputPort("poses"),
        contact_wrench=robot.GetOutputPort("contact_wrench"),
        systems=("robot", "joint_friction", "joint_torque", "joint_state", *of_links),
        engine=CELL._replace(timestep=step / robot.substeps).settings_text(),
        scene_graph=scene_graph,
        robot=robot,
        deflection=state.get_output_port(3) if gears else None,
    )
