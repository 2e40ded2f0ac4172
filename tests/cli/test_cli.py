"""The command line as its users meet it: a process, its exit code, and what it prints."""

import os
import signal
import subprocess
import sys
from importlib.metadata import version

import pytest
from patience import HUNG

from flipdiagram import __version__
from flipdiagram.cli import commands
from flipdiagram.cli import main as cli
from flipdiagram.errors import PlanningError, SimulationError
from flipdiagram.scenario.scenario import Scenario, from_yaml

COMMAND = [sys.executable, "-m", "flipdiagram"]
NOTHING_SLOW = "sys.exit(any(name.split('.')[0] in ('pydrake', 'matplotlib', 'rich') for name in sys.modules))"


def run(*arguments, **settings):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=HUNG, **settings)


def listen_to_ctrl_c():
    """In the child: a run in the background of a shell would have it inherit a Ctrl-C that is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def assert_one_line(done, code, *parts):
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("flipdiagram: error: ") and done.stderr.count("\n") == 1, done.stderr
    for part in parts:
        assert part in done.stderr


@pytest.fixture
def in_process(capsys, monkeypatch, tmp_path):
    """run(arguments) without the cost of a process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run_here(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        return subprocess.CompletedProcess(arguments, code, *capsys.readouterr())

    return run_here


def test_scenario_prints_the_defaults_as_yaml():
    done = run("scenario")
    assert (done.returncode, done.stderr) == (0, "")
    assert from_yaml(done.stdout) == Scenario()
    assert "[kg, 0.0001 to 50]" in done.stdout


def test_version_names_both():
    done = run("--version")
    assert done.returncode == 0
    assert __version__ in done.stdout and f"Drake {version('drake')}" in done.stdout


@pytest.mark.parametrize("command", [[], ["plan"], ["flip"], ["frequency"], ["scenario"]])
def test_help_prints_to_stdout_and_imports_nothing_slow(command):
    script = f"import sys; from flipdiagram.cli.main import main; main({[*command, '--help']!r});"
    done = subprocess.run([sys.executable, "-c", script + NOTHING_SLOW], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "" and "usage: flipdiagram" in done.stdout


def test_errors_come_before_drake_is_imported():
    script = "import sys; from flipdiagram.cli.main import main; main(['plan', '--object.mass=-1']);"
    assert subprocess.run([sys.executable, "-c", script + NOTHING_SLOW], capture_output=True).returncode == 0


@pytest.mark.parametrize(
    ("words", "path", "value"),
    [
        (["--controller.k_p", "400"], "controller.k_p", 400.0),
        (["--controller.k_p=400"], "controller.k_p", 400.0),
        (["--controller.k-p", "4e2"], "controller.k_p", 400.0),
        (["--joint-friction.coulomb=0.2"], "joint_friction.coulomb", 0.2),
        (["--task.start_y", "-0.1"], "task.start_y", -0.1),
        (["--task.start_y", "-1e-1"], "task.start_y", -0.1),
        (["--start-y", "-1e-1"], "task.start_y", -0.1),
        (["--start-y=0.14"], "task.start_y", 0.14),
        (["--planner.contact_samples", "[10, 12]"], "planner.contact_samples", (10, 12)),
        (["--sensors.velocity_cutoff=62.8"], "sensors.velocity_cutoff", 62.8),
        (["--controller.nominal-inertia", "null"], "controller.nominal_inertia", None),
        (["--controller.k_p=1", "--controller.k_p=2"], "controller.k_p", 2.0),
    ],
)
def test_every_field_is_an_option(in_process, words, path, value):
    done = in_process("scenario", *words)
    assert done.returncode == 0, done.stderr
    assert from_yaml(done.stdout) == Scenario().with_overrides({path: value})


def test_options_win_over_the_file_and_the_file_over_the_defaults(in_process, tmp_path):
    (tmp_path / "delta.yaml").write_text("controller: {k_p: 1, k_v: 2}")
    done = in_process("scenario", "--scenario", "delta.yaml", "--controller.k_v", "3")
    expected = {"controller.k_p": 1.0, "controller.k_v": 3.0}
    assert from_yaml(done.stdout) == Scenario().with_overrides(expected)


BAD = {
    "no command": (
        [],
        "plan, flip, frequency, experiment, borders, replanning, engines, pancake, calibrate, inverse, place, campaign, "
        "challenge, report, diagram, arm, info, scenario, completion",
    ),
    "unknown command": (["flap"], "'flap'", "'flip'"),
    "unknown option": (["flip", "--fast"], "--fast"),
    "abbreviated option": (["flip", "--arch", "pd"], "--arch"),
    "section as an option": (["flip", "--task", "3"], "--task"),
    "stray word": (["flip", "now"], "now"),
    "unknown architecture": (["flip", "--architecture", "pid"], "'pid'", "pd, pd+ff, pd+dob, pd+ff+dob"),
    "no architecture": (["flip", "--architecture"], "--architecture"),
    "no jobs": (["flip", "--jobs", "0"], "'0'", "a whole number from 1 to 1000"),
    "unknown field": (["flip", "--controller.kp", "1"], "did you mean 'controller.k_p'?"),
    "unknown section": (["plan", "--controler.k_p", "1"], "did you mean 'controller.k_p'?"),
    "field without a value": (["plan", "--controller.k_p"], "--controller.k_p VALUE"),
    "field followed by an option": (["plan", "--controller.k_p", "--quiet"], "--controller.k_p VALUE"),
    "field with half a list": (["plan", "--task.workspace_y", "[1"], "'task.workspace_y' = '[1'", "YAML"),
    "negative mass": (["plan", "--object.mass", "-1"], "'object.mass' = -1", "from 0.0001 to 50 [kg]"),
    "start outside": (["flip", "--start-y", "9"], "'task.start_y' = 9.0", "-0.35 to 0.35 [m]"),
    "file missing": (["flip", "--scenario", "none.yaml"], "'none.yaml'", "No such file"),
    "file no mapping": (["flip", "--scenario", "list.yaml"], "'list.yaml'", "[1, 2]", "no mapping"),
    "file with an unknown key": (["flip", "--scenario", "key.yaml"], "'object.mas'", "'object.mass'"),
    "out is a file": (["flip", "--out", "list.yaml"], "--out = 'list.yaml'", "writable folder"),
    "out is below a file": (["plan", "--out", "list.yaml/x"], "--out = 'list.yaml/x'", "writable folder"),
    "out cannot be written": (["plan", "--out", "/proc/x"], "--out = '/proc/x'", "writable folder"),
}


@pytest.mark.parametrize(("words", "parts"), [(row[0], row[1:]) for row in BAD.values()], ids=BAD)
def test_bad_input_ends_with_2_and_one_line_and_leaves_nothing(in_process, tmp_path, words, parts):
    (tmp_path / "list.yaml").write_text("[1, 2]")
    (tmp_path / "key.yaml").write_text("object: {mas: 1}")
    before = sorted(tmp_path.iterdir())
    assert_one_line(in_process(*words), 2, *parts)
    assert sorted(tmp_path.iterdir()) == before


def test_a_bad_scenario_in_a_process_of_its_own():
    assert_one_line(run("plan", "--object.mass=.nan"), 2, "'object.mass' = nan", "from 0.0001 to 50 [kg]")


@pytest.mark.parametrize("error", [PlanningError, SimulationError])
def test_what_the_physics_refuses_ends_with_3(in_process, monkeypatch, error):
    def refuse(*_):
        raise error("the arm\ncannot reach")

    monkeypatch.setattr(commands, "scenario", refuse)
    assert_one_line(in_process("scenario"), 3, "the arm cannot reach")


def test_a_bug_is_not_dressed_up_as_bad_input(in_process, monkeypatch):
    monkeypatch.setattr(commands, "scenario", lambda *_: [][0])
    with pytest.raises(IndexError):
        in_process("scenario")


def test_ctrl_c_ends_with_130_and_one_line(tmp_path):
    script = "import sys, time; from flipdiagram.cli import commands, main; commands.scenario = lambda *_: (print('in'), time.sleep(60))"
    script += "; sys.exit(main.main(['scenario']))"
    with subprocess.Popen(
        [sys.executable, "-u", "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=listen_to_ctrl_c,
    ) as process:
        assert process.stdout.readline() == "in\n"
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=HUNG)
    assert (process.returncode, stderr) == (130, "flipdiagram: interrupted\n")


def test_a_reader_that_leaves_early_is_no_error():
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run([*COMMAND, "scenario"], stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_full_disk_behind_stdout_is_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, "scenario"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (2, "flipdiagram: error: No space left on device\n")


def test_closed_streams_are_no_error():
    done = subprocess.run(["sh", "-c", 'exec "$@" >&- 2>&-', "sh", *COMMAND, "scenario"])
    assert done.returncode == 0


def test_a_terminal_without_greek_gets_something():
    done = run("scenario", env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0 and done.stdout.isascii()
