"""Constraints of the motion, each as margin ≥ 0 with its slope, linearised about the last trajectory (rows.py).

Contact forces per unit mass are F_s = (a − g)·s and F_n = (a − g)·n; as ds/dθ = n and dn/dθ = −s, their slopes in θ
are F_n and −F_s.  The acceleration is held over an interval while the tool turns on, so contact is demanded at both its
ends.  A law fills margin and slope of constraints i from the variables x[:, i] they depend on and the numbers p[:, i].
numba compiles the loop over i where planning is hot.  Else the loop runs once, an `element` being a whole array.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import flight
from flipdiagram.planning.rows import Constraint
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.contact import GRAVITY_Z

FRICTION = "friction cone"
NORMAL = "normal force"
SUPPORT = "centre of pressure"
SEPARATION = "separation of blade and block"
CLEARANCE = "table clearance"
WORKSPACE = "workspace"
RELEASE = "release angle"
GROUPS = (FRICTION, NORMAL, SUPPORT, RELEASE, WORKSPACE, CLEARANCE, SEPARATION)


@dataclass(frozen=True)
class Geometry:
    """Sizes [m] that the constraints need, about the object's centre in the tool's (s, n) frame."""

    half_length: float
    half_thickness: float
    half_blade: float
    blade_thickness: float
    round: bool = False
    """A disc, else a box."""

    @classmethod
    def of(cls, scenario: Scenario) -> Geometry:
        """Take the sizes from a scenario."""
        block, tool = scenario.object, scenario.tool
        disc = block.diameter is not None
        return cls(block.length / 2, block.thickness / 2, tool.blade_width / 2, tool.blade_thickness, disc)

    @property
    def gyration(self) -> float:
        """k² = I_θ / m of the block about the axis of the motion [m²]."""
        return (self.half_length**2 * (0.75 if self.round else 1.0) + self.half_thickness**2) / 3

    @property
    def half_support(self) -> float:
        """Half of what of the block lies on the blade, along s [m]."""
        return min(self.half_length, self.half_blade)

    @property
    def blade(self) -> list[tuple[float, float]]:
        """Corners (s, n) of the blade [m]."""
        top, bottom = -self.half_thickness, -self.half_thickness - self.blade_thickness
        return list(product((self.half_blade, -self.half_blade), (top, bottom)))

    @property
    def block(self) -> list[tuple[float, float]]:
        """Corners (s, n) of the block [m]."""
        return list(product((self.half_length, -self.half_length), (self.half_thickness, -self.half_thickness)))

    def depth(self, theta: float) -> tuple[float, float]:
        """Depth of the block's lowest corner below its centre at angle θ [m], and its derivative [m/rad]."""
        s, c = np.sin(theta), np.cos(theta)
        along, across = np.copysign(self.half_length, s), np.copysign(self.half_thickness, c)
        return float(along * s + across * c), float(along * c - across * s)


@dataclass(frozen=True)
class Trajectory:
    """Linearisation point: states (N + 1, 6), inputs (N, 3), and which samples it has.

    A motion that is planned again begins inside a sample: `passed` [s] of its first interval are gone.  before (3,):
    the acceleration in force when it begins, None: it begins at rest.
    """

    states: Floats
    inputs: Floats
    n_contact: int
    n_flight: int
    sampling_time: float
    passed: float = 0.0
    before: Floats | None = None

    def between(self, other: Trajectory) -> Trajectory:
        """Half-way to another one, with its samples."""
        return replace(other, states=(self.states + other.states) / 2, inputs=(self.inputs + other.inputs) / 2)


def bound_law(x: Any, p: Any, margin: Any, slope: Any) -> None:
    """sign · x ≥ bound."""
    for i in range(x.shape[1]):
        sign, bound = p[0, i], p[1, i]
        margin[i] = sign * x[0, i] - bound
        slope[0, i] = sign


def contact_law(x: Any, p: Any, margin: Any, slope: Any) -> None:
    """along · F_s + across · F_n + turning · a_θ ≥ least, on (a_y, a_z, a_θ, θ): forces and moment per unit mass."""
    for i in range(x.shape[1]):
        a_y, lift, a_theta = x[0, i], x[1, i] - GRAVITY_Z, x[2, i]
        s, c = np.sin(x[3, i]), np.cos(x[3, i])
        f_s, f_n = a_y * c + lift * s, lift * c - a_y * s
        along, across, turning, least = p[0, i], p[1, i], p[2, i], p[3, i]
        margin[i] = along * f_s + across * f_n + turning * a_theta - least
        slope[0, i] = along * c - across * s
        slope[1, i] = along * s + across * c
        slope[2, i] = turning
        slope[3, i] = along * f_n - across * f_s


