"""What the report shows of studies that take hours, where they lie in its folder: they are never run for it."""

import json
from dataclasses import dataclass
from pathlib import Path

from flipdiagram.campaign.study import report_section
from flipdiagram.grid import Grid
from flipdiagram.studies.registry import STUDIES


@dataclass(frozen=True)
class Section:
    """A heading, what the study did, and its pictures with their captions."""

    heading: str
    text: str
    pictures: tuple[tuple[str, str], ...]


SECTIONS = {
    "engines": Section(
        "Do the engines agree?",
        "The worlds of a campaign flown in Drake and in MuJoCo, closed loop: the same diagram and the same controller.",
        (("engines", "Verdicts of both engines, over the two parameters that tell their worlds apart best"),),
    ),
    "calibrate": Section(
        "Which worlds explain what the paper measured?",
        "Worlds drawn from priors of what the paper does not tell, flown, and kept where they print its numbers.",
        (
            ("predictions", "The paper's numbers, and those of the worlds before and after"),
            ("posterior", "The unknowns that the numbers tell most about"),
        ),
    ),
    "inverse": Section(
        "In which worlds does the block slide off as the paper tells?",
        "Worlds of a wide box in which PD and PD+FF lose the block by sliding, with no strike before, and both with"
        " observer keep it.",
        (("mechanism", "The world with the smallest change: friction used, way slid, speeds of the joints"),),
    ),
    "pancake": Section(
        "Does a pancake turn over too?",
        "A disc of finite elements takes the place of the block; the plan takes it for rigid. Each flip was replayed in"
        " MuJoCo on the same motion of the blade.",
        (
            ("map", "How each flip ended, by Young's modulus and friction"),
            ("engines", "The same flips in Drake and in MuJoCo's flex"),
        ),
    ),
}
"""By the study, which is the name of its folder."""


def optional_sections(folder: Path) -> str:
    """The sections of the studies below `folder` that are there, campaign and tuning last; '' without any."""
    parts = [section(name, folder / name) for name in SECTIONS if _there(folder / name)]
    campaign = report_section(folder)
    return "\n\n".join([*parts, f"## How often does it work?\n\n{campaign}"] if campaign else parts)


def _there(folder: Path) -> bool:
    return (folder / "summary.json").is_file()


def section(name: str, folder: Path) -> str:
    """The section of a study that lies in a folder, its figures drawn anew."""
    of = SECTIONS[name]
    study, summary = STUDIES[name], json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    study.figures(summary, folder)
    grids = [grid.section() for grid in study.tables(summary) if isinstance(grid, Grid) and grid.rows]
    drawn = [(picture, text) for picture, text in of.pictures if (folder / f"{picture}.png").is_file()]
    pictures = [f"![{text}]({name}/{picture}.png)\n\n*{text}*" for picture, text in drawn]
    return "\n\n".join([f"## {of.heading}", of.text, *grids, *pictures])
