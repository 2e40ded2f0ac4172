"""A scenario whose object is a pancake: its defaults, what follows from what, and what is refused."""

import pytest

from flipdiagram.errors import ScenarioError
from flipdiagram.scenario.scenario import Scenario, from_yaml

PANCAKE = Scenario().with_overrides({"object.kind": "pancake"})
BOX = {"object.diameter": None, "object.length": 0.12, "object.width": 0.05}


def test_the_kind_brings_its_defaults_for_object_blade_and_contact():
    thing = PANCAKE.object
    assert (thing.diameter, thing.thickness, thing.mass) == (0.12, 0.012, 0.1)
    assert (thing.youngs_modulus, thing.friction) == (50e3, 0.6)
    assert thing.size == (0.12, 0.12, 0.012)
    assert PANCAKE.tool.blade_size[:2] == (0.13, 0.13)
    assert PANCAKE.simulation.contact_approximation == "sap"
    assert from_yaml("object: {kind: pancake}\ntable:\n") == PANCAKE
    assert Scenario().object.kind == "block" and Scenario().object.friction == 1.86


@pytest.mark.parametrize(
    "overrides",
    [{}, BOX, {"object.diameter": 0.1}, {"object.mass": 0.061}, {"tool.blade_width": 0.09}, {"task.start_y": 0.05}],
)
def test_changes_and_yaml_give_the_same_scenario_back(overrides):
    scenario = PANCAKE.with_overrides(overrides)
    assert Scenario().with_overrides(scenario.changes()) == scenario
    assert from_yaml(scenario.to_yaml()) == scenario
    assert scenario.with_overrides({}) == scenario
    assert scenario.with_overrides({"task.start_y": 0.05}).object == scenario.object


def test_a_diameter_is_both_edges_and_the_order_of_overrides_does_not_matter():
    smaller = PANCAKE.with_overrides({"object.diameter": 0.1})
    assert smaller.object.size == (0.1, 0.1, 0.012)
    assert smaller.with_overrides({"object.diameter": 0.08}).object.size == (0.08, 0.08, 0.012)
    one = Scenario().with_overrides({"object.mass": 0.2, "object.kind": "pancake"})
    other = Scenario().with_overrides({"object.kind": "pancake", "object.mass": 0.2})
    assert one == other and one.object.mass == 0.2


def test_back_to_the_block():
    assert PANCAKE.with_overrides({"object.kind": "block"}) == Scenario()


@pytest.mark.parametrize(
    ("overrides", "field", "valid"),
    [
        ({"object.kind": "waffle"}, "object.kind", "block, pancake"),
        ({"object.youngs_modulus": 0.0}, "object.youngs_modulus", "5000 to 10000000"),
        ({"object.youngs_modulus": -5e4}, "object.youngs_modulus", "5000 to 10000000"),
        ({"object.poissons_ratio": 0.5}, "object.poissons_ratio", "below 0.5"),
        ({"object.damping": -1.0}, "object.damping", "from 0 to 1"),
        ({"object.layers": 1}, "object.layers", "from 2 to 20"),
        ({"object.refinement": 12}, "object.refinement", "at most 1500 vertices, not 1875"),
        ({"object.diameter": 0.28}, "object.diameter", "below twice tool.reach = 0.14"),
        ({**BOX, "object.width": 0.3}, "object.width", "below twice tool.reach = 0.14"),
        ({"object.length": 0.1}, "object.length", "object.diameter = 0.12"),
        ({"object.file": "block.sdf"}, "object.file", "null"),
        ({"simulation.engine": "mujoco"}, "simulation.engine", "drake where object.kind is pancake"),
        ({"simulation.contact_approximation": "similar"}, "simulation.contact_approximation", "sap where"),
    ],
)
def test_what_is_refused_in_one_line(overrides, field, valid):
    with pytest.raises(ScenarioError) as error:
        PANCAKE.with_overrides(overrides)
    assert error.value.field == field
    assert valid in str(error.value) and "\n" not in str(error.value)


def test_a_block_has_no_diameter():
    with pytest.raises(ScenarioError, match=r"object\.diameter' = 0\.1 .*null unless object\.kind is pancake"):
        Scenario().with_overrides({"object.diameter": 0.1})
