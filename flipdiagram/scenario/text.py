"""Scenario text in and out, and its errors: for any tree of sections, none of them known here by name.

Every function that takes a `model` means the class of the whole tree, whose fields are sections of plain
fields.  Whatever is wrong ends in a one-line `ScenarioError`: the path of the field, the value given, and
what is valid.
"""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Mapping
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

import annotated_types
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from flipdiagram.errors import ScenarioError

Model = TypeVar("Model", bound=BaseModel)

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlist = _short.maxtuple = _short.maxdict = 8


def quantity(default: Any, unit: str, text: str, **bounds: Any) -> Any:
    """A field with a unit: its description reads 'text [unit]'; bounds are pydantic's gt, ge, lt, le."""
    return Field(default, description=f"{text} [{unit}]", **bounds)


class Section(BaseModel):
    """Base of all sections: immutable, no unknown keys, no conversions, finite numbers, checked defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)

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
        first = error.errors(include_url=False)[0]
    location = [str(part) for part in first["loc"]]
    context = first.get("ctx", {})
    if first["type"] == "scenario":
        path = ".".join([*location, context["field"]])
        raise bad_value(path, context["value"], context["valid"])
    if first["type"] in ("extra_forbidden", "invalid_key"):
        raise unknown_field(model, ".".join(location))
    if not location:
        raise ScenarioError(f"scenario = {show(data)} is no mapping; valid is 'section: {{field: value}}'")
    section = section_of(model, location[0])
    if len(location) == 1:
        names = ", ".join(section.model_fields)
        raise ScenarioError(
            f"scenario section '{location[0]}' = {show(first['input'])} is no mapping;"
            f" valid is 'field: value' with {names}"
        )
    field = section.model_fields[location[1]]
    # an error inside a tuple is located at its item: show the whole
    raise bad_value(".".join(location[:2]), data[location[0]][location[1]], describe_valid(field))


def override(model: type[Model], data: Mapping[str, Any], changes: Mapping[str, Any]) -> Model:
    """The model from `data` with single fields replaced by path, {"section.field": value}."""
    sections = {name: dict(values) for name, values in data.items()}
    valid = field_paths(model)
    for path, value in changes.items():
        if path not in valid:
            raise unknown_field(model, path)
        section, name = path.split(".")
        sections[section][name] = value
    return validate(model, sections)


def parse_mapping(text: str, source: str) -> dict[Any, Any]:
    """YAML text as nested mappings, empty text and sections as empty ones; `source` names it in errors."""
    data = _parse(text, source)
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ScenarioError(
            f"{source} = {show(data)} is no mapping; valid is 'section: {{field: value}}',"
            " as `flipdiagram scenario` prints"
        )
    return {key: {} if value is None else value for key, value in data.items()}


def parse_value(text: str, path: str) -> Any:
    """One field's value as YAML: '400', 'null', '[1, 2]', 'clarabel'; `path` names the field in errors."""
    return _parse(text, f"scenario field '{path}' = {show(text)}")


def dump(scenario: BaseModel, comments: bool) -> str:
    """YAML text that reads back exactly; with comments, each field's description behind it."""
    lines: list[str] = []
    for section, values in scenario.model_dump(mode="json").items():
        lines.append(f"{section}:")
        for name, field in section_of(type(scenario), section).model_fields.items():
            text = yaml.safe_dump(values[name], default_flow_style=True, width=10_000).removesuffix("...\n").strip()
            entry = f"  {name}: {text}"
            lines.append(f"{entry:<44}  # {field.description}" if comments else entry)
    return "\n".join(lines) + "\n"


def field_paths(model: type[BaseModel]) -> list[str]:
    """All field paths in order: 'section.field', …"""
    return [f"{name}.{field}" for name in model.model_fields for field in section_of(model, name).model_fields]


def section_of(model: type[BaseModel], name: str) -> type[BaseModel]:
    """The class of a section."""
    annotation = model.model_fields[name].annotation
    assert isinstance(annotation, type) and issubclass(annotation, BaseModel), f"{name} is no section"
    return annotation


