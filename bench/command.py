"""`flipdiagram flip`, the whole command as a user runs it: wall time, and peak memory of its processes."""

from __future__ import annotations

import os
import sys
import tempfile

from bench.processes import watch
from bench.results import Section, Target

TIME_LIMIT, MEMORY_LIMIT = Target("<", 25.0), Target("<", 600e6)
TEXT = (
    "`flipdiagram {words}` in a fresh process, from its start to its exit: plans, simulates the four architectures in"
    " processes of their own, writes recordings, figures and the rest. Memory: peak resident size, as the kernel"
    " accounts it, of the process that had the largest."
)
QUICK_TEXT = " A quick run (shorter hold, no replay) is less than the targets speak of, so none is judged."


def measure(repetitions: int, quick: bool) -> Section:
    """Run the command `repetitions` times, with --quick if `quick`."""
    words = ["flip", "--quick"] if quick else ["flip"]
    text = TEXT.format(words=" ".join(words)) + (QUICK_TEXT if quick else "")
    section = Section("The whole command", text)
    runs = []
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as out:
            runs.append(watch([sys.executable, "-m", "flipdiagram.cli", *words, "--out", out]))
            files = sum(len(names) for _, _, names in os.walk(out))
    section.add("wall time", [run.elapsed for run in runs], target=None if quick else TIME_LIMIT)
    section.add("peak memory of any process", [run.largest for run in runs], "B", None if quick else MEMORY_LIMIT)
    for place in range(min(len(run.peaks) for run in runs)):
        name = "largest" if place == 0 else f"{place + 1}. largest"
        section.add(name, [sorted(run.peaks.values(), reverse=True)[place] for run in runs], "B", indent=1)
    section.checks.append(f"exit code 0, {files} files written, {os.cpu_count()} cores")
    return section
