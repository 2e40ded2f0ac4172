"""Flips that are run once per question: what the question is, and that nothing finished is run again."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import get_args

import grimp
import numpy as np
import pytest
from flips.tasks import fly_or_hang, fly_wrongly, refuse_to_plan
from ideal import IDEAL
from patience import HUNG, loaded
from shared import ideal_plan

import flipdiagram
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.flips import flip as flip_module
from flipdiagram.flips import run as flips_run
from flipdiagram.flips.flight import Work, fly_flight
from flipdiagram.flips.flip import PLAN_SECTIONS, SOURCES, Flip
from flipdiagram.flips.run import Clock, is_done, run_flips
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.planning import plan_motion
from flipdiagram.scenario.scenario import ARCHITECTURES, FILES, Scenario, field_paths
from flipdiagram.scenario.text import fields_of
from flipdiagram.simulation import metrics
from flipdiagram.simulation.recording_files import load_recording, recording_key
from flipdiagram.simulation.simulate import simulate
from flipdiagram.studies.experiment import run as experiment
from flipdiagram.studies.frequency import run as frequency

SHORT = {"simulation.hold_time": 0.05, "simulation.settle_time": 0.05}
UNFINISHED = ("real_time_factor", "solve_time_s", "channel_steps_per_s")
"""Entries of a summary that hold times."""


def closure(*roots, without=()):
    """Modules of ours that the roots import, directly or not, leaving out what only the rooms `without` import."""
    graph = grimp.build_graph("flipdiagram")
    for name in graph.modules:
        if name.removeprefix("flipdiagram.").startswith(without):
            graph.remove_module(name)
    found = {f"flipdiagram.{name}" for name in roots}
    for name in sorted(found):
        found |= graph.find_upstream_modules(name)
    return found - {"flipdiagram"}


def another(path):
    """A valid value of a field that differs from the default."""
    section, name = path.split(".")
    value = getattr(getattr(IDEAL, section), name)
    special = {
        "arm.link_inertia_scales": (1.1,) * 6,
        "arm.reflected_inertia_scales": (1.1,) * 6,
        "controller.nominal_inertia": (1.0,) * 6,
        "sensors.velocity_cutoff": 100.0,
        "sensors.delay": 1,
        "simulation.contact_model": "point",
        "simulation.contact_approximation": "sap",
        "simulation.step": 0.0005,
        "controller.period": 0.002,
        "planner.solver": "osqp",
        "planner.contact_samples": (11, 30),
        "planner.flight_samples": (5, 20),
        "task.start_y": 0.02,
        "disturbance.payload": 0.1,
        "controller.gravity_compensation": 0.5,
        "sensors.encoder_resolution": 1e-4,
        "sensors.encoder_bits": 13,
        "drive.delay": 0.002,
        "joints.stiffness": (2e4,) * 6,
        "joints.damping": (5.0,) * 6,
    }
    if path in special:
        return special[path]
    if isinstance(value, tuple):
        return tuple(1.01 * v + (0.001 if v == 0 else 0.0) for v in value)
    if isinstance(value, str):
        choices = get_args(fields_of(Scenario)[path].annotation)
        return next(choice for choice in choices if choice != value)
    if value is None:
        return 0.05
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 1.01 * value + (0.001 if value == 0 else 0.0)


OWN_ARM = (
    *("base", "flange", "base_pose", "mount_angle", "home", "torque_limits"),
    *("speed_limits", "reflected_inertia", "gear_ratios"),
)
"""Fields that are refused without an arm of the user's own."""
PATHS = [path for path in field_paths() if path not in FILES and path not in [f"arm.{name}" for name in OWN_ARM]]
UNUSED = ("one_dof", "frequency")
NEEDS = {"object.diameter": {"object.kind": "pancake"}}
"""What a field is refused without."""


