"""The maps of the pancake: flips whose rule is known, so every cell is; one real flip and what is measured of it."""

import json
import math
import sys

import numpy as np
import pancakes
import pytest

from flipdiagram import Scenario, simulate
from flipdiagram.cli import main as cli
from flipdiagram.errors import InputError
from flipdiagram.results import info, open_result
from flipdiagram.simulation.bending import bending
from flipdiagram.studies.pancake import run as study
from flipdiagram.studies.pancake.figures import plot_engines, plot_map, write_figures
from flipdiagram.studies.pancake.second_engine import agreement
from flipdiagram.studies.pancake.tables import map_grid, tables
from flipdiagram.studies.pancake.worlds import FRICTIONS, MODULI, as_pancake, worlds_of

SETTINGS = {"moduli": [1e4, 1e5], "frictions": [0.3, 0.45, 0.7], "work": pancakes.WORK, "replay": pancakes.REPLAY}
PANCAKE = Scenario().with_overrides({"object.kind": "pancake"})


def fly(folder, scenario=PANCAKE, **settings):
    given = {"architectures": ["pd", "pd+ff+dob"], "jobs": 1, **SETTINGS, **settings}
    study.run(scenario, folder, **given)
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pancake")
    pytest.importorskip("mujoco")
    fly(folder)
    return folder


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def outcomes(summary, name="outcome"):
    return {(r["architecture"], r["friction"], r["youngs_modulus_Pa"]): r[name] for r in summary["runs"]}


def test_every_cell_is_the_flip_of_its_world(summary):
    found = outcomes(summary)
    assert len(found) == len(summary["runs"]) == 12
    won = {key for key, outcome in found.items() if outcome == "turned over"}
    assert won == {("pd+ff+dob", mu, E) for mu, E in ((0.45, 1e5), (0.7, 1e5), (0.7, 1e4))}
    assert set(found.values()) == {"turned over", "folded"}
    for run in summary["runs"]:
        assert run["overrides"] == {
            "object.youngs_modulus": run["youngs_modulus_Pa"],
            "object.friction": run["friction"],
        }
        assert run["largest_deformation_energy_J"] == 0.01 and run["real_time_factor"] == 0.5
        assert run["success"] == (run["failure"] is None)
    assert summary["scenario"]["object"]["kind"] == "pancake"


def test_the_second_engine_is_told_beside_the_first(summary):
    rows = summary["second_engine"]
    assert len(rows) == 12 and all(row["judged"] for row in rows)
    differ = [row for row in rows if row["drake"]["success"] != row["mujoco"]["success"]]
    assert [(row["friction"], row["youngs_modulus_Pa"]) for row in differ] == [(0.45, 1e5), (0.7, 1e4)]
    assert summary["agreement"].items() >= {"flips": 12, "same": 10, "both": 1, "only_drake": 2, "neither": 9}.items()
    assert summary["agreement"]["low"] < 10 / 12 < summary["agreement"]["high"]
    assert rows[0]["difference"] == {
        "touchdown_time_s": pytest.approx(0.003),
        "touchdown_angle_rad": pytest.approx(-0.003),
        "final_centre_m": pytest.approx(0.003),
    }
    lost = {"drake": {"success": True}, "mujoco": {"success": False}, "judged": False}
    assert agreement([lost])["flips"] == 0 and agreement([lost])["rate"] is None


def test_tables_figures_and_readers_show_it(folder, summary):
    ended, cells, planned, pairs, said, apart, differ, quick = tables(summary)
    assert ended.rows[1][:5] == ["`pd+ff+dob`", "6", "3", "3", "6"] and quick is None
    assert cells.headings[3:] == ["E = 10 kPa", "E = 100 kPa"]
    assert cells.rows[4] == ["`pd+ff+dob`", "12", "0.45", "folded", "turned over"]
    assert pairs.rows[0][1:] == ["1", "2"] and "10 of 12 flips, 83 %" in said and len(differ.rows) == 2
    assert planned.rows[0] == ["12", "0.3", "4.0", "2.90"]
    assert apart.rows[0] == ["turned over in both", "1", "3.0 (3.0)", "0.003 (0.003)", "3.0 (3.0)"]
    assert write_figures(summary, folder) == []
    assert all((folder / f"{name}.png").stat().st_size > 10_000 for name in ("map", "engines"))
    result = open_result(folder)
    place = {"architecture": "pd+ff+dob", "friction": 0.45, "youngs_modulus_Pa": 1e5, "thickness_m": 0.012}
    assert bool(result["runs"]["success"].sel(place)) and not bool(result["second_engine"]["mujoco"].sel(place))
    assert result["runs"]["largest_deformation_energy_J"].attrs["units"] == "J"
    rows = dict(info(folder).rows)
    assert rows["pancake, pd+ff+dob"].startswith("3 of 6 turned over: folded")
    assert rows["second engine"] == "MuJoCo gives the same verdict in 10 of 12 runs"


