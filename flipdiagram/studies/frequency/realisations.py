"""How an observer may be realised, and which claims hold under which realisation."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from flipdiagram.scenario.one_dof import Frequency, OneDof
from flipdiagram.studies.frequency.claims import evaluate
from flipdiagram.studies.frequency.laboratory import WITH_OBSERVER, Laboratory, Measured

Progress = Callable[[str], None]
BEYOND = 3.0
"""A fourth frequency of Fig. 9, as a multiple of g_dis, where C12 is tried beyond the three panels."""
TEXTBOOK = {
    "nominal_mass_ratio": 1.0,
    "reference_scaled_by_nominal_mass": False,
    "velocity_cutoff": None,
    "feedforward": "command",
}
REALISATIONS: dict[str, dict[str, Any]] = {
    "textbook: r = 1, exact velocity": {},
    "r = 0.5": {"nominal_mass_ratio": 0.5},
    "r = 0": {"nominal_mass_ratio": 0.0},
    "r = 2, reference scaled": {"nominal_mass_ratio": 2.0, "reference_scaled_by_nominal_mass": True},
    "r = 0.5, reference scaled": {"nominal_mass_ratio": 0.5, "reference_scaled_by_nominal_mass": True},
    "documented, 10 Hz: r = 1, g_v = 62.8 rad/s": {"velocity_cutoff": 62.8},
    "documented, 20 Hz: r = 1, g_v = 125.7 rad/s": {"velocity_cutoff": 125.7},
    "r = 0.5, g_v = 62.8 rad/s": {"nominal_mass_ratio": 0.5, "velocity_cutoff": 62.8},
    "r = 0.5, FF of measured acceleration": {"nominal_mass_ratio": 0.5, "feedforward": "measured"},
}
"""Changes to TEXTBOOK, by name; documented: the velocity filters of the authors' group, in joint control and sliding
(10 and 20 Hz)."""
LOWEST, COUNT, CUT_OFFS, TOLERANCE = 1.0, 28, 9, 1e-4
"""The table is measured on fewer frequencies [rad/s] and cut-offs, and to a coarser tolerance, than the figures."""


def observer(settings: OneDof) -> dict[str, Any]:
    """The `observer` entry of summary.json."""
    return {
        "nominal_mass_ratio": settings.nominal_mass_ratio,
        "velocity_cutoff_rad_s": settings.velocity_cutoff,
        "reference_scaled_by_nominal_mass": settings.reference_scaled_by_nominal_mass,
        "feedforward": settings.feedforward,
    }


def measure_all(laboratory: Laboratory, progress: Progress = lambda text: None) -> Measured:
    """Everything the claims need, of the four architectures: commands with and without friction, noise, Fig. 9."""
    settings, study = laboratory.settings, laboratory.study
    omega = study.frequencies()
    loops = laboratory.loops(sorted({settings.g_dis, *study.g_dis}))
    laboratory.stable(loops)
    progress("responses without friction")
    linear = laboratory.responses(loops, omega)
    progress(f"responses with {settings.friction_model} friction")
    friction = laboratory.responses(loops, omega, "friction")
    progress("responses to velocity noise")
    noise = laboratory.responses(loops, omega, "noise")
    progress("maximum torque")
    cut_offs = np.geomspace(*study.torque_g_dis, study.torque_count)
    torque_omega = np.array([*study.torque_omega, BEYOND * settings.g_dis])
    torque = {}
    for name in laboratory.controllers:
        row = [(name, float(g)) for g in cut_offs] if name in WITH_OBSERVER else [(name, 0.0)]
        responses = laboratory.responses(row, torque_omega)
        missing = np.full(len(torque_omega), np.nan)
        torque[name] = np.stack([responses[loop].peak_force if loop in responses else missing for loop in row], axis=1)
    return Measured(settings, study, linear, friction, noise, torque_omega, cut_offs, torque, laboratory.unstable)


def laboratories(settings: OneDof, study: Frequency) -> dict[str, Laboratory]:
    """A laboratory for each realisation, with the mass, gains and friction of the settings, measuring coarsely."""
    changes = {"omega": None, "lowest": max(LOWEST, study.lowest), "count": COUNT, "torque_count": CUT_OFFS}
    coarse = study.model_copy(update=changes | {"tolerance": max(TOLERANCE, study.tolerance), "most_windows": 2})
    own = {name: settings.model_copy(update={**TEXTBOOK, **more}) for name, more in REALISATIONS.items()}
    return {name: Laboratory(of, coarse, lenient=True) for name, of in own.items()}


def judged(name: str, laboratory: Laboratory) -> dict[str, Any]:
    """The `realisations` entry of summary.json: which claims hold under a realisation."""
    holds = {claim["id"]: claim["holds"] for claim in evaluate(measure_all(laboratory))}
    entry = {"name": name, "observer": observer(laboratory.settings), "holding": sum(holds.values()), "holds": holds}
    return entry | {"unstable": list(laboratory.unstable.values())}


def best(rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The realisation under which most claims hold; of equals, the one nearest to the textbook's r = 1."""
    return max(rows, key=lambda row: (row["holding"], -abs(row["observer"]["nominal_mass_ratio"] - 1.0)))
