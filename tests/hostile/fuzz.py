"""Draw cases until a time is over, and keep those that end badly in `corpus/`, which the tests replay.

`make fuzz`, or `python tests/hostile/fuzz.py SECONDS [SEED]`.  A process of its own runs them one after another, so that
a case which ends the interpreter is found too.
"""

import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1])]
CORPUS = HERE / "corpus"
CASES = 200
"""That a process runs before the next one takes over: Drake's memory grows."""


def main(seconds, seed):
    """Run until the time is over; returns how many cases were kept."""
    begin, found = time.monotonic(), len(list(CORPUS.glob("*.yaml")))
    with tempfile.TemporaryDirectory() as folder:
        while (left := seconds - (time.monotonic() - begin)) > 0:
            command = [sys.executable, __file__, "--child", str(seed), str(left), folder]
            code = subprocess.run(command, stdout=subprocess.DEVNULL).returncode
            if code != 0:
                keep((Path(folder) / "case.yaml").read_text("utf-8"), f"the interpreter ended with {code}")
            seed += 1
    new = len(list(CORPUS.glob("*.yaml"))) - found
    print(f"{new} new cases in {CORPUS.relative_to(HERE.parents[1])}, next seed {seed}")
    return new


def child(seed, seconds, folder):
    """Run cases in a folder, each from an empty one."""
    from hostile.draws import drawn, dump, ending
    from hostile.table import make

    dice, until, log = random.Random(seed), time.monotonic() + seconds, Path(folder) / "stderr"
    keeping = os.dup(2)
    os.dup2(os.open(log, os.O_CREAT | os.O_RDWR | os.O_APPEND), 2)

    def capture():
        said = log.read_text("utf-8", errors="replace")
        os.truncate(log, 0)
        return said

    ends: Counter[str] = Counter()
    for number in range(CASES):
        if time.monotonic() > until:
            break
        case = drawn(dice)
        text = dump({"words": case.words, "files": dict(case.files)})
        (Path(folder) / "case.yaml").write_text(text, "utf-8")
        with tempfile.TemporaryDirectory() as room:
            os.chdir(room)
            make(case.files, Path(room))
            code, wrong = ending(case, capture)
            ends[f"{case.name} {code}"] += 1
            os.chdir(folder)
        if wrong is not None:
            os.write(keeping, f"seed {seed}, case {number}: {wrong[:2000]}\n{text}\n".encode())
            keep(text, wrong)
    os.write(keeping, f"seed {seed}: {dict(sorted(ends.items()))}\n".encode())


def keep(text, wrong):
    """Write a case into the corpus, with what was wrong as a comment."""
    CORPUS.mkdir(exist_ok=True)
    name = f"{random.Random(text).getrandbits(32):08x}.yaml"
    (CORPUS / name).write_text(f"# {' '.join(wrong.split())[:200]}\n{text}", "utf-8")


if __name__ == "__main__":
    if sys.argv[1] == "--child":
        child(int(sys.argv[2]), float(sys.argv[3]), sys.argv[4])
    else:
        sys.exit(main(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time())) > 0)
