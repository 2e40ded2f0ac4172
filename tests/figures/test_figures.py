import re
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from synthetic import DROP, RELEASE, recording, recordings

from flipdiagram.errors import InputError
from flipdiagram.figures import motion
from flipdiagram.figures.style import NAMES, STYLES, save
from flipdiagram.planning.plan import Plan
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.experiment.figures import plot_responses

OKABE_ITO = {"#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7"}


def a_plan():
    rng = np.random.default_rng(1)
    inputs = rng.uniform(-5, 5, (7, 3))
    v = np.vstack([np.zeros(3), np.cumsum(inputs, axis=0) * 0.1])
    x = np.vstack([np.zeros(3), np.cumsum(v[:-1] * 0.1 + inputs * 0.005, axis=0)])
    return Plan(
        sampling_time=0.1,
        n_contact=4,
        n_flight=2,
        n_brake=3,
        states=np.hstack([x, v]),
        inputs=inputs,
        cost=1.0,
        residual=0.0,
        max_sliding_angle=0.5,
        friction_angle=1.0,
        limit_use={},
        solver="none",
        iterations=1,
        solve_time=0.0,
    )


def all_axes():
    many = recordings()
    return {
        "13": [motion.plot_trajectories(many)],
        "14": motion.plot_velocities(many),
        "14 all": motion.plot_velocities(many, ARCHITECTURES),
        "15": motion.plot_accelerations(many),
        "sliding": [motion.plot_sliding_angle(many)],
        "torques": motion.plot_torques(many),
        "plan": motion.plot_plan(a_plan()),
    }


@pytest.fixture(scope="module")
def drawn():
    return all_axes()


def lines_named(axes, label):
    return [line for ax in axes for line in ax.get_lines() if line.get_label() == label]


def test_every_visible_label_has_a_unit(drawn):
    for name, axes in drawn.items():
        for ax in axes:
            assert re.search(r"\[.+\]$", ax.get_ylabel()), (name, ax.get_ylabel())
            shared = [other for other in axes if other.get_xlabel()]
            assert shared and all(re.search(r"\[.+\]$", other.get_xlabel()) for other in shared), name


def test_an_architecture_looks_the_same_in_every_figure(drawn):
    for architecture, label in NAMES.items():
        looks = {
            (line.get_color(), str(line.get_linestyle()), str(line._unscaled_dash_pattern), line.get_linewidth())
            for axes in drawn.values()
            for line in lines_named(axes, label)
        }
        assert len(looks) == 1, architecture
        assert {look[0] for look in looks} == {STYLES[architecture].color}


def test_colours_are_colour_blind_safe_and_each_has_a_line_of_its_own():
    styles = [STYLES[name] for name in ARCHITECTURES]
    assert {style.color for style in styles} <= OKABE_ITO and len({style.color for style in styles}) == 4
    assert len({str(style.linestyle) for style in styles}) == 4


def test_responses_show_command_and_the_two_controllers_of_the_paper(drawn):
    for axes in (drawn["14"], drawn["15"]):
        assert len(axes) == 3
        for ax in axes:
            shown = {line.get_label() for line in ax.get_lines()}
            assert shown == {"command", "PD + DOB", "PD + FF + DOB", "planned release"}
    (line,) = lines_named(drawn["14"][1:2], "PD + DOB")
    data = recording("pd+dob")
    np.testing.assert_array_equal(line.get_ydata(), data["v"].sel(time=line.get_xdata(), axis="z").values)


def test_acceleration_is_the_measured_one_and_the_command_the_planned_one(drawn):
    data = recording("pd+ff+dob")
    for label, signal in (("command", "a_cmd"), ("PD + FF + DOB", "a")):
        (line,) = lines_named(drawn["15"][2:], label)
        np.testing.assert_array_equal(line.get_ydata(), data[signal].sel(time=line.get_xdata(), axis="theta").values)


