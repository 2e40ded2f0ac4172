"""`flipdiagram flip`, the whole command as a user runs it: wall time, and peak memory of its processes."""

from __future__ import annotations

import os
import re
import sys
import tempfile

from bench.processes import Watched, watch
from bench.results import Section, Target

TIME_LIMIT, MEMORY_LIMIT = Target("<", 25.0), Target("<", 600e6)
STAGES = (("start-up", "planning"), ("planning", "planned in"), ("simulations", r"\d+/\d+ "))
"""Each stage, and how the line of progress begins that ends it; the last stage ends with the command."""
LAST_STAGE = "figures and replay, exit"
PROGRAM = (
    "import sys; from contextlib import nullcontext; from flipdiagram.cli import commands, main;"
    " commands.status = lambda quiet: nullcontext(lambda text: print(text, file=sys.stderr, flush=True));"
    " sys.exit(main.main())"
)
"""The command, with its progress a line each: it shows none where stderr is no terminal."""
QUICK = ("--quick", "--architecture", "pd+ff+dob")
TEXT = (
    "`flipdiagram {words}` in a fresh process, from its start to its exit, as a user runs it. Memory: peak resident"
    " size, as the kernel accounts it, of that of its processes which had the largest; of each process, from /proc."
)
QUICK_TEXT = " This is less than the targets speak of, so none is judged."


def measure(repetitions: int, quick: bool) -> Section:
    """Run the command `repetitions` times; if `quick`, one architecture, a shorter hold and no replay."""
    words = ["flip", *QUICK] if quick else ["flip"]
    text = TEXT.format(words=" ".join(words)) + (QUICK_TEXT if quick else "")
    section = Section("The whole command", text)
    runs: list[Watched] = []
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as out:
            runs.append(watch([sys.executable, "-c", PROGRAM, *words, "--out", out]))
            files = sum(len(names) for _, _, names in os.walk(out))
    section.add("wall time", [run.elapsed for run in runs], target=None if quick else TIME_LIMIT)
    stages = [stage_times(run) for run in runs]
    for name in stages[0] if all(stages) else {}:
        section.add(name, [times[name] for times in stages], indent=1)
    largest = [run.largest for run in runs]
    section.add("peak memory of any process", largest, "B", None if quick else MEMORY_LIMIT)
    for place in range(min(len(run.peaks) for run in runs)):
        peaks = [sorted(run.peaks.values(), reverse=True)[place] for run in runs]
        section.add(f"process {place + 1}", peaks, "B", indent=1)
    section.checks.append(f"exit code 0, {files} files written, {os.cpu_count()} cores")
    return section


def stage_times(run: Watched) -> dict[str, float]:
    """Seconds of each stage by the progress that the command printed; empty where that is not as expected."""
    times: dict[str, float] = {}
    begin = 0.0
    for name, mark in STAGES:
        ends = [at for at, line in run.lines if re.match(mark, line)]
        if not ends:
            return {}
        times[name], begin = ends[-1] - begin, ends[-1]
    return times | {LAST_STAGE: run.elapsed - begin}
