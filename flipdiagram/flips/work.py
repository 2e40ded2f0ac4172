"""What a worker does: plan a motion, fly a trial.  Scenarios and plans travel as data, diagrams do not."""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from flipdiagram.diagrams.controller import nominal_inertia
from flipdiagram.errors import InputError, PlanningError, SimulationError
from flipdiagram.files import versions
from flipdiagram.flips.flips import SOURCES, Flip, Outcome, fly_one
from flipdiagram.flips.provenance import code_version
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.planning.planner import Planner
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.cell import Arm
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.metrics import FlipMetrics

Planned = tuple[str | None, str | None]
"""(plan as JSON, None) or (None, why there is none)."""


@dataclass(frozen=True)
class Flight:
    """One flip to be flown: what is true, what planner and controller believe, and the plan."""

    truth: Scenario
    believed: Scenario
    architecture: str
    seed: int
    plan: str
    """The plan as JSON."""

    @property
    def plan_key(self) -> str:
        """Name of the motion that is needed."""
        return Flip(self.believed, self.architecture).plan_key


@dataclass(frozen=True)
class Landed:
    """What became of a flight."""

    outcome: Outcome
    torque_use: float | None
    """Largest torque of any joint over its limit; 1: saturated."""
    seconds: float
    code: str
    versions: dict[str, str]
    host: str


@dataclass(frozen=True)
class Work:
    """The two functions that workers call; importable by name, as only their names travel."""

    plan: Callable[[Scenario], Planned]
    fly: Callable[[Flight], Landed]


def plan_trial(believed: Scenario) -> Planned:
    """Plan a motion, or say why there is none."""
    try:
        return plan_motion(believed).to_json(), None
    except (PlanningError, SimulationError, InputError) as error:
        return None, str(error)


def fly_trial(flight: Flight) -> Landed:
    """Fly a trial; what goes wrong with the physics is its outcome."""
    scenario = flight.truth
    if scenario.controller.nominal_inertia is None and flight.believed.arm != scenario.arm:
        # the controller's M_n is of the arm as it is believed to be
        fields = {"controller.nominal_inertia": _inertia(flight.believed)}
        scenario = scenario.with_overrides(fields)
    flip = Flip(scenario, flight.architecture)
    outcome, seconds = fly_one(flip, _plan(flight.plan), Path())
    return Landed(outcome, _torque_use(scenario, outcome.metrics), seconds, *provenance())


def provenance() -> tuple[str, dict[str, str], str]:
    """Code, versions and host of this process."""
    return code_version(SOURCES), versions() | {"numpy": np.__version__}, _host()


@lru_cache(maxsize=4)
def _plan(text: str) -> Plan:
    return Plan.from_json(text, "stored plan")


@lru_cache(maxsize=1)
def _host() -> str:
    return socket.gethostname()


@lru_cache(maxsize=16)
def _inertia(believed: Scenario) -> tuple[float, ...]:
    arm = arm_of(believed)
    unscaled = believed.with_overrides({"controller.nominal_inertia_scale": 1.0})
    return tuple(float(value) for value in nominal_inertia(unscaled, arm, Planner(believed, arm).q_start))


def _torque_use(scenario: Scenario, metrics: FlipMetrics | None) -> float | None:
    if metrics is None:
        return None
    # torque limits do not depend on inertias, which vary from trial to trial
    names = ("link_inertia_scale", "reflected_inertia_scale", "link_inertia_scales", "reflected_inertia_scales")
    arm = scenario.arm.model_copy(update={name: Arm.model_fields[name].default for name in names})
    return float(np.max(np.array(metrics.max_torque_Nm) / _limits(arm)))


@lru_cache(maxsize=16)
def _limits(arm: Arm) -> np.ndarray:
    return np.array(arm_of(Scenario(arm=arm)).tau_max)
