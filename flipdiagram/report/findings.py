"""Sentences derived from the border maps: where an architecture works, and which verdicts are fragile."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flipdiagram.figures.style import NAMES
from flipdiagram.scenario.scenario import ARCHITECTURES

Summary = Mapping[str, Any]


def border_sentences(a_map: Summary) -> list[str]:
    """For each architecture: everywhere, nowhere, or in how many cells of a map, and the failures by kind."""
    lines = []
    for name in ARCHITECTURES:
        cells = a_map["architectures"][name]
        won = [value for row in cells["success"] for value in row]
        kinds: dict[str, int] = {}
        for failure in (text for row in cells["failure"] for text in row if text):
            kind = kind_of(failure)
            kinds[kind] = kinds.get(kind, 0) + 1
        where = "everywhere" if all(won) else "nowhere" if not any(won) else f"in {sum(won)} of {len(won)} cells"
        text = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items(), key=lambda item: -item[1]))
        lines.append(f"* **{NAMES[name]}** works {where}" + (f"; failures: {text}" if text else ""))
    return ["\n".join(lines)]


def kind_of(failure: str) -> str:
    """The kind of a failure text: 'blade hit the table', 'dropped', 'landed wrong', 'no plan', 'diverged', …"""
    for start, kind in (
        ("blade hit the table", "blade hit the table"),
        ("dropped", "dropped"),
        ("landed", "landed at a wrong angle"),
        ("never", "never landed"),
        ("no plan", "no plan"),
        ("diverged", "diverged"),
        ("refused", "refused"),
    ):
        if failure.startswith(start):
            return kind
    return "other"


def lead_sentence(borders: Summary) -> str:
    """Where E3's slight lead of FF + DOB appears although it does not in the scenario as it is."""
    where = []
    for a_map in borders["maps"]:
        delay = {name: a_map["architectures"][name]["velocity_delay_s"] for name in ("pd+dob", "pd+ff+dob")}
        success = {name: a_map["architectures"][name]["success"] for name in delay}
        cells = [
            (j, i)
            for j, row in enumerate(delay["pd+dob"])
            for i in range(len(row))
            if all(success[name][j][i] for name in delay)
        ]
        holds = [(j, i) for j, i in cells if delay["pd+ff+dob"][j][i] < 0 < delay["pd+dob"][j][i]]
        if holds:
            where.append(f"{len(holds)} of {len(cells)} cells of '{a_map['title']}'")
    if not where:
        return "E3's slight lead of FF + DOB with a slight lag of DOB appears in no cell of these maps."
    return "E3's slight lag of DOB with a slight lead of FF + DOB appears in " + ", ".join(where) + "."


def fragile_sentence(borders: Summary, experiment: Summary) -> str:
    """Which verdicts differ under another solver, step, estimate or engine."""
    lines = []
    for row in borders["variations"]:
        if row["fragile"]:
            names = ", ".join(NAMES[name] for name in row["fragile"])
            lines.append(f"* {row['group']} '{row['name']}': the verdict of {names} differs")
    engines = experiment.get("second_engine")
    apart = sum(not row["agree"] for row in engines["runs"]) if engines else 0
    if engines:
        runs = len(engines["runs"])
        lines.append(f"* MuJoCo, given the same tool motions: {runs - apart} of {runs} verdicts are the same")
    if not borders["variations"]:
        return "\n".join(lines)
    fragile = [row for row in borders["variations"] if row["fragile"]]
    head = (
        f"Of {len(borders['variations']) - 1} variations of contact model, solver, step and inertias,"
        f" {len(fragile)} change a verdict; a verdict that changes is fragile:"
    )
    return "\n".join([head, "", *lines])
