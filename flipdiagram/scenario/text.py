"""Sections of typed fields with units, as text and back, and the errors of their fields.

Nothing here knows a section by name: `model` is the class of a whole tree, whose fields are sections of plain fields.
Whatever is wrong ends in a one-line `ScenarioError`: the path of the field, the value given, and what is valid.
"""

import difflib
import math
from collections.abc import Iterable, Mapping
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from flipdiagram.errors import ScenarioError
from flipdiagram.scenario.yaml_reader import show

Model = TypeVar("Model", bound=BaseModel)
BOUNDS = {"gt": "above", "ge": "of at least", "lt": "below", "le": "of at most"}
"""Words for one bound; two that are both allowed are 'from low to high'."""


def quantity(default: Any, unit: str, text: str, **bounds: Any) -> Any:
    """A field with a unit, '1' for a pure number, which `unit_of` tells; bounds are pydantic's gt, ge, lt, le.

    Those of a list of numbers stand at its items: tuple[Annotated[float, Field(ge=0, le=1)], ...].
    """
    return Field(default, description=text, json_schema_extra={"unit": unit}, **bounds)


def unit_of(field: FieldInfo) -> str:
    """The unit of a field; '' where it has none: a text, a choice."""
    return str(field.json_schema_extra["unit"]) if isinstance(field.json_schema_extra, dict) else ""


def explain(field: FieldInfo) -> str:
    """What a field is, 'text [unit, lowest to highest]' or 'text [one or another]', for comments and help."""
    valid = [f"{low:.10g} to {high:.10g}" for low, high in dict.fromkeys(spans_of(field))]
    kind, _ = _kind(field)
    valid += map(str, get_args(kind)) if get_origin(kind) is Literal else ["true", "false"] if kind is bool else []
    unit = ", ".join(word for word in ("" if kind is bool else unit_of(field), " or ".join(valid)) if word)
    return f"{field.description or ''} [{unit}]" if unit else field.description or ""


class Section(BaseModel):
    """Base of all sections: immutable, no unknown keys, no conversions, finite numbers, checked defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)

    if not TYPE_CHECKING:  # a checker shall see the fields as arguments, which this signature hides

        def __init__(self, **data: Any) -> None:
            try:
                super().__init__(**data)
            except ValidationError as error:
                raise error_of(type(self), data, error) from None

        __init__.__pydantic_base_init__ = True  # sections inside others are validated without it, and located whole

        def __setattr__(self, name: str, value: Any) -> NoReturn:
            remedy = "with_overrides({'section.field': value}) gives a changed copy"
            message = f"{name} = {show(value)} cannot be set: a {type(self).__name__} does not change; {remedy}"
            raise ScenarioError(message, field=name, value=value, valid=remedy)

    @model_validator(mode="before")
    @classmethod
    def _lists_are_tuples(cls, data: Any) -> Any:
        # YAML has lists only; a field that compares and hashes needs a tuple
        if isinstance(data, Mapping):
            return {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
        return data


def invalid(field: str, value: Any, valid: str) -> PydanticCustomError:
    """The error for a validator to raise; `field` is the path below the section that validates."""
    return PydanticCustomError("scenario", "{field}", {"field": field, "value": value, "valid": valid})


def validate(model: type[Model], data: Any) -> Model:
    """The model from nested mappings, absent fields at their defaults; ScenarioError for a bad one."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise error_of(model, data, error) from None


def error_of(model: type[BaseModel], data: Any, error: ValidationError) -> ScenarioError:
    """The first of pydantic's errors about a tree of sections, or about a section alone, as ours."""
    first = error.errors(include_url=False)[0]
    # an error inside a tuple is located at its item: show the whole
    location, context = [str(part) for part in first["loc"]], first.get("ctx", {})
    if not is_tree(model):
        location = [model.__name__, *location]
    if first["type"] == "scenario":
        return bad_value(".".join([*location, context["field"]]), context["value"], context["valid"])
    if first["type"] in ("extra_forbidden", "invalid_key"):
        return unknown_field(model, ".".join(location))
    if len(location) > 1:
        section, name = location[:2]
        value, field = (data if not is_tree(model) else data[section])[name], fields_of(model)[f"{section}.{name}"]
        return bad_value(f"{section}.{name}", value, describe_valid(field))
    what, valid = "scenario", "'section: {field: value}'"
    if location:
        what = f"scenario section '{location[0]}'"
        valid = f"'field: value' with {', '.join(section_of(model, location[0]).model_fields)}"
    message = f"{what} = {show(first['input'])} is no mapping; valid is {valid}"
    return ScenarioError(message, field="".join(location), value=first["input"], valid=valid)


def override(model: type[Model], data: Mapping[str, Any], changes: Mapping[str, Any]) -> Model:
    """The model from `data` with fields replaced, {"section.field": value} or {"section": {"field": value}}."""
    sections, valid = {name: dict(values) for name, values in data.items()}, fields_of(model)
    for key, value in changes.items():
        inside = value if isinstance(value, Mapping) and key in sections else {"": value}
        for path, single in ((f"{key}.{name}" if name else str(key), item) for name, item in inside.items()):
            if path not in valid:
                raise unknown_field(model, path)
            section, name = path.split(".")
            sections[section][name] = single
    return validate(model, sections)


