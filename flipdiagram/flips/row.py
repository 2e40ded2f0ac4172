"""A row of stored flips: what each of its cells is, and how one that is something else is named."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import MODES
from flipdiagram.scenario.yaml_reader import show
from flipdiagram.simulation.events import Touchdown
from flipdiagram.simulation.metrics import FlipMetrics

PackedRow = tuple[Any, ...]
"""A row as SQLite takes it, in the order of `COLUMNS`."""
LARGEST = 1e15
"""Beyond every number of a flip, in SI."""
LATEST = 1e11
"""Seconds since 1970 of the year 5138."""
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Item = Number | str | bool | None


@dataclass(frozen=True)
class Row:
    """One flip that has ended; the mappings are plain data.

    Seconds, host, attempts and finished tell how it came about, as the plan's `solve_time_s` and a pancake's
    `real_time_factor` do; the others do not depend on workers, their number or their order.
    """

    trial: Annotated[int, Field(ge=0)] | str
    """Its number in a campaign; the key of its question in a study."""
    architecture: str
    outcome: str
    """One of `outcome.MODES`."""
    failure: str | None
    seed: Annotated[int, Field(ge=0)]
    scenario_hash: str
    overrides: Mapping[str, Any]
    values: Sequence[Any]
    """Of the dimensions, in their order."""
    metrics: Mapping[str, Any] | None
    plan: Mapping[str, Any] | None
    """The plan's summary."""
    code: str
    versions: Mapping[str, str]
    seconds: Annotated[float, Field(ge=0, le=LARGEST)]
    host: str
    attempts: Annotated[int, Field(ge=0)]
    finished: Annotated[float, Field(ge=0, le=LATEST)]
    """Seconds since 1970, by the clock of the host."""

    def packed(self) -> PackedRow:
        """As it stands in the file, to be put there: made by the worker that has the row."""
        return tuple(_packed(name, getattr(self, name)) for name in COLUMNS)


def _packed(name: str, value: Any) -> Any:
    return to_json(value) if name in _JSON and value is not None else value


COLUMNS = tuple(field.name for field in fields(Row))
_JSON = ("overrides", "values", "metrics", "plan", "versions")
CODE, ATTEMPTED = COLUMNS.index("code"), COLUMNS.index("attempts")
"""Where they stand in a packed row."""


class Campaign(NamedTuple):
    """What the rows of a campaign can be."""

    trials: int
    architectures: Sequence[str]
    dimensions: int


def read_row(path: Path, cells: PackedRow, campaign: Campaign | None = None) -> Row:
    """The row that cells of a file hold; InputError that names the file, the row and the column of a bad one."""
    data = dict(zip(COLUMNS, cells, strict=True))
    place = f"table trials, row ({show(data['trial'])}, {show(data['architecture'])}), column "
    for name in _JSON:
        if data[name] is not None:
            try:
                data[name] = json.loads(data[name])
            except (TypeError, ValueError, RecursionError):
                raise damaged(path, place + name, data[name], "JSON") from None
    try:
        _checked().model_validate(data)
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
        name = str(wrong["loc"][0])
        valid = wrong["msg"].removeprefix("Input should be ")
        raise damaged(path, ".".join([place + name, *map(str, wrong["loc"][1:])]), wrong["input"], valid) from None
    row = Row(**data)
    known: dict[str, tuple[Any, bool, str | Sequence[str]]] = {"outcome": (row.outcome, row.outcome in MODES, MODES)}
    if campaign is not None:
        trials, names, count = campaign
        here = isinstance(row.trial, int) and row.trial < trials
        known["trial"] = row.trial, here, f"a whole number from 0 to {trials - 1}"
        known["architecture"] = row.architecture, row.architecture in names, names
        known["values"] = row.values, len(row.values) == count, f"a list of {count}"
    for name, (value, good, choice) in known.items():
        if not good:
            raise damaged(path, place + name, value, choice)
    return row


def damaged(path: Path, place: str, value: Any, valid: str | Sequence[str]) -> InputError:
    """The error of a file in which a cell is not as it was written."""
    return InputError.of("file", str(path), valid, f"'{path}' is damaged: {place} = {show(value)}")


def to_json(data: Any) -> str:
    """Text that is the same for the same data."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False)


@cache
def _checked() -> type[BaseModel]:
    """A row as it is checked: the kinds and bounds of `Row`, in its metrics those of `FlipMetrics`."""
    kinds: dict[Any, Any] = {float: Number | None, list[float]: list[Number | None]}
    kinds[Touchdown | None] = dict[str, Number | None] | None
    of_metrics = get_type_hints(FlipMetrics) | {"torque_use": float}
    strict = ConfigDict(strict=True)
    known: dict[str, Any] = {name: (kinds.get(kind, kind), None) for name, kind in of_metrics.items()}
    metrics = create_model("metrics", __config__=strict, **known | {"max_torque_Nm": (list[Number | None], ...)})
    columns: dict[str, Any] = get_type_hints(Row, include_extras=True)
    columns |= {"metrics": metrics | None, "values": list[Item | list[Item]]}
    cells: dict[str, Any] = {name: (kind, ...) for name, kind in columns.items()}
    return create_model("row", __config__=strict, **cells)
