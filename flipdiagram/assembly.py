"""Arm and spatula put into a MultibodyPlant: the one place where the cell and `ArmModel` get them from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, ModelInstanceIndex, RigidBody

from flipdiagram import assets
from flipdiagram.errors import ScenarioError

# Harmonic drives on top of the rotors: their share is unknown, doubling is our estimate [L].
REFLECTED_INERTIA_SCALE = 2.0

# Flange: z out of it, x up. Spatula: x out, z up. So x_S = z_F, y_S = -y_F, z_S = x_F; columns are S in F.
R_FLANGE_SPATULA: Any = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class ArmHandles:
    """What `add_arm` put into a plant; all valid before and after Finalize."""

    arm: ModelInstanceIndex
    spatula: ModelInstanceIndex
    spatula_body: RigidBody
    tool: Frame  # T: centre of the blade's top surface, x along the handle, z the normal
    control_point: Frame  # T moved along its z by tool_height: origin C
    flange: Frame  # sixth modified-DH frame
    rated_torques: dict[str, float]  # [N m] by joint name
    home: dict[str, float]  # [rad] by joint name: near the start pose


def add_arm(
    plant: MultibodyPlant,
    *,
    tool_height: float = 0.005,
    link_inertia_scale: float = 1.0,
    reflected_inertia_scale: float = REFLECTED_INERTIA_SCALE,
    speed_scale: float = 1.0,
    torque_scale: float = 1.0,
    link_inertia_scales: Sequence[float] | None = None,
    reflected_inertia_scales: Sequence[float] | None = None,
    arm: str | None = None,
    spatula: str | None = None,
) -> ArmHandles:
    """Add arm and spatula to a plant that is not finalized: base welded to the world, spatula to the flange.

    tool_height: C above the blade's top surface [m]; the scales are factors on the numbers of mh3f.urdf
    (`assets.arm_urdf`); arm: path of a URDF of the user's own with a link "base", a frame or link "flange",
    and an actuator and a <limit> for every joint; spatula: URDF text (`assets.spatula_urdf(...)`, default
    numbers if None). Raises ScenarioError for a bad number and for a file that lacks one of these.
    """
    text = assets.arm_urdf(
        arm,
        link_inertia_scale=link_inertia_scale,
        reflected_inertia_scale=reflected_inertia_scale,
        speed_scale=speed_scale,
        torque_scale=torque_scale,
        link_inertia_scales=link_inertia_scales,
        reflected_inertia_scales=reflected_inertia_scales,
    )
    offset: Any = np.array([0.0, 0.0, assets.check_not_negative("tool_height", tool_height)])
    no_offset: Any = np.zeros(3)
    file = arm or "mh3f.urdf"
    try:
        (arm_instance,) = Parser(plant).AddModelsFromString(text, "urdf")
    except RuntimeError as error:
        raise ScenarioError(f"arm = '{file}' cannot be read as URDF: {error}") from None
    for name in ("base", "flange"):
        if not plant.HasFrameNamed(name, arm_instance):
            raise ScenarioError(f"arm = '{file}' has no link or frame '{name}'; valid is an arm with both")
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(arm_instance)]
    names = [joint.name() for joint in joints if joint.num_velocities() > 0]
    rated, home = assets.rated_torques(text), assets.home_angles(text)
    for name in names:
        if name not in rated or not plant.HasJointActuatorNamed(name, arm_instance):
            raise ScenarioError(f"arm = '{file}': joint '{name}' needs a <limit> and an actuator of its name")

    (spatula_instance,) = Parser(plant).AddModelsFromString(spatula or assets.spatula_urdf(), "urdf")
    flange = plant.GetFrameByName("flange", arm_instance)
    body = plant.GetBodyByName("spatula", spatula_instance)
    tool = plant.GetFrameByName("tool", spatula_instance)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base", arm_instance))
    plant.WeldFrames(flange, body.body_frame(), RigidTransform(RotationMatrix(R_FLANGE_SPATULA), no_offset))
    C_in_T = FixedOffsetFrame("control_point", tool, RigidTransform(offset), spatula_instance)
    return ArmHandles(
        arm=arm_instance,
        spatula=spatula_instance,
        spatula_body=body,
        tool=tool,
        control_point=plant.AddFrame(C_in_T),
        flange=flange,
        rated_torques={name: rated[name] for name in names},
        home={name: home[name] for name in names},
    )
