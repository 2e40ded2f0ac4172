"""What workers are asked to do in tests; they import this module by its name: `flips.tasks`."""

import ctypes
import os
import signal
import time

from flipdiagram.errors import InputError
from flipdiagram.flips.flight import fly_flight


def pid_after(seconds):
    time.sleep(seconds)
    return os.getpid()


def hold_the_interpreter(seconds):
    """Native code that does not let go of the interpreter's lock, so no thread of Python runs."""
    ctypes.PyDLL(None).sleep(seconds)


def take(gigabytes):
    held = bytearray(int(gigabytes * 1e9))
    held[::4096] = b"x" * len(held[::4096])
    time.sleep(600)


def refuse(path):
    raise InputError.of("file", path, "another")


def divide(number):
    return 1 / number


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def do(what):
    """What a trial can do: end well, raise, hang, or end its process."""
    if what == "raise":
        raise ZeroDivisionError("a bug")
    if what == "hang":
        time.sleep(600)
    if what == "die":
        die()
    return os.getpid()


def fly_or_hang(flight, plan):
    if flight.architecture == "pd+ff":
        time.sleep(600)
    return fly_flight(flight, plan)


def fly_wrongly(flight, plan):
    return fly_flight(flight, plan) if flight.architecture == "pd" else 1 / 0


def refuse_to_plan(believed):
    raise InputError.of("planner.solver", "none", "one that is installed")
