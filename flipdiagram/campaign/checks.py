"""From a campaign's file to a Specification: all that can be known before anything runs is checked."""

import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from flipdiagram.campaign.distributions import distribution, is_number
from flipdiagram.campaign.specification import UNKNOWN_SECTIONS, Dimension, Specification, elements_of
from flipdiagram.campaign.specification_file import MOST_TRIALS, Source, SpecificationFile, parse, read
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError, PlanningError, SimulationError
from flipdiagram.flips.flip import NOT_OF_A_FLIP
from flipdiagram.scenario.scenario import Scenario, field_paths, from_mapping, load_scenario, value_of
from flipdiagram.scenario.text import unknown_field
from flipdiagram.scenario.work import flip_work

CHECKED = 5_000
"""Trials whose scenario is tried beforehand, 0.1 ms each; of a longer campaign those spread evenly."""
BUILT = 40
"""Borders at which the diagram itself is built beforehand, 50 ms each."""
BUILD_SECONDS = 0.15
"""Of a typical core, for building and judging a flip."""


def load_specification(path: str | Path, changes: Mapping[str, Any] | None = None) -> Specification:
    """Read and check a campaign file; a base scenario that it names is looked for beside it first.

    changes: fields of the base by path that count more than the file, such as those of the command line.
    """
    return specification(read(path), Path(path).parent, changes)


def specification_of(given: Specification | Mapping[str, Any] | str | os.PathLike[str]) -> Specification:
    """A campaign as a file, or as what would stand in one: {"vary": {...}, "trials": 100}, its base a Scenario or not.

    Raises InputError, as for a file.
    """
    if isinstance(given, Specification):
        return given
    if isinstance(given, str | os.PathLike):
        return load_specification(Path(given))
    if not isinstance(given, Mapping):
        raise InputError.of("specification", given, "the name of a file, or a mapping as it would stand in one")
    base = given.get("base")
    data = dict(given) | ({"base": base.model_dump(mode="json")} if isinstance(base, Scenario) else {})
    try:
        text = json.dumps(data)
    except (TypeError, ValueError) as error:
        valid = "texts, numbers, lists and mappings of these"
        raise InputError.of("specification", given, valid, f"a campaign's mapping cannot be written: {error}") from None
    parsed = parse(text, "specification")
    return specification(replace(parsed, lines={}), Path("."))  # its lines are of no file


def from_text(text: str, name: str = "campaign.yaml") -> Specification:
    """Check the text of a campaign file."""
    return specification(parse(text, name), Path("."))


def specification(source: Source, folder: Path, changes: Mapping[str, Any] | None = None) -> Specification:
    """Check everything of a campaign that can be known before it runs; raises InputError with the line."""
    checked = drawn_from(source, folder, changes)
    _check_scenarios(source, checked)
    return checked


def drawn_from(source: Source, folder: Path, changes: Mapping[str, Any] | None = None) -> Specification:
    """The campaign of a file, of which no scenario has been tried yet; raises InputError with the line."""
    file = source.validated(SpecificationFile, source.data)
    base = _base(source, file, folder).with_overrides(changes or {})
    dimensions = _dimensions(source, file, base)
    if len(set(file.architectures)) < len(file.architectures):
        valid = str(SpecificationFile.model_fields["architectures"].description)
        raise source.bad(["architectures"], list(file.architectures), valid)
    unknown = [field for d in dimensions for field in d.fields if field.split(".")[0] in UNKNOWN_SECTIONS]
    if any(field not in unknown for field in file.known):
        fields = ", ".join(unknown) or "none is varied here"
        valid = f"{SpecificationFile.model_fields['known'].description}: {fields}"
        raise source.bad(["known"], list(file.known), valid)
    return Specification(
        base=base,
        dimensions=dimensions,
        trials=_trials(source, file, dimensions),
        text=source.text,
        name=source.name,
        **file.model_dump(exclude={"base", "vary", "trials", "tune", "calibrate"}),
    )


def estimated_hours(specification: Specification, jobs: int) -> float:
    """Wall time of the whole campaign on `jobs` cores [h], from the speed of a typical core."""
    seconds = flip_work(specification.base)
    plan = seconds.pop("planner.contact_samples")
    flips = specification.rows * (BUILD_SECONDS + sum(seconds.values()))
    plans = (specification.trials if specification.planned else 1) * plan
    return (flips + plans) / jobs / 3600


def check_estimate(specification: Specification, jobs: int, share: float = 1.0) -> None:
    """InputError where a share of the campaign, as what is missing, would take longer than its `limit_hours`."""
    hours = estimated_hours(specification, jobs) * share
    if hours <= specification.limit_hours:
        return
    source = parse(specification.text, specification.name)
    needed = f"{hours:.3g} h on {jobs} core{'s' if jobs > 1 else ''}, limit_hours is {specification.limit_hours:g}"
    most = max(int(specification.trials * specification.limit_hours / hours), 1)
    valid = f"valid are about {most} trials, a higher limit_hours, or --yes"
    raise source.error(["trials"], f"{specification.rows} flips would take about {needed}; {valid}")


