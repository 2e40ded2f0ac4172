"""Arm and spatula put into a MultibodyPlant: the one place where the cell and `ArmModel` get them from."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    Joint,
    ModelInstanceIndex,
    RigidBody,
    SpatialInertia,
    WeldJoint,
)

from flipdiagram.errors import InputError, first_line
from flipdiagram.robot.arm_spec import FORMATS, ArmSpec, file_error, one_per_joint
from flipdiagram.robot.link_inertia import with_inertias
from flipdiagram.robot.model_files import arm_urdf, model_path
from flipdiagram.robot.model_xml import JOINT_TYPES, read_model
from flipdiagram.robot.own_files import JointNumbers, chain_between, check_uncoupled, joint_numbers
from flipdiagram.scenario.cell import OWN_ARM, Arm

UNSCALED = {"reflected_inertia_scale": 1.0, "reflected_inertia_scales": None, "speed_scale": 1.0, "torque_scale": 1.0}
# Flange: z out of it, x up. Spatula: x out, z up. So x_S = z_F, y_S = -y_F, z_S = x_F; columns are S in F.
R_FLANGE_SPATULA = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])


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
    gear_stiffness: dict[str, float] | None  # [N m/rad] by joint name; None where the file does not say


def add_arm(plant: MultibodyPlant, spec: ArmSpec) -> ArmHandles:
    """Add arm and spatula to a plant that is not finalized: base welded to the world, spatula to the flange.

    Raises InputError for a file that lacks something.
    """
    arm = spec.arm
    instance, numbers = _add_urdf(plant, arm) if arm.file is None else _add_own(plant, arm, spec.suffix)
    base, flange = (plant.GetFrameByName(name, instance) for name in (arm.base, arm.flange))
    R_FS = RotationMatrix.MakeZRotation(arm.mount_angle) @ RotationMatrix(R_FLANGE_SPATULA)
    x, y, z, yaw = arm.base_pose
    X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, z]) if any(arm.base_pose) else RigidTransform()
    plant.WeldFrames(plant.world_frame(), base, X_WB)

    text = spec.spatula or model_path("spatula.urdf").read_text(encoding="utf-8")
    body, tool = add_tool(plant, text)
    tool_model = body.model_instance()
    plant.WeldFrames(flange, body.body_frame(), RigidTransform(R_FS, np.zeros(3)))
    X_TC = RigidTransform([0.0, 0.0, spec.tool_height])
    return ArmHandles(
        arm=instance,
        spatula=tool_model,
        spatula_body=body,
        tool=tool,
        control_point=plant.AddFrame(FixedOffsetFrame("control_point", tool, X_TC, tool_model)),
        flange=flange,
        rated_torques=numbers.rated_torque,
        home=numbers.home,
        gear_stiffness=numbers.gear_stiffness,
    )


def add_tool(plant: MultibodyPlant, text: str, what: str = "the tool's model") -> tuple[RigidBody, Frame]:
    """The body of a tool, from its URDF or SDF, and its frame "tool"; an InputError begins with `what`."""
    kind = "sdf" if text.startswith("<sdf") else "urdf"
    body = add_body(plant, what, lambda parser: parser.AddModelsFromString(text, kind))
    if not plant.HasFrameNamed("tool", body.model_instance()):
        raise InputError(f"{what} lacks a frame; valid is one body and a frame 'tool'", field="tool.file")
    return body, plant.GetFrameByName("tool", body.model_instance())


def _add_urdf(plant: MultibodyPlant, arm: Arm) -> tuple[ModelInstanceIndex, JointNumbers]:
    """The arm from its scaled URDF, and what that says of the moving joints."""
    text = arm_urdf(arm)
    with drake_reads(f"arm.file = '{arm.file}'"):
        (instance,) = Parser(plant).AddModelsFromString(text, "urdf")
    return instance, joint_numbers(text, [joint.name() for joint in _moving(plant, instance)])


def _add_own(plant: MultibodyPlant, arm: Arm, suffix: str) -> tuple[ModelInstanceIndex, JointNumbers]:
    """An arm of the user's own: its file, then what the scenario says instead of the file."""
    if suffix == ".urdf":
        instance, numbers = _add_urdf(plant, arm)
        arm = arm.model_copy(update=UNSCALED)  # the scales are in the text
    else:
        model = read_model("arm.file", str(arm.file), (FORMATS[suffix],))
        if arm.link_inertia_scale != 1.0 or arm.link_inertia_scales is not None:
            text = with_inertias(arm, model, _scaled_inertias(arm))
            with drake_reads(f"arm.file = '{arm.file}' with scaled links"):
                (instance,) = Parser(plant).AddModelsFromString(text, suffix.removeprefix("."))
        else:
            with drake_reads(f"arm.file = '{arm.file}'"):
                (instance,) = Parser(plant).AddModels(arm.file)
        check_uncoupled(arm, model.root, _keep_the_chain(plant, instance, arm))
        numbers = JointNumbers({}, {}, None)
    joints = _moving(plant, instance)
    names = [joint.name() for joint in joints]
    for field in OWN_ARM:
        one_per_joint(f"arm.{field}", getattr(arm, field), names)
    peak = _actuate(plant, arm, joints, numbers.peak_torque)
    for joint, limit in zip(joints, arm.speed_limits or (), strict=False):
        joint.set_velocity_limits([-limit], [limit])
    rated = {} if arm.torque_limits else {name: t for name, t in numbers.rated_torque.items() if np.isfinite(t)}
    home = numbers.home if arm.home is None else dict(zip(names, arm.home, strict=True))
    rated = {name: rated.get(name, peak[name]) for name in names}
    return instance, JointNumbers(rated, peak, home, numbers.gear_stiffness)


