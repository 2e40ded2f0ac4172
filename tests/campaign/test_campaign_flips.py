"""Real flips of both engines: the same rows from 1, 2 and 4 processes, and after kill -9; on Dask: test_cluster."""

import json
import os
import random
import re
import signal

import pytest
from campaign.made_up import contents
from ideal import IDEAL

from flipdiagram.campaign.checks import from_text, load_specification
from flipdiagram.campaign.run import run
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.flips import child_process
from flipdiagram.flips.flight import fly
from flipdiagram.flips.store_file import open_to_read
from flipdiagram.planning import plan_motion
from flipdiagram.simulation.events import SATURATED
from flipdiagram.simulation.verdict import LIMITED

TEXT = """
base: {simulation: {hold_time: 0.05, settle_time: 0.05}}
vary:
  object.friction: {uniform: [0.8, 2.0]}
  arm.link_inertia_scale: {uniform: [0.9, 1.1]}
  simulation.engine: {choice: [drake, mujoco]}
sampler: sobol
trials: 4
seed: 2
architectures: [pd, pd+ff+dob]
timeout: 100
"""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return contents(run(from_text(TEXT), tmp_path_factory.mktemp("flips"), jobs=1).file)


def test_both_engines_fly(undisturbed):
    assert [row["values"][-1] for row in undisturbed[::2]].count("mujoco") == 2
    assert all(row["metrics"] for row in undisturbed)


def test_a_row_is_what_a_single_flip_measures(undisturbed):
    specification = from_text(TEXT)
    trial = specification.trial(1)
    plan = plan_motion(specification.believed(trial))
    truth = specification.truth(trial)
    # M_n is of the arm as planner and controller believe it to be, which is the base's
    inertia = tuple(build_loop(specification.base).boxes.nominal_inertia.inertia.tolist())
    truth = truth.with_overrides({"controller.nominal_inertia": inertia, "controller.nominal_inertia_scale": 1.0})
    outcome = fly(truth, "pd+ff+dob", plan)
    row = next(row for row in undisturbed if (row["trial"], row["architecture"]) == (1, "pd+ff+dob"))
    measured = outcome.metrics.as_dict()
    assert row["metrics"] == json.loads(json.dumps(measured | {"torque_use": row["metrics"]["torque_use"]}))


WEAK = """
base: strong.yaml
vary:
  arm.torque_scale: {grid: [0.15, 1.0]}
  disturbance.payload: {grid: [0.0, 1.0]}
sampler: grid
architectures: [pd+ff+dob]
timeout: 100
"""


def test_a_flip_that_lacks_torque_fails_by_its_limit_and_one_that_never_reached_it_by_what_happened(tmp_path):
    short = {"simulation.start": "hold", "simulation.hold_time": 0.05, "simulation.settle_time": 0.05}
    (tmp_path / "strong.yaml").write_text(IDEAL.with_overrides(short).to_yaml())
    (tmp_path / "weak.yaml").write_text(WEAK)
    file = run(load_specification(tmp_path / "weak.yaml"), tmp_path, jobs=2).file
    rows = {tuple(row["values"]): row for row in contents(file)}
    for payload in (0.0, 1.0):
        weak = rows[0.15, payload]
        assert weak["outcome"] == "torque limit" and weak["metrics"]["saturated_s"] > 5 * LIMITED
        assert weak["failure"].startswith("torque limit from") and weak["metrics"]["torque_use"] >= SATURATED
    # torque is all that it lacked: with the arm's own the same flip succeeds
    assert rows[1.0, 0.0]["outcome"] == "turned over"
    # an unknown payload of 1 kg fails the same way, with torque to spare
    heavy = rows[1.0, 1.0]
    assert heavy["outcome"] == "struck the table" and heavy["failure"].startswith("struck the table at")
    assert heavy["metrics"]["saturated_s"] == 0 and heavy["metrics"]["torque_use"] < 0.9


@pytest.mark.parametrize("jobs", [2, 4])
def test_real_flips_do_not_depend_on_the_number_of_processes(jobs, tmp_path, undisturbed):
    assert contents(run(from_text(TEXT), tmp_path, jobs=jobs).file) == undisturbed


def test_real_flips_are_the_same_after_workers_and_driver_were_lost(tmp_path, undisturbed):
    dice = random.Random(1)

    def disturb(text):
        if re.match("flips 2/8", text):
            os.kill(dice.choice(child_process.children()), signal.SIGKILL)
        if re.match("flips 5/8", text):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(from_text(TEXT), tmp_path, jobs=2, progress=disturb)
    with open_to_read(tmp_path / "campaign.sqlite") as results:
        assert 5 <= len(results.done()) < 8
    run(from_text(TEXT), tmp_path, jobs=2, resume=True)
    assert contents(tmp_path / "campaign.sqlite") == undisturbed
