"""Elastic gears: rotor and link of each joint as two bodies with a spring and a damper between them.

A harmonic drive gives way under torque.  Joint i turns the rotor, by q_i seen behind the gear's ratio; its link stands
at q_i + delta_i, the deflection, and the gear's torque is -(k_i delta_i + d_i delta_i').  With M_l the inertia of the
links and J_r the reflected inertia of the rotors on a diagonal, their kinetic energy is

    qd^T J_r qd / 2 + (qd + delta')^T M_l (qd + delta') / 2,

so that one gear whose neighbours are locked swings at omega^2 = k (1 / J_r + 1 / M_l), both its sides free.
"""

from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Joint,
    JointActuator,
    ModelInstanceIndex,
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
    UnitInertia,
)

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, rounded_up
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import one_per_joint
from flipdiagram.robot.assembly import ArmHandles
from flipdiagram.scenario.scenario import Scenario

DAMPING_RATIO = 0.05
"""Of a gear whose neighbours are locked, where the scenario names no damping: metal flexsplines lose little (o)."""


class Gears(NamedTuple):
    """Stiffness [N m/rad] and damping [N m s/rad] of the gears (n,), in the order of the arm's joints."""

    stiffness: Floats
    damping: Floats


class GearHandles(NamedTuple):
    """What `add_gears` put into a plant: the model whose positions are the deflections (n,) [rad], and the numbers."""

    model: ModelInstanceIndex
    stiffness: Floats
    damping: Floats


def gears_of(scenario: Scenario, arm: ArmModel) -> Gears:
    """The gears of a scenario whose joints are elastic.

    Raises InputError where nobody gives stiffness or rotor inertia, or the damping is too small for the step.
    """
    given, step = scenario.joints, scenario.simulation.step
    if given.stiffness is not None:
        stiffness = np.array(one_per_joint("joints.stiffness", given.stiffness, arm.joint_names), dtype=float)
    elif arm.handles.gear_stiffness is not None:
        stiffness = np.array([arm.handles.gear_stiffness[name] for name in arm.joint_names])
    else:
        raise _missing("joints.stiffness", f"one per joint, {' '.join(arm.joint_names)}")
    stiffness *= given.stiffness_scale
    rotor = rotor_inertia(arm)
    if not np.all(rotor > 0):
        raise _missing("arm.reflected_inertia", f"one above 0 per joint, {' '.join(arm.joint_names)}")
    links = arm.mass_matrix(arm.home) - np.diag(rotor)
    both_free = np.linalg.inv(np.linalg.inv(links) + np.diag(1 / rotor))
    least = stable_damping(stiffness, least_inertia(both_free), step)
    if given.damping is None:
        two_bodies = 1 / (1 / rotor + 1 / np.diag(links))
        return Gears(stiffness, np.maximum(2 * DAMPING_RATIO * np.sqrt(stiffness * two_bodies), least))
    damping = np.array(one_per_joint("joints.damping", given.damping, arm.joint_names))
    if np.any(damping < least):
        worst = int(np.argmax(least - damping))
        message = (
            f"scenario field 'joints.damping' = {list(given.damping)} makes the gear of joint {arm.joint_names[worst]}"
            f" unstable at this step; valid is at least {rounded_up(least[worst])} N m s/rad there, or null"
        )
        raise InputError(message, field="joints.damping", value=given.damping, valid=least)
    return Gears(stiffness, damping)


def rotor_inertia(arm: ArmModel) -> Floats:
    """Reflected inertia of the arm's rotors (n,) [kg m^2]."""
    actuators = [arm.plant.get_joint_actuator(index) for index in arm.plant.GetJointActuatorIndices()]
    inertia = {actuator.joint().name(): actuator.default_reflected_inertia() for actuator in actuators}
    return np.array([inertia.get(name, 0.0) for name in arm.joint_names])


def least_inertia(M: Floats) -> Floats:
    """The largest J (n,) in the ratios of M's diagonal for which M - diag(J) is positive semidefinite [kg m^2]."""
    diagonal = np.diag(M)
    least: Floats = np.linalg.eigvalsh(M / np.sqrt(np.outer(diagonal, diagonal)))[0] * diagonal
    return least


