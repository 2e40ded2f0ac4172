"""The question that a flip answers, and its names: equal questions have equal keys, so that none is flown twice."""

import hashlib
import json
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.errors import InputError
from flipdiagram.files import read_file, versions
from flipdiagram.robot.model_files import urdf_directory
from flipdiagram.scenario.scenario import FILES, Controller, Scenario, value_of

PLAN_SECTIONS = ("arm", "tool", "object", "table", "task", "planner")
"""What a plan depends on; a test checks that nothing else changes it."""
SOURCES = ("blocks", "diagrams", "planning", "plants", "robot", "scenario", "simulation", "theory")
"""Modules whose code decides what a flip measures; a test compares them with what `simulate`, `metrics` import."""
NOT_OF_A_FLIP = ("one_dof", "frequency")
"""Sections on which no flip depends."""
OF_A_FLIP = set(Scenario.model_fields) - set(NOT_OF_A_FLIP)


@cache
def code_version(modules: tuple[str, ...]) -> str:
    """Digest of our modules (files or folders by name), the model files, and the versions of Drake, Python and ours.

    A stored result is used again only where it would come out the same.
    """
    package = Path(__file__).parents[1]
    files = [path for name in modules for path in (package / f"{name}.py", *sorted((package / name).rglob("*.py")))]
    files += sorted(urdf_directory().glob("*df"))
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for path in files:
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class Flip:
    """One flip to be run; recording: file for its signals, relative to the study's folder, or None."""

    scenario: Scenario
    architecture: str
    recording: str | None = None

    def __post_init__(self) -> None:
        check_architecture(self.architecture)

    @property
    def key(self) -> str:
        """Name of the question: scenario as far as the architecture depends on it, architecture, code and versions."""
        scenario = self.scenario
        if "dob" not in self.architecture:  # no observer, no cut-off
            scenario = scenario.with_overrides({"controller.g_dis": Controller().g_dis})
        return _digest(scenario, OF_A_FLIP, self.architecture, code_version(SOURCES), *_engine(scenario))

    @property
    def plan_key(self) -> str:
        """Name of the motion that the flip needs."""
        return _digest(self.scenario, PLAN_SECTIONS, code_version(SOURCES))


def scenario_digest(scenario: Scenario) -> str:
    """Name of a scenario, as far as the flip goes."""
    return hashlib.sha256(_sections(scenario, OF_A_FLIP).encode()).hexdigest()


def _digest(scenario: Scenario, sections: Collection[str], *texts: str) -> str:
    parts = (_sections(scenario, sections), *_models(scenario), *texts)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _sections(scenario: Scenario, sections: Collection[str]) -> str:
    return json.dumps(scenario.model_dump(mode="json", include=set(sections)), sort_keys=True)


def _engine(scenario: Scenario) -> list[str]:
    """The version of an engine that `code_version` does not count; none where it is missing: nothing flies there."""
    with suppress(PackageNotFoundError):
        return [f"mujoco {version('mujoco')}"] if scenario.simulation.engine == "mujoco" else []
    return []


def _models(scenario: Scenario) -> list[str]:
    """Digests of the model files that a scenario names: they may change under the same name."""
    digests = []
    for field in FILES:
        if path := value_of(scenario, field):
            with suppress(InputError):  # who runs the flip says that it cannot be read
                digests.append(f"{field} {hashlib.sha256(read_file(path, field, 'a file')).hexdigest()}")
    return digests
