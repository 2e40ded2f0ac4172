"""What an arm of the user's own can do, and what its file leaves out, found before anything flies."""

import logging
import math
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from flipdiagram.arrays import Floats
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import FORMATS
from flipdiagram.robot.assembly import drake_reads
from flipdiagram.robot.gears import rotor_inertia
from flipdiagram.robot.model_xml import read_model
from flipdiagram.robot.serial_chain import serial_chain
from flipdiagram.scenario.cell import Arm, JointFriction

INERTIA_PER_TORQUE = 0.01
"""Reflected inertia [kg m²] suggested per N m of peak torque: what the UR5 and the Panda of examples/own_arm.py have
lies between 0.0067 and 0.017.
"""
STARTS = 5
"""Of the search for the longest reach."""


@dataclass(frozen=True)
class Joint:
    """One joint, in the order from base to flange."""

    name: str
    lower: float  # [rad], as upper
    upper: float
    speed: float  # [rad/s]
    peak_torque: float  # [N m], as the rated one
    rated_torque: float
    reflected_inertia: float  # [kg m²] of rotor and gear, as the file or the scenario has it
    suggested_inertia: float | None  # [kg m²] where it has none
    carries: bool  # whether what it moves, as far as the next joint, has a mass


def joints_of(arm: ArmModel, friction: JointFriction, step: float) -> list[Joint]:
    """The joints of an arm.  The friction and the step [s] of the simulation bound the suggested inertias from below:
    a joint with less would chatter.
    """
    rotors, chain = rotor_inertia(arm), serial_chain(arm)
    carries = np.ones(arm.n_joints) if chain is None else chain.mass
    least = friction.coulomb * arm.tau_rated * step / friction.transition_velocity
    wanted = np.maximum(INERTIA_PER_TORQUE * arm.tau_max, least)
    columns = arm.q_min, arm.q_max, arm.qd_max, arm.tau_max, arm.tau_rated, rotors, wanted, carries
    rows = np.array(columns, dtype=float).T.tolist()
    return [
        Joint(name, low, high, speed, peak, rated, rotor, None if rotor else _two_digits(need), bool(mass > 0))
        for name, (low, high, speed, peak, rated, rotor, need, mass) in zip(arm.joint_names, rows, strict=True)
    ]


def reach_of(arm: ArmModel, base: Floats) -> float:
    """The farthest [m] that the control point gets from the origin of the arm's base (3,) [m], within the joint limits.

    To a millimetre or so: the search may end beside the very farthest pose.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    def minus_distance(q: Floats) -> float:
        y, z, _, x, _, _ = arm.task_position(q)
        return -float(np.linalg.norm(np.array([x, y, z]) - base))

    seeds = qmc.Halton(arm.n_joints, scramble=False).random(200)[1:]
    nearest_first = sorted(arm.q_min + seeds * (arm.q_max - arm.q_min), key=minus_distance)
    bounds = list(zip(arm.q_min, arm.q_max, strict=True))
    return -min(float(minimize(minus_distance, q, bounds=bounds).fun) for q in nearest_first[:STARTS])


def lowest_over(arm: ArmModel, path: Floats, middle: Floats, size: Floats) -> float | None:
    """The least height [m] of a joint that moves while it is over a table, along joint angles (K, n).

    The table: its middle (2,) and edges (2,) in x and y [m].  None where no joint comes over it.
    """
    context, heights = arm.plant.CreateDefaultContext(), []
    frames = [arm.plant.GetJointByName(name, arm.handles.arm).frame_on_parent() for name in arm.joint_names]
    for q in path:
        arm.plant.SetPositions(context, q)
        places = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
        over = np.all(np.abs(places[:, :2] - middle) <= size / 2, axis=1)
        heights += places[over, 2].tolist()
    return min(heights, default=None)


def colliding_links(arm: Arm) -> list[str]:
    """The links or bodies of an arm's file that have collision shapes, which the simulation leaves out."""
    if arm.file is None:
        return []
    root = read_model("arm.file", arm.file, tuple(FORMATS.values())).root
    carriers = [*root.iter("link"), *root.iter("body")]
    return [carrier.get("name", "") for carrier in carriers if any(carrier.find(k) is not None for k in _SHAPES)]


_SHAPES = ("collision", "geom")


def left_out(arm: Arm) -> str | None:
    """The sentence that says so; None for the MH3F, and for an arm without any."""
    links = colliding_links(arm)
    if not links:
        return None if arm.file is None else "The arm's file has no collision shapes: the arm passes through the table."
    return (
        f"The collision shapes of {len(links)} links of the arm are left out: only blade, block and table touch, and"
        " the arm itself passes through the table."
    )


def warnings_of(arm: Arm) -> dict[str, int]:
    """What Drake says against an own arm's file as it is, without the lines, and how often it says so."""
    if arm.file is None:
        return {}
    plant = MultibodyPlant(0.0)  # the parser does not keep it
    with drake_reads(f"arm.file = '{arm.file}'"), _heard() as said:
        Parser(plant).AddModels(arm.file)
    return dict(Counter(_without_place(text) for text in said))


@contextmanager
def _heard() -> Iterator[list[str]]:
    """The warnings of Drake's log, which nobody else hears."""

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    said: list[str] = []
    log, listener = logging.getLogger("drake"), Listener(logging.WARNING)
    level, propagate = log.level, log.propagate
    log.addHandler(listener)
    log.setLevel(logging.WARNING)
    log.propagate = False
    try:
        yield said
    finally:
        log.removeHandler(listener)
        log.setLevel(level)
        log.propagate = propagate


def _without_place(text: str) -> str:
    """'file.urdf:12: warning: Text' as 'Text'."""
    return " ".join(text.partition("warning: ")[2].split() or text.split())


def _two_digits(value: float) -> float:
    """A positive number rounded up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit - 1e-9) * unit:.2g}")
