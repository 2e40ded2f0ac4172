"""The robot cell of section IV: arm, spatula, block and table in one MultibodyPlant, with joint friction."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, ContactResults, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Block
from flipdiagram.blocks.friction import JointFriction, stable_transition_velocity
from flipdiagram.errors import InputError
from flipdiagram.plants.push import Push
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import Parts, add_parts
from flipdiagram.scenario.scenario import Scenario


@dataclass(frozen=True)
class Cell:
    """Handles to the cell: its ports, and the parts inside."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    parts: Parts
    tau: InputPort
    """Torques of the drives (n,) [N m]."""
    q: OutputPort
    qd: OutputPort
    block: OutputPort
    """Pose of the block, quaternion (w first) and position [m], then its velocity in the world: (13,)."""
    poses: OutputPort
    """Of all bodies, by their indices in `plant`."""
    contact_wrench: OutputPort
    systems: tuple[str, ...]
    """Names of all systems of the cell."""

    def stand(self, context: Context, q: Floats) -> None:
        """Put the arm at rest at angles q (n,) [rad] into a root Context, the block where it lies on the blade."""
        plant, X_TB = self.plant, self._block_on_blade
        context = plant.GetMyMutableContextFromRoot(context)
        plant.SetPositions(context, self.parts.arm.arm, q)
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        plant.SetFreeBodyPose(context, self.parts.block, self.parts.arm.tool.CalcPoseInWorld(context) @ X_TB)

    def holding_torque(self, q: Floats) -> Floats:
        """Joint torques (n,) [N m] that hold arm and block still at q (n,) [rad], without friction of the joints."""
        plant, arm, context = self.plant, self.parts.arm, self._own_context
        plant.SetPositions(context, arm.arm, q)
        centre = self._block_on_blade @ self.parts.block.default_com()
        world = plant.world_frame()
        J = plant.CalcJacobianTranslationalVelocity(context, JacobianWrtVariable.kV, arm.tool, centre, world, world)
        weight = self.parts.block.default_mass() * plant.gravity_field().gravity_vector()
        torque = plant.CalcGravityGeneralizedForces(context) + J.T @ weight
        return -np.asarray(plant.GetVelocitiesFromArray(arm.arm, torque), dtype=float)

    @cached_property
    def _own_context(self) -> Context:
        return self.plant.CreateDefaultContext()

    @cached_property
    def _block_on_blade(self) -> RigidTransform:
        """Pose of the block's body in the tool's frame, as in the default Context."""
        context = self.plant.CreateDefaultContext()
        X_WT = self.parts.arm.tool.CalcPoseInWorld(context)
        return X_WT.inverse() @ self.plant.GetFreeBodyPose(context, self.parts.block)


CONTACT_PAIRS = ("blade-block", "table-block", "table-blade")
"""Who pushes whom in the output of `ContactForces`: the first on the second."""


class ContactForces(Block):
    """Contact forces, output `contact_wrench` (12,): force x, y, z [N] in world axes for each of `CONTACT_PAIRS`, then
    the moment [N·m] of the first pair's forces, blade on block, about the world's origin.

    Input `contact_results` of a MultibodyPlant.  Not scalar-convertible: it reads them over float.
    The forces belong to the step that begins at t: the plant's outputs are not sampled (see `add_cell`).
    """

    def __init__(self, plant: MultibodyPlant, parts: Parts) -> None:
        super().__init__()
        bodies = (parts.arm.spatula_body, parts.block, parts.table)
        self._body_of = {g: b.index() for b in bodies for g in plant.GetCollisionGeometriesForBody(b)}
        blade, block, table = (body.index() for body in bodies)
        self._slot = {(blade, block): (0, 1.0), (table, block): (3, 1.0), (table, blade): (6, 1.0)}
        self._slot |= {(on, by): (first, -1.0) for (by, on), (first, _) in self._slot.items()}
        self.input("contact_results", Value[ContactResults]())
        self.output("contact_wrench", 12, self._wrench)

    def _wrench(self, contact_results: ContactResults) -> Floats:
        wrench, results = np.zeros(12), contact_results
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            # F_Ac_W acts on the body of geometry M, at the centroid
            by, on, F = self._body_of.get(surface.id_N()), self._body_of.get(surface.id_M()), info.F_Ac_W()
            self._add(wrench, by, on, F.translational(), surface.centroid(), F.rotational())
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            # contact_force acts on body B
            self._add(wrench, pair.bodyA_index(), pair.bodyB_index(), pair.contact_force(), pair.contact_point(), 0.0)
        return wrench

    def _add(
        self,
        wrench: Floats,
        by: BodyIndex | None,
        on: BodyIndex | None,
        force: Floats,
        at: Floats,
        couple: Floats | float,
    ) -> None:
        if (slot := self._slot.get((by, on))) is not None:
            first, sign = slot
            wrench[first : first + 3] += sign * force
            if first == 0:
                (x, y, z), (fx, fy, fz) = at, force  # np.cross costs more than the rest of this method
                wrench[9:] += sign * (couple + np.array([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx]))


