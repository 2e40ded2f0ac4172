"""The site as `make docs` builds it: pages, every module, the equations, nothing from elsewhere; CONTRIBUTING.md."""

import html
import importlib.util
import re
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import pytest
from patience import HUNG

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "flipdiagram"
MODULES = sorted(
    path.relative_to(PACKAGE).with_suffix("").as_posix().removesuffix("/__init__").removesuffix("__init__")
    for path in PACKAGE.rglob("*.py")
    if not re.fullmatch(r"_(?!_init__).*", path.stem)
)
LOADING = r'<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc="([^"]*)"|<link\b[^>]*\bhref="([^"]*)"|(?:url\(|@import )["\']?([^"\')]*)'


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Where it is; built by a process of its own, as the build dresses up our classes."""
    out = tmp_path_factory.mktemp("docs")
    command = [sys.executable, ROOT / "docs" / "build.py", "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HUNG)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return out


def texts_in(folder, *endings):
    """Text of each file by its path."""
    paths = [path for path in folder.rglob("*.*") if path.suffix in endings]
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in paths}


@pytest.fixture(scope="module")
def reference(site):
    """The files of the API reference."""
    return texts_in(site / "api", ".html", ".css")


@pytest.fixture(scope="module")
def page(reference):
    """page(module): what a reader sees of it, in one line of words."""

    def words(module):
        text = reference[f"flipdiagram/{module}.html"]
        text = text[text.index("<main") :].partition("</main>")[0]
        text = re.sub(r'<div class="pdoc-code codehilite">.*?</div>', "", text, flags=re.DOTALL)  # "View Source"
        return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).split())

    return words


def test_every_public_module_has_a_page_that_others_link_to(reference):
    assert "" in MODULES and "blocks/pd" in MODULES and "blocks/_parameters" not in MODULES
    pages = {f"flipdiagram/{module}.html" if module else "flipdiagram.html" for module in MODULES}
    assert pages == {name for name in reference if name.endswith(".html")} - {"index.html"}
    for name in pages - {"flipdiagram.html"}:
        parent = name.rpartition("/")[0] + ".html"
        link = name.removeprefix(parent.rpartition("/")[0]).removeprefix("/")
        assert f'href="{link}"' in reference[parent] or f'href="./{link}"' in reference[parent], (
            f"{parent} has no link to {link}"
        )
    assert 'url=./flipdiagram.html"' in reference["index.html"].replace("url=flip", "url=./flip")


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("blocks/pd", "a_ref = K_p (x_cmd - x) + K_v (v_cmd - v)"),
        ("blocks/pd", "ProportionalDerivative( k_p: ArrayLike, k_v: ArrayLike)"),
        ("blocks/pd", "Inputs x_cmd, x [m or rad] and v_cmd, v [m/s or rad/s], output a_ref"),
        ("blocks/observer", "tau_dis = g/(s+g) [tau + g M_n qd] - g M_n qd"),
        ("blocks/observer", "w[k+1] = e^(-g T) w[k] + (1 - e^(-g T)) (tau[k] + g M_n qd[k])"),
        (
            "blocks/observer",
            "DisturbanceObserver( g_dis: ArrayLike, inertia: ArrayLike, period: float, offset: float = 0.0, initial: ArrayLike = 0.0)",
        ),
        ("blocks/inverse_jacobian", "qdd_ref = J_t^-1 (a_ref - Jdot_t qd)"),
        ("diagrams/controller", "The four architectures differ by which boxes are present"),
        ("scenario/one_dof", "position gain (p) [1/s2, 0 to"),
    ],
)
def test_equations_ports_and_units_are_there(page, module, words):
    assert words.replace(" ", "") in page(module).replace(" ", "")


def test_names_that_only_python_knows_are_not(page):
    for module in filter(None, MODULES):
        text = page(module)
        assert (
            "𝓣" not in text
            and "converter: Any" not in text
            and "ToScalarType" not in text
            and "Overloaded function" not in text
        ), module


def test_every_page_is_in_the_site_and_reachable_from_its_first(site):
    home = (site / "index.html").read_text(encoding="utf-8")
    for page in (path for path in (ROOT / "docs").rglob("*.md") if "report" not in path.parts):
        name = page.relative_to(ROOT / "docs").with_suffix(".html").as_posix()
        assert (site / name).is_file() and (name == "index.html" or f'href="{name}"' in home), name
    python = (site / "reference" / "python.html").read_text(encoding="utf-8")
    assert 'href="../api/flipdiagram.html"' in python
    for name, words in (("cli", "flipdiagram arm"), ("scenario", "controller.k_p")):
        assert words in (site / "reference" / f"{name}.html").read_text(encoding="utf-8")


def test_the_site_is_small(site):
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < 10e6


def test_internals_say_so_and_what_is_public_says_that(page):
    assert "Internal: may change in any version" in page("robot/chain")
    assert "Public, from flipdiagram itself: ARCHITECTURES" in page(
        "scenario/scenario"
    ) or "Public, from flipdiagram itself: Scenario" in page("scenario/scenario")
    assert "Internal" not in page("blocks/pd") and "Internal" not in page("compiled")


def test_nothing_names_this_machine(site):
    reference = texts_in(site, ".html", ".css")
    pattern = re.compile(r"(?<![a-zA-Z0-9_.])/(?:home|root|Users|work|tmp|farm)/[A-Za-z]| at 0x[0-9a-f]{6}")
    own = [str(ROOT), sys.prefix, str(Path.home()) + "/"]
    for name, text in reference.items():
        assert not pattern.search(text) and not any(place in text for place in own), name


def test_nothing_is_loaded_from_elsewhere(site):
    reference = texts_in(site, ".html", ".css", ".js")
    for name, text in reference.items():
        found = ("".join(groups) for groups in re.findall(LOADING, text)) if name.endswith(".html") else ()
        outside = {place for place in found if re.match(r"\s*(?:https?:)?//", place)}
        assert not outside, name
    assert not re.search(r"(?:fetch|importScripts|XMLHttpRequest)\(\s*[\"']https?:", "".join(reference.values()))


CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


@pytest.fixture
def contributed(monkeypatch):
    """The contract suite of the blocks with the block of CONTRIBUTING.md entered as its step 2 says."""
    (code,) = re.findall(r"^ +```python\n(.*?)^ +```", CONTRIBUTING, re.DOTALL | re.MULTILINE)
    module = types.ModuleType("contributed_damping")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(textwrap.dedent(code), "CONTRIBUTING.md", "exec"), vars(module))
    (entry,) = re.findall(r"`(\"damping\": lambda: .*?),`", CONTRIBUTING)
    place = ROOT / "tests" / "blocks" / "test_contract.py"
    found = importlib.util.spec_from_file_location("contract_of_the_contributed", place)
    suite = importlib.util.module_from_spec(found)
    found.loader.exec_module(suite)
    suite.SYSTEMS.update(eval(f"{{{entry}}}", vars(module)))
    return suite


@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")  # as in the suite itself
def test_the_block_of_contributing_passes_the_contract_of_blocks(contributed):
    contributed.test_no_result_is_stale("damping")
    for form in ("ToAutoDiffXd", "ToSymbolic"):
        contributed.test_other_scalars_give_the_same_numbers("damping", form)
    contributed.test_converted_blocks_keep_ports_sampling_and_defaults("damping")
    contributed.test_every_system_says_what_it_is("damping")


def test_contributing_names_every_room_and_only_files_that_exist():
    for folder in {path.parent for path in PACKAGE.glob("*/*.py")}:
        assert f"`{folder.name}/`" in CONTRIBUTING.split("## Where is")[0], folder
    named = re.findall(r"`((?:\w+/)+\w+\.py)`", CONTRIBUTING)
    for name in named:
        example = name.endswith(("blocks/damping.py", "test_damping.py"))
        assert example or (ROOT / name).is_file() or (PACKAGE / name).is_file(), name
    assert len(named) > 20
