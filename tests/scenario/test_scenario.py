import math
import re
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flipdiagram.errors import InputError, ScenarioError
from flipdiagram.scenario.scenario import (
    ARCHITECTURES,
    Controller,
    Scenario,
    farthest,
    field_paths,
    from_mapping,
    from_yaml,
    load_scenario,
)
from flipdiagram.scenario.text import describe_valid, fields_of, spans_of, unit_of
from flipdiagram.scenario.yaml_reader import line_of, parse_value, read_mapping


def test_the_defaults_are_the_table_of_the_paper():
    scenario = Scenario()
    assert (scenario.planner.alpha, scenario.planner.beta) == (20.0, 0.5)
    assert (scenario.controller.k_p, scenario.controller.k_v, scenario.controller.g_dis) == (350.0, 120.0, 12.6)
    assert scenario.controller.period == 0.001
    block = scenario.object
    assert (block.length, block.width, block.thickness, block.mass) == (0.065, 0.062, 0.010, 0.061)
    assert block.friction == 1.86
    assert scenario.task.start_y == 0.0
    assert ARCHITECTURES == ("pd", "pd+ff", "pd+dob", "pd+ff+dob")


def test_a_scenario_cannot_be_changed_in_place():
    with pytest.raises(ScenarioError, match=r"mass = 1.0 cannot be set: .* with_overrides"):
        Scenario().object.mass = 1.0


BAD_IN_PYTHON = {
    "unknown field": (
        lambda: Scenario(controller={"kp": 3}),
        "'controller.kp' does not exist; did you mean 'controller.k_p'?",
    ),
    "bad value": (
        lambda: Scenario(object={"mass": -1.0}),
        "'object.mass' = -1.0 is not valid; valid is a finite number from",
    ),
    "unknown section": (lambda: Scenario(controler={}), "did you mean 'controller'?"),
    "no mapping": (lambda: Scenario(controller=3), "section 'controller' = 3 is no mapping"),
    "fields that contradict": (
        lambda: Scenario(simulation={"step": 0.0003}),
        "'simulation.step' = 0.0003 is not valid",
    ),
    "a section alone": (lambda: Controller(kp=3), "'Controller.kp' does not exist; did you mean 'Controller.k_p'?"),
    "a value of it": (
        lambda: Controller(k_p=-3.0),
        "'Controller.k_p' = -3.0 is not valid; valid is a finite number from 0",
    ),
    "nested override": (lambda: Scenario().with_overrides({"controller": {"kp": 3}}), "did you mean 'controller.k_p'?"),
    "override of a section": (
        lambda: Scenario().with_overrides({"controller": 3}),
        "'controller' is a section, no field",
    ),
}


@pytest.mark.parametrize("name", BAD_IN_PYTHON)
def test_python_gets_the_same_one_line_errors_as_a_file(name):
    make, text = BAD_IN_PYTHON[name]
    with pytest.raises(ScenarioError) as caught:
        make()
    assert text in str(caught.value) and "\n" not in str(caught.value)
    assert caught.value.__context__ is None or caught.value.__suppress_context__  # no trace of pydantic


def test_nested_overrides_and_arguments_are_the_same_as_paths():
    wanted = Scenario().with_overrides({"controller.k_p": 400.0, "controller.k_v": 90.0, "object.mass": 0.1})
    nested = {"controller": {"k_p": 400.0, "k_v": 90.0}, "object.mass": 0.1}
    assert Scenario().with_overrides(nested) == wanted
    assert Scenario(controller={"k_p": 400.0, "k_v": 90.0}, object={"mass": 0.1}) == wanted
    assert Scenario().with_overrides(wanted.changes()) == wanted


def test_a_scenario_shows_what_is_not_at_its_default():
    assert repr(Scenario()) == "Scenario()" and "no fields" in Scenario()._repr_html_()
    changed = Scenario().with_overrides({"controller.k_p": 400.0, "arm.file": "<a>.urdf"})
    assert str(changed) == "Scenario(arm.file='<a>.urdf', controller.k_p=400.0)"
    assert "&lt;a&gt;.urdf" in changed._repr_html_() and "350.0" in changed._repr_html_()
    many = changed.with_overrides(
        {f"arm.{name}_scale": 1.1 for name in ("speed", "torque", "link_inertia", "reflected_inertia")}
    )
    assert repr(many).endswith(", … 2 more)") and len(repr(many)) < 160


