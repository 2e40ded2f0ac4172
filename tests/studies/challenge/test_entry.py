"""What enters the challenge: what a file may hold, and what is said of one that does not fit."""

import re
from pathlib import Path

import numpy as np
import pytest

from flipdiagram import InputError, Plan, PlanningError, Scenario, plan_motion
from flipdiagram.errors import EntryError
from flipdiagram.flips.outcome import SUCCESS
from flipdiagram.studies.challenge.entry import load_entry, watched
from flipdiagram.studies.challenge.flying import EntryFlight, fly_entry, plan_entry
from flipdiagram.studies.challenge.suites import load_suites

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "challenge.md"
WORLD = load_suites().worlds(["nominal"])[2]
FUNCTION = "def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):\n    "
SYSTEM = """
from pydrake.systems.framework import LeafSystem
class Mine(LeafSystem):
    def __init__(self):
        super().__init__()
        self.q = self.DeclareVectorInputPort("q", 6)
        self.DeclareVectorOutputPort("tau", 6, self.calc)
    def calc(self, context, output):
        output.set_value({value})
def controller(scenario):
    return Mine()
"""


@pytest.fixture
def entered(tmp_path):
    """Write the text of an entry and load it."""

    def enter(text):
        file = tmp_path / "mine.py"
        file.write_text(text, encoding="utf-8")
        return load_entry(file)

    return enter


@pytest.fixture(scope="module")
def plan():
    return plan_motion(WORLD.believed("drake", {})).to_json()


def flown(entry, plan):
    """The outcome of one flip of the nominal suite, with a short hold."""
    short = {"simulation.hold_time": 0.05, "simulation.settle_time": 0.3, **entry.settings}
    truth, believed = WORLD.truth("drake", short), WORLD.believed("drake", short)
    flight = EntryFlight(0, truth, believed, entry.architecture, path=entry.path, digest=entry.digest)
    return fly_entry(flight, plan).outcome