def _base(source: Source, file: SpecificationFile, folder: Path) -> Scenario:
    with source.located(("base",)):
        return scenario_beside(folder, file.base) if isinstance(file.base, str) else from_mapping(file.base or {})


def scenario_beside(folder: Path, name: str) -> Scenario:
    """A scenario that a file in a folder names: looked for beside it first.  Raises InputError."""
    beside = folder / name
    return load_scenario(beside if beside.is_file() else name)


def _dimensions(source: Source, file: SpecificationFile, base: Scenario) -> tuple[Dimension, ...]:
    dimensions: list[Dimension] = []
    for key, data in file.vary.items():
        path, fields = ("vary", key), tuple(part.strip() for part in key.split(","))
        for field in fields:
            if field not in field_paths():
                raise source.error(path, str(unknown_field(Scenario, field)))
            if field.split(".")[0] in NOT_OF_A_FLIP:
                text = f"{field} belongs to section III, no flip depends on it; valid are fields of a flip"
                raise source.error(path, text)
            if any(field in dimension.fields for dimension in dimensions) or fields.count(field) > 1:
                raise source.error(path, f"{field} stands twice; valid is once")
        with source.located(path, f"{key}: "):
            dimensions += _dimensions_of(base, key, fields, data)
    return tuple(dimensions)


def _dimensions_of(base: Scenario, key: str, fields: tuple[str, ...], data: Any) -> list[Dimension]:
    if not (isinstance(data, Mapping) and "scale" in data):
        return [Dimension(key, fields, distribution(data))]
    if len(data) > 1:
        raise InputError("valid is scale: {distribution: [numbers]} alone")
    factor = distribution(data["scale"])
    if not all(map(is_number, factor.ends())):
        raise InputError("scale takes numbers only")
    elements = elements_of(base, fields[0])
    if len(fields) == 1 and elements:  # each element on its own
        return [Dimension(f"{key}[{k}]", fields, factor, True, k) for k in range(len(elements))]
    for field in fields:
        value = value_of(base, field)
        if not isinstance(value, float):
            raise InputError(f"{field} = {value!r} of the base cannot be scaled; valid is a number, or one list")
    return [Dimension(key, fields, factor, True)]


def _trials(source: Source, file: SpecificationFile, dimensions: tuple[Dimension, ...]) -> int:
    given, trials = "trials" in file.model_fields_set, file.trials
    if file.sampler == "grid":
        for dimension in dimensions:
            if dimension.distribution.values is None:
                text = f"{dimension.name}: the grid needs values; valid are grid, choice and integers"
                raise source.error(["vary", dimension.name.split("[")[0]], text)
        product = math.prod(len(dimension.distribution.values or ()) for dimension in dimensions)
        if given and trials != product:
            raise source.bad(["trials"], trials, f"{product}, the product of the grids, or leave it out")
        if product > MOST_TRIALS:
            raise source.error(["vary"], f"the grid has {product} points; valid are at most {MOST_TRIALS}")
        return product
    if not given:
        raise source.bad(["trials"], None, str(SpecificationFile.model_fields["trials"].description))
    if file.sampler == "saltelli":
        block = len(dimensions) + 2
        n, rest = divmod(trials, block)
        if rest or n < 2 or n & (n - 1):
            valid = f"{block} (dimensions + 2) times a power of two, such as {64 * block}"
            raise source.bad(["trials"], trials, valid)
    return trials


def _check_scenarios(source: Source, specification: Specification) -> None:
    """Try the base, each dimension at its borders, and the drawn scenarios."""
    _try_loop(source, ("base",), specification.base)
    ends = specification.at_ends()
    for k, (dimension, trial) in enumerate(ends):
        path = ("vary", dimension.name.split("[")[0])
        with source.located(path):
            truth = specification.truth(trial)
            specification.believed(trial)
        if len(ends) <= BUILT or k % -(-len(ends) // BUILT) == 0:
            _try_loop(source, path, truth)
    step = -(-specification.trials // CHECKED)
    for index in range(0, specification.trials, step):
        trial = specification.trial(index)
        with source.located(("vary",), f"trial {index}: "):
            specification.truth(trial)
            specification.believed(trial)


def _try_loop(source: Source, path: tuple[str, ...], scenario: Scenario) -> None:
    # where there is no motion from there: an outcome
    with source.located(path), suppress(PlanningError, SimulationError):
        build_loop(scenario)
