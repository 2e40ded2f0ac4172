"""`flipdiagram arm check`: what an arm of the user's own can do, what its file leaves out, and a start that works."""

import shutil
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.errors import PlanningError
from flipdiagram.files import versions
from flipdiagram.grid import Grid
from flipdiagram.planning.arm_motion import task_pose
from flipdiagram.planning.planner import Planner
from flipdiagram.robot import survey
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.model_files import table_size
from flipdiagram.robot.parts import arm_of, base_in_plane
from flipdiagram.scenario.scenario import Scenario

SCHEMA = "flipdiagram/arm/1"
INERTIA = "arm.reflected_inertia"
WIDEST = 80


def check(scenario: Scenario) -> tuple[dict[str, Any], PlanningError | None]:
    """What was found of the scenario's arm, as JSON takes it, and why it cannot flip, where it cannot.

    The motion is planned with the suggested inertias where the file has none.  InputError for a file that will not do.
    """
    arm = arm_of(scenario)
    joints = survey.joints_of(arm, scenario.joint_friction, scenario.simulation.step)
    inertias = [joint.suggested_inertia or joint.reflected_inertia for joint in joints]
    lacking = any(joint.suggested_inertia for joint in joints) and scenario.arm.file is not None
    if lacking:
        scenario = scenario.with_overrides({INERTIA: inertias})
        arm = arm_of(scenario)
    found: dict[str, Any] = {
        "schema": SCHEMA,
        "versions": versions(),
        "file": scenario.arm.file,
        "base": scenario.arm.base,
        "flange": scenario.arm.flange,
        "joints": [asdict(joint) for joint in joints],
        "suggested": {INERTIA: inertias} if lacking else {},
        "reach_m": survey.reach_of(arm, np.array(base_in_plane(scenario)[:3])),
        "collision_shapes_left_out": survey.colliding_links(scenario.arm),
        "collision_note": survey.left_out(scenario.arm),
        "warnings": survey.warnings_of(scenario.arm),
    }
    planner = Planner(scenario, arm)
    try:
        found["start"] = {name: float(q) for name, q in zip(arm.joint_names, planner.q_start, strict=True)}
        plan = planner.plan()
    except PlanningError as error:
        return found | {"problem": str(error)}, error
    found["plan"] = {"cost_J": plan.cost, "limit_use": plan.limit_use}
    path = arm.inverse_kinematics_path(task_pose(plan.states, scenario.task.start_x), planner.q_start)
    found["lowest_joint_over_table_m"] = _height(scenario, arm, path)
    return found, None


def _height(scenario: Scenario, arm: ArmModel, path: Any) -> float | None:
    """The least height of a joint over the table's surface [m]; None where none comes over the table."""
    middle = np.array([scenario.task.start_x, scenario.task.target_y])
    lowest = survey.lowest_over(arm, path, middle, table_size()[:2])
    return None if lowest is None else lowest - scenario.table.height


def report(found: dict[str, Any]) -> list[Grid | str]:
    """The same for a terminal of 80 columns: a table of the joints, and a paragraph for each of the rest."""
    name = "MH3F" if found["file"] is None else Path(found["file"]).name
    sentences = [
        f"{name}: {len(found['joints'])} joints from {found['base']} to {found['flange']}. The object on the blade gets"
        f" {found['reach_m']:.2f} m away from the arm's base.",
        _inertias(found),
        _massless(found["joints"]),
        found["collision_note"] and found["collision_note"] + _over_the_table(found),
        _warnings(found["warnings"]),
        _start(found),
    ]
    return [_joints(found["joints"]), *(_folded(sentence) for sentence in sentences if sentence)]


def _joints(joints: list[dict[str, Any]]) -> Grid:
    headings = ("joint", "range\n[rad]", "speed\n[rad/s]", "peak\n[N m]", "rotor\n[kg m2]")
    keys = ("speed", "peak_torque", "reflected_inertia")
    rows = [
        [joint["name"], f"{joint['lower']:.3g} to {joint['upper']:.3g}", *(f"{joint[key]:.3g}" for key in keys)]
        for joint in joints
    ]
    return Grid(headings, rows, right=headings[1:])


def _inertias(found: dict[str, Any]) -> str | None:
    if not found["suggested"]:
        return None
    lacking = [joint["name"] for joint in found["joints"] if joint["suggested_inertia"]]
    values = ", ".join(f"{value:.3g}" for value in found["suggested"][INERTIA])
    return (
        f"Neither file nor scenario has the inertia of rotor and gear of {', '.join(lacking)}. Without it a joint has"
        " the inertia of its links alone, and its friction, which acts explicitly, may make it chatter. Suggested until"
        f" you know better: --{INERTIA} '[{values}]', in kg m2 at the joint. That is {survey.INERTIA_PER_TORQUE:g}"
        " kg m2 per N m of the peak torque, as the UR5 and the Panda of examples/own_arm.py have (0.007 to 0.017), or"
        " what the friction needs, if that is more."
    )


def _massless(joints: list[dict[str, Any]]) -> str | None:
    names = [joint["name"] for joint in joints if not joint["carries"]]
    return (
        f"The links that {', '.join(names)} move have no mass in the file; the torques lack theirs." if names else None
    )


def _over_the_table(found: dict[str, Any]) -> str:
    if "plan" not in found:
        return ""
    height = found["lowest_joint_over_table_m"]
    if height is None:
        return " In the planned flip no joint comes over the table."
    side = f"{height:.2f} m above" if height >= 0 else f"{-height:.2f} m below"
    return f" In the planned flip the lowest joint over the table is {side} its surface."


def _warnings(warnings: dict[str, int]) -> str | None:
    if not warnings:
        return None
    texts = " ".join(f"{count} x {text.rstrip('.')}." for text, count in warnings.items())
    return f"Drake ignores or changes parts of the file, which does no harm to the flip: {texts}"


def _start(found: dict[str, Any]) -> str:
    start = found.get("start")
    if start is None:
        return "No start pose: see the error."
    angles = ", ".join(f"{round(q, 3) + 0.0:.3f}" for q in start.values())
    text = f"Start: joint angles that work are arm.home = [{angles}] rad."
    if "plan" not in found:
        return f"{text} From there no flip was found: see the error."
    use = ", ".join(f"{value:.0%} of the {name}" for name, value in found["plan"]["limit_use"].items())
    return f"{text} The flip planned from there uses up to {use}."


def _folded(text: str) -> str:
    width = min(WIDEST, shutil.get_terminal_size().columns)
    return "\n" + textwrap.fill(text, width, break_long_words=False, break_on_hyphens=False)
