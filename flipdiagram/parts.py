"""The parts of a scenario: arm with its spatula, block and table, for planner, controller, cell and pictures alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from flipdiagram.arm import ArmModel
from flipdiagram.assembly import ArmHandles, add_arm
from flipdiagram.assets import block_sdf, spatula_urdf, table_sdf
from flipdiagram.scenario import Scenario


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
        "spatula": spatula,
    }
