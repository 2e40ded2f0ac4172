"""Which arm turns the block, mh3f.urdf or one of the user's own, and the tool at its flange."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.files import check_file
from flipdiagram.robot.model_xml import model_error
from flipdiagram.scenario.cell import Arm

FORMATS = {".urdf": "urdf", ".sdf": "sdf", ".xml": "mjcf"}
"""Format by the end of a file's name."""


@dataclass(frozen=True)
class ArmSpec:
    """All that makes an `ArmModel` and the arm in a plant.

    The numbers of an arm's own file are scaled; its factors per joint go from base to flange and multiply those of its
    link and rotor.  torque_scale acts on the peak alone: friction is a fraction of the rated torque, which stays.
    InputError for a bad height, or a file of the user's own that is none or of no known format.
    """

    arm: Arm = Arm()
    tool_height: float = 0.005  # [m] of the control point C above the blade's top surface
    spatula: str | None = None  # URDF or SDF text, one body and a frame "tool"; None: spatula.urdf

    def __post_init__(self) -> None:
        if not 0 <= self.tool_height < math.inf:
            raise InputError.of("tool_height", self.tool_height, "a number of at least 0")
        if self.arm.file is not None and self.suffix not in FORMATS:
            raise file_error(self.arm, "is of no known format", ", ".join(FORMATS))
        if self.arm.file is not None:
            check_file(self.arm.file, "arm.file =", "a URDF, SDF or MJCF")

    @property
    def suffix(self) -> str:
        """Of the arm's file: only the text of a `.urdf` can be changed, other formats are changed in the plant."""
        return Path(self.arm.file or "mh3f.urdf").suffix.lower()


def file_error(arm: Arm, problem: str, valid: Any) -> InputError:
    """The error of an arm's file: "arm.file = 'a.urdf' <problem>; valid is …"."""
    return model_error("arm.file", arm.file, problem, valid)


def one_per_joint(field: str, given: Sequence[float] | None, joints: Sequence[str]) -> Sequence[float]:
    """The numbers of a field for joints of these names, 1 each for None; InputError unless there is one each."""
    if given is None:
        return [1.0] * len(joints)
    if len(given) != len(joints):
        problem = f"scenario field '{field}' = {list(given)} has {len(given)} entries"
        raise InputError.of(field, given, f"one per joint, {' '.join(joints)}", problem)
    return given
