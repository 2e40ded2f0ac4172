"""Every number that a run assumes: its value, unit, and where it comes from, read from the scenario and the models."""

import re

from flipdiagram.grid import Grid
from flipdiagram.robot.model_files import urdf_directory
from flipdiagram.scenario.scenario import ORIGINS, Scenario
from flipdiagram.scenario.text import fields_of, unit_of
from flipdiagram.scenario.yaml_reader import show

NOT_ASSUMED = ("frequency",)
"""Sections that say how a study measures, not what it assumes."""


def scenario_grid(scenario: Scenario) -> Grid:
    """A row for every field of the scenario: value, unit, meaning, origin."""
    rows, default = [], Scenario()
    for path, field in fields_of(Scenario).items():
        section, name = path.split(".")
        if section in NOT_ASSUMED:
            continue
        text, unit = field.description or "", unit_of(field)
        mark = re.search(r"\s*\(([pHMLo])(?::\s*([^)]*))?\)", text)
        value = getattr(getattr(scenario, section), name)
        origin = ORIGINS[mark[1]] + (f": {mark[2]}" if mark[2] else "") if mark else _unmarked(name, value)
        if value != (usual := getattr(getattr(default, section), name)):
            origin = f"set for this run; the default, {show(usual)}, is of: {origin}"
        plain = re.sub(r"\s*\([pHMLo](?::[^)]*)?\)", "", text)
        rows.append([f"`{path}`", show(value), "" if unit == "1" else unit, plain, origin])
    return Grid(["field", "value", "unit", "meaning", "origin"], rows)


def _unmarked(name: str, value: object) -> str:
    neutral = value is None or value == 0 or ("scale" in name and value == 1)
    return "neutral: changes nothing" if neutral else ORIGINS["o"]


def model_grid() -> Grid:
    """A row for every comment on a number in `urdf/`: file, and what it says with its confidence [H] [M] [L]."""
    rows = []
    for path in sorted(urdf_directory().glob("*df")):
        for comment in re.findall(r"<!--(.*?)-->", path.read_text(encoding="utf-8"), re.DOTALL):
            for part in re.split(r"\n\s*\n", comment.strip()):
                if re.search(r"\[[HML]", part):
                    rows.append([f"`urdf/{path.name}`", " ".join(part.split())])
    return Grid(["file", "number and source, confidence [H] high [M] medium [L] low"], rows)
