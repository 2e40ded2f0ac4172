"""The sections of a scenario that describe things: arm, joint friction, tool, object, table, unknown disturbances.

The sources of the defaults are marked as in `scenario.py`: (p) the paper; (H) (M) (L) confidence in published data;
(o) our own choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from flipdiagram.scenario.pancake import PANCAKE
from flipdiagram.scenario.text import Section, invalid, quantity

OWN_ARM = ("home", "torque_limits", "speed_limits", "reflected_inertia", "gear_ratios")
"""Fields of `Arm` with one number per joint of the user's own arm."""
JOINTS = ("S", "L", "U", "R", "B", "T")
Angle = Annotated[float, Field(ge=-10, le=10)]
Factor = Annotated[float, Field(ge=0.01, le=100)]
Force = Annotated[float, Field(ge=-1000, le=1000)]
Inertia = Annotated[float, Field(ge=1e-7, le=1e4)]
Position = Annotated[float, Field(ge=-10, le=10)]
MOST_VERTICES = 1500
"""Of a pancake's mesh; on the blade a step takes 35 ms with 196, longer with the square of their number."""


class Arm(Section):
    """The robot: Motoman MH3F, geometry and limits from urdf/mh3f.urdf, or one of the user's own."""

    file: str | None = Field(None, description="URDF, SDF or MJCF (.xml) of another arm; null: the MH3F")
    base: str = Field("base", description="link or frame of that file that stands on the ground")
    flange: str = Field("flange", description="link or frame that carries the spatula, its z axis pointing out")
    base_pose: tuple[Position, Position, Position, Angle] = quantity(
        (0.0, 0.0, 0.0, 0.0), "m, m, m, rad", "x, y, z and yaw of the arm's base"
    )
    mount_angle: float = quantity(
        0.0, "rad", "turn of the spatula about the flange's z axis; another arm only", ge=-7, le=7
    )
    home: tuple[Angle, ...] | None = quantity(
        None, "rad", "joint angles near the start pose; null: the file's, or searched; another arm only", min_length=1
    )
    torque_limits: tuple[Annotated[float, Field(ge=0.001, le=1e5)], ...] | None = quantity(
        None, "N m", "peak torque of each joint; null: the file's; another arm only", min_length=1
    )
    speed_limits: tuple[Annotated[float, Field(ge=0.001, le=1000)], ...] | None = quantity(
        None, "rad/s", "largest speed of each joint; null: the file's; another arm only", min_length=1
    )
    reflected_inertia: tuple[Inertia, ...] | None = quantity(
        None,
        "kg m2",
        "rotor and gear of each joint, seen at the joint; null: the file's; another arm only",
        min_length=1,
    )
    gear_ratios: tuple[Annotated[float, Field(ge=0.01, le=1e5)], ...] | None = quantity(
        None, "1", "turns of each motor per turn of its joint; null: the file's; another arm only", min_length=1
    )
    link_inertia_scale: float = quantity(
        1.0, "1", "factor on every link's mass and inertia, which are our estimates (c: 0.6 to 1.9)", ge=0.01, le=100
    )
    reflected_inertia_scale: float = quantity(
        3.0,
        "1",
        "factor on the reflected rotor inertias; harmonic drives come on top of the rotors (L) (c: 1.6 to 4.0)",
        ge=0,
        le=100,
    )
    link_inertia_scales: tuple[Factor, ...] | None = quantity(
        None, "1", "a further factor on mass and inertia of each moving link, one per joint; null: 1 each", min_length=1
    )
    reflected_inertia_scales: tuple[Factor, ...] | None = quantity(
        None, "1", "a further factor on each reflected rotor inertia, one per joint; null: 1 each", min_length=1
    )
    speed_scale: float = quantity(1.0, "1", "factor on the joint speed limits", ge=0.001, le=1000)
    torque_scale: float = quantity(1.0, "1", "factor on the joint torque limits (peak = 3 x rated)", ge=0.001, le=10000)

    @model_validator(mode="after")
    def _of_another_arm(self) -> Arm:
        if self.file is None:
            for name in ("base", "flange", "mount_angle", *OWN_ARM):
                if getattr(self, name) != type(self).model_fields[name].default:
                    raise invalid(name, getattr(self, name), "the default unless arm.file names another arm")
        return self


