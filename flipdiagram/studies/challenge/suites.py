"""The worlds of the challenge: frozen suites of campaigns, drawn from public seeds or from the organiser's secret."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from flipdiagram.campaign.checks import drawn_from
from flipdiagram.campaign.specification import Specification, Trial
from flipdiagram.campaign.specification_file import Source
from flipdiagram.errors import InputError
from flipdiagram.files import read_text
from flipdiagram.flips.store import digest_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.yaml_reader import read_mapping
from flipdiagram.studies.challenge.entry import OWN

LATEST = "v1"
PUBLIC, HELD_OUT = "public", "held-out"
LEAST_SECRET = 16
"""Characters: a shorter one could be guessed."""


@dataclass(frozen=True)
class World:
    """One world in which every entry flies; its hash changes with every number that decides it."""

    kind: str
    """`PUBLIC` or `HELD_OUT`."""
    suite: str
    index: int
    trial: Trial
    specification: Specification
    hash: str

    @property
    def name(self) -> str:
        """As in messages: 'public uncertain 12'."""
        return f"{self.kind} {self.suite} {self.index}"

    def truth(self, engine: str, settings: Mapping[str, Any]) -> Scenario:
        """What is true, with planner and controller as the entry sets them."""
        overrides = self.trial.overrides | {"simulation.engine": engine}
        return self.specification.base.with_overrides(overrides | dict(settings))

    def believed(self, engine: str, settings: Mapping[str, Any]) -> Scenario:
        """What the entry is told: the start, what the suite says is known, and else what does not vary."""
        known = self.specification.known
        told = {path: v for path, v in self.trial.overrides.items() if path.startswith("task.") or path in known}
        return self.specification.base.with_overrides(told | {"simulation.engine": engine} | dict(settings))


@dataclass(frozen=True)
class Suites:
    """A version of the suites, as its file has it."""

    version: str
    base: Mapping[str, Any]
    suites: Mapping[str, Mapping[str, Any]]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the suites, in the order of the file."""
        return tuple(self.suites)

    @cached_property
    def digest(self) -> str:
        """Name of all its public worlds."""
        return digest_of({"worlds": [world.hash for world in self.worlds(self.names)]})

    def worlds(self, names: Sequence[str], secret: str | None = None) -> list[World]:
        """The public worlds of some suites, or those that a secret draws."""
        kind = PUBLIC if secret is None else HELD_OUT
        found, fixed = [], {section: fields for section, fields in self.base.items() if section not in OWN}
        for name in names:
            suite = dict(self.suites[name])
            if secret is not None:
                if "seed" not in suite:
                    continue
                digest = hashlib.sha256(f"{self.version} {name} {secret}".encode()).digest()
                suite["seed"] = int.from_bytes(digest[:4], "big")
            specification = _specification(name, self.base, suite)
            for index in range(specification.trials):
                trial = specification.trial(index)
                decides = {"base": fixed, "overrides": trial.overrides, "known": sorted(specification.known)}
                found.append(World(kind, name, index, trial, specification, digest_of(decides)))
        return found


def load_suites(version: str = LATEST) -> Suites:
    """A version of the suites that comes with flipdiagram."""
    file = Path(__file__).with_name(f"{version}.yaml")
    data, _ = read_mapping(file.read_text(encoding="utf-8"), file.name, "'version', 'base' and 'suites'")
    return Suites(data["version"], data["base"], data["suites"])


def read_secret(path: str | Path) -> str:
    """The organiser's secret, the text of a file; raises InputError where it is none."""
    secret = read_text(path, "--seed-file", "a text file").strip()
    if len(secret) < LEAST_SECRET:
        valid = f"at least {LEAST_SECRET} characters, such as of `openssl rand -hex 32`"
        raise InputError.of("--seed-file", str(path), valid, f"--seed-file = '{path}' holds {len(secret)} characters")
    return secret


def _specification(name: str, base: Mapping[str, Any], suite: Mapping[str, Any]) -> Specification:
    source = Source(f"suite {name}", "", {"base": dict(base), **suite}, {})
    return drawn_from(source, Path())
