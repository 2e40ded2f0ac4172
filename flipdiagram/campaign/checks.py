"""From YAML to a Specification, everything checked before anything runs; each error one line with its line number."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flipdiagram.campaign.distributions import DistributionError, distribution
from flipdiagram.campaign.reading import Source, parse, read
from flipdiagram.campaign.sampling import SAMPLERS
from flipdiagram.campaign.specification import UNKNOWN_SECTIONS, Dimension, Specification, elements_of, value_of
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import FlipdiagramError, InputError
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, field_paths, from_mapping, load
from flipdiagram.scenario.text import unknown_field

KEYS = ("base", "vary", "known", "sampler", "seed", "trials", "architectures", "timeout", "limit_hours", "tune")
MOST_TRIALS = 10_000_000
MOST_SEED = 2**32 - 1
CHECKED = 5_000
"""Trials whose scenario is tried beforehand, 0.1 ms each; of a longer campaign those spread evenly."""
BUILT = 40
"""Borders at which the diagram itself is built beforehand, 50 ms each."""
PLAN_SECONDS, BUILD_SECONDS, REAL_TIME_FACTOR, MOTION_SECONDS = 0.8, 0.15, 2.0, 1.0
"""Of a typical core: a plan, building and judging a flip, simulated over wall time; a typical motion."""


def load_specification(path: str | Path, changes: Mapping[str, Any] | None = None) -> Specification:
    """Read and check a campaign file; a base scenario that it names is looked for beside it first.

    changes: fields of the base by path that count more than the file, such as those of the command line.
    """
    return specification(read(path), Path(path).parent, changes)


def changes_of(scenario: Scenario) -> dict[str, Any]:
    """The fields of a scenario that are not at their defaults, by path."""
    default = Scenario()
    return {path: v for path in field_paths() if (v := value_of(scenario, path)) != value_of(default, path)}


def from_text(text: str, name: str = "campaign.yaml") -> Specification:
    """Check the text of a campaign file."""
    return specification(parse(text, name), Path("."))


def specification(source: Source, folder: Path, changes: Mapping[str, Any] | None = None) -> Specification:
    """Check everything of a campaign that can be known before it runs; raises InputError with the line."""
    for key in source.data:
        if key not in KEYS:
            raise source.error([str(key)], f"unknown key {key!r}; valid are {', '.join(KEYS)}")
    base = _base(source, folder).with_overrides(changes or {})
    dimensions = _dimensions(source, base)
    sampler = source.data.get("sampler", "lhs")
    if sampler not in SAMPLERS:
        raise source.bad(["sampler"], sampler, f"one of {', '.join(SAMPLERS)}")
    found = Specification(
        base=base,
        dimensions=dimensions,
        sampler=sampler,
        seed=_whole(source, "seed", 0, 0, MOST_SEED),
        trials=_trials(source, sampler, dimensions),
        architectures=_architectures(source),
        timeout=_number(source, "timeout", 120.0),
        known=_known(source, dimensions),
        limit_hours=_number(source, "limit_hours", 12.0),
        text=source.text,
        name=source.name,
        tune=source.data.get("tune"),
    )
    _check_scenarios(source, found)
    return found


def estimated_hours(specification: Specification, jobs: int) -> float:
    """Wall time of the whole campaign on `jobs` cores [h], from the speed of a typical core."""
    settings = specification.base.simulation
    simulated = settings.hold_time + MOTION_SECONDS + settings.settle_time
    flips = specification.rows * (BUILD_SECONDS + simulated / REAL_TIME_FACTOR * 0.001 / settings.step)
    plans = (specification.trials if specification.plans_vary else 1) * PLAN_SECONDS
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


def _base(source: Source, folder: Path) -> Scenario:
    given = source.data.get("base")
    try:
        if isinstance(given, str):
            beside = folder / given
            return load(beside if beside.is_file() else given)
        return from_mapping(given or {})
    except InputError as error:
        raise source.error(_named("base", str(error)), str(error)) from None


def _dimensions(source: Source, base: Scenario) -> tuple[Dimension, ...]:
    vary = source.data.get("vary")
    if not isinstance(vary, Mapping) or not vary:
        raise source.bad(["vary"], vary, "'field: {distribution: [numbers]}', at least one")
    found: list[Dimension] = []
    for key, data in vary.items():
        path = ["vary", str(key)]
        fields = tuple(part.strip() for part in str(key).split(","))
        for field in fields:
            _check_field(source, path, field)
            if any(field in dimension.fields for dimension in found) or fields.count(field) > 1:
                raise source.error(path, f"{field} stands twice; valid is once")
        try:
            found += _dimensions_of(base, str(key), fields, data)
        except DistributionError as error:
            raise source.error(path, f"{key}: {error}") from None
    return tuple(found)


def _check_field(source: Source, path: list[str], field: str) -> None:
    if field.split(".")[0] in ("one_dof", "frequency") and field in field_paths():
        raise source.error(path, f"{field} belongs to section III, no flip depends on it; valid are fields of a flip")
    if field not in field_paths():
        raise source.error(path, str(unknown_field(Scenario, field)))


def _dimensions_of(base: Scenario, key: str, fields: tuple[str, ...], data: Any) -> list[Dimension]:
    if not (isinstance(data, Mapping) and "scale" in data):
        return [Dimension(key, fields, distribution(data))]
    if len(data) > 1:
        raise DistributionError("valid is scale: {distribution: [numbers]} alone")
    factor = distribution(data["scale"])
    if any(not isinstance(end, int | float) or isinstance(end, bool) for end in factor.ends()):
        raise DistributionError("scale takes numbers only")
    elements = elements_of(base, fields[0])
    if len(fields) == 1 and elements:  # each element on its own
        return [Dimension(f"{key}[{k}]", fields, factor, True, k) for k in range(len(elements))]
    for field in fields:
        value = value_of(base, field)
        if not isinstance(value, float):
            raise DistributionError(f"{field} = {value!r} of the base cannot be scaled; valid is a number, or one list")
    return [Dimension(key, fields, factor, True)]


def _trials(source: Source, sampler: str, dimensions: tuple[Dimension, ...]) -> int:
    if sampler != "grid":
        trials = _whole(source, "trials", None, 1, MOST_TRIALS)
        if sampler == "saltelli":
            n, rest = divmod(trials, len(dimensions) + 2)
            if rest or n < 2 or n & (n - 1):
                block = len(dimensions) + 2
                valid = f"{block} (dimensions + 2) times a power of two, such as {64 * block}"
                raise source.bad(["trials"], trials, valid)
        return trials
    product = 1
    for dimension in dimensions:
        values = dimension.distribution.values
        if values is None:
            text = f"{dimension.name}: the grid needs values; valid are grid, choice and integers"
            raise source.error(["vary", dimension.name.split("[")[0]], text)
        product *= len(values)
    given = source.data.get("trials", product)
    if given != product:
        raise source.bad(["trials"], given, f"{product}, the product of the grids, or leave it out")
    if product > MOST_TRIALS:
        raise source.error(["vary"], f"the grid has {product} points; valid are at most {MOST_TRIALS}")
    return product


def _architectures(source: Source) -> tuple[str, ...]:
    given = source.data.get("architectures", list(ARCHITECTURES))
    valid = f"a list of {', '.join(ARCHITECTURES)}, each once"
    if not isinstance(given, list) or not given or any(name not in ARCHITECTURES for name in given):
        raise source.bad(["architectures"], given, valid)
    if len(set(given)) < len(given):
        raise source.bad(["architectures"], given, valid)
    return tuple(given)


def _known(source: Source, dimensions: tuple[Dimension, ...]) -> tuple[str, ...]:
    given = source.data.get("known", [])
    varied = [field for d in dimensions for field in d.fields if field.split(".")[0] in UNKNOWN_SECTIONS]
    if not isinstance(given, list) or any(field not in varied for field in given):
        text = "a list of varied fields of arm, tool, object or table: " + (", ".join(varied) or "none is varied here")
        raise source.bad(["known"], given, text)
    return tuple(given)


def _whole(source: Source, key: str, default: int | None, least: int, most: int) -> int:
    value = source.data.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise source.bad([key], value, f"a whole number from {least} to {most}")
    return value


def _number(source: Source, key: str, default: float) -> float:
    value = source.data.get(key, default)
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < float("inf"):
        raise source.bad([key], value, "a finite number above 0")
    return float(value)


def _check_scenarios(source: Source, found: Specification) -> None:
    """Try the base, each dimension at its borders, and the drawn scenarios."""
    _try_loop(source, ["base"], found.base)
    ends = found.at_ends()
    for k, (dimension, trial) in enumerate(ends):
        path = ["vary", dimension.name.split("[")[0]]
        try:
            truth = found.truth(trial)
            found.believed(trial)
        except InputError as error:
            raise source.error(path, str(error)) from None
        if len(ends) <= BUILT or k % -(-len(ends) // BUILT) == 0:
            _try_loop(source, path, truth)
    step = -(-found.trials // CHECKED)
    for index in range(0, found.trials, step):
        trial = found.trial(index)
        try:
            found.truth(trial)
            found.believed(trial)
        except InputError as error:
            raise source.error(_named("vary", str(error)), f"trial {index}: {error}") from None


def _try_loop(source: Source, path: list[str], scenario: Scenario) -> None:
    try:
        build_loop(scenario)
    except InputError as error:
        raise source.error(path, str(error)) from None
    except FlipdiagramError:
        return  # no motion from there: an outcome


def _named(key: str, message: str) -> list[str]:
    """Where the field that a message names stands in the file."""
    field = re.search(r"'(\w+)\.(\w+)'", message)
    if field is None:
        return [key]
    return [key, f"{field[1]}.{field[2]}"] if key == "vary" else [key, field[1], field[2]]
