"""YAML 1.2 as plain data that knows its lines: what scenarios and specifications are read with.

PyYAML parses; four things are added that no YAML library for Python has together: the plain scalars of YAML 1.2 alone
(PyYAML takes 1:30 for 90, 010 for 8 and yes for true; ruamel.yaml takes 1_000 and 0x10 for numbers), a refusal of keys
that stand twice, the line of every key, and a bound on what a text grows into by its aliases.
"""

import re
import reprlib
from collections.abc import Hashable, Iterable
from typing import Any

import yaml

from flipdiagram.errors import ScenarioError
from flipdiagram.files import TEXT_BYTES

Lines = dict[tuple[Hashable, ...], int]
"""Line of the file by the path of a key, or of an item by its index: as pydantic's `loc` names them."""

SECTIONS = "'section: {field: value}', as `flipdiagram scenario` prints"

MOST_VALUES, DEEPEST = 20_000, 40
"""Values that a text may have, counted again at each alias, and in how many others one may stand."""

_short = reprlib.Repr()
_short.maxlevel = 2
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlist = _short.maxtuple = _short.maxdict = 8


def read_mapping(text: str, source: str, valid: str = SECTIONS) -> tuple[dict[Any, Any], Lines]:
    """YAML text as nested mappings, empty text as an empty one, and the line of each key.

    Args:
        text: the text of a file.
        source: what errors call it, such as "scenario file 'a.yaml'".
        valid: what the file may be, for the error where it is no mapping.

    Raises ScenarioError, its line after the source, where it is no YAML, no mapping, or has a key twice.
    """
    data, lines = _read(text, source)
    if data is None:
        return {}, lines
    if not isinstance(data, dict):
        message = f"{source} = {show(data)} is no mapping; valid is {valid}"
        raise ScenarioError(message, field=source, value=data, valid=valid)
    return data, lines


def parse_value(text: str, path: str) -> Any:
    """One field's value as YAML: '400', 'null', '[1, 2]', 'clarabel'; `path` names the field in errors."""
    return _read(text, f"scenario field '{path}' = {show(text)}")[0]


def line_of(lines: Lines, path: Iterable[Hashable]) -> str:
    """', line 3' for a path, or the nearest key above it that the file has; '' where there is none."""
    at = tuple(path)
    while at and at not in lines:
        at = at[:-1]
    return f", line {lines[at]}" if at in lines else ""


def show(value: Any) -> str:
    """A value on one short line, as YAML would write it."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return repr(value) if isinstance(value, float) else _short.repr(value)


class _Loader(yaml.SafeLoader):
    """The plain scalars of YAML 1.2, no tags of other kinds, few enough values, and none that holds itself."""

    yaml_implicit_resolvers: dict[str, list[Any]] = {}

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._values = self._depth = 0
        self._sizes: dict[yaml.Node | None, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """The next value, counted with all that it holds."""
        event, before = self.peek_event(), self._values
        self._values, self._depth = self._values + 1, self._depth + 1
        self._check(event, self._depth <= DEEPEST, f"nested too deeply; valid are at most {DEEPEST} levels")
        node = super().compose_node(parent, index)
        self._depth -= 1
        if isinstance(event, yaml.AliasEvent):
            self._check(event, node in self._sizes, f"*{event.anchor} stands in what it means; valid is one beside it")
            self._values = before + self._sizes[node]
        elif node is not None:
            plain = self.resolve(type(node), node.value, (True, False))
            tags = (plain, self.DEFAULT_SCALAR_TAG, f"{TAG}float" if plain == f"{TAG}int" else plain)
            self._check(event, node.tag in tags, f"tag {show(node.tag)} of {show(node.value)}; valid is none")
        self._check(event, self._values <= MOST_VALUES, f"too many values; valid are at most {MOST_VALUES}")
        self._sizes[node] = self._values - before
        return node

    def _check(self, event: Any, good: bool, problem: str) -> None:
        if not good:
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


TAG = "tag:yaml.org,2002:"

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
    _Loader.add_implicit_resolver(f"{TAG}{_tag}", re.compile(rf"^({_pattern})$"), _first)


def _read(text: str, source: str) -> tuple[Any, Lines]:
    lines: Lines = {}
    if len(text) > TEXT_BYTES:
        raise ScenarioError(f"{source} has {len(text)} characters; valid are at most {TEXT_BYTES}")
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, lines
        _number(node, (), lines, source)
        return loader.construct_document(node), lines
    except yaml.YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None) or error
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise ScenarioError(f"{source}{line}: not valid YAML: {' '.join(str(problem).split())}") from None
    except ValueError as error:  # a number of thousands of digits
        raise ScenarioError(f"{source}: not valid YAML: {' '.join(str(error).split())}") from None


def _number(node: yaml.Node, path: tuple[Hashable, ...], lines: Lines, source: str) -> None:
    """Note the line of each key and item; refuse a key that stands twice, of which PyYAML keeps the last in silence."""
    entries: list[tuple[Hashable, yaml.Node, yaml.Node]]
    if isinstance(node, yaml.SequenceNode):
        entries = [(index, item, item) for index, item in enumerate(node.value)]
    elif isinstance(node, yaml.MappingNode):
        entries = [(str(key.value), key, value) for key, value in node.value]
    else:
        return
    for name, key, value in entries:
        at, line = (*path, name), key.start_mark.line + 1
        if at in lines:
            raise ScenarioError(
                f"{source}, line {line}: '{'.'.join(map(str, at))}' stands twice, on lines {lines[at]} and {line};"
                " valid is once"
            )
        lines[at] = line
        _number(value, at, lines, source)
