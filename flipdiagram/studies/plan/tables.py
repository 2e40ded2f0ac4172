"""The numbers of the planned motion as a table."""

from flipdiagram.grid import Grid, number
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid]:
    """A row a number."""
    return [Grid(["planned motion", "value"], [[name, number(value)] for name, value in summary["plan"].items()])]
