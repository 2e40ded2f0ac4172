"""A printed kernel as machine code, made once: the object file stays in the user's cache folder."""

import ctypes
import hashlib
import platform
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import llvmlite.binding as llvm  # type: ignore[import-untyped]

from flipdiagram.compiled.printer import ARGUMENTS
from flipdiagram.compiled.vectors import INTEGER
from flipdiagram.errors import InputError
from flipdiagram.files import cache_folder, write_atomically

Kernel = Callable[..., None]
"""The function of ``kernel_source``, from addresses and integers; it leaves Python's lock to others."""

_KEPT = 400  # files of the cache folder
_DIGEST = hashlib.sha256().digest_size
_loaded: dict[str, Kernel] = {}
_lock = threading.Lock()


def load_kernel(source: str) -> tuple[Kernel, bool]:
    """The compiled kernel of a source (``kernel_source``), and whether it was known, in this process or on disk.

    The key is the source, the processor and the version of the compiler. A cache folder that cannot be written, or
    a file that is damaged, costs the time of compiling and nothing else.
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    processor = f"{platform.machine()} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    key = hashlib.sha256("\n".join([version("llvmlite"), processor, source]).encode()).hexdigest()
    with _lock:
        if key in _loaded:
            return _loaded[key], True
        path = cache_folder() / f"{key[:32]}.o"
        code = _stored(path)
        hit = code is not None
        if code is None:
            code = bytes(target_machine().emit_object(parsed(source)))
            _store(path, code)
        _loaded[key] = _link(code)
        return _loaded[key], hit


def parsed(source: str) -> Any:
    """The module of a source, for this machine; it is printed as it is to run, so no pass changes it."""
    module = llvm.parse_assembly(source)
    module.triple, module.data_layout = llvm.get_process_triple(), str(target_machine().target_data)
    module.verify()
    return module


def target_machine() -> Any:
    """This processor, with all instructions that it has."""
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="jitdefault",
        jit=True,
    )


def _link(code: bytes) -> Kernel:
    """A callable of object code, which keeps the owner of its machine code alive."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    kinds = [ctypes.c_int64 if kind is INTEGER else ctypes.c_void_p for kind in ARGUMENTS.values()]
    kernel: Any = ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address("kernel"))
    kernel.owner = engine
    return cast(Kernel, kernel)


def _stored(path: Path) -> bytes | None:
    """Object code from a file, if it is whole."""
    with suppress(OSError):
        content = path.read_bytes()
        if hashlib.sha256(content[_DIGEST:]).digest() == content[:_DIGEST]:
            return content[_DIGEST:]
    return None


def _store(path: Path, code: bytes) -> None:
    """Keep object code in a file; does nothing where it cannot."""
    with suppress(OSError, InputError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomically(path, hashlib.sha256(code).digest() + code)
        files = sorted(path.parent.glob("*.o"), key=lambda file: file.stat().st_mtime)
        for old in files[: max(0, len(files) - _KEPT)]:
            old.unlink(missing_ok=True)
