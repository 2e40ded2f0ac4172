"""Graph → Mermaid flowchart, which GitHub and notebooks draw themselves."""

from flipdiagram.drawing.graph import Box, Graph, Names
from flipdiagram.drawing.layout import Line
from flipdiagram.drawing.style import Style


def to_mermaid(graph: Graph, lines: tuple[Line, ...], style: Style, title: str | None) -> str:
    """The drawing as a Mermaid `flowchart LR`; boxes go by b0, b1, …, for names such as `end` are reserved."""
    ids = {box.path: f"b{i}" for i, box in enumerate(graph.boxes)}
    out = [] if title is None else ["---", f"title: {_yaml(title)}", "---"]
    out += ["flowchart LR", *_subgraph(graph, (), ids, style, "  ")]
    for line in lines:
        label = f'|"{_text(", ".join(line.signals))}"|' if line.signals else ""
        out.append(f"  {ids[line.source]} -->{label} {ids[line.target]}")
    colours: dict[str, list[str]] = {}
    for box in graph.boxes:
        if box.kind not in ("input", "output"):
            colours.setdefault(style.colour(box), []).append(ids[box.path])
    out += [f"  style {name} fill:{fill},stroke:#333333,color:#000000" for fill, m in colours.items() for name in m]
    return "\n".join(out) + "\n"


def _subgraph(graph: Graph, path: Names, ids: dict[Names, str], style: Style, indent: str) -> list[str]:
    out = [f"{indent}{_node(box, ids[box.path], style)}" for box in graph.boxes if box.path[:-1] == path]
    for i, inner in enumerate(graph.open_paths):
        if inner[:-1] == path:
            inside = _subgraph(graph, inner, ids, style, indent + "  ")
            out += [f'{indent}subgraph g{i}["{_text(inner[-1])}"]', *inside, f"{indent}end"]
    return out


def _node(box: Box, name: str, style: Style) -> str:
    if box.kind == "sum":
        return f'{name}(("+"))'
    if box.kind in ("input", "output"):
        return f'{name}(["{_text(box.name)}"])'
    below = style.second_line(box)
    text = _text(box.name) + (f"<br/>{_text(below)}" if below else "")
    return f'{name}[["{text}"]]' if box.kind == "closed" else f'{name}["{text}"]'


def _text(text: str) -> str:
    """Text inside quotes; Mermaid's entities begin with a # and have no &."""
    out = text.replace("#", "#35;").replace('"', "#quot;").replace("<", "#lt;").replace(">", "#gt;")
    return out.replace("&", "#amp;").replace("`", "#96;").replace("\n", " ")


def _yaml(text: str) -> str:
    return "'" + text.replace("'", "''").replace("\n", " ") + "'"
