"""The exceptions of flipdiagram: one class per way of going wrong, with the exit code of the command line."""


class FlipdiagramError(Exception):
    """Base of every error raised on purpose. `exit_code` is what the command line exits with."""

    exit_code = 1


class ScenarioError(FlipdiagramError):
    """A bad input. The message names the field, the value given and what would be valid."""

    exit_code = 2


class MissingProgramError(FlipdiagramError):
    """A system program is not installed. The message says which feature needs it and how to install it."""

    exit_code = 2


class PlanningError(FlipdiagramError):
    """The planner or the kinematics said no: infeasible plan, unreachable pose."""

    exit_code = 3


class SimulationError(FlipdiagramError):
    """The simulation broke off, for instance because it diverged."""

    exit_code = 3
