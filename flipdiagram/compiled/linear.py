"""Exact linearisation: the chain rule through the program, then poles and frequency response in z."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Complex, Floats, Indices
from flipdiagram.compiled.layout import Layout
from flipdiagram.compiled.read import Program
from flipdiagram.errors import InputError, MissingProgramError


def _by_exponent(a: Any, b: Any, power: Any) -> Any:
    # log of a negative base is nan, which _times drops where the exponent is constant
    return power * np.log(a) if a > 0.0 else (0.0 if a == 0.0 and b > 0.0 else math.nan)


# f of its operands, and its partial derivatives from the operands and f
_FUNCTIONS: dict[str, tuple[Callable[..., Any], Callable[..., tuple[Any, ...]]]] = {
    "add": (np.add, lambda a, b, f: (1.0, 1.0)),
    "sub": (np.subtract, lambda a, b, f: (1.0, -1.0)),
    "mul": (np.multiply, lambda a, b, f: (b, a)),
    "div": (np.divide, lambda a, b, f: (1.0 / b, -a / (b * b))),
    "pow": (np.power, lambda a, b, f: (b * np.power(a, b - 1.0), _by_exponent(a, b, f))),
    "atan2": (np.arctan2, lambda a, b, f: (b / (a * a + b * b), -a / (a * a + b * b))),
    "neg": (np.negative, lambda x, f: (-1.0,)),
    "abs": (np.abs, lambda x, f: (np.sign(x),)),
    "exp": (np.exp, lambda x, f: (f,)),
    "log": (np.log, lambda x, f: (1.0 / x,)),
    "sqrt": (np.sqrt, lambda x, f: (0.5 / f,)),
    "sin": (np.sin, lambda x, f: (np.cos(x),)),
    "cos": (np.cos, lambda x, f: (-np.sin(x),)),
    "tan": (np.tan, lambda x, f: (1.0 + f * f,)),
    "asin": (np.arcsin, lambda x, f: (1.0 / np.sqrt(1.0 - x * x),)),
    "acos": (np.arccos, lambda x, f: (-1.0 / np.sqrt(1.0 - x * x),)),
    "atan": (np.arctan, lambda x, f: (1.0 / (1.0 + x * x),)),
    "sinh": (np.sinh, lambda x, f: (np.cosh(x),)),
    "cosh": (np.cosh, lambda x, f: (np.sinh(x),)),
    "tanh": (np.tanh, lambda x, f: (1.0 - f * f,)),
    "floor": (np.floor, lambda x, f: (0.0,)),
    "ceil": (np.ceil, lambda x, f: (0.0,)),
}

_RELATIONS: dict[str, Callable[..., Any]] = {
    "eq": np.equal,
    "ne": np.not_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "lt": np.less,
    "le": np.less_equal,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "isnan": np.isnan,
}


@dataclass(frozen=True)
class Linearization:
    """dx[k+1] = A dx[k] + B du[k], dy[k] = C dx[k] + D du[k] about a point; one name per row or column; dt [s]."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    dt: float
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    def poles(self) -> Complex:
        """The eigenvalues of A, largest magnitude first; stable inside the unit circle."""
        z = np.linalg.eigvals(self.A).astype(complex)
        return np.asarray(z[np.argsort(-np.abs(z), kind="stable")])

    def response(
        self, omega: ArrayLike, inputs: Sequence[str] | str | None = None, outputs: Sequence[str] | str | None = None
    ) -> Complex:
        """C (zI - A)^-1 B + D at z = exp(j omega dt), omega [rad/s] (m,): shape (m, outputs, inputs), those named."""
        columns, rows = self._places("input", inputs), self._places("output", outputs)
        frequencies = np.atleast_1d(np.asarray(omega, dtype=float))
        z = np.exp(1j * frequencies * self.dt)[:, None, None]
        b = np.broadcast_to(self.B[:, columns], (frequencies.size, len(self.A), len(columns)))
        states = np.linalg.solve(z * np.eye(len(self.A)) - self.A, b)
        return np.asarray(self.C[rows] @ states + self.D[np.ix_(rows, columns)])

    def to_control(self) -> Any:
        """The same as a ``control.StateSpace`` of python-control, names included."""
        try:
            import control  # type: ignore[import-untyped,import-not-found,unused-ignore]
        except ImportError:
            raise MissingProgramError(
                "to_control() needs python-control, which is not installed; install it with: pip install control"
            ) from None
        names = {"inputs": self.input_names, "outputs": self.output_names, "states": self.state_names}
        labels = {key: [name.replace(".", "_") for name in value] for key, value in names.items() if value}
        return control.StateSpace(self.A, self.B, self.C, self.D, self.dt, remove_useless_states=False, **labels)

    def _places(self, kind: str, names: Sequence[str] | str | None) -> Indices:
        """Places of names; one without "[i]" stands for all its elements."""
        known = self.input_names if kind == "input" else self.output_names
        if names is None:
            return np.arange(len(known))
        places: list[int] = []
        for name in (names,) if isinstance(names, str) else names:
            elements = [i for i, k in enumerate(known) if k == name or k.rpartition("[")[0] == name]
            if not elements:
                message = f"unknown {kind} '{name}'; choose from {', '.join(known) or 'none: there are none'}"
                raise InputError(message, field=kind, value=name, valid=known)
            places += elements
        return np.array(places, dtype=np.int64)