def test_every_field_says_what_it_is_and_in_which_unit():
    for path, field in fields_of(Scenario).items():
        assert field.description and not field.description.endswith("]"), path
        assert unit_of(field) or describe_valid(field).startswith(("one of", "a text")), path


def test_every_number_has_a_lowest_and_a_highest_value_and_says_both():
    text = Scenario().to_yaml(comments=True)
    for path, field in fields_of(Scenario).items():
        spans = spans_of(field)
        assert spans or not re.search(r"\b(int|float)\b", repr(field.annotation)), path
        for low, high in spans:
            assert -math.inf < low < high < math.inf, path
            assert f"{low:.10g} to {high:.10g}]" in text, path


def test_the_printed_scenario_explains_its_marks_and_lists_the_choices():
    text = Scenario().to_yaml(comments=True)
    legend, _, fields = text.partition("\narm:\n")
    used = {mark[0] for mark in re.findall(r"\(([pHMLoc])(?:: [^)]*)?\)", fields)}
    assert used == {mark for mark in "pHMLoc" if f"# ({mark}" in legend} - {"M"} and legend.count("\n") < 10
    for field in fields_of(Scenario).values():
        if choices := [value for value in get_args(field.annotation) if isinstance(value, str)]:
            assert f"[{' or '.join(choices)}]" in fields
    assert from_yaml(text) == Scenario()


