"""What a cell offers, whichever engine moves it: its ports, its start, and what both engines have before them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import Adder

from flipdiagram.arrays import Floats
from flipdiagram.errors import NoEquilibriumError
from flipdiagram.plants.joint_friction import joint_friction
from flipdiagram.plants.push import Push
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.assembly import ArmHandles
from flipdiagram.robot.parts import Parts, add_parts
from flipdiagram.scenario.scenario import Scenario

MOST_TRIES, SETTLED = 100, 1e-14
"""To find how far gears give way at rest; change [rad] below which it is found."""
Rest = Callable[[Callable[[Floats], Floats]], Floats | None]
"""Of the torques (n,) [N m] that hold the arm still at q (n,) [rad]: the q where it rests at the start, None where the
default context shall be that of `q_start`."""
CONTACT_PAIRS = ("blade-block", "table-block", "table-blade")
"""Who pushes whom in `contact_wrench`: the first on the second."""


@dataclass(frozen=True)
class Cell(ABC):
    """Handles to a cell: its ports, and the parts inside."""

    plant: MultibodyPlant
    """Drake's model of the parts; whether it stands in the diagram is the engine's choice."""
    parts: Parts
    X_TB: RigidTransform
    """Pose of the block's body in the tool's frame, as it lies on the blade."""
    tau: InputPort
    """Torques of the drives (n,) [N m]."""
    q: OutputPort
    """Angles of the joints (n,) [rad], where gears give way on the motors' side: what encoders see, friction brakes."""
    qd: OutputPort
    q_link: OutputPort
    """The same of the links, q where the joints are rigid."""
    qd_link: OutputPort
    block: OutputPort
    """Pose of the block, quaternion (w first) and position [m], then its velocity in the world: (13,)."""
    poses: OutputPort
    """Of all bodies, by their indices in `plant`."""
    contact_wrench: OutputPort
    """Force x, y, z [N] in world axes for each of `CONTACT_PAIRS`, then the moment [N m] of the first pair's forces,
    blade on block, about the world's origin: (12,).  They belong to the step that begins at t."""
    systems: tuple[str, ...]
    """Names of all systems of the cell."""
    engine: str
    """What moves it, with its contact settings, in one line."""

    @abstractmethod
    def stand(self, context: Context, q: Floats) -> None:
        """Put the arm at rest at angles q (n,) [rad] into a root Context, the block where it lies on the blade.

        Gears give way under the load, joints that stick are unloaded by their friction.
        """

    @abstractmethod
    def show(self, builder: DiagramBuilder, meshcat: Meshcat) -> None:
        """Add what shows the cell in Meshcat."""

    @property
    def recorded(self) -> dict[str, OutputPort]:
        """What else a recording keeps of the object, by name."""
        return {}

    def holding_torque(self, q: Floats) -> Floats:
        """Joint torques (n,) [N m] that hold arm and block still at q (n,) [rad], without friction of the joints.

        Raises NoEquilibriumError where gears give way without end.
        """
        self.put_arm(self._own_context, q)
        return self._load(self._own_context)

    def put_arm(self, context: Context, q: Floats) -> None:
        """Set the angles q (n,) [rad] of the joints in a Context of `plant`, gears deflected by the load at rest."""
        put_arm(self.plant, self.parts, self.X_TB, context, q)

    def _load(self, context: Context) -> Floats:
        return load(self.plant, self.parts, self.X_TB, context)

    @cached_property
    def _own_context(self) -> Context:
        return self.plant.CreateDefaultContext()


def block_on_blade(plant: MultibodyPlant, parts: Parts) -> RigidTransform:
    """Pose X_TB of the block's body in the tool's frame, as in the default Context."""
    context = plant.CreateDefaultContext()
    X_WT = parts.arm.tool.CalcPoseInWorld(context)
    return X_WT.inverse() @ plant.GetFreeBodyPose(context, parts.block)