def clearance_law(x: Any, p: Any, margin: Any, slope: Any) -> None:
    """z + s sin θ + n cos θ ≥ floor: a corner (s, n) of what is at height z, on (z, θ)."""
    for i in range(x.shape[1]):
        s, n, floor = p[0, i], p[1, i], p[2, i]
        sine, cosine = np.sin(x[1, i]), np.cos(x[1, i])
        margin[i] = x[0, i] + s * sine + n * cosine - floor
        slope[0, i] = 1.0
        slope[1, i] = s * cosine - n * sine


def flight_law(x: Any, p: Any, margin: Any, slope: Any) -> None:
    """The same of a corner of the block, t after a release with (z, θ, v_z, v_θ)."""
    for i in range(x.shape[1]):
        s, n, floor, t = p[0, i], p[1, i], p[2, i], p[3, i]
        theta = x[1, i] + x[3, i] * t
        sine, cosine = np.sin(theta), np.cos(theta)
        turned = s * cosine - n * sine
        margin[i] = x[0, i] + x[2, i] * t + GRAVITY_Z * t * t / 2 + s * sine + n * cosine - floor
        slope[0, i] = 1.0
        slope[1, i] = turned
        slope[2, i] = t
        slope[3, i] = turned * t


def separation_law(x: Any, p: Any, margin: Any, slope: Any) -> None:
    """The block's corner (s, n), t after a release with x̂, is `gap` above the plane of a blade at (y, z, θ).

    With the corner's offset (y, z) from the control point:  offset · n(θ) + h ≥ gap,  h = −n being the block's half
    thickness.
    """
    for i in range(x.shape[1]):
        s, n, t, gap = p[0, i], p[1, i], p[2, i], p[3, i]
        turned = x[2, i] + x[5, i] * t
        block_s, block_c = np.sin(turned), np.cos(turned)
        tool_s, tool_c = np.sin(x[8, i]), np.cos(x[8, i])
        y = x[0, i] + x[3, i] * t - x[6, i] + s * block_c - n * block_s
        z = x[1, i] + x[4, i] * t + GRAVITY_Z * t * t / 2 - x[7, i] + s * block_s + n * block_c
        by_turn = (s * block_s + n * block_c) * tool_s + (s * block_c - n * block_s) * tool_c
        margin[i] = z * tool_c - y * tool_s - n - gap
        slope[0, i] = -tool_s
        slope[1, i] = tool_c
        slope[2, i] = by_turn
        slope[3, i] = -tool_s * t
        slope[4, i] = tool_c * t
        slope[5, i] = by_turn * t
        slope[6, i] = tool_s
        slope[7, i] = -tool_c
        slope[8, i] = -(y * tool_c + z * tool_s)


def contact(layout: Layout, scenario: Scenario, k: Indices) -> list[Constraint]:
    """Normal force, friction cone (7) and centre of pressure in the intervals k."""
    geometry, planner = Geometry.of(scenario), scenario.planner
    mu = scenario.object.friction * (1 - planner.friction_margin)
    reach = geometry.half_support * (1 - planner.support_margin)
    constraints = []
    for at in (k, k + 1):
        columns = [layout.u(k, 0), layout.u(k, 1), layout.u(k, 2), layout.x(at, 2)]
        constraints.append(Constraint.of(NORMAL, contact_law, columns, 0.0, 1.0, 0.0, planner.minimum_normal))
        for sign in (1.0, -1.0):
            constraints.append(Constraint.of(FRICTION, contact_law, columns, -sign, mu, 0.0, 0.0))
            # ±(k² a_θ − h F_s) ≤ reach · F_n; in units of acceleration, as the others
            along, turning = sign * geometry.half_thickness / reach, -sign * geometry.gyration / reach
            constraints.append(Constraint.of(SUPPORT, contact_law, columns, along, 1.0, turning, 0.0))
    return constraints


