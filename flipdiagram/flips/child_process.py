"""Calls made in a child process that may hang, crash or leak: it is killed, noticed or replaced.

A thread owns one child and makes one call at a time, so a crash takes no other call with it.  Threads of this process
and of Dask's workers use the same function, `in_child`: both have the same time-outs, isolation and memory.  What
becomes of the trial whose call ends so is decided in `driver`.
A child is a plain subprocess on a socket pair: nothing listens, and it may be started where daemons may not fork.
"""

import ctypes
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from inspect import isfunction
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from flipdiagram.errors import FlipdiagramError

RECYCLED_AFTER = 120
"""Calls after which a child is replaced: Drake never frees a Python system, 2 to 5 MB a flip."""
START_TIMEOUT = 300.0
"""Seconds that a new child may take to import what it calls."""
STARTS = 12
"""How often a child is started that ends before it is ready."""
IDLE = 120.0
"""Seconds without a call after which a child ends, as in a Dask worker whose campaign is over."""
MEMORY = 2.0
"""GB that the process of a flip may hold; it needs 0.4, and 5 MB more for each flip that it has flown."""
LOOK = 0.25
"""Seconds between two looks at the memory of a child that makes a call."""
PR_SET_PDEATHSIG = 1
"""Of Linux's prctl: the signal that a process gets when the thread that started it ends."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Set to 1 in children: they share the cores already, and sums come out the same on every machine."""


class Limits(NamedTuple):
    """What a call may take: time [s], and memory of its process [GB], which is watched where there is a /proc."""

    seconds: float
    gigabytes: float


class TrialLimitError(Exception):
    """The call took more than it may; its child was killed.  `kind`: timeout or memory."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.kind, str(self))


class WorkerLostError(Exception):
    """The child ended in the middle of the call: killed, out of memory, or crashed."""


class TrialError(Exception):
    """The call raised an exception, which stands in the message; `error` is that exception where it is one of ours."""

    error: FlipdiagramError | None = None


class Child:
    """One child process; `call` is for one thread at a time."""

    def __init__(self) -> None:
        parent_end, child_end = socket.socketpair()
        alive_read, self._alive = os.pipe()  # the child sees its end close when this process is gone
        ends = f"{child_end.fileno()}, {alive_read}, {os.getpid()}"
        program = f"from flipdiagram.flips.child_process import serve; serve({ends})"
        environment = os.environ | {name: "1" for name in THREADS}
        environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
        # Ctrl-C reaches the whole process group; the parent decides, and from its first moment a child never hears it
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", program],
                pass_fds=(child_end.fileno(), alive_read),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=environment,
            )
        except BaseException:
            os.close(self._alive)
            parent_end.close()
            raise
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            child_end.close()
            os.close(alive_read)
        self.pid = self._process.pid
        self._connection = Connection(parent_end.detach())
        self._closing = threading.Lock()
        self._closed = False
        self.calls = 0
        _children.add(self)

    @property
    def spent(self) -> bool:
        """Whether a new child should take the next call."""
        return self._closed or self.calls >= RECYCLED_AFTER or self._process.poll() is not None

    def call(self, function: Callable[..., Any], arguments: tuple[Any, ...], limits: Limits | None) -> Any:
        """What function(*arguments) returns there.

        Raises TrialLimitError, WorkerLostError, or TrialError with what it raised.
        """
        try:
            self._connection.send((function, arguments))
            self._wait(limits)
            value, failure, error = self._connection.recv()
        except (EOFError, OSError):
            self.close()
            code = self._process.returncode
            raise WorkerLostError(f"the worker process ended unexpectedly (exit code {code})") from None
        if failure is not None:
            lost = TrialError(failure)
            lost.error = error
            raise lost
        return value

    def _wait(self, limits: Limits | None) -> None:
        """Until there is an answer; TrialLimitError, the process killed, where it takes too much."""
        begin = time.monotonic()
        while not self._connection.poll(None if limits is None else LOOK):
            assert limits is not None, "without limits poll waits for ever"
            if time.monotonic() - begin > limits.seconds:
                self.close()
                raise TrialLimitError("timeout", f"took longer than {limits.seconds:g} s")
            if _resident(self.pid) > limits.gigabytes * 1e9:
                self.close()
                raise TrialLimitError("memory", f"took more than {limits.gigabytes:g} GB of memory")

    def close(self) -> None:
        """End the process and release what belongs to it."""
        with self._closing:
            if self._closed:
                return
            self._closed = True
            _children.discard(self)
            self._process.kill()
            self._process.wait()
            os.close(self._alive)
            self._connection.close()


_children: set[Child] = set()
_thread = threading.local()


def in_child(function: Callable[..., Any], arguments: tuple[Any, ...], limits: Limits | None = None) -> Any:
    """As `Child.call`, in the child of this thread, started or replaced as needed."""
    child: Child | None = getattr(_thread, "child", None)
    if child is None or child.spent:
        if child is not None:
            child.close()
        child = _thread.child = _started(_modules(function, *arguments))
    child.calls += 1
    return child.call(function, arguments, limits)


def _modules(*values: Any) -> tuple[str, ...]:
    """Where functions, and the classes of other values, are defined."""
    homes = {value.__module__ if isfunction(value) else type(value).__module__ for value in values}
    return tuple(sorted(homes))


def _started(modules: tuple[str, ...]) -> Child:
    """A new child that has imported what it will need; one lost before says nothing about a trial."""
    for start in range(1, STARTS + 1):
        child = Child()
        try:
            child.call(_load, modules, Limits(START_TIMEOUT, float("inf")))
            break
        except WorkerLostError:
            if start == STARTS:
                raise
    return child


def children() -> list[int]:
    """Ids of the children of this process that are alive."""
    return [child.pid for child in list(_children)]


def kill_children() -> None:
    """End the processes of all children, from any thread; a call that is under way raises WorkerLostError."""
    for child in list(_children):
        with suppress(OSError):
            os.kill(child.pid, signal.SIGKILL)


def close_children() -> None:
    """End all children and forget them; for when no thread makes calls any more."""
    for child in list(_children):
        child.close()


def serve(connection_fd: int, alive_fd: int, parent: int) -> None:
    """The child's life: answer calls until the parent, its process id, is gone or has nothing to do for `IDLE`."""
    die_with(parent)
    threading.Thread(target=_end_with_parent, args=(alive_fd,), daemon=True).start()
    connection = Connection(connection_fd)
    with suppress(EOFError, OSError):
        while connection.poll(IDLE):
            connection.send(_answer(connection.recv_bytes()))


def _answer(message: bytes) -> tuple[Any, str | None, FlipdiagramError | None]:
    """(what the call returned, None, None) or (None, what it raised in one line, that error where it is ours)."""
    try:
        function, arguments = pickle.loads(message)  # from the parent's end of a socket pair, never from a file
        return function(*arguments), None, None
    except Exception as error:  # whatever it is: the outcome of this trial, not the end of the campaign
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return None, text, error if isinstance(error, FlipdiagramError) else None


def _load(*modules: str) -> None:
    for module in modules:
        import_module(module)


def _resident(pid: int) -> int:
    """Memory that a process holds [B]; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0


def die_with(parent: int) -> None:
    """On Linux the kernel kills this process with the one that started it, whatever native code either is in."""
    with suppress(AttributeError, OSError):  # elsewhere the watcher does it, as soon as it gets the interpreter's lock
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it was gone before
        os._exit(1)


def _end_with_parent(alive_fd: int) -> None:
    os.read(alive_fd, 1)  # returns when the parent's end is closed, even by kill -9
    os._exit(1)
