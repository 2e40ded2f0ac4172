"""Do the engines agree?  The worlds of a campaign flown in Drake and in MuJoCo, closed loop, verdict beside verdict."""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import xarray as xr
from scipy.stats import ks_2samp

from flipdiagram.campaign.checks import load_specification
from flipdiagram.campaign.dataset import counted, load_dataset, parameters_of
from flipdiagram.campaign.run import FILE, WORK
from flipdiagram.campaign.run import run as fly
from flipdiagram.campaign.statistics import holm, success_rate
from flipdiagram.errors import InputError
from flipdiagram.files import write_summary
from flipdiagram.flips.flight import Work
from flipdiagram.plants.mujoco_contact import import_mujoco
from flipdiagram.scenario.scenario import Scenario, Simulation
from flipdiagram.studies.study import Progress, silent

ENGINES = get_args(Simulation.model_fields["engine"].annotation)


def run(
    scenario: Scenario,
    out: str | Path,
    *,
    file: str | None,
    yes: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    work: Work = WORK,
) -> None:
    """Fly the campaign of a file in every engine, each into a folder of its name; write summary.json.

    Flips that are there already are kept.  yes: even if it takes longer than the file's limit.  Raises InputError.
    """
    if file is None:
        raise InputError("engines needs the FILE of a campaign; see examples/engines.yaml", field="FILE")
    import_mujoco()  # raises InputError before anything is written
    data = {}
    for engine in ENGINES:
        specification = load_specification(file, scenario.changes() | {"simulation.engine": engine})
        if yes:
            specification = replace(specification, limit_hours=math.inf)
        folder, there = Path(out) / engine, (Path(out) / engine / FILE).exists()
        ended = fly(
            specification,
            folder,
            jobs=jobs,
            resume=there,
            progress=lambda text, engine=engine: progress(f"{engine}: {text}"),  # type: ignore[misc]
            work=work,
        )
        data[engine] = load_dataset(ended.file)
    base = specification.base.with_overrides({"simulation.engine": ENGINES[0]})
    write_summary(Path(out) / "summary.json", "engines", base, agreement(*data.values()))


def agreement(one: xr.Dataset, other: xr.Dataset) -> dict[str, Any]:
    """How often two campaigns of the same worlds give the same verdict, which flips differ, and in which worlds.

    A verdict is whether the block was turned over; the outcome says how a failure looked.  parameters: medians over
    flips with equal and with other verdicts, and the p of Kolmogorov and Smirnov, which also sees worlds that lie about
    a border in the middle; Holm's correction over all of them.
    """
    names = [str(name) for name in one["architecture"].values]
    entries, differ, same_verdict, everywhere = {}, [], [], []
    for name in names:
        a, b = one.sel(architecture=name), other.sel(architecture=name)
        both = counted(a) & counted(b)
        same = a["success"].values == b["success"].values
        outcomes = Counter(zip(a["outcome"].values[both].tolist(), b["outcome"].values[both].tolist(), strict=True))
        entries[name] = {
            "counted": int(both.sum()),
            "equal": int((same & both).sum()),
            **success_rate(int((same & both).sum()), int(both.sum())),
            "turned_over": [int((part["success"].values & both).sum()) for part in (a, b)],
            "outcomes": [{"pair": list(pair), "flips": count} for pair, count in outcomes.most_common()],
        }
        for k in np.flatnonzero(both & ~same):
            values = {p: one[p].values[k].item() for p in parameters_of(one)}
            pair = [str(part["outcome"].values[k]) for part in (a, b)]
            differ.append(
                {"trial": int(one["trial"].values[k]), "architecture": name, "outcomes": pair, "values": values}
            )
        same_verdict.append(same)
        everywhere.append(both)
    parameters = _parameters(one, np.array(same_verdict), np.array(everywhere))
    return {
        "engines": list(ENGINES),
        "trials": one.sizes["trial"],
        "architectures": entries,
        "differ": differ,
        "parameters": parameters,
    }


def _parameters(data: xr.Dataset, same: np.ndarray, both: np.ndarray) -> list[dict[str, Any]]:
    """By parameter, the one that tells equal from other verdicts best first; [] where all verdicts are equal."""
    rows: list[dict[str, Any]] = []
    for name in parameters_of(data):
        values = np.broadcast_to(data[name].values, same.shape)
        equal, other = values[same & both], values[~same & both]
        if values.dtype.kind == "f" and len(equal) and len(other):
            p = float(ks_2samp(equal, other).pvalue)
            rows.append({"name": name, "equal": float(np.median(equal)), "other": float(np.median(other)), "p": p})
    for row, p in zip(rows, holm([row["p"] for row in rows]), strict=True):
        row["p_holm"] = p
    return sorted(rows, key=lambda row: row["p"])
