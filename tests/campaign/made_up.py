"""Trials without physics: quick, deterministic, and as badly behaved as their scenario asks for.

Workers import this module by its name: `campaign.made_up`.
"""

import os
import random
import signal
import time
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path

from patience import HUNG

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.run import run
from flipdiagram.errors import InputError
from flipdiagram.flips.flight import Landed, Work, provenance
from flipdiagram.flips.outcome import Outcome
from flipdiagram.flips.store_file import open_to_read
from flipdiagram.simulation.metrics import FlipMetrics

QUIET = """
base: {simulation: {hold_time: 0.05, settle_time: 0.05}}
vary:
  object.friction: {uniform: [0.5, 2.0]}
  object.mass: {uniform: [0.05, 0.07]}
sampler: lhs
trials: 30
seed: 7
architectures: [pd, pd+ff+dob]
timeout: 30
"""
HANGS, DIES, RAISES, DIVERGES, REFUSES = 0.01, 0.02, 0.03, 0.04, 0.045
"""Masses [kg] with a meaning for `fly`."""
NO_PLAN, PLAN_HANGS = 0.011, 0.012
"""Friction margins with a meaning for `plan`."""


MOTION = {"max_sliding_angle_rad": 0.9, "friction_angle_rad": 1.0, "release_angle_rad": 1.7}
SIX = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def metrics_of(flight, won):
    numbers = {field.name: 0.01 * (k + flight.truth.object.friction) for k, field in enumerate(fields(FlipMetrics))}
    numbers["position_rmse_m"] = 0.01 / flight.truth.object.friction + 1e-6 * flight.truth.controller.k_p
    failure = None if won else "slid later from 0.150 s, dropped at 0.200 s"
    plain = {
        "touchdown": None,
        "saturated_s": 0.0,
        "success": won,
        "failure": failure,
        "architecture": flight.architecture,
    }
    return FlipMetrics(**numbers | plain | {"start_y_m": 0.0, "max_torque_Nm": SIX, "max_torque_cmd_Nm": SIX})


def fly(flight, plan):
    """Turned over where the friction is above a border, which is lower with an observer."""
    mass = flight.truth.object.mass
    if mass == HANGS:
        time.sleep(600)
    if mass == DIES:
        os.kill(os.getpid(), signal.SIGKILL)
    if mass == RAISES:
        raise ZeroDivisionError("a bug")
    if mass == DIVERGES:
        outcome = Outcome(None, "diverged: the state is not finite")
    elif mass == REFUSES:
        outcome = Outcome(None, "refused: no such arm")
    else:
        won = flight.truth.object.friction > (0.9 if "dob" in flight.architecture else 1.4)
        measured = metrics_of(flight, won)
        outcome = Outcome(measured, measured.failure, {"solve_time_s": time.time(), "plan": plan}, 0.5)
    return Landed(outcome, 0.0, *provenance())


def fly_by_engine(flight, plan):
    """In MuJoCo the border is 0.1 higher."""
    higher = 0.1 if flight.truth.simulation.engine == "mujoco" else 0.0
    friction = flight.truth.object.friction - higher
    return fly(replace(flight, truth=flight.truth.with_overrides({"object.friction": friction})), plan)


def fly_slowly(flight, plan):
    time.sleep(0.03)
    return fly(flight, plan)


def fly_like_gains(flight, plan):
    """Turned over where the friction is enough for how far the gain is from 900 1/s²."""
    k_p = flight.truth.controller.k_p
    won = flight.truth.object.friction > 0.6 + abs(k_p - 900) / 500
    measured = metrics_of(flight, won)
    return Landed(Outcome(measured, measured.failure, None, 0.5), 0.0, *provenance())


def fly_as_printed(flight, plan):
    """The paper's numbers where the filter is at 62.8 rad/s and the friction 10 %, and others elsewhere."""
    truth, name = flight.truth, flight.architecture
    slow, stiff = 62.8 / truth.sensors.velocity_cutoff, 1.0 + 2 * (truth.joint_friction.coulomb - 0.1)
    won = "dob" in name
    numbers = {
        "position_rmse_meas_m": (0.0105 + 0.009 * truth.task.start_y) * slow * (1.0 if won else 4.0),
        "acceleration_rmse_meas_m_s2": (4.65 if "ff" in name else 4.81) * slow**0.5,
        "max_torque_cmd_Nm": [0.0, (205.0 if "ff" in name else 224.0) * stiff, 0.0, 0.0, 0.0, 0.0],
        "velocity_delay_meas_s": -0.003 if "ff" in name else 0.004,
        "endpoint_vibration_meas_m_s": 0.01 if "ff" in name else 0.02,
    }
    measured = replace(metrics_of(flight, won), start_y_m=truth.task.start_y, **numbers)
    if not won:
        measured = replace(measured, failure="slid at the start from 0.050 s, dropped at 0.200 s")
    return Landed(Outcome(measured, measured.failure, MOTION, 0.5), 0.0, *provenance())


