"""The parts of a scenario: arm with its spatula, block and table, for planner, controller, cell and pictures alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from flipdiagram.arm import ArmModel
from flipdiagram.assembly import ArmHandles, add_arm
from flipdiagram.assets import block_sdf, spatula_urdf, table_sdf
from flipdiagram.scenario import Scenario

PAYLOAD_RADIUS = 0.03
"""Radius [m] of the sphere that stands for an unknown payload."""


@dataclass(frozen=True)
class Parts:
    """What `add_parts` put into a plant."""

    arm: ArmHandles
    block: RigidBody
    table: RigidBody


def arm_of(scenario: Scenario) -> ArmModel:
    """The arm as controller and planner know it: no block, no friction; control point at the object's centre."""
    return ArmModel(**_arm_options(scenario))


def add_parts(plant: MultibodyPlant, scenario: Scenario) -> Parts:
    """Add arm, spatula, block and table to a plant that is not finalized; raises ScenarioError for a bad number."""
    arm = add_arm(plant, **_arm_options(scenario))
    if scenario.disturbance.payload > 0:
        _add_payload(plant, arm, scenario.disturbance.payload)
    thing, physics = scenario.object, scenario.simulation
    block = block_sdf(
        size=(thing.width, thing.length, thing.thickness),
        mass=thing.mass,
        friction=thing.friction,
        hydroelastic_modulus=physics.hydroelastic_modulus,
        hunt_crossley_dissipation=physics.dissipation,
    )
    (block_model,) = Parser(plant).AddModelsFromString(block, "sdf")
    (table_model,) = Parser(plant).AddModelsFromString(table_sdf(friction=scenario.table.friction), "sdf")
    table = plant.GetBodyByName("table", table_model)
    top: Any = np.array([scenario.task.start_x, scenario.task.target_y, scenario.table.height])
    plant.WeldFrames(plant.world_frame(), table.body_frame(), RigidTransform(top))
    return Parts(arm, plant.GetBodyByName("block", block_model), table)


def _add_payload(plant: MultibodyPlant, arm: ArmHandles, mass: float) -> None:
    """A solid sphere at the flange, without collision geometry: only its mass [kg] matters."""
    payload = plant.AddRigidBody(
        "payload", plant.AddModelInstance("payload"), SpatialInertia.SolidSphereWithMass(mass, PAYLOAD_RADIUS)
    )
    plant.WeldFrames(arm.flange, payload.body_frame())


def _arm_options(scenario: Scenario) -> dict[str, Any]:
    arm, tool = scenario.arm, scenario.tool
    spatula = spatula_urdf(
        blade_size=(tool.blade_length, tool.blade_width, tool.blade_thickness),
        tool_length=tool.reach,
        mass=tool.mass,
        friction=scenario.object.friction,
    )
    return {
        "tool_height": scenario.object.thickness / 2,
        "link_inertia_scale": arm.link_inertia_scale,
        "reflected_inertia_scale": arm.reflected_inertia_scale,
        "speed_scale": arm.speed_scale,
        "torque_scale": arm.torque_scale,
        "link_inertia_scales": arm.link_inertia_scales,
        "reflected_inertia_scales": arm.reflected_inertia_scales,
        "spatula": spatula,
    }
