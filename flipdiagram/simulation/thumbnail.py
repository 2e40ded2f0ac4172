"""The path of a recorded motion as a small picture, SVG inside HTML, for what a notebook shows of a run.

Of a pancake its outline stands at some instants, seen along x.
"""

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.pancake_surface import middle_section, outlines, surface_of
from flipdiagram.simulation.recording import Recording

WIDTH, HEIGHT, MARGIN, LEGEND = 280, 170, 12, 56
"""Pixels; the legend stands on the right."""
POINTS = 120
"""Points of a line; more cannot be seen at this size."""
COMMAND, TOOL, BLOCK = "#000000", "#009E73", "#CC79A7"
"""Colours of the lines, as in the figures."""
AFTER = 0.15
"""Seconds after the motion that are shown."""
OUTLINES, FILL = 5, "#efd6e3"
"""Outlines of a pancake, evenly from the first to the last instant that is shown."""


def path_svg(data: Recording) -> str:
    """Tool (green), its command (black, thin) and the block's centre (pink) in the y-z plane, start to landing."""
    shown = data.sel(time=slice(0.0, float(data.attrs["end_time_s"]) + AFTER))
    shown = shown.isel(time=np.unique(np.linspace(0, shown.sizes["time"] - 1, POINTS).astype(int)))
    lines = {
        BLOCK: shown["block_pose"].values[:, 5:],
        TOOL: shown["x"].values[:, :2],
        COMMAND: shown["x_cmd"].values[:, :2],
    }
    outline, surface = np.empty((0, 1, 2)), surface_of(data)
    if surface is not None:
        instants = np.linspace(shown["time"].values[0], shown["time"].values[-1], OUTLINES)
        outline = outlines(surface, middle_section(data, surface), instants)
    every = np.vstack([*lines.values(), *outline])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = float(np.min((np.array([WIDTH - LEGEND, HEIGHT]) - 2 * MARGIN) / np.maximum(high - low, 1e-6)))
    lines = {colour: (points - low) * scale + MARGIN for colour, points in lines.items()}
    widths = {BLOCK: 1.6, TOOL: 2.2, COMMAND: 0.9}
    drawn = "".join(_shape((points - low) * scale + MARGIN) for points in outline)
    drawn += "".join(_line(points, colour, widths[colour]) for colour, points in lines.items())
    names = {COMMAND: "command", TOOL: "tool", BLOCK: "block" if surface is None else "pancake"}
    legend = "".join(
        f'<text x="{WIDTH - LEGEND}" y="{18 + 14 * row}" fill="{colour}" font-size="11">{name}</text>'
        for row, (colour, name) in enumerate(names.items())
    )
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" role="img" style="background: white">'
        f"<title>path in the y-z plane</title>{drawn}{legend}</svg>"
    )


def beside(table: str, picture: str) -> str:
    """A table and a picture in one line of a notebook."""
    return f'<div style="display: flex; gap: 1em; align-items: center">{table}{picture}</div>'


def _shape(points: Floats) -> str:
    return f'<polygon points="{_places(points)}" fill="{FILL}" stroke="{BLOCK}" stroke-width="0.6"/>'


def _line(points: Floats, colour: str, width: float) -> str:
    return f'<polyline points="{_places(points)}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _places(points: Floats) -> str:
    return " ".join(f"{y:.1f},{HEIGHT - z:.1f}" for y, z in points)
