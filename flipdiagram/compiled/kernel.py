"""Printed source -> machine code: by numba or LLVM alone, once; the object file stays in the user's cache folder.

Loading that file takes llvmlite alone and some milliseconds; importing and starting numba takes half a second.
"""

from __future__ import annotations

import ctypes
import hashlib
import math
import os
import platform
import re
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import llvmlite.binding as llvm  # type: ignore[import-untyped]
import numpy as np

from flipdiagram.compiled.errors import NotCompilable

Kernel = Callable[..., None]
"""The function of ``print_source``, from addresses and integers; it leaves Python's lock to others."""

# The arguments of the printed function: N an integer, I and F addresses of integers and floats.
ARGUMENTS = "N N I I F N F N F N N N N F N I F N N".split()

_KEPT = 400  # files of the cache folder
_DIGEST = hashlib.sha256().digest_size
# What machine code may ask of the process that loads it: the C library's mathematics.
_LIBRARY = frozenset(
    "exp log sqrt sin cos tan asin acos atan atan2 sinh cosh tanh floor ceil pow fabs memset memcpy sincos fma".split()
)
_loaded: dict[str, Kernel] = {}
_lock = threading.Lock()


def cache_folder() -> Path:
    """Where machine code is kept: FLIPDIAGRAM_CACHE_DIR, else flipdiagram/ in the user's cache folder."""
    if chosen := os.environ.get("FLIPDIAGRAM_CACHE_DIR"):
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base) / "flipdiagram"


def load_kernel(source: str, cache: bool = True, vectors: bool = False) -> tuple[Kernel, bool]:
    """The compiled kernel of a source, and whether it was known, in this process or on disk.

    The source is Python (``print_source``), or with ``vectors`` LLVM's language (``vector_source``).

    The key is the source, the processor and the versions of the compilers. A cache folder that cannot be written, or
    a file that is damaged, costs the time of compiling and nothing else.
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    processor = f"{platform.machine()} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    text = "\n".join([version("numba"), version("llvmlite"), processor, source])
    key = hashlib.sha256(text.encode()).hexdigest()
    with _lock:
        if cache and key in _loaded:
            return _loaded[key], True
        path = cache_folder() / f"{key[:32]}.o"
        code = _stored(path) if cache else None
        hit = code is not None
        if code is None:
            function: Any = None if vectors else _compile(source)
            code = _assembled(source) if vectors else _object_code(function)
            if code and cache:
                _store(path, code)
        kernel = _link(code) if code else _kept(function.ctypes, function)
        if cache:
            _loaded[key] = kernel
        return kernel, hit


def _compile(source: str) -> Any:
    """The function of a source as numba's CFunc."""
    import numba  # only where something is compiled

    kinds = {
        "N": numba.types.int64,
        "I": numba.types.CPointer(numba.types.int64),
        "F": numba.types.CPointer(numba.types.float64),
    }
    names: dict[str, Any] = {"math": math, "np": np}
    exec(compile(source, "<compiled diagram>", "exec"), names)
    for name in ("choose", "smaller", "larger"):  # functions: branches in the kernel itself cost numba much time
        names[name] = numba.njit(forceinline=True)(names[name])
    signature = numba.types.void(*(kinds[kind] for kind in ARGUMENTS))
    # numpy's error model: a division by zero gives infinity, as it does in Drake; inlined, the function is seen to
    # raise nothing, and what numba adds for exceptions goes
    try:
        return numba.cfunc(signature, error_model="numpy", forceinline=True)(names["kernel"])
    except RecursionError:
        raise NotCompilable(f"the diagram is too large for numba: {source.count(chr(10))} lines of source") from None


def _object_code(function: Any) -> bytes | None:
    """The function as an object file; None where it needs more than the C library of the process that loads it."""
    text = function.inspect_llvm().replace(function.native_name, "kernel")
    asked = set(re.findall(r"^declare [^@]*@(?!llvm\.)([^(]+)\(", text, re.M))
    return bytes(_target().emit_object(llvm.parse_assembly(text))) if asked <= _LIBRARY else None


def _assembled(source: str) -> bytes:
    """Text in LLVM's language as an object file; it is printed as it is to run, so no pass changes it before."""
    target = _target()
    module = llvm.parse_assembly(source)
    module.triple, module.data_layout = llvm.get_process_triple(), str(target.target_data)
    module.verify()
    return bytes(target.emit_object(module))


def _target() -> Any:
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="jitdefault",
        jit=True,
    )


def _link(code: bytes) -> Kernel:
    """A callable of object code."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    kinds = [ctypes.c_int64 if kind == "N" else ctypes.c_void_p for kind in ARGUMENTS]
    return _kept(ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address("kernel")), engine)


def _kept(kernel: Any, owner: Any) -> Kernel:
    """The callable, which keeps the owner of its machine code alive."""
    kernel.owner = owner
    return cast(Kernel, kernel)


def _stored(path: Path) -> bytes | None:
    """Object code from a file, if it is whole."""
    with suppress(OSError):
        content = path.read_bytes()
        if hashlib.sha256(content[_DIGEST:]).digest() == content[:_DIGEST]:
            return content[_DIGEST:]
    return None


def _store(path: Path, code: bytes) -> None:
    """Keep object code in a file that appears whole or not at all; does nothing where it cannot."""
    with suppress(OSError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(temporary, path)
        finally:
            with suppress(FileNotFoundError):
                os.unlink(temporary)
        files = sorted(path.parent.glob("*.o"), key=lambda file: file.stat().st_mtime)
        for old in files[: max(0, len(files) - _KEPT)]:
            old.unlink(missing_ok=True)
