"""The one exception of this package."""

from flipdiagram.errors import InputError


class NotCompilable(InputError):
    """A diagram has no compiled form. One line names the block and the reason."""


def first_line(error: BaseException) -> str:
    """The first line of an exception's message, for one-line errors."""
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
