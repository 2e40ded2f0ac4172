"""What a scenario with a pancake has instead of the block's: other defaults, and rules of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flipdiagram.scenario.text import invalid

if TYPE_CHECKING:
    from flipdiagram.scenario.cell import Object, Tool
    from flipdiagram.scenario.scenario import Simulation

PANCAKE: dict[str, dict[str, Any]] = {
    "object": {"diameter": 0.12, "thickness": 0.012, "mass": 0.1, "friction": 0.6},
    "tool": {"blade_length": 0.13, "blade_width": 0.13},
    "simulation": {"contact_approximation": "sap"},
}
"""Defaults where the object is a pancake: one like an okonomiyaki for one person, and a blade that it fits."""


def kind_in(data: Mapping[str, Any]) -> str | None:
    """The kind of object that nested mappings name; None where they name none."""
    section = data.get("object")
    return section.get("kind") if isinstance(section, Mapping) else getattr(section, "kind", None)


def with_defaults(data: Mapping[str, Any]) -> dict[str, Any]:
    """The sections, with a pancake's defaults for what they do not say; the object's own section knows its own."""
    filled = dict(data)
    for section, fields in PANCAKE.items():
        if section != "object" and isinstance(given := filled.get(section, {}), Mapping):
            filled[section] = {**fields, **given}
    return filled


def check_pancake(pancake: Object, tool: Tool, settings: Simulation) -> None:
    """Raise unless Drake's SAP solver moves it and it does not reach the flange; it may hang over the blade."""
    if pancake.width / 2 >= tool.reach:
        edge = "width" if pancake.diameter is None else "diameter"
        raise invalid(f"object.{edge}", pancake.width, f"below twice tool.reach = {tool.reach} [m]")
    where = "where object.kind is pancake"
    if settings.engine != "drake":
        raise invalid("simulation.engine", settings.engine, f"drake {where}")
    if settings.contact_approximation != "sap":
        raise invalid("simulation.contact_approximation", settings.contact_approximation, f"sap {where}")
