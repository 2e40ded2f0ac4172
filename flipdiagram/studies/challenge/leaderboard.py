"""The leaderboard: stored results of many entries as Markdown, as a page of HTML, and as a picture."""

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from markdown_it import MarkdownIt

from flipdiagram.errors import InputError
from flipdiagram.figures.style import save
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.grid import Grid
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.figures import plot_leaderboard
from flipdiagram.studies.challenge.replays import write_replays
from flipdiagram.studies.challenge.score import Result, found, load_results
from flipdiagram.studies.challenge.suites import PUBLIC
from flipdiagram.studies.challenge.tables import HEADINGS, number_cells
from flipdiagram.studies.study import Progress, Summary, silent

FILE = "leaderboard.json"
NOISY = "uncertain"
"""The suite in which there is a noise gain."""
MARK = " ≠"
"""Behind a rank that is another one under the other referee."""
TEXT = """# Leaderboard of the challenge

Suites {version} ({digest}); flipdiagram {flipdiagram}, Drake {drake}, MuJoCo {mujoco}. An entry is ranked by
how many blocks it turned over, within each suite and under each referee, Drake and MuJoCo; a dash: not flown.
Marked{mark}: among the entries that flew under both referees its rank differs between them. The interval is Wilson's,
95 %; held-out worlds are drawn from a secret ({secret}) that no entry has seen. What the benchmark measures, and
what it does not: see the page on the challenge.

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
    results = load_results(leaderboard / "results")
    if len(versions := {entry["suite"]["digest"][:12] for entry in results}) > 1:
        problem = f"--leaderboard = '{leaderboard}' holds results of other suites, {', '.join(sorted(versions))}"
        raise InputError.of("--leaderboard", str(leaderboard), "results of one version", problem)
    kept = ("entry", "suite", "held_out", "of", "scores")
    entries = [{name: entry[name] for name in kept} for entry in results]
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
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    write_atomically(out / "index.html", PAGE.format(body=body))
    missing = [entry["entry"]["name"] for entry in entries if entry["entry"]["name"] not in replays]
    return [f"no replay, as the file is not there or has changed: {', '.join(missing)}"] if missing and replays else []


def tables(summary: Summary) -> list[Grid]:
    """A table for each suite."""
    suites = dict.fromkeys(row["suite"] for row in summary["entries"][0]["scores"])
    return [suite_grid(summary["entries"], suite) for suite in suites]


def markdown(entries: Sequence[Result], replays: Mapping[str, str]) -> str:
    """The page: a table for each suite, one of the other numbers, and who entered."""
    entries = [_escaped(entry) for entry in entries]  # texts of strangers
    first = entries[0]
    secrets = sorted({entry["held_out"] for entry in entries if entry["held_out"]}) or ["none was flown"]
    parts = [
        TEXT.format(
            version=first["suite"]["version"],
            digest=first["suite"]["digest"][:12],
            secret=", ".join(secrets),
            mark=MARK,
            **{name: first["of"].get(name, "not installed") for name in ("flipdiagram", "drake", "mujoco")},
        ),
        "![Blocks turned over](leaderboard.png)\n\n",
    ]
    for suite in dict.fromkeys(row["suite"] for row in first["scores"]):
        parts.append(f"## {suite}\n\n{suite_grid(entries, suite).markdown()}\n")
    parts.append(f"## Other numbers\n\n{number_grid(entries).section()}\n")
    parts.append(f"## Entries\n\n{entry_grid(entries, replays).markdown()}")
    return "".join(parts)


def _escaped(result: Result) -> Result:
    texts = {name: escape(value, quote=False) for name, value in result["entry"].items() if isinstance(value, str)}
    return {**result, "entry": result["entry"] | texts}


def suite_grid(entries: Sequence[Result], suite: str) -> Grid:
    """Rank, share and interval by kind of worlds and referee, under which most entries flew first, and so ordered."""
    flown = Counter((row["kind"], row["engine"]) for e in entries for row in e["scores"] if row["suite"] == suite)
    columns = sorted(flown, key=lambda column: (column[0] != PUBLIC, -flown[column], column[1]))
    ranks = {column: rank(entries, suite, *column) for column in columns}
    # a rank can only be another one among those that flew under both referees
    both = [entry for entry in entries if all(found(entry, kind, suite, engine) for kind, engine in columns)]
    compared = {column: rank(both, suite, *column) for column in columns}
    order = sorted(
        entries, key=lambda entry: [ranks[column].get(entry["entry"]["name"], len(entries) + 1) for column in columns]
    )
    rows = []
    for entry in order:
        name, cells = entry["entry"]["name"], []
        for kind, engine in columns:
            row = found(entry, kind, suite, engine)
            if row is None:
                cells.append("–")
                continue
            places = {
                compared[kind, other][name] for k, other in columns if k == kind and name in compared[kind, other]
            }
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


def number_grid(entries: Sequence[Result]) -> Grid:
    """Medians in the public worlds of a suite, the one with noise, under the referee of most: what no rank counts."""
    flown = Counter(
        (row["suite"], row["engine"]) for entry in entries for row in entry["scores"] if row["kind"] == PUBLIC
    )
    suite, engine = max(flown, key=lambda column: (column[0] == NOISY, flown[column]))
    rows = [[entry["entry"]["name"], *number_cells(found(entry, PUBLIC, suite, engine))] for entry in entries]
    return Grid(["entry", *HEADINGS], rows, f"medians in the public worlds of {suite}, {engine}", right=HEADINGS)


def entry_grid(entries: Sequence[Result], replays: Mapping[str, str]) -> Grid:
    """Who entered, with what, and from where the idea comes."""
    rows = []
    for summary in entries:
        entry = summary["entry"]
        replay = replays.get(entry["name"])
        name = f"[{entry['name']}]({replay})" if replay else entry["name"]
        rows.append([name, entry["author"], ", ".join(entry["kinds"]), entry["reference"], entry["digest"][:12]])
    return Grid(["entry", "author", "enters with", "reference", "digest"], rows)


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
