"""Settings of all tests: the same examples in every run, and no test that needs a program skipped unnoticed."""

import os
import shutil
import tempfile

import pytest
import shared
from hypothesis import settings

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")

ALTERNATIVES = {"chromium": ("chromium", "chromium-browser", "google-chrome")}
LONG = (
    "test_notebooks.py",
    "test_one_dof_agreement.py",
    "test_turnover.py",
    "test_wheel.py",
    "test_docs.py",
    "test_experiment.py",
    "test_flips.py",
    "test_running.py",
)
"""Files that take the longest (`pytest --durations=50`). They come first, so that no worker ends alone with one."""


def pytest_configure(config: pytest.Config) -> None:
    """Make the folder in which the workers of this run share what they compute."""
    if not hasattr(config, "workerinput"):
        os.environ[shared.FOLDER] = tempfile.mkdtemp(prefix="flipdiagram-tests-")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove it."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(shared.FOLDER), ignore_errors=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the long files first; `make test` keeps this order with --no-loadscope-reorder."""
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Handle `@pytest.mark.needs("dot")`: a missing program skips with a reason, and fails in CI, which has them all."""
    for marker in item.iter_markers("needs"):
        for program in marker.args:
            if not any(shutil.which(name) for name in ALTERNATIVES.get(program, (program,))):
                message = f"'{program}' is not installed; `make test` installs it as root where apt is at hand"
                (pytest.fail if os.environ.get("CI") else pytest.skip)(message)