class JointFriction(Section):
    """Friction of the joints, unknown to the controller; levels as fractions of each joint's rated torque.

    Harmonic drives of this size lose 5-20 % of the rated torque to Coulomb friction; 10 % is the middle (o).  That they
    break away above it, and bend before, is known (L); how much is our guess.
    """

    model: Literal["tanh", "elasto-plastic"] = Field(
        "tanh",
        description="tanh: a regularised sign, which creeps under load (c: 45 %); elasto-plastic: it"
        " sticks, and breaks away above the sliding friction",
    )
    coulomb: float = quantity(
        0.075, "rated torque", "Coulomb friction, fraction of rated torque (c: 0.01 to 0.18)", ge=0, le=10
    )
    viscous: float = quantity(
        0.05, "rated torque per rad/s", "viscous friction, fraction of rated torque (c: 0.004 to 0.09)", ge=0, le=100
    )
    transition_velocity: float = quantity(
        0.06, "rad/s", "velocity over which the Coulomb friction changes sign (tanh)", ge=0.0001, le=10
    )
    breakaway: float = quantity(
        1.5, "1", "friction at which a stuck joint breaks away, over Coulomb friction (elasto-plastic) (o)", ge=1, le=10
    )
    stribeck_velocity: float = quantity(
        0.05, "rad/s", "over which the friction falls from the one to the other (elasto-plastic) (o)", ge=0.0001, le=10
    )
    presliding: float = quantity(
        5e-4, "rad", "how far a stuck joint bends before it breaks away (elasto-plastic) (o)", ge=1e-8, le=0.1
    )


class Tool(Section):
    """The spatula: a thin rigid blade; its centre lies `reach` from the flange."""

    reach: float = quantity(0.14, "m", "flange to blade centre (H)", ge=0.01, le=2)
    blade_length: float = quantity(0.10, "m", "blade along the handle (o)", ge=0.005, le=1)
    blade_width: float = quantity(0.09, "m", "blade across the handle, along the tangent s (o)", ge=0.005, le=1)
    blade_thickness: float = quantity(0.002, "m", "blade thickness (o)", ge=0.0001, le=0.1)
    mass: float = quantity(0.15, "kg", "blade and handle (o)", ge=0.001, le=50)
    file: str | None = Field(
        None,
        description="URDF or SDF of another tool: one body, a frame 'tool' at the centre of its blade's top surface,"
        " x along the handle, z the normal; the blade's numbers here must match; null: the spatula",
    )

    @property
    def blade_size(self) -> tuple[float, float, float]:
        """Edges of the blade along x, y, z of the tool frame [m]: length, width, thickness."""
        return self.blade_length, self.blade_width, self.blade_thickness


