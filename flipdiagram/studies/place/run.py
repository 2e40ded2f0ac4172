"""Laying the object down by letting it slide off a tilted spatula: plan, simulate, judge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import atomic_path, write_summary
from flipdiagram.flips.workers import Workers
from flipdiagram.planning.placing import Placer, PlacingPlan
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.metrics import rmse, touchdown
from flipdiagram.simulation.recording import Recording, in_tool, roll
from flipdiagram.simulation.simulate import simulate
from flipdiagram.studies.study import Progress
from flipdiagram.theory import contact
from flipdiagram.theory.contact import ContactState

NEAR, GENTLE, FLAT = 0.02, 0.3, 0.1
"""Success: within this of the target [m], slower than this at touch-down [m/s], flat within this [rad]."""
STILL = 1e-3
"""Speed along the blade [m/s] above which the object counts as sliding."""


@dataclass(frozen=True)
class Placement:
    """What became of the object: where it lies, how fast it came down, how it slid."""

    architecture: str
    success: bool
    failure: str | None
    final_y_m: float
    distance_m: float
    tilt_rad: float
    touchdown_time_s: float | None
    touchdown_speed_m_s: float | None
    slid_m: float
    planned_slide_m: float
    position_rmse_m: float
    recording: str


def run(
    scenario: Scenario,
    out: str | Path,
    architectures: Sequence[str] = ARCHITECTURES,
    *,
    jobs: int | None = None,
    progress: Progress = lambda text: None,
) -> None:
    """Plan once, simulate each architecture, write recordings and summary.json.

    Raises InputError, PlanningError where the object cannot be laid down, SimulationError.
    """
    for name in architectures:
        check_architecture(name)
    build_loop(scenario, architectures[0])  # what is wrong with the scenario shows before anything is computed
    folder = Path(out)
    progress("planning")
    plan = Placer(scenario, arm_of(scenario)).plan()
    progress(f"planned {plan.plan.duration:.2f} s; simulating {', '.join(architectures)}")
    placements: dict[int, Placement] = {}
    with Workers(jobs) as workers:
        tasks = [(scenario, name, plan, folder) for name in architectures]
        for index, placed in workers.results(place_one, tasks):
            placements[index] = placed
            verdict = "laid down" if placed.success else placed.failure
            progress(f"{len(placements)}/{len(tasks)} {placed.architecture}: {verdict}")
    body = {
        "plan": _plan_summary(plan),
        "target_y_m": scenario.place.target_y,
        "runs": [asdict(placements[i]) for i in sorted(placements)],
    }
    write_summary(folder / "summary.json", "place", scenario, body)


def _plan_summary(plan: PlacingPlan) -> dict[str, Any]:
    return {
        "tilt_rad": plan.slide.tilt,
        "friction_angle_rad": plan.plan.friction_angle,
        "slide_begins_s": plan.slide_begins,
        "slide_time_s": plan.slide.duration,
        "slide_way_m": plan.slide.way,
        "slide_speed_m_s": plan.slide.final_speed,
        "retreat_begins_s": plan.retreat_begins,
        "duration_s": plan.plan.duration,
        "limit_use": plan.plan.limit_use,
        "solve_time_s": plan.plan.solve_time,
    }


def place_one(scenario: Scenario, architecture: str, plan: PlacingPlan, folder: Path) -> Placement:
    """One run: simulate, judge, write its recording."""
    name = f"{architecture}.nc"
    data = simulate(scenario, architecture, plan.plan).recording
    data["slide"] = (("time",), sliding(data), {"units": "m"})
    data["slide_cmd"] = (("time",), plan.displacement(data["time"].values), {"units": "m"})
    data["contact_state"] = (("time",), contact_states(data), {"units": "1", "note": "0 stick, 1 slide, 2 release"})
    placed = judge(data, scenario.place.target_y, architecture, plan, name)
    with atomic_path(folder / name) as temporary:
        judged = data.assign_attrs(study="place", success=int(placed.success), failure=placed.failure or "")
        judged.to_netcdf(temporary, engine="scipy")
    return placed


def sliding(data: Recording) -> np.ndarray:
    """Displacement σ of the object along the blade since the start [m], (time,)."""
    along = in_tool(data)[:, 1]
    return along - along[int(np.searchsorted(data["time"].values, 0.0))]


def contact_states(data: Recording) -> np.ndarray:
    """Contact state of eqs. (7)–(9) by what the object really does on the blade, as ContactState values, (time,)."""
    time, slide = data["time"].values, sliding(data)
    speed = np.gradient(slide, time)
    touching = np.linalg.norm(data["contact_force"].sel(pair="blade-block").values, axis=-1) > 0
    state = np.where(np.abs(speed) > STILL, ContactState.SLIDE, ContactState.STICK)
    return np.where(touching, state, ContactState.RELEASE).astype(np.int8)


def planned_states(data: Recording, friction: float) -> np.ndarray:
    """Contact state that eqs. (7)–(9) give for the commanded sliding angle, (time,)."""
    phi = contact.sliding_angle(data["a_cmd"].values[:, :2], data["x_cmd"].values[:, 2])
    return contact.contact_state(phi, friction)


def judge(data: Recording, target_y: float, architecture: str, plan: PlacingPlan, name: str) -> Placement:
    """Whether the object lies flat within `NEAR` of the target and came down slower than `GENTLE`."""
    time, pose, landed = data["time"].values, data["block_pose"].values, touchdown(data)
    y, tilt = float(pose[-1, 5]), float(abs(np.angle(np.exp(1j * roll(pose)[-1]))))
    distance, speed = abs(y - target_y), None
    if landed is not None:
        k = max(int(np.searchsorted(time, landed.time_s)) - 1, 1)
        speed = float(np.linalg.norm(pose[k, 5:] - pose[k - 1, 5:]) / (time[1] - time[0]))
    failure = None
    if speed is None or landed is None:
        failure = "never reached the table"
    elif tilt > FLAT:
        failure = f"lies tilted by {tilt:.2f} rad"
    elif distance > NEAR:
        failure = f"lies {100 * distance:.1f} cm from the target"
    elif speed >= GENTLE:
        failure = f"came down with {speed:.2f} m/s"
    until = time <= plan.retreat_begins
    return Placement(
        architecture,
        failure is None,
        failure,
        y,
        distance,
        tilt,
        None if landed is None else landed.time_s,
        speed,
        float(-sliding(data)[until].min()),
        plan.slide.way,
        rmse(data, "x", "x_cmd", ["y", "z"]),
        name,
    )