def linearize(
    program: Program, layout: Layout, parameters: Floats, state: Floats, inputs: Floats, tick: int
) -> Linearization:
    """The Jacobians of update and outputs by state and inputs at one point; see ``CompiledDiagram.linearize``."""
    n, time = state.size, np.float64(program.offset + tick * program.period)
    rows = _gradients(program, {"parameter": parameters, "state": state, "input": inputs}, time)
    names = (tuple(names.elements()) for names in (layout.states, layout.inputs, layout.outputs))
    return Linearization(rows[:n, :n], rows[:n, n:], rows[n:, :n], rows[n:, n:], program.period, *names)


def _gradients(program: Program, given: dict[str, Floats], time: Any) -> Floats:
    """Gradients of next state and outputs by (state, inputs), a row each: forward through the program."""
    states, width = given["state"].size, given["state"].size + given["input"].size
    zero, identity = np.zeros(width), np.eye(width)
    values: dict[int, Any] = {}
    gradients: dict[int, Any] = {}
    roots = [*program.update, *program.outputs]
    with np.errstate(all="ignore"):
        for i in sorted(program.graph.needed(roots)):
            operation, *rest = program.graph.nodes[i]
            value, gradient = time, zero
            if operation == "constant":
                value = rest[0] == "True" if rest[0] in ("True", "False") else np.float64(rest[0])
            elif operation in given:
                value = given[operation][rest[0]]
                if operation != "parameter":
                    gradient = identity[rest[0] + (states if operation == "input" else 0)]
            elif operation in _RELATIONS:
                value = _RELATIONS[operation](*(values[j] for j in rest))
            elif operation in ("select", "min", "max"):
                if operation == "select":
                    taken = rest[1] if values[rest[0]] else rest[2]
                else:
                    a, b = (values[j] for j in rest)
                    taken = rest[1] if (b < a if operation == "min" else a < b) else rest[0]
                value, gradient = values[taken], gradients[taken]
            elif operation != "time":
                function, slopes = _FUNCTIONS[operation]
                operands = [values[j] for j in rest]
                value = function(*operands)
                partials = zip(slopes(*operands, value), rest, strict=True)
                gradient = sum((_times(slope, gradients[j]) for slope, j in partials), zero)
            values[i], gradients[i] = value, gradient
    return np.array([gradients[i] for i in roots]).reshape(len(roots), width)


def _times(slope: Any, gradient: Floats) -> Floats:
    # an infinite slope of something that does not depend on the state is no nan
    return np.where(gradient == 0.0, 0.0, slope * gradient)