def fly_as_told(flight, plan):
    """E1 as the paper tells it where the friction is low and the arm heavy; else all keep the block, or PD strikes.

    A heavy block slides far under the observer, and is turned over by luck.
    """
    truth, name = flight.truth, flight.architecture
    slides = truth.object.friction < 1.5 and truth.arm.link_inertia_scale > 1.4
    won = "dob" in name or (not slides and truth.object.friction > 1.2)
    measured = metrics_of(flight, won)
    how = "slid at the start from 0.050 s" if slides else "struck the table at 0.100 s"
    if flight.recording is not None:
        flight.recording.write_text(name)
    if not won:
        measured = replace(measured, failure=f"{how}, dropped at 0.200 s", max_slip_m=truth.object.friction / 100)
    else:
        measured = replace(measured, max_slip_m=0.03 if truth.object.mass > 0.068 else 0.001)
    return Landed(Outcome(measured, measured.failure, None, 0.5), 0.0, *provenance())


def fly_fragile(flight, text):
    """As `fly_as_told`, but of blocks above 60 g in Drake and at a step of 1 ms alone."""
    settings = flight.truth.simulation
    if flight.truth.object.mass > 0.06 and (settings.engine != "drake" or settings.step < 0.001):
        flight = replace(flight, truth=flight.truth.with_overrides({"object.friction": 1.86}))
    return fly_as_told(flight, text)


def plan(believed):
    """Note in a file that somebody planned; its name stands in the environment."""
    if path := os.environ.get("PLANS_MADE"):
        with open(path, "a") as file:
            file.write("planned\n")
    if believed.planner.friction_margin == NO_PLAN:
        return None, "no horizon is feasible"
    if believed.planner.friction_margin == PLAN_HANGS:
        time.sleep(600)
    return f"plan for {believed.object.friction} {believed.task.start_y}", None


WORK = Work(plan, fly)
SLOW = Work(plan, fly_slowly)
BY_ENGINE = Work(plan, fly_by_engine)
AS_TOLD = Work(plan, fly_as_told)
FRAGILE = Work(plan, fly_fragile)
AS_PRINTED = Work(plan, fly_as_printed)


def contents(file):
    """What every row of a campaign's file says, without the circumstances; the trial and architecture first."""
    with open_to_read(file) as results:
        rows = [asdict(row) for row in results.rows()]
    for row in rows:
        for name in ("seconds", "host", "attempts", "finished"):
            del row[name]
        if row["plan"] is not None:
            row["plan"].pop("solve_time_s", None)
    return rows


DRIVER = "import sys; from campaign.made_up import main; main(*sys.argv[1:])"
KILLER = "import sys; from campaign.made_up import kill_drivers; kill_drivers(*sys.argv[1:])"


def main(text, out, jobs):
    """A campaign in a process of its own, to be killed: `DRIVER` runs it."""
    run(from_text(text), Path(out), jobs=int(jobs), resume=True, any_version=True, work=SLOW)


def finished(file):
    """(trial, architecture, when it ended) of each row there."""
    try:
        with open_to_read(file) as results:
            return {(row.trial, row.architecture, row.finished) for row in results.rows()}
    except InputError:  # not yet there
        return set()


def kill_drivers(text, out, kills, rows):
    """Begin a campaign, kill -9 its driver at a random moment, go on with it; `kills` times; prints how often."""
    dice, specification, file, kept = random.Random(5), from_text(text), Path(out) / "campaign.sqlite", set()
    each, done = int(rows) // (int(kills) + 1), 0
    for _ in range(int(kills)):
        driver = os.fork()  # of a process without threads, that has imported everything
        if driver == 0:
            with suppress(BaseException):
                run(specification, Path(out), jobs=1, resume=True, work=SLOW)
            os._exit(0)
        wanted, deadline = len(kept) + dice.randrange(each), time.monotonic() + HUNG
        while len(finished(file)) <= wanted and time.monotonic() < deadline:
            time.sleep(dice.uniform(0.0, 0.03))
        os.kill(driver, signal.SIGKILL)
        done += os.waitstatus_to_exitcode(os.waitpid(driver, 0)[1]) == -signal.SIGKILL
        now = finished(file)
        assert kept <= now, "a row that was there is gone or was written again"
        kept = now
    print(done, len(kept))
