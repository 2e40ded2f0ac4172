"""What a campaign's file may say, and the line in the error where it says something else."""

import re

import pytest
from campaign.made_up import QUIET

from flipdiagram.campaign.checks import check_estimate, estimated_hours, from_text, load_specification
from flipdiagram.campaign.draw import missing_draws
from flipdiagram.campaign.specification_file import parse
from flipdiagram.campaign.tuning import load_tuning, tuning
from flipdiagram.errors import InputError
from flipdiagram.flips.flip import Flip
from flipdiagram.scenario.scenario import Scenario

GOOD = """
base: {task: {start_y: 0.02}}
vary:
  object.friction: {uniform: [0.5, 2.0]}
  object.mass: {choice: [0.05, 0.06]}
sampler: lhs
trials: 8
"""


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (
            ("object.friction:", "object.fricton:"),
            4,
            ["'object.fricton' does not exist", "did you mean 'object.friction'"],
        ),
        (("object.friction:", "frequency.gains:"), 4, ["frequency.gains", "does not exist"]),
        (("object.friction:", "one_dof.mass:"), 4, ["section III"]),
        (("[0.5, 2.0]", "[-0.5, 2.0]"), 4, ["'object.friction' = -0.5", "from 0.01 to 100"]),
        (("[0.5, 2.0]", "[2.0, 0.5]"), 4, ["low < high"]),
        (("uniform", "gauss"), 4, ["'gauss' is no distribution"]),
        (("choice: [0.05, 0.06]", "choice: [0.05, heavy]"), 5, ["'object.mass' = 'heavy'"]),
        (("object.mass: {choice: [0.05, 0.06]}", "object.length: {uniform: [0.05, 0.2]}"), 5, ["tool.blade_width"]),
        (("object.mass:", "object.friction, object.mass:"), 5, ["object.friction stands twice"]),
        (("object.mass: {choice: [0.05, 0.06]}", "sensors.delay: {uniform: [0.5, 3]}"), 5, ["whole number"]),
        (("object.mass: {choice: [0.05, 0.06]}", "arm.file: {scale: {uniform: [1, 2]}}"), 5, ["cannot be scaled"]),
        (
            ("object.mass: {choice: [0.05, 0.06]}", "object.friction: {uniform: [1, 2]}"),
            5,
            ["stands twice", "lines 4 and 5"],
        ),
        (("lhs", "mcmc"), 6, ["sampler = 'mcmc'", "sobol"]),
        (("sampler: lhs", "sampler: grid"), 4, ["the grid needs values"]),
        (("sampler: lhs\ntrials: 8", "sampler: saltelli\ntrials: 10"), 7, ["trials = 10", "power of two"]),
        (("trials: 8", "trials: 0"), 7, ["trials = 0"]),
        (("trials: 8", "trials: 2.5"), 7, ["trials = 2.5"]),
        (("trials: 8", "trials: 99999999999"), 7, ["trials = 99999999999"]),
        (("trials: 8", "trials: 8\nseed: -1"), 8, ["seed = -1"]),
        (("trials: 8", "trials: 8\ntimeout: .nan"), 8, ["timeout = nan"]),
        (("trials: 8", "trials: 8\narchitectures: [pid]"), 8, ["'pid'", "pd+ff+dob"]),
        (("trials: 8", "trials: 8\narchitectures: [pd, pd]"), 8, ["each once"]),
        (("trials: 8", "trials: 8\nknown: [task.start_y]"), 8, ["known", "object.friction"]),
        (("trials: 8", "trials: 8\nworkers: 3"), 8, ["unknown key 'workers'", "architectures"]),
        (("trials: 8", "trials: [8"), 8, ["not valid YAML"]),
        (("trials: 8", "trials: !!python/object/apply:os.system [id]"), 7, ["not valid YAML", "python"]),
        (("start_y: 0.02", "start_y: 9.0"), 2, ["'task.start_y' = 9.0"]),
        (("base: {task: {start_y: 0.02}}", "base: nowhere.yaml"), 2, ["nowhere.yaml", "cannot be read"]),
        (("base: {task: {start_y: 0.02}}", "base: {joint_friction: {coulomb: 0.9}}"), 2, ["chatter"]),
        ((GOOD[GOOD.index("vary") : GOOD.index("sampler")], "vary: {}\n"), 3, ["vary"]),
    ],
)
def test_an_error_is_one_line_with_the_line_of_the_file(change, line, words):
    text = GOOD.replace(*change)
    assert text != GOOD
    with pytest.raises(InputError) as caught:
        from_text(text, "mine.yaml")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"campaign 'mine.yaml', line {line}: "), caught.value
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1, 2]", "5", "a: *b", "&a [*a]"])
def test_what_is_no_mapping_is_refused(text):
    with pytest.raises(InputError, match=r"campaign 'mine.yaml'"):
        from_text(text, "mine.yaml")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_specification(tmp_path / "none.yaml")