# Each row: YAML, then what its one line must contain.
BAD = {
    "unknown section": ("objekt: {mass: 1}", "'objekt'", "did you mean 'object'?", "planner"),
    "unknown key": ("controller: {kp: 1}", "'controller.kp'", "did you mean 'controller.k_p'?", "controller.g_dis"),
    "key without its section": ("g_dis: 30", "'g_dis'", "did you mean 'controller.g_dis'?"),
    "key that is no text": ("object: {1: 2}", "'object.1'", "object.mass"),
    "wrong type": ("object: {mass: heavy}", "'object.mass' = 'heavy'", "a finite number from 0.0001 to 50 [kg]"),
    "unknown engine": ("simulation: {engine: bullet}", "'simulation.engine' = 'bullet'", "drake", "mujoco"),
    "quoted number": ("object: {mass: '0.061'}", "'object.mass' = '0.061'", "a finite number from 0.0001 to 50 [kg]"),
    "yes where a number stands": (
        "object: {mass: true}",
        "'object.mass' = true",
        "a finite number from 0.0001 to 50 [kg]",
    ),
    "null where a number stands": ("object: {mass: null}", "'object.mass' = null", "a finite number from 0.0001 to 50"),
    "negative mass": ("object: {mass: -0.061}", "'object.mass' = -0.061", "a finite number from 0.0001 to 50 [kg]"),
    "zero period": ("controller: {period: 0}", "'controller.period' = 0", "a finite number from 1e-05 to 0.1 [s]"),
    "not a number": ("object: {mass: .nan}", "'object.mass' = nan", "a finite number from 0.0001 to 50 [kg]"),
    "infinite": ("controller: {k_p: .inf}", "'controller.k_p' = inf", "a finite number from 0 to 100000000 [1/s2]"),
    "fraction of 1": ("planner: {friction_margin: 1}", "'planner.friction_margin' = 1", "below 1"),
    "optional number": (
        "sensors: {velocity_cutoff: -1}",
        "= -1",
        "a finite number from 0.1 to 100000 [rad/s], or null",
    ),
    "whole number": ("planner: {max_iterations: 2.5}", "= 2.5", "a whole number from 1 to 1000"),
    "pair too long": (
        "planner: {contact_samples: [1, 2, 3]}",
        "= [1, 2, 3]",
        "a list of 2 whole numbers from 2 to 400 [samples]",
    ),
    "pair reversed": ("planner: {contact_samples: [30, 20]}", "= (30, 20)", "fewest and most"),
    "start outside": ("task: {start_y: 0.5}", "'task.start_y' = 0.5", "inside the workspace, -0.35 to 0.35 [m]"),
    "workspace empty": ("task: {workspace_x: [1, 0]}", "'task.workspace_x' = (1.0, 0.0)", "low < high [m]"),
    "target outside": ("task: {target_y: 9}", "'task.target_y' = 9.0", "inside the workspace"),
    "unknown choice": ("planner: {solver: cplex}", "'planner.solver' = 'cplex'", "clarabel, osqp"),
    "inertia of two joints": ("controller: {nominal_inertia: [1, 2]}", "= (1.0, 2.0)", "each joint S L U R B T"),
    "inertia not positive": (
        "controller: {nominal_inertia: [1, 1, 1, 1, 1, 0]}",
        "a list of finite numbers from 1e-07 to 10000 [kg m2]",
    ),
    "inertia no list": (
        "controller: {nominal_inertia: 3}",
        "= 3",
        "a list of finite numbers from 1e-07 to 10000 [kg m2], at least one, or null",
    ),
    "step between": ("simulation: {step: 0.0007}", "'simulation.step' = 0.0007", "0.001 [s] divided by 1, 2, 4, 8"),
    "block wider than the blade": ("object: {length: 0.2}", "'object.length' = 0.2", "tool.blade_width = 0.09"),
    "section no mapping": ("task: 3", "section 'task' = 3 is no mapping", "start_x, start_y"),
    "no mapping": ("[1, 2]", "= [1, 2] is no mapping", "`flipdiagram scenario`"),
    "one text": ("hello", "= 'hello' is no mapping"),
    "duplicate key": ("object:\n  mass: 1\n  mass: 2", "'object.mass' stands twice, on lines 2 and 3"),
    "duplicate section": ("object: {mass: 1}\nobject: {}", "'object' stands twice, on lines 1 and 2"),
    "unknown friction": ("joint_friction: {model: lugre}", "'joint_friction.model' = 'lugre'", "tanh, elasto-plastic"),
    "breakaway below sliding": ("joint_friction: {breakaway: 0.9}", "= 0.9", "a finite number from 1 to 10"),
    "Stribeck velocity zero": (
        "joint_friction: {stribeck_velocity: 0}",
        "= 0",
        "a finite number from 0.0001 to 10 [rad/s]",
    ),
    "presliding zero": ("joint_friction: {presliding: 0}", "= 0", "a finite number from 1e-08 to 0.1 [rad]"),
    "unknown joints": ("joints: {model: soft}", "'joints.model' = 'soft'", "rigid, elastic"),
    "stiffness not positive": (
        "joints: {stiffness: [1, 1, 1, 1, 1, 0]}",
        "'joints.stiffness'",
        "a list of finite numbers from 1 to 100000000",
    ),
    "stiffness of two joints": (
        "joints: {stiffness: [1, 2]}",
        "'joints.stiffness' = (1.0, 2.0)",
        "each joint S L U R B T",
    ),
    "no stiffness": (
        "joints: {stiffness_scale: 0}",
        "'joints.stiffness_scale' = 0",
        "a finite number from 0.01 to 1000",
    ),
    "damping not positive": (
        "joints: {damping: [-1]}",
        "'joints.damping' = [-1]",
        "a list of finite numbers from 1e-06 to 100000",
    ),
    "elastic with tamsi": (
        "joints: {model: elastic}\nsimulation: {contact_approximation: tamsi}",
        "'simulation.contact_approximation' = 'tamsi'",
        "sap, lagged or similar",
    ),
    "ripple above the torque": ("drive: {ripple: 1.5}", "'drive.ripple' = 1.5", "from 0 to 1"),
    "no ripple cycles": (
        "drive: {ripple_cycles: 0}",
        "'drive.ripple_cycles' = 0",
        "a finite number from 0.001 to 1000 [1/turn]",
    ),
    "torque delay between": (
        "drive: {delay: 0.0015}",
        "'drive.delay' = 0.0015",
        "a multiple of controller.period = 0.001",
    ),
    "long torque delay": ("drive: {delay: 10}", "'drive.delay' = 10", "at most 1000 of them"),
    "no encoder bits": ("sensors: {encoder_bits: -1}", "'sensors.encoder_bits' = -1", "a whole number from 0 to 32"),
    "two encoders": (
        "sensors: {encoder_bits: 13, encoder_resolution: 1e-5}",
        "'sensors.encoder_bits' = 13",
        "null or 0 where",
    ),
    "ratios of the MH3F": (
        "arm: {gear_ratios: [1, 1, 1, 1, 1, 1]}",
        "'arm.gear_ratios'",
        "the default unless arm.file",
    ),
    "no YAML": ("{{", "not valid YAML"),
    "two documents": ("{}\n---\n{}", "not valid YAML"),
    "control character": ("\0", "not valid YAML"),
    "bottomless": ("[" * 5000, "not valid YAML"),
    "endless number": ("object: {mass: " + "9" * 5000 + "}", "not valid YAML"),
    "its own parent": ("object: &a {mass: *a}", "not valid YAML", "*a stands in what it means"),
    "a key that cannot be one": ("? [1]\n: 2", "not valid YAML"),
}


