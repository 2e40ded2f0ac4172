"""A plan as a command of the tool: begun at some time, led over from the command before it, for an object off-centre.

The new plan starts where the tool is, the command before it stands elsewhere.  The difference, e and its rate r at the
change, is added to the plan and decays as the feedback lets an error of the tool decay: p'' = −K_v p' − K_p p with
p(0) = e, p'(0) = r.  So x_cmd and v_cmd do not jump, and a tool that is e behind its command and moves as planned asks
for a_cmd + K_p p + K_v p', which is the planned acceleration itself: the feedback does not add to it what the new plan
has already taken into account.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.planning.plan import Plan

Three = tuple[float, float, float]
NOTHING: Three = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Command:
    """x_cmd, v_cmd, a_cmd of (y, z, θ) over the time t since the start of the motion [s].

    plan: for the object's centre, its time 0 at `begins`.  offset, rate: e [m, rad] and r [per s] at `begins`, which
    decay by `gains`, K_p [1/s²] and K_v [1/s].  shift: how far the object sits from the middle of the blade along the
    tangent s [m].
    """

    plan: Plan
    begins: float = 0.0
    offset: Three = NOTHING
    rate: Three = NOTHING
    gains: tuple[float, float] = (0.0, 0.0)
    shift: float = 0.0

    @property
    def release_time(self) -> float:
        """When the object leaves the tool [s]."""
        return self.begins + self.plan.release_time

    @property
    def touchdown_time(self) -> float:
        """When the object touches down [s]."""
        return self.begins + self.plan.touchdown_time

    @property
    def end_time(self) -> float:
        """When the tool has come to rest [s]."""
        return self.begins + self.plan.duration

    def at(self, t: float) -> tuple[list[float], list[float], list[float]]:
        """x_cmd, v_cmd, a_cmd, three numbers each, of the tool's control point."""
        x, v, a = self.plan.at(t - self.begins)
        if self.shift:
            x, v, a = on_tool(x, v, a, self.shift)
        if self.offset != NOTHING or self.rate != NOTHING:
            of_offset, of_rate = decay(*self.gains, max(t - self.begins, 0.0))
            for signal, by_offset, by_rate in zip((x, v, a), of_offset, of_rate, strict=True):
                for i, (e, r) in enumerate(zip(self.offset, self.rate, strict=True)):
                    signal[i] += e * by_offset + r * by_rate
        return x, v, a

    def led_over_from(self, last: Command, gains: tuple[float, float]) -> Command:
        """This command with offset and rate such that it continues `last` at `begins`."""
        x, v, _ = last.at(self.begins)
        mine_x, mine_v, _ = replace(self, offset=NOTHING, rate=NOTHING).at(self.begins)
        e, r = ((old[0] - new[0], old[1] - new[1], old[2] - new[2]) for old, new in ((x, mine_x), (v, mine_v)))
        return replace(self, offset=e, rate=r, gains=gains)


def decay(k_p: float, k_v: float, t: float) -> tuple[Three, Three]:
    """p, p', p'' at t [s] of p'' = −k_v p' − k_p p: for p(0) = 1, p'(0) = 0, and for p(0) = 0, p'(0) = 1."""
    half = k_v / 2
    square = half * half - k_p
    root = math.sqrt(abs(square))
    if square > 0:
        # both exponents are negative: cosh and sinh alone would overflow
        slow, fast = math.exp((root - half) * t), math.exp(-(root + half) * t)
        c, s = (slow + fast) / 2, (slow - fast) / (2 * root)
    elif square < 0:
        c, s = (math.exp(-half * t) * value for value in (math.cos(root * t), math.sin(root * t) / root))
    else:
        c, s = math.exp(-half * t), t * math.exp(-half * t)
    p, dp = (c + half * s, s), (-k_p * s, c - half * s)
    first, second = ((p[i], dp[i], -k_v * dp[i] - k_p * p[i]) for i in (0, 1))
    return first, second


def on_tool(x: list[float], v: list[float], a: list[float], shift: float) -> tuple[list[float], ...]:
    """From the motion of an object `shift` [m] along s from the middle of the blade to that of the middle.

    With s = (cos θ, sin θ), n = ds/dθ:  x − d s,  v − d θ̇ n,  a − d (θ̈ n − θ̇² s).
    """
    c, s = math.cos(x[2]), math.sin(x[2])
    w, alpha = v[2], a[2]
    along, across = (c, s), (-s, c)
    position = [x[i] - shift * along[i] for i in (0, 1)]
    velocity = [v[i] - shift * w * across[i] for i in (0, 1)]
    acceleration = [a[i] - shift * (alpha * across[i] - w * w * along[i]) for i in (0, 1)]
    return [*position, x[2]], [*velocity, w], [*acceleration, alpha]


def of_object(x: Floats, v: Floats, shift: float) -> Floats:
    """State x̂ (6,) of an object `shift` [m] along s from the tool's control point, whose x, v are (3,)."""
    position, velocity, _ = on_tool(list(map(float, x)), list(map(float, v)), [0.0, 0.0, 0.0], -shift)
    return np.array([*position, *velocity])