def test_a_base_file_is_looked_for_beside_the_campaign(tmp_path):
    (tmp_path / "base.yaml").write_text("task: {start_y: 0.03}\n")
    (tmp_path / "c.yaml").write_text(GOOD.replace("{task: {start_y: 0.02}}", "base.yaml"))
    assert load_specification(tmp_path / "c.yaml").base.task.start_y == 0.03


def test_fields_of_the_command_line_count_more_than_the_file(tmp_path):
    (tmp_path / "c.yaml").write_text(GOOD)
    given = Scenario().with_overrides({"task.start_y": 0.05, "controller.k_p": 400.0})
    found = load_specification(tmp_path / "c.yaml", given.changes())
    assert (found.base.task.start_y, found.base.controller.k_p) == (0.05, 400.0)
    assert Scenario().changes() == {}


def test_trials_are_the_same_again_and_within_their_distributions():
    one, other = from_text(GOOD), from_text(GOOD)
    assert [one.trial(k) for k in range(8)] == [other.trial(k) for k in range(8)]
    assert all(0.5 <= one.trial(k).values[0] <= 2.0 and one.trial(k).values[1] in (0.05, 0.06) for k in range(8))
    assert len({one.trial(k).seed for k in range(8)}) == 8
    trial = one.trial(3)
    assert one.truth(trial).object.friction == trial.values[0] and one.truth(trial).task.start_y == 0.02


def test_planner_and_controller_do_not_know_what_varies_in_the_world_unless_told():
    text = GOOD.replace("object.mass: {choice: [0.05, 0.06]}", "task.start_y: {uniform: [0.0, 0.1]}")
    unknown, known = from_text(text), from_text(text + "known: [object.friction]\n")
    trial = unknown.trial(0)
    assert unknown.truth(trial).object.friction == known.truth(trial).object.friction == trial.values[0]
    assert unknown.believed(trial).object.friction == 1.86
    assert known.believed(trial).object.friction == trial.values[0]
    assert unknown.believed(trial).task.start_y == unknown.truth(trial).task.start_y == trial.values[1]
    assert unknown.planned == (1,) and known.planned == (0, 1) and from_text(GOOD).planned == ()
    keys = {Flip(from_text(GOOD).believed(from_text(GOOD).trial(k)), "pd").plan_key for k in range(8)}
    assert len(keys) == 1


def test_noise_of_a_trial_has_its_seed_whatever_the_architecture_unless_the_file_sets_it():
    noise = "object.mass: {choice: [0.05, 0.06]}\n  sensors.position_noise: {loguniform: [1.0e-6, 1.0e-3]}"
    text = GOOD.replace("object.mass: {choice: [0.05, 0.06]}", noise)
    found = from_text(text)
    seeds = [found.truth(found.trial(k)).sensors.noise_seed for k in range(8)]
    assert seeds == [found.trial(k).seed for k in range(8)] and len(set(seeds)) == 8
    assert all(1e-6 <= found.truth(found.trial(k)).sensors.position_noise <= 1e-3 for k in range(8))
    flights = [draw.flight() for draw in missing_draws(found, {})]
    assert [flight.truth.sensors.noise_seed for flight in flights] == [
        seed for seed in seeds for _ in found.architectures
    ]
    other = from_text(text + "seed: 9\n")
    assert not {other.truth(other.trial(k)).sensors.noise_seed for k in range(8)} & set(seeds)
    named = from_text(text.replace("vary:\n", "vary:\n  sensors.noise_seed: {choice: [4]}\n"))
    assert {named.truth(named.trial(k)).sensors.noise_seed for k in range(8)} == {4}
    assert named.trial(0).overrides["sensors.camera_seed"] == named.trial(0).seed


def test_noise_that_cannot_be_is_refused_with_its_line():
    text = GOOD.replace("object.mass: {choice: [0.05, 0.06]}", "sensors.velocity_noise: {uniform: [-1.0, 1.0]}")
    with pytest.raises(
        InputError, match=r"line 5: .*'sensors.velocity_noise' = -1.0 is not valid; valid is .* from 0 to 100"
    ):
        from_text(text, "mine.yaml")


