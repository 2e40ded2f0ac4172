"""What a campaign's file says, written out: summary.json, figures, and campaign.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from flipdiagram.campaign.analysis import analyse
from flipdiagram.campaign.conduct import FILE
from flipdiagram.campaign.dataset import load_dataset
from flipdiagram.campaign_figures import plot_tuning, write_figures
from flipdiagram.campaign_tables import section, tuning_section
from flipdiagram.figures import save
from flipdiagram.files import write_atomically, write_summary
from flipdiagram.scenario import Scenario, from_mapping


def write_analysis(file: str | Path, out: str | Path) -> dict[str, Any]:
    """Analyse a campaign's file, of a running one what is there; returns the summary.  Raises ScenarioError."""
    out = Path(out)
    data = load_dataset(file)
    specification = json.loads(data.attrs["specification"])
    body: dict[str, Any] = analyse(data)
    body["figures"] = write_figures(body, data, out)
    body["specification"] = {key: value for key, value in specification.items() if key != "base"}
    written = write_summary(out / "summary.json", "campaign", from_mapping(specification["base"]), body)
    summary: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    write_atomically(out / "campaign.md", f"# Campaign\n\n{section(summary)}")
    return summary


def write_tuning(tuning: dict[str, Any], base: Scenario, out: str | Path) -> dict[str, Any]:
    """Write what the tuner found: tuning.json, tuning.md and a figure; returns the summary."""
    out = Path(out)
    save(plot_tuning(tuning), out / "tuning")
    written = write_summary(out / "tuning.json", "tuning", base, tuning)
    text = f"# Tuned gains\n\n{tuning_section(tuning)}\n![Search and verdict](tuning.png)\n"
    write_atomically(out / "tuning.md", text)
    summary: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    return summary


def report_section(folder: Path, name: str = "campaign") -> str:
    """What the reproduction report shows of a campaign, and of tuned gains, below `folder`/`name`; '' without them."""
    out, parts = folder / name, []
    if (out / FILE).is_file():
        parts.append(section(write_analysis(out / FILE, out), name))
    if (out / "tuning.json").is_file():
        tuning = json.loads((out / "tuning.json").read_text(encoding="utf-8"))
        parts.append(f"{tuning_section(tuning)}\n![Search and verdict of the tuner]({name}/tuning.png)\n")
    return "\n".join(parts)
