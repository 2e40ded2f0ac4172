"""The numbers of the planned motion as a table."""

from flipdiagram.grid import Grid, labelled
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid]:
    """A row a number."""
    return [Grid(["planned motion", "value"], [labelled(*entry) for entry in summary["plan"].items()])]