def test_a_list_is_scaled_element_by_element_and_fields_joined_by_a_comma_together():
    found = from_text(
        GOOD.replace("object.mass: {choice: [0.05, 0.06]}", "arm.link_inertia_scales: {scale: {uniform: [0.8, 1.2]}}")
        .replace("object.friction:", "joint_friction.coulomb, joint_friction.viscous:")
        .replace("{uniform: [0.5, 2.0]}", "{scale: {uniform: [0.5, 1.2]}}")
    )
    assert len(found.dimensions) == 7
    truth = found.truth(found.trial(2))
    assert truth.joint_friction.coulomb / 0.075 == pytest.approx(truth.joint_friction.viscous / 0.05)
    assert len(set(truth.arm.link_inertia_scales)) == 6
    assert truth.arm.link_inertia_scales == pytest.approx(found.trial(2).values[1:])


def test_the_grid_has_all_combinations_and_needs_no_number_of_trials():
    text = (
        GOOD.replace("uniform: [0.5, 2.0]", "grid: [0.5, 1.0, 2.0]").replace("lhs", "grid").replace("trials: 8\n", "")
    )
    found = from_text(text)
    assert found.trials == 6
    assert [found.trial(k).values for k in range(3)] == [(0.5, 0.05), (0.5, 0.06), (1.0, 0.05)]
    with pytest.raises(InputError, match="line 7.*trials = 8.*6, the product"):
        from_text(text + "trials: 8")


def test_the_digest_changes_with_what_changes_a_result_only():
    digest = from_text(GOOD).digest
    assert from_text("# a comment\n" + GOOD + "limit_hours: 3\n").digest == digest
    assert from_text(GOOD + "architectures: [pd, pd+ff, pd+dob, pd+ff+dob]\n").digest == digest
    for change in (("2.0", "2.1"), ("trials: 8", "trials: 9"), ("lhs", "sobol"), ("start_y: 0.02", "start_y: 0.03")):
        assert from_text(GOOD.replace(*change)).digest != digest


def test_a_campaign_that_would_take_too_long_says_how_long_and_what_fits():
    found = from_text(GOOD.replace("trials: 8", "trials: 200000\nlimit_hours: 5"))
    assert estimated_hours(found, 1) == pytest.approx(2 * estimated_hours(found, 2))
    with pytest.raises(InputError) as caught:
        check_estimate(found, 2)
    message = str(caught.value)
    assert "line 7" in message and "800000 flips" in message and "limit_hours is 5" in message and "--yes" in message
    most = int(re.search(r"about (\d+) trials", message)[1])
    check_estimate(from_text(GOOD.replace("trials: 8", f"trials: {most}\nlimit_hours: 5")), 2)


TUNE = (
    QUIET
    + """
tune:
  over:
    controller.k_p: {loguniform: [100, 1500]}
  budget: 90
  held_out: 10
"""
)


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (("controller.k_p", "controller.k_q"), 14, ["controller.k_q", "does not exist"]),
        (("controller.k_p", "object.friction"), 14, ["cannot be chosen"]),
        (("[100, 1500]", "[-100, 1500]"), 14, ["0 < low"]),
        (("budget: 90", "budget: 10"), 15, ["budget", "at least 60"]),
        (("held_out: 10", "held_out: 10\n  objective: {quantile: 2, of: x}"), 17, ["objective"]),
        (("held_out: 10", "held_out: 10\n  trials: 5"), 17, ["unknown key 'trials'"]),
        (("held_out: 10", "held_out: 10\n  architecture: dob"), 17, ["'dob'"]),
    ],
)
def test_an_error_in_the_section_of_the_tuner_has_its_line(change, line, words):
    source = parse(TUNE.replace(*change), "t.yaml")
    with pytest.raises(InputError) as caught:
        tuning(source, from_text(source.text, "t.yaml"))
    assert f"line {line}: " in str(caught.value), caught.value
    for word in words:
        assert word in str(caught.value)


def test_the_examples_are_valid():
    from pathlib import Path

    examples = Path(__file__).parents[2] / "examples"
    assert load_specification(examples / "campaign.yaml").rows == 256
    found, wanted = load_tuning(examples / "tuning.yaml")
    assert found.trials == 16 and wanted.budget == 320 and len(wanted.over) == 5
    pancakes, margins = load_tuning(examples / "pancake" / "margins.yaml")
    assert pancakes.base.object.kind == "pancake" and "tool.blade_length" in margins.over
