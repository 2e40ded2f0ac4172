"""Pancakes without physics: how each ends is a rule of its modulus and friction.  Workers import this by its name."""

import math
from dataclasses import replace
from functools import lru_cache

import synthetic
from campaign.made_up import metrics_of, plan

from flipdiagram.flips.flight import Landed, Work, provenance
from flipdiagram.flips.flip import Flip
from flipdiagram.flips.outcome import Outcome
from flipdiagram.simulation.events import Touchdown
from flipdiagram.simulation.recording_files import load_recording, save_recording

signals = lru_cache(synthetic.recording)
BENT = {"largest_deformation_energy_J": 0.01, "largest_overhang": 0.2, "turned_share": 1.0, "away_m": 0.01}
PLANNED = {"touchdown_y_m": -0.04, "touchdown_angle_rad": 2.9, "touchdown_time_s": 0.5}
DIVERGES = 8e3
"""Modulus [Pa] at which nothing is measured."""


def flown(flight, border, y):
    """Turned over above a friction that is higher for a soft one; folded below."""
    pancake = flight.truth.object
    won = pancake.friction > border + (0.2 if pancake.youngs_modulus < 2e4 else 0.0)
    failure = None if won else "folded, 9 % of its upper face look up"
    landed = Touchdown(0.5 + y, 0.0, 0.18, 3.0 - y)
    measured = replace(metrics_of(flight, won), failure=failure, touchdown=landed)
    bent = BENT | {"final_x_m": 0.5, "final_y_m": y, "mass_kg": pancake.mass}
    return Landed(Outcome(measured, failure, {"bending": bent, **PLANNED}, 0.5), 0.0, *provenance())


def fly(flight, plan):
    if flight.truth.object.youngs_modulus == DIVERGES:
        return Landed(Outcome(None, "diverged: the pancake is stretched to 1 m"), 0.0, *provenance())
    landed = flown(flight, 0.4 if "dob" in flight.architecture else math.inf, 0.0)
    landed.outcome.plan["bending"]["real_time_factor"] = 0.5
    key = Flip(flight.truth, flight.architecture).key
    save_recording(signals(flight.architecture), landed.outcome.metrics, flight.recording, key)
    return landed


def replay(flight, plan):
    """As in the other engine, where it needs 0.1 more friction; what it reads is the recording of the same flip."""
    assert load_recording(flight.recording).attrs["architecture"] == flight.architecture
    return flown(flight, 0.5 if "dob" in flight.architecture else math.inf, 0.003)


WORK, REPLAY = Work(plan, fly), Work(plan, replay)