def test_the_key_changes_with_every_field_that_the_flip_reads_and_with_no_other():
    assert len({Flip(IDEAL, name).key for name in ARCHITECTURES}) == 4
    for path in PATHS:
        if path.startswith(UNUSED):
            continue
        base = IDEAL.with_overrides(NEEDS.get(path, {}))
        changed = base.with_overrides({path: another(path)})
        for name in ARCHITECTURES:
            same = path == "controller.g_dis" and "dob" not in name
            assert (Flip(changed, name).key == Flip(base, name).key) is same, (path, name)


def test_the_study_of_section_iii_has_no_part_in_a_flip():
    other = IDEAL.with_overrides(
        {"one_dof.k_p": 500.0, "one_dof.g_dis": 60.0, "frequency.count": 30, "frequency.lowest": 0.5}
    )
    assert Flip(other, "pd+dob").key == Flip(IDEAL, "pd+dob").key
    assert Flip(other, "pd+dob").plan_key == Flip(IDEAL, "pd+dob").plan_key


def test_the_key_of_a_flip_in_mujoco_holds_its_version(monkeypatch):
    flown = Flip(IDEAL.with_overrides({"simulation.engine": "mujoco"}), "pd")
    keys = {Flip(IDEAL, "pd").key}
    for number in ("4.0.0", "4.1.0"):
        monkeypatch.setattr(flip_module, "version", lambda name, number=number: number)
        keys.add(flown.key)
    assert len(keys) == 3 and Flip(IDEAL, "pd").key in keys
    assert flown.plan_key == Flip(IDEAL, "pd").plan_key


def test_the_name_of_the_recording_is_no_part_of_the_question():
    assert Flip(IDEAL, "pd", "a.nc").key == Flip(IDEAL, "pd").key


def test_the_plan_key_changes_with_the_sections_of_the_plan_alone():
    for path in PATHS:
        if path.startswith(UNUSED):
            continue
        base = IDEAL.with_overrides(NEEDS.get(path, {}))
        changed = base.with_overrides({path: another(path)})
        wanted = path.split(".")[0] in PLAN_SECTIONS
        assert (Flip(changed, "pd").plan_key != Flip(base, "pd").plan_key) is wanted, path


def test_a_plan_depends_on_the_sections_of_the_plan_alone():
    """All other fields changed at once, the states are the same to the bit."""
    changes = {path: another(path) for path in PATHS if path.split(".")[0] not in (*PLAN_SECTIONS, *UNUSED)}
    changes |= {"joint_friction.transition_velocity": 0.1, "controller.period": 0.001, "sensors.encoder_bits": None}
    other = IDEAL.with_overrides(changes)
    for section in ("joint_friction", "joints", "drive", "disturbance", "controller", "sensors", "simulation"):
        assert getattr(other, section) != getattr(IDEAL, section)
    one, two = ideal_plan(), plan_motion(other)
    for name, value in vars(one).items():
        if name not in ("solve_time", "program_times"):  # how long it took
            np.testing.assert_array_equal(value, getattr(two, name), err_msg=name)


def test_a_model_file_counts_by_its_content(tmp_path):
    file = tmp_path / "block.sdf"
    file.write_text("<sdf/>")
    scenario = IDEAL.with_overrides({"object.file": str(file)})
    before = Flip(scenario, "pd")
    keys = before.key, before.plan_key
    file.write_text("<sdf version='1.7'/>")
    after = Flip(scenario, "pd")
    assert after.key != keys[0] and after.plan_key != keys[1]


def test_the_sources_of_a_flip_are_what_simulation_and_metrics_import():
    needed = {name.split(".")[1] for name in closure("simulation.simulate", "simulation.metrics")}
    # names of types, the words of an error and of a table, and how a file is written change no number
    assert needed - {"arrays", "errors", "files", "grid"} == set(SOURCES)


