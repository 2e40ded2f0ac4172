"""Graph → DOT, the language of Graphviz, and DOT → picture by Graphviz's program `dot`."""

import shutil
import subprocess
from html import escape

from flipdiagram.drawing.graph import Box, Graph, Names, full_name
from flipdiagram.drawing.layout import Line
from flipdiagram.drawing.placement import Placement, place
from flipdiagram.drawing.style import Style
from flipdiagram.drawing.typography import box_lines, signal_html, signal_rows
from flipdiagram.errors import InputError, MissingProgramError

INSTALL = (
    "program 'dot' is not installed; SVG and PNG drawings need it: `apt-get install graphviz` or"
    " `brew install graphviz` (DOT and Mermaid do without)"
)
MOST_LINES = 80
"""Larger drawings are Graphviz's own, with curved arrows."""
FONT = "Helvetica,Arial,sans-serif"
HEAD = f"""  graph [rankdir=LR, bgcolor=white, splines=spline, nodesep=0.35, ranksep=0.45, pad=0.15, size="16.5"];
  graph [fontname="{FONT}", fontsize=13];
  node [shape=box, style=filled, fillcolor=white, color="#333333", penwidth=1.2, height=0.5, margin="0.12,0.06"];
  node [fontname="{FONT}", fontsize=13];
  edge [color="#333333", penwidth=1.1, arrowsize=0.7, fontname="{FONT}", fontsize=12];"""
"""`size` [inch] keeps a figure within 1600 pixels."""


def to_dot(
    graph: Graph,
    lines: tuple[Line, ...],
    style: Style,
    title: str | None = None,
    *,
    placed: Placement | None = None,
    legend: bool = True,
) -> str:
    """The drawing as DOT text, the same on every build of the same diagram; with fixed places where given."""
    out = ["digraph diagram {", HEAD]
    main = {path for line in lines if line.main for path in (line.source, line.target)}
    out += _cluster(graph, (), style, main, placed, "  ")
    out += [f"  {_edge(i, line, placed)};" for i, line in enumerate(lines)]
    for i, (x, y) in enumerate(placed.branches if placed else ()):
        out.append(f'  "branch:{i}" [shape=point, width=0.06, fillcolor="#333333", label="", pos="{x:.2f},{y:.2f}"];')
    if title is not None:
        if placed is None:
            out.append(f"  label={quoted(title)}; labelloc=t;")
        else:
            x, y = placed.frame.centre[0], placed.frame.top + 24.0
            look = f'shape=plaintext, style="", fontsize=15, label={quoted(title)}'
            out.append(f'  "title:" [{look}, pos="{x:.2f},{y:.2f}"];')
    table = style.legend() if legend else ""
    if table:
        at = f', pos="{placed.frame.centre[0]:.2f},{placed.frame.bottom - 26:.2f}"' if placed else ""
        look = f'shape=plaintext, style="", fontsize=11, tooltip="sample times", label=<{table}>'
        out.append(f'  "legend:" [{look}{at}];')
    return "\n".join([*out, "}", ""])


def render(graph: Graph, lines: tuple[Line, ...], style: Style, title: str | None, form: str) -> bytes:
    """The drawing as `svg` or `png`.  Raises MissingProgramError where Graphviz is not installed.

    Graphviz's `dot` places the boxes, `placement` the arrows, and Graphviz's `neato -n2` draws what stands where.
    """
    if len(lines) > MOST_LINES:
        return run_dot(to_dot(graph, lines, style, title), f"-T{form}")
    placed = place(run_dot(to_dot(graph, lines, style, legend=False), "-Tjson"), graph, lines)
    return run_dot(to_dot(graph, lines, style, title, placed=placed), "-Kneato", "-n2", f"-T{form}")


def run_dot(text: str, *options: str) -> bytes:
    """What Graphviz's `dot` makes of DOT text.  Raises MissingProgramError where it is not installed."""
    program = shutil.which("dot")
    if program is None:
        raise MissingProgramError(INSTALL)
    done = subprocess.run([program, *options], input=text.encode(), capture_output=True, check=False)
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        reason = next((line for line in said if "rror" in line), f"exit code {done.returncode}")
        raise InputError(f"Graphviz cannot draw the diagram: {reason}")
    return done.stdout


def quoted(text: str) -> str:
    """A string of DOT."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


def _cluster(
    graph: Graph, path: Names, style: Style, main: set[Names], placed: Placement | None, indent: str
) -> list[str]:
    boxes = [box for box in graph.boxes if box.path[:-1] == path]
    out = [f"{indent}{_node(box, style, box.path in main, placed)};" for box in boxes]
    for inner in graph.open_paths:
        if inner[:-1] == path:
            name = "cluster_" + full_name(inner)
            words = " ".join(box_lines(inner[-1]))
            out.append(f"{indent}subgraph {quoted(name)} {{")
            out.append(f'{indent}  style="filled,rounded"; fillcolor="#F7F7F7"; color="#999999";')
            out.append(f"{indent}  label={quoted(words)};")
            if placed is not None:
                out.append(f"{indent}  {placed.clusters[inner]};")
            out += [*_cluster(graph, inner, style, main, placed, indent + "  "), f"{indent}}}"]
    return out


def _node(box: Box, style: Style, main: bool, placed: Placement | None) -> str:
    name = full_name(box.path)
    attributes = {"id": quoted(name), "tooltip": quoted(style.tooltip(box))}
    if main:
        attributes["group"] = "main"
    if box.kind == "sum":
        attributes |= {"label": '"+"', "shape": "circle", "width": "0.3", "height": "0.3", "fixedsize": "true"}
    elif box.kind in ("input", "output"):
        attributes |= {"label": f"<{signal_html(box.name)}>", "shape": "plaintext", "style": '""'}
        attributes |= {"width": "0.3", "height": "0.3", "margin": '"0.04"'}
    else:
        words = "<BR/>".join(escape(line) for line in box_lines(box.name))
        below = style.second_line(box)
        small = f'<BR/><FONT POINT-SIZE="11" COLOR="#555555">{escape(below)}</FONT>' if below else ""
        attributes["label"] = f"<{words}{small}>"
        if box.kind == "closed":
            attributes["penwidth"] = "2.4"
    if box.kind not in ("input", "output"):
        attributes["fillcolor"] = quoted(style.colour(box))
    fixed = "" if placed is None else f", {placed.nodes[box.path]}"
    return f"{quoted(name)} [{', '.join(f'{k}={v}' for k, v in attributes.items())}{fixed}]"


def _edge(number: int, line: Line, placed: Placement | None) -> str:
    start, end = (quoted(full_name(path)) for path in (line.source, line.target))
    attributes = {}
    if line.signals:
        rows = [", ".join(map(signal_html, row)) for row in signal_rows(line.signals)]
        attributes["label"] = f"< {',<BR/>'.join(rows)} >"
    arrows = (f"{arrow.source_port} -> {arrow.target_port}" for arrow in line.arrows)
    attributes["edgetooltip"] = quoted(", ".join(arrows))
    if line.main:
        attributes["weight"] = "20"
    if line.backward and placed is None:
        attributes["dir"] = "back"
        start, end = end, start
    fixed = "" if placed is None else f", {placed.edges[number]}"
    return f"{start} -> {end} [{', '.join(f'{k}={v}' for k, v in attributes.items())}{fixed}]"
