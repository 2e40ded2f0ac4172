"""Exact linearisation: the chain rule through the program, by Drake, then poles and frequency response in z."""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pydrake.math as scalar_math
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd

from flipdiagram.arrays import Complex, Floats, Indices
from flipdiagram.compiled.layout import Layout
from flipdiagram.compiled.read import Program
from flipdiagram.errors import InputError, MissingProgramError


def _power(a: Any, b: Any) -> Any:
    """The power a^b; Drake has none whose exponent depends on the state."""
    return scalar_math.exp(b * scalar_math.log(a)) if b.derivatives().any() else scalar_math.pow(a, b.value())


# of AutoDiffXd; what is not named here has its name from pydrake.math
_OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "pow": _power,
    "abs": lambda x: x * float(np.sign(x.value())),
    "min": lambda a, b: b if b < a else a,
    "max": lambda a, b: b if a < b else a,
    "select": lambda condition, yes, no: yes if condition else no,
    **{name: getattr(operator, name) for name in ("eq", "ne", "gt", "ge", "lt", "le")},
    "and": operator.and_,
    "or": operator.or_,
    "not": operator.not_,
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
    n, point = state.size, np.concatenate([state, inputs])
    zero = np.zeros(point.size)
    moving = [AutoDiffXd(value, slope) for value, slope in zip(point, np.eye(point.size), strict=True)]
    atoms = {"parameter": [AutoDiffXd(value, zero) for value in parameters], "state": moving[:n], "input": moving[n:]}
    atoms["time"] = [AutoDiffXd(program.offset + tick * program.period, zero)]
    values: dict[int, Any] = {}
    roots = [*program.update, *program.outputs]
    for i in sorted(program.graph.needed(roots)):
        operation, *rest = program.graph.nodes[i]
        if operation == "constant":
            values[i] = rest[0] == "True" if rest[0] in ("True", "False") else AutoDiffXd(float(rest[0]), zero)
        elif operation in atoms:
            values[i] = atoms[operation][rest[0] if rest else 0]
        else:
            values[i] = _evaluated(operation, [values[j] for j in rest])
    rows = np.array([values[i].derivatives() for i in roots]).reshape(len(roots), point.size)
    names = (tuple(names.elements()) for names in (layout.states, layout.inputs, layout.outputs))
    return Linearization(rows[:n, :n], rows[:n, n:], rows[n:, :n], rows[n:, n:], program.period, *names)


def _evaluated(operation: str, operands: list[Any]) -> Any:
    """The value of a node with its gradient by (state, inputs), or whether a relation holds."""
    result = (_OPERATIONS.get(operation) or getattr(scalar_math, operation))(*operands)
    if isinstance(result, bool):
        return result
    depends = np.any([operand.derivatives() for operand in operands if isinstance(operand, AutoDiffXd)], axis=0)
    if not isinstance(result, AutoDiffXd):  # floor and ceil, which have no slope
        return AutoDiffXd(result, 0.0 * depends)
    # an infinite slope of something that does not depend on the state is no nan
    return AutoDiffXd(result.value(), np.where(depends, result.derivatives(), 0.0))
