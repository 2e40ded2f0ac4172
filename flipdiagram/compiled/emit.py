"""Prints a program as the source of one function: a loop over channels around a loop over ticks."""

from __future__ import annotations

from collections import Counter

from flipdiagram.compiled.graph import ATOMS
from flipdiagram.compiled.read import Program
from flipdiagram.compiled.sections import Section, Sections

_LONGEST = 90  # characters of an expression that may still stand inside another

_FORMS = {
    "add": "({} + {})",
    "sub": "({} - {})",
    "mul": "({} * {})",
    "div": "({} / {})",
    "neg": "(-{})",
    # std::min and std::max, which Drake uses, including what they do with nan
    "min": "smaller({}, {})",
    "max": "larger({}, {})",
    "pow": "math.pow({}, {})",
    "atan2": "math.atan2({}, {})",
    "abs": "math.fabs({})",
    "floor": "np.floor({})",
    "ceil": "np.ceil({})",
    "select": "choose({}, {}, {})",
    "eq": "({} == {})",
    "ne": "({} != {})",
    "gt": "({} > {})",
    "ge": "({} >= {})",
    "lt": "({} < {})",
    "le": "({} <= {})",
    "and": "({} & {})",
    "or": "({} | {})",
    "not": "(not {})",
    "isnan": "({0} != {0})",
    **{
        name: f"math.{name}({{}})"
        for name in ("exp", "log", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")
    },
}

_HEAD = """# A Drake diagram as one loop, printed by flipdiagram.compiled; its arguments are described in print_source.
import math

import numpy as np

inf, nan = math.inf, math.nan


def choose(condition, yes, no):
    return yes if condition else no


def smaller(a, b):
    return b if b < a else a


def larger(a, b):
    return b if a < b else a


def kernel(
    first, last, ticks, start, state, states, parameter, stride, series, span, inputs, held,
    every, signal, signals, column, log, rows, width
):
    for c in range(first, last):
"""


def print_source(program: Program) -> str:
    """The source of ``kernel``, plain Python on flat arrays.

    Channels ``first`` to ``last`` (exclusive) advance from tick ``start[c]`` by ``ticks[c]`` updates. ``state``
    (channels, ``states``) is overwritten. ``parameter``: rows ``stride`` apart, 0 where all channels share one.
    ``series`` (channels, ``held`` + 1, ``inputs``): channels ``span`` apart, the last row held.
    Before the update of every ``every``-th tick, and after the last update if its turn comes then, all outputs and
    states go to ``signal`` (channels, ``signals``), and of them those that ``column`` (``width``) names, to a row of
    ``log`` (channels, ``rows``, ``width``).
    """
    return _HEAD + "".join(f"{'    ' * depth}{line}\n" for depth, line in _Printer(program).lines())


class _Printer:
    """Every node used more than once, or too long, gets a name; what depends on parameters alone, before the loop."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._nodes = program.graph.nodes
        self._text: dict[int, str] = {}
        self._sections = Sections(program)
        graph, section, roots = program.graph, self._sections.of, {*program.update, *program.outputs}
        self._uses = Counter(program.update) + Counter(program.outputs)
        for i in self._sections.order:
            twice = 2 if self._nodes[i][0] == "isnan" else 1
            for operand in graph.operands(i):
                # across a border of sections nothing is written in place
                self._uses[operand] += twice if section(operand) == section(i) else 2
        self._uses.update(self._sections.fixed & roots)

    def _named(self, section: Section) -> list[str]:
        lines = []
        for i in self._sections.members(section):
            node = self._nodes[i]
            text = _FORMS[node[0]].format(*map(self._read, node[1:]))
            if self._uses[i] > 1 or len(text) > _LONGEST:
                lines.append(f"v{i} = {text.removeprefix('(').removesuffix(')') if _enclosed(text) else text}")
                text = f"v{i}"
            self._text[i] = text
        return lines

    def _read(self, i: int) -> str:
        node = self._nodes[i]
        if node[0] == "constant":
            return f"({node[1]})" if node[1].startswith("-") else str(node[1])
        if node[0] == "time":
            return "t"
        return f"{node[0][0]}{node[1]}" if node[0] in ATOMS else self._text[i]

    def lines(self) -> list[tuple[int, str]]:
        """(depth, line) of the body of the loop over channels."""
        program = self._program
        states = range(len(program.update))
        lines = [(2, f"p{i} = parameter[c * stride + {i}]") for i in self._sections.used("parameter")]
        lines += [(2, line) for line in self._named("channel")]
        lines += [(2, f"s{i} = state[c * states + {i}]") for i in states]
        lines += [(2, "last_tick, row, due = ticks[c], 0, 0 if rows > 0 else -1"), (2, "first_tick = start[c]")]
        lines += [(2, "for k in range(last_tick + 1):")]
        if self._sections.has_time():
            # Drake's own expression for the time of a sample
            lines += [(3, f"t = {program.offset!r} + (first_tick + k) * {program.period!r}")]
        if self._sections.used("input"):
            lines += [(3, "j = c * span + min(k, held) * inputs")]
            lines += [(3, f"i{i} = series[j + {i}]") for i in self._sections.used("input")]
        lines += [(3, line) for line in self._named("tick")]
        lines += [(3, "if k == due:")]
        lines += [(4, line) for line in self._named("row")]
        values = [self._read(i) for i in program.outputs] + [f"s{i}" for i in states]
        lines += [(4, f"signal[c * signals + {i}] = {value}") for i, value in enumerate(values)]
        lines += [(4, "place = (c * rows + row) * width"), (4, "for i in range(width):")]
        lines += [(5, "log[place + i] = signal[c * signals + column[i]]")]
        lines += [(4, "row += 1"), (4, "due = due + every if row < rows else -1")]
        lines += [(3, "if k == last_tick:"), (4, "break")]
        moving = [i for i in states if self._nodes[program.update[i]] != ("state", i)]
        lines += [(3, f"n{i} = {self._read(program.update[i])}") for i in moving]
        lines += [(3, f"s{i} = n{i}") for i in moving]
        lines += [(2, f"state[c * states + {i}] = s{i}") for i in moving]
        return lines


def _enclosed(text: str) -> bool:
    """Whether the first parenthesis closes at the very end."""
    depth = 0
    for i, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return i == len(text) - 1 and text[0] == "("
    return False
