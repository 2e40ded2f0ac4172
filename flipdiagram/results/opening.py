"""Files of results back as objects, with one-line errors for what cannot be read."""

from __future__ import annotations

import json
import os
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from flipdiagram.errors import InputError
from flipdiagram.planning.plan import SCHEMA as PLAN_SCHEMA
from flipdiagram.planning.plan import Plan
from flipdiagram.results import summaries
from flipdiagram.simulation.recording_files import load_recording

STUDIES = ("turnover", "experiment", "borders", "frequency", "report", "plan")
VERSION = 1
"""Version of every schema that this code reads."""
IN_FOLDER = ("summary.json", "plan.json", "frequency.nc")
"""What stands for a folder, first one first; after these a single recording."""
VALID = "valid is a recording (.nc), summary.json, plan.json, frequency.nc, or a folder that holds one"
AnyPath = str | os.PathLike[str]
Result = xr.Dataset | dict[str, xr.Dataset] | Plan


@dataclass(frozen=True)
class Source:
    """A file as read: what it is ('recording', 'frequency data', 'motion' or a study), and its content."""

    path: Path
    kind: str
    schema: str
    data: xr.Dataset | None = None
    summary: Mapping[str, Any] | None = None
    plan: Plan | None = None


def open_result(path: AnyPath) -> Result:
    """The object that a file or folder of results holds.

    A recording or frequency.nc: its Dataset.  plan.json, and the summary.json of `flipdiagram plan`: the Plan.
    summary.json of turnover: Dataset over (architecture, joint); experiment: (architecture, start_y); report: claims;
    borders: a Dataset by map name, over the architecture and the map's two axes; frequency: a Dataset by figure,
    '5' … '10', over (curve, omega); beside these 'variations' and 'claims'.  Units stand in attrs["units"].
    A folder: its summary.json, else plan.json, frequency.nc, or its only recording.

    Raises InputError for a missing or damaged file, an unknown schema, and a schema newer than this version.
    """
    source = read(path)
    if source.data is not None:
        return source.data
    if source.plan is not None:
        return source.plan
    assert source.summary is not None
    if source.kind == "plan":
        return Plan.load(source.path.with_name("plan.json"))
    try:
        return summaries.READERS[source.kind](source.summary, source.path.parent)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise _damaged(source.path, error) from error


def read(path: AnyPath) -> Source:
    """A file or folder of results, read and known by its kind; InputError as `open_result`."""
    file = locate(path)
    if file.suffix == ".html":
        raise InputError(f"'{file}' is a page for a browser and is not supported here; {VALID}")
    if file.suffix == ".nc":
        return _read_dataset(file)
    if file.suffix != ".json":
        raise InputError(f"'{file}' is no file of results; {VALID}")
    return _read_json(file)


def locate(path: AnyPath) -> Path:
    """The file that stands for a path; InputError where there is none."""
    found = Path(path)
    try:
        if not found.exists():
            raise InputError(f"'{found}' does not exist; {VALID}")
        if not found.is_dir():
            return found
        held = [found / name for name in IN_FOLDER if (found / name).is_file()] or sorted(found.glob("*.nc"))
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(found)!r} cannot be read: {reason}; {VALID}") from None
    if not held:
        raise InputError(f"folder '{found}' holds no results; {VALID}")
    if held[0].name not in IN_FOLDER and len(held) > 1:
        names = ", ".join(file.name for file in held)
        raise InputError(f"folder '{found}' holds several recordings, {names}; name one of them")
    return held[0]


def _read_json(file: Path) -> Source:
    try:
        text = file.read_text(encoding="utf-8")
        content = json.loads(text)
    except OSError as error:
        raise InputError(f"'{file}' cannot be read: {error.strerror}; {VALID}") from None
    except (ValueError, RecursionError) as error:  # not UTF-8 is a ValueError too
        raise _damaged(file, f"not valid JSON: {error}") from None
    schema = content.get("schema") if isinstance(content, dict) else None
    match = re.fullmatch(r"flipdiagram/(\w+)/(\d{1,9})", schema) if isinstance(schema, str) else None
    known = (*STUDIES, PLAN_SCHEMA.split("/")[1])
    if match is None or match[1] not in known:
        names = ", ".join(f"flipdiagram/{name}/{VERSION}" for name in known)
        raise InputError(f"'{file}' has schema {json.dumps(schema)[:60]}; valid are {names}")
    if int(match[2]) != VERSION:
        age = "newer" if int(match[2]) > VERSION else "older"
        raise InputError(
            f"'{file}' has schema '{schema}', {age} than this flipdiagram reads; valid is version {VERSION}"
        )
    if schema == PLAN_SCHEMA:
        return Source(file, "motion", PLAN_SCHEMA, plan=Plan.from_json(text, f"plan file '{file}'"))
    for part in ("versions", "scenario"):
        if not isinstance(content.get(part), dict):
            raise _damaged(file, KeyError(part))
    return Source(file, match[1], str(schema), summary=content)


def _read_dataset(file: Path) -> Source:
    try:
        data = load_recording(file)
    except OSError as error:
        raise _damaged(file, error.strerror or error) from None
    # what scipy and xarray raise for bytes that are no NetCDF, or that end too early
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, MemoryError, struct.error) as error:
        raise _damaged(file, f"no NetCDF 3, or cut off ({error})") from None
    if "x_cmd" in data and "time" in data.sizes and "architecture" in data.attrs:
        return Source(file, "recording", "recording", data=data)
    if "linear_peak_x" in data and "omega" in data.coords:
        return Source(file, "frequency data", "frequency data", data=data)
    names = ", ".join(str(name) for name in list(data.data_vars)[:6]) or "nothing"
    raise InputError(f"'{file}' holds {names}: neither a recording nor frequency data; {VALID}")


def _damaged(file: Path, reason: object) -> InputError:
    if isinstance(reason, KeyError):
        reason = f"it lacks {reason}"
    text = " ".join(str(reason).split())[:160]
    return InputError(f"'{file}' is damaged: {text}; valid is a file that flipdiagram wrote")
