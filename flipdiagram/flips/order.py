"""What travels between driver and workers: an order, of which the worker makes a flight, and a row ready to keep.

The driver of a thousand workers has no time for a flip: drawing, checking and the text of a row are the worker's.
"""

import time
import zlib
from collections.abc import Callable, Hashable
from typing import Protocol

from flipdiagram.files import plain
from flipdiagram.flips.flight import Flight, Landed, Planned
from flipdiagram.flips.flip import scenario_digest
from flipdiagram.flips.row import PackedRow, Row
from flipdiagram.flips.store import PackedPlan
from flipdiagram.scenario.scenario import Scenario


class Order(Protocol):
    """A flip to be flown: a `Flight`, or what a worker makes one from; it is pickled."""

    @property
    def motion(self) -> Hashable:
        """Orders with equal ones fly the same plan."""

    def flight(self) -> Flight:
        """The flip itself; InputError where it cannot be."""


def plan_order(plan: Callable[[Scenario], Planned], order: Order) -> PackedPlan:
    """Plan the motion of an order."""
    text, error = plan(order.flight().believed)
    return None if text is None else zlib.compress(text.encode()), error


def fly_order(fly: Callable[[Flight, str], Landed], order: Order, plan: bytes) -> PackedRow:
    """Fly an order; its row, as after the first attempt."""
    flight = order.flight()
    return row_of(flight, fly(flight, zlib.decompress(plan).decode())).packed()


def row_of(flight: Flight, landed: Landed, attempts: int = 1) -> Row:
    """A flip that has ended now as a row of the store."""
    outcome = landed.outcome
    measured = outcome.metrics and outcome.metrics.as_dict() | {"torque_use": outcome.torque_use}
    return Row(
        trial=flight.trial,
        architecture=flight.architecture,
        outcome=outcome.mode,
        failure=outcome.failure,
        seed=flight.seed,
        scenario_hash=scenario_digest(flight.truth),
        overrides=plain(flight.overrides),
        values=plain(flight.values),
        metrics=plain(measured),
        plan=plain(outcome.plan),
        code=landed.code,
        versions=landed.versions,
        seconds=landed.seconds,
        host=landed.host,
        attempts=attempts,
        finished=time.time(),
    )
