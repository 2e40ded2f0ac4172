"""Damaged files of a campaign: each command gives its result or one line, and writes nothing into what it refuses."""

import os
import sqlite3
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from campaign.made_up import QUIET, metrics_of
from hostile.table import Case, check
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flipdiagram.campaign.analysis import analyse
from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.dataset import export, load_dataset
from flipdiagram.campaign.watch import status_grid
from flipdiagram.errors import InputError
from flipdiagram.flips.flight import Landed
from flipdiagram.flips.order import row_of
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.row import COLUMNS, to_json
from flipdiagram.flips.store_file import open_to_read, open_to_write

TRIALS = 6
SPECIFICATION = from_text(QUIET.replace("trials: 30", f"trials: {TRIALS}"))
META = {
    "specification": to_json(SPECIFICATION.as_dict()),
    "digest": SPECIFICATION.digest,
    "rows": str(SPECIFICATION.rows),
    "code": "c",
    "versions": "{}",
}


@cache
def campaign():
    """The bytes of a campaign of 6 trials under 2 architectures, all flown."""
    with TemporaryDirectory() as folder:
        with open_to_write(Path(folder) / "c.sqlite", META) as store:
            store.put([row(trial, name) for trial in range(TRIALS) for name in SPECIFICATION.architectures])
        return (Path(folder) / "c.sqlite").read_bytes()


def row(trial, name):
    flight = SPECIFICATION.flight(SPECIFICATION.trial(trial), name)
    measured = metrics_of(flight, flight.truth.object.friction > 1.0)
    return row_of(flight, Landed(Outcome(measured, measured.failure, {"cost_J": 1.0}, 0.5), 0.1, "c", {}, "h")).packed()


def sound(path):
    path.write_bytes(campaign())


def execute(path, *statements):
    """Run SQL on a file in which any value may stand in a cell, as in those that have no STRICT tables."""
    for batch in (
        [
            ("PRAGMA writable_schema = ON",),
            ("UPDATE sqlite_master SET sql = replace(replace(sql, ', STRICT', ''), ') STRICT', ')')",),
        ],
        statements,
    ):
        database = sqlite3.connect(path, isolation_level=None)
        try:
            for statement in batch:
                database.execute(*statement)
        finally:
            database.close()


def changed(statement):
    """A function that makes a campaign's file and runs a statement on it."""

    def make(path):
        sound(path)
        execute(path, (statement,))

    return make


def cell(column, value, where="trial = 3 AND architecture = 'pd'"):
    return changed(f'UPDATE OR REPLACE trials SET "{column}" = {value} WHERE {where}')


ROW = ("damaged", "table trials", "row (3, 'pd')")
DAMAGE = {
    "metrics that are no JSON": (cell("metrics", "'{'"), (*ROW, "column metrics = '{'", "valid is JSON")),
    "metrics of a text": (
        cell("metrics", "json_set(metrics, '$.max_slip_m', 'x')"),
        (*ROW, "metrics.max_slip_m = 'x'"),
    ),
    "metrics without torques": (cell("metrics", "'{}'"), (*ROW, "column metrics.max_torque_Nm")),
    "values of other length": (cell("values", "'[1.0]'"), (*ROW, "column values = [1.0]; valid is a list of 2")),
    "values beyond sense": (cell("values", "'[1.0, 1e300]'"), (*ROW, "column values.1", "1e+300")),
    "bytes": (cell("failure", "x'00ff'"), (*ROW, "column failure = b'", "valid is a valid string")),
    "outcome": (cell("outcome", "'flew away'"), (*ROW, "column outcome = 'flew away'; choose from turned over")),
    "seed": (cell("seed", "'x'"), (*ROW, "column seed = 'x'; valid is a valid integer")),
    "seconds": (cell("seconds", "-1e999"), (*ROW, "column seconds = -inf")),
    "unknown trial": (
        cell("trial", "99"),
        ("row (99, 'pd')", "column trial = 99; valid is a whole number from 0 to 5"),
    ),
    "trial of another kind": (cell("trial", "'a'"), ("row ('a', 'pd')", "column trial = 'a'")),
    "unknown architecture": (
        cell("architecture", "'pid'"),
        ("row (3, 'pid')", "column architecture", "choose from pd, pd+ff+dob"),
    ),
    "specification": (
        changed("UPDATE meta SET value = replace(value, '6', '7') WHERE key = 'specification'"),
        ("table meta, row 'specification'",),
    ),
    "text of meta": (changed("UPDATE meta SET value = x'ff' WHERE key = 'specification'"), ("table meta",)),
    "no table": (changed("DROP TABLE trials"), ("no such table: trials",)),
    "trigger": (
        changed("CREATE TRIGGER t AFTER INSERT ON trials BEGIN DELETE FROM trials; END"),
        ("not of a campaign",),
    ),
    "pipe": (os.mkfifo, ("cannot be read: Is a pipe",)),
    "text": ("SQLite format 4", ("not a database",)),
    "empty": ("", ("not a database",)),
}
CASES = [
    Case(f"{how}, {name}", [*words], 2, says, {"c.sqlite": make})
    for name, (make, says) in DAMAGE.items()
    for how, words in (("export", ["campaign", "--export", "c.sqlite", "a.csv"]), ("info", ["info", "c.sqlite"]))
]
BESIDE = {
    f"watch with {beside} a pipe": Case(
        "", ["campaign", "--watch", "c.sqlite"], code, says, {"c.sqlite": sound, f"c.sqlite{beside}": os.mkfifo}
    )
    for beside, code, says in ((".lock", 0, ()), ("-wal", 2, ("Is a pipe",)), ("-journal", 2, ("Is a pipe",)))
}
CASES += [
    Case(
        "salvage alone", ["campaign", "--salvage", "--watch", "c.sqlite"], 2, ("--export FILE TO",), {"c.sqlite": sound}
    ),
    Case(
        "salvage of nothing",
        ["campaign", "--salvage", "--export", "c.sqlite", "a.csv"],
        2,
        ("table meta",),
        {"c.sqlite": DAMAGE["text of meta"][0]},
    ),
    Case(
        "analyse",
        ["campaign", "--analyse", "c.sqlite", "--out", ".", "--quiet"],
        2,
        ROW,
        {"c.sqlite": DAMAGE["outcome"][0]},
    ),
    *BESIDE.values(),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_damaged_campaign_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)


