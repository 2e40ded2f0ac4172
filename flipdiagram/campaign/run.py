"""A campaign from its specification to its file: what is missing is flown, by whatever workers."""

import os
import tempfile
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from flipdiagram.campaign.checks import check_estimate, specification_of
from flipdiagram.campaign.dataset import load_dataset
from flipdiagram.campaign.draw import missing_draws
from flipdiagram.campaign.specification import Specification
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying, fly_all
from flipdiagram.flips.flight import Work, fly_flight, plan_drawn_flight, provenance
from flipdiagram.flips.flip import scenario_digest
from flipdiagram.flips.row import to_json
from flipdiagram.flips.run import Clock, Progress
from flipdiagram.flips.store import refusal
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import workers_of

FILE = "campaign.sqlite"
COMPARED = 500
"""Rows of an earlier run whose scenario is drawn again to see that it comes out the same."""
WORK = Work(plan_drawn_flight, fly_flight)


@dataclass(frozen=True)
class Ended:
    """A campaign that has run to its end: its file, flips flown now, and by which workers."""

    file: Path
    flown: int
    workers: str


def run_campaign(
    specification: Specification | Mapping[str, Any] | str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    any_version: bool = False,
    progress: Progress = lambda text: None,
) -> xr.Dataset:
    """Fly every trial of a campaign under every architecture; the flips over (trial, architecture), with units.

    Args:
        specification: the name of a campaign file, as examples/campaign.yaml, or what would stand in one:
            {"base": scenario, "vary": {"object.mass": {"uniform": [0.03, 0.12]}}, "trials": 64}.
        out: folder for campaign.sqlite, which `open_campaign` reads again; None: nothing is kept.
        jobs: processes side by side, by default one a core.
        scheduler: address of a Dask scheduler, whose workers fly instead.
        resume: go on with what `out` holds.
        any_version: even if code or versions have changed since.
        progress: told how far it is, as a line of text.

    Raises InputError for a bad specification, for one that takes longer than its `limit_hours` [h], and for a file that
    cannot be used; SimulationError where the cluster is lost.
    """
    checked = specification_of(specification)
    if out is None and resume:
        raise InputError.of("resume", True, "resume with the folder `out` of an earlier run")
    settings: Any = {"jobs": jobs, "scheduler": scheduler, "resume": resume, "any_version": any_version}
    with tempfile.TemporaryDirectory() if out is None else nullcontext(os.fspath(out)) as folder:
        return load_dataset(run(checked, folder, progress=progress, **settings).file)


def run(
    specification: Specification,
    out: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    any_version: bool = False,
    progress: Progress = lambda text: None,
    work: Work = WORK,
) -> Ended:
    """Fly every trial under every architecture into `out`/campaign.sqlite.

    Args:
        specification: what is flown; one that would take longer than its `limit_hours` is refused.
        out: folder of the file.
        jobs: processes, by default one a core.
        scheduler: address of a Dask scheduler, whose workers fly instead.
        resume: go on with what is there.
        any_version: even if code or versions have changed since.
        progress: told how far it is.
        work: what workers do.

    Raises InputError for a file that cannot be used, SimulationError where the cluster is lost; what has ended is kept.
    """
    file, (code, versions, _) = Path(out) / FILE, provenance()
    meta = {
        "specification": to_json(specification.as_dict()),
        "digest": specification.digest,
        "text": specification.text,
        "rows": str(specification.rows),
        "code": code,
        "versions": to_json(versions),
        "begun": str(time.time()),
    }
    with workers_of(jobs, scheduler) as workers:
        width = max(workers.width(), 1)
        if not resume:  # nothing is written before all is checked
            check_estimate(specification, width)
        with open_to_write(file, meta, resume) as store:
            if store.meta().get("code") != code and not any_version:
                problem = f"was begun with other code or versions ({store.meta().get('versions')})"
                raise refusal(file, problem, "the same installation, another --out, or --any-version")
            done = store.done()
            _check_draws(specification, done, file)
            missing = specification.rows - len(done)
            check_estimate(specification, width, missing / specification.rows)
            progress(f"{specification.rows} flips, {missing} of them to be flown, on {workers.name}")
            tick = Clock(missing, progress).tick
            flying = Flying(workers, store, work, specification.limits, tick, any_version)
            fly_all(missing_draws(specification, done), missing, flying)
        return Ended(file, missing, workers.name)


def _check_draws(specification: Specification, done: Mapping[tuple[int, str], str], file: Path) -> None:
    for index, name in list(done)[:: -(-len(done) // COMPARED) or 1]:
        truth = specification.truth(specification.trial(index))
        if scenario_digest(truth) != done[index, name]:
            problem = f"holds a trial {index} that is drawn differently now (by another scipy or scenario?)"
            raise refusal(file, problem, "the installation with which it was begun, or another --out")
