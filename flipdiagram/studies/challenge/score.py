"""What an entry's flips say: success first, with its interval, then numbers side by side; no blended one."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.campaign.statistics import holm, paired, success_rate
from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import NOT_PHYSICS, SUCCESS

Row = Mapping[str, Any]
Result = Mapping[str, Any]
"""The summary of an entry."""
MEDIANS = (
    "landing_cost_J",
    "position_rmse_m",
    "acceleration_rmse_m_s2",
    "torque_use",
    "compute_p50_s",
    "compute_p99_s",
    "noise_gain_Nms",
)
"""Numbers of a flip of which the median over a suite is told, where there are any."""


def scores(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """By kind of worlds, suite and engine: flips, those turned over with Wilson's interval, and medians.

    Every world counts: an entry that raises, hangs or finds no motion has not turned the block over.
    """
    groups: dict[tuple[str, str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["kind"], row["suite"], row["engine"]].append(row)
    return [_score(kind, suite, engine, of) for (kind, suite, engine), of in groups.items()]


def _score(kind: str, suite: str, engine: str, rows: Sequence[Row]) -> dict[str, Any]:
    won = sum(row["outcome"] == SUCCESS for row in rows)
    entry: dict[str, Any] = {"kind": kind, "suite": suite, "engine": engine, "flips": len(rows), "turned_over": won}
    entry |= success_rate(won, len(rows))
    for name in MEDIANS:
        values = [row[name] for row in rows if row.get(name) is not None and np.isfinite(row[name])]
        entry[name] = float(np.median(values)) if values else None
    return entry | {"modes": dict(Counter(row["outcome"] for row in rows).most_common())}


def found(entry: Result, kind: str, suite: str, engine: str) -> Mapping[str, Any] | None:
    """An entry's score in a suite; None where it has not flown it."""
    wanted = (kind, suite, engine)
    rows: list[Mapping[str, Any]] = entry["scores"]
    return next((row for row in rows if (row["kind"], row["suite"], row["engine"]) == wanted), None)


def problems(rows: Sequence[Row]) -> list[str]:
    """What an entry did wrong, a line each: how often, what, and where first."""
    first: dict[str, Row] = {}
    count: Counter[str] = Counter()
    for row in rows:
        if row["outcome"] in NOT_PHYSICS or str(row["failure"]).startswith("no plan: '"):
            text = str(row["failure"])
            first.setdefault(text, row)
            count[text] += 1
    return [
        f"{number} of {len(rows)} flips: {text} (first in {first[text]['kind']} {first[text]['suite']}"
        f" {first[text]['index']}, {first[text]['engine']})"
        for text, number in count.most_common()
    ]


def paired_with(rows: Iterable[Row], other: Mapping[str, Any]) -> dict[str, Any]:
    """By kind and suite: the same worlds in the same engines under another entry, and McNemar's p.

    The p are corrected for the suites that are looked at (Holm).
    """
    theirs = {(row["hash"], row["engine"]): row["outcome"] == SUCCESS for row in other["flips"]}
    groups: dict[tuple[str, str], list[tuple[bool, bool]]] = defaultdict(list)
    for row in rows:
        if (key := (row["hash"], row["engine"])) in theirs:
            groups[row["kind"], row["suite"]].append((row["outcome"] == SUCCESS, theirs[key]))
    compared = [paired(*zip(*pairs, strict=True)) for pairs in groups.values()]
    adjusted = holm([entry["p"] for entry in compared])
    entries = [
        {"kind": kind, "suite": suite, **entry, "p_holm": p}
        for (kind, suite), entry, p in zip(groups, compared, adjusted, strict=True)
    ]
    return {"name": other["entry"]["name"], "suites": entries}


def load_results(folder: str | Path) -> list[dict[str, Any]]:
    """The summaries of entries in a folder, `*.json`, by name; raises InputError for a folder without any."""
    results = []
    for file in sorted(Path(folder).glob("*.json")):
        try:
            summary = json.loads(file.read_text(encoding="utf-8"))
            if summary["schema"] != "flipdiagram/challenge/1":
                raise KeyError("schema")
        except (OSError, ValueError, KeyError, TypeError):
            valid = "summary.json of flipdiagram challenge"
            raise InputError.of("results", str(file), valid, f"'{file}' is no result of an entry") from None
        results.append(summary)
    if not results:
        valid = "one that holds summaries of entries, NAME.json"
        raise InputError.of("results", str(folder), valid, f"folder '{folder}' holds no results")
    return results
