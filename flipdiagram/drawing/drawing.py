"""Drake Diagram → drawing: DOT, SVG, PNG, Mermaid, and the table of sample times."""

import os
import shutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from pydrake.systems.framework import Diagram

from flipdiagram.drawing.dot import render, to_dot
from flipdiagram.drawing.graph import Graph, read_graph
from flipdiagram.drawing.layout import FEEDBACK, Line, lines
from flipdiagram.drawing.mermaid import to_mermaid
from flipdiagram.drawing.rates import RateTable, rates_of
from flipdiagram.drawing.style import Style, styled_by_rate
from flipdiagram.errors import InputError
from flipdiagram.files import write_atomically


class HasDiagram(Protocol):
    """Something around a Diagram that says how it is drawn."""

    @property
    def diagram(self) -> Diagram:
        """The diagram itself."""

    @property
    def groups(self) -> Mapping[str, Collection[str]]:
        """Names of its systems that are drawn as one box, by the name of the box."""

    @property
    def ports(self) -> Collection[str]:
        """Names of the diagram's ports that are drawn: a figure need not show all by which it can be connected."""


@dataclass(frozen=True)
class Drawing:
    """A diagram as a figure; the same text on every build of the same diagram, in any process."""

    graph: Graph
    lines: tuple[Line, ...]
    style: Style
    title: str | None = None

    def __repr__(self) -> str:
        return f"<Drawing of {len(self.graph.boxes)} boxes; svg(), png(), dot(), mermaid(), rates()>"

    def dot(self) -> str:
        """The figure in DOT, the language of Graphviz, which bends the arrows its own way: `svg` has them square."""
        return to_dot(self.graph, self.lines, self.style, self.title)

    def svg(self) -> str:
        """The figure as SVG.  Raises MissingProgramError (exit code 2) where Graphviz's `dot` is not installed."""
        return self._render("svg").decode()

    def png(self) -> bytes:
        """The figure as PNG at 96 dots per inch.  Raises MissingProgramError as `svg` does."""
        return self._render("png")

    def mermaid(self) -> str:
        """The figure as a Mermaid flowchart."""
        return to_mermaid(self.graph, self.lines, self.style, self.title)

    def rates(self, *, unconnected: bool = False) -> RateTable:
        """Sample times, ports and feed-through of each leaf system drawn, also of those inside closed boxes.

        Ports that nothing is connected to are left out, unless `unconnected`: a MultibodyPlant has dozens.
        """
        systems = (pair for box in self.graph.boxes for pair in box.systems)
        return rates_of(self.graph.diagram, systems, unconnected, self.graph.ports)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the figure by the suffix of `path`: .dot, .svg, .png, .mmd (Mermaid) or .md (Mermaid and table).

        The file appears whole or not at all.  Raises InputError for another suffix or a place that cannot be
        written, MissingProgramError as `svg` does.
        """
        forms: dict[str, Callable[[], str | bytes]] = {
            ".dot": self.dot,
            ".svg": self.svg,
            ".png": self.png,
            ".mmd": self.mermaid,
            ".md": self._markdown,
        }
        suffix = Path(path).suffix.lower()
        if suffix not in forms:
            raise InputError.of("path", suffix, list(forms), f"drawing '{path}' has the suffix '{suffix}'")
        return write_atomically(path, forms[suffix]())

    def _render(self, form: str) -> bytes:
        return render(self.graph, self.lines, self.style, self.title, form)

    def _markdown(self) -> str:
        return f"```mermaid\n{self.mermaid()}```\n\n{self.rates().to_markdown()}"

    def _repr_svg_(self) -> str | None:
        return self.svg() if shutil.which("dot") else None

    def _repr_markdown_(self) -> str | None:
        # JupyterLab would show Markdown before SVG
        return None if shutil.which("dot") else self._markdown()


def draw(
    diagram: Diagram | HasDiagram,
    *,
    depth: int = 0,
    title: str | None = None,
    rates: bool = False,
    groups: Mapping[str, Collection[str]] | None = None,
    feedback: Collection[str] = FEEDBACK,
    taps: bool = False,
) -> Drawing:
    """Draw a Diagram, ours or anyone's, or what holds one and says what of it is one box, such as a Loop.

    Args:
        diagram: what is drawn.
        depth: levels of sub-diagrams and groups that are opened.
        title: stands above the figure.
        rates: colour the boxes by sample time.
        groups: names of systems of the outermost diagram drawn as one box, by its name.
        feedback: names of boxes on the way back, drawn from right to left.
        taps: draw log sinks and what else only looks on (an attribute `only_looks_on` says so) too, and in a diagram
            without inputs the outputs that tap a signal which also goes elsewhere.

    Raises:
        InputError: for a depth that is no whole number >= 0, groups that do not fit, or what is no Diagram.
    """
    ports: Collection[str] | None = None
    if not isinstance(diagram, Diagram):
        if not hasattr(diagram, "diagram"):
            problem = f"cannot draw a {type(diagram).__name__}"
            raise InputError.of("diagram", diagram, "a Drake Diagram or a Loop", problem)
        groups, ports = diagram.groups if groups is None else groups, diagram.ports
        diagram = diagram.diagram
    graph = read_graph(diagram, depth=depth, groups=groups, taps=taps, ports=ports)
    style = styled_by_rate(graph.boxes) if rates else Style()
    return Drawing(graph, lines(graph, feedback), style, title)
