"""What every use of MuJoCo shares: its import, the contact settings, and the boxes that collide in Drake as MJCF.

MuJoCo is an optional extra, imported when it is used.
"""

import importlib
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, first_line
from flipdiagram.robot.model_files import spaced
from flipdiagram.robot.parts import Parts


class Settings(NamedTuple):
    """How MuJoCo solves the contact; the values approach rigid Coulomb friction.

    What has one value only stands in `head`: the integrator is "Euler" ("implicitfast" differs by rounding where
    nothing has damping, which the last moments before the release, on an edge of the block, amplify to 0.02 rad at
    touch-down); the elliptic cone is Coulomb's; no noslip iterations, which cost sliding friction half a percent;
    damping ratio 1, no rebound, as Drake's dissipation of 20 s/m leaves next to none; condim 3, as the corners of a
    face resist spinning by themselves.

    timestep: longest step [s]; a whole number of steps fills the period.
    time_constant: decay [s] of a penetration (solref); at least twice the step, or contact is no longer stable.
    impratio: stiffness of friction over that of the normal direction; above 1 friction creeps less.
    impedance: share of the contact force that is a constraint, 0 to 1 (solimp, constant); the rest is compliance.
    """

    timestep: float
    time_constant: float
    impratio: float = 100.0
    impedance: float = 0.99

    def settings_text(self) -> str:
        """Engine and contact settings in one line, for a report; InputError where MuJoCo is missing."""
        solver = f"Euler, elliptic cone, impratio {self.impratio:g}, 0 noslip iterations"
        contact = f"solref {self.time_constant * 1e3:g} ms / 1, solimp {self.impedance:g}, condim 3"
        return f"MuJoCo {import_mujoco().__version__}, step {self.timestep * 1e3:g} ms, {solver}, {contact}"


CELL = Settings(timestep=5e-5, time_constant=5e-4)
"""From flips by pd+ff+dob with an elliptic cone and impratio 100; τ is the time constant, h MuJoCo's step, slip in mm
until 0.47 s, while the face lies on the blade, and until the last edge leaves it, lift-off in µm, touch-down in rad:

| τ [ms] | h [ms] | slip, face | slip, all | lift-off | touch-down | CPU [s] |
|---|---|---|---|---|---|---|
| 2 | 0.25, 0.05, 0.01 | 0.84, 0.94, 0.96 | 0.86, 0.95, 0.97 | 4, 1, 0 | 2.723, 2.720, 2.710 | 1.8, 2.0, 4.7 |
| 1 | 0.25, 0.05, 0.01 | 0.38, 0.46, 0.48 | 0.39, 0.48, 0.51 | 3, 1, 0 | 2.712, 2.719, 2.710 | 1.4, 1.9, 5.6 |
| 0.5 | 0.25, 0.05, 0.01 | 0.14, 0.22, 0.24 | 0.21, 0.24, 0.26 | 23, 2, 0 | 2.698, 2.718, 2.709 | 1.6, 2.2, 4.5 |
| 0.2 | 0.1, 0.05, 0.025 | 0.08, 0.10, 0.10 | 0.58, 0.40, 0.17 | 143, 34, 3 | 2.707, 2.706, 2.710 | 1.3, 1.9, 2.5 |
| Drake | 1, 0.5 | 0.48, 0.24 | 0.51, 0.29 | 86, 51 | 2.739, 2.737 | 3.9, 4.9 |

All turn over.  The block creeps in proportion to τ, in Drake to the step: neither engine counts how the Jacobian J of
the contact changes, so the face moves at τ/2, or half a step, times J' q'; on a rigid blade it would hardly slip.
Eight steps to a time constant keep the face quiet; where it hops, the last edge makes it more.  Cone and impratio
change little (τ = 0.5, h = 0.125: pyramidal / 1 slips 0.20 mm, elliptic / 1, 10, 100 slip 0.19 mm until 0.47 s).

At τ = 0.5 the last edge needs the short step, the face on the blade and then on the table does not: steps of two or
three h while at least four points touch, one h else, beside one length throughout (CPU of a whole flip):

| h [ms], flat | h [ms], else | slip, face | slip, all | touch-down | CPU [s] |
|---|---|---|---|---|---|
| 0.01 | 0.01 | 0.24 | 0.26 | 2.709 | 2.8 |
| 0.05 | 0.05 | 0.22 | 0.24 | 2.718 | 1.0 |
| 0.1 | 0.05 | 0.21 | 0.25 | 2.714 | 0.8 |
| 0.15 | 0.05 | 0.20 | 0.22 | 2.721 | 0.7 |
| 0.1 | 0.1 | 0.21 | 0.44 | 2.706 | 0.65 |
| 0.125 | 0.0625 | 0.21 | 0.33 | 2.703 | 0.6 |

Of 20 flips (four architectures; payload, start, friction of block and joints varied) 0.1 / 0.05 gives the verdicts of
0.05 / 0.05, touch-down within 0.05 rad where the block turns over and the release within 6 ms.
"""


class ContactBox(NamedTuple):
    """A box that collides: edges `size` (3,) [m], its pose in the frame of its body, and its own friction."""

    name: str
    X_BG: RigidTransform
    size: Floats
    friction: CoulombFriction

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
        raise InputError("the second engine needs MuJoCo: pip install 'flipdiagram[mujoco]'") from None


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
            found[name].append(ContactBox(label, X_BG, np.array(shape.size()), friction))
    return found


def head(settings: Settings, step: float, gravity: Sequence[float]) -> str:
    """The elements before the bodies: step [s], gravity (3,) [m/s²], and that nothing touches but the pairs named."""
    return f"""<compiler angle="radian"/>
  <option timestep="{step!r}" gravity="{spaced(gravity)}" integrator="Euler" cone="elliptic"
          impratio="{float(settings.impratio)!r}" solver="Newton"
          iterations="100" tolerance="1e-12"><flag autoreset="disable"/></option>
  <default><geom type="box" contype="0" conaffinity="0"/></default>"""


def compliance(settings: Settings, of: str = "") -> str:
    """The attributes that say how stiff a contact pair is, or a joint's limit (of: "limit")."""
    impedance = spaced((settings.impedance, settings.impedance, 1e-3, 0.5, 2.0))
    return f'solref{of}="{spaced((settings.time_constant, 1.0))}" solimp{of}="{impedance}"'


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
                f'<pair geom1="{one.name}" geom2="{other.name}" friction="{friction!r} {friction!r}" condim="3"'
                f" {compliance(settings)}/>"
            )
    return "".join(elements)


def compiled(mujoco: Any, xml: str) -> Any:
    """MuJoCo's model of a text; InputError, in one line, for what it refuses."""
    try:
        return mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        message = f"simulation.engine = 'mujoco' cannot move this cell: {first_line(error)}; valid is drake"
        raise InputError(message, field="simulation.engine", value="mujoco", valid="drake") from None
