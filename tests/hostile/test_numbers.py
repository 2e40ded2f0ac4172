"""Numbers beyond sense: each is refused in one line that names the field and its range."""

import math

import pytest
from hostile.table import Case, check

from flipdiagram.campaign.specification_file import SpecificationFile
from flipdiagram.campaign.tuning import TuneSection
from flipdiagram.scenario.text import spans_of
from flipdiagram.studies.calibrate.section import CalibrateSection

SPECIFICATION = "vary: {object.mass: {uniform: [0.05, 0.07]}}\ntrials: 2\n"


def field(path, value, *says, command="plan"):
    """One field at a value that is refused: the line names it."""
    return Case(f"{path} {value}", [command, f"--{path}={value}"], 2, (f"'{path}'", *says))


def campaign(text, *says, command="campaign"):
    return Case(f"{command} {text}", [command, "c.yaml"], 2, says, {"c.yaml": f"{SPECIFICATION}{text}\n"})


CASES = [
    field("object.mass", "-1", "from 0.0001 to 50 [kg]"),
    field("simulation.hold_time", "1e9", "from 0 to 600 [s]"),
    field("simulation.settle_time", "1e5", "from 0 to 600 [s]", command="flip"),
    field("planner.replan_period", "1e-9", "from 0.001 to 10 [s]", command="flip"),
    field("object.thickness", "1e-300", "from 0.0001 to 0.5 [m]", command="flip"),
    field("object.length", "1e-300", "from 0.001 to 1 [m]"),
    field("controller.k_p", "1e300", "from 0 to 100000000", command="flip"),
    field("controller.period", "1e-300", "from 1e-05 to 0.1"),
    field("arm.base_pose", "[0, 0, 1e300, 0]", "4 finite numbers from -10 to 10"),
    field("joints.stiffness", "[1e300, 1, 1, 1, 1, 1]", "finite numbers from 1 to"),
    field("planner.contact_samples", "[10, 1000000]", "whole numbers from 2 to 400"),
    field("sensors.noise_seed", "9" * 30, "from 0 to 4294967295"),
    field("frequency.lowest", "1e-300", "from 0.0001", command="frequency"),
    Case(
        "too long a flip",
        ["flip", "--simulation.settle_time=600", "--simulation.step=1.5625e-05"],
        2,
        ("'simulation.settle_time' = 600.0", "about 320 min", "--yes"),
    ),
    Case(
        "a solver that gives up",
        [
            "plan",
            "--planner.sampling_time=0.5",
            "--planner.contact_samples=[10, 10]",
            "--planner.flight_samples=[4, 4]",
        ],
        3,
        ("farthest from the defaults: planner.sampling_time = 0.5",),
    ),
    Case("too long a study", ["frequency", "--one_dof.step=1e-7"], 2, ("'frequency.lowest' = 0.1", "--yes")),
    Case("jobs of 30 digits", ["flip", "--jobs", "9" * 30], 2, ("--jobs", "from 1 to 1000")),
    Case("jobs of 5000 digits", ["flip", "--jobs", "9" * 5000], 2, ("--jobs", "from 1 to 1000")),
    Case("resolution of 30 digits", ["borders", "--resolution", "9" * 30], 2, ("--resolution", "from 1 to 1000")),
    campaign("timeout: 1e300", "timeout = 1e+300", "0.01 to 1e6 [s]"),
    campaign("memory: 1e-300", "memory = 1e-300", "0.01 to 10000 [GB]"),
    campaign("limit_hours: 1e300", "limit_hours = 1e+300"),
    campaign("seed: 1" + "0" * 30, "seed", "from 0 to 4294967295"),
    campaign("base: {simulation: {settle_time: 1e5}}", "line 3", "'simulation.settle_time' = 100000.0"),
    campaign("calibrate: {population: 1" + "0" * 30 + "}", "from 10 to 100000", command="calibrate"),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_number_beyond_sense_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)


def test_every_number_of_a_specification_has_a_lowest_and_a_highest_value():
    for section in (SpecificationFile, TuneSection, CalibrateSection):
        for name, field in section.model_fields.items():
            if field.annotation in (int, float):
                ((low, high),) = spans_of(field)
                assert -math.inf < low < high < math.inf, name
