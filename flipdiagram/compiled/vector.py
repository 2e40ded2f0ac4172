"""Prints a program as LLVM's own language: W channels advance together, each operation on a vector of W lanes.

Not left to a compiler that may or may not vectorise a loop: the vectors are written down.  The shape of the kernel:

    for each W channels:  copy states and parameters, lane by lane, into vectors
        until the longest of them ends:
            ticks, without any question asked, up to the next event: the shortest that still runs ends, or a row is due
            event: write the row of the log, store the states of the channels that end here

A channel that has ended goes on, unseen, until the last of its neighbours ends; surplus lanes repeat the last channel.
"""

from __future__ import annotations

from flipdiagram.compiled.read import Program
from flipdiagram.compiled.sections import Section, Sections
from flipdiagram.compiled.vector_frame import FRAME
from flipdiagram.compiled.vector_math import exponential, hyperbolic_tangent, sine_and_cosine
from flipdiagram.compiled.vector_text import LANES, VectorText, number

_OPERATIONS = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_RELATIONS = {"eq": "oeq", "ne": "une", "gt": "ogt", "ge": "oge", "lt": "olt", "le": "ole"}
_INTRINSICS = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "ceil": "ceil"}
_OWN = frozenset({"sin", "cos", "exp", "tanh"})
_BY_LANE = frozenset("log tan asin acos atan sinh cosh pow atan2".split())


def vector_source(program: Program) -> str:
    """The text of ``kernel``, with the arguments of ``print_source``; it has no use for ``signal``.

    Every operation rounds as Drake's does, and in its order.  Only sin, cos, exp and tanh of what changes from tick to
    tick are our own, so a program without such has the exact kernel's results to the bit in this form too.
    """
    return _Printer(program).module()


