"""How long a test waits: long where it is not about time, by the load of the machine where it is."""

import os
from contextlib import suppress

HUNG = 900
"""Seconds after which a process is given up that would end by itself; no test is about this number."""


def loaded(seconds):
    """Seconds that something may take which takes less than `seconds` on free cores, at the load there is now."""
    running = os.getloadavg()[0]
    with suppress(OSError), open("/proc/loadavg", encoding="ascii") as file:  # the mean of a minute lags behind
        running = max(running, float(file.read().split()[3].split("/")[0]))
    return seconds * max(1.0, 1.5 * running / (os.cpu_count() or 1))
