"""The distribution: built from the listed files without network, installed alone, used from another folder.

`python -m build` makes the wheel from the source distribution, so the one proves that the other holds all it needs.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from patience import HUNG

ROOT = Path(__file__).parents[1]
SOURCE = {path.relative_to(ROOT).as_posix() for path in (ROOT / "flipdiagram").rglob("*.py")}


def run(*command, **settings):
    # neither the checkout nor a pytest of ours may leak into the processes that stand for a user's
    variables = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "COV_", "PIP_", "MYPY"))
    }
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=HUNG, env=variables, **settings)
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(source distribution, wheel), made from a copy of the files that git lists."""
    git = shutil.which("git")
    assert git, "git is needed"
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: git cannot list the files")
    copy, out = tmp_path_factory.mktemp("copy"), tmp_path_factory.mktemp("dist")
    listing = run(git, "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", "-z").stdout.split("\0")
    for name in listing:
        if name and (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name)
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, copy)
    (sdist,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def environment(built, tmp_path_factory):
    """bin/ of a new virtual environment: the wheel installed by pip, the dependencies lent by this one.

    A .pth file lends the folder and not the .pth files in it, so an editable install there stays out of sight.
    """
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    paths = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)}, scheme="venv")
    scripts, packages = Path(paths["scripts"]), Path(paths["purelib"])
    quietly = ("--quiet", "--no-deps", "--no-index", "--disable-pip-version-check")
    run(sys.executable, "-m", "pip", "--python", scripts / "python", "install", *quietly, built[1])
    (packages / "lent.pth").write_text("\n".join({sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}))
    return scripts


def test_the_wheel_holds_the_package_and_nothing_else(built):
    with zipfile.ZipFile(built[1]) as wheel:
        names, metadata = set(wheel.namelist()), {}
        for name in names:
            if name.endswith((".dist-info/METADATA", ".dist-info/entry_points.txt")):
                metadata[name.rpartition("/")[2]] = wheel.read(name).decode()
    package = {name for name in names if ".dist-info/" not in name}
    assert {name for name in package if name.endswith(".py")} == SOURCE
    assert {"flipdiagram/py.typed", "flipdiagram/rendering/replay_overlay.html"} <= package
    models = {f"flipdiagram/urdf/{path.name}" for path in (ROOT / "urdf").iterdir() if path.is_file()}
    assert "flipdiagram/urdf/mh3f.urdf" in models and models <= package
    data = {path.relative_to(ROOT).as_posix() for path in (ROOT / "flipdiagram").rglob("*") if path.is_file()}
    assert package <= data | {name for name in package if name.startswith("flipdiagram/urdf/")}
    assert not {name for name in package if re.search(r"tests?/|notebooks?/|\.ipynb$|\.pyc$", name)}
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    assert "flipdiagram = flipdiagram.__main__:main" in metadata["entry_points.txt"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"Version: {project['version']}" in metadata["METADATA"] and "Requires-Dist: drake" in metadata["METADATA"]


def test_the_source_distribution_holds_what_builds_and_tests_need(built):
    with tarfile.open(built[0]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert SOURCE <= names
    assert {"pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "Makefile", "urdf/mh3f.urdf"} <= names
    assert {path.relative_to(ROOT).as_posix() for path in ROOT.glob("tests/**/*.py")} <= names
    assert not {name for name in names if name.startswith(("out/", ".venv", "dist/")) or name.endswith(".pyc")}


def test_the_installed_package_is_the_wheel_not_the_checkout(environment, tmp_path):
    text = "import flipdiagram as f, flipdiagram.robot.model_files as a; print(f.__file__, a.urdf_directory(), f.__version__, sep='\\n')"
    package, models, version = run(environment / "python", "-c", text, cwd=tmp_path).stdout.splitlines()
    inside = environment.parent.resolve()
    assert inside in Path(package).resolve().parents and inside in Path(models).resolve().parents
    assert version in run(environment / "flipdiagram", "--version", cwd=tmp_path).stdout


def test_scenario_and_plan_run_in_another_folder(environment, tmp_path):
    assert "mass: 0.061" in run(environment / "flipdiagram", "scenario", cwd=tmp_path).stdout
    assert "planned motion" in run(environment / "flipdiagram", "plan", cwd=tmp_path).stdout
    assert {path.name for path in (tmp_path / "out" / "plan").iterdir()} == {
        ".flipdiagram",
        "plan.json",
        "plan.png",
        "plan.svg",
        "summary.json",
    }


def test_a_flip_runs_in_another_folder(environment, tmp_path):
    words = (
        "--architecture",
        "pd+ff+dob",
        "--quick",
        "--no-replay",
        "--simulation.hold_time",
        "0.2",
        "--out",
        "flipped",
    )
    run(environment / "flipdiagram", "flip", *words, cwd=tmp_path)
    written = {path.name for path in (tmp_path / "flipped").iterdir()}
    assert {"pd+ff+dob.nc", "plan.json", "summary.json"} <= written
    (result,) = json.loads((tmp_path / "flipped" / "summary.json").read_text(encoding="utf-8"))["runs"]
    assert result["architecture"] == "pd+ff+dob" and result["recording"] in written


CONSUMER = """
from flipdiagram.theory.contact import sliding_angle
from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import Scenario

scenario = Scenario().with_overrides({"controller.k_p": 400.0})
reveal_type(scenario.controller.k_p)
reveal_type(scenario.planner.contact_samples)
reveal_type(InputError.exit_code)
scenario.controller.kp
sliding_angle("steep")
"""


def test_a_type_checker_sees_the_types_of_the_installed_package(environment, tmp_path):
    (tmp_path / "consumer.py").write_text(CONSUMER)
    command = [sys.executable, "-m", "mypy", "--python-executable", environment / "python", "--config-file", os.devnull]
    done = subprocess.run(
        [*map(str, command), "consumer.py"], capture_output=True, text=True, timeout=HUNG, cwd=tmp_path
    )
    revealed = re.findall(r'Revealed type is "(.*)"', done.stdout.replace("builtins.", ""))
    assert revealed == ["float", "tuple[int, int]", "int"], done.stdout
    errors = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert (
        '"Controller" has no attribute "kp"' in errors[0]
        and errors[1:]
        and all("sliding_angle" in e for e in errors[1:])
    )
