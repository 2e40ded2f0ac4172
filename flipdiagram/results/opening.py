"""Files of results back as objects, with one-line errors for what cannot be read."""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from flipdiagram.campaign import dataset
from flipdiagram.errors import InputError
from flipdiagram.files import RESULT_BYTES, check_file, read_text
from flipdiagram.planning.plan import SCHEMA as PLAN_SCHEMA
from flipdiagram.planning.plan import Plan
from flipdiagram.simulation.recording import SCHEMA as RECORDING_SCHEMA
from flipdiagram.simulation.recording_files import check_recording, open_netcdf
from flipdiagram.studies.registry import STUDIES

CAMPAIGN = "campaign data"
"""The flips of a campaign over (trial, architecture), from its file or an exported one."""
VERSION = 1
"""Version of every schema that this code reads."""
IN_FOLDER = ("summary.json", "tuning.json", "plan.json", "frequency.nc", "campaign.sqlite")
"""What stands for a folder, first one first; after these a single recording."""
VALID = (
    "a recording (.nc), summary.json, tuning.json, plan.json, frequency.nc, a campaign (.sqlite, .csv,"
    " .parquet, .nc), or a folder that holds one"
)
DEEPEST = 40
"""Levels of lists and mappings that a summary may have."""
BROKEN = (KeyError, TypeError, ValueError, IndexError, AttributeError)
"""What reading a summary raises where an entry is missing or of another kind."""
AnyPath = str | os.PathLike[str]
Result = xr.Dataset | dict[str, xr.Dataset] | Plan


@dataclass(frozen=True)
class Source:
    """A file as read: 'recording', 'frequency data', 'campaign data', 'motion' or a study, and what it holds."""

    path: Path
    kind: str
    data: xr.Dataset | None = None
    summary: Mapping[str, Any] | None = None
    plan: Plan | None = None

    def result(self) -> Result:
        """The object that it holds; InputError where it is damaged."""
        if self.data is not None:
            return self.data
        if self.plan is not None:
            return self.plan
        try:
            result: Result = STUDIES[self.kind].read(self.summary, self.path.parent)
            return result
        except BROKEN as error:
            raise damaged(self.path, error) from error


def open_result(path: AnyPath) -> Result:
    """The object that a file or folder of results holds; every summary.json is read by its study's `read`.

    A recording or frequency.nc: its Dataset.  plan.json, and the summary.json of `flipdiagram plan`: the Plan.
    summary.json of turnover and place: Dataset over (architecture, joint); experiment: (architecture, start_y);
    replanning: (case, way, architecture); pancake: 'runs' and 'second_engine', each over (architecture, thickness,
    friction, modulus); report: claims; borders: a Dataset by map name, over the architecture and the map's two axes;
    frequency: a Dataset by figure, '5' … '10', over (curve, omega); beside these 'variations' and 'claims';
    campaign: rates by architecture, 'pairs' and 'quantiles'; tuning.json: 'rates' and 'gains'.
    campaign.sqlite and what --export wrote: the flips over (trial, architecture).  Units stand in attrs["units"].
    A folder: its summary.json, else tuning.json, plan.json, frequency.nc, campaign.sqlite, or its only recording.

    Raises InputError for a missing or damaged file, an unknown schema, and a schema newer than this version.
    """
    return read(path).result()


def open_campaign(path: AnyPath) -> xr.Dataset:
    """The flips of a campaign over (trial, architecture), with units: `outcome`, `success`, metrics, what was varied.

    path: the folder of a campaign, its campaign.sqlite, also while it runs, or what --export wrote (.csv, .parquet,
    .nc).  Raises InputError where it is something else.
    """
    file = Path(path)
    held = file / "campaign.sqlite"
    source = read(held if held.is_file() else file)
    if source.kind != CAMPAIGN or source.data is None:
        raise _refused(file, f"is a result of kind '{source.kind}'", "the folder or campaign.sqlite of a campaign")
    return source.data


