"""Laying the object down by letting it slide off a tilted spatula: plan, simulate, judge."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.files import write_summary
from flipdiagram.flips.workers import Workers
from flipdiagram.grid import Grid, number
from flipdiagram.planning.place_replanner import PlaceReplanner
from flipdiagram.planning.placing import Placer, PlacingPlan
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation.placement import measure_placement, placed
from flipdiagram.simulation.recording import Recording
from flipdiagram.simulation.recording_files import save_recording
from flipdiagram.simulation.replans import replans
from flipdiagram.simulation.simulate import simulate
from flipdiagram.simulation.thumbnail import beside, path_svg
from flipdiagram.studies.study import Progress, silent
from flipdiagram.theory import contact


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
        for index, entry in workers.results(place_one, tasks):
            placements[index] = entry
            progress(f"{len(placements)}/{len(tasks)} {entry['architecture']}: {entry['failure'] or 'laid down'}")
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
    data = placed(data, placing.displacement(data["time"].values), scenario.place.target_y)
    return Placement(data, placing, measure_placement(data).as_dict())


def place_one(scenario: Scenario, architecture: str, plan: PlacingPlan, folder: Path) -> dict[str, Any]:
    """One run: lay down, write the recording; its entry in `runs` of summary.json."""
    placement, name = place(scenario, architecture, plan), f"{architecture}.nc"
    save_recording(placement.recording, measure_placement(placement.recording), folder / name)
    again = replans(placement.recording)
    return placement.verdict | {"recording": name} | ({} if again is None else {"replanning": again})


def planned_states(data: Recording, friction: float) -> np.ndarray:
    """Contact state that eqs. (7)–(9) give for the commanded sliding angle, (time,)."""
    return contact.contact_state(commanded_angle(data), friction)


def commanded_angle(data: Recording) -> np.ndarray:
    """Sliding angle φ of eq. (11) of the commanded motion [rad], (time,)."""
    return contact.sliding_angle(data["a_cmd"].values[:, :2], data["x_cmd"].values[:, 2])
