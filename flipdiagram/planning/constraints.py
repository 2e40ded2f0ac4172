"""Constraints of the motion, linearised about the last trajectory so that each solve is a QP.

With the trajectory's θ̄ and ā the contact forces per unit mass, F_s = (a − g)·s and F_n = (a − g)·n, become linear in
the unknowns: ds/dθ = n and dn/dθ = −s, hence F_s ≈ s̄·(a − g) + F̄_n (θ − θ̄), F_n ≈ n̄·(a − g) − F̄_s (θ − θ̄).
The acceleration is held over an interval while the tool turns on, so contact is demanded at both its ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.model import flight
from flipdiagram.planning.rows import Rows
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.contact import GRAVITY_Z, tool_normal, tool_tangent

FRICTION = "friction cone"
NORMAL = "normal force"
SUPPORT = "centre of pressure"
SEPARATION = "separation of blade and block"
CLEARANCE = "table clearance"
WORKSPACE = "workspace"
RELEASE = "release angle"

Terms = list[tuple[Any, Any]]
"""Pairs of columns and values, as `Rows.add` takes them."""


@dataclass(frozen=True)
class Geometry:
    """Sizes [m] that the constraints need, about the object's centre in the tool's (s, n) frame."""

    half_length: float
    half_thickness: float
    half_blade: float
    blade_thickness: float

    @classmethod
    def of(cls, scenario: Scenario) -> Geometry:
        """Take the sizes from a scenario."""
        thing, tool = scenario.object, scenario.tool
        return cls(thing.length / 2, thing.thickness / 2, tool.blade_width / 2, tool.blade_thickness)

    @property
    def gyration(self) -> float:
        """k² = I_θ / m of the block about the axis of the motion [m²]."""
        return (self.half_length**2 + self.half_thickness**2) / 3

    def depth(self, theta: float) -> tuple[float, float]:
        """Depth of the block's lowest corner below its centre at angle θ [m], and its derivative [m/rad]."""
        s, c = np.sin(theta), np.cos(theta)
        along, across = np.copysign(self.half_length, s), np.copysign(self.half_thickness, c)
        return float(along * s + across * c), float(along * c - across * s)


@dataclass(frozen=True)
class Trajectory:
    """Linearisation point: states (N + 1, 6), inputs (N, 3), and which samples it has."""

    states: Floats
    inputs: Floats
    n_contact: int
    n_flight: int
    sampling_time: float


def _contact_terms(
    layout: Layout, point: Trajectory, k: Indices, at: Indices
) -> tuple[tuple[Terms, Floats], tuple[Terms, Floats]]:
    """F_s and F_n of intervals k at samples `at`, each as (terms, constant): force ≈ Σ value·w[column] + constant."""
    theta, a = point.states[at, 2], point.inputs[k, :2]
    s, n = tool_tangent(theta), tool_normal(theta)
    lift = a - np.array([0.0, GRAVITY_Z])
    f_s, f_n = np.sum(lift * s, axis=-1), np.sum(lift * n, axis=-1)
    columns = (layout.u(k, 0), layout.u(k, 1), layout.x(at, 2))
    tangential = list(zip(columns, (s[:, 0], s[:, 1], f_n), strict=True)), -GRAVITY_Z * s[:, 1] - f_n * theta
    normal = list(zip(columns, (n[:, 0], n[:, 1], -f_s), strict=True)), -GRAVITY_Z * n[:, 1] + f_s * theta
    return tangential, normal


def _scaled(terms: Terms, factor: float) -> Terms:
    return [(column, factor * value) for column, value in terms]


def contact_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario) -> None:
    """Cone (7), normal force and centre of pressure in every interval of the contact phase, and the release angle."""
    stick_rows(rows, layout, point, scenario, np.arange(layout.release - point.n_contact, layout.release))
    rows.add(RELEASE, [(layout.x(layout.release, 2), -1.0)], [-(np.pi / 2 + scenario.planner.release_angle)])


def stick_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario, k: Indices) -> None:
    """Cone (7), normal force and centre of pressure in the intervals k."""
    geometry, planner = Geometry.of(scenario), scenario.planner
    mu = scenario.object.friction * (1 - planner.friction_margin)
    reach = geometry.half_length * (1 - planner.support_margin)
    for at in (k, k + 1):
        (tangential, f_s0), (normal, f_n0) = _contact_terms(layout, point, k, at)
        rows.add(NORMAL, _scaled(normal, -1.0), f_n0 - planner.minimum_normal)
        for sign in (1.0, -1.0):
            rows.add(FRICTION, [*_scaled(tangential, sign), *_scaled(normal, -mu)], mu * f_n0 - sign * f_s0)
            # ±(k² a_θ − h F_s) ≤ reach · F_n; rows in units of acceleration, as the others
            moment = [(layout.u(k, 2), sign * geometry.gyration / reach)]
            moment += _scaled(tangential, -sign * geometry.half_thickness / reach)
            rows.add(SUPPORT, [*moment, *_scaled(normal, -1.0)], f_n0 + sign * geometry.half_thickness / reach * f_s0)


