"""The printed source and what becomes of it: shared subexpressions, the cache on disk, damaged and unwritable caches."""

import doctest
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.symbolic import Variable, sin
from pydrake.systems.framework import DiagramBuilder
from sampled_diagrams import PERIOD, expressions_block, saturated_loop, single

from flipdiagram.compiled import compile_diagram, diagram, kernel
from flipdiagram.compiled.vectors import LANES
from flipdiagram.files import cache_folder

FRESH = """
import sys
sys.path[:0] = {path!r}
from sampled_diagrams import saturated_loop
from flipdiagram.compiled import compile_diagram
compiled = compile_diagram(saturated_loop(0.77))
run = compiled.run(1000, inputs={{"reference": 0.1}})
print(compiled.from_cache, "numba" in sys.modules, repr(run.final.tolist()))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of the test's own, and nothing remembered in the process."""
    monkeypatch.setenv("FLIPDIAGRAM_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kernel, "_loaded", {})
    return tmp_path / "cache"


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "_loaded", {})


def final(compiled):
    return compiled.run(1000, inputs={"reference": 0.1}).final.tolist()


def test_a_fresh_process_finds_the_machine_code(folder):
    script = FRESH.format(path=[p for p in sys.path if p])
    runs = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split(" ", 2)
        for _ in range(2)
    ]
    assert [run[0] for run in runs] == ["False", "True"]
    assert [run[1] for run in runs] == ["False", "False"]  # which takes half a second to start
    assert runs[0][2] == runs[1][2]


def test_a_damaged_file_is_compiled_again(folder, monkeypatch):
    first = compile_diagram(saturated_loop())
    (file,) = folder.glob("*.o")
    good = file.read_bytes()
    assert not first.from_cache and compile_diagram(saturated_loop()).from_cache
    for damage in (good[: len(good) // 2], b"", good[:-1] + bytes([good[-1] ^ 1])):
        file.write_bytes(damage)
        forget(monkeypatch)
        again = compile_diagram(saturated_loop())
        assert not again.from_cache and final(again) == final(first)
    forget(monkeypatch)
    assert compile_diagram(saturated_loop()).from_cache


def test_a_folder_that_cannot_be_written_costs_only_time(folder, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("FLIPDIAGRAM_CACHE_DIR", str(tmp_path / "file" / "cache"))
    compiled = compile_diagram(saturated_loop())
    assert not compiled.from_cache and final(compiled)
    assert compile_diagram(saturated_loop()).from_cache  # in memory


def test_the_folder_stays_small(folder, monkeypatch):
    monkeypatch.setattr(kernel, "_KEPT", 2)
    folder.mkdir()
    for age in range(4):
        (folder / f"{age}.o").write_bytes(b"old")
        os.utime(folder / f"{age}.o", (age, age))
    compile_diagram(saturated_loop())
    names = {file.name for file in folder.iterdir()}
    assert len(names) == 2 and "3.o" in names


def test_the_default_folder_is_the_users(monkeypatch):
    monkeypatch.delenv("FLIPDIAGRAM_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache_folder() == Path("/somewhere/flipdiagram")


def test_subexpressions_of_different_blocks_are_computed_once_and_constants_before_the_loop():
    x, y, t, w = (Variable(name) for name in "xytw")
    builder = DiagramBuilder()
    for name, state in (("a", x), ("b", y)):
        dynamics = [0.5 * state + sin(w * t) + sin(3.0 * w)]
        block = expressions_block([state], [state], dynamics, time=t, parameter=np.array([w]))
        builder.AddNamedSystem(name, block)
    source = compile_diagram(builder.Build(), tie={"w": ["a.0", "b.0"]}, exact=True).source
    before, loop = source.split("\ntick:")
    assert before.count('call double @"sin"') == loop.count('call double @"sin"') == LANES


def test_the_source_is_the_same_for_two_builds():
    one, two = compile_diagram(saturated_loop()), compile_diagram(saturated_loop())
    assert one.source == two.source and two.from_cache


def test_exact_code_is_kept_beside_the_other(folder):
    x = Variable("x")
    block = expressions_block([x], [x], [sin(x)])
    assert [compile_diagram(block, exact=exact).from_cache for exact in (False, True, True)] == [False, False, True]
    assert len(list(folder.glob("*.o"))) == 2


def test_the_example_of_the_docstring():
    found = doctest.testmod(diagram)
    assert found.attempted > 8 and found.failed == 0


def test_a_single_block_is_a_diagram_too():
    x = Variable("x")
    compiled = compile_diagram(expressions_block([x], [x], [0.5 * x]))
    assert compiled.run(3, state=[8.0]).final == 1.0 and compiled.period == PERIOD
    assert compile_diagram(single(expressions_block([x], [x], [0.5 * x]))).source == compiled.source