def test_the_sources_of_section_iii_are_what_it_imports():
    """Beyond the 1-DOF loop its imports reach the arm, but through code that the study never calls."""
    never_called = (
        "robot",
        "planning",
        "diagrams.controller",
        "diagrams.replacement",
        "arrays",
        "errors",
        "files",
        "folders",
        "grid",
        "flips",
    )
    for module in sorted(closure("studies.frequency.run", without=never_called)):
        parts = module.split(".")[1:]
        assert any("/".join(parts[:n]) in frequency.SOURCES for n in range(1, len(parts) + 1)) or parts in (
            ["studies"],
            ["diagrams"],
        ), module


def test_the_sources_are_there():
    package = Path(flipdiagram.__file__).parent
    for name in (*frequency.SOURCES, *SOURCES):
        assert (package / name).is_dir() or (package / f"{name}.py").is_file(), f"{name} is gone"


def test_the_clock_counts_and_estimates():
    clock = Clock(4)
    clock.begin -= 30.0
    assert clock.tick().startswith("flips 1/4, 1:3")  # 30 s for the first, three are left
    clock.tick()
    clock.tick()
    assert clock.tick() == "flips 4/4, 0:00 left"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("flips")


@pytest.fixture(scope="module")
def flips():
    near = IDEAL.with_overrides(SHORT)
    far = near.with_overrides({"planner.table_clearance": 0.3})
    wild = near.with_overrides({"controller.k_v": 1e6, "arm.torque_scale": 1e4})
    return [
        Flip(near, "pd+ff+dob", "a.nc"),
        Flip(far, "pd"),
        Flip(near, "pd"),
        Flip(wild, "pd"),
        Flip(near.with_overrides({"controller.g_dis": 99.0}), "pd"),  # the same question as the third
    ]


@pytest.fixture(scope="module")
def outcomes(flips, folder):
    return run_flips(flips, folder)


def rows(folder):
    connection = sqlite3.connect(folder / "runs.sqlite")
    try:
        return connection.execute("SELECT * FROM trials ORDER BY trial").fetchall()
    finally:
        connection.close()


def test_outcomes_come_in_the_order_of_the_flips_and_failures_are_outcomes(outcomes, folder):
    best, far, plain, wild, same = outcomes
    assert best.metrics.architecture == "pd+ff+dob" and plain.metrics.architecture == "pd"
    assert far.metrics is None and far.failure.startswith("no plan: ") and not far.success
    assert wild.metrics is None and wild.failure.startswith("diverged: ") and wild.plan["cost_J"] > 0
    assert same == plain
    assert len(rows(folder)) == 4


def test_a_flip_alone_in_this_process_gives_the_same_bits_as_the_pool(outcomes, flips, folder):
    """Planned here and not read from the store, too."""
    flip = flips[0]
    run = simulate(flip.scenario, flip.architecture, plan_motion(flip.scenario))
    assert metrics.measure(run.recording) == outcomes[0].metrics
    stored = load_recording(folder / flip.recording)
    for name, values in run.recording.items():
        np.testing.assert_array_equal(stored[name], values, err_msg=str(name))
    assert stored.attrs["success"] == outcomes[0].success
    assert recording_key(folder / flip.recording) == flip.key


def test_a_second_call_runs_nothing(outcomes, flips, folder):
    before, words = rows(folder), []
    again = run_flips(flips, folder, progress=words.append)
    assert repr(again) == repr(outcomes)
    assert rows(folder) == before
    assert words == []


def test_a_recording_that_is_gone_or_anothers_is_run_again(outcomes, flips, folder):
    flip = flips[0]
    whole = load_recording(folder / "a.nc")
    with open_to_write(folder / "runs.sqlite", {"digest": "flips of studies"}) as store:
        assert is_done(flip, store, folder)
        assert not is_done(replace(flip, recording="gone.nc"), store, folder)
        (folder / "half.nc").write_bytes((folder / "a.nc").read_bytes()[:50])
        assert not is_done(replace(flip, recording="half.nc"), store, folder)
        assert is_done(replace(flip, recording=None), store, folder)

    # another scenario's flip has written the same name since; this one's is still known to the store
    other = Flip(flip.scenario.with_overrides({"simulation.settle_time": 0.06}), flip.architecture, "a.nc")
    run_flips([other], folder, jobs=1)
    assert not load_recording(folder / "a.nc").equals(whole)
    words = []
    assert run_flips([flip], folder, jobs=1, progress=words.append) == [outcomes[0]]
    assert words[0] == "1 flips, 1 of them to be run"
    assert load_recording(folder / "a.nc").equals(whole)


