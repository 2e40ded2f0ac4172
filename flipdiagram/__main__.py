"""The command line as a process: `python -m flipdiagram`, and what the program `flipdiagram` starts.

From its first line on a signal ends it with one line and the code 128 + its number, wherever it comes: in an import, in
a callback of native code that swallows exceptions, or in the work, whose `finally` then cleans up.
"""

import os
import signal
import sys
from importlib.machinery import ExtensionFileLoader
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
AT_ONCE, AGAIN = 0.05, 10.0
"""Seconds after which an interruption is raised again: one that was put off or seen to be swallowed, and any other."""


class Stopped(KeyboardInterrupt):
    """A signal.  Of KeyboardInterrupt itself the interpreter keeps in mind that it came, and exits as it likes."""


def main() -> int:
    """Run the command line to its end or a signal; returns the exit code."""
    received: list[int] = []
    code: int | None = None

    def stop(number: int, frame: FrameType | None) -> None:
        if number != signal.SIGALRM:
            received.append(number)
        loading = _loads_native_code(frame)
        signal.setitimer(signal.ITIMER_REAL, AT_ONCE if loading else AGAIN)
        if not loading:
            raise Stopped

    def unraisable(problem: "sys.UnraisableHookArgs") -> None:
        if received:
            signal.setitimer(signal.ITIMER_REAL, AT_ONCE)
        else:
            sys.__unraisablehook__(problem)

    try:
        sys.unraisablehook = unraisable
        signal.signal(signal.SIGALRM, stop)
        for number in SIGNALS:
            if signal.getsignal(number) != signal.SIG_IGN:  # as under nohup, or behind the & of a script
                signal.signal(number, stop)
        os.environ["MPLBACKEND"] = "agg"  # the command draws into files only, whatever its user has chosen
        from flipdiagram.cli.main import main as run

        code = run()
    except BaseException:  # of a library too: it may have caught the interruption and raised its own
        if not received:
            raise
    finally:
        for number in (*SIGNALS, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
    if not received:
        return code or 0
    if not code:  # else a line has been written
        os.write(2, b"flipdiagram: interrupted\n")
    return 128 + received[0]


def _loads_native_code(frame: FrameType | None) -> bool:
    """Whether an extension module is being initialised: Drake's would report an exception in many lines of its own."""
    while frame is not None:
        if "importlib" in frame.f_code.co_filename and isinstance(frame.f_locals.get("self"), ExtensionFileLoader):
            return True
        frame = frame.f_back
    return False


if __name__ == "__main__":
    sys.exit(main())