def test_paths_have_equal_scales_and_a_cross_where_the_block_was_dropped(drawn):
    (ax,) = drawn["13"]
    assert ax.get_aspect() == 1.0
    crosses = [line for line in ax.get_lines() if line.get_marker() == "X" and len(line.get_xdata())]
    assert len(crosses) == len(DROP)
    for (architecture, time), cross in zip(DROP.items(), crosses, strict=True):
        # the last sample with contact is the one before the drop
        at = recording(architecture)["x"].sel(time=time - 1e-3, method="nearest").values
        assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (at[0], at[1])
        assert cross.get_markerfacecolor() == STYLES[architecture].color


def test_a_block_that_stays_until_the_release_is_not_dropped():
    assert motion.dropped_at(recording("pd+ff+dob")) is None
    assert motion.dropped_at(recording("pd")) == pytest.approx(DROP["pd"] - 1e-3)


def test_sliding_angle_ends_with_the_contact(drawn):
    (ax,) = drawn["sliding"]
    for label, end in (("PD", DROP["pd"] - 1e-3), ("PD + DOB", RELEASE)):
        (line,) = lines_named([ax], label)
        assert line.get_xdata()[-1] == pytest.approx(end) and line.get_xdata()[0] == pytest.approx(0.0, abs=1e-9)
    (cone,) = lines_named([ax], "friction angle")
    assert cone.get_ydata()[0] == pytest.approx(61.73, abs=0.01)  # atan 1.86


def test_torques_have_a_panel_for_each_joint(drawn):
    assert [ax.get_ylabel() for ax in drawn["torques"]] == [f"$τ_{joint}$ [N m]" for joint in "SLURBT"]
    (line,) = lines_named(drawn["torques"][1:2], "PD")
    assert np.max(line.get_ydata()) == pytest.approx(120.0, rel=1e-3)


def test_torque_limits_are_lines_where_torque_comes_near_and_words_elsewhere():
    one = recording("pd+dob").copy(deep=True)  # its torques reach 20, 120, 40, 5, 8 and 2 N m
    one["tau"].attrs["limit"] = [30.0, 200.0, 400.0, 6.0, 9.0, 50.0]
    for k, (ax, limit) in enumerate(zip(motion.plot_torques({"pd+dob": one}), one["tau"].attrs["limit"], strict=True)):
        levels = {line.get_ydata()[0] for line in ax.get_lines() if len(line.get_ydata()) == 2}
        near = k not in (2, 5)
        assert levels == ({limit, -limit} if near else set())
        assert ax.get_title(loc="right") == ("" if near else f"limit ±{limit:g} N m")


def test_the_blade_is_drawn_where_it_touches_the_table():
    one = recording("pd").copy(deep=True)
    k = int(np.searchsorted(one["time"].values, 0.12))
    one["tool_pose"].values[k] = [np.cos(0.25), np.sin(0.25), 0, 0, 0.5, 0.01, one.attrs["table_height_m"] + 0.05]
    one.attrs["scenario"] += "\nforgotten:\n  field: 1\n"  # of an older version
    assert not motion.plot_trajectories({"pd": one}).patches
    one["contact_force"].loc[{"pair": "table-blade", "time": slice(0.1195, 0.2)}] = 5.0
    (blade,) = motion.plot_trajectories({"pd": one}).patches
    corners = blade.get_xy()[:-1]
    half = Scenario().tool.blade_width / 2
    top = corners[corners[:, 0].argmax()]
    np.testing.assert_allclose(top[0], 0.01 + half * np.cos(0.5), atol=3e-3)
    assert corners[:, 1].min() < one.attrs["table_height_m"] + 0.05 - half * np.sin(0.5) + 1e-9