def bad_value(path: str, value: Any, valid: str) -> ScenarioError:
    """The error of a field whose value is not valid."""
    return ScenarioError(f"scenario field '{path}' = {show(value)} is not valid; valid is {valid}")


def unknown_field(model: type[BaseModel], path: str) -> ScenarioError:
    """The error of a path that no field has: the likely meaning, and the valid names at that level."""
    paths, sections = field_paths(model), list(model.model_fields)
    section, _, name = path.partition(".")
    if section in sections:
        valid = "valid are " + ", ".join(p for p in paths if p.startswith(f"{section}."))
    else:
        valid = "valid are the sections " + ", ".join(sections)
    same_name = [p for p in paths if p.partition(".")[2] == (name or section)]
    near = same_name or difflib.get_close_matches(path, paths if name else sections, n=1)
    meant = f"did you mean '{near[0]}'? " if near else ""
    return ScenarioError(f"scenario field {show(path)} does not exist; {meant}{valid}")


def describe_valid(field: FieldInfo) -> str:
    """What a field accepts, in words: 'a finite number above 0 [kg]'."""
    annotation, optional = field.annotation, False
    if get_origin(annotation) in (Union, UnionType):
        optional = NoneType in get_args(annotation)
        (annotation,) = (kind for kind in get_args(annotation) if kind is not NoneType)
    text = _describe_type(annotation)
    bounds = [
        f"{words} {getattr(limit, name):g}"
        for limit in field.metadata
        for kind, name, words in (
            (annotated_types.Gt, "gt", "above"),
            (annotated_types.Ge, "ge", "of at least"),
            (annotated_types.Lt, "lt", "below"),
            (annotated_types.Le, "le", "of at most"),
        )
        if isinstance(limit, kind)
    ]
    unit = re.search(r"\[(.+)\]$", field.description or "")
    words = [text, " and ".join(bounds), f"[{unit[1]}]" if unit and unit[1] != "1" else ""]
    return " ".join(word for word in words if word) + (", or null" if optional else "")


def show(value: Any) -> str:
    """A value on one short line, as YAML would write it."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return repr(value) if isinstance(value, float) else _short.repr(value)


def _describe_type(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(str(choice) for choice in get_args(kind))
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        count = "a list of" if others == [...] else f"a list of {1 + len(others)}"
        return f"{count} {_describe_type(first).removeprefix('a ')}s"
    return {float: "a finite number", int: "a whole number", bool: "true or false", str: "a text"}[kind]


class _Loader(yaml.SafeLoader):
    """YAML 1.2's plain scalars; PyYAML's own takes 1e6 for text, 1:30 for 90, 010 for 8 and yes for true."""

    yaml_implicit_resolvers: dict[str, list[Any]] = {}


for _tag, _pattern, _first in (
    ("null", r"null|Null|NULL|~|", ["n", "N", "~", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?(0|[1-9][0-9]*)", list("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
    ("merge", r"<<", ["<"]),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^({_pattern})$"), _first)


def _parse(text: str, source: str) -> Any:
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        _refuse_duplicates(node, ())
        return loader.construct_document(node)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: a number of thousands of digits
        raise ScenarioError(f"{source} is not valid YAML: {' '.join(str(error).split())}") from None


def _refuse_duplicates(node: yaml.Node, path: tuple[str, ...]) -> None:
    # PyYAML keeps the last of two equal keys in silence
    if not isinstance(node, yaml.MappingNode) or len(path) > 1:
        return
    lines: dict[str, int] = {}
    for key, value in node.value:
        name, line = str(key.value), key.start_mark.line + 1
        here = (*path, name)
        if name in lines:
            both = f"on lines {lines[name]} and {line}"
            raise ScenarioError(f"scenario field '{'.'.join(here)}' stands twice, {both}; valid is once")
        lines[name] = line
        _refuse_duplicates(value, here)
