"""Border maps and variations: every cell is a valid flip, the border lies where the verdict changes, cells come again."""

import dataclasses
import json

import numpy as np
import pytest
from ideal import IDEAL
from matplotlib.figure import Figure

from flipdiagram.cli import main as cli
from flipdiagram.cli.options import split_overrides
from flipdiagram.errors import InputError
from flipdiagram.flips.outcome import Outcome
from flipdiagram.planning import plan_motion
from flipdiagram.plants.joint_friction import joint_friction
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.scenario.yaml_reader import parse_value
from flipdiagram.simulation import metrics
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.simulate import simulate
from flipdiagram.studies.borders import run as borders
from flipdiagram.studies.borders.figures import FAILED, _border, plot_map
from flipdiagram.studies.borders.maps import LAB_INERTIA, maps_of
from flipdiagram.studies.borders.run import cell, map_summary, variation_summary
from flipdiagram.studies.borders.tables import border_grid, variation_grid
from flipdiagram.studies.borders.variations import variations_of

NAMES = ["disturbance", "payload", "clearance", "gains", "cone", "inertia", "sensing"]
OTHER = IDEAL.with_overrides(
    {
        "controller.k_p": 100.0,
        "controller.k_v": 15.0,
        "controller.g_dis": 50.0,
        "object.friction": 1.0,
        "controller.nominal_inertia": (1.0,) * 6,
        "controller.nominal_inertia_scale": 2.0,
    }
)


def measured(name="pd", **changes):
    numbers = dict(
        architecture=name,
        start_y_m=0.0,
        success=True,
        failure=None,
        touchdown=None,
        position_rmse_m=0.004,
        angle_rmse_rad=0.01,
        acceleration_rmse_m_s2=2.0,
        max_torque_Nm=[10.0, 50.0, 8.0, 2.0, 1.0, 1.0],
        max_slip_m=0.001,
        max_lift_off_m=0.0,
        release_time_s=0.5,
        release_angle_rad=1.6,
        contact_after_release_s=0.0,
        velocity_delay_s=0.01,
        endpoint_vibration_m_s=0.008,
    )
    others = dict.fromkeys((field.name for field in dataclasses.fields(FlipMetrics)), 0.0)
    return FlipMetrics(**(others | numbers | changes))


WON = Outcome(measured(), None)
DROPPED = Outcome(measured(success=False, failure="dropped at 0.3 s"), "dropped at 0.3 s")
NO_PLAN = Outcome(None, "no plan: too far")
DIVERGED = Outcome(None, "diverged: not finite")


@pytest.mark.parametrize("resolution", [2, 3, None])
@pytest.mark.parametrize("scenario", [IDEAL, OTHER], ids=["default", "other"])
def test_every_cell_of_every_map_is_a_valid_scenario_of_its_own(resolution, scenario):
    maps = maps_of(scenario, resolution)
    assert list(maps) == NAMES
    for drawn in maps.values():
        assert len(drawn.x.values) == len(drawn.x.overrides) >= 2
        keys = set()
        for j in range(len(drawn.y.values)):
            for i in range(len(drawn.x.values)):
                flip = cell(scenario, drawn, i, j, "pd+dob")
                keys.add(flip.key)
                for path, value in {**drawn.x.overrides[i], **drawn.y.overrides[j]}.items():
                    section, name = path.split(".")
                    assert getattr(getattr(flip.scenario, section), name) == value
        assert len(keys) == len(drawn.x.values) * len(drawn.y.values), f"{drawn.name}: two cells are the same flip"
        # neither axis takes back what the other sets
        assert not drawn.x.overrides[0].keys() & drawn.y.overrides[0].keys()


def test_no_cell_has_a_friction_that_would_chatter():
    from flipdiagram.robot.parts import arm_of

    arm = arm_of(IDEAL)
    for resolution in (None, 9):
        for fields in maps_of(IDEAL, resolution)["disturbance"].y.overrides:
            joint_friction(IDEAL.with_overrides(fields), arm)  # raises where it would


def test_values_stand_for_what_they_set():
    maps = maps_of(IDEAL)
    assert [fields["controller.gravity_compensation"] for fields in maps["disturbance"].x.overrides] == pytest.approx(
        [1 - value for value in maps["disturbance"].x.values]
    )
    for fields in maps["gains"].x.overrides:  # the damping ratio of the default, 120 / (2 √350)
        assert fields["controller.k_v"] / (2 * fields["controller.k_p"] ** 0.5) == pytest.approx(3.2071, rel=1e-4)
    assert maps["cone"].y.values[0] < 0 < maps["cone"].y.values[-1] < 1
    assert maps["sensing"].x.values[-1] == "exact"
    assert maps["sensing"].x.overrides[-1] == {"sensors.velocity_cutoff": None}
    assert all(isinstance(fields["sensors.delay"], int) for fields in maps["sensing"].y.overrides)
    assert maps["disturbance"].x.values == (0.0, 0.04, 0.16, 0.36, 0.64, 1.0)


