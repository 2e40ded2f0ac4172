"""Laying the object down by letting it slide off a tilted spatula: plan, simulate, judge."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import atomic_path, write_summary
from flipdiagram.flips.workers import Workers
from flipdiagram.grid import Grid, number
from flipdiagram.planning.place_replanner import PlaceReplanner
from flipdiagram.planning.placing import Placer, PlacingPlan
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.events import touchdown
from flipdiagram.simulation.metrics import rmse
from flipdiagram.simulation.recording import Recording, in_tool, roll
from flipdiagram.simulation.replans import replans
from flipdiagram.simulation.simulate import simulate
from flipdiagram.simulation.thumbnail import beside, path_svg
from flipdiagram.studies.study import Progress, silent
from flipdiagram.theory import contact
from flipdiagram.theory.contact import ContactState

NEAR, GENTLE, FLAT = 0.02, 0.3, 0.1
"""Success: within this of the target [m], slower than this at touch-down [m/s], flat within this [rad]."""
STILL = 1e-3
"""Speed along the blade [m/s] above which the object counts as sliding."""


def run(
    scenario: Scenario,
    out: str | Path,
    architectures: Sequence[str] = ARCHITECTURES,
    *,
    jobs: int | None = None,
    progress: Progress = silent,
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
    placements: dict[int, dict[str, Any]] = {}
    with Workers(jobs) as workers:
        tasks = [(scenario, name, plan, folder) for name in architectures]
        for index, placed in workers.results(place_one, tasks):
            placements[index] = placed
            progress(f"{len(placements)}/{len(tasks)} {placed['architecture']}: {placed['failure'] or 'laid down'}")
    runs = [placements[i] for i in sorted(placements)]
    motion, slide = plan.plan, plan.slide
    planned = {
        "tilt_rad": slide.tilt,
        "friction_angle_rad": motion.friction_angle,
        "slide_begins_s": plan.slide_begins,
        "slide_time_s": slide.duration,
        "slide_way_m": slide.way,
        "slide_speed_m_s": slide.final_speed,
        "retreat_begins_s": plan.retreat_begins,
        "duration_s": motion.duration,
        "limit_use": motion.limit_use,
        "solve_time_s": motion.solve_time,
    }
    body = {"plan": planned, "target_y_m": scenario.place.target_y, "runs": runs}
    write_summary(folder / "summary.json", "place", scenario, body)


@dataclass(frozen=True, repr=False)
class Placement:
    """One object laid down: its recording, the plan it followed, and the verdict, the `runs` entry of summary.json."""

    recording: Recording
    plan: PlacingPlan
    verdict: dict[str, Any]

    @property
    def success(self) -> bool:
        """Whether it lies flat at the target and came down gently."""
        return bool(self.verdict["success"])

    def __repr__(self) -> str:
        return f"Placement({self.verdict['architecture']}: {self.verdict['failure'] or 'laid down'})"

    def _repr_html_(self) -> str:
        """Verdict and path."""
        rows = [[name, number(value)] for name, value in self.verdict.items() if not isinstance(value, dict)]
        return beside(Grid(["", "laying down"], rows).html(), path_svg(self.recording))


def place(
    scenario: Scenario | None = None, architecture: str = "pd+ff+dob", plan: PlacingPlan | None = None
) -> Placement:
    """Lay the object down: carry it sticking (7), tilt the blade so that it slides (8), draw the blade away.

    Args:
        scenario: its section `place` says where to and how; the default where None.
        architecture: one of `ARCHITECTURES`.
        plan: that of an earlier `Placement` of the same scenario; made where None.

    Raises InputError, PlanningError where the object cannot be laid down, and SimulationError.
    """
    scenario = scenario or Scenario()
    check_architecture(architecture)
    placer = Placer(scenario, arm_of(scenario))
    placing = placer.plan() if plan is None else plan
    data = simulate(
        scenario, architecture, placing.plan, replanner=lambda: PlaceReplanner(placer, placing.after_carry)
    ).recording
    data["slide"] = (("time",), sliding(data), {"units": "m"})
    data["slide_cmd"] = (("time",), placing.displacement(data["time"].values), {"units": "m"})
    data["contact_state"] = (("time",), contact_states(data), {"units": "1", "note": "0 stick, 1 slide, 2 release"})
    verdict = {"architecture": architecture} | judge(data, scenario.place.target_y, placing)
    judged = {"study": "place", "success": int(verdict["success"]), "failure": verdict["failure"] or ""}
    return Placement(data.assign_attrs(judged), placing, verdict)


def place_one(scenario: Scenario, architecture: str, plan: PlacingPlan, folder: Path) -> dict[str, Any]:
    """One run: lay down, write the recording; its entry in `runs` of summary.json."""
    placement, name = place(scenario, architecture, plan), f"{architecture}.nc"
    with atomic_path(folder / name) as temporary:
        placement.recording.to_netcdf(temporary, engine="scipy")
    again = replans(placement.recording)
    return placement.verdict | {"recording": name} | ({} if again is None else {"replanning": again})


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
    return contact.contact_state(commanded_angle(data), friction)


def commanded_angle(data: Recording) -> np.ndarray:
    """Sliding angle φ of eq. (11) of the commanded motion [rad], (time,)."""
    return contact.sliding_angle(data["a_cmd"].values[:, :2], data["x_cmd"].values[:, 2])


def judge(data: Recording, target_y: float, plan: PlacingPlan) -> dict[str, Any]:
    """Whether the object lies flat within `NEAR` of the target and came down slower than `GENTLE`; where, and how."""
    time, pose, landed = data["time"].values, data["block_pose"].values, touchdown(data)
    y, tilt = float(pose[-1, 5]), float(abs(np.angle(np.exp(1j * roll(pose)[-1]))))
    distance, speed = abs(y - target_y), None
    if landed is not None:
        k = max(int(np.searchsorted(time, landed.time_s)) - 1, 1)
        speed = float(np.linalg.norm(pose[k, 5:] - pose[k - 1, 5:]) / (time[1] - time[0]))
    failure = None
    if speed is None:
        failure = "never reached the table"
    elif tilt > FLAT:
        failure = f"lies tilted by {tilt:.2f} rad"
    elif distance > NEAR:
        failure = f"lies {100 * distance:.1f} cm from the target"
    elif speed >= GENTLE:
        failure = f"came down with {speed:.2f} m/s"
    return {
        "success": failure is None,
        "failure": failure,
        "final_y_m": y,
        "distance_m": distance,
        "tilt_rad": tilt,
        "touchdown_time_s": landed and landed.time_s,
        "touchdown_speed_m_s": speed,
        "slid_m": float(-sliding(data)[time <= plan.retreat_begins].min()),
        "planned_slide_m": plan.slide.way,
        "position_rmse_m": rmse(data, "x", "x_cmd", ["y", "z"]),
    }
