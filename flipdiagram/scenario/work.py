"""The work that a scenario asks for, in seconds of a typical core, estimated before anything runs."""

import math
from collections.abc import Callable

from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario, value_of

MOST_MINUTES = 30.0
"""That a flip, or the study of section III, may take by estimate unless the command says --yes."""
STEP_SECONDS, PLAN_SECONDS, REPLAN_SECONDS = 0.0005, 0.8, 0.001
"""Of a step of the plant, a plan of the default, a replanning of the default with four linearisations."""
SAMPLES_CUBED = 2e-6
"""Seconds that a plan takes longer for the cube of its samples: 3 s at 120, 23 s at 240."""
TICKS_A_SECOND = 2e7
"""Channel-steps of the loop of section III."""
LOOPS, SHORTEST_WINDOW = 50, 2000
"""Loops that its study drives at each frequency, its realisations included; fewest ticks of a window."""

Work = Callable[[Scenario], dict[str, float]]


def flip_work(scenario: Scenario) -> dict[str, float]:
    """Seconds of one flip, by the field that decides them."""
    settings, planner = scenario.simulation, scenario.planner
    each = STEP_SECONDS / settings.step
    samples = planner.contact_samples[1] + planner.samples_to_rest
    motion = (samples + planner.flight_samples[1]) * planner.sampling_time
    again = planner.max_iterations / 30
    work = {
        "simulation.hold_time": settings.lead_time * each,
        "simulation.settle_time": settings.settle_time * each,
        "planner.sampling_time": motion * each,
        "planner.contact_samples": PLAN_SECONDS + SAMPLES_CUBED * samples**3 * max(again, 1.0),
    }
    if planner.replan_period is not None:
        tries = planner.replan_iterations / 4 * (2 * planner.replan_search + 1) ** 2
        one = (REPLAN_SECONDS + SAMPLES_CUBED / 30 * samples**3) * tries
        work["planner.replan_period"] = motion / planner.replan_period * one
    return work


def place_work(scenario: Scenario) -> dict[str, float]:
    """Seconds of laying the object down once."""
    place, each = scenario.place, STEP_SECONDS / scenario.simulation.step
    own = {f"place.{name}": getattr(place, name) * each for name in ("tilt_time", "wait", "retreat_time")}
    return flip_work(scenario) | own


def frequency_work(scenario: Scenario) -> dict[str, float]:
    """Seconds of the study of section III, two windows at each frequency."""
    step, study = scenario.one_dof.step, scenario.frequency
    ticks = sum(max(2 * math.pi / (w * step), SHORTEST_WINDOW) for w in study.frequencies())
    slow = "frequency.lowest" if study.omega is None else "frequency.omega"
    return {
        slow: 2 * LOOPS * ticks / TICKS_A_SECOND,
        "frequency.noise_time": LOOPS * study.noise_time / step / TICKS_A_SECOND,
        "frequency.torque_count": LOOPS * study.torque_count * SHORTEST_WINDOW / TICKS_A_SECOND,
    }


def check_work(scenario: Scenario, work: Work) -> None:
    """InputError where it would take more than `MOST_MINUTES`, naming the field that costs most."""
    seconds = work(scenario)
    if sum(seconds.values()) <= 60 * MOST_MINUTES:
        return
    field = max(seconds, key=lambda path: seconds[path])
    took = f"a run would take about {sum(seconds.values()) / 60:.3g} min"
    problem = f"scenario field '{field}' = {value_of(scenario, field)!r}: {took}"
    valid = f"one that leaves it at most {MOST_MINUTES:g} min by estimate, or --yes"
    raise InputError.of(field, value_of(scenario, field), valid, problem)
