"""The cell with a pancake in the place of the block: Drake moves it by finite elements."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryConfigurationVector, GeometryId
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, ContactResults, MultibodyPlant
from pydrake.multibody.tree import DeformableBodyId, ModelInstanceIndex
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from flipdiagram.arrays import Floats
from flipdiagram.blocks.block import Block
from flipdiagram.errors import SimulationError
from flipdiagram.plants.cell import ContactForces, DrakeCell, plant_config, wired
from flipdiagram.plants.handle import Rest, add_model, block_on_blade, rest_by_default
from flipdiagram.plants.pancake import add_carrier, add_pancake, let_carry, rest_shape
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.pancake_mesh import PancakeMesh, pancake_mesh
from flipdiagram.robot.parts import Parts, Surroundings, add_surroundings
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.rigid_fit import rigid_fit, spin

STRETCHED = 3.0
"""Times its own size to which a pancake may be stretched; Drake's elements are unstable long before (D#21317)."""


@dataclass(frozen=True)
class PancakeCell(DrakeCell):
    """The cell with a pancake: `plant` is Drake's model of a rigid block like it, `robot` moves what bends."""

    around: Surroundings
    """Arm and table in `robot`."""
    pancake: DeformableBodyId
    """In `robot`."""
    seen: "Pancake"
    """The box that measures it."""
    at_rest: Floats
    """Vertices (V, 3) [m] in the tool's frame, as it rests on the blade."""

    @property
    def recorded(self) -> dict[str, OutputPort]:
        """Where the vertices are, and how much of the pancake touches."""
        return {name: self.seen.GetOutputPort(name) for name in ("vertices", "contact_area")}

    def stand(self, context: Context, q: Floats) -> None:
        """See `Cell`."""
        self.put_arm(self._own_context, q)
        robot, arm = self.robot, self.around.arm
        mine = robot.GetMyMutableContextFromRoot(context)
        for moving, still in _same_models(self.around, self.parts):
            robot.SetPositions(mine, moving, self.plant.GetPositions(self._own_context, still))
        robot.SetVelocities(mine, np.zeros(robot.num_velocities()))
        X_WT = arm.tool.CalcPoseInWorld(mine)
        vertices = X_WT @ self.at_rest.T
        robot.deformable_model().SetPositionsAndVelocities(mine, self.pancake, vertices, np.zeros_like(vertices))
        own = self.seen.GetMyMutableContextFromRoot(context)
        own.SetDiscreteState(vertices.T.ravel())


class Pancake(Block):
    """What is measured of a pancake.  Not scalar-convertible: it reads Drake's geometry, over float.

    Inputs `shape`, configurations of the deformable geometries; `contact_results`; `body_poses`, of the rigid bodies.
    Outputs `vertices` (3 V,) [m] in the world, vertex by vertex; `block` (13,): pose and velocity, as `handle.Cell` has
    them, of the rigid body that fits best; `poses`: the rigid bodies' with it in its place; `contact_area` (2,) [m²]
    with blade and table.  Its state is where the vertices were one step before, of which their speeds follow.

    Raises SimulationError where the pancake is torn apart.
    """

    def __init__(
        self,
        mesh: PancakeMesh,
        mass: float,
        geometry: GeometryId,
        surfaces: tuple[list[GeometryId], list[GeometryId]],
        place: int,
        initial: Floats,
        period: float,
    ) -> None:
        super().__init__()
        self.mesh, self.masses = mesh, mesh.masses(mass)
        self.size = float(np.ptp(mesh.vertices, axis=0).max())
        self.geometry, self.surfaces, self.place, self.step = geometry, surfaces, place, period
        self.input("shape", Value[GeometryConfigurationVector]())
        self.input("contact_results", Value[ContactResults]())
        self.input("body_poses", Value[list[RigidTransform]]())
        self.state("before", initial.ravel())
        self.output("vertices", initial.size, self._vertices)
        self.intermediate("fit", self._fit)
        self.output("block", 13, self._block)
        self.output("contact_area", 2, self._area)
        read = {self._sources[name][1] for name in ("fit", "body_poses")}
        self.DeclareAbstractOutputPort("poses", lambda: Value[list[RigidTransform]](), self._poses, read)
        self.update(self._vertices, period)

    def _vertices(self, shape: GeometryConfigurationVector, t: float) -> Floats:
        vertices = np.array(shape.value(self.geometry))
        extent = np.ptp(vertices.reshape(-1, 3), axis=0).max()
        if not extent < STRETCHED * self.size:
            what = f"the pancake is stretched to {extent:.3g} m" if np.isfinite(extent) else "the state is not finite"
            raise SimulationError(f"the simulation diverged at {t:.3f} s: {what}")
        return vertices

    def _fit(self, shape: GeometryConfigurationVector) -> tuple[Floats, RigidTransform]:
        """Vertices (V, 3) [m], and the pose of the rigid body that fits them best."""
        vertices = np.array(shape.value(self.geometry)).reshape(-1, 3)
        fit = rigid_fit(vertices, self.mesh.vertices, self.masses)
        return vertices, RigidTransform(RotationMatrix.ProjectToRotationMatrix(fit.rotation), fit.centre)

    def _block(self, fit: tuple[Floats, RigidTransform], before: Floats) -> Floats:
        vertices, X_WB = fit
        omega, v = spin(vertices, (vertices - before.reshape(-1, 3)) / self.step, self.masses)
        return np.concatenate([X_WB.rotation().ToQuaternion().wxyz(), X_WB.translation(), omega, v])

    def _area(self, contact_results: ContactResults) -> Floats:
        area = np.zeros(2)
        for i in range(contact_results.num_deformable_contacts()):
            patch = contact_results.deformable_contact_info(i)
            for k, shapes in enumerate(self.surfaces):
                if patch.id_B() in shapes:
                    area[k] += patch.contact_mesh().total_area()
        return area

    def _poses(self, context: Context, poses: Value) -> None:
        rigid, (_, X_WB) = list(self.value_in(context, "body_poses")), self.value_in(context, "fit")
        poses.set_value([*rigid[: self.place], X_WB, *rigid[self.place :]])