def _scaled_inertias(arm: Arm) -> dict[str, SpatialInertia]:
    """The inertias of the links of an arm's SDF or MJCF that have a mass, by name, times the scenario's factors."""
    plant = MultibodyPlant(0.0)
    with drake_reads(f"arm.file = '{arm.file}'"):
        (instance,) = Parser(plant).AddModels(arm.file)
    _keep_the_chain(plant, instance, arm)
    joints = _moving(plant, instance)
    names = [joint.name() for joint in joints]
    factors = one_per_joint("arm.link_inertia_scales", arm.link_inertia_scales, names)
    of_link = {joint.child_body().name(): factor for joint, factor in zip(joints, factors, strict=True)}
    inertias = {}
    for body in (plant.get_body(index) for index in plant.GetBodyIndices(instance)):
        if (mass := body.default_mass()) > 0:
            M, scale = body.default_spatial_inertia(), arm.link_inertia_scale * of_link.get(body.name(), 1.0)
            inertias[body.name()] = SpatialInertia(mass * scale, M.get_com(), M.get_unit_inertia())
    return inertias


def _moving(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[Joint]:
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(instance)]
    return [joint for joint in joints if joint.num_velocities() > 0]


def _actuate(
    plant: MultibodyPlant, arm: Arm, joints: Sequence[Joint], peak_in_text: Mapping[str, float]
) -> dict[str, float]:
    """One actuator a joint, in the order of the joints, which the plant's input then has too; returns their limits
    [N m] by joint name.
    """
    of_file = {}
    for actuator in [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]:
        gear = actuator.default_gear_ratio(), actuator.default_rotor_inertia()
        of_file[actuator.joint().name()] = actuator.effort_limit(), *gear
        plant.RemoveJointActuator(actuator)
    names, limits = [joint.name() for joint in joints], {}
    scales = one_per_joint("arm.reflected_inertia_scales", arm.reflected_inertia_scales, names)
    for k, (joint, name) in enumerate(zip(joints, names, strict=True)):
        peak, ratio, rotor = of_file.get(name, (peak_in_text.get(name, 0.0), 1.0, 0.0))
        rotor *= arm.reflected_inertia_scale * scales[k]
        if arm.reflected_inertia:
            ratio, rotor = 1.0, arm.reflected_inertia[k]
        limit = (arm.torque_limits[k] if arm.torque_limits else peak) * arm.torque_scale
        if not (np.isfinite(limit) and limit > 0):
            valid = f"one per joint in the file or in arm.torque_limits, {' '.join(names)}"
            raise file_error(arm, f"lacks a limit: joint '{name}' has no torque limit", valid)
        limits[name] = float(limit)
        actuator = plant.AddJointActuator(name, joint, limits[name])
        actuator.set_default_gear_ratio(ratio)
        actuator.set_default_rotor_inertia(rotor)
        if arm.speed_scale != 1.0:
            low, high = joint.velocity_lower_limits(), joint.velocity_upper_limits()
            joint.set_velocity_limits(arm.speed_scale * low, arm.speed_scale * high)
    return limits


