"""Two engines over the worlds of one campaign: flights whose rule is known, so every count is."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from campaign.made_up import BY_ENGINE, QUIET
from ideal import IDEAL

from flipdiagram.campaign.checks import from_text
from flipdiagram.cli import main as cli
from flipdiagram.errors import InputError
from flipdiagram.results import info, open_result
from flipdiagram.studies.engines import run as engines
from flipdiagram.studies.engines.figures import write_figures
from flipdiagram.studies.engines.tables import tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("engines")
    (folder / "worlds.yaml").write_text(QUIET, encoding="utf-8")
    engines.run(IDEAL, folder, file=str(folder / "worlds.yaml"), jobs=2, work=BY_ENGINE)
    return folder


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_the_flips_that_differ_are_those_between_the_borders(summary):
    specification = from_text(QUIET)
    frictions = {k: specification.trial(k).overrides["object.friction"] for k in range(30)}
    for name, border in (("pd", 1.4), ("pd+ff+dob", 0.9)):
        between = [k for k, mu in frictions.items() if border < mu <= border + 0.1]
        found = [flip["trial"] for flip in summary["differ"] if flip["architecture"] == name]
        entry = summary["architectures"][name]
        assert between and found == between
        assert entry["counted"] == 30 and entry["equal"] == 30 - len(between)
        assert entry["turned_over"] == [sum(mu > border + d for mu in frictions.values()) for d in (0.0, 0.1)]
        assert entry["low"] < entry["rate"] == (30 - len(between)) / 30 < entry["high"]
        assert sum(row["flips"] for row in entry["outcomes"]) == 30
    for flip in summary["differ"]:
        assert flip["outcomes"] == ["turned over", "slid later"]  # as made_up has it
        assert flip["values"]["object.friction"] == frictions[flip["trial"]]


def test_the_parameter_that_tells_the_worlds_apart_comes_first():
    """The rule of one architecture alone, and many worlds: the mass plays no part."""
    import xarray as xr

    rng = np.random.default_rng(0)
    friction, mass = rng.uniform(0.5, 2.0, 400), rng.uniform(0.05, 0.07, 400)
    worlds = []
    for border in (0.7, 0.9):
        won = (friction > border)[:, None]
        outcome = np.where(won, "turned over", "slid later")
        worlds.append(
            xr.Dataset(
                {"outcome": (("trial", "architecture"), outcome), "success": (("trial", "architecture"), won)},
                coords={"trial": range(400), "architecture": ["pd"]}
                | {"object.friction": ("trial", friction), "object.mass": ("trial", mass)},
                attrs={"parameters": json.dumps(["object.mass", "object.friction"])},
            )
        )
    first, second = engines.agreement(*worlds)["parameters"]
    assert (first["name"], second["name"]) == ("object.friction", "object.mass")
    assert first["p_holm"] < 1e-6 < 0.01 < second["p_holm"] and 0.7 < first["other"] < 0.9 < first["equal"]
    equal = engines.agreement(worlds[0], worlds[0])
    assert equal["differ"] == [] and equal["parameters"] == [] and equal["architectures"]["pd"]["rate"] == 1.0


def test_tables_figure_and_readers_show_it(folder, summary):
    agreement, difference, parameters = tables(summary)
    assert [row[0] for row in agreement.rows] == ["`pd`", "`pd+ff+dob`", "all"]
    assert agreement.headings[1:5] == ["flips", "drake", "mujoco", "same verdict"]
    counts = np.array([[int(text) for text in row[1:5]] for row in agreement.rows])
    assert (counts[:2].sum(axis=0) == counts[2]).all() and counts[2, 0] == 60
    assert len(difference.rows) == len(summary["differ"]) and len(parameters.rows) == 2
    assert write_figures(summary, folder) == [] and (folder / "engines.png").stat().st_size > 10_000
    result = open_result(folder)
    assert list(result["agreement"]["architecture"].values) == ["pd", "pd+ff+dob"]
    assert ("kind", "engines") in info(folder).rows


def test_another_call_flies_nothing_again(folder, summary):
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("campaign.sqlite")}
    said = []
    engines.run(IDEAL, folder, file=str(folder / "worlds.yaml"), jobs=1, work=BY_ENGINE, progress=said.append)
    assert len(before) == 2 and any("drake: 60 flips, 0 of them to be flown" in text for text in said)
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["differ"] == summary["differ"]


def test_without_mujoco_one_line_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"needs MuJoCo: pip install 'flipdiagram\[mujoco\]'"):
        engines.run(IDEAL, tmp_path / "out", file="any.yaml")
    assert not (tmp_path / "out").exists()
    assert cli.main(["engines", str(tmp_path / "none.yaml"), "--out", str(tmp_path / "out")]) == 2
    assert "MuJoCo" in capsys.readouterr().err


def test_without_a_file_one_line_says_which(tmp_path, capsys):
    assert cli.main(["engines", "--out", str(tmp_path / "out")]) == 2
    assert "engines needs the FILE of a campaign" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_the_worlds_of_the_example_are_the_campaigns():
    examples = Path(__file__).parents[3] / "examples"
    ours, campaign = (yaml.safe_load((examples / f"{name}.yaml").read_text()) for name in ("engines", "campaign"))
    assert ours["vary"] == campaign["vary"] and ours["seed"] == campaign["seed"]
