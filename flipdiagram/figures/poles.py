"""Poles of a sampled loop as a picture: in z with the unit circle, in s with lines of equal damping."""

from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipdiagram.figures.style import GUIDE, RC, style_of, tidy
from flipdiagram.theory.poles import Pole

DAMPING = (0.3, 0.5, 0.7, 0.9)


def draw_poles(poles: Sequence[Pole], architecture: str, title: str) -> Figure:
    """Two panels of a new Figure: all poles in the unit circle, and those that are not gone after a sample in s."""
    color = style_of(architecture).color
    with rc_context(RC):
        figure = Figure(figsize=(8.0, 4.2), layout="constrained")
        in_z, in_s = figure.subplots(1, 2)
        figure.suptitle(title, fontsize="medium")
        _draw(in_z, [pole.z for pole in poles], color)
        angle = np.linspace(0.0, 2 * np.pi, 361)
        in_z.plot(np.cos(angle), np.sin(angle), **GUIDE)
        in_z.set(xlabel="Re z", ylabel="Im z", aspect="equal")
        s = [pole.s for pole in poles if pole.s is not None]
        _draw(in_s, s, color)
        far = 1.1 * max(map(abs, s), default=1.0)
        for zeta in DAMPING:
            end = far * np.exp(1j * (np.pi - np.arccos(zeta)))
            in_s.plot([end.real, 0.0, end.real], [end.imag, 0.0, -end.imag], **GUIDE)
            in_s.annotate(f"ζ = {zeta:g}", (end.real, end.imag), fontsize="small", color="0.4", ha="right")
        in_s.axvline(0.0, color="0.4", linewidth=0.9)
        in_s.set(xlabel="Re s [rad/s]", ylabel="Im s [rad/s]", xlim=(-1.25 * far, None))
        for ax in (in_z, in_s):
            tidy(ax)
    return figure


def _draw(ax: Axes, upper: Sequence[complex], color: str) -> None:
    both = [point for pole in upper for point in (pole, pole.conjugate())]
    ax.plot(np.real(both), np.imag(both), "x", color=color, markeredgewidth=1.4)