def test_the_map_is_read_without_colours(summary):
    letters = [text.get_text() for text in plot_map(summary).axes[1].texts]
    assert letters == ["F", "F", "F", "T", "T", "T"]
    assert [text.get_text() for text in plot_engines(summary).axes[1].texts][2:4] == ["F F", "T F"]


def test_another_call_flies_nothing_again(folder, summary):
    said = []
    again = fly(folder, progress=said.append)
    assert not any("to be run" in text for text in said) and again["runs"] == summary["runs"]
    assert again["second_engine"] == summary["second_engine"]


def test_without_mujoco_the_map_is_made_and_one_line_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    moduli = [pancakes.DIVERGES, 1e5]
    summary = fly(tmp_path, Scenario(), moduli=moduli, frictions=[0.7, 0.7], architectures=["pd+dob"])
    assert [run["outcome"] for run in summary["runs"]] == ["diverged", "turned over"]
    assert summary["runs"][0]["failure"].startswith("diverged: ") and "recording" not in summary["runs"][0]
    assert any("pip install" in str(part) for part in tables(summary)[2:])
    assert write_figures(summary, tmp_path) == [] and not (tmp_path / "engines.png").exists()
    assert list(open_result(tmp_path)) == ["runs"]


def test_a_thicker_pancake_is_as_dense_and_each_world_comes_once():
    base = as_pancake(Scenario())
    worlds = worlds_of(base, [1e5, 5e4, 1e5], [0.6], [0.012, 0.024])
    assert [(w.thickness, w.youngs_modulus) for w in worlds] == [(t, E) for t in (0.012, 0.024) for E in (1e5, 5e4)]
    mass = [world.flip(base, "pd").scenario.object.mass for world in worlds]
    assert mass == [0.1, 0.1, 0.2, 0.2]
    assert len({world.flip(base, "pd").recording for world in worlds}) == 4
    assert as_pancake(PANCAKE) is PANCAKE and as_pancake(Scenario()) == PANCAKE
    grid = map_grid(
        {"architectures": ["pd"], "runs": [w.as_dict() | {"architecture": "pd", "outcome": "folded"} for w in worlds]}
    )
    assert [row[1] for row in grid.rows] == ["12", "24"] and len(worlds_of(base, MODULI, FRICTIONS, [0.012])) == 16


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--moduli", "0"], "object.youngs_modulus"),
        (["--moduli", "5e3"], "object.refinement"),
        (["--frictions", "-1"], "object.friction"),
        (["--thicknesses", "nan"], "object.thickness"),
        (["--object.kind", "pancake", "--simulation.engine", "mujoco"], "drake where object.kind is pancake"),
    ],
)
def test_bad_input_ends_with_one_line_before_anything_is_flown(words, said, tmp_path, capsys):
    assert cli.main(["pancake", *words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not (tmp_path / "out" / "summary.json").exists()


@pytest.fixture(scope="module")
def flip():
    """A coarse, stiff pancake of little friction, cut short: it leaves the blade and does not land."""
    short = {"object.refinement": 1, "object.youngs_modulus": 1e6, "simulation.settle_time": 0.0}
    return simulate(PANCAKE.with_overrides(short))


def test_what_is_measured_of_how_it_bent(flip):
    data, found = flip.recording, bending(flip.recording)
    assert found["largest_deformation_energy_J"] == float(data["deformation_energy"].max()) > 0
    assert 0 <= found["largest_overhang"] < 0.5 and 0 <= found["turned_share"] <= 1
    last = data["vertices"].values[-1]
    assert math.hypot(found["final_x_m"] - last[:, 0].mean(), found["final_y_m"] - last[:, 1].mean()) < 0.01
    after = data.copy()
    after["overhang"] = after["overhang"].where(after["frame_time"] < 0, 1.0)
    assert bending(after)["largest_overhang"] == 1.0
    after["overhang"] = after["overhang"] * np.nan
    assert math.isnan(bending(after)["largest_overhang"])
    assert bending(data.drop_vars("vertices")) is None


def test_a_real_flip_keeps_how_it_bent(flip, monkeypatch):
    from flipdiagram.flips.flight import fly as fly_one

    outcome = fly_one(PANCAKE, "pd+ff+dob", flip.plan, simulated=lambda: flip)
    assert outcome.plan["bending"] == bending(flip.recording) | {"real_time_factor": flip.real_time_factor}


def test_an_unknown_architecture_is_refused(tmp_path):
    with pytest.raises(InputError, match="architecture"):
        fly(tmp_path, architectures=["pid"])
