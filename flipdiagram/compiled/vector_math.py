"""sin, cos, exp and tanh of all lanes at once: no branch, no table, each operation an instruction for vectors.

From the true value by 1.6 units in the last place at most (sin, cos), 1 (exp) and 2.5 (tanh), as
tests/compiled/test_vector_math.py measures; sin -0.0 is 0.0. The same on every machine: additions, multiplications
and fused ones, each rounded once, in an order that is fixed.
"""

from __future__ import annotations

import math

from flipdiagram.compiled.vector_text import LANES, VectorText, number, whole

REACH = 2.0**30
"""Largest |x| of our own sin and cos; beyond, and for inf and nan, those of the C library. So all arguments are fine.

n pi/2 is three doubles; with fused operations x - n P1 is exact, and what P3 leaves out is below 1e-39 for such n.
"""
EXP_REACH = 708.0
"""Largest |x| of our own exp: beyond, numbers are infinite or subnormal; there the C library's."""

_PI_HALVES = (
    -float.fromhex("0x1.921fb54442d18p+0"),
    -float.fromhex("0x1.1a62633145c07p-54"),
    float.fromhex("0x1.f1976b7ed8fbcp-110"),
)
_LN2 = (-float.fromhex("0x1.62e42fefa39efp-1"), -float.fromhex("0x1.abc9e3b39803fp-56"))
# Added to |y| < 2^51 and taken away again, it leaves the nearest integer; the sum ends in that integer's bits.
_ROUNDER = 1.5 * 2.0**52
# Minimax on [-pi/4, pi/4], of Sun's fdlibm (k_sin.c, k_cos.c): sin r = r + r^3 S(r^2), cos r = 1 - r^2/2 + r^4 C(r^2).
_SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
# exp r = 1 + r + r^2 E(r) on [-ln 2/2, ln 2/2]: Taylor's, whose next term is 4e-18
_EXP = tuple(1.0 / math.factorial(k) for k in range(2, 14))


def _polynomial(text: VectorText, x: str, coefficients: tuple[float, ...]) -> str:
    total = number(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = text.multiply_add(total, x, number(coefficient))
    return total


def _nearest(text: VectorText, x: str, factor: float) -> tuple[str, str]:
    """The integer nearest to ``factor`` x, as a double, and with its last bits in an integer."""
    sum_ = text.multiply_add(x, number(factor), number(_ROUNDER))
    return text.binary("fsub", sum_, number(_ROUNDER)), text.cast("bitcast", sum_, text.doubles, text.integers)


def sine_and_cosine(text: VectorText, x: str) -> tuple[str, str]:
    """sin x and cos x."""
    n, quadrant = _nearest(text, x, 2.0 / math.pi)
    r = x
    for part in _PI_HALVES:
        r = text.multiply_add(n, number(part), r)
    square = text.binary("fmul", r, r)
    cube, fourth = text.binary("fmul", square, r), text.binary("fmul", square, square)
    sine = text.multiply_add(cube, _polynomial(text, square, _SIN), r)
    cosine = text.multiply_add(square, number(-0.5), number(1.0))
    cosine = text.multiply_add(fourth, _polynomial(text, square, _COS), cosine)
    odd = text.let(f"icmp ne {text.integers} {text.integer('and', quadrant, whole(1))}, zeroinitializer")
    next_quadrant = text.integer("add", quadrant, whole(1))
    found = {
        "sin": _signed(text, text.select(odd, cosine, sine), quadrant),
        "cos": _signed(text, text.select(odd, sine, cosine), next_quadrant),
    }
    sine, cosine = _or_else(text, x, REACH, found)
    return sine, cosine


def _signed(text: VectorText, value: str, quadrant: str) -> str:
    """Minus the value where bit 1 of the quadrant is set."""
    sign = text.integer("and", text.integer("shl", quadrant, whole(62)), whole(-(2**63)))
    bits = text.integer("xor", text.cast("bitcast", value, text.doubles, text.integers), sign)
    return text.cast("bitcast", bits, text.integers, text.doubles)


def _or_else(text: VectorText, x: str, reach: float, found: dict[str, str]) -> list[str]:
    """What was found where |x| <= reach, the C library's elsewhere; lane by lane, so no channel sees another."""
    beyond = text.compare("ugt", text.intrinsic("fabs", x), number(reach))
    any_ = text.let(f"icmp ne i{LANES} {text.cast('bitcast', beyond, text.bits, f'i{LANES}')}, 0")
    before, slow, after = text.label, text.fresh("slow"), text.fresh("after")
    text.put(f"br i1 {any_}, label %{slow}, label %{after}, !prof !0")
    text.place(slow)
    replaced = [text.select(beyond, text.by_lane(name, x), ours) for name, ours in found.items()]
    text.put(f"br label %{after}")
    text.place(after)
    pairs = zip(found.values(), replaced, strict=True)
    return [text.let(f"phi {text.doubles} [ {a}, %{before} ], [ {b}, %{slow} ]") for a, b in pairs]


def _exponential_parts(text: VectorText, x: str) -> tuple[str, str]:
    """(p, s) with exp x = s (1 + p), s a power of two."""
    n, bits = _nearest(text, x, 1.0 / math.log(2.0))
    r = text.multiply_add(n, number(_LN2[1]), text.multiply_add(n, number(_LN2[0]), x))
    p = text.multiply_add(text.binary("fmul", r, r), _polynomial(text, r, _EXP), r)
    exponent = text.integer("shl", text.integer("add", bits, whole(1023)), whole(52))
    return p, text.cast("bitcast", exponent, text.integers, text.doubles)


def exponential(text: VectorText, x: str) -> str:
    """The power e^x."""
    p, scale = _exponential_parts(text, x)
    return _or_else(text, x, EXP_REACH, {"exp": text.multiply_add(p, scale, scale)})[0]


def hyperbolic_tangent(text: VectorText, x: str) -> str:
    """tanh x = e / (e + 2) with e = exp 2|x| - 1; 1 from |x| = 20 on."""
    size = text.intrinsic("fabs", x)
    size = text.select(text.compare("ogt", size, number(20.0)), number(20.0), size)  # nan stays
    p, scale = _exponential_parts(text, text.binary("fadd", size, size))
    e = text.multiply_add(p, scale, text.binary("fsub", scale, number(1.0)))
    return text.intrinsic("copysign", text.binary("fdiv", e, text.binary("fadd", e, number(2.0))), x)