def test_who_is_left_out_is_said_and_whoever_flew_alone_is_shown(drawn):
    assert drawn["14"][0].get_title(loc="right") == "left out, as in the paper: PD, PD + FF"
    assert drawn["14 all"][0].get_title(loc="right") == ""
    starts = {name: [recording(name)] for name in ARCHITECTURES}
    assert plot_responses(starts, "v").get_supxlabel() == "left out, as in the paper: PD, PD + FF"
    assert plot_responses({"pd": starts["pd"]}, "v").get_supxlabel() == ""
    alone = motion.plot_velocities({"pd": recording("pd")})
    assert lines_named(alone, "PD") and alone[0].get_title(loc="right") == ""


def test_plan_passes_through_its_samples(drawn):
    plan, axes = a_plan(), drawn["plan"]
    for row, values in enumerate((plan.states[:, :3], plan.states[:, 3:])):
        for column in range(3):
            (line,) = lines_named([axes[3 * row + column]], "tool")
            np.testing.assert_allclose(
                np.interp(plan.t[:-1], line.get_xdata(), line.get_ydata()), values[:-1, column], atol=2e-3
            )
    assert all(line.get_xdata()[0] == pytest.approx(0.6) for line in lines_named(axes, "touch-down"))


def test_a_part_of_the_architectures_can_be_drawn_into_given_axes():
    figure = Figure()
    axes = figure.subplots(3, 1)
    one = {"pd+dob": recording("pd+dob")}
    assert list(motion.plot_velocities(one, axes=list(axes))) == list(axes)
    assert motion.plot_trajectories(one, ax=axes[0]) is axes[0]
    assert not figure.legends and axes[0].get_legend() is not None
    assert "block dropped" not in {line.get_label() for line in axes[0].get_lines()}


def test_unknown_architecture_is_named_with_the_valid_ones():
    with pytest.raises(InputError, match=r"unknown architecture 'pid'; choose from pd, pd\+ff, pd\+dob, pd\+ff\+dob"):
        motion.plot_torques({"pid": recording("pd")})


def test_strip_has_each_picture_with_its_time():
    images = np.zeros((8, 20, 20, 3), np.uint8) + np.arange(8, dtype=np.uint8)[:, None, None, None]
    ax = motion.snapshot_strip(images, np.arange(8) / 10)
    assert [text.get_text() for text in ax.texts] == [f"0.{k}0 s" for k in range(8)]
    corners = [tuple(np.array(image.get_extent())[[0, 3]]) for image in ax.images]
    assert corners == [(26 * (k % 4), 26 * (k // 4)) for k in range(8)]
    assert [int(image.get_array()[0, 0, 0]) for image in ax.images] == list(range(8))


def test_saved_files_are_the_same_to_the_byte(tmp_path):
    for run in "ab":
        for name, axes in all_axes().items():
            if name in ("13", "15", "plan"):
                save(axes[0].figure, tmp_path / run / name)
    first = {path.name: path.read_bytes() for path in sorted((tmp_path / "a").iterdir())}
    second = {path.name: path.read_bytes() for path in sorted((tmp_path / "b").iterdir())}
    assert first == second
    assert sorted(first) == ["13.png", "13.svg", "15.png", "15.svg", "plan.png", "plan.svg"]
    assert all(b"dc:date" not in data and b"Matplotlib v" not in data for data in first.values())


def test_saving_replaces_whole_files_or_nothing(tmp_path):
    ax = motion.plot_sliding_angle({"pd": recording("pd")})
    (tmp_path / "figure.png").write_text("old")
    written = save(ax.figure, tmp_path / "figure")
    assert [path.name for path in written] == ["figure.png", "figure.svg"]
    assert written[0].read_bytes().startswith(b"\x89PNG")
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(InputError, match="cannot write"):
        save(ax.figure, tmp_path / "file" / "figure")
    broken = SimpleNamespace(savefig=lambda *a, **k: (_ for _ in ()).throw(RuntimeError("no")))
    with pytest.raises(RuntimeError):
        save(broken, tmp_path / "figure")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure.png", "figure.svg", "file"]
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