def read(path: AnyPath) -> Source:
    """A file or folder of results, read and known by its kind; InputError as `open_result`."""
    file = _locate(path)
    if file.suffix == ".nc":
        return _read_dataset(file)
    if file.suffix == ".json":
        return _read_json(file)
    if file.suffix == ".sqlite":
        return Source(file, CAMPAIGN, dataset.load_dataset(file))
    if file.suffix in (".csv", ".parquet"):
        try:
            return Source(file, CAMPAIGN, dataset.read_table(check_file(file, "", VALID)))
        except ImportError:
            install = "pip install 'flipdiagram[parquet]'"
            raise _refused(file, "needs pyarrow, which is not installed; install it with", install, ": ") from None
        except (OSError, *BROKEN) as error:
            raise damaged(file, error) from error
    page = "is a page for a browser and is not supported here"
    raise _refused(file, page if file.suffix == ".html" else "is no file of results")


def _locate(path: AnyPath) -> Path:
    """The file that stands for a path; InputError where there is none."""
    file = Path(path)
    try:
        if not file.exists():
            raise _refused(file, "does not exist")
        if not file.is_dir():
            return file
        held = [file / name for name in IN_FOLDER if (file / name).is_file()] or sorted(file.glob("*.nc"))
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        raise _refused(file, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not held:
        raise _refused(file, "is a folder that holds no results")
    if held[0].name not in IN_FOLDER and len(held) > 1:
        names = [recording.name for recording in held]
        raise _refused(file, f"is a folder that holds several recordings, {', '.join(names)}", "one of them")
    return held[0]


def _refused(file: Path, problem: str, valid: str = VALID, joint: str = "; valid is ") -> InputError:
    message = f"{str(file)!r} {problem}{joint}{valid}"
    return InputError(message, field="file", value=str(file), valid=valid)


def damaged(file: Path, reason: object) -> InputError:
    """The error for a file that is not as flipdiagram wrote it."""
    if isinstance(reason, KeyError):
        reason = f"it lacks {reason}"
    return _refused(file, f"is damaged: {' '.join(str(reason).split())[:160]}", "a file that flipdiagram wrote")


def _read_json(file: Path) -> Source:
    text = read_text(file, "", VALID, RESULT_BYTES)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise damaged(file, f"not valid JSON: {error}") from None
    if _is_deep(content):
        raise damaged(file, f"nested in more than {DEEPEST} levels")
    schema = content.get("schema") if isinstance(content, dict) else None
    match = re.fullmatch(r"flipdiagram/(\w+)/(\d{1,9})", schema) if isinstance(schema, str) else None
    known = {study.name: study.schema for study in STUDIES.values()} | {"motion": PLAN_SCHEMA}
    if match is None or match[1] not in known:
        raise _refused(file, f"has schema {json.dumps(schema)[:60]}", ", ".join(known.values()), "; valid are ")
    if int(match[2]) != VERSION:
        age = "newer" if int(match[2]) > VERSION else "older"
        raise _refused(file, f"has schema '{schema}', {age} than this flipdiagram reads", f"version {VERSION}")
    if schema == PLAN_SCHEMA:
        return Source(file, "motion", plan=Plan.from_json(text, f"plan file '{file}'"))
    for part in ("versions", "scenario"):
        if not isinstance(content.get(part), dict):
            raise damaged(file, KeyError(part))
    return Source(file, match[1], summary=content)


def _is_deep(content: Any) -> bool:
    level = [content]
    for _ in range(DEEPEST):
        held = (item for item in level if isinstance(item, dict | list))
        level = [item for one in held for item in (one.values() if isinstance(one, dict) else one)]
    return bool(level)


def _read_dataset(file: Path) -> Source:
    data = open_netcdf(file)
    kind = kind_of(data)
    if kind == "recording":
        return Source(file, kind, check_recording(data, f"'{file}'"))
    if kind == CAMPAIGN:
        return Source(file, kind, data.assign(success=data["success"].astype(bool)))  # NetCDF 3 has numbers only
    if kind is not None:
        return Source(file, kind, data)
    names = ", ".join(str(name) for name in list(data.data_vars)[:6]) or "nothing"
    raise _refused(file, f"holds {names}: neither a recording nor frequency data nor a campaign")


def kind_of(data: xr.Dataset) -> str | None:
    """What a Dataset is of: 'recording', 'frequency data', 'campaign data'; None for anything else."""
    if data.attrs.get("schema") == RECORDING_SCHEMA or "x_cmd" in data:
        return "recording"
    if "linear_peak_x" in data and "omega" in data.coords:
        return "frequency data"
    return CAMPAIGN if {"trial", "architecture"} <= set(data.sizes) and "outcome" in data else None
