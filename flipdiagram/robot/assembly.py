"""Arm and spatula put into a MultibodyPlant: the one place where the cell and `ArmModel` get them from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    Joint,
    JointActuator,
    ModelInstanceIndex,
    RigidBody,
    WeldJoint,
)

from flipdiagram.errors import InputError
from flipdiagram.robot import model_files as assets
from flipdiagram.robot import own_files as arm_files
from flipdiagram.robot.own_files import ArmFile

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
    rated_torques: dict[str, float]  # [N m] by joint name, from base to flange
    home: dict[str, float] | None  # [rad] by joint name: near the start pose; None where nobody says


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
    arm: ArmFile | str | None = None,
    spatula: str | None = None,
    base_pose: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> ArmHandles:
    """Add arm and spatula to a plant that is not finalized: base welded to the world, spatula to the flange.

    tool_height: C above the blade's top surface [m]; the scales are factors on the numbers of mh3f.urdf
    (`assets.arm_urdf`); arm: a file of the user's own (None: mh3f.urdf); spatula: URDF or SDF text with a body and a
    frame "tool" (`assets.spatula_urdf(...)`, default numbers if None); base_pose: x, y, z [m] and yaw [rad] of
    the base.  Raises InputError for a bad number and for a file that lacks something.
    """
    own = ArmFile(arm) if isinstance(arm, str) else arm
    offset: Any = np.array([0.0, 0.0, assets.check_not_negative("tool_height", tool_height)])
    scales: dict[str, Any] = {
        "link_inertia_scale": link_inertia_scale,
        "reflected_inertia_scale": reflected_inertia_scale,
        "speed_scale": speed_scale,
        "torque_scale": torque_scale,
        "link_inertia_scales": link_inertia_scales,
        "reflected_inertia_scales": reflected_inertia_scales,
    }
    if own is None:
        instance, rated, home, _ = _add_urdf(plant, None, scales)
        base, flange = (plant.GetFrameByName(name, instance) for name in ("base", "flange"))
        R_FS = RotationMatrix(R_FLANGE_SPATULA)
    else:
        own.check()
        instance, rated, home, _ = _add_own(plant, own, scales)
        base, flange = (plant.GetFrameByName(name, instance) for name in (own.base, own.flange))
        R_FS = RotationMatrix.MakeZRotation(own.mount_angle) @ RotationMatrix(R_FLANGE_SPATULA)
    x, y, z, yaw = base_pose
    X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, z]) if any(base_pose) else RigidTransform()
    plant.WeldFrames(plant.world_frame(), base, X_WB)

    tool_model, body, tool = _add_spatula(plant, spatula or assets.spatula_urdf())
    plant.WeldFrames(flange, body.body_frame(), RigidTransform(R_FS, np.zeros(3)))
    C_in_T = FixedOffsetFrame("control_point", tool, RigidTransform(offset), tool_model)
    return ArmHandles(
        arm=instance,
        spatula=tool_model,
        spatula_body=body,
        tool=tool,
        control_point=plant.AddFrame(C_in_T),
        flange=flange,
        rated_torques=rated,
        home=home,
    )


Added = tuple[ModelInstanceIndex, dict[str, float], dict[str, float] | None, dict[str, float]]
"""The model, rated torques [N m], home [rad] and peak torques [N m] by joint name, as far as the file tells."""


def _add_urdf(plant: MultibodyPlant, own: ArmFile | None, scales: dict[str, Any]) -> Added:
    text = assets.arm_urdf(own, **scales)
    try:
        (instance,) = Parser(plant).AddModelsFromString(text, "urdf")
    except RuntimeError as error:
        raise InputError(f"arm.file = '{own.path if own else 'mh3f.urdf'}' cannot be read: {error}") from None
    names = [joint.name() for joint in _moving(plant, instance)]
    rated, home = arm_files.rated_torques(text), arm_files.home_angles(text)
    stated = {name: rated.get(name, np.inf) for name in names}
    return instance, stated, home and {name: home[name] for name in names}, arm_files.peak_torques(text)


def _add_own(plant: MultibodyPlant, own: ArmFile, scales: dict[str, Any]) -> Added:
    """An arm of the user's own: its file, then what the scenario says instead of the file."""
    rated: dict[str, float] = {}
    peak: dict[str, float] = {}
    home: dict[str, float] | None = None
    if own.is_urdf:
        instance, rated, home, peak = _add_urdf(plant, own, scales)
        scales = {}  # they are in the text
    else:
        if any(scales[name] != 1.0 for name in ("link_inertia_scale",)) or scales["link_inertia_scales"] is not None:
            raise InputError(f"arm.link_inertia_scale needs a URDF; valid is 1 for arm.file = '{own.path}'")
        try:
            instance = Parser(plant).AddModels(own.path)[0]
        except (RuntimeError, IndexError) as error:
            raise InputError(f"arm.file = '{own.path}' cannot be read: {error}") from None
        _fix_off_the_chain(plant, instance, own)
        _free_from_the_ground(plant, instance, own)
    joints = _moving(plant, instance)
    names = [joint.name() for joint in joints]
    for field in ("home", "torque_limits", "speed_limits", "reflected_inertia"):
        given = getattr(own, field)
        if given is not None and len(given) != len(joints):
            raise InputError(
                f"scenario field 'arm.{field}' = {list(given)} has {len(given)} entries;"
                f" valid is one per joint, {' '.join(names)}"
            )
    torque = _actuate(plant, own, joints, scales, peak)
    if own.speed_limits is not None:
        for joint, limit in zip(joints, own.speed_limits, strict=True):
            joint.set_velocity_limits([-limit], [limit])
    if own.home is not None:
        home = dict(zip(names, own.home, strict=True))
    known = own.torque_limits is None
    rated = {n: rated[n] if known and np.isfinite(rated.get(n, np.inf)) else torque[n] for n in names}
    return instance, rated, home, peak


