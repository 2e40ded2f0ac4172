"""What `flipdiagram challenge --template` prints."""

from pathlib import Path

from flipdiagram.scenario.scenario import Scenario


def show(scenario: Scenario, *, template: bool, json: bool) -> list[str] | None:
    """The text of an entry to begin with, which is one itself; None where a score is wanted."""
    if not template:
        return None
    return [Path(__file__).with_name("template.py").read_text(encoding="utf-8").removesuffix("\n")]
