"""Plan of laying an object down: stick, slide, and away with the blade (eqs. (7) and (8)).

1. carry: from the start to above the table, tilted just below the friction angle, the object sticking (7); the blade
   stops as high above it as a flip keeps it, because the servo lags most where a fast motion ends;
2. sink to the table while tilting beyond the friction angle: the object slides, |φ| between ϕ and π/2 (8);
3. wait until its lower edge stands on the table, and draw the blade away along itself.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.errors import PlanningError
from flipdiagram.planning import constraints, limits
from flipdiagram.planning.arm_motion import ArmMotion, task_pose
from flipdiagram.planning.constraints import Geometry
from flipdiagram.planning.horizon import Layout
from flipdiagram.planning.plan import Plan
from flipdiagram.planning.rows import Constraint
from flipdiagram.planning.segment import segment
from flipdiagram.planning.slide import Slide, tilt_for
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import loaded_arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory import contact

CARRY_SAMPLES = (40, 60, 80, 120, 160)
"""Durations tried for the carrying, in samples: the first that the contact and the joints allow."""

TILT_ITERATIONS = 5


@dataclass(frozen=True)
class PlacingPlan:
    """The motion as a Plan for the MPC, and when and how the object slides in it."""

    plan: Plan
    slide: Slide
    slide_begins: float
    """When the blade passes the friction angle [s]."""
    retreat_begins: float
    """When the blade begins to be drawn away [s]."""
    landing: Floats
    """Where the object is meant to lie: y, z [m]."""
    after_carry: int
    """Samples in which the object is on the blade, after the carrying."""

    def displacement(self, t: Floats) -> Floats:
        """Planned σ(t) [m] of the object along the blade, until the blade is drawn away."""
        return self.slide.displacement(np.asarray(t) - self.slide_begins)


class Placer:
    """Plans the laying down of one scenario."""

    def __init__(self, scenario: Scenario, arm: ArmModel) -> None:
        self.scenario, self.arm = scenario, arm
        self.geometry = Geometry.of(scenario)
        self.settings = scenario.place

    def plan(self) -> PlacingPlan:
        """The first motion that contact and joints allow; raises PlanningError saying what stands in the way."""
        begin = time.perf_counter()
        reasons = []
        for samples in CARRY_SAMPLES:
            try:
                return self._attempt(samples, begin)
            except PlanningError as error:
                reasons.append(str(error))
        raise PlanningError(f"the object cannot be laid down: {reasons[-1]}")

    def _attempt(self, carry_samples: int, begin: float) -> PlacingPlan:
        settings, geometry = self.settings, self.geometry
        dt = settings.sampling_time
        mu = self.scenario.object.friction
        below = beyond = float(np.arctan(mu)) - settings.carry_margin
        for _ in range(TILT_ITERATIONS):  # the way to the table depends a little on the tilt
            beyond = tilt_for(mu, self._way(beyond), settings.speed, settings.tilt_margin)
        start = np.array([self.scenario.task.start_y, self.scenario.task.start_z, 0.0])
        way = self._way(beyond)
        slide = Slide(beyond, mu, way)
        edge_y = settings.target_y - geometry.half_length  # where the object's lower edge shall stand
        above = self._pose(below, edge_y, way, self._carried_above)
        tilted = self._pose(beyond, edge_y, way, settings.edge_clearance)
        away = tilted + settings.retreat * np.array([np.cos(beyond), np.sin(beyond), 0.0])
        times = settings.tilt_time, slide.duration + settings.wait, settings.retreat_time
        samples = carry_samples, *(max(4, round(t / dt)) for t in times)
        carry, tilt, waiting, retreat = (Layout(count, 0) for count in samples)
        still = np.tile([*tilted, 0.0, 0.0, 0.0], (waiting.intervals + 1, 1))
        pieces = [
            segment(start, above, self.carrying(carry), carry, dt),
            segment(above, tilted, self._free(tilt, settings.edge_clearance), tilt, dt),
            (still, np.zeros((waiting.intervals, 3))),
            segment(tilted, away, self._free(retreat, settings.edge_clearance), retreat, dt),
        ]
        states = np.vstack([pieces[0][0], *(piece[0][1:] for piece in pieces[1:])])
        inputs = np.vstack([piece[1] for piece in pieces])
        contact_samples = sum(len(piece[1]) for piece in pieces[:3])
        slide_begins = self._passes(states, np.arctan(mu), carry_samples)
        plan = self._finished(states, inputs, contact_samples, carry_samples, begin)
        landing = np.array([settings.target_y, self.scenario.table.height + geometry.half_thickness])
        after = contact_samples - carry_samples
        return PlacingPlan(plan, slide, slide_begins, contact_samples * dt, landing, after)

    def _way(self, tilt: float) -> float:
        """How far the object slides until its lower edge reaches the table [m]."""
        g = self.geometry
        over = (self.settings.edge_clearance + g.blade_thickness * np.cos(tilt)) / np.sin(tilt)
        return float(g.half_blade - g.half_length + over)

    @property
    def _carried_above(self) -> float:
        """How far above the table the blade stays while it carries [m]."""
        return max(self.scenario.planner.table_clearance, self.settings.edge_clearance)

    def _pose(self, tilt: float, edge_y: float, way: float, above: float) -> Floats:
        """(y, z, θ) of the control point with the blade's lower edge that far above the table [m], in line with where
        the object's edge lands.
        """
        g, table = self.geometry, self.scenario.table.height
        s, n = contact.tool_tangent(tilt), contact.tool_normal(tilt)
        middle_z = table + above + g.half_blade * s[1] + g.blade_thickness * n[1]
        middle_y = edge_y + (way + g.half_length) * s[0]
        return np.array([middle_y, middle_z, 0.0]) + np.array([*(g.half_thickness * n), tilt])

    def carrying(self, layout: Layout, shift: float = 0.0) -> list[Constraint]:
        """Constraints while the object sticks; shift: how far it sits from the middle of the blade along s [m]."""
        sticks = constraints.contact(layout, self.scenario, np.arange(layout.intervals))
        return sticks + self._free(layout, self._carried_above, shift)

    def _free(self, layout: Layout, above: float, shift: float = 0.0) -> list[Constraint]:
        """The workspace, and every corner of the blade that far above the table, less half of the edge's clearance."""
        g, floor = self.geometry, self.scenario.table.height + above - self.settings.edge_clearance / 2
        lower = [(s - shift, n) for s, n in g.blade if n < -g.half_thickness]
        return [
            *constraints.workspace(layout, self.scenario, np.arange(1, layout.intervals + 1)),
            *constraints.clearance(layout, lower, floor, np.arange(1, layout.intervals)),
        ]

    def _passes(self, states: Floats, angle: float, first: int) -> float:
        theta = states[first:, 2]
        k = int(np.argmax(theta > angle))
        share = (angle - theta[k - 1]) / (theta[k] - theta[k - 1]) if k else 0.0
        return float((first + k - 1 + share) * self.settings.sampling_time)

    def _finished(self, states: Floats, inputs: Floats, contact_samples: int, carried: int, begin: float) -> Plan:
        arm, scenario = self.arm, self.scenario
        pose = task_pose(states[0], scenario.task.start_x)
        q_start = arm.inverse_kinematics(pose, through=[task_pose(states[-1], scenario.task.start_x)])
        # the object counts as long as it may be on the blade, where it was when it began to slide
        mover = ArmMotion(arm, scenario.task.start_x, loaded_arm_of(scenario))
        motion = mover.follow(states, inputs, q_start, contact_samples)
        use = {kind: float(values.max()) for kind, values in limits.limit_use(motion, arm).items()}
        for kind, value in use.items():
            if value > 1:
                text = f"{kind} cannot be met: {value:.2f} x the limit would be needed"
                bare = mover.follow(states, inputs, q_start)
                most = limits.largest_mass(bare, motion, scenario.object.mass, arm) if kind == limits.TORQUE else 0.0
                most = math.floor(100 * most) / 100
                raise PlanningError(f"{text}; largest mass for this arm: {most:g} kg" if most else text)
        phi = contact.sliding_angle(inputs[:carried, :2], states[:carried, 2])
        return Plan(
            sampling_time=self.settings.sampling_time,
            n_contact=contact_samples,
            n_flight=1,
            n_brake=len(inputs) - contact_samples,
            states=states,
            inputs=inputs,
            cost=0.0,
            residual=0.0,
            max_sliding_angle=float(np.abs(phi).max()),
            friction_angle=float(contact.friction_angle(scenario.object.friction)),
            limit_use=use,
            solver="clarabel",
            iterations=1,
            solve_time=time.perf_counter() - begin,
        )
