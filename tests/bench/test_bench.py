"""The benchmark: its cheapest piece from the command line, and the parts of it that calculate."""

import importlib.util
import json
import statistics
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def bench_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))


def test_the_cheapest_piece_writes_what_it_measured(tmp_path):
    command = [sys.executable, "bench/run.py", "--quick", "--only", "resolve", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "bench.json").read_text())
    assert report["schema"] == "flipdiagram/bench/1"
    (section,) = report["sections"]
    measured = {m["name"]: m for m in section["measurements"]}
    solve = measured["program.solve()"]
    assert solve["target"] == {"relation": "<", "value": 0.01}
    values = solve["values"]
    assert (solve["median"], solve["min"], solve["max"]) == (statistics.median(values), min(values), max(values))
    assert 0 < solve["min"] and solve["max"] < 10
    # how long it took is the machine's business; what is said of it, here and in the README's table, follows from that
    verdict = "met" if solve["median"] < 0.01 else "missed"
    assert solve["verdict"] == verdict
    assert "N = 50" in section["title"]
    if importlib.util.find_spec("clarabel"):
        assert measured["program.solve() / raw"]["unit"] == "x"
        assert any("same problem" in check for check in section["checks"])
    else:
        assert any("not installed" in check for check in section["checks"])
    markdown = (tmp_path / "bench.md").read_text()
    for name in measured:
        assert name in markdown and name in done.stdout
    (row,) = [line for line in markdown.splitlines() if f"{section['title']}: program.solve() |" in line]
    assert row.replace("*", "").endswith(f"| < 10.0 ms | {verdict} |")


def test_matrices_describe_the_same_problem_as_the_program():
    from bench import raw

    # min (x - 3)² + 2 y² + x y + y + 1  with  x + y = 4, 0 <= x <= 2, y = y0 fixed by a bound, x - y <= 10
    prog = MathematicalProgram()
    x, y = prog.NewContinuousVariables(2)
    prog.AddQuadraticCost(np.array([[2.0, 1.0], [1.0, 4.0]]), np.array([-6.0, 0.0]), 9.0, [x, y])
    prog.AddLinearCost(np.array([1.0]), 1.0, [y])
    prog.AddLinearEqualityConstraint(np.array([[1.0, 1.0]]), np.array([4.0]), [x, y])
    prog.AddBoundingBoxConstraint([0.0, 2.5], [2.0, 2.5], [x, y])
    prog.AddLinearConstraint(np.array([[1.0, -1.0]]), [-np.inf], [10.0], [x, y])
    problem = raw.matrices(prog)
    assert (problem.equalities, problem.b.size) == (2, 5)  # of the bounds on x, both; of the row, the upper one
    at = np.array([1.5, 2.5])
    assert problem.objective(at) == pytest.approx(1.5**2 + 2 * 2.5**2 + 1.5 * 2.5 + 2.5 + 1)
    assert problem.violation(at) == pytest.approx(0.0)
    assert problem.violation(np.array([2.5, 2.5])) == pytest.approx(1.0)  # the equality; the bound by 0.5 only
    result = ClarabelSolver().Solve(prog)
    assert problem.objective(result.GetSolution([x, y])) == pytest.approx(result.get_optimal_cost())


def test_self_times_leave_out_what_is_called_inside():
    from bench.timing import SelfTimes

    now = 0.0

    def work(seconds):
        nonlocal now
        now += seconds

    own = SelfTimes(clock=lambda: now)
    inner = own.wrap(lambda: work(4.0), lambda: "inner")

    def outer():
        work(1.0)
        inner()
        work(2.0)
        inner()

    own.wrap(outer, lambda: "outer")()
    assert own.take() == {"outer": 3.0, "inner": 8.0}
    assert own.take() == {}


def test_watch_sees_the_memory_of_a_grandchild():
    from bench.processes import watch

    grandchild = "import time; block = bytearray(150_000_000); time.sleep(0.3); print('done')"
    child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}], check=True)"
    watched = watch([sys.executable, "-c", child])
    assert watched.largest > 150e6
    assert [line for _, line in watched.lines] == ["done"]
    assert 0.3 < watched.elapsed


def test_a_command_that_fails_is_no_measurement():
    from bench.processes import watch

    with pytest.raises(RuntimeError, match="exit code 3: no motion"):
        watch([sys.executable, "-c", "print('no motion'); raise SystemExit(3)"])


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.234, "s", "1.23 s"),
        (0.01234, "s", "12.3 ms"),
        (0.000123, "s", "123 µs"),
        (6e8, "B", "600 MB"),
        (1.5, "x", "1.50 ×"),
    ],
)
def test_quantities_have_three_digits_and_a_unit(value, unit, text):
    from bench.tables import quantity

    assert quantity(value, unit) == text


def test_a_verdict_follows_the_median():
    from bench.results import Measurement, Target

    assert Measurement("slow once", [1.0, 1.0, 9.0], target=Target("<", 2.0)).verdict == "met"
    assert Measurement("slow", [1.0, 3.0, 3.0], target=Target("<", 2.0)).verdict == "missed"
    assert Measurement("factor", [2.0, 2.0], "x", Target(">=", 2.0)).verdict == "met"
    assert Measurement("unjudged", [1.0]).verdict is None


def test_a_million_trials_on_paper_are_bound_by_what_is_slowest():
    from bench.cluster import _on_paper

    batches = {"scheduler": 3e-4, "driver": 2e-4, "idle": 0.02, "wall": 0.01}  # 0.1 ms are the scheduler's for a trial
    alone = batches | {"scheduler": 5.2e-3, "driver": 4e-3}
    text = _on_paper(alone, batches, 1.5)
    assert "25 min" in text and "667 trials a second in batches of 22, 33 s each" in text
    assert "scheduler 0.32 ms a trial, 22% of a core" in text and text.endswith("bound by the cores")
    assert _on_paper(alone, alone, 1.5).endswith("bound by the driver or the scheduler")
