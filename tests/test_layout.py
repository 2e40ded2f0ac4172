"""The house rules: one direction of imports, short files, no star imports of Drake, no paths of anyone's machine."""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "flipdiagram"
LONGEST = 300

# Each module may import only from those above it; a folder stands for all its files.
ORDER = (
    "errors", "files", "parallel", "scenario_io", "scenario_one_dof", "scenario_parts", "scenario_place", "scenario", "contact", "transfer",
    "arm_files", "assets", "provenance", "task_space", "inverse_kinematics", "assembly", "arm", "serial_chain", "parts",
    "planning", "blocks", "plants", "replacement", "controller", "one_dof_loop", "loop", "compiled", "recording", "margins", "simulate", "metrics", "second_engine", "studies",
    "scene", "sketch", "snapshots", "figures", "frequency_figures", "replay", "gallery", "grid", "tables", "campaign", "campaign_figures", "campaign_tables", "campaign_report",
    "frequency_tables", "experiment_figures", "experiment_tables", "border_figures", "border_tables", "replanning_tables", "place_figures", "place_tables", "results", "drawing", "diagrams", "api", "report",
    "live", "terminal", "campaign_commands", "options", "completion", "commands", "cli",
)  # fmt: skip

MODULES = sorted(PACKAGE.rglob("*.py"))
SOURCES = sorted([*MODULES, *ROOT.glob("tests/**/*.py"), *ROOT.glob("bench/**/*.py")])


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path) for path in MODULES}


def imports_of(text: str) -> set[str]:
    """Modules of ours that a module imports anywhere in it; `from package import name` counts as package.name."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                deeper = f"{node.module}.{alias.name}"
                found.add(deeper if deeper in NAMES else str(node.module))
    return {name for name in found if name.split(".")[0] == "flipdiagram"} - {"flipdiagram"}


def room_of(module: str) -> str:
    return module.split(".")[1]


GRAPH = {name_of(path): imports_of(path.read_text(encoding="utf-8")) for path in MODULES}


def test_imports_are_found_in_every_form():
    text = "import flipdiagram.errors\nfrom flipdiagram import contact\ndef f():\n from flipdiagram.planning.plan import Plan"
    assert imports_of(text) == {"flipdiagram.errors", "flipdiagram.contact", "flipdiagram.planning.plan"}


@pytest.mark.parametrize("module", sorted(set(GRAPH) - {"flipdiagram"}))
def test_a_module_imports_only_from_above(module):
    assert room_of(module) in ORDER, f"give {module} its place in ORDER"
    place = ORDER.index(room_of(module))
    below = {name for name in GRAPH[module] if room_of(name) not in ORDER or ORDER.index(room_of(name)) > place}
    assert not below, f"{module} imports {', '.join(sorted(below))}, which stand below it"


def test_no_module_imports_itself_in_a_circle():
    seen: dict[str, bool] = {}

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path, module))
        if module not in seen:
            for name in GRAPH.get(module, ()):
                visit(name, (*path, module))
            seen[module] = True

    for module in GRAPH:
        visit(module, ())


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_source_file_keeps_the_house_rules(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= LONGEST or path not in MODULES, f"more than {LONGEST} lines: is it still one idea?"
    stars = [n.module for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ImportFrom) and n.names[0].name == "*"]
    assert not stars, "import names, not everything: pydrake.all shadows abs, all, max, min and pow"
    assert "pydrake.all" not in {getattr(n, "module", None) for n in ast.walk(ast.parse(text))}


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
