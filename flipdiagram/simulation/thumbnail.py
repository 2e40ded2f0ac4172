"""The path of a recorded motion as a small picture, SVG inside HTML, for what a notebook shows of a run."""

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.simulation.recording import Recording

WIDTH, HEIGHT, MARGIN, LEGEND = 280, 170, 12, 56
"""Pixels; the legend stands on the right."""
POINTS = 120
"""Points of a line; more cannot be seen at this size."""
COMMAND, TOOL, BLOCK = "#000000", "#009E73", "#CC79A7"
"""Colours of the lines, as in the figures."""
AFTER = 0.15
"""Seconds after the motion that are shown."""


def path_svg(data: Recording) -> str:
    """Tool (green), its command (black, thin) and the block's centre (pink) in the y-z plane, start to landing."""
    shown = data.sel(time=slice(0.0, float(data.attrs["end_time_s"]) + AFTER))
    shown = shown.isel(time=np.unique(np.linspace(0, shown.sizes["time"] - 1, POINTS).astype(int)))
    lines = {
        BLOCK: shown["block_pose"].values[:, 5:],
        TOOL: shown["x"].values[:, :2],
        COMMAND: shown["x_cmd"].values[:, :2],
    }
    every = np.vstack(list(lines.values()))
    low, high = every.min(axis=0), every.max(axis=0)
    scale = float(np.min((np.array([WIDTH - LEGEND, HEIGHT]) - 2 * MARGIN) / np.maximum(high - low, 1e-6)))
    lines = {colour: (points - low) * scale + MARGIN for colour, points in lines.items()}
    widths = {BLOCK: 1.6, TOOL: 2.2, COMMAND: 0.9}
    drawn = "".join(_line(points, colour, widths[colour]) for colour, points in lines.items())
    names = {COMMAND: "command", TOOL: "tool", BLOCK: "block"}
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


def _line(points: Floats, colour: str, width: float) -> str:
    text = " ".join(f"{y:.1f},{HEIGHT - z:.1f}" for y, z in points)
    return f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}"/>'