def _keep_the_chain(plant: MultibodyPlant, instance: ModelInstanceIndex, arm: Arm) -> list[str]:
    """Leave the joints between base and flange, whose names it returns: weld others that move, and remove constraints
    and what carries the base itself.
    """
    for name in (arm.base, arm.flange):
        if not plant.HasFrameNamed(name, instance):
            raise file_error(arm, f"has no link or frame '{name}'", "an arm with both")
    joints = {joint.name(): joint for joint in (plant.get_joint(i) for i in plant.GetJointIndices(instance))}
    ends = {name: (joint.parent_body().index(), joint.child_body().index()) for name, joint in joints.items()}
    base, flange = (plant.GetFrameByName(name, instance).body().index() for name in (arm.base, arm.flange))
    chain = chain_between(arm, ends, base, flange)
    for name in chain:
        if joints[name].num_velocities() > 1 or joints[name].type_name() == "screw":
            kind = joints[name].type_name()
            raise file_error(arm, f"has a joint '{name}' of type '{kind}' in its chain", ", ".join(JOINT_TYPES))
    for index in plant.GetConstraintIds():
        plant.RemoveConstraint(index)
    for actuator in [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]:
        if actuator.joint().name() not in chain:
            plant.RemoveJointActuator(actuator)
    for name, (parent, child) in ends.items():
        if child == base:  # such as a joint that fixes the base to the world: its place is the scenario's
            if parent != plant.world_body().index():
                carrier = plant.get_body(parent).name()
                raise file_error(arm, f"has its base '{arm.base}' on '{carrier}'", "a base that nothing carries")
            plant.RemoveJoint(joints[name])
    for joint in [joint for joint in _moving(plant, instance) if joint.name() not in chain]:
        weld = WeldJoint(f"{joint.name()}_fixed", joint.frame_on_parent(), joint.frame_on_child(), RigidTransform())
        plant.RemoveJoint(joint)
        plant.AddJoint(weld)
    return chain


@contextmanager
def drake_reads(what: str) -> Iterator[None]:
    """InputError, one line that begins with `what`, where Drake refuses a model; its warnings, which the check of the
    file has answered, are not shown.
    """
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    except (RuntimeError, ValueError, IndexError, SystemExit) as error:  # SystemExit: an assertion of Drake's failed
        raise InputError(f"{what} cannot be read: {first_line(error)}") from None
    finally:
        log.setLevel(level)


def add_body(plant: MultibodyPlant, what: str, add: Callable[[Parser], list[ModelInstanceIndex]]) -> RigidBody:
    """The one body of a model; InputError that begins with `what` where it cannot be read or has another number."""
    with drake_reads(what):
        (instance,) = add(Parser(plant))
    bodies = [plant.get_body(i) for i in plant.GetBodyIndices(instance)]
    if len(bodies) != 1:
        raise InputError(f"{what} has {len(bodies)} bodies; valid is one")
    return bodies[0]
