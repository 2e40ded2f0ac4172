"""Graphviz places the boxes; from there on the arrows are ours, and Graphviz draws what stands where."""

import json
from dataclasses import dataclass

from flipdiagram.drawing.graph import Graph, Names, full_name
from flipdiagram.drawing.layout import Line
from flipdiagram.drawing.routes import GAP, Point, Rectangle, Route, Routes, around, branches, place_name
from flipdiagram.drawing.typography import size_of

ARROW = 7.0
"""Length of an arrowhead [pt]."""


@dataclass(frozen=True)
class Placement:
    """Attributes of DOT that fix boxes, arrows and the names of signals."""

    nodes: dict[Names, str]
    edges: tuple[str, ...]
    clusters: dict[Names, str]
    frame: Rectangle
    branches: tuple[Point, ...]
    """Where lines that begin together part."""


def place(laid_out: bytes, graph: Graph, lines: tuple[Line, ...]) -> Placement:
    """Final places, from the JSON of Graphviz's `dot`, with feedback below the main path."""
    objects = {node["name"]: node for node in json.loads(laid_out).get("objects", ())}
    boxes = {box.path: _box(objects[full_name(box.path)]) for box in graph.boxes}
    corners_of = {path: objects["cluster_" + full_name(path)]["bb"] for path in graph.open_paths}
    areas = {path: Rectangle(*map(float, corners.split(","))) for path, corners in corners_of.items()}
    main, back = _sides(lines)
    heights = [sum(boxes[path].centre[1] for path in side) / len(side) for side in (main, back) if side]
    turned = len(heights) == 2 and heights[1] > heights[0]
    if turned:  # textbooks have feedback below
        boxes = {name: _mirrored(box) for name, box in boxes.items()}
        areas = {name: _mirrored(area) for name, area in areas.items()}
    boxes = _below(boxes, main, back)
    # Graphviz left room for it above, now that is below
    title_at = {name: (a.centre[0], a.bottom + 12.0 if turned else a.top - 12.0) for name, a in areas.items()}
    titles = [Rectangle(x - 40.0, y - 10.0, x + 40.0, y + 10.0) for x, y in title_at.values()]
    sums = {box.path for box in graph.boxes if box.kind == "sum"}
    routes = Routes(boxes, sums, lines, titles).all()
    obstacles = [*boxes.values(), *titles]
    borders = [area.outline for area in areas.values()]
    names: list[Rectangle] = []
    edges = []
    for line, route in zip(lines, routes, strict=True):
        text = f'pos="{_spline(route)}"'
        if line.signals:
            names.append(place_name(route, size_of(line.signals), obstacles, [*routes, *borders], names))
            x, y = names[-1].centre
            text += f', lp="{x:.2f},{y:.2f}"'
        edges.append(text)
    corners = [*boxes.values(), *areas.values(), *names, *(around(p, p) for route in routes for p in route)]
    lefts, bottoms, rights, tops = zip(*corners, strict=True) if corners else ((0.0,),) * 4
    frame = Rectangle(min(lefts), min(bottoms), max(rights), max(tops))
    nodes = {name: 'pos="{:.2f},{:.2f}"'.format(*box.centre) for name, box in boxes.items()}
    clusters = {
        name: 'bb="{:.2f},{:.2f},{:.2f},{:.2f}"; lp="{:.2f},{:.2f}"'.format(*a, *title_at[name])
        for name, a in areas.items()
    }
    return Placement(nodes, tuple(edges), clusters, frame, tuple(branches(routes, lines)))


def _below(boxes: dict[Names, Rectangle], main: list[Names], back: list[Names]) -> dict[Names, Rectangle]:
    """The boxes, those of the feedback that stand above a straight main path moved below it where there is room."""
    heights = [boxes[path].centre[1] for path in main]
    if not main or max(heights) - min(heights) > 1.0:
        return boxes
    names = [path for path in back if len(path) == 1]  # clusters stay as they are
    above = [name for name in names if boxes[name].centre[1] > heights[0]]
    placed = dict(boxes)
    for name in above:
        placed[name] = boxes[name].shifted(2.0 * (heights[0] - boxes[name].centre[1]))
    if above:  # what stood below makes way for them, to leave the way from the plant free
        floor = min(placed[name].bottom for name in above) - 5.0 * GAP
        for name in set(names) - set(above):
            placed[name] = placed[name].shifted(min(0.0, floor - placed[name].top))
    pairs = ((placed[name].grown(2.0 * GAP), box) for name in names for other, box in placed.items() if other != name)
    return boxes if any(box.overlaps(other) for box, other in pairs) else placed


def _sides(lines: tuple[Line, ...]) -> tuple[list[Names], list[Names]]:
    """Boxes of the main path, and those that take or give feedback beside it."""
    main = {path: None for line in lines if line.main for path in (line.source, line.target)}
    back = {path: None for line in lines if line.backward for path in (line.source, line.target) if path not in main}
    return list(main), list(back)


def _box(node: dict) -> Rectangle:
    x, y = map(float, node["pos"].split(","))
    return Rectangle(x, y, x, y).grown(36.0 * float(node["width"]), 36.0 * float(node["height"]))  # half of 72 pt/inch


def _mirrored(area: Rectangle) -> Rectangle:
    return Rectangle(area.left, -area.top, area.right, -area.bottom)


def _spline(route: Route) -> str:
    (ax, ay), (bx, by) = route[-2:]
    length = abs(bx - ax) + abs(by - ay) or 1.0
    cut = min(ARROW, 0.9 * length) / length
    points = [*route[:-1], (bx + cut * (ax - bx), by + cut * (ay - by))]
    out = [f"e,{bx:.2f},{by:.2f}", f"{points[0][0]:.2f},{points[0][1]:.2f}"]
    for a, b in zip(points, points[1:], strict=False):
        out += [f"{x:.2f},{y:.2f}" for x, y in (a, b, b)]
    return " ".join(out)