class Object(Section):
    """The rubber block that stands for the pancake, or a pancake that bends."""

    kind: Literal["block", "pancake"] = Field(
        "block",
        description="block: rigid; pancake: finite elements, with defaults of its own for all that describes it and"
        " for the tool that carries it",
    )
    diameter: float | None = quantity(
        None, "m", "of a round pancake, in the place of length and width; null: a box (o)", ge=0.001, le=1
    )
    length: float = quantity(0.065, "m", "along the tangent s of the tool (p)", ge=0.001, le=1)
    width: float = quantity(0.062, "m", "along the handle (p)", ge=0.001, le=1)
    thickness: float = quantity(0.010, "m", "along the normal n (p)", ge=0.0001, le=0.5)
    mass: float = quantity(0.061, "kg", "mass (p)", ge=0.0001, le=50)
    friction: float = quantity(1.86, "1", "static friction coefficient on the blade (p)", ge=0.01, le=100)
    youngs_modulus: float = quantity(50e3, "Pa", "Young's modulus of a pancake (L)", ge=5e3, le=1e7)
    poissons_ratio: float = quantity(0.4, "1", "Poisson's ratio of a pancake (L)", ge=0, lt=0.5)
    damping: float = quantity(
        0.005, "s", "of a pancake: stress of a rate of strain over that of a strain (L)", ge=0, le=1
    )
    refinement: int = quantity(2, "1", "edges of a pancake's mesh from its middle to its rim (o)", ge=1, le=20)
    layers: int = quantity(2, "1", "layers of a pancake's mesh over its thickness (o)", ge=2, le=20)
    file: str | None = Field(
        None,
        description="URDF or SDF of another object: one body of this mass, its frame at the centre of a box of this"
        " size, x along the width; null: the block",
    )

    @model_validator(mode="before")
    @classmethod
    def _defaults_of_a_pancake(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and data.get("kind") == "pancake":
            # of a box only where the file says so
            data = {**PANCAKE["object"], **data}
            if isinstance(diameter := data["diameter"], int | float):
                data = {"length": diameter, "width": diameter, **data}
        return data

    @model_validator(mode="after")
    def _of_a_pancake(self) -> Object:
        if self.kind == "block":
            if self.diameter is not None:
                raise invalid("diameter", self.diameter, "null unless object.kind is pancake")
            return self
        if self.file is not None:
            raise invalid("file", self.file, "null where object.kind is pancake")
        if self.diameter is not None:
            for edge in ("length", "width"):
                if getattr(self, edge) != self.diameter:
                    valid = f"object.diameter = {self.diameter:g} [m], or object.diameter = null for a box"
                    raise invalid(edge, getattr(self, edge), valid)
        if self.vertices > MOST_VERTICES:
            valid = f"one that leaves the mesh at most {MOST_VERTICES} vertices, not {self.vertices}"
            raise invalid("refinement", self.refinement, valid)
        return self

    @property
    def size(self) -> tuple[float, float, float]:
        """Edges along x, y, z of its frame [m]: width, length, thickness."""
        return self.width, self.length, self.thickness

    @property
    def vertices(self) -> int:
        """Of a pancake's mesh."""
        return (2 * self.refinement + 1) ** 2 * (self.layers + 1)


class Table(Section):
    """The plane on which the block lands."""

    height: float = quantity(0.175, "m", "height of its surface above the robot's base (c: 0.11 to 0.22)", ge=-1, le=2)
    friction: float = quantity(
        0.7,
        "1",
        "friction coefficient of its surface, combined with another one as 2 a b / (a + b) (o)",
        ge=0.01,
        le=100,
    )


class Disturbance(Section):
    """What neither the planner nor the controller knows, beyond gravity and joint friction."""

    payload: float = quantity(0.0, "kg", "unknown mass at the flange (o)", ge=0, le=100)
    push: tuple[Force, Force] = quantity((0.0, 0.0), "N", "force on the spatula along y and z (o)")
    push_time: float = quantity(0.1, "s", "when it begins, after the start of the motion", ge=0, le=60)
    push_duration: float = quantity(0.05, "s", "how long it lasts", ge=0.0001, le=60)
    object_mass_scale: float = quantity(
        1.0, "1", "the object's mass over the one that was planned for", ge=0.01, le=100
    )
    start_error: float = quantity(
        0.0, "m", "arm and object stand this far off on y from the planned start", ge=-1, le=1
    )
    block_offset: float = quantity(
        0.0, "m", "the object lies this far from the middle of the blade along s", ge=-0.5, le=0.5
    )
    table_error: float = quantity(0.0, "m", "the table is this much higher than planned", ge=-1, le=1)
