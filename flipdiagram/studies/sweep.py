"""Frequency responses by experiment: run a loop to its steady state, read its meters over whole periods."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.blocks.meters import fundamental, whole_periods
from flipdiagram.contact import Floats
from flipdiagram.errors import SimulationError
from flipdiagram.transfer import Complex

SHORTEST_WINDOW = 2000
"""Fewest samples of a window: a peak between samples is then seen at many phases of the period."""
SETTLED = 1e-9
"""What is left of the slowest transient, as a fraction, when the first window begins."""
LONGEST_SETTLING = 120.0
"""Seconds after which a loop is measured however slowly its poles decay."""
METERS = ("lockin_x", "lockin_a", "peak_x", "peak_a", "peak_force", "rms_error")


@dataclass(frozen=True)
class Response:
    """What the meters read in the last window, one entry per channel; every array has the shape (n,).

    omega [rad/s]; x [m] and a [m/s²]: phasors of the fundamental, relative to sin ωt; peak_x, peak_a: half of maximum
    less minimum; peak_force: largest modulus [N]; rms_error of x [m]; steady: whether the last two windows agreed;
    spread: their difference; ticks: samples of the window; rest: of a period, by which the window is not whole.
    """

    omega: Floats
    x: Complex
    a: Complex
    peak_x: Floats
    peak_a: Floats
    peak_force: Floats
    rms_error: Floats
    steady: np.ndarray
    spread: Floats
    ticks: np.ndarray
    rest: Floats
    steps: int

    def select(self, index: Any) -> Response:
        """The channels of an index, as a Response of its own."""
        arrays = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "steps"}
        return Response(**arrays, steps=self.steps)


def settling_ticks(pole: complex | None, period: float) -> int:
    """Ticks after which a transient with this pole s [rad/s] has decayed to SETTLED; 2 s where it is not known."""
    if pole is None or pole.real >= 0:
        return math.ceil(2.0 / period)
    return math.ceil(min(math.log(1 / SETTLED) / -pole.real, LONGEST_SETTLING) / period)


def measure(
    loop: Any,
    omega: ArrayLike,
    parameters: Mapping[str, ArrayLike],
    settling: ArrayLike,
    *,
    tolerance: float,
    most_windows: int,
    name: str = "loop",
    threads: int | None = None,
) -> Response:
    """Drive a compiled `one_dof_loop.build_experiment` at omega (n,) [rad/s] until two successive windows agree.

    parameters: further numeric parameters, (n,) or one for all; settling: ticks before the first window, (n,).
    Two windows agree when fundamental and RMS error of x differ by less than the tolerance, relative to their size.
    Channels that never do are returned with steady = False.  Raises SimulationError where a loop diverges.
    """
    w = np.asarray(omega, dtype=float)
    n, period = len(w), loop.period
    window, rest = map(np.array, zip(*(whole_periods(value, period, SHORTEST_WINDOW) for value in w), strict=True))
    settle = np.broadcast_to(np.asarray(settling, dtype=np.int64), (n,))
    given = {key: np.broadcast_to(np.asarray(value, dtype=float), (n,)) for key, value in parameters.items()}
    given["omega"] = w
    states, where = _layout(loop)
    run = loop.run(settle, parameters=given, threads=threads)
    steps, now, state = int(settle.sum()), run.ticks.copy(), np.array(run.final)
    active, before = np.arange(n), np.zeros((2, n), complex)
    result: dict[str, Any] = {f.name: np.zeros(n, complex if f.name in ("x", "a") else float) for f in fields(Response)}
    result |= {"omega": w, "ticks": window, "rest": rest, "steady": np.zeros(n, bool)}
    result["spread"] = np.full(n, np.inf)
    for turn in range(most_windows):
        reset = state[active]
        reset[:, where] = states[where]
        chosen = {key: value[active] for key, value in given.items()}
        run = loop.run(window[active], parameters=chosen, state=reset, start=now[active], threads=threads)
        steps += int(window[active].sum())
        _check_finite(run.final, w[active], name)
        read = _read(run.outputs, w[active], period, now[active], window[active])
        state[active], now[active] = run.final, run.ticks
        for key, value in read.items():
            result[key][active] = value
        latest = np.stack([read["x"], read["rms_error"] + 0j])
        if turn:
            size = np.maximum(np.abs(latest), np.abs(before[:, active]))
            spread = np.max(np.abs(latest - before[:, active]) / np.maximum(size, 1e-300), axis=0)
            result["spread"][active], result["steady"][active] = spread, spread <= tolerance
        before[:, active] = latest
        active = np.nonzero(~result["steady"])[0]
        if not active.size:
            break
    result["steps"] = steps
    return Response(**result)


def _layout(loop: Any) -> tuple[Floats, np.ndarray]:
    """The default state, and the indices of those elements that belong to meters."""
    names = [name.partition("[")[0] for name in loop.state_names]
    where = np.array([i for i, name in enumerate(names) if name.split(".")[0] in METERS], dtype=int)
    default = np.concatenate([np.ravel(loop.default_state[name]) for name in loop.states])
    return default, where


def _read(outputs: Mapping[str, Floats], w: Floats, period: float, start: Any, ticks: Any) -> dict[str, Any]:
    peaks = {name: outputs[f"peak_{name}"] for name in ("x", "a", "force")}
    return {
        "x": fundamental(outputs["lockin_x"], w, period, start, ticks),
        "a": fundamental(outputs["lockin_a"], w, period, start, ticks),
        "peak_x": (peaks["x"][:, 0] - peaks["x"][:, 1]) / 2,
        "peak_a": (peaks["a"][:, 0] - peaks["a"][:, 1]) / 2,
        "peak_force": np.max(np.abs(peaks["force"]), axis=1),
        "rms_error": outputs["rms_error"][:, 0],
    }


def _check_finite(final: Floats, w: Floats, name: str) -> None:
    bad = ~(np.isfinite(final).all(axis=1) & (np.abs(final).max(axis=1) < 1e100))
    if bad.any():
        raise SimulationError(f"the loop '{name}' diverged at omega = {w[bad][0]:.6g} rad/s")
