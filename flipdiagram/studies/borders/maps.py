"""The questions of `flipdiagram borders`: what is varied, over which values, and why.  Declarations only."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario

LAB_INERTIA = (0.5, 1.5, 0.8, 0.4, 0.5, 0.01)
"""M_n [kg·m²] that the authors' laboratory gives for its arm, constant over the motion."""

Overrides = Mapping[str, Any]
Sets = str | Callable[[Any], Overrides]
"""The field that has the value of an axis, or the fields that a value sets."""


@dataclass(frozen=True)
class Axis:
    """One direction of a map: its label with unit, its values as shown, and the fields that each of them sets."""

    label: str
    values: tuple[float | str, ...]
    overrides: tuple[Overrides, ...]
    logarithmic: bool = False

    @classmethod
    def of(cls, label: str, values: Sequence[float | str], sets: Sets, logarithmic: bool = False) -> Axis:
        """An axis with these values."""
        plain = tuple(v if isinstance(v, str) else float(v) for v in values)
        overrides = tuple({sets: v} if isinstance(sets, str) else sets(v) for v in plain)
        return cls(label, plain, overrides, logarithmic)


@dataclass(frozen=True)
class Map:
    """One border map: every architecture over two axes."""

    name: str
    title: str
    question: str
    x: Axis
    y: Axis


def maps_of(scenario: Scenario, resolution: int | None = None) -> dict[str, Map]:
    """All maps by name, around the numbers of a scenario.

    resolution: points per axis; finer than the default where it is larger, thinner where it is smaller.
    """
    if resolution is not None and resolution < 2:
        raise InputError.of("resolution", resolution, "a whole number of at least 2")
    maps = (*_disturbances(resolution), _gains(scenario, resolution), _cone(resolution), *_estimates(resolution))
    return {a_map.name: a_map for a_map in maps}


def _grid(low: float, high: float, default: int, resolution: int | None) -> list[float]:
    return [float(f"{value:.4f}") + 0.0 for value in np.linspace(low, high, resolution or default)]


def _squares(high: float, default: int, resolution: int | None) -> list[float]:
    """0 to `high`, closer together near 0."""
    return [float(f"{high * value**2:.4f}") for value in np.linspace(0.0, 1.0, resolution or default)]


def _ratios(low: float, high: float, default: int, resolution: int | None) -> list[float]:
    return [float(f"{value:.3g}") for value in np.geomspace(low, high, resolution or default)]


def _friction(default: int, resolution: int | None) -> Axis:
    def fields(level: float) -> Overrides:
        # viscous friction grows in proportion, transition too where the default's would chatter
        return {
            "joint_friction.coulomb": level,
            "joint_friction.viscous": 0.33 * level,
            "joint_friction.transition_velocity": max(0.06, 0.45 * level),
        }

    return Axis.of("joint friction [of rated torque]", _grid(0.0, 0.2, default, resolution), fields)


def _disturbances(resolution: int | None) -> Iterator[Map]:
    yield Map(
        "disturbance",
        "Small and large disturbances",
        "Conclusion 2 of the paper: FF is effective in small disturbances, the observer in large ones.",
        Axis.of(
            "gravity left to feedback [of the arm's]",
            _squares(1.0, 6, resolution),
            lambda left: {"controller.gravity_compensation": round(1.0 - left, 6)},
        ),
        _friction(5, resolution),
    )
    yield Map(
        "payload",
        "Unknown payload, gravity of the arm compensated",
        "How heavy a load, unknown to plan and controller, may hang at the flange where the arm's own weight is known?",
        Axis.of(
            "unknown payload [kg]",
            _squares(2.0, 5, resolution),
            lambda mass: {"disturbance.payload": mass, "controller.gravity_compensation": 1.0},
        ),
        _friction(4, resolution),
    )
    yield Map(
        "clearance",
        "Distance from the table",
        "Where is the border of E1: how far from the table must the plan keep the blade of an arm that sags?",
        Axis.of(
            "least distance of blade and table in the plan [m]",
            _grid(0.01, 0.08, 8, resolution),
            "planner.table_clearance",
        ),
        _friction(3, resolution),
    )


def _gains(scenario: Scenario, resolution: int | None) -> Map:
    k_p, k_v, g_dis = scenario.controller.k_p, scenario.controller.k_v, scenario.controller.g_dis
    damping = k_v / (2 * k_p**0.5) if k_p else 1.0
    return Map(
        "gains",
        "Gains",
        "Can higher PD gains replace the observer, and how fast may it be?  (k_v keeps the damping ratio.)",
        Axis.of(
            "k_p [1/s²]",
            _ratios(k_p / 5 or 70.0, k_p * 40 or 14000.0, 6, resolution),
            lambda gain: {"controller.k_p": gain, "controller.k_v": round(2 * damping * gain**0.5, 6)},
            logarithmic=True,
        ),
        Axis.of("g_dis [rad/s]", _ratios(g_dis / 6, g_dis * 24, 6, resolution), "controller.g_dis", logarithmic=True),
    )


def _cone(resolution: int | None) -> Map:
    return Map(
        "cone",
        "Friction of the block and margin of the plan",
        "How slippery may the block be, and how much of its friction may the plan use?  (below 0: more than there is)",
        Axis.of(
            "friction coefficient of the block [1]",
            _ratios(0.3, 1.86, 5, resolution),
            "object.friction",
            logarithmic=True,
        ),
        Axis.of("planning margin [of the friction]", _grid(-0.6, 0.4, 6, resolution), "planner.friction_margin"),
    )


def _estimates(resolution: int | None) -> Iterator[Map]:
    scales: list[float | str] = [*_ratios(1 / 3, 3.0, 7, resolution), "lab"]
    cutoffs: list[float | str] = [*_ratios(40.0, 1000.0, 5, resolution), "exact"]
    delays = sorted({round(delay) for delay in np.linspace(0, 12, resolution or 5)})

    def inertia(scale: float | str) -> Overrides:
        constant, scale = (LAB_INERTIA, 1.0) if scale == "lab" else (None, scale)
        return {"controller.nominal_inertia": constant, "controller.nominal_inertia_scale": scale}

    def filtered(cutoff: float | str) -> Overrides:
        return {"sensors.velocity_cutoff": None if cutoff == "exact" else cutoff}

    yield Map(
        "inertia",
        "Error of the nominal inertia",
        "How wrong may M_n be?  (lab: the constant M_n of the authors' laboratory)",
        Axis.of("nominal inertia [of diag M(q) at the start]", scales, inertia, logarithmic=True),
        _friction(3, resolution),
    )
    yield Map(
        "sensing",
        "Velocity filter and delay",
        "How slow may the velocity filter be, and how old the measurement?",
        Axis.of("cut-off of the velocity filter [rad/s]", cutoffs, filtered, logarithmic=True),
        Axis.of("delay [periods of 1 ms]", delays, lambda delay: {"sensors.delay": int(delay)}),
    )
