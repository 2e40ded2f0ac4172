"""Colours and second lines of the boxes: plain, or by sample time.  Tints of Okabe and Ito's colour-blind-safe set."""

from dataclasses import dataclass

from flipdiagram.drawing.graph import Box, class_of, full_name
from flipdiagram.drawing.rates import Timing, timing_of

TINTS = {"feedforward": "#FBE9C6", "disturbance_observer": "#CFE5F3"}
"""The two boxes by which the architectures differ: orange, blue."""
CLOSED = "#EFEFEF"
PERIODS = ("#CFE5F3", "#FBE9C6", "#CDEBE0", "#F3DCE9", "#FBF8CC", "#DDF0FB")
OTHER = {"direct": "#FFFFFF", "continuous": "#F6D5C3", "events": "#E4E4E4"}


@dataclass(frozen=True)
class Style:
    """How boxes look; `timings` lists the sample times of the diagram where they are shown."""

    timings: tuple[Timing, ...] = ()

    def colour(self, box: Box) -> str:
        """Fill colour of a box."""
        if self.timings and box.systems:
            return self._colour_of(slowest(box))
        return CLOSED if box.kind == "closed" else TINTS.get(box.name, "#FFFFFF")

    def second_line(self, box: Box) -> str:
        """What stands below the name: the sample time, where shown and where there is one."""
        if not self.timings or not box.systems or slowest(box).kind == "direct":
            return ""
        return slowest(box).short

    def tooltip(self, box: Box) -> str:
        """Path and class of a box."""
        name = full_name(box.path)
        return f"{name} ({class_of(box.systems[0][1])})" if box.kind in ("box", "sum") else name

    def legend(self) -> str:
        """The legend of sample times as an HTML-like table of Graphviz; empty where they are not shown."""
        if not self.timings:
            return ""
        cells = "".join(f'<TD BGCOLOR="{self._colour_of(t)}">{t.text}</TD>' for t in self.timings)
        look = 'BORDER="0" CELLBORDER="1" CELLSPACING="0" CELLPADDING="4" COLOR="#999999"'
        return f"<TABLE {look}><TR>{cells}</TR></TABLE>"

    def _colour_of(self, timing: Timing) -> str:
        if timing.kind != "sampled":
            return OTHER[timing.kind]
        sampled = [t for t in self.timings if t.kind == "sampled"]
        return PERIODS[sampled.index(timing) % len(PERIODS)]


def slowest(box: Box) -> Timing:
    """Timing of a box; of a closed one that of its slowest sampled part, and where none is sampled of its states."""
    return max(timing_of(system) for _, system in box.systems)


def styled_by_rate(boxes: tuple[Box, ...]) -> Style:
    """The style that shows the sample times of these boxes."""
    return Style(tuple(sorted({slowest(box) for box in boxes if box.systems}, reverse=True)))
