"""Which way the arrows of a drawing run: the main path from left to right, feedback from right to left below it."""

from collections.abc import Collection
from dataclasses import dataclass

from flipdiagram.drawing.graph import Arrow, Graph, Names

FEEDBACK = (
    "tool_kinematics",
    "disturbance_observer",
    "encoder",
    "velocity",
    "measured_acceleration",
    "v_noise_sum",
    "position_noise",
    "velocity_noise",
)
"""Boxes of ours on the way back from the plant; no rule could tell them from the boxes of the forward path."""


@dataclass(frozen=True)
class Line:
    """All arrows from one box to another, drawn as one line."""

    source: Names
    target: Names
    signals: tuple[str, ...]
    arrows: tuple[Arrow, ...]
    backward: bool
    """Runs from right to left."""
    main: bool
    """Part of the main path."""

    @property
    def net(self) -> frozenset[str]:
        """The output ports that it comes from; lines of the same ones may share their beginning."""
        return frozenset(arrow.source_port for arrow in self.arrows)


def lines(graph: Graph, feedback: Collection[str] = FEEDBACK) -> tuple[Line, ...]:
    """The lines of a drawing, one for each pair of boxes that arrows join."""
    joined: dict[tuple[Names, Names], list[Arrow]] = {}
    for arrow in graph.arrows:
        joined.setdefault((arrow.source, arrow.target), []).append(arrow)
    back = _backward(graph, list(joined), feedback)
    path = _longest_path(graph, [pair for pair in joined if pair not in back])
    main = set(zip(path, path[1:], strict=False))
    return tuple(
        Line(*pair, _signals(graph, pair, arrows), tuple(arrows), pair in back, pair in main)
        for pair, arrows in joined.items()
    )


def _signals(graph: Graph, pair: tuple[Names, Names], arrows: list[Arrow]) -> tuple[str, ...]:
    """Names on a line, each once.  What leaves a sum has the name; a term of the same name goes without."""
    kind = {box.path: box.kind for box in graph.boxes}
    after = {a.signal for a in graph.arrows if a.source == pair[1]} if kind[pair[1]] == "sum" else set()
    return tuple(dict.fromkeys(a.signal for a in arrows if a.signal and a.signal not in after))


def _backward(graph: Graph, pairs: list[tuple[Names, Names]], feedback: Collection[str]) -> set[tuple[Names, Names]]:
    """What closes a circle, found by following the arrows from the sources; and what feedback boxes take and give."""
    after: dict[Names, list[Names]] = {box.path: [] for box in graph.boxes}
    for source, target in pairs:
        after[source].append(target)
    entered = {target for source, target in pairs if source != target}
    sources = [box.path for box in graph.boxes if box.path not in entered]
    back: set[tuple[Names, Names]] = set()
    done: set[Names] = set()

    def follow(box: Names, trail: frozenset[Names]) -> None:
        done.add(box)
        for target in after[box]:
            if target in trail:
                back.add((box, target))
            elif target not in done:
                follow(target, trail | {target})

    for start in (*sources, *after):
        if start not in done:
            follow(start, frozenset({start}))
    circle = {path for pair in back for path in pair}
    fed = set(after) - set(sources)
    for pair in pairs:
        if any(path[-1] in feedback and path in fed for path in pair) and (pair[0] in entered or pair[0] in circle):
            back.add(pair)
    # a box that takes and gives at the same place stands left of it
    return {(a, b) for a, b in back if not (a[-1] in feedback and (b, a) in back)}


def _longest_path(graph: Graph, pairs: list[tuple[Names, Names]]) -> list[Names]:
    """The longest chain of forward lines; of equal ones that through the boxes added first."""
    rank = {box.path: i for i, box in enumerate(graph.boxes)}
    before: dict[Names, list[Names]] = {path: [] for path in rank}
    for source, target in pairs:
        before[target].append(source)
    best: dict[Names, list[Names]] = {}

    def longest(path: Names) -> list[Names]:
        if path not in best:
            chains = [longest(source) for source in sorted(before[path], key=rank.__getitem__)]
            best[path] = [*max(chains, key=len, default=[]), path]
        return best[path]

    return max((longest(path) for path in rank), key=len, default=[])
