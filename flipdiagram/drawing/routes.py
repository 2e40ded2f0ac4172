"""Arrows of horizontal and vertical pieces between placed boxes, as textbooks draw them, and places for their names."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from flipdiagram.drawing.graph import Names
from flipdiagram.drawing.layout import Line

Point = tuple[float, float]
"""x to the right, y upwards [pt]."""
Route = tuple[Point, ...]

GAP = 5.0
"""Least distance of parallel pieces of two arrows, and of arrows from boxes they pass [pt]."""
SIDE = (0.0, 6.0, -6.0, 12.0, -12.0)
"""Where arrows may meet a side of a box: distances from its middle [pt]."""
LEVEL = 0.1
"""Distance below which two points, or two heights, are one [pt]."""
USABLE = 0.35
"""Share of a side, to either side of its middle, where an arrow may end: the corners are rounded."""

# What a route costs, in points of length; only the order of magnitude between the groups matters.
# Never, if there is any way round: it would be read wrongly.
THROUGH_A_BOX, ON_ANOTHER_ARROW, SHORT_HEAD, SHORT_TAIL = 1000.0, 300.0, 200.0, 100.0
# Better not: it is read, but with an effort.
THROUGH_TEXT, INTO_A_SUM_FROM_ITS_SIDE, FEEDBACK_ABOVE, CROSSING = 60.0, 40.0, 25.0, 12.0
# Tidiness, between routes that are equally clear: few pieces, short, from the middles of the sides.
PIECE, LENGTH, OFF_CENTRE = 8.0, 1.0 / 20.0, 0.3

# What the place of a name costs: over a name, a box or an arrow it cannot be read; then whose name it is must be clear.
NAME_ON_NAME, NAME_ON_BOX, NAME_ON_ARROW = 1000.0, 500.0, 100.0
PIECE_TOO_SHORT, ON_A_SHARED_PIECE = 80.0, 50.0
# Tidiness: in the middle of a long level piece, above it.
OFF_THE_MIDDLE, BESIDE_AN_UPRIGHT, BELOW, PER_LENGTH, LONG = 60.0, 20.0, 5.0, 1.0 / 10.0, 200.0


class Rectangle(NamedTuple):
    """An area with its sides along the axes."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def centre(self) -> Point:
        """Its middle."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2

    @property
    def outline(self) -> Route:
        """Its sides as one closed route."""
        left, bottom, right, top = self
        return (left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)

    def shifted(self, upwards: float) -> "Rectangle":
        """The same further up."""
        return Rectangle(self.left, self.bottom + upwards, self.right, self.top + upwards)

    def grown(self, across: float, upwards: float | None = None) -> "Rectangle":
        """The same with its sides moved outwards, top and bottom as the others unless told."""
        up = across if upwards is None else upwards
        return Rectangle(self.left - across, self.bottom - up, self.right + across, self.top + up)

    def overlaps(self, other: "Rectangle") -> bool:
        """Whether the two share an area."""
        across = self.left < other.right and other.left < self.right
        return across and self.bottom < other.top and other.bottom < self.top


def around(a: Point, b: Point) -> Rectangle:
    """The rectangle with two opposite corners; flat for a piece of a route."""
    return Rectangle(min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1]))


class Routes:
    """Routes of lines between boxes, each found with regard to all others."""

    def __init__(
        self, boxes: dict[Names, Rectangle], sums: set[Names], lines: Sequence[Line], texts: Sequence[Rectangle]
    ) -> None:
        self._boxes, self._sums, self._lines, self._texts = boxes, sums, lines, texts
        self._main = {end for line in lines if line.main for end in (line.source, line.target)}
        self._lanes = _lanes(boxes.values())
        self._routes: dict[int, Route] = {}
        order = sorted(range(len(lines)), key=lambda i: (not lines[i].main, i))
        for i in (*order, *order):  # the first ones did not know of the later ones
            self._routes.pop(i, None)
            self._routes[i] = self._best(lines[i])

    def all(self) -> list[Route]:
        """The routes in the order of the lines."""
        return [self._routes[i] for i in range(len(self._lines))]

    def _best(self, line: Line) -> Route:
        """Of up to two corners, short, clear of boxes and of the other routes."""
        ways = [(self._length(route, line), i, route) for i, route in enumerate(self._ways(line))]
        least, best = math.inf, None
        for length, _, route in sorted(ways):
            if length >= least:
                break
            cost = self._with_obstacles(length, route, line, least)
            if cost < least:
                least, best = cost, route
        assert best is not None, "some way leads around everything"
        return best

    def _ways(self, line: Line) -> Iterator[Route]:
        a, b = self._boxes[line.source], self._boxes[line.target]
        for i in self._offsets(line.source):
            yield from _straight(a, b, i)
            for j in self._offsets(line.target):
                yield from _bent(a, b, i, j, self._lanes)

    def _offsets(self, name: Names) -> Sequence[float]:
        if name in self._sums:
            return SIDE[:1]
        box = self._boxes[name]
        most = USABLE * min(box.right - box.left, box.top - box.bottom)
        return [offset for offset in SIDE if abs(offset) <= most]

    def _length(self, route: Route, line: Line) -> float:
        """Cost of a route for itself."""
        pieces = list(pairwise(route))
        lengths = [abs(b[0] - a[0]) + abs(b[1] - a[1]) for a, b in pieces]
        cost = PIECE * len(pieces) + LENGTH * sum(lengths)
        cost += SHORT_TAIL * (lengths[0] < GAP) + SHORT_HEAD * (lengths[-1] < 2 * GAP)
        ends = (self._boxes[line.source], route[0]), (self._boxes[line.target], route[-1])
        cost += OFF_CENTRE * sum(_off_centre(box, end) for box, end in ends)
        joins = line.target in self._sums and line.target in self._main and not line.main
        if joins and len(route) > 2 and abs(route[-1][1] - route[-2][1]) < LEVEL:
            cost += INTO_A_SUM_FROM_ITS_SIDE  # terms join the main path from above or below
        highest = max(self._boxes[end].top for end in (line.source, line.target))
        if line.backward and any(y > highest for _, y in route):
            cost += FEEDBACK_ABOVE  # feedback runs below
        return cost

    def _with_obstacles(self, cost: float, route: Route, line: Line, enough: float) -> float:
        """That cost and what is in the way; no further than to `enough`."""
        pieces = [around(*piece) for piece in pairwise(route)]
        for name, box in self._boxes.items():
            by = GAP if name not in (line.source, line.target) else -1.0
            cost += THROUGH_A_BOX * sum(_near(box, piece, by) for piece in pieces)
            if cost >= enough:
                return cost
        cost += THROUGH_TEXT * sum(_near(text, piece, 0.0) for text in self._texts for piece in pieces)
        for i, laid in self._routes.items():
            same = self._lines[i].net == line.net and laid[0] == route[0]
            others = [around(*piece) for piece in pairwise(laid)]
            cost += sum(_conflict(piece, other, same) for piece in pieces for other in others)
            if cost >= enough:
                return cost
        return cost


def branches(routes: Sequence[Route], lines: Sequence[Line]) -> list[Point]:
    """Where lines of one net part."""
    pairs = ((i, k) for i in range(len(routes)) for k in range(i) if lines[k].net == lines[i].net)
    points = (_parting(routes[i], routes[k]) for i, k in pairs)
    return list(dict.fromkeys(point for point in points if point is not None))


def _parting(a: Route, b: Route) -> Point | None:
    """The end of what two routes share from their start; None where they share nothing."""
    if math.dist(a[0], b[0]) > LEVEL:
        return None
    for i, (p, q) in enumerate(zip(a[1:], b[1:], strict=False)):
        if math.dist(p, q) < LEVEL:
            continue
        start = a[i]
        u, v = ((p[0] - start[0], p[1] - start[1]), (q[0] - start[0], q[1] - start[1]))
        if u[0] * v[0] + u[1] * v[1] > 0.0:  # the same way, for different lengths
            return min(p, q, key=lambda end: math.dist(start, end))
        return start if i > 0 else None
    return None


def _lanes(boxes: Iterable[Rectangle]) -> tuple[list[float], list[float]]:
    """The x and y at which arrows may pass between boxes [pt]."""
    xs, ys = set(), set()
    for box in boxes:
        for step in (2.4 * GAP, 4.8 * GAP):
            xs |= {round(box.left - step, 2), round(box.right + step, 2)}
            ys |= {round(box.bottom - step, 2), round(box.top + step, 2)}
    return sorted(xs), sorted(ys)


def _straight(a: Rectangle, b: Rectangle, i: float) -> Iterator[Route]:
    """Level or upright, off the middle of the first box by i, where that meets the second one."""
    x, y = a.centre[0] + i, a.centre[1] + i
    if abs(y - b.centre[1]) <= USABLE * (b.top - b.bottom) and (a.right <= b.left or b.right <= a.left):
        yield ((a.right, y), (b.left, y)) if a.right <= b.left else ((a.left, y), (b.right, y))
    if abs(x - b.centre[0]) <= USABLE * (b.right - b.left) and (a.top <= b.bottom or b.top <= a.bottom):
        yield ((x, a.top), (x, b.bottom)) if a.top <= b.bottom else ((x, a.bottom), (x, b.top))


def _bent(a: Rectangle, b: Rectangle, i: float, j: float, lanes: tuple[list[float], list[float]]) -> Iterator[Route]:
    """Of one or two corners, off the middles of the boxes by i and j."""
    (ax, ay), (bx, by) = (a.centre[0] + i, a.centre[1] + i), (b.centre[0] + j, b.centre[1] + j)
    if not a.left <= bx <= a.right and not b.bottom <= ay <= b.top:
        yield (a.right if bx > ax else a.left, ay), (bx, ay), (bx, b.bottom if ay < by else b.top)
    if not a.bottom <= by <= a.top and not b.left <= ax <= b.right:
        yield (ax, a.top if by > ay else a.bottom), (ax, by), (b.left if ax < bx else b.right, by)
    for x in lanes[0]:
        if not a.left <= x <= a.right and not b.left <= x <= b.right:
            yield (a.right if x > ax else a.left, ay), (x, ay), (x, by), (b.right if x > bx else b.left, by)
    for y in lanes[1]:
        if not a.bottom <= y <= a.top and not b.bottom <= y <= b.top:
            yield (ax, a.top if y > ay else a.bottom), (ax, y), (bx, y), (bx, b.top if y > by else b.bottom)


def place_name(
    route: Route, size: Point, boxes: Iterable[Rectangle], routes: Iterable[Route], names: Sequence[Rectangle]
) -> Rectangle:
    """Where the name of a signal, of this size [pt], stands beside its route: clear of boxes, arrows and other names.

    Where other routes share the beginning it would not tell whose name it is: better further on.
    """
    width, height = size
    areas = [box.grown(1.0) for box in boxes]
    arrows = [around(*piece).grown(1.0) for other in routes for piece in pairwise(other)]
    beside = [other for other in routes if other != route and math.dist(other[0], route[0]) < LEVEL]
    shared = [around(*piece) for other in beside for piece in pairwise(other)]
    best: tuple[float, Rectangle] | None = None
    for (ax, ay), (bx, by) in pairwise(route):
        level = abs(by - ay) < LEVEL
        length = abs(bx - ax) + abs(by - ay)
        for part in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9):
            x, y = ax + part * (bx - ax), ay + part * (by - ay)
            for side in (1, -1):
                middle = (x, y + side * (height / 2 + 1.0)) if level else (x + side * (width / 2 + 4.0), y)
                area = Rectangle(*middle, *middle).grown(width / 2, height / 2)
                cost = NAME_ON_NAME * sum(area.overlaps(other) for other in names)
                cost += NAME_ON_BOX * sum(area.overlaps(other) for other in areas)
                cost += NAME_ON_ARROW * sum(area.overlaps(other) for other in arrows)
                cost += OFF_THE_MIDDLE * abs(part - 0.5) + BELOW * (side < 0) + BESIDE_AN_UPRIGHT * (not level)
                cost -= PER_LENGTH * min(length, LONG)
                cost += PIECE_TOO_SHORT * (length < (width if level else height))
                cost += ON_A_SHARED_PIECE * any(_near(piece, Rectangle(x, y, x, y), LEVEL) for piece in shared)
                if best is None or cost < best[0]:
                    best = (cost, area)
    assert best is not None, "a route has at least one piece"
    return best[1]


def _off_centre(box: Rectangle, end: Point) -> float:
    (x, y) = box.centre
    return min(abs(end[0] - x), abs(end[1] - y))


def _near(box: Rectangle, piece: Rectangle, by: float) -> bool:
    across = box.left - by < piece.right and piece.left < box.right + by
    return across and box.bottom - by < piece.top and piece.bottom < box.top + by


def _conflict(a: Rectangle, b: Rectangle, same: bool) -> float:
    """Two arrows may cross, though better not, and may not run on top of each other unless they are of one net."""
    if not _near(a, b, GAP):
        return 0.0
    a_level, b_level = (piece.top - piece.bottom < LEVEL for piece in (a, b))
    if a_level != b_level:
        return 0.0 if same else CROSSING
    apart = abs(a.top - b.top) if a_level else abs(a.right - b.right)
    return 0.0 if same and apart < LEVEL else ON_ANOTHER_ARROW
