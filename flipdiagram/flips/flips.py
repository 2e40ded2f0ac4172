"""Many flips: planned once per motion, run once per question, spread over processes, kept as they end."""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.errors import FlipdiagramError, PlanningError, SimulationError
from flipdiagram.flips.provenance import code_version
from flipdiagram.flips.store import Store
from flipdiagram.flips.workers import Workers
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.scenario.scenario import FILES, Controller, Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.metrics import FlipMetrics, Touchdown
from flipdiagram.simulation.recording_files import recording_key, save_recording
from flipdiagram.simulation.simulate import simulate

PLAN_SECTIONS = ("arm", "tool", "object", "table", "task", "planner")
"""What a plan depends on; a test checks that nothing else changes it."""
BATCH = 150
"""Flips after which the processes are renewed: Drake never frees a Python system."""
SOURCES = ("blocks", "diagrams", "planning", "plants", "robot", "scenario", "simulation", "theory")
"""Modules whose code decides what a flip measures; a test compares them with what `simulate`, `metrics` import."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Flip:
    """One flip to be run; recording: file for its signals, relative to the study's folder, or None."""

    scenario: Scenario
    architecture: str
    recording: str | None = None

    def __post_init__(self) -> None:
        check_architecture(self.architecture)

    @property
    def key(self) -> str:
        """Name of the question: scenario as far as the architecture depends on it, architecture, code and versions."""
        scenario = self.scenario
        if "dob" not in self.architecture:  # no observer, no cut-off
            default = Controller().g_dis
            scenario = scenario.with_overrides({"controller.g_dis": default})
        sections = scenario.model_dump(mode="json", exclude={"one_dof", "frequency"})
        return _digest(json.dumps(sections, sort_keys=True), self.architecture, *_models(scenario))

    @property
    def plan_key(self) -> str:
        """Name of the motion that the flip needs."""
        sections = self.scenario.model_dump(mode="json", include=set(PLAN_SECTIONS))
        return _digest(json.dumps(sections, sort_keys=True), *_models(self.scenario))