def _same_models(around: Surroundings, parts: Parts) -> list[tuple[ModelInstanceIndex, ModelInstanceIndex]]:
    """Arm and gears in the plant that moves, and in the one of a rigid block."""
    models = [(around.arm.arm, parts.arm.arm)]
    if around.gears is not None and parts.gears is not None:
        models.append((around.gears.model, parts.gears.model))
    return models


def add_pancake_cell(
    builder: DiagramBuilder, scenario: Scenario, arm: ArmModel, q_start: Floats | None = None, rest: Rest | None = None
) -> PancakeCell:
    """Add the cell to a diagram, the pancake on the blade; see `cell.add_cell`.

    The default context has it undeformed; `PancakeCell.stand` puts it there as it rests on the blade.

    Raises:
        InputError: where the joint friction's transition velocity is too small for the step.
        SimulationError: where the pancake does not come to rest on the blade.
    """
    plant = MultibodyPlant(scenario.simulation.step)
    parts = add_model(plant, scenario, q_start)
    X_TB = block_on_blade(plant, parts)
    if rest is not None:
        rest_by_default(plant, parts, X_TB, rest)
    robot, scene_graph = AddMultibodyPlant(plant_config(scenario), builder)
    robot.set_name("robot")
    around = add_surroundings(robot, scenario)
    default = plant.CreateDefaultContext()
    X_WB = plant.GetFreeBodyPose(default, parts.block)
    mesh, blade, table = pancake_mesh(scenario.object), around.arm.spatula_body, around.table
    carrier = add_carrier(robot, blade, around.arm.tool, scenario)
    pancake = add_pancake(robot, scenario, X_WB)
    robot.Finalize()
    let_carry(scene_graph, robot, pancake, carrier, blade)
    for moving, still in _same_models(around, parts):
        robot.SetDefaultPositions(moving, plant.GetPositions(default, still))
    geometry = robot.deformable_model().GetGeometryId(pancake)
    mass = scenario.object.mass * scenario.disturbance.object_mass_scale
    surfaces = robot.GetCollisionGeometriesForBody(blade), robot.GetCollisionGeometriesForBody(table)
    initial = (X_WB @ mesh.vertices.T).T
    place, step = int(parts.block.index()), scenario.simulation.step
    seen = builder.AddNamedSystem("pancake", Pancake(mesh, mass, geometry, surfaces, place, initial, step))
    builder.Connect(robot.get_deformable_body_configuration_output_port(), seen.GetInputPort("shape"))
    builder.Connect(robot.get_contact_results_output_port(), seen.GetInputPort("contact_results"))
    builder.Connect(robot.get_body_poses_output_port(), seen.GetInputPort("body_poses"))
    ports = wired(builder, scenario, arm, robot, around, ContactForces(robot, blade, table, geometry))
    ports["systems"] = (*ports["systems"], "pancake")
    return PancakeCell(
        plant,
        parts,
        X_TB,
        **ports,
        block=seen.GetOutputPort("block"),
        poses=seen.GetOutputPort("poses"),
        scene_graph=scene_graph,
        robot=robot,
        around=around,
        pancake=pancake,
        seen=seen,
        at_rest=rest_shape(scenario, X_TB),
    )