BAD_FILES = {
    "syntax": ("NAME = 'a'\ndef control(:\n", "entry 'mine.py', line 2: SyntaxError"),
    "import": ("\n\nimport no_such_module\n", "entry 'mine.py', line 3: ModuleNotFoundError: No module named"),
    "prints": ("print('hello')\n", "entry 'mine.py', line 1 writes to stdout: 'hello'; valid is stderr"),
    "nothing": ("X = 1\n", "entry 'mine.py' enters with nothing; valid is a function control, controller or plan"),
    "both": (FUNCTION + "pass\ndef controller(s): pass\n", "has both control and controller; valid is one of them"),
    "architecture": ("ARCHITECTURE = 'pid'\n", "has ARCHITECTURE = 'pid'; valid is one of pd, pd+ff"),
    "world": ("SETTINGS = {'object.friction': 3.0}\n", "sets 'object.friction'; valid is fields of planner and"),
    "value": ("SETTINGS = {'controller.k_p': -1}\n", "has SETTINGS that cannot be: scenario field 'controller.k_p'"),
    "settings": ("SETTINGS = 3\n", "has SETTINGS = 3; valid is a dict such as"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_file_that_cannot_enter_is_refused_in_one_line(entered, case):
    text, said = BAD_FILES[case]
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        entered(text)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_no_text_is_refused(tmp_path):
    with pytest.raises(InputError, match="entry"):
        load_entry(tmp_path / "none.py")
    (tmp_path / "mine.txt").write_text("NAME = 1")
    with pytest.raises(InputError, match=r"valid is a file whose name ends with \.py"):
        load_entry(tmp_path / "mine.txt")


BAD_FLIGHTS = {
    "shape": (FUNCTION + "return q[:5]\n", "'mine.py': control returned an array of shape (5,); valid is (6,)"),
    "none": (FUNCTION + "return None\n", "'mine.py': control returned"),
    "text": (FUNCTION + "return 'a lot'\n", "'mine.py': control returned str; valid are 6 torques"),
    "nan": (FUNCTION + "return 0 * q + (float('nan') if t > 0.1 else 0)\n", "not finite (joint 1, t = 0.1"),
    "raises": (FUNCTION + "return q / memory['absent']\n", "'mine.py', line 2: KeyError: 'absent'"),
    "prints": (FUNCTION + "print('tau', q)\n    return q\n", "'mine.py', line 2 writes to stdout: 'tau'"),
    "reset": ("def reset(memory):\n    raise ValueError('no')\n" + FUNCTION + "return q\n", "line 2: ValueError: no"),
    "system": (SYSTEM.format(value="1 / 0"), "'mine.py', line 9: ZeroDivisionError: division by zero"),
    "again": (
        FUNCTION
        + "try:\n        return q / memory['absent']\n    except KeyError:\n        raise ValueError('my own words')\n",
        "'mine.py', line 5: ValueError: my own words",
    ),
    "runtime": (SYSTEM.format(value="self.GetInputPort('no')"), "'mine.py', line 9: RuntimeError"),
    "no system": ("def controller(scenario):\n    return 3\n", "'mine.py': 'controller' = 3 is no Drake System"),
    "no tau": (
        SYSTEM.replace('"tau"', '"torque"').format(value="[0] * 6"),
        "'mine.py': the box for 'controller' has no output port 'tau' but torque; valid is",
    ),
    "port": (
        SYSTEM.replace('("q", 6)', '("q", 7)').format(value="[0] * 6"),
        "'mine.py': the box for 'controller' has input port 'q' has size 7",
    ),
}


@pytest.mark.parametrize("case", BAD_FLIGHTS)
def test_what_an_entry_does_wrong_is_the_outcome_in_one_line(entered, plan, case):
    text, said = BAD_FLIGHTS[case]
    outcome = flown(entered(text), plan)
    assert outcome.mode == "crashed"
    assert said in outcome.failure and "\n" not in outcome.failure


def test_a_function_with_the_torques_of_the_papers_controller_flies_as_it_does(entered, plan):
    """pd+ff written by hand as a plain function against the boxes, in the same world: the same flip."""
    text = """
import numpy as np
def reset(memory):
    arm, s = memory["arm"], memory["scenario"].controller
    from flipdiagram.diagrams.controller import nominal_inertia
    from flipdiagram.planning.planner import Planner
    q = Planner(memory["scenario"], arm).q_start
    memory.update(M=nominal_inertia(memory["scenario"], arm, q), k_p=s.k_p, k_v=s.k_v)
def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    x, v, J, bias = memory["arm"].task_kinematics(q, qd)
    a = a_cmd + memory["k_p"] * (x_cmd - x) + memory["k_v"] * (v_cmd - v)
    return memory["M"] * np.linalg.solve(J, a - bias)
"""
    by_hand, ours = flown(entered(text), plan), flown(entered("ARCHITECTURE = 'pd+ff'\n"), plan)
    assert by_hand.metrics.position_rmse_m == pytest.approx(ours.metrics.position_rmse_m, rel=1e-4)
    assert by_hand.mode == ours.mode


def test_settings_change_the_papers_controller_and_the_plan(entered):
    entry = entered("ARCHITECTURE = 'pd+ff+dob'\nSETTINGS = {'controller.k_p': 600, 'planner.friction_margin': 0.5}\n")
    believed = WORLD.believed("drake", entry.settings)
    planned, _ = plan_entry(believed, entry.path)
    assert believed.controller.k_p == 600
    assert (
        Plan.from_json(planned, "plan").max_sliding_angle < plan_motion(WORLD.believed("drake", {})).max_sliding_angle
    )


def test_a_planner_of_ones_own_is_asked_and_what_it_says_is_told(entered):
    own = "import flipdiagram\ndef plan(scenario):\n    return {}\n"
    assert plan_entry(Scenario(), entered(own.format("3")).path)[1] == (
        "'mine.py': plan returned int; valid is a flipdiagram.Plan"
    )
    raising = own.format("1 / 0")
    assert "'mine.py', line 3: ZeroDivisionError" in plan_entry(Scenario(), entered(raising).path)[1]
    slower = own.format('flipdiagram.plan_motion(scenario.with_overrides({"planner.friction_margin": 0.6}))')
    planned, _ = plan_entry(WORLD.believed("drake", {}), entered(slower).path)
    assert np.tan(Plan.from_json(planned, "plan").max_sliding_angle) < 0.45 * 1.86


SNIPPETS = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.M)


@pytest.mark.parametrize("snippet", SNIPPETS, ids=["function", "system"])
def test_what_the_page_prints_enters_and_turns_the_block_over(entered, plan, snippet):
    assert flown(entered(snippet), plan).mode == SUCCESS


def test_a_memory_sees_each_instant_once(entered, plan, tmp_path):
    """Times that a control function is called with: every millisecond once, however often Drake asks for the torque."""
    file = tmp_path / "times"
    text = (
        f"from pathlib import Path\ntimes = []\n{FUNCTION}times.append(t)\n"
        f"    Path({str(file)!r}).write_text('\\n'.join(map(repr, times)))\n    return 0 * q\n"
    )
    flown(entered(text), plan)
    times = np.array([float(line) for line in file.read_text().splitlines()])
    np.testing.assert_allclose(np.diff(times), 0.001, atol=1e-9)
    assert times[0] == pytest.approx(-0.05)


def test_an_entry_is_told_the_start_and_nothing_else(entered):
    """What is drawn in the uncertain suite is not in the scenario that an entry sees."""
    for world in load_suites().worlds(["uncertain", "disturbed"])[::7]:
        told, usual = world.believed("drake", {}), WORLD.believed("drake", {})
        assert told.task.start_y == world.trial.overrides["task.start_y"]
        assert told.with_overrides({"task.start_y": usual.task.start_y}) == usual


def test_our_own_errors_pass(tmp_path):
    with pytest.raises(PlanningError), watched(tmp_path / "mine.py"):
        raise PlanningError("no motion")
    with pytest.raises(EntryError, match="returned"), watched(tmp_path / "mine.py"):
        raise EntryError("returned nothing")


def test_the_papers_controller_turns_the_block_over_and_tells_its_time(entered, plan):
    outcome = flown(entered("ARCHITECTURE = 'pd+ff+dob'\n"), plan)
    assert outcome.mode == SUCCESS
    assert 0 < outcome.plan["compute_s"]["p50"] <= outcome.plan["compute_s"]["p99"] < 0.1
