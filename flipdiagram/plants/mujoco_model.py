"""The cell as a model of MuJoCo's, made from the numbers of Drake's: arm, block, table, and who touches whom.

Each link of the arm, with all that is welded to it, is one body whose frame lies on its joint, parallel to the world
where all joints are at zero.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant

from flipdiagram.errors import InputError
from flipdiagram.plants.handle import CONTACT_PAIRS
from flipdiagram.plants.mujoco_contact import (
    ContactBox,
    Settings,
    Spring,
    contact_boxes,
    free_body,
    head,
    inertial,
    limit_compliance,
    pairs,
    springs,
)
from flipdiagram.robot.gears import GearHandles
from flipdiagram.robot.model_files import spaced
from flipdiagram.robot.parts import Parts
from flipdiagram.robot.serial_chain import SerialChain, chain_in

WITHOUT_END = 1e6
"""Angle [rad] that stands for a limit at infinity."""


class CellModel(NamedTuple):
    """The text in MJCF, the pose of the spatula's body in the frame of MuJoCo's body "blade", the last link, and the
    springs of those pairs of geometries that have one, see `mujoco_contact.give_way`."""

    mjcf: str
    X_LS: RigidTransform
    springs: dict[str, Spring]


def cell_model(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    parts: Parts,
    joint_names: Sequence[str],
    settings: Settings,
    step: float,
) -> CellModel:
    """The model of a finalized plant with steps of `step` [s].

    Its coordinates are the arm's, by joint_names, where gears give way each with its gear's deflection after it, then
    those of the block.  Sensors, one a pair of `CONTACT_PAIRS`, give the net force [N], moment [N m] and the point [m]
    about which it is taken, in world axes.

    Raises InputError where the arm is no chain of revolute joints or something else than a box collides.
    """
    chain = chain_in(plant, parts.arm, joint_names)
    if chain is None:
        message = "simulation.engine = 'mujoco' moves chains of revolute joints, and this arm is none; valid is drake"
        raise InputError(message, field="simulation.engine", value="mujoco", valid="drake")
    boxes = contact_boxes(plant, scene_graph, parts)
    context = plant.CreateDefaultContext()
    for name in joint_names:
        plant.GetJointByName(name, parts.arm.arm).set_angle(context, 0.0)
    X_LS = RigidTransform(-chain.points[-1]) @ parts.arm.spatula_body.EvalPoseInWorld(context)
    X_WTable = parts.table.EvalPoseInWorld(context)
    limits = np.array([_limits(plant, parts, name) for name in joint_names])
    table = "".join(box.geom(X_WTable) for box in boxes["table"])
    sensors = "".join(
        f'<contact name="{name}" body1="{by}" body2="{on}" num="1" data="force torque pos" reduce="netforce"/>'
        for name, (by, on) in ((name, name.split("-")) for name in CONTACT_PAIRS)
    )
    return CellModel(
        f"""<mujoco>
  {head(settings, step, plant.gravity_field().gravity_vector())}
  <worldbody>
    {_links(chain, limits, parts.gears, boxes["blade"], X_LS)}
    {free_body("block", parts.block, boxes["block"])}
    <body name="table">{table}</body>
  </worldbody>
  <contact>{pairs(boxes, CONTACT_PAIRS, settings)}</contact>
  <sensor>{sensors}</sensor>
</mujoco>""",
        X_LS,
        springs(boxes, CONTACT_PAIRS),
    )


def _limits(plant: MultibodyPlant, parts: Parts, name: str) -> tuple[float, float]:
    joint = plant.GetJointByName(name, parts.arm.arm)
    return joint.position_lower_limit(), joint.position_upper_limit()


def _links(
    chain: SerialChain, limits: np.ndarray, gears: GearHandles | None, blade: Sequence[ContactBox], X_LS: RigidTransform
) -> str:
    """The bodies of the arm, each inside the one before; a gear is a second joint about the axis of the first."""
    n, text = len(chain.mass), ""
    places = np.diff(chain.points, axis=0, prepend=np.zeros((1, 3)))
    for k in reversed(range(n)):
        last = k == n - 1
        low_high = spaced(np.clip(limits[k], -WITHOUT_END, WITHOUT_END))
        range_of = f'range="{low_high}" {limit_compliance()}' if np.isfinite(limits[k]).any() else ""
        gear = "" if gears is None else _gear(chain.axes[k], gears.stiffness[k], gears.damping[k])
        text = f"""<body name="{"blade" if last else f"link{k + 1}"}" pos="{spaced(places[k])}">
      <joint name="joint{k + 1}" axis="{spaced(chain.axes[k])}" armature="{float(chain.rotor[k])!r}"
             damping="{float(chain.damping[k])!r}" {range_of}/>{gear}
      {inertial(chain.mass[k], chain.centres[k] - chain.points[k], chain.inertias[k])}
      {"".join(box.geom(X_LS) for box in blade) if last else text}</body>"""
    return text


def _gear(axis: np.ndarray, stiffness: float, damping: float) -> str:
    spring = f'stiffness="{float(stiffness)!r}" damping="{float(damping)!r}"'
    return f'<joint axis="{spaced(axis)}" {spring}/>'