def stable_damping(stiffness: Floats, inertia: Floats, step: float) -> Floats:
    """Smallest damping [N m s/rad] with which steps of `step` h [s] are stable, with a margin of two.

    The spring acts as it is when the step begins, the damper as it ends: J (w[k+1] - w[k]) = -h (k delta[k] + d w[k+1])
    and delta[k+1] = delta[k] + h w[k+1].  That is stable where h^2 k < 4 J + 2 h d (Jury's criterion at -1), and to
    first order in h damped by d alone.  Here h^2 k <= 2 J + 2 h d: the other half of J is left to the friction of the
    rotor, which acts explicitly too, and to other poses of the arm.

    The inertia J between rotor and link is so small at a wrist that its gear swings faster than the steps can show; it
    is then damped by so much.
    """
    return np.maximum(0.0, (step**2 * stiffness - 2 * inertia) / (2 * step))


def add_gears(plant: MultibodyPlant, arm: ArmHandles, gears: Gears, joint_names: tuple[str, ...]) -> GearHandles:
    """Put elastic gears into an arm in a plant that is not finalized.

    Each joint keeps its name, limits and drive and carries a rotor without mass of its own, the reflected inertia being
    the drive's; from there a joint `<name>_gear` leads to the link.  The arm's state stays that of its joints, now the
    motors' side; the deflections are the state of a model `gears`.

    Raises InputError for a joint that does not turn.
    """
    model = plant.AddModelInstance("gears")
    drives = {drive.joint().name(): drive for drive in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())}
    joints = [
        _add_gear(plant, arm, model, plant.GetJointByName(name, arm.arm), drives[name], float(damping))
        for name, damping in zip(joint_names, gears.damping, strict=True)
    ]
    for joint, stiffness in zip(
        joints, gears.stiffness, strict=True
    ):  # after all joints: Drake removes none with springs
        plant.AddForceElement(RevoluteSpring(joint, 0.0, float(stiffness)))
    return GearHandles(model, *gears)


def _add_gear(
    plant: MultibodyPlant, arm: ArmHandles, model: ModelInstanceIndex, old: Joint, drive: JointActuator, damping: float
) -> RevoluteJoint:
    """Put a rotor and the gear's joint, which is returned, behind a joint and its drive."""
    name = old.name()
    if not isinstance(old, RevoluteJoint):
        message = f"joints.model = 'elastic' bends joints that turn, and {name} does not; valid is rigid"
        raise InputError(message, field="joints.model", value="elastic", valid="rigid")
    parent, child, axis = old.frame_on_parent(), old.frame_on_child(), old.revolute_axis()
    angles = float(old.position_lower_limit()), float(old.position_upper_limit())
    speeds, viscous = (old.velocity_lower_limits(), old.velocity_upper_limits()), float(old.default_damping())
    limit, ratio, rotor_inertia = drive.effort_limit(), drive.default_gear_ratio(), drive.default_rotor_inertia()
    plant.RemoveJointActuator(drive)
    plant.RemoveJoint(old)
    massless = SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0))
    rotor = plant.AddRigidBody(f"{name}_rotor", model, massless)
    # a joint belongs to the model of its child's frame
    turned = plant.AddFrame(FixedOffsetFrame(f"{name}_turned", rotor.body_frame(), RigidTransform(), arm.arm))
    link = plant.AddFrame(FixedOffsetFrame(f"{name}_link", child, RigidTransform(), model))
    joint = plant.AddJoint(RevoluteJoint(name, parent, turned, axis, *angles, viscous))
    joint.set_velocity_limits(*speeds)
    actuator = plant.AddJointActuator(name, joint, limit)
    actuator.set_default_gear_ratio(ratio)
    actuator.set_default_rotor_inertia(rotor_inertia)
    return plant.AddJoint(RevoluteJoint(f"{name}_gear", rotor.body_frame(), link, axis, damping=damping))


def _missing(field: str, valid: str) -> InputError:
    return InputError(f"joints.model = 'elastic' needs {field}; valid is {valid}", field=field, valid=valid)
