"""What every use of MuJoCo shares: its import, the contact settings, and the boxes that collide in Drake as MJCF.

MuJoCo is an optional extra, imported when it is used.
"""

import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Box, ProximityProperties, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, first_line
from flipdiagram.robot.model_files import spaced
from flipdiagram.robot.parts import Parts
from flipdiagram.theory.impact import damping_ratio, restitution


class Settings(NamedTuple):
    """How MuJoCo solves the contact; the values approach rigid Coulomb friction.

    timestep: longest step [s]; a whole number of steps fills the period.
    stiffness: of a penetration [1/s²], with critical damping (solref).
    friction_damping: of a slip that shall not be [1/s] (solreffriction).
    impratio: stiffness of friction over that of the normal direction; above 1 friction creeps less.
    impedance: share of the contact force that is a constraint, 0 to 1 (solimp, constant); the rest is compliance.
    """

    timestep: float
    stiffness: float
    friction_damping: float
    impratio: float = 1000.0
    impedance: float = 0.02

    def settings_text(self) -> str:
        """Engine and contact settings in one line, for a report; InputError where MuJoCo is missing."""
        solver = f"Euler, elliptic cone, impratio {self.impratio:g}, 0 noslip iterations"
        contact = f"solref {' '.join(f'{number:g}' for number in self.solref)}, solimp {self.impedance:g}"
        friction = f"solreffriction -1 {-self.friction_damping:g}, condim 3"
        return f"MuJoCo {import_mujoco().__version__}, step {self.timestep * 1e3:g} ms, {solver}, {contact}, {friction}"

    @property
    def solref(self) -> tuple[float, float]:
        """Stiffness [1/s²] and critical damping [1/s], negative: as MuJoCo tells them from a time constant."""
        return -self.stiffness, -2.0 * math.sqrt(self.stiffness)


CELL = Settings(timestep=1e-4, stiffness=3e5, friction_damping=40.0)
"""Soft enough to slide quietly.  MuJoCo solves friction and normal force together: a contact that slides at v_t is
driven apart like one that closes at μ v_t, here with friction_damping / impedance times μ v_t, and what opens ceases to
act.  Where that is more than the share of the weight that compliance bears, (1 − impedance) / impedance of it, the face
hops and slides too far: impedance 0.99 with a time constant of 0.5 ms hopped from 2 mm/s on.  In eight worlds of PD +
DOB with friction 1.35 to 1.54, a block that slides on the recorded blade by Coulomb's law until θ = 1.2 rad goes 0.2 to
10 mm; those settings gave 6 to 11 mm more, Drake up to 2 mm less.

From flips of the default of the first versions by pd+ff+dob and of one such world, friction 1.449: slip of the first in
mm until the last edge leaves it, touch-down in rad; of the second slip until θ = 1.2 rad, by Coulomb's law 4.7:

| step [ms] | stiffness | friction damping | impedance | slip | touch-down | second: slip |
|---|---|---|---|---|---|---|
| 0.1, 0.05, 0.025, 0.01 | 1e6 | 40 | 0.02 | 0.47, 0.47, 0.50, 0.49 | 2.718, 2.710, 2.708, 2.709 | 6.9, 6.7, 6.7, 6.7 |
| 0.1, 0.05 | 3e5 | 40 | 0.02 | 0.45, 0.45 | 2.713, 2.713 | 6.6, 6.6 |
| 0.1 | 1e5 | 20 | 0.02 | 0.93 | 2.715 | 6.3 |
| 0.05 | 1e6 | 20, 80 | 0.02 | 0.95, 0.23 | 2.708, 2.709 | 6.6, 6.8 |
| 0.05 | 1e6 | 80 | 0.05 | 0.60 | 2.717 | 7.5 |
| Drake: 1 | | | | 0.48 | 2.739 | 5.0 |

A block on a blade that turns creeps by J' q' over friction_damping / impedance, as MuJoCo does not count how the
Jacobian J of the contact changes; in Drake by half a step times J' q'.  The integrator is "Euler"; the elliptic cone is
Coulomb's; noslip iterations cost sliding friction half a percent; condim 3, as the corners of a face resist spinning by
themselves.
"""
LIMIT = 5e-4
"""Time constant [s] of the joints' limits."""


