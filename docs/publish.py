"""Copy a finished report into docs/report, and its summary table into the README between the markers.

    python docs/publish.py out/report

The numbers in README.md and docs/report come from that run: none is typed by hand.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
from pathlib import Path

from flipdiagram.report.claims import readme_block

ROOT = Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- report: begin -->\n", "<!-- report: end -->\n"


def main() -> int:
    """Publish the report named on the command line; refuses a quick one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", type=Path, help="folder of `flipdiagram report`")
    folder = parser.parse_args().report
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if summary["quick"]:
        print(f"{folder} is a quick report; valid is a whole one", file=sys.stderr)
        return 2
    target = ROOT / "docs" / "report"
    shutil.rmtree(target, ignore_errors=True)
    for name in ("report.md", "summary.json"):
        _copy(folder / name, target / name)
    for picture in re.findall(r"\]\(([^)]+\.png)\)", (folder / "report.md").read_text(encoding="utf-8")):
        _copy(folder / picture, target / picture)
    readme = ROOT / "README.md"
    readme.write_text(with_block(readme.read_text(encoding="utf-8"), readme_block(summary)), encoding="utf-8")
    print(f"published to {target.relative_to(ROOT)} and README.md")
    return 0


def with_block(text: str, block: str) -> str:
    """The README's text with a new block between the markers."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + block + END + rest.split(END)[1]


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


if __name__ == "__main__":
    sys.exit(main())
