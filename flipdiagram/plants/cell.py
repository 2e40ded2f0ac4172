"""The robot cell of section IV: arm, spatula, block and table in one MultibodyPlant, with joint friction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId, Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlant, ContactResults, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Block
from flipdiagram.plants.handle import (
    CONTACT_PAIRS,
    Cell,
    Rest,
    add_joint_torque,
    add_model,
    add_push,
    block_on_blade,
    rest_by_default,
)
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import Parts, Surroundings
from flipdiagram.scenario.scenario import Scenario


@dataclass(frozen=True)
class DrakeCell(Cell):
    """The cell in Drake: `robot` moves it."""

    scene_graph: SceneGraph
    robot: MultibodyPlant
    """What stands in the diagram: `plant`, or another where the object is no rigid body."""

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

    def __init__(
        self, plant: MultibodyPlant, blade: RigidBody, table: RigidBody, block: RigidBody | GeometryId
    ) -> None:
        super().__init__()
        bodies = {"blade": blade, "table": table} | ({"block": block} if isinstance(block, RigidBody) else {})
        self._who: dict[BodyIndex | GeometryId, str] = {body.index(): name for name, body in bodies.items()}
        self._who |= {g: name for name, body in bodies.items() for g in plant.GetCollisionGeometriesForBody(body)}
        if isinstance(block, GeometryId):
            self._who[block] = "block"
        self._slot = {tuple(pair.split("-")): (3 * k, 1.0) for k, pair in enumerate(CONTACT_PAIRS)}
        self._slot |= {(on, by): (first, -1.0) for (by, on), (first, _) in self._slot.items()}
        self.input("contact_results", Value[ContactResults]())
        self.output("contact_wrench", 12, self._wrench)

    def _wrench(self, contact_results: ContactResults) -> Floats:
        wrench, results = np.zeros(12), contact_results
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            # F_Ac_W acts on the body of geometry M, at the centroid
            by, on, F = surface.id_N(), surface.id_M(), info.F_Ac_W()
            self._add(wrench, by, on, F.translational(), surface.centroid(), F.rotational())
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            # contact_force acts on body B
            self._add(wrench, pair.bodyA_index(), pair.bodyB_index(), pair.contact_force(), pair.contact_point(), 0.0)
        for i in range(results.num_deformable_contacts()):
            patch = results.deformable_contact_info(i)
            # F_Ac_W acts on the body of geometry A, the one that bends, at the centroid
            F, at = patch.F_Ac_W(), patch.contact_mesh().centroid()
            self._add(wrench, patch.id_B(), patch.id_A(), F.translational(), at, F.rotational())
        return wrench

    def _add(
        self,
        wrench: Floats,
        by: BodyIndex | GeometryId,
        on: BodyIndex | GeometryId,
        force: Floats,
        at: Floats,
        couple: Floats | float,
    ) -> None:
        pair = self._who.get(by, ""), self._who.get(on, "")
        if (slot := self._slot.get(pair)) is not None:
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
    plant, scene_graph = AddMultibodyPlant(plant_config(scenario), builder)
    parts = add_model(plant, scenario, q_start)
    X_TB = block_on_blade(plant, parts)
    if rest is not None:
        rest_by_default(plant, parts, X_TB, rest)
    forces = ContactForces(plant, parts.arm.spatula_body, parts.table, parts.block)
    return DrakeCell(
        plant,
        parts,
        X_TB,
        **wired(builder, scenario, arm, plant, parts, forces),
        block=plant.get_state_output_port(parts.block.model_instance()),
        poses=plant.get_body_poses_output_port(),
        scene_graph=scene_graph,
        robot=plant,
    )


def plant_config(scenario: Scenario) -> MultibodyPlantConfig:
    """How Drake's plant of a cell steps and touches.

    Sampled outputs would make the plant step in an unrestricted update, which Drake runs before the discrete updates of
    the same instant: the observer would then see the state after the step, and everything be evaluated twice.
    """
    settings = scenario.simulation
    return MultibodyPlantConfig(
        time_step=settings.step,
        contact_model=settings.contact_model,
        discrete_contact_approximation=settings.contact_approximation,
        use_sampled_output_ports=False,
    )


def wired(
    builder: DiagramBuilder,
    scenario: Scenario,
    arm: ArmModel,
    robot: MultibodyPlant,
    parts: Parts | Surroundings,
    forces: ContactForces,
) -> dict[str, Any]:
    """Add what stands around a plant in the diagram: joint friction, push, contact forces; fields of its `DrakeCell`.

    parts: those of this plant, finalized.
    """
    settings = scenario.simulation
    state = builder.AddNamedSystem("joint_state", Demultiplexer([arm.n_joints] * 2))
    contact = builder.AddNamedSystem("contact_forces", forces)
    builder.Connect(robot.get_state_output_port(parts.arm.arm), state.get_input_port())
    link, of_links = state, tuple[str, ...]()
    if parts.gears is not None:
        models = parts.arm.arm, parts.gears.model
        link, of_links = _add_link_state(builder, [robot.get_state_output_port(m) for m in models], arm.n_joints)
    torque = add_joint_torque(builder, scenario, arm, state.get_output_port(1))
    builder.Connect(torque.get_output_port(), robot.get_actuation_input_port(parts.arm.arm))
    builder.Connect(robot.get_contact_results_output_port(), contact.get_input_port())
    if any(scenario.disturbance.push):
        add_push(builder, scenario, parts.arm, robot.get_applied_spatial_force_input_port())
    return {
        "tau": torque.get_input_port(0),
        "q": state.get_output_port(0),
        "qd": state.get_output_port(1),
        "q_link": link.get_output_port(0),
        "qd_link": link.get_output_port(1),
        "contact_wrench": contact.get_output_port(),
        "systems": (
            "robot",
            "scene_graph",
            "joint_friction",
            "joint_torque",
            "joint_state",
            "contact_forces",
            *of_links,
        ),
        "engine": f"Drake, step {1e3 * settings.step:g} ms, {settings.contact_model}, {settings.contact_approximation}",
    }


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
