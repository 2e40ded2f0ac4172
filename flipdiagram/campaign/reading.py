"""The YAML of a campaign as plain data that knows its lines.  YAML cannot run code: a tag is refused."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from flipdiagram.errors import InputError
from flipdiagram.scenario.yaml_reader import _Loader, show

LARGEST = 1_000_000
"""Characters that a specification may have."""
Path_ = tuple[str, ...]


@dataclass(frozen=True)
class Source:
    """Plain data from a YAML file, and the line on which each key of its mappings stands."""

    name: str
    text: str
    data: dict[str, Any]
    lines: dict[Path_, int] = field(repr=False)

    def error(self, path: Iterable[str], problem: str) -> InputError:
        """An error about a key, or the nearest key above it that is there: 'campaign 'a.yaml', line 3: …'."""
        at = tuple(path)
        while at and at not in self.lines:
            at = at[:-1]
        line = f", line {self.lines[at]}" if at in self.lines else ""
        return InputError(f"campaign '{self.name}'{line}: {problem}")

    def bad(self, path: Iterable[str], value: Any, valid: str) -> InputError:
        """The error of a value that is not valid."""
        at = tuple(path)
        return self.error(at, f"{': '.join(at)} = {show(value)} is not valid; valid is {valid}")


def read(path: str | Path) -> Source:
    """The file; InputError where it cannot be read or is no mapping."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError(f"campaign '{path}' cannot be read: {reason}; valid is a YAML file") from None
    return parse(text, str(path))


def parse(text: str, name: str = "campaign.yaml") -> Source:
    """The text; `name` stands for it in errors.  InputError where it is no YAML mapping."""
    if len(text) > LARGEST:
        raise InputError(f"campaign '{name}' has {len(text)} characters; valid are at most {LARGEST}")
    lines: dict[Path_, int] = {}
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is not None:
            _walk(node, (), lines, name)
        data = None if node is None else loader.construct_document(node)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or error
        raise InputError(f"campaign '{name}'{line}: not valid YAML: {' '.join(str(problem).split())}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"campaign '{name}': not valid YAML: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise InputError(f"campaign '{name}' = {show(data)} is no mapping; valid is 'vary: {{field: …}}' and so on")
    return Source(name, text, data, lines)


def _walk(node: yaml.Node, path: Path_, lines: dict[Path_, int], name: str) -> None:
    """Note the line of each key; refuse keys that stand twice, of which PyYAML keeps the last in silence."""
    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _walk(item, (*path, "[]"), lines, name)
    if not isinstance(node, yaml.MappingNode):
        return
    seen: dict[str, int] = {}
    for key, value in node.value:
        text, line = str(key.value), key.start_mark.line + 1
        if text in seen:
            raise InputError(
                f"campaign '{name}', line {line}: '{text}' stands twice, first on line {seen[text]}; valid is once"
            )
        seen[text] = line
        lines.setdefault((*path, text), line)
        _walk(value, (*path, text), lines, name)
