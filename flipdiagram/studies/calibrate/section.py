"""What is to be calibrated: the section `calibrate` of a campaign's file, whose `vary` are the priors."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from flipdiagram.campaign.checks import scenario_beside, specification
from flipdiagram.campaign.specification import Specification
from flipdiagram.campaign.specification_file import Source, read
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.text import Section
from flipdiagram.studies.calibrate.observations import DATA

MEDIAN, NEAREST = "median", "nearest"
"""Names of two scenarios and of their files: each unknown at its posterior's median, and the world nearest to the data.

The medians of unknowns one by one need not be a world that explains much; the nearest one shows what goes together.
"""
OWN_NAMES = {
    MEDIAN: "another name: that of the world at the posterior's medians",
    NEAREST: "another name: that of the world nearest to the paper",
}


class CalibrateSection(Section):
    """The section `calibrate`; the description of a field says what is valid."""

    starts: tuple[float, ...] = Field(
        (0.0, 0.06, 0.14), min_length=2, description="at least two starts on y [m], the last one the paper's last"
    )
    population: int = Field(100, ge=10, le=100_000, description="a whole number from 10 to 100000")
    """Draws that are kept, and drawn anew in each round."""
    rounds: int = Field(5, ge=0, le=100, description="a whole number from 0 to 100")
    """Of the sequential sampler; 0: rejection alone."""
    synthetic: int = Field(20, ge=0, le=10_000, description="a whole number from 0 to 10000")
    """Worlds whose own output is taken for data, to see whether they are found again."""
    hold_out: tuple[str, ...] = Field(
        ("position RMSE, last start", "E5"), description=f"a list of {', '.join(DATA)}, each held out by itself"
    )
    sources: dict[str, str] = Field(
        default_factory=dict, description="where the prior of an unknown comes from, by its name in `vary`"
    )
    compare: dict[str, str | None] = Field(
        default_factory=dict, description="a scenario's file for each name, null for the defaults"
    )
    """Scenarios that are flown beside the worlds and stand in the tables under these names."""


def load_calibration(
    path: str | Path, changes: Mapping[str, Any] | None = None
) -> tuple[Specification, CalibrateSection, dict[str, Scenario]]:
    """Read and check a campaign file with its section `calibrate`, and what it compares; InputError with the line."""
    source = read(path)
    priors = specification(source, Path(path).parent, changes)
    section = calibration(source, priors)
    return priors, section, compared(section, source, Path(path).parent)


def compared(section: CalibrateSection, source: Source, folder: Path) -> dict[str, Scenario]:
    """The scenarios to be flown beside the worlds, by name; a file is looked for in the folder first."""
    for name in OWN_NAMES.keys() & section.compare.keys():
        raise source.bad(["calibrate", "compare"], name, OWN_NAMES[name])
    found = {}
    for name, file in section.compare.items():
        with source.located(("calibrate", "compare")):
            found[name] = Scenario() if file is None else scenario_beside(folder, file)
    return found


def calibration(source: Source, priors: Specification) -> CalibrateSection:
    """Check the section `calibrate` of a campaign."""
    data = source.data.get("calibrate")
    if not isinstance(data, Mapping):
        raise source.bad(["calibrate"], data, f"a mapping of {', '.join(CalibrateSection.model_fields)}")
    section = source.validated(CalibrateSection, data, ("calibrate",))
    if len(set(section.starts)) < len(section.starts):
        raise source.bad(["calibrate", "starts"], list(section.starts), "different starts")
    for name in section.hold_out:
        if name not in DATA:
            raise source.bad(["calibrate", "hold_out"], name, f"one of {', '.join(DATA)}")
    names = [dimension.name for dimension in priors.dimensions]
    for name in section.sources:
        if name not in names:
            raise source.bad(["calibrate", "sources"], name, f"one of {', '.join(names)}")
    if priors.sampler in ("grid", "saltelli"):
        raise source.bad(["sampler"], priors.sampler, "random, lhs or sobol: draws from the priors")
    if section.population > priors.trials:
        raise source.bad(["calibrate", "population"], section.population, f"at most the trials, {priors.trials}")
    for start in section.starts:
        with source.located(("calibrate", "starts")):
            priors.base.with_overrides({"task.start_y": start})
    return section
