"""Every notebook runs from a clean kernel, and the outputs kept in it are those that it gives.

After a change `python tests/test_notebooks.py [NAME.ipynb ...]` executes them again in place, without timestamps.
"""

import ast
import json
import os
import re
import sys
import time
from pathlib import Path

import matplotlib.font_manager  # noqa: F401  builds its cache, about which a kernel would tell on stderr
import nbformat
import pytest
from nbclient import NotebookClient
from patience import HUNG

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = {path.name: path for path in sorted(FOLDER.glob("*.ipynb"))}
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
LONGEST = 90
"""Seconds of processor time a notebook may take; they are meant to take less than half of it."""
LARGEST = 600_000
"""Bytes of a notebook with its outputs."""
WIDEST = 110
"""Characters in a line of printed text: more does not fit the page."""
PRIVATE = re.compile(r"/(?:home|root|work|tmp)/|site-packages|\b0x[0-9a-f]{6,}")
"""What the text of an output must not contain: paths and addresses of one machine or one run."""
COMPARED = ("text/plain", "text/markdown")
"""Kinds of output compared by their text; a table's HTML is that of pandas, a picture Matplotlib's or Graphviz's."""
PNG = "iVBORw0KGgo"
"""How a PNG begins in base64, which may spell anything."""
NEEDS = {"04_diagram.ipynb": pytest.mark.needs("dot")}
OWN_CLASSES = {"03_own_controller.ipynb"}

every = pytest.mark.parametrize("name", NOTEBOOKS)


def read(path):
    return nbformat.read(path, as_version=4)


def execute(notebook, folder):
    """The notebook run from top to bottom by a kernel of its own in a folder."""
    client = NotebookClient(
        notebook,
        timeout=HUNG,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(folder)}},
    )
    return client.execute()


def clean(notebook):
    """Without what differs from run to run: timestamps, random ids, version of Python, how text came in pieces."""
    notebook.metadata = nbformat.from_dict(METADATA)
    notebook.nbformat_minor = 5
    for i, cell in enumerate(notebook.cells):
        cell.metadata, cell.id = nbformat.from_dict({}), f"cell-{i:02d}"
        if cell.cell_type == "code":
            cell.outputs = joined(cell.outputs)
    return notebook


def joined(outputs):
    """The outputs with pieces of one stream put together."""
    result = []
    for output in outputs:
        if output.output_type == "stream" and result and result[-1].get("name") == output.name:
            result[-1].text += output.text
        else:
            result.append(output)
    return result


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def texts(cell):
    """Kinds of a cell's outputs, and the texts of those that do not change with the version of a library."""
    found = []
    for output in joined(cell.get("outputs", [])):
        if output.output_type == "stream":
            found.append((output.name, output.text))
        elif output.output_type == "error":
            found.append(("error", f"{output.ename}: {output.evalue}"))
        else:
            found += [(kind, text if kind in COMPARED else "") for kind, text in sorted(output.data.items())]
    return found


def test_there_are_notebooks():
    names = "01_turn_over 02_blocks 03_own_controller 04_diagram 05_planning 06_section_iii 07_campaign".split()
    names += [
        "08_own_arm_and_object",
        "09_replanning_and_place",
        "10_enter_your_controller",
        "11_from_block_to_pancake",
    ]
    assert list(NOTEBOOKS) == [f"{name}.ipynb" for name in names]


@pytest.mark.parametrize("name", [name for name in NOTEBOOKS if name >= "05"])
def test_a_notebook_of_a_study_takes_all_of_ours_from_the_public_face(name):
    source = "\n".join(cell.source for cell in code_cells(read(NOTEBOOKS[name])))
    assert set(re.findall(r"^(?:from|import) (flipdiagram\S*)", source, re.MULTILINE)) == {"flipdiagram"}


@pytest.mark.parametrize("name", [pytest.param(name, marks=NEEDS.get(name, ())) for name in NOTEBOOKS])
def test_a_notebook_runs_and_gives_the_outputs_kept_in_it(name, tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))  # nobody's own settings
    kept, copy = read(NOTEBOOKS[name]), read(NOTEBOOKS[name])
    for cell in code_cells(copy):
        cell.outputs, cell.execution_count = [], None
    before = os.times()
    fresh = execute(copy, tmp_path)
    after = os.times()  # the kernel, a child, has ended
    assert 0 < after.children_user + after.children_system - before.children_user - before.children_system < LONGEST
    for old, new in zip(code_cells(kept), code_cells(fresh), strict=True):
        assert texts(new) == texts(old), old.source
    assert [path.name for path in tmp_path.iterdir() if path.name != "ipython"] == []


@every
def test_the_outputs_kept_are_whole_and_of_no_machine(name):
    notebook = read(NOTEBOOKS[name])
    cells = code_cells(notebook)
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    found = [(kind, text) for cell in cells for kind, text in texts(cell)]
    assert len(found) >= 5
    assert {"stderr", "error"}.isdisjoint(kind for kind, _ in found)
    everything = [text for cell in cells for output in cell.outputs for text in output.get("data", {}).values()]
    for text in everything + [text for _, text in found]:
        assert PRIVATE.search(text) is None or text.startswith(PNG)
    for kind, text in found:
        if kind == "stdout":
            assert max(map(len, text.splitlines()), default=0) <= WIDEST, text


@every
def test_a_notebook_is_small_and_clean(name):
    path = NOTEBOOKS[name]
    assert path.stat().st_size < LARGEST
    notebook = read(path)
    nbformat.validate(notebook)
    assert notebook.metadata == METADATA
    assert all(not cell.metadata for cell in notebook.cells)
    assert notebook.cells[0].cell_type == "markdown" and notebook.cells[0].source.startswith("# ")


@every
def test_only_the_own_controller_defines_a_class(name):
    sources = (re.sub(r"^%.*$", "", cell.source, flags=re.MULTILINE) for cell in code_cells(read(NOTEBOOKS[name])))
    defined = [node for source in sources for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    assert bool(defined) == (name in OWN_CLASSES)


def refresh(names):
    """Execute notebooks in place."""
    for name in names or NOTEBOOKS:
        begin = time.perf_counter()
        notebook = clean(execute(read(FOLDER / name), FOLDER))
        nbformat.write(notebook, FOLDER / name)
        size = len(json.dumps(notebook))
        print(f"{name}: {time.perf_counter() - begin:.1f} s, {size / 1000:.0f} kB")


if __name__ == "__main__":
    refresh(sys.argv[1:])