def workspace_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario) -> None:
    """The object's centre, and later the blade, stays inside the workspace."""
    k = np.arange(layout.release - point.n_contact + 1, layout.intervals + 1)
    for component, (low, high) in enumerate((scenario.task.workspace_y, scenario.task.workspace_z)):
        rows.add(WORKSPACE, [(layout.x(k, component), 1.0)], np.full(k.size, high))
        rows.add(WORKSPACE, [(layout.x(k, component), -1.0)], np.full(k.size, -low))


def clearance_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario, shift: float = 0.0) -> None:
    """Every corner of the blade, and of the block while it is carried, keeps its distance to the table.

    shift: how far the block sits from the middle of the blade along s [m].
    """
    geometry = Geometry.of(scenario)
    floor = scenario.table.height + scenario.planner.table_clearance
    h, width = geometry.half_thickness, geometry.half_blade
    blade = [(sign * width - shift, -h - t) for sign, t in product((1, -1), (0.0, geometry.blade_thickness))]
    block = [(sign * geometry.half_length, h) for sign in (1, -1)]
    first = layout.release - point.n_contact + 1
    for corners, last in ((blade, layout.intervals), (block, layout.release)):
        k = np.arange(first, last + 1)
        theta = point.states[k, 2]
        for s, n in corners:
            height = s * np.sin(theta) + n * np.cos(theta)
            slope = s * np.cos(theta) - n * np.sin(theta)
            rows.add(CLEARANCE, [(layout.x(k, 1), -1.0), (layout.x(k, 2), -slope)], height - slope * theta - floor)


def separation_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario) -> None:
    """Once released, both lower corners of the flying block stay on their side of the blade's plane.

    The gap demanded grows as ½ a_sep t² up to `separation_gap`.  The block is taken to stay where it touches down, the
    tool where it comes to rest, whichever is first.
    """
    geometry, planner, dt = Geometry.of(scenario), scenario.planner, point.sampling_time
    h, r = geometry.half_thickness, layout.release
    j = np.arange(1, max(layout.n_brake, point.n_flight) + 1)
    at = np.minimum(r + j, layout.intervals)
    time = np.minimum(j, point.n_flight) * dt
    gap = np.minimum(planner.separation_gap, planner.separation_acceleration * (j * dt) ** 2 / 2)
    released = point.states[r]
    block = released[:2] + np.outer(time, released[3:5])
    block[:, 1] += GRAVITY_Z * time**2 / 2
    block_angle = released[2] + released[5] * time
    tool, angle = point.states[at, :2], point.states[at, 2]
    n, s = tool_normal(angle), tool_tangent(angle)
    for side in (1, -1):
        arm = side * geometry.half_length * tool_tangent(block_angle) - h * tool_normal(block_angle)
        d_arm = side * geometry.half_length * tool_normal(block_angle) + h * tool_tangent(block_angle)
        offset = block - tool + arm
        by_block_angle = np.sum(d_arm * n, axis=-1)
        by_tool_angle = -np.sum(offset * s, axis=-1)
        terms = [
            (layout.x(r, 0), n[:, 0]),
            (layout.x(r, 1), n[:, 1]),
            (layout.x(r, 3), n[:, 0] * time),
            (layout.x(r, 4), n[:, 1] * time),
            (layout.x(r, 2), by_block_angle),
            (layout.x(r, 5), by_block_angle * time),
            (layout.x(at, 0), -n[:, 0]),
            (layout.x(at, 1), -n[:, 1]),
            (layout.x(at, 2), by_tool_angle),
        ]
        value = np.sum(offset * n, axis=-1) + h
        at_point = np.sum((block - np.array([0, GRAVITY_Z / 2]) * time[:, None] ** 2 - tool) * n, axis=-1)
        at_point += by_block_angle * block_angle + by_tool_angle * angle
        rows.add(SEPARATION, _scaled(terms, -1.0), value - at_point - gap)


def flight_rows(rows: Rows, layout: Layout, point: Trajectory, scenario: Scenario) -> None:
    """No corner of the flying block is below the table before the touch-down sample."""
    geometry, r = Geometry.of(scenario), layout.release
    time = np.arange(1, point.n_flight) * point.sampling_time
    theta = point.states[r, 2] + point.states[r, 5] * time
    for s, n in product(
        (geometry.half_length, -geometry.half_length), (geometry.half_thickness, -geometry.half_thickness)
    ):
        height = s * np.sin(theta) + n * np.cos(theta)
        slope = s * np.cos(theta) - n * np.sin(theta)
        terms = [
            (layout.x(r, 1), -1.0),
            (layout.x(r, 4), -time),
            (layout.x(r, 2), -slope),
            (layout.x(r, 5), -slope * time),
        ]
        rows.add(CLEARANCE, terms, height - slope * theta + GRAVITY_Z * time**2 / 2 - scenario.table.height)


def landing_row(layout: Layout, point: Trajectory, scenario: Scenario) -> tuple[Floats, float]:
    """The block's lowest corner meets the table at touch-down: row (6,) and bound with row · x̂(release) = bound."""
    matrix, offset = flight(point.n_flight * point.sampling_time)
    theta = float((matrix @ point.states[layout.release] + offset)[2])
    depth, slope = Geometry.of(scenario).depth(theta)
    at_landing = np.array([0.0, 1.0, -slope, 0.0, 0.0, 0.0])
    return at_landing @ matrix, float(scenario.table.height + depth - slope * theta - at_landing @ offset)