def release(layout: Layout, scenario: Scenario) -> list[Constraint]:
    """The tool has turned beyond π/2 when it releases."""
    angle = np.pi / 2 + scenario.planner.release_angle
    return [Constraint.of(RELEASE, bound_law, [layout.x(np.array([layout.release]), 2)], 1.0, angle)]


def workspace(layout: Layout, scenario: Scenario, k: Indices) -> list[Constraint]:
    """The object's centre, and later the blade, is inside the workspace at samples k."""
    return [
        Constraint.of(WORKSPACE, bound_law, [layout.x(k, component)], sign, sign * bound)
        for component, (low, high) in enumerate((scenario.task.workspace_y, scenario.task.workspace_z))
        for sign, bound in ((-1.0, high), (1.0, low))
    ]


def clearance(layout: Layout, corners: Iterable[tuple[float, float]], floor: float, k: Indices) -> list[Constraint]:
    """Corners (s, n) of what moves with the tool are above a height `floor` [m] at samples k."""
    columns = [layout.x(k, 1), layout.x(k, 2)]
    return [Constraint.of(CLEARANCE, clearance_law, columns, s, n, floor) for s, n in corners]


def separation(layout: Layout, scenario: Scenario, n_flight: int) -> list[Constraint]:
    """Once released, both lower corners of the flying block stay on their side of the blade's plane.

    The gap demanded grows as ½ a_sep t² up to `separation_gap`.  The block is taken to stay where it touches down, the
    tool where it comes to rest, whichever is first.
    """
    planner, r = scenario.planner, layout.release
    j = np.arange(1, max(layout.n_brake, n_flight) + 1)
    time, tool = np.minimum(j, n_flight) * planner.sampling_time, np.minimum(r + j, layout.intervals)
    gap = np.minimum(planner.separation_gap, planner.separation_acceleration * (j * planner.sampling_time) ** 2 / 2)
    columns = [layout.x(r, c) for c in range(6)] + [layout.x(tool, c) for c in range(3)]
    lower = [(s, n) for s, n in Geometry.of(scenario).block if n < 0]
    return [Constraint.of(SEPARATION, separation_law, columns, s, n, time, gap) for s, n in lower]


def in_flight(layout: Layout, scenario: Scenario, n_flight: int) -> list[Constraint]:
    """No corner of the flying block is below the table before the touch-down sample."""
    time = np.arange(1, n_flight) * scenario.planner.sampling_time
    columns = [layout.x(layout.release, component) for component in (1, 2, 4, 5)]
    height = scenario.table.height
    corners = Geometry.of(scenario).block
    return [Constraint.of(CLEARANCE, flight_law, columns, s, n, height, time) for s, n in corners]


def of_horizon(
    layout: Layout, scenario: Scenario, n_contact: int, n_flight: int, shift: float = 0.0
) -> list[Constraint]:
    """All but the joint limits, for a motion that starts n_contact samples before the release.

    shift: how far the block sits from the middle of the blade along s [m].
    """
    geometry, first = Geometry.of(scenario), layout.release - n_contact
    floor = scenario.table.height + scenario.planner.table_clearance
    blade = [(s - shift, n) for s, n in geometry.blade]
    upper = [(s, n) for s, n in geometry.block if n > 0]
    moving, carried = np.arange(first + 1, layout.intervals + 1), np.arange(first + 1, layout.release + 1)
    return [
        *contact(layout, scenario, np.arange(first, layout.release)),
        *release(layout, scenario),
        *workspace(layout, scenario, moving),
        *clearance(layout, blade, floor, moving),
        *clearance(layout, upper, floor, carried),
        *separation(layout, scenario, n_flight),
        *in_flight(layout, scenario, n_flight),
    ]


def landing_row(layout: Layout, point: Trajectory, scenario: Scenario) -> tuple[Floats, float]:
    """The block's lowest corner meets the table at touch-down: row (6,) and bound with row · x̂(release) = bound."""
    matrix, offset = flight(point.n_flight * point.sampling_time)
    theta = float((matrix @ point.states[layout.release] + offset)[2])
    depth, slope = Geometry.of(scenario).depth(theta)
    at_landing = np.array([0.0, 1.0, -slope, 0.0, 0.0, 0.0])
    return at_landing @ matrix, float(scenario.table.height + depth - slope * theta - at_landing @ offset)
