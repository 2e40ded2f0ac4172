"""Prints a program as LLVM's own language: eight channels advance together, each operation on a vector of eight lanes.

Not left to a compiler that may or may not vectorise a loop: the vectors are written down.  The shape of the kernel::

    for eight channels at a time:
        load parameters, states and numbers of ticks
        for k = 0, 1, ... up to the longest of them:
            compute the next states, and where a row is due the outputs, and write the row
            take over the next states, in the lanes that have not ended
        store the states
"""

from collections.abc import Iterable

from llvmlite import ir  # type: ignore[import-untyped]

from flipdiagram.compiled.functions import exponential, hyperbolic_tangent, sine_and_cosine
from flipdiagram.compiled.graph import ATOMS
from flipdiagram.compiled.read import Program
from flipdiagram.compiled.vectors import (
    BITS,
    DOUBLE,
    DOUBLES,
    INTEGER,
    INTEGERS,
    LANE_NUMBERS,
    LANES,
    POINTER,
    Value,
    VectorBuilder,
    number,
    whole,
)

ARGUMENTS = {
    **dict.fromkeys(("first", "last", "channels"), INTEGER),
    **dict.fromkeys(("ticks", "start", "state", "parameters", "inputs"), POINTER),
    **dict.fromkeys(("pitch", "stride", "held", "every"), INTEGER),
    **dict.fromkeys(("columns", "log"), POINTER),
    **dict.fromkeys(("width", "rows"), INTEGER),
}
"""What ``kernel`` is called with; see ``kernel_source``."""

