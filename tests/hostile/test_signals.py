"""Signals and environments: a process of its own each, as no other way shows what a shell would see."""

import os
import signal
import subprocess
import sys

import pytest
from patience import HUNG

from flipdiagram.files import _here, remove_left

COMMAND = [sys.executable, "-m", "flipdiagram"]
IN_AN_IMPORT = """
import os, sys, time
class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r} and not done:
            done.append(1)
            os.kill(os.getpid(), {number})
done = []
sys.meta_path.insert(0, Slow())
from flipdiagram.__main__ import main
sys.exit(main())
"""
SWALLOWED = """
import os, sys, time
from flipdiagram.cli import commands
class Trap:
    def __del__(self):
        os.kill(os.getpid(), {number})
        for _ in range(1000): pass
def held(arguments, scenario):
    Trap()
    while True: time.sleep(1)
commands.scenario = held
from flipdiagram.__main__ import main
sys.exit(main())
"""
AT_THE_END = """
import os, signal, sys
from flipdiagram.__main__ import main
code = main()
os.kill(os.getpid(), {number})
sys.exit(code)
"""


def run(program, *words, number=signal.SIGINT, **settings):
    """A program with a signal in it, which reaches it as in a shell in the foreground."""
    return subprocess.run(
        [sys.executable, "-c", program.format(number=int(number), **settings), *words],
        capture_output=True,
        text=True,
        timeout=HUNG,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=str)
@pytest.mark.parametrize("module", ["flipdiagram.studies.registry", "pydrake", "pydrake.common.cpp_param"])
def test_a_signal_during_an_import_is_one_line(tmp_path, module, number, code):
    done = run(IN_AN_IMPORT, "plan", "--out", str(tmp_path), number=number, module=module)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", "flipdiagram: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_an_interruption_that_a_finaliser_swallows_comes_again():
    done = run(SWALLOWED, "scenario", number=signal.SIGTERM)
    assert (done.returncode, done.stderr) == (143, "flipdiagram: interrupted\n")


def test_a_signal_after_the_end_changes_nothing():
    done = run(AT_THE_END, "scenario")
    assert (done.returncode, done.stderr) == (0, "")


def dead():
    """The number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_what_a_killed_process_left_goes_and_what_a_living_one_writes_stays(tmp_path):
    here, gone = _here(), dead()
    left = [f".pd+ff+dob-{here}-{gone}-00ff00ff.nc", f".a-b-{here}-{gone}-00ff00ff"]
    kept = [
        f".pd-{here}-{os.getpid()}-00ff00ff.nc",
        f".pd-{'0' * 8}-{gone}-00ff00ff.nc",  # of another machine
        f".pd-{here}-{'9' * 10}-00ff00ff.nc",
        f"pd-{here}-{gone}-00ff00ff.nc",
        f".pd-{gone}.nc",
        ".gitignore",
    ]
    for name in left + kept:
        (tmp_path / name).touch()
    remove_left(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(kept)


KILLED = """
import os, signal, sys
from flipdiagram.files import atomic_path
with atomic_path("out/fig.svg") as path:
    path.write_text("half")
    os.kill(os.getpid(), {number})
"""


def test_the_next_run_into_a_folder_removes_what_sigkill_left(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert run(KILLED, number=signal.SIGKILL).returncode == -signal.SIGKILL
    (hidden,) = (tmp_path / "out").iterdir()
    assert hidden.name.startswith(".fig-")
    from flipdiagram.cli.main import main

    assert main(["plan", "--quiet", "--out", "out"]) == 0
    assert not hidden.exists() and (tmp_path / "out" / "summary.json").exists()


ENVIRONMENTS = {
    "file names in ASCII": (
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        ["plan"],
        2,
        "PYTHONUTF8=1 or LC_ALL=C.UTF-8",
    ),
    "a backend that is none": ({"MPLBACKEND": "nonsense"}, ["plan", "--quiet"], 0, ""),
}


@pytest.mark.parametrize(("changes", "words", "code", "says"), ENVIRONMENTS.values(), ids=ENVIRONMENTS)
def test_an_environment_ends_cleanly(tmp_path, changes, words, code, says):
    done = subprocess.run(
        [*COMMAND, *words], env=os.environ | changes, cwd=tmp_path, capture_output=True, text=True, timeout=HUNG
    )
    assert done.returncode == code, done.stderr
    assert says in done.stderr and done.stderr.count("\n") == (1 if code else 0)


@pytest.mark.parametrize(
    ("redirection", "words", "code"),
    [
        ("2>/dev/full", ["plan", "--object.mass=-1"], 2),
        (">/dev/full 2>&1", ["scenario"], 2),
        ("2>&- >&-", ["plan", "--object.mass=-1"], 2),
    ],
)
def test_streams_that_take_nothing_change_no_code(redirection, words, code):
    done = subprocess.run(
        ["sh", "-c", f'exec "$@" {redirection}', "sh", *COMMAND, *words], capture_output=True, text=True, timeout=HUNG
    )
    assert (done.returncode, done.stderr) == (code, "")


def test_a_reader_of_a_table_that_leaves_early_is_no_error(tmp_path, monkeypatch):
    from flipdiagram.cli import main as cli
    from flipdiagram.grid import Grid

    read, write = os.pipe()
    os.close(read)
    with open(write, "w", encoding="utf-8") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        monkeypatch.setattr(
            cli.commands, "scenario", lambda options, _: cli.commands.show(options, [Grid(["a"], [["b"]])])
        )
        assert cli.main(["scenario"]) == 0