@pytest.mark.parametrize(("text", "parts"), [(row[0], row[1:]) for row in BAD.values()], ids=BAD)
def test_a_bad_scenario_ends_in_one_line_with_field_value_and_what_is_valid(text, parts):
    with pytest.raises(InputError) as caught:
        from_yaml(text)
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("text", ["", "# nothing but a comment", "task:", "task: {}", "controller:\n  # k_p: 1\n"])
def test_what_a_file_leaves_out_keeps_its_default(text):
    assert from_yaml(text) == Scenario()


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e3", 1000.0), ("1.5E-3", 0.0015), ("010", 10.0), (".5", 0.5), ("+7", 7.0), ("5.", 5.0), ("3", 3.0)],
)
def test_numbers_are_read_as_they_look(text, value):
    read = from_yaml(f"controller: {{k_p: {text}}}").controller.k_p
    assert read == value and isinstance(read, float)


@pytest.mark.parametrize("text", ["1:30", "1_000", "0x10", "1,5"])
def test_numbers_of_older_yaml_are_refused_rather_than_guessed(text):
    with pytest.raises(InputError, match="a finite number"):
        from_yaml(f"controller:\n  k_p: {text}")


def ordered(low, high):
    return st.tuples(st.integers(low, high), st.integers(low, high)).map(lambda pair: tuple(sorted(pair)))


scenarios = st.fixed_dictionaries(
    {
        "arm.link_inertia_scale": st.floats(0.01, 100),
        "joint_friction.coulomb": st.floats(0, 10),
        "object.mass": st.floats(1e-4, 50),
        "object.friction": st.sampled_from([0.01, 100.0, 0.1, 1.86, 1 / 3, 12.3456789123]),
        "table.height": st.floats(-1, 2),
        "task.start_y": st.floats(-0.35, 0.35),
        "task.workspace_x": st.tuples(st.floats(-1, 0.5), st.floats(0.5, 1, exclude_min=True)),
        "planner.contact_samples": ordered(2, 400),
        "planner.solver": st.sampled_from(["clarabel", "osqp"]),
        "planner.max_iterations": st.integers(1, 1000),
        "controller.k_p": st.floats(0, 1e8),
        "controller.nominal_inertia": st.none() | st.tuples(*[st.floats(1e-7, 1e4)] * 6),
        "sensors.velocity_cutoff": st.none() | st.floats(0.1, 1e5),
        "simulation.step": st.integers(0, 9).map(lambda power: 0.001 / 2**power),
    }
)


@given(changes=scenarios, comments=st.booleans())
def test_yaml_round_trips_exactly(changes, comments):
    scenario = Scenario().with_overrides(changes)
    again = from_yaml(scenario.to_yaml(comments=comments))
    assert again == scenario
    assert repr(again.model_dump()) == repr(
        scenario.model_dump()
    )  # tells 1 from 1.0, a list from a tuple, -0.0 from 0.0


@given(changes=scenarios)
def test_overrides_change_the_fields_named_and_no_other(changes):
    before, after = Scenario().model_dump(), Scenario().with_overrides(changes).model_dump()
    for path in field_paths():
        section, name = path.split(".")
        assert after[section][name] == changes.get(path, before[section][name]), path


