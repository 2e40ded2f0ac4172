"""A campaign's file as it stands there: which keys, of which kind; each error one line with its line number."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import BaseModel, Field, ValidationError

from flipdiagram.errors import InputError
from flipdiagram.files import read_text
from flipdiagram.flips.child_process import MEMORY
from flipdiagram.scenario.joints import MOST_SEED
from flipdiagram.scenario.scenario import ARCHITECTURES, Architecture
from flipdiagram.scenario.text import Section
from flipdiagram.scenario.yaml_reader import Lines, line_of, read_mapping, show

MOST_TRIALS = 10_000_000
VARY = "'field: {distribution: [numbers]}', at least one"

Model = TypeVar("Model", bound=BaseModel)
Seed = Annotated[int, Field(ge=0, le=MOST_SEED, description=f"a whole number from 0 to {MOST_SEED}")]


class SpecificationFile(Section):
    """The whole file; the description of a field says what is valid."""

    base: str | dict[str, Any] | None = Field(None, description="a partial scenario, or the name of its file")
    vary: dict[str, Any] = Field(min_length=1, description=VARY)
    known: tuple[str, ...] = Field((), description="a list of varied fields of arm, tool, object or table")
    sampler: Literal["grid", "random", "lhs", "sobol", "saltelli"] = Field(
        "lhs", description="one of grid, random, lhs, sobol, saltelli"
    )
    seed: Seed = 0
    trials: int = Field(1, ge=1, le=MOST_TRIALS, description=f"a whole number from 1 to {MOST_TRIALS}")
    architectures: tuple[Architecture, ...] = Field(
        get_args(Architecture), min_length=1, description=f"a list of {', '.join(ARCHITECTURES)}, each once"
    )
    timeout: float = Field(120.0, ge=0.01, le=1e6, description="a number from 0.01 to 1e6 [s]")
    memory: float = Field(MEMORY, ge=0.01, le=1e4, description="a number from 0.01 to 10000 [GB]")
    limit_hours: float = Field(12.0, ge=1e-6, le=1e5, description="a number from 1e-6 to 1e5 [h]")
    tune: Any = Field(None, description="the section that `tuning.TuneSection` checks")
    calibrate: Any = Field(None, description="the section that the study `calibrate` checks")


@dataclass(frozen=True)
class Source:
    """Plain data from a YAML file, and the line on which each of its keys stands."""

    name: str
    text: str
    data: dict[str, Any]
    lines: Lines = field(repr=False)

    def error(self, path: Iterable[str], problem: str, value: Any = None, valid: str | None = None) -> InputError:
        """An error about a key, or the nearest key above it that is there: 'campaign 'a.yaml', line 3: …'."""
        at = tuple(path)
        message = f"campaign '{self.name}'{line_of(self.lines, at)}: {problem}"
        return InputError(message, field=".".join(at), value=value, valid=valid)

    def bad(self, path: Iterable[str], value: Any, valid: str) -> InputError:
        """The error of a value that is not valid."""
        at = tuple(path)
        return self.error(at, f"{': '.join(at)} = {show(value)} is not valid; valid is {valid}", value, valid)

    @contextmanager
    def located(self, path: tuple[str, ...], prefix: str = "") -> Iterator[None]:
        """The line of a key before what is wrong with it; below `base` and `vary`, of the field that is named there."""
        try:
            yield
        except InputError as error:
            if path == ("base",):
                path = ("base", *(error.field or "").split("."))
            elif path == ("vary",) and error.field:
                path = ("vary", error.field)
            raise self.error(path, f"{prefix}{error}") from None

    def validated(self, model: type[Model], data: Mapping[str, Any], path: tuple[str, ...] = ()) -> Model:
        """A section of the file, checked; the first error with its line."""
        try:
            return model.model_validate(data)
        except ValidationError as error:
            problems = error.errors(include_url=False)
        keys = ", ".join(model.model_fields)
        for key in data:
            if key not in model.model_fields:
                where = f"{path[0]}: " if path else ""
                raise self.error((*path, str(key)), f"{where}unknown key {key!r}; valid are {keys}", key, keys)
        name = str(problems[0]["loc"][0])
        raise self.bad((*path, name), data.get(name), str(model.model_fields[name].description))


def read(path: str | Path) -> Source:
    """The file; InputError where it cannot be read or is no mapping."""
    return parse(read_text(path, "campaign", "a YAML file"), str(path))


def parse(text: str, name: str = "campaign.yaml") -> Source:
    """The text; `name` stands for it in errors.  InputError where it is no YAML mapping."""
    return Source(name, text, *read_mapping(text, f"campaign '{name}'", "'vary: {field: …}' and so on"))
