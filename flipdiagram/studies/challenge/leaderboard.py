"""The leaderboard: stored results of many entries as Markdown, as a page of HTML, and as a picture."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markdown_it import MarkdownIt
from matplotlib.figure import Figure

from flipdiagram.errors import InputError
from flipdiagram.figures.style import GUIDE, new_axes, save, tidy
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.figures import COLORS
from flipdiagram.studies.challenge.replays import write_replays
from flipdiagram.studies.challenge.score import load_results
from flipdiagram.studies.challenge.suites import HELD_OUT, PUBLIC
from flipdiagram.studies.study import Progress, Summary, silent

FILE = "leaderboard.json"
Result = Mapping[str, Any]
MARK = " ≠"
"""Behind a rank that is another one under the other referee."""
TEXT = """# Leaderboard of the challenge

Suites {version} ({digest}); flipdiagram {flipdiagram}, Drake {drake}, MuJoCo as its extra has it. An entry is ranked by
how many blocks it turned over, within each suite and under each referee: Drake and MuJoCo. A rank marked{mark} differs
between the two. The interval is Wilson's, 95 %; held-out worlds are drawn from a secret ({secret}) that no entry has
seen. What the benchmark measures, and what it does not: see the page on the challenge.

"""


def run(scenario: Scenario, out: str | Path, *, leaderboard: Path, progress: Progress = silent) -> None:
    """Write leaderboard.json from the stored results of entries; `write_figures` makes the pages of it.

    Args:
        scenario: does not count.
        out: folder of the results.
        leaderboard: folder of the entries, with their summaries as `results`/NAME.json.
        progress: told how far it is.

    Raises InputError for a folder without results, and where they are of several versions of the suites.
    """
    found = load_results(leaderboard / "results")
    if len(versions := {entry["suite"]["digest"][:12] for entry in found}) > 1:
        problem = f"--leaderboard = '{leaderboard}' holds results of other suites, {', '.join(sorted(versions))}"
        raise InputError.of("--leaderboard", str(leaderboard), "results of one version", problem)
    kept = ("entry", "suite", "held_out", "of", "scores")
    entries = [{name: entry[name] for name in kept} for entry in found]
    write_summary(Path(out) / FILE, "leaderboard", Scenario(), {"folder": str(leaderboard), "entries": entries})


def write_figures(
    summary: Summary, out: Path, *, no_replay: bool = False, jobs: int | None = None, progress: Progress = silent
) -> list[str]:
    """Write the page as Markdown and HTML, its picture and, unless told not to, a replay of each entry."""
    entries = summary["entries"]
    save(plot_leaderboard(entries), out / "leaderboard")
    replays = {} if no_replay else write_replays(Path(summary["folder"]), entries, out, jobs, progress)
    text = markdown(entries, replays)
    write_atomically(out / "leaderboard.md", text)
    body = MarkdownIt("commonmark").enable("table").render(text)
    write_atomically(out / "leaderboard.html", PAGE.format(body=body))
    missing = [entry["entry"]["name"] for entry in entries if entry["entry"]["name"] not in replays]
    return [f"no replay, as the file is not there or has changed: {', '.join(missing)}"] if missing and replays else []


def tables(summary: Summary) -> list[Grid]:
    """A table for each suite."""
    suites = dict.fromkeys(row["suite"] for row in summary["entries"][0]["scores"])
    return [suite_grid(summary["entries"], suite) for suite in suites]


def markdown(entries: Sequence[Result], replays: Mapping[str, str]) -> str:
    """The page: a table for each suite, one of the other numbers, and who entered."""
    first = entries[0]
    secrets = sorted({entry["held_out"] for entry in entries if entry["held_out"]}) or ["none was flown"]
    parts = [
        TEXT.format(
            version=first["suite"]["version"],
            digest=first["suite"]["digest"][:12],
            secret=", ".join(secrets),
            mark=MARK,
            **{name: first["of"][name] for name in ("flipdiagram", "drake")},
        ),
        "![Blocks turned over](leaderboard.png)\n\n",
    ]
    for suite in dict.fromkeys(row["suite"] for row in first["scores"]):
        parts.append(f"## {suite}\n\n{suite_grid(entries, suite).markdown()}\n")
    parts.append(f"## Other numbers\n\n{number_grid(entries).markdown()}\n")
    parts.append(f"## Entries\n\n{entry_grid(entries, replays).markdown()}")
    return "".join(parts)


def suite_grid(entries: Sequence[Result], suite: str) -> Grid:
    """Rank, share and interval by kind of worlds and referee; the best under the first referee stands first."""
    columns = list(
        dict.fromkeys(
            (row["kind"], row["engine"]) for entry in entries for row in entry["scores"] if row["suite"] == suite
        )
    )
    ranks = {column: rank(entries, suite, *column) for column in columns}
    order = sorted(entries, key=lambda entry: ranks[columns[0]].get(entry["entry"]["name"], len(entries) + 1))
    rows = []
    for entry in order:
        name, cells = entry["entry"]["name"], []
        for kind, engine in columns:
            row = found(entry, kind, suite, engine)
            if row is None:
                cells.append("–")
                continue
            places = {ranks[kind, other][name] for k, other in columns if k == kind and name in ranks[kind, other]}
            place = f"{ranks[kind, engine][name]}.{MARK if len(places) > 1 else ''}"
            share = f"{100 * row['rate']:.0f} % ({100 * row['low']:.0f}–{100 * row['high']:.0f})"
            cells.append(f"{place} {share}")
        rows.append([name, *cells])
    headings = [f"{kind}, {engine}" for kind, engine in columns]
    return Grid(["entry", *headings], rows, suite, right=headings)


def rank(entries: Sequence[Result], suite: str, kind: str, engine: str) -> dict[str, int]:
    """Places by share of blocks turned over; equal shares share a place."""
    rates = {entry["entry"]["name"]: row["rate"] for entry in entries if (row := found(entry, kind, suite, engine))}
    return {name: 1 + sum(other > rate for other in rates.values()) for name, rate in rates.items()}


def found(entry: Result, kind: str, suite: str, engine: str) -> Mapping[str, Any] | None:
    """An entry's score in a suite; None where it has not flown it."""
    wanted = (kind, suite, engine)
    rows: list[Mapping[str, Any]] = entry["scores"]
    return next((row for row in rows if (row["kind"], row["suite"], row["engine"]) == wanted), None)


