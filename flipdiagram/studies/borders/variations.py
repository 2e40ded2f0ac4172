"""Is it physics or the solver?  The same flips under other contact models, solvers, steps, and estimates of inertia."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydrake.multibody.plant import DiscreteContactApproximation

from flipdiagram.scenario.scenario import Scenario, Simulation

STEPS = (0.00025, 0.0005, 0.001)
"""Time steps of the plant [s]."""
INERTIA_ERROR = 0.3
"""How far our estimates of the inertias may be off."""


@dataclass(frozen=True)
class Variation:
    """One change of the scenario: the group it belongs to, its name, and the fields it sets."""

    group: str
    name: str
    overrides: Mapping[str, Any]


def variations_of(scenario: Scenario) -> Iterator[Variation]:
    """The scenario as it is, then each change alone."""
    physics = scenario.simulation
    yield Variation("scenario", "as it is", {})
    names = get_args(Simulation.model_fields["contact_approximation"].annotation)
    installed = [name for name in names if hasattr(DiscreteContactApproximation, f"k{name.capitalize()}")]
    installed = installed if physics.engine == "drake" else []  # MuJoCo has contact settings of its own
    for model in ("hydroelastic_with_fallback", "point"):
        for approximation in installed:
            if (model, approximation) != (physics.contact_model, physics.contact_approximation):
                fields = {"simulation.contact_model": model, "simulation.contact_approximation": approximation}
                words = "point" if model == "point" else "hydroelastic"
                yield Variation("contact", f"{words}, {approximation}", fields)
    for step in STEPS:
        if step != physics.step and step <= scenario.controller.period:
            yield Variation("step", f"{1000 * step:g} ms", {"simulation.step": step})
    arm, joints = scenario.arm, "SLURBT"
    for field, text in (("link_inertia_scale", "link"), ("reflected_inertia_scale", "rotor and gear")):
        together = getattr(arm, field)
        each = getattr(arm, f"{field}s") or (1.0,) * len(joints)
        for sign in (-1, 1):
            factor = 1 + sign * INERTIA_ERROR
            words = f"{100 * sign * INERTIA_ERROR:+.0f} %"
            yield Variation("inertia", f"every {text} {words}", {f"arm.{field}": together * factor})
            for k, joint in enumerate(joints):
                scales = tuple(value * (factor if i == k else 1.0) for i, value in enumerate(each))
                yield Variation("inertia", f"{text} of {joint} {words}", {f"arm.{field}s": scales})