class _Printer:
    def __init__(self, program: Program) -> None:
        self._program = program
        self._nodes = program.graph.nodes
        self._sections = Sections(program)
        self._states = range(len(program.update))
        self._moving = [i for i in self._states if self._nodes[program.update[i]] != ("state", i)]
        self._text = VectorText()
        self._names: dict[int, str] = {}
        self._pairs: dict[int, tuple[str, str]] = {}

    def _compute(self, section: Section) -> None:
        for i in self._sections.members(section):
            node = self._nodes[i]
            given = [self._read(operand) for operand in node[1:]]
            if section == "channel" and node[0] in _OWN:  # once for all ticks: as exact as Drake's, at no cost
                self._names[i] = self._text.by_lane(node[0], *given)
            else:
                self._names[i] = self._operation(node[0], *given, key=node[1])

    def _read(self, i: int) -> str:
        node = self._nodes[i]
        if node[0] == "constant":
            return f"splat (i1 {node[1].lower()})" if node[1] in ("True", "False") else number(float(node[1]))
        return self._names[i]

    def _operation(self, kind: str, *given: str, key: int) -> str:
        text = self._text
        if kind in ("sin", "cos"):
            if key not in self._pairs:
                self._pairs[key] = sine_and_cosine(text, given[0])
            return self._pairs[key][kind == "cos"]
        if kind in ("exp", "tanh"):
            return exponential(text, given[0]) if kind == "exp" else hyperbolic_tangent(text, given[0])
        if kind in _OPERATIONS:
            return text.binary(_OPERATIONS[kind], *given)
        if kind in _INTRINSICS:
            return text.intrinsic(_INTRINSICS[kind], *given)
        if kind in _RELATIONS:
            return text.compare(_RELATIONS[kind], *given)
        if kind in _BY_LANE:
            return text.by_lane(kind, *given)
        if kind in ("min", "max"):  # std::min and std::max, which Drake uses, including what they do with nan
            a, b = given
            return text.select(text.compare("olt", *((b, a) if kind == "min" else (a, b))), b, a)
        if kind == "select":
            condition, yes, no = given
            return text.select(condition, yes, no)
        if kind == "neg":
            return text.let(f"fneg {text.doubles} {given[0]}")
        if kind == "isnan":
            return text.compare("uno", given[0], given[0])
        if kind == "not":
            return text.let(f"xor {text.bits} {given[0]}, splat (i1 true)")
        assert kind in ("and", "or"), kind
        return text.let(f"{kind} {text.bits} {given[0]}, {given[1]}")

    def _at(self, kind: str, values: dict[int, str]) -> None:
        """States, inputs or parameters by place."""
        for i in self._sections.order:
            if self._nodes[i][0] == kind:
                self._names[i] = values[self._nodes[i][1]]

    def _tick(self, k: str, states: list[str]) -> None:
        """All of the section "tick" at tick ``k`` from the states given."""
        text, program = self._text, self._program
        self._pairs.clear()
        self._at("state", dict(enumerate(states)))
        if self._sections.has_time():
            count = text.binary("fadd", "%first_tick", text.everywhere(text.let(f"sitofp i64 {k} to double"), "double"))
            time = text.binary("fmul", count, number(program.period))
            time = text.binary("fadd", number(program.offset), time)  # Drake's own expression for the time of a sample
            self._names[self._nodes.index(("time",))] = time
        if used := self._sections.used("input"):
            row = text.let(f"mul i64 {text.let(f'call i64 @llvm.smin.i64(i64 {k}, i64 %held)')}, %inputs")
            lanes = [text.let(f"add i64 %base{lane}, {row}") for lane in range(LANES)]
            values = {}
            for i in used:
                places = [text.let(f"add i64 {place}, {i}") for place in lanes]
                pointers = [text.let(f"getelementptr double, ptr %series, i64 {place}") for place in places]
                values[i] = text.gathered([text.let(f"load double, ptr {pointer}") for pointer in pointers])
            self._at("input", values)
        self._compute("tick")

    def _stored(self, where: str, i: int) -> str:
        return self._text.let(f"getelementptr {self._text.doubles}, ptr {where}, i64 {i}")

    def module(self) -> str:
        """The whole text; the fixed parts are in ``vector_frame``."""
        text, vector = self._text, self._text.doubles
        outputs, states = len(self._program.outputs), self._states
        parameters = self._sections.used("parameter")
        sections: dict[str, str] = {}

        def cut(name: str) -> None:
            sections[name] = "\n".join(text.lines)
            text.lines.clear()

        text.label = "loaded"
        for i in states:
            text.put(f"%x{i}.0 = load {vector}, ptr {self._stored('%own', i)}, align 64")
        self._at(
            "parameter", {i: text.let(f"load {vector}, ptr {self._stored('%par', i)}, align 64") for i in parameters}
        )
        if self._sections.used("input"):
            for lane in range(LANES):
                place = text.let(f"getelementptr i64, ptr %channels, i64 {lane}")
                channel = text.let(f"load i64, ptr {place}")
                text.put(f"%base{lane} = mul i64 {channel}, %span")
        self._compute("channel")
        text.put("br label %segment")
        loaded = text.label
        cut("loaded")

        text.label = "tick"
        self._tick("%k", [f"%x{i}" for i in states])
        after = {i: self._read(self._program.update[i]) if i in self._moving else f"%x{i}" for i in states}
        text.put("%k.next = add i64 %k, 1")
        text.put("%again = icmp slt i64 %k.next, %next")
        text.put("br i1 %again, label %tick, label %event")
        ticked = text.label
        cut("tick")

        text.label = "due.now"
        self._tick("%next", [f"%x{i}.e" for i in states])
        self._compute("row")
        for i, root in enumerate(self._program.outputs):
            text.put(f"store {vector} {self._read(root)}, ptr {self._stored('%sig', i)}, align 64")
        text.put("br label %rows.loop")
        due = text.label
        cut("due")

        for i in states:
            text.put(f"store {vector} %x{i}.e, ptr {self._stored('%own', i)}, align 64")
        cut("store")

        def phis(suffix: str, *sources: tuple[dict[int, str], str]) -> str:
            return "\n".join(
                f"  %x{i}{suffix} = phi {vector} " + ", ".join(f"[ {names[i]}, %{label} ]" for names, label in sources)
                for i in states
            )

        start, segment, event = ({i: f"%x{i}{end}" for i in states} for end in (".0", ".s", ".e"))
        declared = sorted(text.scalar_calls)
        return FRAME.format(
            W=LANES,
            never=2**63 - 1,
            outputs=outputs,
            signals=outputs + len(states),
            parameters=max(parameters, default=-1) + 1,
            **sections,
            segment_phis=phis(".s", (start, loaded), (event, "next.event")),
            tick_phis=phis("", (segment, "segment"), (after, ticked)),
            event_phis=phis(".e", (segment, "segment"), (after, ticked)),
            loaded_label=loaded,
            due_label=due,
            ticked_label=ticked,
            declarations="\n".join(
                f"declare double @{name}({', '.join(['double'] * count)})" for name, count in declared
            ),
        )