def dump(scenario: BaseModel, comments: bool) -> str:
    """YAML text that reads back exactly; with comments, each field's description and unit behind it."""
    lines: list[str] = []
    for section, values in scenario.model_dump(mode="json").items():
        lines.append(f"{section}:")
        for name, field in section_of(type(scenario), section).model_fields.items():
            text = yaml.safe_dump(values[name], default_flow_style=True, width=10_000).removesuffix("...\n").strip()
            entry = f"  {name}: {text}"
            lines.append(f"{entry:<44}  # {explain(field)}" if comments else entry)
    return "\n".join(lines) + "\n"


def is_tree(model: type[BaseModel]) -> bool:
    """Whether the fields of a model are sections; else it is a section of plain fields."""
    kinds = (field.annotation for field in model.model_fields.values())
    return all(isinstance(kind, type) and issubclass(kind, BaseModel) for kind in kinds)


def fields_of(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """All fields by path, 'section.field', in order; of a section alone its class stands for 'section'."""
    if not is_tree(model):
        return {f"{model.__name__}.{name}": field for name, field in model.model_fields.items()}
    return {
        f"{section}.{name}": field
        for section in model.model_fields
        for name, field in section_of(model, section).model_fields.items()
    }


def section_of(model: type[BaseModel], name: str) -> type[BaseModel]:
    """The class of a section."""
    annotation = model.model_fields[name].annotation
    assert isinstance(annotation, type) and issubclass(annotation, BaseModel), f"{name} is no section"
    return annotation


def bad_value(path: str, value: Any, valid: str) -> ScenarioError:
    """The error of a field whose value is not valid."""
    message = f"scenario field '{path}' = {show(value)} is not valid; valid is {valid}"
    return ScenarioError(message, field=path, value=value, valid=valid)


def unknown_field(model: type[BaseModel], path: str) -> ScenarioError:
    """The error of a path that no field has: the likely meaning, and the valid names at that level."""
    paths, sections = list(fields_of(model)), list(model.model_fields) if is_tree(model) else [model.__name__]
    section, _, name = path.partition(".")
    valid = [p for p in paths if p.startswith(f"{section}.")] if section in sections else sections
    if path in sections:
        message = f"scenario field {show(path)} is a section, no field; valid are {', '.join(valid)}"
        return ScenarioError(message, field=path, valid=valid)
    same_name = [p for p in paths if p.partition(".")[2] == (name or section)]
    near = same_name or difflib.get_close_matches(path, paths if name else sections, n=1)
    meant = f"did you mean '{near[0]}'? " if near else ""
    kind = "valid are " if valid is not sections else "valid are the sections "
    message = f"scenario field {show(path)} does not exist; {meant}{kind}{', '.join(valid)}"
    return ScenarioError(message, field=path, valid=valid)


def describe_valid(field: FieldInfo) -> str:
    """What a field accepts, in words: 'a finite number from 0.0001 to 50 [kg]'."""
    kind, optional = _kind(field)
    unit = f"[{unit_of(field)}]" if unit_of(field) not in ("", "1") else ""
    words = [_describe_type(kind), _describe_bounds(_bounds(field.metadata)), unit]
    some = ", at least one" if get_args(kind)[1:] == (...,) else ""
    return " ".join(word for word in words if word) + some + (", or null" if optional else "")


def spans_of(field: FieldInfo) -> list[tuple[float, float]]:
    """Lowest and highest of each number that a field holds, once for a list of any length; none of no number."""
    kind, _ = _kind(field)
    numbers = get_args(kind) if get_origin(kind) is tuple else (kind,)
    limits = [_item(number) for number in numbers if number is not ...]
    found = [field.metadata if own is None else own for base, own in limits if base in (float, int)]
    return [
        (bounds.get("ge", bounds.get("gt", -math.inf)), bounds.get("le", bounds.get("lt", math.inf)))
        for bounds in map(_bounds, found)
    ]


def _kind(field: FieldInfo) -> tuple[Any, bool]:
    """The type of a field without None, where only one is left, and whether it may be None."""
    if get_origin(field.annotation) not in (Union, UnionType):
        return field.annotation, False
    kinds = [kind for kind in get_args(field.annotation) if kind is not NoneType]
    return kinds[0] if len(kinds) == 1 else field.annotation, NoneType in get_args(field.annotation)


def _item(kind: Any) -> tuple[Any, list[Any] | None]:
    """The type of an item of a list, and what restricts it, None where it is not annotated."""
    return (get_args(kind)[0], get_args(kind)[1].metadata) if get_origin(kind) is Annotated else (kind, None)


def _bounds(limits: Iterable[Any]) -> dict[str, float]:
    return {bound: getattr(limit, bound) for limit in limits for bound in BOUNDS if hasattr(limit, bound)}


def _describe_bounds(bounds: Mapping[str, float]) -> str:
    if bounds.keys() == {"ge", "le"}:
        return f"from {bounds['ge']:.10g} to {bounds['le']:.10g}"
    return " and ".join(f"{BOUNDS[bound]} {value:g}" for bound, value in bounds.items())


def _describe_type(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(str(choice) for choice in get_args(kind))
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        base, limits = _item(first)
        count = "a list of" if others == [...] else f"a list of {1 + len(others)}"
        words = [f"{_describe_type(base).removeprefix('a ')}s", _describe_bounds(_bounds(limits or ()))]
        return " ".join([count, *filter(None, words)])
    return {float: "a finite number", int: "a whole number", bool: "true or false", str: "a text"}[kind]
