"""What the two MPC blocks share: checked settings, and x_cmd, v_cmd, a_cmd computed once for all three outputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DependencyTicket, LeafSystem, ValueProducer

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError

CHANNELS = 6
"""Task coordinates (y, z, θ, x, pitch, yaw): the MPC moves the first three, the others are held."""
Commands = tuple[Floats, Floats, Floats]


def standing(hold: ArrayLike, start_time: float) -> tuple[Floats, float]:
    """The pose that is held (6,) [m, rad] and the start of the motion >= 0 [s]; InputError for others."""
    if not (math.isfinite(start_time) and start_time >= 0):
        raise InputError(f"start_time = {start_time} s; it must be finite and >= 0")
    pose = np.array(hold, dtype=float)
    if pose.shape != (CHANNELS,):
        raise InputError(f"hold has shape {pose.shape}; valid is ({CHANNELS},)")
    return pose, float(start_time)


def declare_commands(
    system: LeafSystem, commands: Callable[[Context], Commands], tickets: Collection[DependencyTicket]
) -> None:
    """Declare the outputs x_cmd, v_cmd, a_cmd (6,) of a system; `commands` runs once for all three."""
    entry = system.DeclareCacheEntry(
        "command",
        ValueProducer(allocate=lambda: Value[object](), calc=lambda context, value: value.set_value(commands(context))),
        set(tickets),
    )
    ticket = {system.cache_entry_ticket(entry.cache_index())}

    def writer(index: int) -> Callable[[Context, BasicVector], None]:
        return lambda context, output: output.set_value(entry.Eval(context)[index])

    for i, name in enumerate(("x_cmd", "v_cmd", "a_cmd")):
        system.DeclareVectorOutputPort(name, CHANNELS, writer(i), ticket)
