"""A campaign from its specification to its file: what is missing is flown, on whatever engine."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipdiagram.campaign.checks import check_estimate
from flipdiagram.campaign.modes import mode_of
from flipdiagram.campaign.opening import begun
from flipdiagram.campaign.results import Results, Row
from flipdiagram.campaign.specification import Specification, Trial, scenario_digest
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips.driver import WORK, Job, fly_all
from flipdiagram.flips.engines import engine
from flipdiagram.flips.flips import Clock
from flipdiagram.flips.work import Landed, Planned, Work, provenance

FILE = "campaign.sqlite"
TIMES = ("solve_time_s",)
"""Entries of a plan's summary that differ from run to run."""
COMPARED = 500
"""Rows of an earlier run whose scenario is drawn again to see that it comes out the same."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Ended:
    """A campaign that has run to its end: its file, flips flown now, wall time [s], and where it ran."""

    file: Path
    flown: int
    seconds: float
    engine: str


def run(
    specification: Specification,
    out: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    yes: bool = False,
    any_version: bool = False,
    progress: Progress = lambda text: None,
    work: Work = WORK,
) -> Ended:
    """Fly every trial under every architecture into `out`/campaign.sqlite; with `resume` those that are missing there.

    jobs: processes, by default one a core; scheduler: address of a Dask scheduler instead; yes: even if it takes longer
    than the limit; any_version: go on although code or versions have changed.  Raises InputError for a file that
    cannot be used, SimulationError where the cluster is lost; all that had ended is kept.
    """
    begin, file = time.monotonic(), Path(out) / FILE
    code, versions, _ = provenance()
    meta = {"code": code, "versions": json.dumps(versions, sort_keys=True), "begun": str(time.time())}
    with engine(jobs, scheduler) as found, ExitStack() as stack:
        width = max(found.width(), 1)
        if not yes and not resume:  # nothing is written before all is checked
            check_estimate(specification, width)
        results = stack.enter_context(begun(file, specification, meta, resume))
        if results.meta()["code"] != code and not any_version:
            raise InputError(
                f"'{file}' was begun with other code or versions ({results.meta()['versions']});"
                " valid is the same installation, another --out, or --any-version"
            )
        done = results.done()
        _check_draws(specification, done, file)
        missing = specification.rows - len(done)
        if not yes:
            check_estimate(specification, width, missing / specification.rows)
        progress(f"{specification.rows} flips, {missing} of them to be flown, on {found.name}")
        keeper = _Keeper(results, Clock(missing), progress, None if any_version else code)
        fly_all(_missing(specification, done), found, keeper, specification.timeout, work)
        return Ended(file, missing, time.monotonic() - begin, found.name)


def _missing(specification: Specification, done: Mapping[tuple[int, str], str]) -> Iterator[Job]:
    """Trial by trial, so that the architectures can be compared from the first row on."""
    for index in range(specification.trials):
        names = [name for name in specification.architectures if (index, name) not in done]
        if names:
            trial = specification.trial(index)
            truth, believed = specification.truth(trial), specification.believed(trial)
            for name in names:
                yield Job(trial, truth, believed, name, trial.seed)


def _check_draws(specification: Specification, done: Mapping[tuple[int, str], str], file: Path) -> None:
    for index, name in list(done)[:: -(-len(done) // COMPARED) or 1]:
        truth = specification.truth(specification.trial(index))
        if scenario_digest(truth) != done[index, name]:
            raise InputError(
                f"'{file}': trial {index} is drawn differently now (another version of scipy or of the scenario?);"
                " valid is the installation with which it was begun, or another --out"
            )


class _Keeper:
    """Puts what has ended into the file."""

    def __init__(self, results: Results, clock: Clock, progress: Progress, code: str | None) -> None:
        self._results, self._clock, self._progress, self._code = results, clock, progress, code

    def plan(self, key: str) -> Planned | None:
        return self._results.plan(key)

    def put_plan(self, key: str, plan: str | None, error: str | None) -> None:
        self._results.put_plan(key, plan, error)

    def keep(self, ended: list[tuple[Job, Landed]]) -> None:
        same = [(job, landed) for job, landed in ended if self._code in (None, landed.code)]
        self._results.put([row_of(job, landed, job.name) for job, landed in same])
        for _ in same:
            self._progress(f"flips {self._clock.tick()}")
        if len(same) < len(ended):  # a worker that has just started reads the files as they are now
            raise SimulationError(
                "the program was changed while the campaign runs, or a worker has another one; what has ended is kept,"
                " --resume --any-version goes on with the new one"
            )


def row_of(job: Job, landed: Landed, trial: Trial) -> Row:
    """A flip that has ended as a row of the file."""
    outcome = landed.outcome
    measured = outcome.metrics and outcome.metrics.as_dict() | {"torque_use": landed.torque_use}
    return Row(
        trial=trial.index,
        architecture=job.architecture,
        outcome=mode_of(outcome.failure, outcome.metrics),
        failure=outcome.failure,
        seed=trial.seed,
        scenario_hash=scenario_digest(job.truth),
        overrides=_plain(trial.overrides),
        values=_plain(trial.values),
        metrics=_plain(measured),
        plan=_plain(outcome.plan and {k: v for k, v in outcome.plan.items() if k not in TIMES}),
        code=landed.code,
        versions=landed.versions,
        seconds=landed.seconds,
        host=landed.host,
        attempts=job.attempts,
        finished=time.time(),
    )


def _plain(value: Any) -> Any:
    """As JSON gives it back: lists, and null for what is no finite number."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
