"""Which arm turns the block, mh3f.urdf or one of the user's own: its numbers scaled, where it stands, its tool."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flipdiagram.errors import InputError

FORMATS = (".urdf", ".sdf", ".xml")
"""URDF, SDF, and MJCF, whose files end in .xml."""
REFLECTED_INERTIA_SCALE = 2.0
"""Harmonic drives on top of the rotors: their share is unknown, doubling is our estimate [L]."""


@dataclass(frozen=True)
class ArmFile:
    """An arm of the user's own, as the scenario names it; what is given per joint goes from base to flange, and None
    stands for what the file says.  InputError unless the file is there and of a known format.
    """

    path: str  # URDF, SDF or MJCF (.xml)
    base: str = "base"  # link or frame that stands on the ground
    flange: str = "flange"  # link or frame that carries the spatula, its z axis pointing out
    mount_angle: float = 0.0  # [rad] turn of the spatula about the flange's z axis
    home: tuple[float, ...] | None = None  # [rad] near the start pose
    torque_limits: tuple[float, ...] | None = None  # [N m]
    speed_limits: tuple[float, ...] | None = None  # [rad/s]
    reflected_inertia: tuple[float, ...] | None = None  # [kg m²] rotor and gear, seen at the joint

    def __post_init__(self) -> None:
        if Path(self.path).suffix.lower() not in FORMATS:
            raise self.error(f"is of no known format; valid is {', '.join(FORMATS)}", FORMATS)
        if not Path(self.path).is_file():
            raise self.error("cannot be read; valid is an existing file", "an existing file")

    @property
    def is_urdf(self) -> bool:
        """Whether the text can be read and changed as URDF; other formats are changed in the plant."""
        return Path(self.path).suffix.lower() == ".urdf"

    def error(self, problem: str, valid: object = None) -> InputError:
        """The error of this file: "arm.file = 'a.urdf' …"."""
        return InputError(f"arm.file = '{self.path}' {problem}", field="arm.file", value=self.path, valid=valid)


@dataclass(frozen=True)
class ArmSpec:
    """All that makes an `ArmModel` and the arm in a plant; InputError for a number that is not valid.

    Scales are factors on the numbers of the file, without unit; `_scales` hold one per moving joint, from base to
    flange, and multiply those of its link and rotor.  torque_scale acts on the peak alone: friction is a fraction of
    the rated torque, which stays.
    """

    tool_height: float = 0.005  # [m] of the control point C above the blade's top surface
    own: ArmFile | None = None  # None: mh3f.urdf
    spatula: str | None = None  # URDF or SDF text, one body and a frame "tool"; None: spatula.urdf
    base_pose: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # x, y, z [m] and yaw [rad] of the base
    link_inertia_scale: float = 1.0  # mass and inertia of every link
    reflected_inertia_scale: float = REFLECTED_INERTIA_SCALE  # every rotor inertia
    speed_scale: float = 1.0
    torque_scale: float = 1.0
    link_inertia_scales: tuple[float, ...] | None = None
    reflected_inertia_scales: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        may_be_zero = ("tool_height", "reflected_inertia_scale")
        numbers = {name: getattr(self, name) for name in ("link_inertia_scale", "speed_scale", "torque_scale")}
        for name in ("link_inertia_scales", "reflected_inertia_scales"):
            numbers |= {f"{name}[{k}]": scale for k, scale in enumerate(getattr(self, name) or ())}
        for name, value in (numbers | {name: getattr(self, name) for name in may_be_zero}).items():
            if not math.isfinite(value) or value < 0 or (value == 0 and name not in may_be_zero):
                valid = "a number of at least 0" if name in may_be_zero else "a number above 0"
                message = f"{name} = {value} is not valid; valid is {valid}"
                raise InputError(message, field=name, value=value, valid=valid)

    def per_joint(self, name: str, joints: Sequence[str]) -> Sequence[float]:
        """The factors of a field for joints of these names, 1 each for None; InputError unless there is one each."""
        scales = getattr(self, name)
        if scales is None:
            return [1.0] * len(joints)
        if len(scales) != len(joints):
            valid = f"one per joint, {' '.join(joints)}"
            message = f"{name} = {list(scales)} has {len(scales)} entries; valid is {valid}"
            raise InputError(message, field=name, value=scales, valid=valid)
        return tuple(scales)
