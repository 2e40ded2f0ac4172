"""How long a test waits: long where it is not about time, by the load of the machine where it is."""

import os

HUNG = 900
"""Seconds after which a process is given up that would end by itself; no test is about this number."""


def loaded(seconds):
    """Seconds that something may take which takes less than `seconds` on free cores, at the load there is now."""
    running, _, _ = os.getloadavg()
    return seconds * max(1.0, 1.5 * running / (os.cpu_count() or 1))