def _moving(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[Joint]:
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(instance)]
    return [joint for joint in joints if joint.num_velocities() > 0]


def _actuate(
    plant: MultibodyPlant, own: ArmFile, joints: Sequence[Joint], scales: dict[str, Any], stated: dict[str, float]
) -> dict[str, float]:
    """One actuator a joint, in the order of the joints, which the plant's input then has too; returns their limits."""
    old: dict[str, JointActuator] = {}
    for index in list(plant.GetJointActuatorIndices()):
        actuator = plant.get_joint_actuator(index)
        old[actuator.joint().name()] = actuator
    limits, gears = {}, {}
    for k, joint in enumerate(joints):
        name, actuator = joint.name(), old.get(joint.name())
        in_file = actuator.effort_limit() if actuator else stated.get(name, 0.0)
        limit = own.torque_limits[k] if own.torque_limits else in_file
        limit *= scales.get("torque_scale", 1.0)
        if not (np.isfinite(limit) and limit > 0):
            raise InputError(
                f"arm.file = '{own.path}': joint '{name}' has no torque limit; valid is one per joint"
                f" in the file or in arm.torque_limits, {' '.join(j.name() for j in joints)}"
            )
        limits[name] = float(limit)
        ratio, rotor = (actuator.default_gear_ratio(), actuator.default_rotor_inertia()) if actuator else (1.0, 0.0)
        rotor *= scales.get("reflected_inertia_scale", 1.0) * (scales.get("reflected_inertia_scales") or [1.0] * 99)[k]
        gears[name] = (1.0, own.reflected_inertia[k]) if own.reflected_inertia else (ratio, rotor)
    for actuator in old.values():
        plant.RemoveJointActuator(actuator)
    for joint in joints:
        actuator = plant.AddJointActuator(joint.name(), joint, limits[joint.name()])
        ratio, rotor = gears[joint.name()]
        actuator.set_default_gear_ratio(ratio)
        actuator.set_default_rotor_inertia(rotor)
        if (scale := scales.get("speed_scale", 1.0)) != 1.0:
            joint.set_velocity_limits(scale * joint.velocity_lower_limits(), scale * joint.velocity_upper_limits())
    return limits


def _free_from_the_ground(plant: MultibodyPlant, instance: ModelInstanceIndex, own: ArmFile) -> None:
    """Remove what the file itself fixes the base to the world with: where it stands is the scenario's."""
    base = plant.GetFrameByName(own.base, instance).body().index()
    for index in plant.GetJointIndices(instance):
        joint = plant.get_joint(index)
        if joint.child_body().index() == base and joint.num_velocities() == 0:
            plant.RemoveJoint(joint)


def _fix_off_the_chain(plant: MultibodyPlant, instance: ModelInstanceIndex, own: ArmFile) -> None:
    """Weld the moving joints that do not lie between base and flange, as `arm_files.made_ready` does for a URDF."""
    for name in (own.base, own.flange):
        if not plant.HasFrameNamed(name, instance):
            raise InputError(f"arm.file = '{own.path}' has no link or frame '{name}'; valid is an arm with both")
    by_child = {plant.get_joint(i).child_body().index(): plant.get_joint(i) for i in plant.GetJointIndices(instance)}
    here, base = (plant.GetFrameByName(name, instance).body().index() for name in (own.flange, own.base))
    chain = set()
    while here != base:
        if here not in by_child:
            raise InputError(f"arm.file = '{own.path}': '{own.flange}' is not carried by '{own.base}'")
        chain.add(by_child[here].name())
        here = by_child[here].parent_body().index()
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    for joint in [joint for joint in _moving(plant, instance) if joint.name() not in chain]:
        for actuator in actuators:
            if actuator.joint().index() == joint.index():
                plant.RemoveJointActuator(actuator)
        weld = WeldJoint(f"{joint.name()}_fixed", joint.frame_on_parent(), joint.frame_on_child(), RigidTransform())
        plant.RemoveJoint(joint)
        plant.AddJoint(weld)


def _add_spatula(plant: MultibodyPlant, text: str) -> tuple[ModelInstanceIndex, RigidBody, Frame]:
    """The spatula's model, its one body, and its frame "tool"."""
    kind = "sdf" if "<sdf" in text else "urdf"
    try:
        (instance,) = Parser(plant).AddModelsFromString(text, kind)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"the tool's model cannot be read: {error}") from None
    bodies = [plant.get_body(i) for i in plant.GetBodyIndices(instance)]
    if len(bodies) != 1 or not plant.HasFrameNamed("tool", instance):
        raise InputError(f"the tool's model has {len(bodies)} bodies; valid is one body and a frame 'tool'")
    return instance, bodies[0], plant.GetFrameByName("tool", instance)