_OPERATIONS = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv", "neg": "fneg", "not": "not_"}
_OPERATIONS |= {"and": "and_", "or": "or_", "select": "select"}
_RELATIONS = {"eq": "==", "gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_INTRINSICS = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "ceil": "ceil"}
_OWN = frozenset({"sin", "cos", "exp", "tanh"})


def kernel_source(program: Program, exact: bool) -> str:
    """The text of ``kernel``: channels ``first`` to ``last`` (exclusive) of ``channels`` advance.

    ``ticks``, ``start`` (channels,): from tick ``start`` by so many updates. In all arrays the channel comes last, so
    eight neighbours are one vector: ``state`` (states, channels), overwritten; ``parameters`` (m, channels); ``inputs``
    (inputs, ``held`` + 1, ``pitch``), the last row held, channels ``stride`` apart: 0 where all share eight equal ones.
    Before the update of every ``every``-th tick, and after the last update if its turn comes then, those outputs and
    states, in one row, that ``columns`` (``width``,) names go to ``log`` (``rows``, ``width``, channels).

    Every operation rounds as Drake's does, and in its order.  sin, cos, exp and tanh are the C library's, as Drake's
    are, if ``exact``; else our own, except of what depends on parameters alone.
    """
    return _Printer(program, exact).text()


class _Printer:
    def __init__(self, program: Program, exact: bool) -> None:
        self._program, self._exact = program, exact
        self._nodes = program.graph.nodes
        graph, roots = program.graph, {*program.update, *program.outputs}
        self._order = sorted(graph.needed(roots))
        self._in_tick = graph.needed(program.update)
        self._constant: set[int] = set()
        """Nodes that depend on parameters alone: computed once for all ticks."""
        for i in self._order:
            operands = graph.operands(i)
            if self._nodes[i][0] in ("constant", "parameter") or (operands and self._constant.issuperset(operands)):
                self._constant.add(i)
        function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), ARGUMENTS.values()), "kernel")
        self._given: dict[str, Value] = dict(zip(ARGUMENTS, function.args, strict=True))
        self._builder = VectorBuilder(function.append_basic_block("entry"))
        self._values: dict[int, Value] = {}
        self._pairs: dict[int, tuple[Value, Value]] = {}

    def text(self) -> str:
        """The whole module."""
        b, given = self._builder, self._given
        size = ir.Constant(INTEGER, len(self._program.outputs) + len(self._program.update))
        signals = b.bitcast(b.alloca(DOUBLES, size), POINTER)
        with b.counting(given["first"], given["last"], LANES) as channel:
            self._eight_channels(channel, signals)
        b.ret_void()
        return str(b.module)

    def _eight_channels(self, channel: Value, signals: Value) -> None:
        """All ticks of the channels from ``channel`` on; lanes beyond the last channel never move."""
        b, given, n = self._builder, self._given, self._given["channels"]
        inside = b.icmp_signed("<", b.add(b.spread(channel), LANE_NUMBERS), b.spread(n))
        length = b.load_lanes(INTEGERS, b.at(given["ticks"], channel), inside, whole(0))
        start = b.sitofp(b.load_lanes(INTEGERS, b.at(given["start"], channel), inside), DOUBLES)
        places = [b.at(given["state"], channel, i, n) for i in range(len(self._program.update))]
        begin = [b.load_lanes(DOUBLES, place, inside) for place in places]
        for i, place in self._atoms("parameter"):
            self._values[i] = b.load_lanes(DOUBLES, b.at(given["parameters"], channel, place, n), inside)
        self._compute(i for i in self._order if i in self._constant)
        longest = b.call(b.external(f"llvm.vector.reduce.smax.v{LANES}i64", INTEGER, INTEGERS), [length])

        before, tick, after = b.block, b.append_basic_block("tick"), b.append_basic_block("after")
        b.branch(tick)
        b.position_at_end(tick)
        k, row, *x = b.phi(INTEGER), b.phi(INTEGER), *(b.phi(DOUBLES) for _ in begin)
        self._values |= {i: x[place] for i, place in self._atoms("state")}
        self._time_and_inputs(k, start, channel, inside)
        self._compute(i for i in self._order if i in self._in_tick and i not in self._constant)
        due = b.and_(b.icmp_signed("==", k, b.mul(row, given["every"])), b.icmp_signed("<", row, given["rows"]))
        with b.if_then(due, likely=False):
            reached = b.icmp_signed(">=", length, b.spread(k))
            self._write(row, channel, b.and_(inside, reached), x, signals)
        runs = b.icmp_signed(">", length, b.spread(k))
        following = [b.select(runs, self._read(i), own) for i, own in zip(self._program.update, x, strict=True)]
        zero, one = ir.Constant(INTEGER, 0), ir.Constant(INTEGER, 1)
        begin, following = [zero, zero, *begin], [b.add(k, one), b.add(row, b.zext(due, INTEGER)), *following]
        for phi, first, other in zip([k, row, *x], begin, following, strict=True):
            phi.add_incoming(first, before)
            phi.add_incoming(other, b.block)
        b.cbranch(b.icmp_signed("<", k, longest), tick, after)
        b.position_at_end(after)
        for place, value in zip(places, x, strict=True):
            b.store_lanes(value, place, inside)

    def _time_and_inputs(self, k: Value, start: Value, channel: Value, inside: Value) -> None:
        """Values of time, in Drake's own expression for the time of a sample, and of the inputs at tick ``k``."""
        b, given, program = self._builder, self._given, self._program
        if ("time",) in self._nodes:
            seconds = b.fmul(b.fadd(start, b.spread(b.sitofp(k, DOUBLE))), number(program.period))
            self._values[self._nodes.index(("time",))] = b.fadd(number(program.offset), seconds)
        row = b.select(b.icmp_signed("<", k, given["held"]), k, given["held"])
        rows, shift = b.add(given["held"], ir.Constant(INTEGER, 1)), b.mul(channel, given["stride"])
        for i, place in self._atoms("input"):
            element = b.add(b.mul(ir.Constant(INTEGER, place), rows), row)
            self._values[i] = b.load_lanes(DOUBLES, b.at(given["inputs"], shift, element, given["pitch"]), inside)

    def _write(self, row: Value, channel: Value, inside: Value, states: list[Value], signals: Value) -> None:
        """One row of the log."""
        b, given = self._builder, self._given
        self._compute(i for i in self._order if i not in self._in_tick and i not in self._constant)
        for i, value in enumerate([*map(self._read, self._program.outputs), *states]):
            b.store(value, b.gep(signals, [ir.Constant(INTEGER, i)], source_etype=DOUBLES))
        with b.counting(ir.Constant(INTEGER, 0), given["width"]) as column:
            signal = b.load(b.at(given["columns"], column), typ=INTEGER)
            value = b.load(b.gep(signals, [signal], source_etype=DOUBLES), typ=DOUBLES)
            element = b.add(b.mul(row, given["width"]), column)
            b.store_lanes(value, b.at(given["log"], channel, element, given["channels"]), inside)

    def _atoms(self, kind: str) -> list[tuple[int, int]]:
        """(node, place) of the states, inputs or parameters that are read."""
        return [(i, self._nodes[i][1]) for i in self._order if self._nodes[i][0] == kind]

    def _compute(self, nodes: Iterable[int]) -> None:
        for i in nodes:
            kind, *operands = self._nodes[i]
            if kind not in ATOMS:
                own = kind in _OWN and not self._exact and i not in self._constant
                self._values[i] = self._own(kind, *operands) if own else self._operation(kind, *operands)

    def _read(self, i: int) -> Value:
        kind, *rest = self._nodes[i]
        if kind != "constant":
            return self._values[i]
        return ir.Constant(BITS, rest[0] == "True") if rest[0] in ("True", "False") else number(float(rest[0]))

    def _own(self, kind: str, operand: int) -> Value:
        b, x = self._builder, self._read(operand)
        if kind == "exp":
            return exponential(b, x)
        if kind == "tanh":
            return hyperbolic_tangent(b, x)
        if operand not in self._pairs:
            self._pairs[operand] = sine_and_cosine(b, x)
        return self._pairs[operand][kind == "cos"]

    def _operation(self, kind: str, *operands: int) -> Value:
        b, values = self._builder, [self._read(i) for i in operands]
        if kind in _OPERATIONS:
            return getattr(b, _OPERATIONS[kind])(*values)
        if kind in _RELATIONS:
            return b.fcmp_ordered(_RELATIONS[kind], *values)
        if kind == "ne":
            return b.fcmp_unordered("!=", *values)
        if kind == "isnan":
            return b.fcmp_unordered("uno", values[0], values[0])
        if kind in ("min", "max"):  # std::min and std::max, which Drake uses, including what they do with nan
            one, other = values
            return b.select(b.fcmp_ordered("<", *((other, one) if kind == "min" else (one, other))), other, one)
        if kind in _INTRINSICS:
            return b.intrinsic(_INTRINSICS[kind], *values)
        return b.by_lane(kind, *values)
