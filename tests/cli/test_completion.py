"""What the shells offer after the script: bash is asked as its line editor asks, fish by its own `complete -C`."""

import argparse
import shutil
import subprocess

import pytest
from patience import HUNG

from flipdiagram.cli.completion import SHELLS, script
from flipdiagram.cli.options import COMMANDS, SHORT, parser
from flipdiagram.errors import InputError
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, field_paths
from flipdiagram.studies.borders.maps import maps_of
from flipdiagram.studies.borders.run import VARIATIONS


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    return {shell: _write(folder / f"flipdiagram.{shell}", script(shell)) for shell in SHELLS}


def _write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def ask(*command, folder):
    done = subprocess.run(command, capture_output=True, text=True, timeout=HUNG, cwd=folder)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


@pytest.fixture
def bash(scripts, tmp_path):
    """bash(*words): what `flipdiagram words…<TAB>` offers; the last word is the one being typed."""
    assert shutil.which("bash"), "make itself needs a shell; these tests need bash"

    def offers(*words):
        text = 'source "$1"; shift; COMP_WORDS=(flipdiagram "$@"); COMP_CWORD=$#; _shtab_flipdiagram; printf "%s\\n" "${COMPREPLY[@]}"'
        return set(ask("bash", "--norc", "-c", text, "bash", scripts["bash"], *words, folder=tmp_path).split())

    return offers


@pytest.mark.parametrize("load", ['source <(cat "$1")', 'eval "$(cat "$1")"'])
def test_bash_knows_the_function_that_completes(scripts, tmp_path, load):
    text = f"{load}; complete -p flipdiagram"
    assert "-F _shtab_flipdiagram flipdiagram" in ask(
        "bash", "--norc", "-c", text, "bash", scripts["bash"], folder=tmp_path
    )


def test_commands(bash):
    assert bash("fl") == {"flip"}
    assert bash("") == set(COMMANDS)
    assert bash("--v") == {"--version"}


def test_options_of_a_command(bash):
    assert bash("flip", "--no") == {"--no-replay"}
    assert bash("plan", "--no") == set()
    assert bash("frequency", "--start-") == set(SHORT)
    assert bash("completion", "") == set(SHELLS)


@pytest.mark.parametrize("before", [["--architecture"], ["--quick", "--architecture"], ["--architecture", "pd"]])
def test_architectures(bash, before):
    assert bash("flip", *before, "") == set(ARCHITECTURES)
    assert bash("flip", *before, "pd+d") == {"pd+dob"}


def test_maps_are_those_of_the_study(bash):
    assert bash("borders", "--maps", "") == {*maps_of(Scenario()), VARIATIONS}


def test_every_field_is_offered_to_every_command_that_takes_a_scenario(bash):
    takers = {
        name for name, command in commands().items() if any(action.dest == "scenario" for action in command._actions)
    }
    assert {"plan", "flip", "scenario"} <= takers
    for name in takers:
        assert {word.removeprefix("--") for word in bash(name, "--") if "." in word} == set(field_paths()), name
    assert bash("flip", "--quick", "--controller.k_") == {"--controller.k_p", "--controller.k_v"}
    assert bash("flip", "--controller.k_p", "400", "--one_dof.ma") == {"--one_dof.mass"}


def commands():
    (subparsers,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    return subparsers.choices


def test_values_of_fields_that_have_names(bash):
    assert bash("plan", "--planner.solver", "cl") == {"clarabel"}
    assert bash("frequency", "--one_dof.reference_scaled_by_nominal_mass", "") == {"true", "false"}


def test_files_and_folders(bash, tmp_path):
    (tmp_path / "mine.yaml").touch()
    (tmp_path / "minutes").mkdir()
    assert bash("flip", "--scenario", "mi") == {"mine.yaml", "minutes"}
    assert bash("flip", "--out", "mi") == {"minutes"}
    assert bash("info", "mi") == {"mine.yaml", "minutes"}


def test_making_a_script_leaves_the_parser_of_the_command_line_alone(bash):
    options = [action for command in commands().values() for action in command._actions if action.option_strings]
    assert all(action.dest not in field_paths() for action in options)
    assert script("bash") == script("bash")


def test_an_unknown_shell_names_the_known_ones():
    with pytest.raises(InputError, match="unknown shell 'tcsh'; choose from bash, zsh, fish"):
        script("tcsh")


@pytest.mark.needs("zsh")
def test_zsh_reads_its_script_and_registers_it(scripts, tmp_path):
    text = f'autoload -Uz compinit; compinit -D -u; eval "$(<{scripts["zsh"]})"; print -- $_comps[flipdiagram]'
    assert ask("zsh", "-f", "-c", text, folder=tmp_path).strip() == "_shtab_flipdiagram"


@pytest.mark.needs("fish")
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("fl", {"flip"}),
        ("flip --architecture pd+d", {"pd+dob"}),
        ("plan --controller.k_", {"--controller.k_p", "--controller.k_v"}),
    ],
)
def test_fish_offers_the_same(scripts, tmp_path, line, offered):
    text = f'source "{scripts["fish"]}"; complete -C "flipdiagram {line}"'
    answer = ask("fish", "--no-config", "-c", text, folder=tmp_path)
    assert {row.split("\t")[0] for row in answer.splitlines()} == offered
