"""All claims, C1–C14 and E1–E8, in one list: what the paper says, whether it holds, what was measured."""

from typing import Any

from flipdiagram.grid import BAD, Grid, verdict
from flipdiagram.studies.frequency.claims import TEXTS
from flipdiagram.studies.frequency.tables import FIGURES, numbers
from flipdiagram.studies.study import Summary


def all_claims(frequency: Summary, experiment: Summary) -> list[dict[str, Any]]:
    """One entry a claim: id, where in the paper, claim, holds, measured, the paper's number, remark, command."""
    section_iii = [
        (c | {"measured": numbers(c), "claim": TEXTS[c["id"]]}, f"Fig. {FIGURES[c['id']]}", "flipdiagram frequency")
        for c in frequency["claims"]
    ]
    section_iv = [(c | {"claim": c["text"]}, "section IV", "flipdiagram experiment") for c in experiment["claims"]]
    return [
        {"id": c["id"], "place": place, "claim": c["claim"], "holds": c["holds"], "measured": c["measured"]}
        | {"paper": c.get("paper", "figure, no number"), "remark": c.get("difference", ""), "command": command}
        for c, place, command in section_iii + section_iv
    ]


def tables(summary: Summary) -> list[Grid | str | None]:
    """What a terminal shows."""
    quick = "a quick report: coarse, two starts, not the numbers to quote" if summary["quick"] else None
    return [claims_grid(summary), quick]


def claims_grid(summary: Summary, *, commands: bool = False) -> Grid:
    """The claims of a report's summary as a table; with the command that reproduces each row."""
    headings = ["", "in the paper", "claim", "holds", "measured here", "the paper"]
    rows = []
    for entry in summary["claims"]:
        remark = f" ({entry['remark']})" if entry["remark"] else ""
        holds = verdict(entry["holds"])
        row = [entry["id"], entry["place"], entry["claim"], f"**{holds}**" if holds == BAD else holds]
        row += [entry["measured"] + remark, entry["paper"]]
        rows.append([*row, f"`{entry['command']}`"] if commands else row)
    return Grid([*headings, "command"] if commands else headings, rows)
