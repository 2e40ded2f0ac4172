"""Sentences derived from the border maps: where an architecture works, and which verdicts are fragile."""

from collections import Counter

import numpy as np

from flipdiagram.figures.style import NAMES
from flipdiagram.flips.outcome import mode_of
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.studies.study import Summary


def border_sentences(a_map: Summary) -> str:
    """For each architecture: everywhere, nowhere, or in how many cells of a map, and the failures by kind."""
    lines = []
    for name in ARCHITECTURES:
        cells = a_map["architectures"][name]
        won = [value for row in cells["success"] for value in row]
        kinds = Counter(mode_of(failure) for row in cells["failure"] for failure in row if failure)
        where = "everywhere" if all(won) else "nowhere" if not any(won) else f"in {sum(won)} of {len(won)} cells"
        text = ", ".join(f"{kind} {count}" for kind, count in kinds.most_common())
        lines.append(f"* **{NAMES[name]}** works {where}" + (f"; failures: {text}" if text else ""))
    return "\n".join(lines)


def lead_sentence(borders: Summary) -> str:
    """Where E3's slight lead of FF + DOB appears although it does not in the scenario as it is."""
    where = []
    for a_map in borders["maps"]:
        delay = {name: a_map["architectures"][name]["velocity_delay_s"] for name in ("pd+dob", "pd+ff+dob")}
        both = np.all([a_map["architectures"][name]["success"] for name in delay], axis=0)
        lead, lag = (np.array(delay[name], dtype=float)[both] for name in ("pd+ff+dob", "pd+dob"))
        if holds := np.count_nonzero((lead < 0) & (lag > 0)):
            where.append(f"{holds} of {np.count_nonzero(both)} cells of '{a_map['title']}'")
    if not where:
        return "E3's slight lead of FF + DOB with a slight lag of DOB appears in no cell of these maps."
    return "E3's slight lag of DOB with a slight lead of FF + DOB appears in " + ", ".join(where) + "."


def fragile_sentence(borders: Summary, experiment: Summary) -> str:
    """Which verdicts differ under another solver, step, estimate or engine."""
    fragile = [row for row in borders["variations"] if row["fragile"]]
    lines = []
    for row in fragile:
        names = ", ".join(NAMES[name] for name in row["fragile"])
        lines.append(f"* {row['group']} '{row['name']}': the verdict of {names} differs")
    if engines := experiment.get("second_engine"):
        same = sum(row["agree"] for row in engines)
        lines.append(f"* MuJoCo as the plant: {same} of {len(engines)} verdicts are the same")
    if not borders["variations"]:
        return "\n".join(lines)
    head = (
        f"Of {len(borders['variations']) - 1} variations of contact model, solver, step and inertias,"
        f" {len(fragile)} change a verdict; a verdict that changes is fragile:"
    )
    return "\n".join([head, "", *lines])