def test_what_is_sound_is_exported(tmp_path, capfd):
    from flipdiagram.cli.main import main

    cell("outcome", "'flew away'")(tmp_path / "c.sqlite")
    target = tmp_path / "a.csv"
    assert main(["campaign", "--export", str(tmp_path / "c.sqlite"), str(target), "--salvage"]) == 0
    out = " ".join(capfd.readouterr().out.split())
    assert "damaged flips left out: 1, the first: " in out and "column outcome = 'flew away'" in out
    assert len(target.read_text().splitlines()) == 1 + 2 * TRIALS - 1


def use(path):
    """What the commands do with a file; each an InputError or a result.  The number of results."""

    def resume():
        with open_to_write(path, META) as store:
            return store.done()

    def salvage():
        return export(path, path.with_name("b.csv"), [])

    uses = (lambda: analyse(load_dataset(path)), lambda: status_grid(path), salvage, resume)
    results = 0
    for one in uses:
        before = path.read_bytes()
        try:
            one()
            results += 1
        except InputError as error:
            assert str(path) in str(error) and len(str(error)) < 1000
            assert path.read_bytes() == before
    return results


examples = settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
VALUES = (
    None,
    0,
    -1,
    2**63 - 1,
    0.5,
    1e300,
    float("inf"),
    "",
    "x",
    "{}",
    "[]",
    "null",
    "[1e999, 1]",
    "[" * 500,
    b"",
    b"\xff",
    "\x00é",
)


@examples
@given(
    table=st.sampled_from(["trials"] * 6 + ["meta"]),
    column=st.sampled_from(COLUMNS),
    value=st.sampled_from(VALUES),
    at=st.integers(0, 2 * TRIALS - 1),
)
def test_any_cell_overwritten_gives_a_result_or_one_line(tmp_path, table, column, value, at):
    path = tmp_path / "campaign.sqlite"
    sound(path)
    where = "trial = ? AND architecture = ?" if table == "trials" else "key = ?"
    which = (at // 2, ("pd", "pd+ff+dob")[at % 2]) if table == "trials" else (sorted(META)[at % len(META)],)
    column = column if table == "trials" else "value"
    with suppress(sqlite3.IntegrityError):  # NULL where nothing may be missing
        execute(path, (f'UPDATE {table} SET "{column}" = ? WHERE {where}', (value, *which)))
    use(path)


@examples
@given(places=st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 7)), min_size=1, max_size=6))
def test_any_bits_flipped_give_a_result_or_one_line(tmp_path, places):
    data = bytearray(campaign())
    for at, bit in places:
        data[at % len(data)] ^= 1 << bit
    path = tmp_path / "campaign.sqlite"
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        use(path)


def test_a_sound_file_is_used_by_all(tmp_path):
    path = tmp_path / "campaign.sqlite"
    sound(path)
    assert use(path) == 4
    with open_to_read(path) as store:
        assert len(store.done()) == 2 * TRIALS
