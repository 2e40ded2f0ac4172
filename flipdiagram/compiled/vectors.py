"""LLVM instructions on vectors of eight lanes, one for each channel."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]

LANES = 8
"""Channels that advance together: one AVX-512 register, two of AVX2. No result depends on it."""
DOUBLE, INTEGER, BIT, POINTER = ir.DoubleType(), ir.IntType(64), ir.IntType(1), ir.PointerType()
DOUBLES, INTEGERS, BITS = (ir.VectorType(kind, LANES) for kind in (DOUBLE, INTEGER, BIT))
LANE_NUMBERS = ir.Constant(INTEGERS, list(range(LANES)))
Value = Any
"""An operand or a result: of LLVM's types above."""


def number(value: float) -> Value:
    """A double in every lane, to the bit."""
    return ir.Constant(DOUBLES, value)


def whole(value: int) -> Value:
    """A 64-bit integer in every lane."""
    return ir.Constant(INTEGERS, value)


class VectorBuilder(ir.IRBuilder):  # type: ignore[misc]
    """LLVM's builder for vectors; ``fadd`` and its like round once: nothing is contracted or reordered."""

    def external(self, name: str, result: Any, *arguments: Any) -> Value:
        """A function from outside, declared once."""
        known = self.module.globals.get(name)
        return known or ir.Function(self.module, ir.FunctionType(result, arguments), name)

    def intrinsic(self, name: str, *arguments: Value) -> Value:
        """A function of LLVM's from doubles to doubles that has instructions for vectors."""
        kinds = [argument.type for argument in arguments]
        return self.call(self.external(f"llvm.{name}.v{LANES}f64", DOUBLES, *kinds), arguments)

    def multiply_add(self, a: Value, b: Value, c: Value) -> Value:
        """The sum a b + c with one rounding."""
        return self.intrinsic("fma", a, b, c)

    def by_lane(self, name: str, *arguments: Value) -> Value:
        """The C library's function of each lane: no faster than without vectors, and the same to the bit."""
        function = self.external(name, DOUBLE, *(DOUBLE for _ in arguments))
        function.attributes.add("readnone")  # LLVM may join sin and cos of one argument; the bits are the same
        result = ir.Constant(DOUBLES, ir.Undefined)
        for lane in range(LANES):
            place = ir.Constant(INTEGER, lane)
            value = self.call(function, [self.extract_element(argument, place) for argument in arguments])
            result = self.insert_element(result, value, place)
        return result

    def spread(self, scalar: Value) -> Value:
        """A scalar in every lane."""
        vector = ir.VectorType(scalar.type, LANES)
        first = self.insert_element(ir.Constant(vector, ir.Undefined), scalar, ir.Constant(INTEGER, 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self.shuffle_vector(first, ir.Constant(vector, ir.Undefined), zeros)

    def at(self, array: Value, place: Value, row: Value | int = 0, pitch: Value | None = None) -> Value:
        """The address of the element row pitch + place of numbers in memory, of eight bytes each."""
        if pitch is not None:
            row = ir.Constant(INTEGER, row) if isinstance(row, int) else row
            place = self.add(self.mul(row, pitch), place)
        return self.gep(array, [place], source_etype=DOUBLE)

    def load_lanes(self, kind: Any, address: Value, inside: Value, outside: Value | None = None) -> Value:
        """Eight neighbours in memory; where a lane is not inside, ``outside``, or else what the first lane has."""
        suffix = "f64" if kind is DOUBLES else "i64"
        if outside is None:
            outside = self.spread(self.load(address, typ=kind.element))
        align = ir.Constant(ir.IntType(32), 8)
        load = self.external(f"llvm.masked.load.v{LANES}{suffix}.p0", kind, POINTER, align.type, BITS, kind)
        return self.call(load, [address, align, inside, outside])

    def store_lanes(self, value: Value, address: Value, inside: Value) -> None:
        """Keep doubles in memory, of the lanes inside."""
        align = ir.Constant(ir.IntType(32), 8)
        store = self.external(f"llvm.masked.store.v{LANES}f64.p0", ir.VoidType(), DOUBLES, POINTER, align.type, BITS)
        self.call(store, [value, address, align, inside])

    @contextmanager
    def counting(self, first: Value, last: Value, step: int = 1) -> Iterator[Value]:
        """The loop ``for i in range(first, last, step)``; the body is what is built inside."""
        before = self.block
        head, body, after = (self.append_basic_block() for _ in range(3))
        self.branch(head)
        self.position_at_end(head)
        i = self.phi(INTEGER)
        i.add_incoming(first, before)
        self.cbranch(self.icmp_signed("<", i, last), body, after)
        self.position_at_end(body)
        yield i
        i.add_incoming(self.add(i, ir.Constant(INTEGER, step)), self.block)
        self.branch(head)
        self.position_at_end(after)
