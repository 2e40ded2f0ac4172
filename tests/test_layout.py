"""The house rules that no linter knows: short files, no star imports of Drake, no paths of anyone's machine.

The direction of imports is kept by the contracts in `pyproject.toml`, which `make lint` checks.
"""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import LONG

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "flipdiagram"
LONGEST = 300

MODULES = sorted(PACKAGE.rglob("*.py"))
SOURCES = sorted([*MODULES, *ROOT.glob("tests/**/*.py"), *ROOT.glob("bench/**/*.py")])


def test_a_file_of_the_package_is_short():
    long = {str(path.relative_to(ROOT)): n for path in MODULES if (n := path.read_text("utf-8").count("\n")) > LONGEST}
    assert not long, "is it still one idea?"


def test_names_are_imported_one_by_one():
    """pydrake.all shadows abs, all, max, min and pow; it also costs a second at every start."""
    stars = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.names[0].name == "*" or node.module == "pydrake.all"):
                stars.append(f"{path.relative_to(ROOT)}: from {node.module} import {node.names[0].name}")
    assert not stars


def test_no_tracked_file_names_a_place_on_someones_machine():
    git = shutil.which("git")
    assert git, "git is needed"
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: git cannot list the files")
    listing = [git, "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    files = subprocess.run(listing, capture_output=True, text=True, check=True).stdout.split("\0")
    pattern = re.compile(rb"(?<![a-zA-Z0-9_.])/(?:home|root|Users|work|tmp|farm)/[A-Za-z]")
    named = [name for name in files if name and (ROOT / name).is_file() and pattern.search((ROOT / name).read_bytes())]
    assert not named, named


def test_the_files_named_as_long_exist():
    assert set(LONG) <= {path.name for path in ROOT.glob("tests/**/*.py")}