def load(plant: MultibodyPlant, parts: Parts, X_TB: RigidTransform, context: Context) -> Floats:
    """Torques (n,) [N m] that hold arm and block still as they stand in a Context of the plant."""
    arm, centre, world = parts.arm, X_TB @ parts.block.default_com(), plant.world_frame()
    J = plant.CalcJacobianTranslationalVelocity(context, JacobianWrtVariable.kV, arm.tool, centre, world, world)
    weight = parts.block.default_mass() * plant.gravity_field().gravity_vector()
    torque = plant.CalcGravityGeneralizedForces(context) + J.T @ weight
    return -np.asarray(plant.GetVelocitiesFromArray(arm.arm, torque), dtype=float)


def put_arm(plant: MultibodyPlant, parts: Parts, X_TB: RigidTransform, context: Context, q: Floats) -> None:
    """Set the angles q (n,) [rad] of the joints in a Context of the plant, gears deflected by the load at rest.

    Raises NoEquilibriumError where gears give way without end.
    """
    gears = parts.gears
    plant.SetPositions(context, parts.arm.arm, q)
    if gears is None:
        return
    deflection = np.zeros(len(q))
    for _ in range(MOST_TRIES):
        plant.SetPositions(context, gears.model, deflection)
        before, deflection = deflection, -load(plant, parts, X_TB, context) / gears.stiffness
        if np.abs(deflection - before).max() < SETTLED:
            return
    raise NoEquilibriumError("no equilibrium to start from: the gears give way; valid is a larger joints.stiffness")


def rest_by_default(plant: MultibodyPlant, parts: Parts, X_TB: RigidTransform, rest: Rest) -> None:
    """Make default what a finalized plant is where the arm rests, the block on the blade."""
    context = plant.CreateDefaultContext()

    def holding_torque(q: Floats) -> Floats:
        put_arm(plant, parts, X_TB, context, q)
        return load(plant, parts, X_TB, context)

    if (q := rest(holding_torque)) is None:
        return
    put_arm(plant, parts, X_TB, context, q)
    for model in (parts.arm.arm, *([] if parts.gears is None else [parts.gears.model])):
        plant.SetDefaultPositions(model, plant.GetPositions(context, model))
    plant.SetDefaultFloatingBaseBodyPose(parts.block, parts.arm.tool.CalcPoseInWorld(context) @ X_TB)


def add_model(plant: MultibodyPlant, scenario: Scenario, q_start: Floats | None = None) -> Parts:
    """Add the parts to a plant and finalize it; by default at rest at the start of the task, the block on the blade.

    q_start: joint angles (n,) [rad] of the default context; by default those of the arm's files.
    """
    parts = add_parts(plant, scenario)
    plant.Finalize()
    plant.set_name("robot")
    if q_start is not None:
        plant.SetDefaultPositions(parts.arm.arm, q_start)
    task, unknown = scenario.task, scenario.disturbance
    y = task.start_y + unknown.start_error + unknown.block_offset
    plant.SetDefaultFloatingBaseBodyPose(parts.block, RigidTransform([task.start_x, y, task.start_z]))
    return parts


def add_joint_torque(builder: DiagramBuilder, scenario: Scenario, arm: ArmModel, qd: OutputPort) -> Adder:
    """Add the joint friction of speeds qd (n,) [rad/s] and its sum with the torque of the drives, the sum's input 0."""
    friction = builder.AddNamedSystem("joint_friction", joint_friction(scenario, arm))
    torque = builder.AddNamedSystem("joint_torque", Adder(2, arm.n_joints))
    builder.Connect(qd, friction.get_input_port())
    builder.Connect(friction.get_output_port(), torque.get_input_port(1))
    return torque


def add_push(builder: DiagramBuilder, scenario: Scenario, arm: ArmHandles, applied: InputPort) -> None:
    """Add the push at the centre of the blade's top surface, into a port that takes forces."""
    unknown = scenario.disturbance
    point = arm.tool.GetFixedPoseInBodyFrame().translation()
    begin = scenario.simulation.lead_time + unknown.push_time
    push = Push(arm.spatula_body, point, unknown.push, begin, unknown.push_duration)
    builder.AddNamedSystem("push", push)
    builder.Connect(push.get_output_port(), applied)
