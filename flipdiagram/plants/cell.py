"""The robot cell of section IV: arm, spatula, block and table in one MultibodyPlant, with joint friction."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, ContactResults, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Block
from flipdiagram.plants.handle import Cell, Rest, add_joint_torque, add_model, add_push, block_on_blade, rest_by_default
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import Parts
from flipdiagram.scenario.scenario import Scenario


@dataclass(frozen=True)
class DrakeCell(Cell):
    """The cell in Drake: `plant` moves it."""

    scene_graph: SceneGraph

    def stand(self, context: Context, q: Floats) -> None:
        """See `Cell`."""
        plant, X_TB = self.plant, self.X_TB
        context = plant.GetMyMutableContextFromRoot(context)
        self.put_arm(context, q)
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        plant.SetFreeBodyPose(context, self.parts.block, self.parts.arm.tool.CalcPoseInWorld(context) @ X_TB)

    def show(self, builder: DiagramBuilder, meshcat: Meshcat) -> None:
        """See `Cell`."""
        MeshcatVisualizer.AddToBuilder(builder, self.scene_graph, meshcat)


class ContactForces(Block):
    """Contact forces, output `contact_wrench` (12,): force x, y, z [N] in world axes for each of the pairs
    `handle.CONTACT_PAIRS`, then the moment [N·m] of the first pair's forces, blade on block, about the world's origin.

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


def add_cell(
    builder: DiagramBuilder, scenario: Scenario, arm: ArmModel, q_start: Floats | None = None, rest: Rest | None = None
) -> DrakeCell:
    """Add the cell to a diagram, at rest with the block on the blade at the start of the task, level there.

    Args:
        builder: the diagram.
        scenario: what the cell is made of.
        arm: the controller's model of the same arm, for rated torques and inertia.
        q_start: joint angles (n,) [rad] of the default context; by default those of the arm's files.
        rest: by which the default context is where the arm rests instead, see `handle.Rest`.

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
    parts = add_model(plant, scenario, q_start)
    X_TB = block_on_blade(plant, parts)
    if rest is not None:
        rest_by_default(plant, parts, X_TB, rest)
    state = builder.AddNamedSystem("joint_state", Demultiplexer([arm.n_joints] * 2))
    contact = builder.AddNamedSystem("contact_forces", ContactForces(plant, parts))
    builder.Connect(plant.get_state_output_port(parts.arm.arm), state.get_input_port())
    link, of_links = state, tuple[str, ...]()
    if parts.gears is not None:
        models = parts.arm.arm, parts.gears.model
        link, of_links = _add_link_state(builder, [plant.get_state_output_port(m) for m in models], arm.n_joints)
    torque = add_joint_torque(builder, scenario, arm, state.get_output_port(1))
    builder.Connect(torque.get_output_port(), plant.get_actuation_input_port(parts.arm.arm))
    builder.Connect(plant.get_contact_results_output_port(), contact.get_input_port())
    if any(scenario.disturbance.push):
        add_push(builder, scenario, parts, plant.get_applied_spatial_force_input_port())
    return DrakeCell(
        plant,
        parts,
        X_TB,
        tau=torque.get_input_port(0),
        q=state.get_output_port(0),
        qd=state.get_output_port(1),
        q_link=link.get_output_port(0),
        qd_link=link.get_output_port(1),
        block=plant.get_state_output_port(parts.block.model_instance()),
        poses=plant.get_body_poses_output_port(),
        contact_wrench=contact.get_output_port(),
        systems=("robot", "scene_graph", "joint_friction", "joint_torque", "joint_state", "contact_forces", *of_links),
        engine=f"Drake, step {1e3 * settings.step:g} ms, {settings.contact_model}, {settings.contact_approximation}",
        scene_graph=scene_graph,
    )


def _add_link_state(
    builder: DiagramBuilder, states: Sequence[OutputPort], n: int
) -> tuple[Demultiplexer, tuple[str, ...]]:
    """Add angles and speeds of the links, the sum of the states of joints and gears (2 n,); and the boxes' names."""
    names = "link_sum", "link_state"
    total = builder.AddNamedSystem(names[0], Adder(len(states), 2 * n))
    for i, state in enumerate(states):
        builder.Connect(state, total.get_input_port(i))
    split = builder.AddNamedSystem(names[1], Demultiplexer([n, n]))
    builder.Connect(total.get_output_port(), split.get_input_port())
    return split, names
