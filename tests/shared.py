"""What many tests start from: computed by the product at the first need, once a run, for all workers of pytest-xdist.

Every call reads it anew, so no test sees what another one does to its copy.
"""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import flipdiagram  # its names are loaded at their first use: pytest's own process needs none of them

FOLDER = "FLIPDIAGRAM_TESTS_SHARED"
"""Variable that names this run's folder; `conftest.py` makes and removes it, workers inherit it."""
T = TypeVar("T")


def once(name: str, compute: Callable[[], T]) -> T:
    """The result of `compute`, by whichever process of this run asks first; the others wait for it."""
    folder = Path(os.environ[FOLDER])
    with open(folder / f"{name}.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        kept = folder / f"{name}.pickle"
        if not kept.exists():
            kept.write_bytes(pickle.dumps(compute()))
        result: T = pickle.loads(kept.read_bytes())
        return result


def ideal_plan() -> flipdiagram.Plan:
    """The motion of `ideal.IDEAL`."""
    return once("plan", lambda: flipdiagram.plan_motion(_ideal()))


def ideal_flip() -> flipdiagram.Run:
    """`ideal.IDEAL` flown by pd+ff+dob."""
    return once("flip", lambda: flipdiagram.simulate(_ideal(), "pd+ff+dob", ideal_plan()))


def _ideal() -> flipdiagram.Scenario:
    from ideal import IDEAL  # here: pytest's own process needs none of it

    return IDEAL
