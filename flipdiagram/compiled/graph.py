"""Expressions as a graph without repetition: equal subexpressions, of whatever block, are one node."""

from collections.abc import Callable, Iterable
from functools import partial, reduce
from typing import Any

from pydrake.symbolic import ExpressionKind, FormulaKind

Node = tuple[Any, ...]
"""(operation, operands...); the operands of "constant", "state", "input" and "parameter" are no nodes."""

ATOMS = frozenset({"constant", "time", "state", "input", "parameter"})

_FUNCTIONS = frozenset(
    "Abs Exp Log Sqrt Sin Cos Tan Asin Acos Atan Sinh Cosh Tanh Floor Ceil Div Min Max Atan2".split()
)
_RELATIONS = {"Eq": "eq", "Neq": "ne", "Gt": "gt", "Geq": "ge", "Lt": "lt", "Leq": "le"}


class Unprintable(Exception):
    """An expression or formula of a kind that has no printed form."""


class Graph:
    """Nodes in an order in which operands come first; each is stored once."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._places: dict[Node, int] = {}

    def add(self, *node: Any) -> int:
        """The place of a node, new or known."""
        place = self._places.setdefault(node, len(self.nodes))
        if place == len(self.nodes):
            self.nodes.append(node)
        return place

    def constant(self, value: float) -> int:
        """A number; stored as text, which tells -0.0 from 0.0 and finds nan again."""
        return self.add("constant", repr(float(value)))

    def operands(self, place: int) -> tuple[int, ...]:
        """The nodes a node is computed from."""
        node = self.nodes[place]
        return () if node[0] in ATOMS else node[1:]

    def needed(self, roots: Iterable[int]) -> set[int]:
        """All nodes that ``roots`` are computed from, themselves included."""
        places: set[int] = set()
        waiting = list(roots)
        while waiting:
            place = waiting.pop()
            if place not in places:
                places.add(place)
                waiting.extend(self.operands(place))
        return places


class Translator:
    """Expressions of one block -> nodes of a graph; ``variables`` gives the node of each variable's id."""

    def __init__(self, graph: Graph, variables: Callable[[int], int]) -> None:
        self._graph = graph
        self._variables = variables

    def expression(self, e: Any) -> int:
        """The node of an Expression; raises Unprintable."""
        kind = e.get_kind()
        if kind == ExpressionKind.Constant:
            return self._graph.constant(e.Evaluate())
        if kind == ExpressionKind.Var:
            return self._variables(e.Unapply()[1][0].get_id())
        if kind == ExpressionKind.NaN:
            return self._graph.constant(float("nan"))
        if kind == ExpressionKind.UninterpretedFunction:
            raise Unprintable(f"the uninterpreted function {e}")
        arguments = e.Unapply()[1]
        if kind == ExpressionKind.Add:
            return self._sum(arguments)
        if kind == ExpressionKind.Mul:
            return self._product(arguments)
        if kind == ExpressionKind.IfThenElse:
            condition, yes, no = arguments
            return self._graph.add("select", self.formula(condition), self.expression(yes), self.expression(no))
        if kind == ExpressionKind.Pow:
            return self._power(*arguments)
        if kind.name not in _FUNCTIONS:
            raise Unprintable(f"an expression of kind {kind.name}, {e}")
        return self._graph.add(kind.name.lower(), *map(self.expression, arguments))

    def _sum(self, terms: list[Any]) -> int:
        # Drake's own order: the constant first, then the terms from left to right
        total = None if terms[0] == 0.0 else self._graph.constant(terms[0])
        for term in terms[1:]:
            factors = term.Unapply()[1] if term.get_kind() == ExpressionKind.Mul else [1.0]
            if total is not None and factors[0] == -1.0:
                total = self._graph.add("sub", total, self._product([1.0, *factors[1:]]))
            else:
                place = self.expression(term)
                total = place if total is None else self._graph.add("add", total, place)
        return self._graph.constant(0.0) if total is None else total

    def _product(self, factors: list[Any]) -> int:
        sign = factors[0]
        places = [] if abs(sign) == 1.0 else [self._graph.constant(sign)]
        total = reduce(partial(self._graph.add, "mul"), [*places, *map(self.expression, factors[1:])])
        return self._graph.add("neg", total) if sign == -1.0 else total

    def _power(self, base: Any, exponent: Any) -> int:
        place = self.expression(base)
        constant = exponent.Evaluate() if exponent.get_kind() == ExpressionKind.Constant else None
        if constant in (2.0, 3.0):  # x * x was what the block wrote, and costs a fiftieth of pow
            square = self._graph.add("mul", place, place)
            return square if constant == 2.0 else self._graph.add("mul", square, place)
        return self._graph.add("pow", place, self.expression(exponent))

    def formula(self, f: Any) -> int:
        """The node of a Formula; raises Unprintable."""
        kind = f.get_kind()
        if kind in (FormulaKind.True_, FormulaKind.False_):
            return self._graph.add("constant", str(kind == FormulaKind.True_))
        if kind.name in _RELATIONS:
            return self._graph.add(_RELATIONS[kind.name], *map(self.expression, f.Unapply()[1]))
        if kind == FormulaKind.Isnan:
            return self._graph.add("isnan", self.expression(f.Unapply()[1][0]))
        if kind == FormulaKind.Not:
            return self._graph.add("not", self.formula(f.Unapply()[1][0]))
        if kind in (FormulaKind.And, FormulaKind.Or):
            return reduce(partial(self._graph.add, kind.name.lower()), map(self.formula, f.Unapply()[1]))
        raise Unprintable(f"a formula of kind {kind.name}, {f}")
