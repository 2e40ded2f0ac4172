"""Any study from Python, by the name of its command's results."""

import os
from typing import Any

from flipdiagram.errors import InputError
from flipdiagram.files import check_output_directory
from flipdiagram.results.opening import Result, open_result
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.study import Progress, silent


def run_study(
    name: str,
    out: str | os.PathLike[str],
    scenario: Scenario | None = None,
    *,
    progress: Progress = silent,
    **options: Any,
) -> Result:
    """Run a study into a folder, as its command does, without figures; what `open_result` reads there.

    Args:
        name: 'plan', 'turnover', 'frequency', 'experiment', 'borders', 'replanning', 'place', 'campaign', …
        out: folder of its results.
        scenario: the default where None.
        progress: told how far it is, as a line of text.
        options: those of its command, by their names in Python: quick=True, architectures=['pd'], jobs=1, starts=[0.0].

    Raises InputError for an unknown study or option, and what the study raises.
    """
    if name not in STUDIES:
        raise InputError.of("name", name, tuple(STUDIES), f"unknown study '{name}'")
    study = STUDIES[name]
    defaults = {option.dest: _default(option.settings) for option in study.options if "run" in option.to}
    for option in options.keys() - defaults.keys():
        problem = f"the study '{name}' has no option '{option}'"
        raise InputError.of(option, options[option], tuple(defaults) or "none", problem)
    folder = check_output_directory(os.fspath(out))
    with study.replacing(folder):
        study.run(scenario or Scenario(), folder, progress=progress, **defaults | options)
    return open_result(folder / study.file)


def _default(settings: dict[str, Any]) -> Any:
    """What argparse gives where an option is left out."""
    return settings.get("default", False if settings.get("action") == "store_true" else None)
