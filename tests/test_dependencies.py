"""pyproject.toml declares what is imported, and what it declares for the package is imported."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
OF_DEVELOPERS = {"bench", "bench-peers", "docs", "examples", "lint", "notebook", "test"}
OURS = {"flipdiagram", "bench"} | {path.stem for folder in ("tests", "docs") for path in (ROOT / folder).iterdir()}
PROVIDERS = packages_distributions()


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def declared(*extras):
    """Distributions that an installation with these extras asks for, those of the extras that they name included."""
    names = set()
    for line in [*PROJECT["dependencies"], *(line for extra in extras for line in EXTRAS[extra])]:
        name, inner = re.match(r"([\w.-]+)(?:\[([\w,-]+)\])?", line).groups()
        names |= declared(*inner.split(",")) if name == "flipdiagram" else {canonical(name)}
    return names


def providers(module):
    """Distributions that bring a module; by its own name where it is not installed."""
    return {canonical(name) for name in PROVIDERS.get(module, [module])}


def imports(folder, without=""):
    """{module from elsewhere: whether some file of the folder cannot be imported without it}.

    without: a folder in it that is left out.
    """
    modules = {}

    def visit(node, needed):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names = [node.module]
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            function = getattr(node.func, "attr", getattr(node.func, "id", ""))
            names = [node.args[0].value] if function in ("import_module", "importorskip") else []
        for name in (name.partition(".")[0] for name in names):
            if name and name not in sys.stdlib_module_names and name not in OURS:
                modules[name] = modules.get(name, False) or needed
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            needed = False
        for child in ast.iter_child_nodes(node):
            visit(child, needed and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))

    for path in sorted((ROOT / folder).rglob("*.py")):
        if without and (ROOT / folder / without) in path.parents:
            continue
        visit(ast.parse(path.read_text(encoding="utf-8")), True)
    return modules


IMPORTED = imports("flipdiagram")


def test_imports_are_found_wherever_they_stand(tmp_path):
    (tmp_path / "module.py").write_text(
        "import os, numpy.linalg\nfrom . import mine\nif TYPE_CHECKING:\n    import optuna\n"
        "def f():\n    from pyarrow import parquet\n    importlib.import_module('mujoco')\n"
        "try:\n    import yaml\nexcept ImportError:\n    pass\n"
    )
    late = {"optuna": False, "pyarrow": False, "mujoco": False}
    assert imports(tmp_path) == {"numpy": True, "yaml": True} | late


@pytest.mark.parametrize(
    ("folder", "extras"),
    [
        ("flipdiagram", sorted(EXTRAS.keys() - OF_DEVELOPERS)),
        ("tests", ["test"]),
        ("bench", ["bench", "bench-peers"]),
        ("docs", ["docs"]),
        ("examples", ["examples"]),
    ],
)
def test_what_is_imported_is_declared(folder, extras):
    modules, asked_for = imports(folder), declared(*extras)
    assert "numpy" in modules
    assert not {module for module in modules if not providers(module) & asked_for}


def test_what_the_package_needs_to_be_imported_is_no_extra():
    """Only the room `environment`, which nothing else of ours imports, cannot be imported without its extra."""

    def needed(modules, allowed):
        return {module for module, needed in modules.items() if needed and not providers(module) & allowed}

    assert not needed(imports("flipdiagram", without="environment"), declared())
    assert needed(IMPORTED, declared()) == {"gymnasium"} and not needed(IMPORTED, declared("gym"))


@pytest.mark.parametrize("extra", [None, *sorted(EXTRAS.keys() - OF_DEVELOPERS)])
def test_what_is_declared_is_imported(extra):
    imported = set().union(*map(providers, IMPORTED))
    named = declared(extra) - declared() if extra else declared()
    assert named and not named - imported


def test_an_extra_named_in_a_message_exists():
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "flipdiagram").rglob("*.py"))
    named = set(re.findall(r"pip install 'flipdiagram\[([\w-]+)\]'", text))
    assert "parquet" in named and named <= EXTRAS.keys() - OF_DEVELOPERS
