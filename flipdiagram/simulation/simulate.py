"""Runs a loop with Drake's Simulator and returns its recording."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from flipdiagram.diagrams.loop import Loop, build_loop
from flipdiagram.diagrams.replacement import Box
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.grid import Grid
from flipdiagram.planning.command import Command
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.replanner import Replanning
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.deformation import with_deformation
from flipdiagram.simulation.margins import with_margins
from flipdiagram.simulation.metrics import FlipMetrics, measure
from flipdiagram.simulation.recording import Recording, assemble
from flipdiagram.simulation.thumbnail import beside, path_svg

CHUNK = 0.1
"""Simulated seconds between two looks at progress and divergence."""
FRAME = 0.02
"""The same where somebody watches."""
ROUNDING = 1e-6
"""Seconds below which two ends of a motion are one."""


@dataclass(frozen=True, repr=False)
class Run:
    """One simulated flip: its recording, the plan it followed, and simulated over wall time of the simulation alone."""

    recording: Recording
    plan: Plan
    real_time_factor: float

    def __repr__(self) -> str:
        measured = measure(self.recording)
        return f"Run({measured.architecture}: {verdict_of(measured)}, position RMSE {_cm(measured.position_rmse_m)})"

    def _repr_html_(self) -> str:
        measured = measure(self.recording)
        landed = measured.touchdown
        rows = [
            ["block", verdict_of(measured)],
            ["touch-down", "–" if landed is None else f"{landed.theta_rad:.2f} rad at {landed.time_s:.2f} s"],
            ["position RMSE", _cm(measured.position_rmse_m)],
            ["acceleration RMSE", f"{measured.acceleration_rmse_m_s2:.2f} m/s²"],
            ["largest slip", _cm(measured.max_slip_m)],
            ["real-time factor", f"{self.real_time_factor:.2f}"],
        ]
        return beside(Grid(["", measured.architecture], rows).html(), path_svg(self.recording))


def verdict_of(measured: FlipMetrics) -> str:
    """'turned over', or why not."""
    return "turned over" if measured.success else str(measured.failure)


def _cm(length: float) -> str:
    return f"{100 * length:.2f} cm"


def simulate(
    scenario: Scenario,
    architecture: str = "pd+ff+dob",
    plan: Plan | None = None,
    progress: Callable[[float], None] | None = None,
    replace: Mapping[str, Box] | None = None,
    replanner: Callable[[], Replanning] | None = None,
) -> Run:
    """Hold, motion, release, touch-down and settling of one flip.

    Args:
        scenario: what is simulated.
        architecture: one of `ARCHITECTURES`.
        plan: the motion to follow; without one the MPC plans when the run starts.
        progress: called with the fraction done.
        replace: boxes of the user's own, as for `build_loop`.
        replanner: makes that by which an MPC plans again, as for `build_loop`.

    Raises:
        InputError: for a bad scenario.
        PlanningError: where there is no motion.
        SimulationError: where the simulation diverges.
    """
    return simulate_loop(
        build_loop(scenario, architecture, record=True, replace=replace, native=True, replanner=replanner),
        plan,
        progress,
    )


def simulate_loop(
    loop: Loop,
    plan: Plan | None = None,
    progress: Callable[[float], None] | None = None,
    pace: Callable[[float, Context], None] | None = None,
) -> Run:
    """One flip of a loop that was built with record=True, from a context of its own; see `simulate`.

    Args:
        loop: the loop; it may be simulated again and again.
        plan: the motion to follow.
        progress: called with the fraction done.
        pace: called with the simulated time [s] and the loop's context every `FRAME`, to hold the simulation back and
            to show it.
    """
    if not loop.logs or loop.mpc is None:
        raise InputError("loop records nothing; valid is one of build_loop(..., record=True)", field="loop", value=loop)
    scenario, context = loop.scenario, loop.context(plan)
    simulator = Simulator(loop.diagram, context)
    simulator.Initialize()
    mine = loop.mpc.GetMyContextFromRoot(context)
    plan = loop.mpc.plan(mine)
    assert plan is not None, "the MPC's initialisation sets a plan"
    end = end_of(scenario, plan)
    begin = time.perf_counter()
    length = CHUNK if pace is None else FRAME
    until, chunk = 0.0, 0
    while until < end:
        chunk += 1
        until = min(chunk * length, end)
        advance(simulator, until)
        if progress is not None:
            progress(until / end)
        if pace is not None:
            pace(until, context)
        later = end_of(scenario, loop.mpc.followed(mine) or plan)
        end = later if later > end + ROUNDING else end  # a plan made again may take longer
    elapsed = time.perf_counter() - begin
    return Run(recording_of(loop, context, loop.mpc.followed(mine) or plan), plan, end / elapsed)


def end_of(scenario: Scenario, followed: Plan | Command) -> float:
    """When the simulation of a motion ends [s], counted from its own start."""
    settings = scenario.simulation
    return settings.lead_time + max(followed.end_time, followed.touchdown_time) + settings.settle_time


def advance(simulator: Simulator, until: float) -> None:
    """Simulate until a time [s]; raises SimulationError where that diverges."""
    try:
        simulator.AdvanceTo(until)
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
        raise SimulationError(f"the simulation diverged before {until:.3f} s: {reason}") from None
    state = simulator.get_context().get_discrete_state(0).value()
    if not np.all(np.isfinite(state)):
        raise SimulationError(f"the simulation diverged before {until:.3f} s: the state is not finite")


def recording_of(loop: Loop, context: Context, plan: Plan | Command) -> Recording:
    """What the sinks of a loop have logged in a Context of its diagram; plan: the motion that was followed."""
    logs = {name: sink.FindLog(context) for name, sink in loop.logs.items()}
    signals = {name: log.data() for name, log in logs.items()}
    signals["block_pose"] = signals.pop("block")[:7]
    samples = signals["q"].shape[1]
    # the log's own times carry the rounding of k·T; these are the same to the bit on every machine
    settings = loop.scenario
    period, hold = settings.controller.period, settings.simulation.lead_time
    clock = (np.arange(samples) - hold / period) * period
    wrench, bent = signals.pop("contact_wrench"), {name: signals.pop(name) for name in loop.cell.recorded}
    signals["contact_force"] = wrench[:9]
    data = with_margins(assemble(signals, clock, settings, loop.architecture, loop.arm, plan), wrench[9:].T, settings)
    if bent:
        data = with_deformation(data, bent["vertices"], bent["contact_area"], settings)
    data = data.assign_attrs(engine=loop.cell.engine)
    return data.assign_attrs(replaced=", ".join(loop.replaced)) if loop.replaced else data