@dataclass(frozen=True)
class Outcome:
    """What became of a flip: its metrics, or why there are none ("no plan: …", "diverged: …")."""

    metrics: FlipMetrics | None
    failure: str | None
    plan: dict[str, Any] | None = None
    """The plan's summary."""

    @property
    def success(self) -> bool:
        """Whether the block was turned over."""
        return self.metrics is not None and self.metrics.success

    def to_json(self) -> str:
        """Text that `from_json` reads back exactly."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Outcome:
        """The outcome written by `to_json`."""
        data = json.loads(text)
        if (found := data["metrics"]) is not None:
            landed = found["touchdown"]
            data["metrics"] = FlipMetrics(**(found | {"touchdown": landed and Touchdown(**landed)}))
        return cls(**data)


def run_flips(
    flips: Sequence[Flip], out: Path, *, jobs: int | None = None, progress: Progress = lambda text: None
) -> list[Outcome]:
    """The outcomes of the flips, in their order; only those that `out`/runs.sqlite does not hold are run.

    Each is stored as soon as it ends, so nothing finished is lost when the run is interrupted.
    """
    with Store(out / "runs.sqlite") as store:
        todo = {flip.key: flip for flip in flips if not _done(flip, store, out)}
        if todo:
            progress(f"{len(flips)} flips, {len(todo)} of them to be run")
            plans = _plans(list(todo.values()), store, jobs, progress)
            _fly(todo, plans, store, out, jobs, progress)
        return [Outcome.from_json(store.outcome(flip.key) or "") for flip in flips]


def _done(flip: Flip, store: Store, out: Path) -> bool:
    text = store.outcome(flip.key)
    if text is None:
        return False
    if flip.recording is None or Outcome.from_json(text).metrics is None:
        return True
    # a run of another scenario into the same folder replaces the file under the same name
    return recording_key(out / flip.recording) == flip.key


def _plans(flips: Sequence[Flip], store: Store, jobs: int | None, progress: Progress) -> dict[str, Plan | str]:
    """The plan, or the reason why there is none, of every motion needed."""
    needed = {flip.plan_key: flip.scenario for flip in flips}
    missing = [key for key in needed if store.plan(key) is None]
    clock = Clock(len(missing))
    with Workers(jobs) as workers:
        for index, (text, error) in workers.results(_plan_one, [(needed[key],) for key in missing]):
            store.put_plan(missing[index], text, error)
            progress(f"planned {clock.tick()}")
    found: dict[str, Plan | str] = {}
    for key in needed:
        text, error = store.plan(key) or ("", "")
        found[key] = Plan.from_json(text, "stored plan") if text else str(error)
    return found


def _fly(
    todo: dict[str, Flip], plans: dict[str, Plan | str], store: Store, out: Path, jobs: int | None, progress: Progress
) -> None:
    tasks: list[tuple[Flip, Plan, Path]] = []
    for flip in todo.values():
        plan = plans[flip.plan_key]
        if isinstance(plan, str):
            _keep(store, flip, Outcome(None, f"no plan: {plan}"), 0.0)
        else:
            tasks.append((flip, plan, out))
    clock = Clock(len(tasks))
    for first in range(0, len(tasks), BATCH):
        batch = tasks[first : first + BATCH]
        with Workers(jobs) as workers:
            for index, (outcome, seconds) in workers.results(fly_one, batch):
                flip = batch[index][0]
                _keep(store, flip, outcome, seconds)
                progress(f"flips {clock.tick()}")


def _keep(store: Store, flip: Flip, outcome: Outcome, seconds: float) -> None:
    store.put_outcome(flip.key, flip.architecture, flip.scenario.to_yaml(), outcome.to_json(), seconds)


def _plan_one(scenario: Scenario) -> tuple[str | None, str | None]:
    try:
        return plan_motion(scenario).to_json(), None
    except (PlanningError, SimulationError) as error:
        return None, str(error)


def fly_one(flip: Flip, plan: Plan, out: Path) -> tuple[Outcome, float]:
    """Run one flip here: its outcome and the seconds it took; writes its recording where the flip names one."""
    _quieten_drake()
    begin = time.perf_counter()
    try:
        run = simulate(flip.scenario, flip.architecture, plan)
    except FlipdiagramError as error:
        return Outcome(None, f"{_kind(error)}: {error}", plan.summary()), time.perf_counter() - begin
    measured = metrics.measure(run.recording)
    if flip.recording is not None:
        save_recording(run.recording, measured, out / flip.recording, flip.key)
    return Outcome(measured, measured.failure, plan.summary()), time.perf_counter() - begin


@cache
def _quieten_drake() -> None:
    # a study that compares solvers uses deprecated ones on purpose; once a process is once too often
    logging.getLogger("drake").addFilter(lambda record: "DRAKE_DEPRECATED" not in record.getMessage())


def _kind(error: FlipdiagramError) -> str:
    if isinstance(error, SimulationError):
        return "diverged"
    return "no plan" if isinstance(error, PlanningError) else "refused"


class Clock:
    """Counts what is done and estimates the time left."""

    def __init__(self, total: int) -> None:
        self.total, self.done, self.begin = total, 0, time.monotonic()

    def tick(self) -> str:
        """One more is done: '12/96, 3:04 left'."""
        self.done += 1
        left = (time.monotonic() - self.begin) / self.done * (self.total - self.done)
        return f"{self.done}/{self.total}, {int(left) // 60}:{int(left) % 60:02d} left"


def _models(scenario: Scenario) -> list[str]:
    """Digests of the model files that a scenario names: they may change under the same name."""
    found = []
    for field in FILES:
        section, name = field.split(".")
        if path := getattr(getattr(scenario, section), name):
            with suppress(OSError):  # who runs the flip says that it cannot be read
                found.append(f"{field} {hashlib.sha256(Path(path).read_bytes()).hexdigest()}")
    return found


def _digest(*texts: str) -> str:
    parts: Iterable[str] = (*texts, code_version(SOURCES))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