def test_a_flip_that_is_lost_is_an_error_and_flown_again_while_the_others_are_kept(tmp_path, monkeypatch):
    near = IDEAL.with_overrides(SHORT)
    flips = [Flip(near, "pd"), Flip(near, "pd+ff")]
    monkeypatch.setattr(flips_run, "LEAST_TIMEOUT", loaded(5.0))
    monkeypatch.setattr(flips_run, "PACE", 0.0)
    with pytest.raises(SimulationError, match=r"lost, timeout: took longer than [0-9.]+ s; the others are kept"):
        run_flips(flips, tmp_path, work=Work(flips_run.WORK.plan, fly_or_hang))
    words = []
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):  # a bug, not physics
        run_flips(flips, tmp_path, progress=words.append, work=Work(flips_run.WORK.plan, fly_wrongly))
    assert words[0] == "2 flips, 1 of them to be run"
    monkeypatch.undo()
    assert all(outcome.metrics is not None for outcome in run_flips(flips, tmp_path))


def test_a_bad_input_that_only_the_planner_sees_ends_the_run(tmp_path):
    with pytest.raises(InputError, match="planner.solver = 'none'") as caught:
        run_flips([Flip(IDEAL, "pd")], tmp_path, work=Work(refuse_to_plan, fly_flight))
    assert caught.value.field == "planner.solver"


COMMAND = [
    sys.executable,
    "-m",
    "flipdiagram",
    "experiment",
    "--starts",
    "0",
    "--architecture",
    "pd",
    "pd+ff+dob",
    "--simulation.hold_time",
    "0.2",
    "--simulation.settle_time",
    "0.1",
]


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(v) for key, v in value.items() if key not in UNFINISHED}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def finished(folder):
    if not (folder / "runs.sqlite").is_file():
        return {}
    connection = sqlite3.connect(f"file:{folder / 'runs.sqlite'}?mode=ro", uri=True, timeout=5)
    try:
        return {key: rest for key, *rest in connection.execute("SELECT * FROM trials")}
    except sqlite3.OperationalError:  # the table is not there yet
        return {}
    finally:
        connection.close()


def test_a_killed_command_goes_on_where_it_was(tmp_path):
    killed, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    process = subprocess.Popen(
        [*COMMAND, "--jobs", "1", "--out", str(killed)],
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    until = time.monotonic() + HUNG
    while len(before := finished(killed)) < 1:
        assert process.poll() is None and time.monotonic() < until
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait(HUNG)
    before = finished(killed)
    assert len(before) == 1
    assert not (killed / "summary.json").exists()

    done = subprocess.run([*COMMAND, "--out", str(killed)], capture_output=True, text=True, timeout=HUNG)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    after = finished(killed)
    assert len(after) == 4  # each once more in MuJoCo
    # the seconds a flip took would differ if it had been run again
    assert {key: after[key] for key in before} == before

    scenario = Scenario().with_overrides({"simulation.hold_time": 0.2, "simulation.settle_time": 0.1})
    experiment.run(scenario, undisturbed, starts=[0.0], architectures=["pd", "pd+ff+dob"])
    one, two = (json.loads((folder / "summary.json").read_text()) for folder in (killed, undisturbed))
    assert len(one["runs"]) == 2
    assert without_times(one) == without_times(two)
    names = [sorted(path.name for path in Path(folder, "recordings").glob("y*.nc")) for folder in (killed, undisturbed)]
    assert names[0] == names[1] and len(names[0]) == 2
