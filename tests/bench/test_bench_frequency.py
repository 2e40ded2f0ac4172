"""The loops that the benchmark compares: all the same one, and what is another is refused."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from flipdiagram.theory.contact import GRAVITY_Z

OMEGA = np.array([4.0, 60.0])
pytestmark = pytest.mark.filterwarnings("default")  # of other people's packages, and of Drake's NaN payloads


@pytest.fixture(autouse=True)
def bench_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2]))


# those of the extras `test` and `bench` that are installed; the benchmark checks each contender at every run
PACKAGES = {
    "hand_written": "numba",
    "simulator": "pydrake",
    "control_loop": "control",
    "bdsim_loop": "bdsim",
    "pathsim_loop": "pathsim",
}
INSTALLED = [name for name, package in PACKAGES.items() if importlib.util.find_spec(package)]


@pytest.mark.parametrize("name", INSTALLED)
def test_a_contender_gives_the_samples_of_the_compiled_diagram(name):
    contender = importlib.import_module(f"bench.contenders.{name}")
    from bench.frequency import differ
    from bench.one_dof import Numbers, compile_loop, trajectories

    expected = trajectories(compile_loop(Numbers(), meters=False), OMEGA, 100)
    first = np.array([0.0, GRAVITY_Z - 60.0 * 4.0]) * 1e-4**2 / 2  # from rest a_cmd = 0, v_cmd = -w
    assert expected[0, :2] == pytest.approx(first, rel=1e-9)
    for log, rows in ((True, expected), (False, expected[:, -1:])):
        assert differ(contender.prepare(Numbers(), OMEGA, 100, log)(), rows) < 1e-9


def test_another_loop_is_refused(monkeypatch):
    from bench import frequency
    from bench.contenders import hand_written
    from bench.one_dof import Numbers, compile_loop

    monkeypatch.setattr(frequency, "MODULES", ("hand_written",))
    bare = compile_loop(Numbers(), meters=False)
    with pytest.raises(RuntimeError, match="runs another loop"):
        frequency.contenders(Numbers(gravity=-9.8), bare)
    monkeypatch.setattr(hand_written, "PACKAGE", "no_such_package")
    tasks, notes = frequency.contenders(Numbers(), bare)
    assert not tasks and "not installed (pip install no_such_package)" in notes[0]
