"""The planned motion as a figure."""

from pathlib import Path
from typing import Any, cast

from matplotlib.figure import Figure

from flipdiagram.figures.motion import plot_plan
from flipdiagram.figures.style import save
from flipdiagram.planning import Plan
from flipdiagram.studies.study import Summary


def write_figures(summary: Summary, out: Path, **_: Any) -> list[str]:
    """Draw plan.png and .svg beside plan.json."""
    save(cast("Figure", plot_plan(Plan.load(out / "plan.json"))[0].figure), out / "plan")
    return []