def test_the_nominal_inertia_is_that_of_the_label_whatever_the_scenario_has():
    drawn = maps_of(OTHER)["inertia"]
    for value, fields in zip(drawn.x.values, drawn.x.overrides, strict=True):
        controller = OTHER.with_overrides(fields).controller
        wanted = (LAB_INERTIA, 1.0) if value == "lab" else (None, value)
        assert (controller.nominal_inertia, controller.nominal_inertia_scale) == wanted


def test_a_finer_map_has_as_many_points_as_asked_for():
    for drawn in maps_of(IDEAL, 8).values():
        assert len(drawn.x.values) - (drawn.x.values[-1] in ("lab", "exact")) == 8
        assert len(drawn.y.values) == 8
        for axis in (drawn.x, drawn.y):
            numbers = [value for value in axis.values if not isinstance(value, str)]
            assert numbers == sorted(set(numbers))


def test_what_does_not_exist_is_refused_before_anything_is_written(tmp_path):
    for settings in ({"resolution": 1}, {"maps": ["disturbance", "nonsense"]}):
        with pytest.raises(InputError, match="resolution = 1|unknown map 'nonsense'; choose from disturbance"):
            borders.run(IDEAL, tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("seed", range(4))
def test_the_border_is_drawn_between_cells_that_differ_and_nowhere_else(seed):
    success = np.random.default_rng(seed).random((4, 5)) < 0.5
    ax = Figure().subplots()
    _border(ax, success)
    drawn = {tuple(sorted(zip(line.get_xdata(), line.get_ydata(), strict=True))) for line in ax.lines}
    expected = set()
    for (j, i), won in np.ndenumerate(success):
        for dj, di in ((0, 1), (1, 0)):
            if j + dj < 4 and i + di < 5 and success[j + dj, i + di] != won:
                middle = np.array([i + di / 2, j + dj / 2])
                along = np.array([dj / 2, di / 2])
                expected.add(tuple(sorted((tuple(middle - along), tuple(middle + along)))))
    assert drawn == expected and len(ax.lines) == len(expected)


def summary_of(cells, variations=(), varied=None):
    a_map = maps_of(IDEAL, 2)["clearance"]
    varied = varied or {name: [] for name in ARCHITECTURES}
    maps = [map_summary(a_map, {name: cells for name in ARCHITECTURES})]
    return {"maps": maps, "variations": variation_summary(list(variations), varied)}


def test_a_map_shows_errors_failures_and_missing_plans_apart():
    summary = summary_of([[WON, DROPPED], [NO_PLAN, DIVERGED]])
    cells = summary["maps"][0]["architectures"]["pd"]
    assert cells["success"] == [[True, False], [False, False]]
    assert cells["failure"] == [[None, "dropped at 0.3 s"], ["no plan: too far", "diverged: not finite"]]
    assert cells["position_rmse_m"] == [[0.004, 0.004], [None, None]]
    figure = plot_map(summary["maps"][0])
    panel = figure.axes[0]
    marks = {tuple(map(int, text.get_position())): text.get_text() for text in panel.texts}
    assert marks == {(1, 0): "×", (0, 1): "–", (1, 1): "×"}
    assert len(panel.lines) == 2  # around the one cell that succeeds, inside the map
    image = panel.images[0].get_array()
    assert image[0, 0] == pytest.approx(0.4)  # [cm]
    assert np.ma.getmaskarray(np.ma.masked_invalid(image)).sum() == 3
    assert len(panel.patches) == 1 and FAILED != "white"
    assert border_grid(summary).rows == [
        [
            "Distance from the table",
            summary["maps"][0]["x"]["label"] + " × " + summary["maps"][0]["y"]["label"],
            "4",
            "1",
            "1",
            "1",
            "1",
        ]
    ]
    assert not border_grid({"maps": []}).rows


def test_a_map_where_nothing_works_can_be_drawn():
    figure = plot_map(summary_of([[NO_PLAN] * 2] * 2)["maps"][0])
    assert not figure.axes[0].lines


def test_variations_change_one_thing_each_and_are_all_valid():
    found = list(variations_of(IDEAL))
    assert found[0].overrides == {} and found[0].group == "scenario"
    keys = [json.dumps(IDEAL.with_overrides(v.overrides).model_dump(mode="json")) for v in found]
    assert len(set(keys)) == len(keys) == len({(v.group, v.name) for v in found})
    names = {v.name for v in found}
    assert {
        "0.25 ms",
        "0.5 ms",
        "point, sap",
        "hydroelastic, lagged",
        "every link +30 %",
        "rotor and gear of T -30 %",
    } <= names
    assert not {"1 ms", "hydroelastic, similar"} & names  # the scenario as it is
    assert sum(v.group == "inertia" for v in found) == 2 * 2 * 7


def test_drakes_contact_is_not_varied_where_mujoco_flies():
    groups = {v.group for v in variations_of(IDEAL.with_overrides({"simulation.engine": "mujoco"}))}
    assert groups == {"scenario", "step", "inertia"}


@pytest.mark.parametrize("field", ["link_inertia_scale", "reflected_inertia_scale"])
def test_inertias_are_varied_around_the_scenarios_own(field):
    scenario = IDEAL.with_overrides({f"arm.{field}": 2.0, f"arm.{field}s": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)})
    mine = [v for v in variations_of(scenario) if any(path.startswith(f"arm.{field}") for path in v.overrides)]
    assert mine[0].overrides == {f"arm.{field}": pytest.approx(1.4)}
    assert mine[3].overrides == {f"arm.{field}s": pytest.approx((1.0, 2.0, 2.1, 4.0, 5.0, 6.0))}
    assert mine[-1].overrides == {f"arm.{field}s": pytest.approx((1.0, 2.0, 3.0, 4.0, 5.0, 7.8))}


