"""A plan as a command of the tool: begun at some time, led over from the command before it, for an object off-centre.

The new plan starts where the tool is, the old command stood elsewhere; the difference e and its rate r at the change go
to zero as a cubic p with p(0) = e, p'(0) = r, p(T) = p'(T) = 0, so x_cmd and v_cmd do not jump.
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

    plan: for the object's centre, its time 0 at `begins`.  offset, rate: e [m, rad] and r [per s] at `begins`, gone
    after `blend` [s].  shift: how far the object sits from the middle of the blade along the tangent s [m].
    """

    plan: Plan
    begins: float = 0.0
    offset: Three = NOTHING
    rate: Three = NOTHING
    blend: float = 0.0
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
        tau = t - self.begins
        if self.blend > 0 and tau < self.blend and (self.offset != NOTHING or self.rate != NOTHING):
            T, s = self.blend, max(tau, 0.0) / self.blend
            p = ((2 * s - 3) * s * s + 1, ((s - 2) * s + 1) * s * T)
            dp = ((6 * s - 6) * s / T, (3 * s - 4) * s + 1)
            ddp = ((12 * s - 6) / T**2, (6 * s - 4) / T)
            for i, (e, r) in enumerate(zip(self.offset, self.rate, strict=True)):
                x[i] += e * p[0] + r * p[1]
                v[i] += e * dp[0] + r * dp[1]
                a[i] += e * ddp[0] + r * ddp[1]
        return x, v, a

    def led_over_from(self, last: Command, blend: float) -> Command:
        """This command with offset and rate such that it continues `last` at `begins`."""
        x, v, _ = last.at(self.begins)
        mine_x, mine_v, _ = replace(self, offset=NOTHING, rate=NOTHING).at(self.begins)
        e, r = ((old[0] - new[0], old[1] - new[1], old[2] - new[2]) for old, new in ((x, mine_x), (v, mine_v)))
        return replace(self, offset=e, rate=r, blend=blend)


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
