"""`flipdiagram arm check`: what it finds, how it is shown, and that what it suggests works."""

import json
import re

import numpy as np
import pytest
from elbow import HOME, urdf

from flipdiagram.cli import arm as arm_command
from flipdiagram.cli import main as cli
from flipdiagram.planning import Planner
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.yaml_reader import parse_value

PLACED = {"arm.flange": "tcp", "arm.mount_angle": np.pi}

FEW = {"planner.contact_samples": (20, 20), "planner.flight_samples": (10, 10)}
"""Horizons that are searched: one, as a plan is not what is tested."""


@pytest.fixture(scope="module")
def elbow(tmp_path_factory):
    """The elbow arm's file; its drives have no inertia."""
    file = tmp_path_factory.mktemp("arm") / "elbow.urdf"
    file.write_text(urdf(), encoding="utf-8")
    return str(file)


@pytest.fixture(scope="module")
def found(elbow):
    """What was found of it where it can flip."""
    fields = PLACED | FEW | {"arm.file": elbow, "arm.home": HOME}
    found, problem = arm_command.check(Scenario().with_overrides(fields))
    assert problem is None
    return found


def test_it_finds_limits_reach_and_what_is_lacking(found):
    assert [joint["name"] for joint in found["joints"]] == ["j1", "j2", "j3", "j4", "j5", "j6"]
    assert found["joints"][0]["peak_torque"] == 90.0 and found["joints"][0]["upper"] == 2.9
    # never longer than all its parts in a row: foot, upper arm, forearm, wrist and tip, spatula with half the block
    in_a_row = 0.3 + 0.26 + np.hypot(0.2, 0.03) + 0.07 + 0.05 + np.hypot(0.14, 0.005)
    assert 0.99 * in_a_row < found["reach_m"] < in_a_row
    assert found["suggested"]["arm.reflected_inertia"] == [0.9] * 6, "0.01 kg m2 per N m"
    assert all(joint["carries"] for joint in found["joints"])
    assert found["collision_shapes_left_out"] == ["l1", "l2", "l3", "l4", "l5", "l6"]


def test_the_start_that_it_names_works(found, elbow):
    fields = PLACED | {"arm.file": elbow, "arm.home": list(found["start"].values()), **found["suggested"]}
    planner = Planner(Scenario().with_overrides(fields))
    np.testing.assert_allclose(planner.q_start, list(found["start"].values()), atol=1e-9)
    assert max(found["plan"]["limit_use"].values()) <= 1


def test_the_report_fits_80_columns_and_names_each_finding(found, capsys):
    for part in arm_command.report(found):
        print(part if isinstance(part, str) else part.markdown())
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    for words in ("6 joints", "reflected_inertia '[0.9, 0.9", "collision shapes of 6 links", "arm.home = ["):
        assert words in " ".join(out.split()), words


def test_an_arm_out_of_reach_is_told_what_to_move_and_that_works(elbow, capsys):
    far = PLACED | {"arm.file": elbow, "arm.base_pose": (-0.6, 0.0, 0.0, 0.0)}
    options = [f"--{path}={json.dumps(value)}" for path, value in far.items() if path != "arm.file"]
    assert cli.main(["arm", "check", elbow, "--json", *options]) == 3
    out, err = capsys.readouterr()
    assert json.loads(out)["problem"] in err and err.count("\n") == 1
    pose = re.search(r"arm.base_pose = (\[.*?\]) \(0\.\d\d m in x\)", err)
    assert pose is not None, err
    moved = Scenario().with_overrides(far | {"arm.base_pose": parse_value(pose[1], "arm.base_pose")})
    assert Planner(moved).q_start.shape == (6,)


def test_what_the_start_must_be_is_said_of_our_arm_too():
    far = Scenario().with_overrides({"task.start_y": 0.8, "task.workspace_y": [-0.35, 1.0]})
    with pytest.raises(Exception, match=r"it can with task.start_y = (0\.\d+) \(0\.\d\d m less\)") as told:
        Planner(far).q_start  # noqa: B018 - raises
    start = float(re.search(r"task.start_y = ([\d.]+)", str(told.value))[1])
    assert Planner(far.with_overrides({"task.start_y": start})).q_start.shape == (6,)


def test_warnings_of_drake_are_counted_once_each(tmp_path):
    from flipdiagram.robot.survey import warnings_of
    from flipdiagram.scenario.cell import Arm

    extra = '<safety_controller k_velocity="1"/></joint>'
    (tmp_path / "arm.urdf").write_text(urdf().replace("</joint>", extra), encoding="utf-8")
    (warning,) = (said := warnings_of(Arm(file=str(tmp_path / "arm.urdf"), flange="tcp"))).items()
    assert "safety_controller" in warning[0] and "arm.urdf" not in warning[0] and warning[1] == 9, said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["arm", "chek", "a.urdf"], "chek"),
        (["arm", "check", "nowhere.urdf"], "arm.file = 'nowhere.urdf'"),
        (["arm", "check", "nowhere.urdf", "--arm.mount_angle", "9"], "arm.mount_angle"),
    ],
    ids=str,
)
def test_bad_input_ends_with_2_and_one_line(arguments, words, capsys):
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and words in err and err.count("\n") == 1, err
