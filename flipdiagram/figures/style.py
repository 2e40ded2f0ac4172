"""How every figure looks: colours, names, labels, fonts; new axes, and files that are the same for the same figure.

Figures are Figure objects without pyplot, so there is no display and no global state.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path
from flipdiagram.scenario.scenario import ARCHITECTURES


@dataclass(frozen=True)
class Style:
    """How one signal looks, in every figure.

    The colours are Okabe and Ito's, which colour-blind readers can tell apart.
    """

    color: str
    linestyle: Any
    zorder: float
    linewidth: float = 1.5

    def line(self) -> dict[str, Any]:
        """Keywords of Axes.plot."""
        return {"color": self.color, "linestyle": self.linestyle, "linewidth": self.linewidth, "zorder": self.zorder}


# broken lines lie over solid ones, or they could not be seen where two signals agree
STYLES = {
    "command": Style("#000000", "-", 2.9, 0.9),
    "pd": Style("#D55E00", (0, (1, 1.2)), 2.8),
    "pd+ff": Style("#E69F00", (0, (6, 1.5, 1, 1.5)), 2.7),
    "pd+dob": Style("#0072B2", (0, (5, 1.5)), 2.6),
    "pd+ff+dob": Style("#009E73", "-", 2.5, 1.9),
}
OTHER = Style("#56B4E9", "-", 2.5, 1.6)
"""An architecture of the user's own."""
NAMES = {"command": "command", "pd": "PD", "pd+ff": "PD + FF", "pd+dob": "PD + DOB", "pd+ff+dob": "PD + FF + DOB"}
WITH_OBSERVER = ("pd+dob", "pd+ff+dob")
LABELS = {
    "x": ("y [m]", "z [m]", "θ [rad]"),
    "v": ("$v_y$ [m/s]", "$v_z$ [m/s]", "$v_θ$ [rad/s]"),
    "a": ("$a_y$ [m/s²]", "$a_z$ [m/s²]", "$a_θ$ [rad/s²]"),
}
MARK: Any = {"color": "black", "linestyle": "none", "zorder": 3}
GUIDE: Any = {"color": "0.4", "linewidth": 0.9, "linestyle": ":"}
RC: Any = {
    "svg.hashsalt": "flipdiagram",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",  # comes with Matplotlib: the same text everywhere
    "font.size": 9.0,
}


def style_of(name: str) -> Style:
    """The style of an architecture or of the command; raises InputError for an unknown name."""
    try:
        return STYLES[name]
    except KeyError:
        message = f"unknown architecture '{name}'; choose from {', '.join(ARCHITECTURES)}"
        raise InputError(message, field="architecture", value=name, valid=ARCHITECTURES) from None


def new_axes(count: int, size: tuple[float, float], columns: int = 1, frame: bool = True) -> list[Axes]:
    """Axes of a new Figure of a size in inches, row by row; without a frame they fill it."""
    with rc_context(RC):
        figure = Figure(figsize=size, layout="constrained" if frame else None)
        if not frame:
            return [figure.add_axes((0, 0, 1, 1))]
        return list(np.ravel(figure.subplots(count // columns, columns, sharex=count > 1, squeeze=False)))


def tidy(ax: Axes) -> None:
    """A pale grid behind the lines, and no frame above and at the right."""
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def finish(axes: Sequence[Axes], own: bool) -> None:
    """Grid and legend; the legend stands above the panels where the figure is our own."""
    for ax in axes:
        tidy(ax)
    handles, labels = axes[0].get_legend_handles_labels()
    figure = axes[0].figure
    if handles and own and isinstance(figure, Figure):
        columns = 3 if figure.get_figwidth() < 7 else 5
        figure.legend(handles, labels, loc="outside upper center", ncols=columns, frameon=False)
    elif handles:
        axes[0].legend(fontsize="small", framealpha=0.9)


def save(figure: Figure, path: str | Path, dpi: int = 150) -> list[Path]:
    """Write `path`.png and `path`.svg (path without suffix), each whole or not at all; returns both paths.

    No dates inside: the same figure gives the same bytes. Raises InputError where it cannot write.
    """
    written = []
    with rc_context(RC):
        for suffix, metadata in (("png", {"Software": None}), ("svg", {"Date": None, "Creator": None})):
            target = Path(f"{path}.{suffix}")
            with atomic_path(target) as temporary:
                figure.savefig(temporary, format=suffix, dpi=dpi, metadata=metadata)
            figure.set_layout_engine("none")  # laid out once, for both
            written.append(target)
    return written
