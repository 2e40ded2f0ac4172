"""Copy finished results into docs/, a short table of them into the README between the markers, long ones into pages.

    python docs/publish.py out/report       what `flipdiagram report` wrote
    python docs/publish.py out/bench        what `make bench` wrote
    python docs/publish.py out/engines      what `flipdiagram engines` wrote

The numbers in README.md and docs come from those runs: none is typed by hand.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from flipdiagram.grid import Grid
from flipdiagram.report.claims import claims_grid
from flipdiagram.report.optional import section

ROOT = Path(__file__).resolve().parent.parent
LONG = {"report": "explanation/what-holds.md", "engines": "how-to/solver-and-engine.md"}
"""Pages of docs/ that show what the README has no room for, between markers of the same names."""
FIRST_ROWS = (
    "The whole command: wall time",
    "Plan from cold: whole process",
    "Replan at N = 25: whole replan",
    "One simulation, replay off: real time / whole call",
    "A campaign: flips a second, two processes",
    "The whole of Figs 5 to 10: wall time, empty cache",
    "Engines side by side: drake: flips a second, two processes",
    "Engines side by side: mujoco: flips a second, two processes",
    "The 1-DOF loop, compiled and elsewhere: compiled / uncompiled diagram, Drake's Simulator",
)
"""Rows of the benchmark that the README shows."""


def main() -> int:
    """Publish the folder named on the command line; refuses a quick run, and a benchmark of some pieces only."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of `flipdiagram report`, `flipdiagram engines`, `make bench`")
    folder = parser.parse_args().folder
    of_bench = (folder / "bench.json").exists()
    found = json.loads((folder / ("bench.json" if of_bench else "summary.json")).read_text(encoding="utf-8"))
    if found.get("quick") or (of_bench and not found["complete"]):
        print(f"{folder} is not of a whole run; valid is one", file=sys.stderr)
        return 2
    kind = "bench" if of_bench else found["schema"].split("/")[1]
    block = bench(folder) if of_bench else {"report": report, "engines": engines}[kind](folder, found)
    _fill(ROOT / "README.md", kind, block)
    if kind in LONG:
        _fill(ROOT / "docs" / LONG[kind], kind, {"report": claims_block, "engines": engines_block}[kind](found))
    print("published to docs and README.md")
    return 0


def report(folder: Path, summary: dict[str, Any]) -> str:
    """Copy a report with its pictures; returns what the README shows of it."""
    target = ROOT / "docs" / "report"
    shutil.rmtree(target, ignore_errors=True)
    for name in ("report.md", "summary.json"):
        _copy(folder / name, target / name)
    for picture in re.findall(r"\]\(([^)]+\.png)\)", (folder / "report.md").read_text(encoding="utf-8")):
        _copy(folder / picture, target / picture)
    return readme_block(summary)


def readme_block(summary: dict[str, Any]) -> str:
    """What the README shows of a report: which claims hold, a row for each section of the paper."""
    rows = []
    for letter, section_name in (("C", "III, one axis: C1–C14"), ("E", "IV, the robot: E1–E8")):
        claims = [entry for entry in summary["claims"] if entry["id"].startswith(letter)]
        failed = [f"{entry['id']}: {entry['claim']}" for entry in claims if not entry["holds"]]
        rows.append((section_name, f"{len(claims) - len(failed)} of {len(claims)}", "<br>".join(failed) or "–"))
    return Grid(("section", "hold", "do not hold as the paper tells"), rows).markdown()


def claims_block(summary: dict[str, Any]) -> str:
    """How many claims hold, and the table of all of them."""
    failed = [entry["id"] for entry in summary["claims"] if not entry["holds"]]
    held = len(summary["claims"]) - len(failed)
    versions = summary["versions"]
    intro = (
        f"{held} of {len(summary['claims'])} claims hold in this physics; {', '.join(failed) or 'none'}"
        f" {'does' if len(failed) == 1 else 'do'} not (Drake {versions['drake']}, Python {versions['python']}):\n\n"
    )
    return intro + claims_grid(summary).markdown()


def engines(folder: Path, summary: dict[str, Any]) -> str:
    """Write where two engines agree into docs/engines.md; returns what the README shows of it."""
    versions = summary["versions"]
    head = (
        f"# Two engines\n\nDrake {versions['drake']}, Python {versions['python']}. [Why they differ, and which to"
        " choose](how-to/solver-and-engine.md).\n\n"
    )
    _copy(folder / "engines.png", ROOT / "docs" / "engines.png")
    text = section("engines", folder).replace("](engines/", "](")
    (ROOT / "docs" / "engines.md").write_text(head + text + "\n", encoding="utf-8")
    equal, counted = _agreement(summary)
    return f"{equal} of {counted} random flips, {100 * equal / counted:.1f} %, end alike in Drake and in MuJoCo.\n"


def engines_block(summary: dict[str, Any]) -> str:
    """Where two engines agree, controller by controller."""
    equal, counted = _agreement(summary)
    by_name = ", ".join(
        f"{name} {100 * entry['rate']:.1f} % ({100 * entry['low']:.1f}–{100 * entry['high']:.1f} %)"
        for name, entry in summary["architectures"].items()
    )
    share = f"{equal} of {counted} flips, {100 * equal / counted:.1f} %"
    return (
        f"In {summary['trials']} worlds drawn by `examples/engines.yaml`, with four controllers each, both engines"
        f" say the same of {share}: {by_name}. [Two engines](../engines.md) shows where the others lie.\n"
    )


def _agreement(summary: dict[str, Any]) -> tuple[int, int]:
    """Flips of which both engines say the same, and all that were counted."""
    entries = summary["architectures"].values()
    equal, counted = (sum(entry[name] for entry in entries) for name in ("equal", "counted"))
    return equal, counted


def bench(folder: Path) -> str:
    """Copy a benchmark; returns what the README shows of it."""
    _copy(folder / "bench.md", ROOT / "docs" / "bench.md")
    return targets((folder / "bench.md").read_text(encoding="utf-8"))


def targets(text: str) -> str:
    """How many targets of bench.md's first table are met, and the rows of it that a user feels."""
    table = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)[0]
    head, rule, *rows = table.splitlines()
    met = sum(row.endswith("| met |") for row in rows)
    shown = [row for name in FIRST_ROWS for row in rows if row.startswith(f"| {name} |")]
    return f"\n{met} of {len(rows)} targets are met; these matter most:\n\n" + "\n".join([head, rule, *shown]) + "\n\n"


def with_block(text: str, name: str, block: str) -> str:
    """A page's text with a new block between the markers of that name."""
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->\n"
    before, rest = text.split(begin)
    return before + begin + block + end + rest.split(end)[1]


def _fill(page: Path, name: str, block: str) -> None:
    page.write_text(with_block(page.read_text(encoding="utf-8"), name, block), encoding="utf-8")


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


if __name__ == "__main__":
    sys.exit(main())
