"""Fresh processes: the result of a module of this folder run in one, and the peak memory of a whole command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
POLL = 0.02
"""Seconds between two looks at the processes of a command."""


def fresh(module: str, *arguments: str) -> tuple[float, Any]:
    """Run `python -m module` in a process of its own: wall time [s], and the JSON of the last line that it printed."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    elapsed = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with exit code {done.returncode}")
    return elapsed, json.loads(done.stdout.splitlines()[-1])


def processor_time(pid: int) -> float:
    """Processor time of a process so far [s], 0 where it has ended."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            fields = file.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except OSError:
        return 0.0


@dataclass(frozen=True)
class Watched:
    """A finished command."""

    elapsed: float
    """Wall time [s]."""
    lines: list[tuple[float, str]]
    """What it printed, each line with the time [s] at which it came."""
    peaks: dict[int, int]
    """Peak resident memory [B] of each of its processes, by id."""
    largest: int
    """Of any process [B]: the kernel's own account of all that ended, or the largest of `peaks` if that is more."""


def watch(command: Sequence[str]) -> Watched:
    """Run a command and watch the memory of the processes that it starts.

    The kernel's account (wait4) misses nothing, but does not tell the processes apart; /proc does, where there is one.
    Raises RuntimeError, with what the command printed, unless it exits with 0.
    """
    peaks: dict[int, int] = {}
    lines: list[tuple[float, str]] = []
    begin = time.perf_counter()
    read, write = os.pipe()
    process = subprocess.Popen(command, cwd=ROOT, stdout=write, stderr=write)
    os.close(write)
    os.set_blocking(read, False)
    while True:
        done, status, usage = os.wait4(process.pid, os.WNOHANG)
        if done:
            break
        for pid in _family(process.pid):
            peaks[pid] = max(peaks.get(pid, 0), _peak(pid))
        lines += [(time.perf_counter() - begin, line) for line in _lines(read)]
        time.sleep(POLL)
    elapsed = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    lines += [(elapsed, line) for line in _lines(read)]
    os.close(read)
    if process.returncode:
        said = " / ".join(line for _, line in lines)
        raise RuntimeError(f"{' '.join(command)} ended with exit code {process.returncode}: {said}")
    kernel = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return Watched(elapsed, lines, peaks, max([kernel, *peaks.values()]))


def _lines(pipe: int) -> list[str]:
    """What the pipe holds; a line is short, and written at once."""
    text = b""
    with suppress(BlockingIOError):
        while block := os.read(pipe, 65536):
            text += block
    return text.decode(errors="replace").splitlines()


def _family(pid: int) -> list[int]:
    """A process and all its descendants that are alive; only itself where there is no /proc."""
    found = [pid]
    for parent in found:
        for children in Path(f"/proc/{parent}/task").glob("*/children"):
            try:
                found += [int(child) for child in children.read_text().split()]
            except OSError:  # it ended meanwhile
                continue
    return found


def _peak(pid: int) -> int:
    """Largest resident memory of a process so far [B], 0 where it cannot be read."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0)
