"""The smaller commands as their users meet them: diagram, info, completion, replanning."""

import json

import pytest

from flipdiagram.cli import main as cli


@pytest.fixture
def run(capsysbinary, monkeypatch, tmp_path):
    """run(arguments) in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run_here(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsysbinary.readouterr()
        return code, out, err.decode()

    return run_here


def test_the_diagram_goes_to_stdout_as_mermaid_or_dot(run):
    code, out, _ = run("diagram", "--architecture", "pd")
    assert code == 0 and out.startswith(b"flowchart LR") and b"disturbance" not in out
    code, out, _ = run("diagram", "--format", "dot")
    assert code == 0 and out.startswith(b"digraph") and b"disturbance" in out


@pytest.mark.needs("dot")
def test_the_diagram_goes_to_a_file_in_the_format_of_its_name(run, tmp_path):
    for name, begins in (("a.svg", b"<?xml"), ("b.png", b"\x89PNG"), ("c.dot", b"digraph"), ("d.mmd", b"flowchart")):
        code, out, _ = run("diagram", "--one-dof", "--out", name)
        assert (code, out) == (0, b"")
        assert (tmp_path / name).read_bytes().startswith(begins)
    code, out, _ = run("diagram", "--format", "png")
    assert code == 0 and out.startswith(b"\x89PNG")


def test_the_table_names_rates_ports_and_feed_through(run):
    code, out, _ = run("diagram", "--table")
    text = out.decode()
    assert code == 0 and "| disturbance_observer | DisturbanceObserver | every 0.001 s |" in text
    assert "flowchart" not in text


def test_the_poles_fit_a_terminal_and_go_into_a_picture(run, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    unstable = ["--architecture", "pd", "--sensors.delay", "20", "--controller.k_p", "5000"]
    for options, verdict in ((["--one-dof"], "Stable: "), (unstable, "Unstable: ")):
        code, out, _ = run("diagram", "--poles", "--out", "poles.svg", *options)
        assert code == 0 and max(map(len, out.decode().splitlines())) <= 80
        assert "damping" in out.decode() and verdict in out.decode()
    assert (tmp_path / "poles.svg").read_bytes().startswith(b"<?xml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["diagram", "--poles", "--out", "a.dot"], "'a.dot' is no picture"),
        (["diagram", "--poles", "--joints.model", "elastic"], "'joints.model' = 'elastic' has no joint model"),
        (["diagram", "--out", "a.pdf"], "'a.pdf' ends in no known format"),
        (["diagram", "--depth", "-1"], "depth"),
        (["diagram", "--architecture", "pid"], "unknown architecture 'pid'"),
        (["info", "nowhere.nc"], "nowhere.nc"),
        (["info", "x", "--controller.k_p", "3"], "takes no fields of a scenario"),
        (["completion", "tcsh"], "unknown shell 'tcsh'; choose from bash, zsh, fish"),
        (["borders", "--maps", "moon"], "unknown map 'moon'; choose from disturbance"),
        (["experiment", "--starts", "0.9"], "task.start_y"),
        (["place", "--place.speed", "0"], "place.speed"),
        (["flip", "--planner.replan_period", "0"], "planner.replan_period"),
    ],
    ids=str,
)
def test_bad_input_ends_with_2_and_one_line(run, tmp_path, arguments, words):
    code, out, err = run(*arguments)
    assert (code, out) == (2, b"")
    assert words in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


def test_a_place_out_of_reach_ends_with_3(run):
    code, _, err = run("place", "--quiet", "--place.target_y", "0.9", "--task.workspace_y", "[-0.35, 1.5]")
    assert code == 3 and "cannot be laid down" in err and err.count("\n") == 1


def test_info_tells_what_a_summary_holds(run, tmp_path):
    assert run("plan", "--out", "plan", "--quiet")[0] == 0
    code, out, _ = run("info", "plan/summary.json")
    assert code == 0 and b"plan" in out


def test_replanning_flies_every_case_in_every_way(run, tmp_path):
    short = ["--simulation.hold_time", "0.1", "--simulation.settle_time", "0.1", "--planner.solver", "daqp"]
    code, out, err = run("replanning", "--quick", "--out", "r", *short)
    assert code == 0, err
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert summary["schema"] == "flipdiagram/replanning/1" and summary["quick"]
    found = {(run["case"], run["way"], run["architecture"]) for run in summary["runs"]}
    assert len(found) == len(summary["runs"]) == 2 * 5 * 4
    assert "planned once" in out.decode()