@given(text=st.text(max_size=60) | st.from_regex(r"(task|object|planner): \{?[a-z_]{1,12}: .{0,20}\}?"))
def test_any_text_gives_a_scenario_or_one_line(text):
    try:
        assert isinstance(from_yaml(text), Scenario)
    except InputError as error:
        assert len(str(error).splitlines()) == 1


@given(value=st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=20) | st.lists(st.floats()))
def test_any_value_of_a_field_is_taken_or_refused_in_one_line(value):
    valid = isinstance(value, (int, float)) and not isinstance(value, bool) and 1e-4 <= value <= 50
    try:
        assert Scenario().with_overrides({"object.mass": value}).object.mass == value and valid
    except InputError as error:
        assert not valid
        assert len(str(error).splitlines()) == 1 and "'object.mass'" in str(error)


@pytest.mark.parametrize("path", ["controller.k_q", "k_p", "", ".", "controller.k_p.x", "a.b"])
def test_an_override_of_no_field_is_refused(path):
    with pytest.raises(InputError, match="does not exist"):
        Scenario().with_overrides({path: 1.0})


def test_with_overrides_leaves_the_original_alone():
    scenario = Scenario()
    changed = scenario.with_overrides({"controller.k_p": 400})
    assert (scenario.controller.k_p, changed.controller.k_p) == (350.0, 400.0)


def test_the_numbers_nearest_to_the_ends_of_their_ranges_come_first():
    changes = {"planner.smoothing": 0.5, "object.mass": 0.06, "task.start_y": -0.35, "table.friction": 0.02}
    changed = Scenario().with_overrides(changes | {"controller.k_p": 1e8})
    sections = ("object", "task", "planner", "table")
    assert farthest(changed, sections) == ["planner.smoothing = 0.5", "table.friction = 0.02", "task.start_y = -0.35"]
    assert farthest(Scenario(), sections) == []


@pytest.mark.parametrize(
    ("text", "value"),
    [("400", 400), ("1e-3", 0.001), ("null", None), ("[1, 2]", [1, 2]), ("osqp", "osqp"), ("true", True), ("", None)],
)
def test_an_override_is_read_as_yaml(text, value):
    assert parse_value(text, "a.b") == value


def test_load_reads_a_partial_file(tmp_path):
    path = tmp_path / "delta.yaml"
    path.write_text("controller: {k_p: 400}  # ΔT", encoding="utf-8")
    assert load_scenario(path) == Scenario().with_overrides({"controller.k_p": 400.0})


def test_load_names_the_file_that_it_cannot_read(tmp_path):
    latin = tmp_path / "latin.yaml"
    latin.write_bytes(b"\xff\xfe\xff")
    for path, reason in ((tmp_path / "none.yaml", "No such file"), (tmp_path, "Is a directory"), (latin, "UTF-8")):
        with pytest.raises(InputError, match=reason) as caught:
            load_scenario(path)
        assert str(path) in str(caught.value)


def test_mappings_of_python_are_read_too():
    assert from_mapping({"planner": {"contact_samples": [10, 20]}}).planner.contact_samples == (10, 20)


def test_the_reader_tells_the_line_of_every_key_and_item_as_pydantic_names_them():
    text = "vary:\n  object.mass:\n    choice:\n      - 1\n      - [2, 3]\ntrials: 8\n"
    data, lines = read_mapping(text, "campaign 'a.yaml'")
    assert data == {"vary": {"object.mass": {"choice": [1, [2, 3]]}}, "trials": 8}
    keys = {("vary",): 1, ("vary", "object.mass"): 2, ("vary", "object.mass", "choice"): 3, ("trials",): 6}
    items = {("vary", "object.mass", "choice", 0): 4, ("vary", "object.mass", "choice", 1): 5}
    assert lines == keys | items | {("vary", "object.mass", "choice", 1, k): 5 for k in (0, 1)}
    assert line_of(lines, ["vary", "object.mass", "choice", 1]) == ", line 5"
    assert line_of(lines, ["trials", "more", 0]) == ", line 6", "the nearest key above"
    assert line_of(lines, ["none"]) == line_of(lines, []) == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a:\n  b:\n    c: 1\n    c: 2", "campaign, line 4: 'a.b.c' stands twice, on lines 3 and 4; valid is once"),
        ("a:\n- {b: 1, b: 2}", "campaign, line 2: 'a.0.b' stands twice, on lines 2 and 2; valid is once"),
        ("a: 1\nb: [1", "campaign, line 2: not valid YAML: .+"),
        ("a: !!python/object/apply:os.system [id]", "campaign, line 1: not valid YAML: .*python.*"),
        ("3", "campaign = 3 is no mapping; valid is 'vary: …'"),
    ],
)
def test_the_reader_refuses_with_the_line(text, message):
    with pytest.raises(InputError) as caught:
        read_mapping(text, "campaign", valid="'vary: …'")
    assert re.fullmatch(message, str(caught.value))