BLOW = 0.5
"""Speed [m/s] with which an edge of the blade strikes the table; at it both engines take as much from a blow."""


class Spring(NamedTuple):
    """How what collides gives way: stiffness [N/m], dissipation of Hunt and Crossley's [s/m]."""

    stiffness: float
    dissipation: float


class ContactBox(NamedTuple):
    """A box that collides: edges `size` (3,) [m], its pose in the frame of its body, its own friction and spring.

    The spring is None where the model files name none.
    """

    name: str
    X_BG: RigidTransform
    size: Floats
    friction: CoulombFriction
    spring: Spring | None

    def geom(self, X_MB: RigidTransform) -> str:
        """The element of a body of MuJoCo's in which Drake's body has the pose X_MB."""
        X = X_MB @ self.X_BG
        pose = f'pos="{spaced(X.translation())}" quat="{spaced(X.rotation().ToQuaternion().wxyz())}"'
        return f'<geom name="{self.name}" size="{spaced(self.size / 2)}" {pose}/>'


def import_mujoco() -> Any:
    """The module; InputError that names the extra where it is missing."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        valid = "pip install 'flipdiagram[mujoco]'"
        message = f"the second engine needs MuJoCo: {valid}"
        raise InputError(message, field="simulation.engine", valid=valid) from None


def contact_boxes(plant: MultibodyPlant, scene_graph: SceneGraph, parts: Parts) -> dict[str, list[ContactBox]]:
    """What collides in Drake, by body: blade, block, table; InputError for another shape than a box."""
    inspector = scene_graph.model_inspector()
    bodies = {"blade": parts.arm.spatula_body, "block": parts.block, "table": parts.table}
    found: dict[str, list[ContactBox]] = {name: [] for name in bodies}
    for name, body in bodies.items():
        for k, geometry in enumerate(plant.GetCollisionGeometriesForBody(body)):
            shape, properties = inspector.GetShape(geometry), inspector.GetProximityProperties(geometry)
            if not isinstance(shape, Box):
                problem = f"collides as {type(shape).__name__} of the {name}; valid is Box"
                raise InputError(f"simulation.engine = 'mujoco' has no shape for what {problem}", valid="Box")
            friction = properties.GetProperty("material", "coulomb_friction")
            X_BG, label = inspector.GetPoseInFrame(geometry), f"{name}{k or ''}"
            found[name].append(ContactBox(label, X_BG, np.array(shape.size()), friction, _spring(properties)))
    return found


def _spring(properties: ProximityProperties) -> Spring | None:
    if not properties.HasProperty("material", "point_contact_stiffness"):
        return None
    dissipation = properties.GetPropertyOrDefault("material", "hunt_crossley_dissipation", 0.0)
    return Spring(properties.GetProperty("material", "point_contact_stiffness"), dissipation)


def head(settings: Settings, step: float, gravity: Sequence[float]) -> str:
    """The elements before the bodies: step [s], gravity (3,) [m/s²], and that nothing touches but the pairs named."""
    return f"""<compiler angle="radian"/>
  <option timestep="{step!r}" gravity="{spaced(gravity)}" integrator="Euler" cone="elliptic"
          impratio="{float(settings.impratio)!r}" solver="Newton"
          iterations="100" tolerance="1e-12"><flag autoreset="disable"/></option>
  <default><geom type="box" contype="0" conaffinity="0"/></default>"""


def compliance(settings: Settings) -> str:
    """The attributes that say how stiff a contact pair is."""
    impedance = spaced((settings.impedance, settings.impedance, 1e-3, 0.5, 2.0))
    friction = f'solreffriction="-1 {-settings.friction_damping!r}"'
    return f'solref="{spaced(settings.solref)}" {friction} solimp="{impedance}"'


def limit_compliance() -> str:
    """The same of a joint's limit, which may be stiff: nothing slides there."""
    return f'solreflimit="{spaced((LIMIT, 1.0))}" solimplimit="{spaced((0.99, 0.99, 1e-3, 0.5, 2.0))}"'


