"""The laws of a Program as one compiled function: the very functions of the blocks, called from a printed one.

numba keeps machine code beside a source and forgets it when that one file changes.  So each function is told that it
stands in a file of the cache folder, named by the digest of all the sources that it and those that it calls come from.
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Callable, Set
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.blocks._scalars import OVER_FLOATS
from flipdiagram.errors import InputError
from flipdiagram.files import cache_folder, write_atomically
from flipdiagram.robot.jit import jit

if TYPE_CHECKING:
    from flipdiagram.diagrams.fused import Program


SIGNS = {operator.add: " + ", operator.mul: " * "}
_loaded: dict[Path, Any] = {}


class NotPrintable(Exception):
    """A law is no plain function, or takes what is neither number nor array."""


class Printer:
    """Writes the lines of the function, and collects what they name and the numbers that they take.

    Attributes: lines; names, the laws and classes; numbers, one after another; files, where the laws stand.
    """

    def __init__(self, program: Program) -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {}
        self.numbers: list[float] = []
        self.files: set[str] = set()
        self._known: dict[int, str] = {}
        self._values = program.values
        for k in range(len(program.given)):  # sizes are no part of the text: delays of any length share it
            self.lines.append(f"v{k} = given[ends[{k}]:ends[{k + 1}]]")
        for law, arguments, result in program.steps:
            terms = [self._value(k) for k in arguments]
            if isinstance(law, int):
                value = f"{terms[0]}[{law}]"
            elif law in SIGNS:
                value = SIGNS[law].join(terms)
            else:
                if isinstance(law, partial):
                    terms[:0] = map(self._constant, law.args)
                    law = law.func
                value = f"{self._law(law)}({', '.join(terms)})"
            self.lines.append(f"v{result} = {value}")
        self.lines.append(f"return np.concatenate(({', '.join(f'v{k}' for k in program.results)},))")

    @property
    def text(self) -> str:
        """The source of the function `compute(given, ends, numbers)`."""
        return "\n    ".join(["def compute(given, ends, numbers):", *self.lines]) + "\n"

    def _value(self, k: int) -> str:
        return f"v{k}" if self._values[k] is None else self._constant(self._values[k])

    def _constant(self, value: Any) -> str:
        """The name of what stands for the same numbers throughout."""
        if id(value) not in self._known:
            name = self._known[id(value)] = f"c{len(self._known)}"
            self.lines.append(f"{name} = {self._printed(value)}")
        return self._known[id(value)]

    def _printed(self, value: Any) -> str:
        first = len(self.numbers)
        if isinstance(value, bool | int):
            return repr(value)
        if isinstance(value, float):
            self.numbers.append(value)
            return f"numbers[{first}]"
        if isinstance(value, np.ndarray) and value.dtype == float:
            self.numbers += value.ravel().tolist()
            return f"numbers[{first}:{len(self.numbers)}].reshape({value.shape})"
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            kind = type(value)
            self.names[kind.__name__] = kind
            return f"{kind.__name__}({', '.join(map(self._printed, value))})"
        raise NotPrintable(type(value).__name__)

    def _law(self, law: Callable[..., Any]) -> str:
        if id(law) not in self._known:
            function, files = native(law)
            self.files |= files
            name = self._known[id(law)] = f"{law.__name__}_{len(self.names)}"
            self.names[name] = function
        return self._known[id(law)]


@cache
def native(law: Any) -> tuple[Any, frozenset[str]]:
    """The function and those that it calls, to be compiled or found compiled, and the files where they stand."""
    law = OVER_FLOATS.get(law, law)
    if isinstance(law, np.ufunc):
        return law, frozenset()
    if hasattr(law, "py_func"):  # is compiled already
        return law, frozenset([law.py_func.__code__.co_filename])
    if not isinstance(law, FunctionType) or law.__closure__:
        raise NotPrintable(repr(law))
    theirs = {name: law.__globals__[name] for name in law.__code__.co_names if name in law.__globals__}
    called = {name: native(value) for name, value in theirs.items() if isinstance(value, FunctionType)}
    files = frozenset([law.__code__.co_filename]).union(*[files for _, files in called.values()])
    names = {**law.__globals__, **{name: function for name, (function, _) in called.items()}}
    return kept(law, names, law.__qualname__, files), files


def kept(function: FunctionType, names: dict[str, Any], text: str, files: Set[str]) -> Any:
    """The function to be compiled, among these names, or found compiled as long as text and files say the same."""
    sources = [text.encode(), *(Path(file).read_bytes() for file in sorted(files))]
    path = cache_folder() / f"{hashlib.sha256(b'|'.join(sources)).hexdigest()[:32]}.py"
    if path not in _loaded:
        with suppress(OSError, InputError):
            if not path.exists():  # a new file of the same text would be a new one to numba
                write_atomically(path, text)
        # a name of its own: numba links what it finds compiled by name, and many are called `compute`
        name = f"{function.__name__}_{path.stem}"
        code = function.__code__.replace(co_filename=str(path), co_name=name, co_qualname=name)
        _loaded[path] = jit(FunctionType(code, names, name, function.__defaults__))
    return _loaded[path]


def machine_code(program: Program) -> Callable[[Floats], Floats] | None:
    """What `program.run` computes, equal to rounding; None where a law cannot be compiled.

    It raises LinAlgError where a law would say that a matrix is singular.
    """
    from numba import float64, int64
    from numba.core.errors import NumbaError

    try:
        printer = Printer(program)
        exec(printer.text, names := {"np": np, "__name__": __name__, **printer.names})
        compute, numbers = kept(names["compute"], names, printer.text, printer.files), np.array(printer.numbers)
        compute.compile((float64[::1], int64[::1], float64[::1]))
    except (NotPrintable, NumbaError):
        return None
    ends = np.array([0, *(part.stop for part in program.given)])
    return lambda given: compute(given, ends, numbers)
