"""The parts of a scenario: arm with its spatula, block and table, for planner, controller, cell and pictures alike."""

import math
from dataclasses import dataclass

from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import ArmSpec
from flipdiagram.robot.assembly import ArmHandles, add_arm, add_body
from flipdiagram.robot.gears import GearHandles, add_gears, gears_of
from flipdiagram.robot.model_files import table_sdf
from flipdiagram.robot.own_things import add_object, check_object, tool_text
from flipdiagram.scenario.scenario import Scenario

PAYLOAD_RADIUS = 0.03
"""Radius [m] of the sphere that stands for an unknown payload."""


@dataclass(frozen=True)
class Parts:
    """What `add_parts` put into a plant."""

    arm: ArmHandles
    block: RigidBody
    table: RigidBody
    gears: GearHandles | None = None
    """None where the joints are rigid."""


@dataclass(frozen=True)
class Surroundings:
    """The same around an object that is no rigid body."""

    arm: ArmHandles
    table: RigidBody
    gears: GearHandles | None


def arm_of(scenario: Scenario) -> ArmModel:
    """The arm as controller and planner know it: no block, no friction; control point at the object's centre."""
    return ArmModel(_arm_spec(scenario))


def loaded_arm_of(scenario: Scenario) -> ArmModel:
    """The arm with the object that it shall carry, of the mass that the planner knows: for planned torques alone."""
    planned = scenario.with_overrides({"disturbance.object_mass_scale": 1.0})
    return ArmModel(_arm_spec(scenario), lambda plant: add_object(plant, planned))


def add_parts(plant: MultibodyPlant, scenario: Scenario) -> Parts:
    """Add arm, spatula, block and table to a plant that is not finalized; raises InputError for a bad number."""
    arm, gears = _add_arm(plant, scenario)
    block = add_object(plant, scenario)
    return Parts(arm, block, _add_table(plant, scenario, arm), gears)


def add_surroundings(plant: MultibodyPlant, scenario: Scenario) -> Surroundings:
    """The same without the block."""
    arm, gears = _add_arm(plant, scenario)
    return Surroundings(arm, _add_table(plant, scenario, arm), gears)


def _add_arm(plant: MultibodyPlant, scenario: Scenario) -> tuple[ArmHandles, GearHandles | None]:
    arm, gears = add_arm(plant, _arm_spec(scenario)), None
    if scenario.joints.model == "elastic":
        rigid = arm_of(scenario)
        gears = add_gears(plant, arm, gears_of(scenario, rigid), rigid.joint_names)
    if scenario.disturbance.payload > 0:
        _add_payload(plant, arm, scenario.disturbance.payload)
    return arm, gears


def _add_table(plant: MultibodyPlant, scenario: Scenario, arm: ArmHandles) -> RigidBody:
    table_text = table_sdf(scenario.table.friction)
    table = add_body(plant, "the table", lambda parser: parser.AddModelsFromString(table_text, "sdf"))
    height = scenario.table.height + scenario.disturbance.table_error
    X_WT = RigidTransform([scenario.task.start_x, scenario.task.target_y, height])
    plant.WeldFrames(plant.world_frame(), table.body_frame(), X_WT)
    _leave_out_collisions(plant, arm)
    return table


def _leave_out_collisions(plant: MultibodyPlant, arm: ArmHandles) -> None:
    """An own arm's collision shapes that its format could not leave out touch nothing."""
    if plant.geometry_source_is_registered():
        scene_graph = Parser(plant).scene_graph()
        for body in (plant.get_body(i) for i in plant.GetBodyIndices(arm.arm)):
            for shape in plant.GetCollisionGeometriesForBody(body):
                scene_graph.RemoveRole(plant.get_source_id(), shape, Role.kProximity)


def base_in_plane(scenario: Scenario) -> tuple[float, float, float, float]:
    """Pose (x, y, z, yaw) [m, rad] of the arm's base in the frame of the motion.

    The motion is planned in a vertical plane that `task.yaw` turns about the vertical axis through the start.  In the
    frame that turns with it the motion is the planar one, and the arm's base is turned the other way.
    """
    x, y, z, yaw = scenario.arm.base_pose
    turn, task = scenario.task.yaw, scenario.task
    if turn == 0:
        return x, y, z, yaw
    c, s = math.cos(-turn), math.sin(-turn)
    dx, dy = x - task.start_x, y - task.start_y
    return task.start_x + c * dx - s * dy, task.start_y + s * dx + c * dy, z, yaw - turn


def _add_payload(plant: MultibodyPlant, arm: ArmHandles, mass: float) -> None:
    """A solid sphere at the flange, without collision geometry: only its mass [kg] matters."""
    payload = plant.AddRigidBody(
        "payload", plant.AddModelInstance("payload"), SpatialInertia.SolidSphereWithMass(mass, PAYLOAD_RADIUS)
    )
    plant.WeldFrames(arm.flange, payload.body_frame())


def _arm_spec(scenario: Scenario) -> ArmSpec:
    """The arm with its tool; InputError unless the files of tool and object say what the scenario says."""
    check_object(scenario)
    arm = scenario.arm.model_copy(update={"base_pose": base_in_plane(scenario)})
    return ArmSpec(arm, scenario.object.thickness / 2, tool_text(scenario))
