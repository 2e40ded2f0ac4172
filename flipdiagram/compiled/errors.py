"""The one exception of this package."""

from flipdiagram.errors import InputError


class NotCompilable(InputError):
    """A diagram has no compiled form. One line names the block and the reason."""
