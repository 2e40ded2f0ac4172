"""The sections of a scenario that describe the motion: what is asked of it, and how it is planned.

The sources of the defaults are marked as in `scenario.py`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from flipdiagram.scenario.cell import Position
from flipdiagram.scenario.text import Section, invalid, quantity


class Task(Section):
    """Where the motion starts and where the block shall land; base frame, x forward, y left, z up."""

    start_x: float = quantity(0.5, "m", "the plane of the motion (H)", ge=-10, le=10)
    start_y: float = quantity(0.0, "m", "start of the object (p: 0 to 0.14)", ge=-10, le=10)
    start_z: float = quantity(0.35, "m", "start of the object (H)", ge=-10, le=10)
    target_y: float = quantity(0.0, "m", "origin of y in the cost (5); the block shall land here (p)", ge=-10, le=10)
    yaw: float = quantity(
        0.0,
        "rad",
        "turn of the plane of motion, blade included, about the vertical axis through the start",
        ge=-math.pi,
        le=math.pi,
    )
    workspace_x: tuple[Position, Position] = quantity((0.35, 0.6), "m", "range of the plane of motion")
    workspace_y: tuple[Position, Position] = quantity((-0.35, 0.35), "m", "range of the object while on the tool")
    workspace_z: tuple[Position, Position] = quantity((0.15, 0.65), "m", "range of the object while on the tool")

    @model_validator(mode="after")
    def _start_inside(self) -> Task:
        for axis in "xyz":
            low, high = getattr(self, f"workspace_{axis}")
            value = getattr(self, f"start_{axis}")
            if not low < high:
                raise invalid(f"workspace_{axis}", (low, high), "low and high with low < high [m]")
            if not low <= value <= high:
                raise invalid(f"start_{axis}", value, f"inside the workspace, {low} to {high} [m]")
        if not self.workspace_y[0] <= self.target_y <= self.workspace_y[1]:
            low, high = self.workspace_y
            raise invalid("target_y", self.target_y, f"inside the workspace, {low} to {high} [m]")
        return self


class Planner(Section):
    """The MPC of section II-A: cost (5), horizon, and the margins of each constraint."""

    alpha: float = quantity(20.0, "1/m2", "weight of the landing place in (5) (p)", ge=0, le=1e6)
    beta: float = quantity(0.5, "s2/m2", "weight of the landing velocity in (5) (p)", ge=0, le=1e6)
    sampling_time: float = quantity(0.02, "s", "sampling time ΔT of the prediction model (2) (o)", ge=0.001, le=0.5)
    contact_samples: tuple[Annotated[int, Field(ge=2, le=400)], Annotated[int, Field(ge=2, le=400)]] = quantity(
        (10, 20), "samples", "contact samples searched, (fewest, most) (c: 64 %, more in 35 %)"
    )
    flight_samples: tuple[Annotated[int, Field(ge=1, le=400)], Annotated[int, Field(ge=1, le=400)]] = quantity(
        (4, 20), "samples", "flight samples searched, (fewest, most) (o)"
    )
    stop: Literal["immediate", "brake"] = Field(
        "immediate",
        description="at the release: immediate: the commanded velocity is zero from then on (p) (c: 64 %); brake:"
        " the tool comes to rest within the limits of its joints",
    )
    brake_samples: int = quantity(
        12, "samples", "samples in which the tool brakes after the release, where it does (o)", ge=2, le=400
    )
    release_angle: float = quantity(
        0.05, "rad", "how far beyond π/2 the tool must turn before it releases", ge=0, le=1.5
    )
    friction_margin: float = quantity(
        0.2,
        "1",
        "fraction of the friction coefficient not used by the plan (c: 0.02 to 0.37); below 0: more than there is",
        gt=-2,
        lt=1,
    )
    minimum_normal: float = quantity(1.0, "m/s2", "least normal force per mass while in contact", ge=0, le=100)
    support_margin: float = quantity(
        0.2, "1", "fraction of the half-length the centre of pressure stays away", ge=0, lt=1
    )
    position_margin: float = quantity(0.05, "rad", "distance to the joint position limits", ge=0, le=3)
    speed_margin: float = quantity(0.05, "1", "fraction of the joint speeds not used by the plan", ge=0, lt=1)
    torque_margin: float = quantity(0.2, "1", "fraction of the joint torques left to the feedback", ge=0, lt=1)
    separation_acceleration: float = quantity(
        5.0, "m/s2", "least acceleration of the blade away from the block", ge=0.01, le=1000
    )
    separation_gap: float = quantity(0.01, "m", "gap between blade and block once separated", ge=0.0001, le=1)
    table_clearance: float = quantity(0.01, "m", "least distance of blade and table", ge=0, le=2)
    smoothing: float = quantity(
        1e-6, "s5/m2", "weight of the integral of squared jerk, keeps the solution unique and smooth", ge=1e-12, le=1
    )
    search_tolerance: float = quantity(
        0.01, "1", "a shorter contact phase is preferred if its J is within this fraction of the best", ge=0, le=10
    )
    max_iterations: int = quantity(30, "1", "most re-linearisations per horizon", ge=1, le=1000)
    angle_tolerance: float = quantity(1e-4, "rad", "θ has settled when no sample moves more than this", ge=1e-9, le=1)
    replan_period: float | None = quantity(
        None,
        "s",
        "how often the rest of the motion is planned again; null: planned once, before it starts",
        ge=0.001,
        le=10,
    )
    replan_from: Literal["measured", "commanded"] = Field(
        "measured", description="state of the tool from which it is planned again; without FF always the command's"
    )
    replan_iterations: int = quantity(4, "1", "most linearisations per replanning", ge=1, le=100)
    replan_search: int = quantity(
        0, "samples", "by which a new plan may have more or fewer contact and flight samples than the last", ge=0, le=5
    )
    compute_delay: float = quantity(0.01, "s", "after which a new plan takes effect", ge=0, le=10)
    replan_deadline: float | None = quantity(
        None,
        "s",
        "a plan that took longer is dropped; null: none is (else results depend on the machine)",
        ge=0.0001,
        le=100,
    )
    solver: Literal["clarabel", "osqp", "scs", "ipopt", "snopt", "mosek", "gurobi", "daqp"] = Field(
        "daqp", description="daqp solves the condensed program; the others stand behind MathematicalProgram"
    )

    @property
    def samples_to_rest(self) -> int:
        """Samples from the release until the commanded motion has ended."""
        return self.brake_samples if self.stop == "brake" else 0

    @model_validator(mode="after")
    def _ranges(self) -> Planner:
        for name in ("contact_samples", "flight_samples"):
            low, high = getattr(self, name)
            if low > high:
                raise invalid(name, (low, high), "fewest and most with fewest <= most [samples]")
        return self