def inertial(mass: float, centre: Floats, inertia: Floats) -> str:
    """The element of mass [kg], its centre (3,) [m] and the inertia about that (3, 3) [kg m²] in a body's frame."""
    products = inertia[0, 1], inertia[0, 2], inertia[1, 2]
    moments = spaced(np.diag(inertia))
    # MuJoCo looks for the principal axes of a full one, and sorts them
    about = f'fullinertia="{moments} {spaced(products)}"' if any(products) else f'diaginertia="{moments}"'
    return f'<inertial pos="{spaced(centre)}" mass="{float(mass)!r}" {about}/>'


def free_body(name: str, body: RigidBody, boxes: Iterable[ContactBox]) -> str:
    """The element of a body that flies, its frame that of Drake's body."""
    centre, about = body.default_com(), body.default_spatial_inertia().Shift(body.default_com())
    inertia = inertial(body.default_mass(), centre, about.CalcRotationalInertia().CopyToFullMatrix3())
    geoms = "".join(box.geom(RigidTransform()) for box in boxes)
    return f'<body name="{name}"><freejoint/>{inertia}{geoms}</body>'


def pairs(boxes: Mapping[str, Sequence[ContactBox]], names: Iterable[str], settings: Settings) -> str:
    """The elements of the pairs of bodies that touch, named "blade-block"; the friction is what Drake combines."""
    elements = []
    for name in names:
        by, on = name.split("-")
        for one, other in product(boxes[by], boxes[on]):
            friction = CalcContactFrictionFromSurfaceProperties(one.friction, other.friction).dynamic_friction()
            elements.append(
                f'<pair name="{one.name}-{other.name}" geom1="{one.name}" geom2="{other.name}" condim="3"'
                f' friction="{friction!r} {friction!r}"'
                f" {compliance(settings)}/>"
            )
    return "".join(elements)


def springs(boxes: Mapping[str, Sequence[ContactBox]], names: Iterable[str]) -> dict[str, Spring]:
    """By the name of its element, the two springs in a row of each pair of boxes that both have one, as in Drake."""
    found = {}
    for name in names:
        by, on = name.split("-")
        for one, other in product(boxes[by], boxes[on]):
            if one.spring is not None and other.spring is not None:
                (k, d), (of_other, d_of_other) = one.spring, other.spring
                total = k + of_other
                both = Spring(k * of_other / total, (of_other * d + k * d_of_other) / total)
                found[f"{one.name}-{other.name}"] = both
    return found


def give_way(model: Any, springs: Mapping[str, Spring]) -> None:
    """Set the stiffness of pairs of a compiled model, by their names, in the place of what `compliance` says.

    MuJoCo's is one of acceleration: that of the spring times its own estimate of the inverse mass.
    """
    for name, spring in springs.items():
        pair = model.pair(name)
        bodies = model.geom_bodyid[[int(pair.geom1[0]), int(pair.geom2[0])]]
        square = spring.stiffness * float(model.body_invweight0[bodies, 0].sum())
        zeta = damping_ratio(restitution(spring.dissipation, BLOW))
        pair.solref[:] = -square, -2.0 * zeta * math.sqrt(square)


def compiled(mujoco: Any, xml: str) -> Any:
    """MuJoCo's model of a text; InputError, in one line, for what it refuses."""
    try:
        return mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        message = f"simulation.engine = 'mujoco' cannot move this cell: {first_line(error)}; valid is drake"
        raise InputError(message, field="simulation.engine", value="mujoco", valid="drake") from None
