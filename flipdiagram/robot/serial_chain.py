"""An arm's chain of revolute joints as arrays, read from a plant: for loops and engines that do without Drake's."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.tree import BodyIndex, RevoluteJoint

from flipdiagram.arrays import Floats
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.assembly import ArmHandles


class SerialChain(NamedTuple):
    """Joints and links at q = 0, in the order of the arm's joints, all in the base frame [m, kg, rad].

    Joint i turns about `axes[i]` through `points[i]`; what it carries as far as the next joint has the mass `mass[i]`
    at `centres[i]`, with `inertias[i]` (3, 3) about it.  C is at `tip`, rotation `tip_turn` (3, 3).
    """

    axes: Floats
    points: Floats
    mass: Floats
    centres: Floats
    inertias: Floats
    rotor: Floats
    """Reflected inertia of each joint [kg m²]."""
    damping: Floats
    """Viscous friction of each joint that the plant has itself [N m s]."""
    tip: Floats
    tip_turn: Floats
    gravity: float
    """g_z [m/s²]."""


class Links(NamedTuple):
    """Where joints and links are at K samples: axes and points on them (K, n, 3), mass centres (K, n, 3), inertias
    (K, n, 3, 3); end (K, 4, 3): rotation of the control point in rows 0-2, its position in row 3; scratch (10, 3)."""

    axes: Floats
    points: Floats
    centres: Floats
    inertias: Floats
    end: Floats
    scratch: Floats


class Along(NamedTuple):
    """A chain that moves along K samples: P = Jᵀ (J Jᵀ)⁻¹ (K, n, 6), q̇ = P v (K, n), J' q̇ (K, 6).

    regular: no pose is singular; else the numbers mean nothing.
    """

    links: Links
    from_task: Floats
    qd: Floats
    bias: Floats
    regular: bool


def serial_chain(arm: ArmModel) -> SerialChain | None:
    """The chain of an arm under vertical gravity; None where it is none, see `chain_in`, or gravity is tilted."""
    if np.any(np.asarray(arm.plant.gravity_field().gravity_vector())[:2]):
        return None
    return chain_in(arm.plant, arm.handles, arm.joint_names, arm.own_context())


def chain_in(
    plant: Any, handles: ArmHandles, joint_names: Sequence[str], context: Any | None = None
) -> SerialChain | None:
    """The chain in a finalized plant, with all that is welded to it; None where there are branches, joints that slide
    or joints out of order.  context: where things are welded, which may be changed here; None: by default.
    """
    joints = [plant.GetJointByName(name, handles.arm) for name in joint_names]
    if not all(isinstance(joint, RevoluteJoint) for joint in joints):
        return None
    carried = [{int(i) for i in plant.GetBodiesKinematicallyAffectedBy([joint.index()])} for joint in joints]
    last = int(handles.control_point.body().index())
    nested = all(after < before for before, after in zip(carried, carried[1:], strict=False))
    if not nested or last not in carried[-1]:
        return None
    context = plant.CreateDefaultContext() if context is None else context
    for joint in joints:
        joint.set_angle(context, 0.0)
    frames = [joint.frame_on_parent().CalcPoseInWorld(context) for joint in joints]
    links = [bodies - rest for bodies, rest in zip(carried, [*carried[1:], set()], strict=True)]
    lumps = [_lump(plant, context, link) for link in links]
    actuators = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    rotor = {actuator.joint().name(): actuator.default_reflected_inertia() for actuator in actuators}
    X_WC = plant.get_frame(handles.control_point.index()).CalcPoseInWorld(context)
    return SerialChain(
        axes=_rows(X.rotation().matrix() @ joint.revolute_axis() for X, joint in zip(frames, joints, strict=True)),
        points=_rows(X.translation() for X in frames),
        mass=np.array([mass for mass, _, _ in lumps]),
        centres=_rows(centre for _, centre, _ in lumps),
        inertias=_rows(inertia for _, _, inertia in lumps),
        rotor=np.array([rotor.get(name, 0.0) for name in joint_names]),
        damping=np.array([float(joint.default_damping()) for joint in joints]),
        tip=np.array(X_WC.translation(), dtype=float),
        tip_turn=np.ascontiguousarray(X_WC.rotation().matrix(), dtype=float),
        gravity=float(plant.gravity_field().gravity_vector()[2]),
    )


def _rows(arrays: Any) -> Floats:
    return np.ascontiguousarray(np.stack([np.asarray(array, dtype=float) for array in arrays]))


def _lump(plant: Any, context: Any, bodies: set[int]) -> tuple[float, Floats, Floats]:
    """Mass, centre and inertia about it of bodies that move as one."""
    mass, moment, about_origin = 0.0, np.zeros(3), np.zeros((3, 3))
    for body in (plant.get_body(BodyIndex(index)) for index in sorted(bodies)):
        X = body.EvalPoseInWorld(context)
        M = body.CalcSpatialInertiaInBodyFrame(context).ReExpress(X.rotation()).Shift(-X.translation())
        mass += M.get_mass()
        moment += M.CalcComMoment()
        about_origin += M.CalcRotationalInertia().CopyToFullMatrix3()
    centre = moment / mass if mass > 0 else moment
    return mass, centre, about_origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