def number_grid(entries: Sequence[Result]) -> Grid:
    """Medians in the public uncertain worlds under Drake, the numbers that no rank counts."""
    rows = []
    for entry in entries:
        row = found(entry, PUBLIC, "uncertain", "drake") or entry["scores"][0]
        values = [(row["landing_cost_J"], 1), (row["position_rmse_m"], 100), (row["acceleration_rmse_m_s2"], 1)]
        values += [(row["torque_use"], 100), (row["compute_p50_s"], 1e6), (row["compute_p99_s"], 1e6)]
        values += [(row["noise_gain_Nms"], 1)]
        cells = ["–" if value is None else number(float(f"{factor * value:.3g}")) for value, factor in values]
        rows.append([entry["entry"]["name"], *cells])
    headings = ["landing J", "position RMSE [cm]", "acceleration RMSE [m/s²]", "torque [% of peak]", "P50 [µs]"]
    headings += ["P99 [µs]", "noise gain [N m s/rad]"]
    return Grid(["entry", *headings], rows, right=headings)


def entry_grid(entries: Sequence[Result], replays: Mapping[str, str]) -> Grid:
    """Who entered, with what, and from where the idea comes."""
    rows = []
    for summary in entries:
        entry = summary["entry"]
        replay = replays.get(entry["name"])
        name = f"[{entry['name']}]({replay})" if replay else entry["name"]
        rows.append([name, entry["author"], ", ".join(entry["kinds"]), entry["reference"], entry["digest"][:12]])
    return Grid(["entry", "author", "enters with", "reference", "digest"], rows)


def plot_leaderboard(entries: Sequence[Result]) -> Figure:
    """A panel for each suite, a row for each entry: the share turned over, public filled and held-out open."""
    suites = list(dict.fromkeys(row["suite"] for row in entries[0]["scores"]))
    names = [entry["entry"]["name"] for entry in entries]
    axes = new_axes(len(suites), (9.6, 0.28 * len(names) + 1.3), columns=len(suites))
    for ax, suite in zip(axes, suites, strict=True):
        for y, entry in enumerate(entries):
            for shift, engine in ((-0.14, "drake"), (0.14, "mujoco")):
                for kind in (PUBLIC, HELD_OUT):
                    row = found(entry, kind, suite, engine)
                    if row is None:
                        continue
                    rate, low, high = (100 * row[key] for key in ("rate", "low", "high"))
                    color, first = COLORS[engine], y == 0
                    if kind == PUBLIC:
                        ax.plot([low, high], [y + shift] * 2, color=color, linewidth=0.9, alpha=0.7)
                    face, label = (color if kind == PUBLIC else "white"), f"{kind}, {engine}" if first else None
                    ax.plot(rate, y + shift, "o", color=color, markerfacecolor=face, markersize=4, label=label)
        ax.set_title(suite, fontsize=9)
        ax.set_xlim(-3, 103)
        ax.set_xlabel("turned over [%]")
        ax.set_yticks(range(len(names)), names if ax is axes[0] else [""] * len(names), fontsize=7.5)
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.set_xticks(np.arange(0, 101, 25))
        for x in (25, 50, 75):
            ax.axvline(x, **GUIDE)
        tidy(ax)
    axes[-1].legend(fontsize=6.5, framealpha=0.9)
    figure = axes[0].figure
    assert isinstance(figure, Figure)
    return figure


PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Leaderboard of the challenge</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 72em; margin: 2em auto; padding: 0 1em; color: #222 }}
table {{ border-collapse: collapse; display: block; overflow-x: auto }}
td, th {{ padding: .25em .7em; border-bottom: 1px solid #ddd; text-align: left; white-space: nowrap }}
img {{ max-width: 100% }}
</style>
{body}
</html>
"""