def test_a_verdict_that_differs_from_the_scenarios_own_is_fragile():
    variations = list(variations_of(IDEAL))[:3]
    varied = {
        "pd": [DROPPED, DROPPED, WON],
        "pd+ff": [DROPPED, NO_PLAN, DIVERGED],  # lost in another way is lost all the same
        "pd+dob": [WON, WON, DROPPED],
        "pd+ff+dob": [WON, WON, WON],
    }
    summary = summary_of([[WON] * 2] * 2, variations, varied)
    assert [row["fragile"] for row in summary["variations"]] == [[], [], ["pd", "pd+dob"]]
    grid = variation_grid(summary)
    assert [row[-1] for row in grid.rows] == ["–", "–", "`pd`, `pd+dob`"]
    assert [row[2] for row in grid.rows] == ["no no yes yes", "no no yes yes", "yes no no yes"]
    assert grid.rows[0][3:7] == ["0.40", "2.00", "1.0", "50.0"]
    varied["pd+ff+dob"] = [WON, NO_PLAN, DIVERGED]
    grid = variation_grid(summary_of([[WON] * 2] * 2, variations, varied))
    assert grid.rows[1][3:7] == ["–"] * 4


SHORT = ["--simulation.hold_time", "0.05", "--simulation.settle_time", "0.05"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """One map of two by two cells, as a user asks for it."""
    out = tmp_path_factory.mktemp("borders")
    words = ["borders", "--maps", "gains", "--resolution", "2", "--out", str(out), "--quiet", *SHORT]
    assert cli.main(words) == 0
    return out, json.loads((out / "summary.json").read_text())


def test_one_map_end_to_end(flown):
    out, summary = flown
    assert summary["schema"] == "flipdiagram/borders/1"
    assert list(summary)[:3] == ["schema", "versions", "scenario"] and summary["quick"] is False
    assert [drawn["name"] for drawn in summary["maps"]] == ["gains"] and summary["variations"] == []
    assert {path.name for path in out.iterdir()} >= {"map_gains.png", "map_gains.svg", "summary.json", "runs.sqlite"}
    cells = summary["maps"][0]["architectures"]
    # without an observer its cut-off changes nothing: both rows are the same to the bit
    for name in ("pd", "pd+ff"):
        assert cells[name]["position_rmse_m"][0] == cells[name]["position_rmse_m"][1]
    assert cells["pd+dob"]["position_rmse_m"][0] != cells["pd+dob"]["position_rmse_m"][1]


def test_a_cell_flown_alone_by_its_overrides_gives_the_same_bits(flown):
    """As options of `flipdiagram flip`: texts on a command line, parsed as the command parses them."""
    _, summary = flown
    drawn = summary["maps"][0]
    i, j, name = 1, 0, "pd+ff+dob"
    fields = {**drawn["x"]["overrides"][i], **drawn["y"]["overrides"][j]}
    words = [word for path, value in fields.items() for word in (f"--{path}", json.dumps(value))]
    rest, texts = split_overrides([*SHORT, *words])
    assert not rest
    scenario = Scenario().with_overrides({path: parse_value(text, path) for path, text in texts.items()})
    found = metrics.measure(simulate(scenario, name, plan_motion(scenario)).recording)
    shown = drawn["architectures"][name]
    assert shown["success"][j][i] == found.success
    for number in borders.NUMBERS:
        assert shown[number][j][i] == getattr(found, number), number
