"""What a campaign's file says, written out: summary.json, figures, and campaign.md."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flipdiagram.campaign.analysis import analyse
from flipdiagram.campaign.dataset import load_dataset
from flipdiagram.campaign.figures import plot_tuning, write_figures
from flipdiagram.campaign.run import FILE
from flipdiagram.campaign.tables import section, tuning_section
from flipdiagram.figures.style import save
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.scenario.scenario import Scenario, from_mapping

TUNING = "tuning.json"
"""What the tuner found, in its folder."""


def write_analysis(file: Path, out: Path) -> dict[str, Any]:
    """Analyse a campaign's file, of a running one what is there; returns the summary.  Raises InputError."""
    data = load_dataset(file)
    specification = json.loads(data.attrs["specification"])
    body: dict[str, Any] = analyse(data)
    body["figures"] = write_figures(body, data, out)
    body["specification"] = {key: value for key, value in specification.items() if key != "base"}
    written = write_summary(out / "summary.json", "campaign", from_mapping(specification["base"]), body)
    summary: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    write_atomically(out / "campaign.md", f"# Campaign\n\n{section(summary)}")
    return summary


def write_tuning(tuning: dict[str, Any], base: Scenario, out: Path) -> None:
    """Write what the tuner found: tuning.json, tuning.md and a figure."""
    save(plot_tuning(tuning), out / "tuning")
    write_summary(out / TUNING, "tuning", base, tuning)
    text = f"# Tuned gains\n\n{tuning_section(tuning)}\n![Search and verdict](tuning.png)\n"
    write_atomically(out / "tuning.md", text)


def report_section(folder: Path, names: Sequence[str] = ("campaign", "tuning")) -> str:
    """What the reproduction report shows of campaigns and of tuned gains below `folder`/name; '' without them."""
    parts = [section(write_analysis(folder / name / FILE, folder / name), name) for name in _with(folder, names, FILE)]
    for name in _with(folder, names, TUNING):
        tuning = json.loads((folder / name / TUNING).read_text(encoding="utf-8"))
        picture = f"![Search and verdict of the tuner]({name}/tuning.png)"
        parts.append(f"### Default gains against tuned ones\n\n{tuning_section(tuning)}\n{picture}\n")
    return "\n".join(parts)


def _with(folder: Path, names: Sequence[str], file: str) -> list[str]:
    return [name for name in names if (folder / name / file).is_file()]
