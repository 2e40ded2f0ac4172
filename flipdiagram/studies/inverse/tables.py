"""The search for E1 as tables."""

from typing import Any

from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import with_unit
from flipdiagram.studies.inverse.search import KEPT
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid]:
    """How far the worlds came; those found and where they lie; the smallest change that does it; the nearest misses."""
    return [
        stage_grid(summary),
        found_grid(summary),
        region_grid(summary),
        smallest_grid(summary),
        nearest_grid(summary),
    ]


def stage_grid(summary: Summary) -> Grid:
    """A row for each controller, in the order in which they are flown."""
    rows = []
    for stage in summary["stages"]:
        modes = sorted(stage["modes"].items(), key=lambda item: -item[1])
        others = ", ".join(f"{count} {mode}" for mode, count in modes if mode not in stage["wanted"])
        if far := sum(stage["modes"].get(mode, 0) for mode in stage["wanted"]) - stage["went"]:
            others = f"{far} turned over, but slid farther than {1000 * KEPT:g} mm" + (f", {others}" if others else "")
        wanted = " or ".join(stage["wanted"])
        rows.append([f"`{stage['architecture']}`", wanted, str(stage["flown"]), str(stage["went"]), others or "–"])
    low, high = (100 * summary[name] for name in ("low", "high"))
    title = (
        f"E1 as the paper tells it in {summary['found']} of {summary['worlds']} worlds"
        f" (95 % interval {low:.2f}–{high:.2f} %)"
        f"{', the block sliding at the start of the motion in ' + str(summary['at_start']) if summary['found'] else ''}"
    )
    return Grid(["controller", "wanted", "worlds", "as wanted", "the others"], rows, title, ["worlds", "as wanted"])


def found_grid(summary: Summary) -> Grid:
    """The worlds in which E1 holds, and where else it holds there: a world that does not is the solver's."""
    rows = [
        [str(world["trial"]), ", ".join(world["firm"]) or "–", _slip(world), _told(world)]
        for world in summary["worlds_found"]
    ]
    return Grid(
        ["world", "holds too", "slip, at most", "what happened"], rows, "the worlds in which E1 holds", ["world"]
    )


def region_grid(summary: Summary) -> Grid:
    """A row for each unknown: the box, and where the worlds lie in which E1 holds."""
    rows = []
    for row in summary["region"]:
        (kind, given), *_ = row["box"].get("scale", row["box"]).items()
        box = " or ".join(map(_text, given)) if kind == "choice" else " to ".join(map(_text, given))
        if "counts" in row:
            found = ", ".join(f"{_text(value)}: {count}" for value, count in row["counts"].items())
        else:
            low, middle, high = map(number, row["interval"])
            found = f"{middle} ({low}–{high})"
        rows.append([f"`{with_unit(row['name'])}`", box, found])
    return Grid(
        ["field", "box", "there (5–95 %)"], rows, "where the worlds lie in which E1 holds as the paper tells", []
    )


def smallest_grid(summary: Summary) -> Grid:
    """What has to be other than in the base."""
    smallest = summary["smallest"] or {"values": {}, "base": {}, "firm": []}
    rows = [
        [f"`{with_unit(name)}`", _text(smallest["base"][name]), _text(value)]
        for name, value in smallest["values"].items()
    ]
    where = f"also: {', '.join(smallest['firm'])}" if smallest["firm"] else "in this engine, at this step"
    title = f"the smallest change of the base that does it ({where})"
    return Grid(["field", "base", "there"], rows, title, [])


def nearest_grid(summary: Summary) -> Grid:
    """The worlds that came nearest without getting there."""
    rows = []
    for world in summary["nearest"]:
        passed = f"{world['passed']} of {len(summary['stages'])}"
        rows.append([str(world["trial"]), passed, _slip(world), _told(world)])
    return Grid(["world", "as wanted", "slip, at most", "what happened"], rows, "the nearest misses", ["world"])


def _told(world: dict[str, Any]) -> str:
    return "; ".join(f"{name} {flip['failure'] or 'turned over'}" for name, flip in world["flips"].items())


def _slip(world: dict[str, Any]) -> str:
    slips = [flip["max_slip_m"] for flip in world["flips"].values() if flip["max_slip_m"] is not None]
    return f"{1000 * max(slips):.1f} mm" if slips else "–"


def _text(value: object) -> str:
    return number(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
