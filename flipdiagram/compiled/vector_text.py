"""Text of LLVM's language for vectors of W lanes, a line at a time."""

from __future__ import annotations

import struct

LANES = 8
"""Channels that advance together: one AVX-512 register, two of AVX2. No result depends on it."""


class VectorText:
    """Lines of a function's body; every operation gets a new name, and ``label`` is the block being written."""

    doubles, integers, bits = f"<{LANES} x double>", f"<{LANES} x i64>", f"<{LANES} x i1>"

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.label = "entry"
        self._count = 0
        self.scalar_calls: set[tuple[str, int]] = set()
        """The C library's functions that are called lane by lane, and how many arguments each has."""

    def put(self, line: str) -> None:
        """An instruction without a result."""
        self.lines.append(f"  {line}")

    def let(self, expression: str) -> str:
        """An instruction with a result; its name."""
        self._count += 1
        self.put(f"%r{self._count} = {expression}")
        return f"%r{self._count}"

    def fresh(self, stem: str) -> str:
        """A label of its own."""
        self._count += 1
        return f"{stem}{self._count}"

    def place(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")
        self.label = label

    def binary(self, operation: str, a: str, b: str) -> str:
        """``fadd`` and its like, of doubles; each rounds once, as in Drake: nothing is contracted or reordered."""
        return self.let(f"{operation} {self.doubles} {a}, {b}")

    def integer(self, operation: str, a: str, b: str) -> str:
        """``and``, ``shl`` and their like, of 64-bit integers."""
        return self.let(f"{operation} {self.integers} {a}, {b}")

    def multiply_add(self, a: str, b: str, c: str) -> str:
        """The sum a b + c with one rounding."""
        return self.intrinsic("fma", a, b, c)

    def intrinsic(self, name: str, *arguments: str) -> str:
        """A function of LLVM's that has instructions for vectors."""
        given = ", ".join(f"{self.doubles} {a}" for a in arguments)
        return self.let(f"call {self.doubles} @llvm.{name}.v{LANES}f64({given})")

    def compare(self, relation: str, a: str, b: str) -> str:
        """Bits: ``olt`` and its like."""
        return self.let(f"fcmp {relation} {self.doubles} {a}, {b}")

    def select(self, condition: str, yes: str, no: str) -> str:
        """Lane by lane."""
        return self.let(f"select {self.bits} {condition}, {self.doubles} {yes}, {self.doubles} {no}")

    def cast(self, operation: str, value: str, source: str, target: str) -> str:
        """``bitcast`` and its like."""
        return self.let(f"{operation} {source} {value} to {target}")

    def lane(self, value: str, lane: int, kind: str | None = None) -> str:
        """One lane as a scalar."""
        return self.let(f"extractelement {kind or self.doubles} {value}, i32 {lane}")

    def gathered(self, scalars: list[str]) -> str:
        """A vector of scalars."""
        vector = "poison"
        for lane, scalar in enumerate(scalars):
            vector = self.let(f"insertelement {self.doubles} {vector}, double {scalar}, i32 {lane}")
        return vector

    def by_lane(self, name: str, *arguments: str) -> str:
        """The C library's function of each lane: no faster than without vectors, and the same to the bit."""
        self.scalar_calls.add((name, len(arguments)))
        found = []
        for lane in range(LANES):
            given = ", ".join(f"double {self.lane(a, lane)}" for a in arguments)
            found.append(self.let(f"call double @{name}({given})"))
        return self.gathered(found)

    def everywhere(self, scalar: str, kind: str = "i64") -> str:
        """A scalar in every lane."""
        whole = f"<{LANES} x {kind}>"
        first = self.let(f"insertelement {whole} poison, {kind} {scalar}, i32 0")
        return self.let(f"shufflevector {whole} {first}, {whole} poison, <{LANES} x i32> zeroinitializer")


def number(value: float) -> str:
    """A double in every lane, to the bit."""
    return f"splat (double 0x{struct.pack('>d', value).hex().upper()})"


def whole(value: int) -> str:
    """A 64-bit integer in every lane."""
    return f"splat (i64 {value})"