def test_an_alias_and_a_merge_are_read():
    data, lines = read_mapping("a: &a {b: 1}\nc: *a\nd: {<<: *a, e: 2}", "campaign")
    assert data == {"a": {"b": 1}, "c": {"b": 1}, "d": {"b": 1, "e": 2}}
    assert line_of(lines, ["c", "b"]) == ", line 1" and line_of(lines, ["d", "e"]) == ", line 3"


def test_a_tag_may_say_what_a_value_is():
    assert read_mapping("{a: !!float 1, b: !!str 2, c: !!int '3', d: !!bool true}", "")[0] == {
        "a": 1.0,
        "b": "2",
        "c": 3,
        "d": True,
    }


BOMB = "a0: &a0 [1, 1]\n" + "".join(f"a{k + 1}: &a{k + 1} [{', '.join([f'*a{k}'] * 9)}]\n" for k in range(30))
# Each row: YAML, then what its one line must contain.
NO_YAML = {
    "aliases that multiply": (BOMB, "line 5", "too many values; valid are at most 20000"),
    "merges that multiply": (
        BOMB.replace("[1, 1]", "{b: 1}").replace("[*", "{<<: [*").replace("]\n", "]}\n"),
        "line 5",
        "too many",
    ),
    "merge of itself": ("a: &a {<<: *a}", "line 1", "*a stands in what it means"),
    "list of itself": ("a: &a [[*a, *a]]", "line 1", "*a stands in what it means"),
    "deep": ("a:\n  " + "[" * 50, "line 2", "nested too deeply; valid are at most 40 levels"),
    "no truth value": ("a:\n  b: !!bool abc", "line 2", "tag 'tag:yaml.org,2002:bool' of 'abc'"),
    "no number": ("a: !!int abc", "line 1", "2002:int' of 'abc'"),
    "empty number": ("a: !!float ''", "line 1", "2002:float' of ''"),
    "no time": ("a: !!timestamp abc", "line 1", "2002:timestamp' of 'abc'"),
    "a time": ("a: !!timestamp 2026-02-30T00:00:00+99:99", "line 1", "2002:timestamp'"),
    "no bytes": ("a: !!binary é", "line 1", "2002:binary'"),
    "a set": ("a: !!set {b}", "line 1", "2002:set'"),
    "pairs": ("a: !!omap [3]", "line 1", "2002:omap'"),
    "merge of a number": ("a: {<<: 3}", "line 1", "expected a mapping"),
    "merge as a value": ("a: <<", "line 1", "merge"),
}


@pytest.mark.parametrize("case", NO_YAML.values(), ids=NO_YAML)
def test_what_grows_or_is_of_another_kind_is_refused_with_its_line(case):
    text, *words = case
    with pytest.raises(InputError) as caught:
        read_mapping(text, "campaign")
    assert all(word in str(caught.value) for word in ["not valid YAML", *words]), str(caught.value)
    assert len(str(caught.value)) < 300


def test_the_encoder_of_the_mh3fs_motors_is_not_guessed_of_another_arm():
    ours, another = Scenario(), from_mapping({"arm": {"file": "mine.urdf"}})
    assert (ours.encoder_bits, another.encoder_bits) == (13, 0)
    assert another.with_overrides({"sensors.encoder_bits": 16}).encoder_bits == 16
    assert ours.with_overrides({"sensors.encoder_bits": 0}).encoder_bits == 0
    assert ours.with_overrides({"sensors.encoder_resolution": 1e-5}).encoder_bits == 0
