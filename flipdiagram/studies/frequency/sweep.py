"""Frequency responses by experiment: run a loop to its steady state, read its meters over whole periods."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flipdiagram.arrays import Complex, Floats
from flipdiagram.blocks.meters import fundamental, whole_periods
from flipdiagram.errors import SimulationError

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
    spread: their difference, that of the fundamental or of the RMS error, whichever is larger; spread_x: that of the
    fundamental; ticks: samples of the window; rest: of a period, by which the window is not whole.
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
    spread_x: Floats
    ticks: np.ndarray
    rest: Floats

    def select(self, index: Any) -> Response:
        """The channels of an index, as a Response of its own."""
        return Response(**{f.name: getattr(self, f.name)[index] for f in fields(self)})


def settling_ticks(pole: complex | None, period: float) -> int:
    """Ticks after which a transient with this pole s [rad/s] has decayed to SETTLED; 2 s where it is not known."""
    if pole is None or pole.real >= 0:
        return math.ceil(2.0 / period)
    return math.ceil(min(math.log(1 / SETTLED) / -pole.real, LONGEST_SETTLING) / period)


def measure(windows: Windows, *, tolerance: float, most_windows: int) -> Response:
    """Drive channels until two successive windows agree.

    Two windows agree when fundamental and RMS error of x differ by less than the tolerance, relative to their size.
    Channels that never do are returned with steady = False.  Raises SimulationError where a loop diverges.
    """
    n = len(windows.omega)
    active, before = np.arange(n), np.zeros((2, n), complex)
    result: dict[str, Any] = {f.name: np.zeros(n, complex if f.name in ("x", "a") else float) for f in fields(Response)}
    result |= {"omega": windows.omega, "ticks": windows.ticks, "rest": windows.rest, "steady": np.zeros(n, bool)}
    result |= {"spread": np.full(n, np.inf), "spread_x": np.full(n, np.inf)}
    for turn in range(most_windows):
        read = windows.next(active)
        for key, value in read.items():
            result[key][active] = value
        latest = decisive(read)
        if turn:
            each = apart(latest, before[:, active])
            spread = np.max(each, axis=0)
            result["spread"][active], result["steady"][active] = spread, spread <= tolerance
            result["spread_x"][active] = each[0]
        before[:, active] = latest
        active = np.nonzero(~result["steady"])[0]
        if not active.size:
            break
    return Response(**result)


class Windows:
    """One window after another of channels that run on: before each, their meters begin anew.

    loop: a compiled `one_dof.build_experiment`; omega (n,): driven at [rad/s]; parameters: further numeric parameters,
    (n,) or one for all; settling: ticks before the first window, (n,).  ticks (n,): samples of the windows, by default
    as nearly whole periods as can be; rest (n,): the part of a period by which they are not; steps: channel-steps so
    far.
    """

    def __init__(
        self,
        loop: Any,
        omega: ArrayLike,
        parameters: Mapping[str, ArrayLike],
        settling: ArrayLike,
        *,
        ticks: ArrayLike | None = None,
        name: str = "loop",
    ) -> None:
        self.omega = np.asarray(omega, dtype=float)
        n = len(self.omega)
        if ticks is None:
            ticks = [whole_periods(value, loop.period, SHORTEST_WINDOW) for value in self.omega]
        self.ticks = np.array(ticks, dtype=np.int64)
        periods = self.ticks * self.omega * loop.period / (2 * np.pi)
        self.rest = periods - np.rint(periods)
        self._loop, self._name = loop, name
        self._given = {key: np.broadcast_to(np.asarray(value, dtype=float), (n,)) for key, value in parameters.items()}
        self._given["omega"] = self.omega
        self._default = np.concatenate([np.ravel(loop.default_state[name]) for name in loop.states])
        boxes = [name.partition("[")[0].partition(".")[0] for name in loop.state_names]
        self._meters = np.flatnonzero(np.isin(boxes, METERS))
        settle = np.broadcast_to(np.asarray(settling, dtype=np.int64), (n,))
        run = loop.run(settle, parameters=self._given)
        self.steps, self._now, self._state = int(settle.sum()), run.ticks.copy(), np.array(run.final)

    def next(self, active: np.ndarray) -> dict[str, Any]:
        """Run the next window of these channels, indices (k,): their readings by name, (k,) each.

        Raises SimulationError where a loop diverges.
        """
        state, ticks, w = self._state[active], self.ticks[active], self.omega[active]
        state[:, self._meters] = self._default[self._meters]
        given = {key: value[active] for key, value in self._given.items()}
        run = self._loop.run(ticks, parameters=given, state=state, start=self._now[active])
        self.steps += int(ticks.sum())
        bad = ~(np.abs(run.final).max(axis=1) < 1e100)  # also where one is nan
        if bad.any():
            raise SimulationError(f"the loop '{self._name}' diverged at omega = {w[bad][0]:.6g} rad/s")
        read: dict[str, Any] = {"rms_error": run.outputs["rms_error"][:, 0]}
        for name in ("x", "a"):
            peaks = run.outputs[f"peak_{name}"]
            read[f"peak_{name}"] = (peaks[:, 0] - peaks[:, 1]) / 2
            phasors = run.outputs[f"lockin_{name}"]
            read[name] = fundamental(phasors, w, self._loop.period, self._now[active], ticks)
        self._state[active], self._now[active] = run.final, run.ticks
        return read | {"peak_force": np.max(np.abs(run.outputs["peak_force"]), axis=1)}


def decisive(read: Mapping[str, Any]) -> Complex:
    """What two windows are compared by: fundamental and RMS error of x [m], shape (2, n)."""
    return np.stack([read["x"], read["rms_error"] + 0j])


def apart(one: Complex, other: Complex) -> Floats:
    """|one − other| relative to the larger of them, element by element; 0 where both are 0."""
    size = np.maximum(np.abs(one), np.abs(other))
    return np.asarray(np.abs(one - other) / np.maximum(size, 1e-300))