def add_cell(builder: DiagramBuilder, scenario: Scenario, arm: ArmModel, q_start: Floats | None = None) -> Cell:
    """Add the cell to a diagram, at rest with the block on the blade at the start of the task, level there.

    Args:
        builder: the diagram.
        scenario: what the cell is made of.
        arm: the controller's model of the same arm, for rated torques and inertia.
        q_start: joint angles (n,) [rad] of the default context; by default those of the arm's files.

    Raises:
        InputError: where the joint friction's transition velocity is too small for the step.
    """
    settings = scenario.simulation
    # Sampled outputs would make the plant step in an unrestricted update, which Drake runs before the discrete updates
    # of the same instant: the observer would then see the state after the step, and everything be evaluated twice.
    config = MultibodyPlantConfig(
        time_step=settings.step,
        contact_model=settings.contact_model,
        discrete_contact_approximation=settings.contact_approximation,
        use_sampled_output_ports=False,
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    parts = add_parts(plant, scenario)
    plant.Finalize()
    plant.set_name("robot")
    if q_start is not None:
        plant.SetDefaultPositions(parts.arm.arm, q_start)
    task, unknown = scenario.task, scenario.disturbance
    y = task.start_y + unknown.start_error + unknown.block_offset
    plant.SetDefaultFloatingBaseBodyPose(parts.block, RigidTransform([task.start_x, y, task.start_z]))
    n = arm.n_joints
    friction = builder.AddNamedSystem("joint_friction", joint_friction(scenario, arm))
    torque = builder.AddNamedSystem("joint_torque", Adder(2, n))
    state = builder.AddNamedSystem("joint_state", Demultiplexer([n, n]))
    contact = builder.AddNamedSystem("contact_forces", ContactForces(plant, parts))
    builder.Connect(plant.get_state_output_port(parts.arm.arm), state.get_input_port())
    builder.Connect(state.get_output_port(1), friction.get_input_port())
    builder.Connect(friction.get_output_port(), torque.get_input_port(1))
    builder.Connect(torque.get_output_port(), plant.get_actuation_input_port(parts.arm.arm))
    builder.Connect(plant.get_contact_results_output_port(), contact.get_input_port())
    if any(unknown.push):  # at the centre of the blade's top surface
        point = parts.arm.tool.GetFixedPoseInBodyFrame().translation()
        begin = settings.lead_time + unknown.push_time
        push = Push(parts.arm.spatula_body, point, unknown.push, begin, unknown.push_duration)
        builder.AddNamedSystem("push", push)
        builder.Connect(push.get_output_port(), plant.get_applied_spatial_force_input_port())
    return Cell(
        plant,
        scene_graph,
        parts,
        tau=torque.get_input_port(0),
        q=state.get_output_port(0),
        qd=state.get_output_port(1),
        block=plant.get_state_output_port(parts.block.model_instance()),
        poses=plant.get_body_poses_output_port(),
        contact_wrench=contact.get_output_port(),
        systems=(plant.get_name(), "scene_graph", *(box.get_name() for box in (friction, torque, state, contact))),
    )


def joint_friction(scenario: Scenario, arm: ArmModel) -> LeafSystem:
    """The friction box of the scenario, its levels as fractions of each joint's rated torque.

    Raises InputError where the friction would chatter: it acts explicitly, so its slope at rest is limited by the
    joint's inertia (the diagonal of M at the arm's home pose) and the step.
    """
    level = scenario.joint_friction
    coulomb, viscous = level.coulomb * arm.tau_rated, level.viscous * arm.tau_rated
    needed = stable_transition_velocity(coulomb, np.diag(arm.mass_matrix(arm.home)), scenario.simulation.step)
    if np.any(needed > level.transition_velocity):
        worst = int(np.argmax(needed))
        v_s, field = level.transition_velocity, "joint_friction.transition_velocity"
        message = (
            f"scenario field '{field}' = {v_s} rad/s makes joint {arm.joint_names[worst]} chatter at this step and"
            f" level; valid is at least {needed[worst]:.4f} rad/s"
        )
        raise InputError(message, field=field, value=v_s, valid=needed[worst])
    return JointFriction(coulomb, viscous, np.full(arm.n_joints, level.transition_velocity))
