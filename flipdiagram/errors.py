"""The exceptions of flipdiagram: one class per way of going wrong, with the exit code of the command line."""

import math
from typing import Any, Self


class FlipdiagramError(Exception):
    """Base of every error raised on purpose. `exit_code` is what the command line exits with."""

    exit_code = 1


class InputError(FlipdiagramError):
    """A bad input. The message, one line, names the field, the value given and what would be valid.

    Args:
        message: the sentence.
        field: name of the field, argument or file, where there is one.
        value: what was given.
        valid: what would be valid, in words or as the names to choose from.
    """

    exit_code = 2

    def __init__(self, message: str, *, field: str | None = None, value: Any = None, valid: Any = None) -> None:
        super().__init__(message)
        self.field, self.value, self.valid = field, value, valid

    @classmethod
    def of(cls, field: str, value: Any, valid: Any, problem: str | None = None) -> Self:
        """The error whose sentence is 'problem; valid is …', or '…; choose from …' where `valid` are names.

        The problem is by default 'field = value'.
        """
        remedy = f"valid is {valid}" if isinstance(valid, str) else f"choose from {', '.join(map(str, valid))}"
        return cls(f"{problem or f'{field} = {value!r}'}; {remedy}", field=field, value=value, valid=valid)


class ScenarioError(InputError):
    """A field of a scenario, or the text of one, is not valid."""


class NotCompilable(InputError):
    """A Drake Diagram has no compiled form. The message names the block and the reason."""


class MissingProgramError(FlipdiagramError):
    """A system program is not installed. The message says which feature needs it and how to install it."""

    exit_code = 2


class PlanningError(FlipdiagramError):
    """The planner or the kinematics said no: infeasible plan, unreachable pose."""

    exit_code = 3


class SimulationError(FlipdiagramError):
    """The simulation broke off, for instance because it diverged."""

    exit_code = 3


class NoEquilibriumError(SimulationError):
    """The controller cannot hold the arm at the start, so a run cannot begin at equilibrium."""


class EntryError(FlipdiagramError):
    """An entry of the challenge did what it must not: raised, returned no torque, wrote to stdout.

    The message, one line, names the file and, where there is one, the line.
    """

    exit_code = 3


def first_line(error: BaseException) -> str:
    """The first line of an exception's message, or its name where there is none."""
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


def rounded_up(value: float) -> str:
    """A positive number of at least `value` in four digits, for a message that names the smallest valid one."""
    if not 0 < value < math.inf:
        return f"{value:g}"
    unit = 10.0 ** (math.floor(math.log10(value)) - 3)
    return f"{math.ceil(value / unit) * unit:.4g}"
