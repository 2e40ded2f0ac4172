"""The worlds of `flipdiagram pancake`: Young's modulus × friction × thickness, all known but that the object bends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from flipdiagram.flips.flip import Flip
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.scenario import Scenario

MODULI = (1e4, 5e4, 2e5, 1e6)
"""Young's moduli [Pa], from the softest that the default mesh carries to rubber."""
FRICTIONS = (0.3, 0.45, 0.6, 1.0)
QUICK_MODULI, QUICK_FRICTIONS, QUICK_MESH = (5e4, 1e6), (0.45, 1.0), {"object.refinement": 1}
"""Of a quick run: fewer worlds, and the coarsest mesh."""


@dataclass(frozen=True)
class World:
    """One pancake."""

    youngs_modulus: float
    """[Pa]."""
    friction: float
    thickness: float
    """[m]."""
    overrides: Mapping[str, Any]
    """Fields that make it of the study's scenario."""

    def as_dict(self) -> dict[str, float]:
        """Its place in the map."""
        return {"youngs_modulus_Pa": self.youngs_modulus, "friction": self.friction, "thickness_m": self.thickness}

    def flip(self, base: Scenario, architecture: str) -> Flip:
        """Flown under an architecture, its recording kept."""
        place = f"E{self.youngs_modulus:g}_mu{self.friction:g}_t{1000 * self.thickness:g}mm"
        return Flip(base.with_overrides(self.overrides), architecture, f"recordings/{place}_{architecture}.nc")


def worlds_of(
    base: Scenario, moduli: Sequence[float], frictions: Sequence[float], thicknesses: Sequence[float]
) -> list[World]:
    """Every combination once, by thickness, friction, modulus; a thicker one is as dense.  Raises InputError."""
    worlds = []
    for t, mu, E in product(*(dict.fromkeys(map(float, values)) for values in (thicknesses, frictions, moduli))):
        fields = {"object.youngs_modulus": E, "object.friction": mu}
        if t != base.object.thickness:
            mass = float(f"{base.object.mass * t / base.object.thickness:.12g}")
            fields |= {"object.thickness": t, "object.mass": mass}
        mesh_modulus(base.with_overrides(fields).object)  # what cannot be shows before anything is flown
        worlds.append(World(E, mu, t, fields))
    return worlds


def as_pancake(scenario: Scenario) -> Scenario:
    """The scenario with a pancake in it, where it has the block."""
    return scenario if scenario.object.kind == "pancake" else scenario.with_overrides({"object.kind": "pancake"})
