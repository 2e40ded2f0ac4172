"""The start of a run at equilibrium: against long holds, potential energy, and a controller of the user's own."""

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem
from shared import ideal_plan

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import NoEquilibriumError, ScenarioError
from flipdiagram.flips.flight import fly
from flipdiagram.simulation.simulate import simulate

IMPERFECT = {"sensors.encoder_resolution": 1e-5, "sensors.delay": 3, "sensors.velocity_cutoff": 62.8}


def held(architecture, seconds, fields):
    """Joint angles, torque and the block in the tool's frame after a hold that began at rest at the start pose."""
    scenario = IDEAL.with_overrides({"simulation.start": "hold", "simulation.hold_time": seconds + 1.0} | fields)
    return state_after(build_loop(scenario, architecture), seconds)


def state_after(loop, seconds):
    context = loop.context(ideal_plan())
    simulator = Simulator(loop.diagram, context)
    simulator.AdvanceTo(seconds)
    plant, parts, tau = loop.cell.plant, loop.cell.parts, loop.boxes.torque_limit.GetOutputPort("tau")
    mine = plant.GetMyContextFromRoot(context)
    X_TB = parts.arm.tool.CalcPoseInWorld(mine).inverse() @ plant.GetFreeBodyPose(mine, parts.block)
    torque = tau.Eval(loop.boxes.torque_limit.GetMyContextFromRoot(context))
    return plant.GetPositions(mine, parts.arm.arm), torque, X_TB.translation()


QUICK = {"controller.k_p": 3000.0}
"""With it all poles are beyond 10 rad/s; with the paper's gains a hold of 2 s ends 0.3 mrad from where 20 s lead."""


@pytest.mark.parametrize(
    "architecture, seconds, fields",
    [
        ("pd+ff", 2.0, QUICK),
        ("pd", 2.0, QUICK | {"disturbance.block_offset": 0.01}),
        ("pd+dob", 2.0, QUICK | IMPERFECT | {"sensors.encoder_resolution": 0.0}),
        ("pd+ff+dob", 2.0, QUICK | {"controller.gravity_compensation": 0.5, "simulation.step": 0.0005}),
        ("pd+ff+dob", 8.0, {}),
    ],
)
def test_it_is_where_a_long_hold_ends(architecture, seconds, fields):
    q, tau, block = held(architecture, seconds, fields)
    loop = build_loop(IDEAL.with_overrides(fields), architecture)
    np.testing.assert_allclose(loop.equilibrium.q, q, atol=1e-6)
    after = state_after(loop, 0.09)
    np.testing.assert_allclose(after[0], q, atol=1e-6)
    np.testing.assert_allclose(after[1], tau, atol=1e-3)
    np.testing.assert_allclose(after[2][1:], block[1:], atol=1e-4)  # PD's blade is tilted: the block creeps along it


def test_nothing_moves_before_the_motion_starts():
    for architecture in ("pd", "pd+ff+dob"):
        scenario = IDEAL.with_overrides({"simulation.settle_time": 0.0})
        before = simulate(scenario, architecture, ideal_plan()).recording.sel(time=slice(-0.09, -0.002))
        assert before["time"].size > 85
        assert np.ptp(before["q"].values, axis=0).max() < 1e-7
        assert np.abs(before["qd"].values).max() < 1e-5
        weight = 0.061 * 9.81
        lifted = before["contact_force"].sel(pair="blade-block", direction="z").values
        np.testing.assert_allclose(lifted, weight, rtol=1e-3)


def test_joints_that_stick_start_unloaded_and_stay():
    """What rests is a range where joints stick; of it the run takes what an endless hold without friction ends in."""
    sticking = IDEAL.with_overrides({"joint_friction.model": "elasto-plastic"})
    loop = build_loop(sticking, "pd+dob")
    np.testing.assert_array_equal(loop.equilibrium.q, build_loop(IDEAL, "pd+dob").equilibrium.q)
    q, _, _ = state_after(loop, 0.09)
    np.testing.assert_allclose(q, loop.equilibrium.q, atol=1e-7)


def test_noise_and_rounding_do_not_move_the_equilibrium():
    """It is that of a sensor without error; the encoder's steps would leave no solution."""
    plain = build_loop(IDEAL, "pd+ff+dob").equilibrium.q
    noisy = IDEAL.with_overrides({"sensors.position_noise": 1e-3, "sensors.velocity_noise": 0.1} | IMPERFECT)
    np.testing.assert_allclose(build_loop(noisy, "pd+ff+dob").equilibrium.q, plain, atol=1e-9)


def test_sensors_have_seen_the_equilibrium_for_long():
    scenario = IDEAL.with_overrides(IMPERFECT | {"sensors.encoder_resolution": 0.0})
    loop = build_loop(scenario, "pd")
    context, q = loop.context(), loop.equilibrium.q
    boxes = loop.sensing.boxes
    delayed = boxes["delayed_q"].GetOutputPort("y").Eval(boxes["delayed_q"].GetMyContextFromRoot(context))
    np.testing.assert_array_equal(delayed, q)
    np.testing.assert_array_equal(
        boxes["velocity"].GetOutputPort("v").Eval(boxes["velocity"].GetMyContextFromRoot(context)), 0.0
    )


@pytest.mark.parametrize("fields", [{}, {"task.yaw": 0.4}, {"disturbance.payload": 0.5, "object.mass": 0.3}])
def test_the_holding_torque_is_the_slope_of_the_potential_energy(fields):
    """U(q) of arm, payload and block, the block carried with the tool; differences against the Jacobian's answer."""
    loop = build_loop(IDEAL.with_overrides(fields))
    plant, context = loop.cell.plant, loop.diagram.CreateDefaultContext()
    mine = plant.GetMyContextFromRoot(context)

    def energy(q):
        loop.cell.stand(context, q)
        return plant.CalcPotentialEnergy(mine)

    for q in (loop.q_start, loop.q_start + [0.3, 0.2, -0.3, 0.4, 0.2, 0.1]):
        steps = 1e-5 * np.eye(6)
        slope = [(energy(q + step) - energy(q - step)) / 2e-5 for step in steps]
        np.testing.assert_allclose(loop.cell.holding_torque(q), slope, atol=1e-6)


def test_the_start_is_the_scenarios_choice():
    by = {start: build_loop(IDEAL.with_overrides({"simulation.start": start}), "pd") for start in ("hold", "switch-on")}
    for loop in by.values():
        plant, mine = loop.cell.plant, loop.cell.plant.GetMyContextFromRoot(loop.context())
        np.testing.assert_array_equal(plant.GetPositions(mine, loop.cell.parts.arm.arm), loop.q_start)
    assert [IDEAL.simulation.lead_time, by["hold"].mpc.start_time, by["switch-on"].mpc.start_time] == [0.1, 2.0, 0.0]
    with pytest.raises(ScenarioError, match="hold_time' = 0.5 is not valid; valid is null or 0"):
        IDEAL.with_overrides({"simulation.start": "switch-on", "simulation.hold_time": 0.5})


class Integral(LeafSystem):
    """PID of the tool: a_ref = k_p e + k_v e' + k_i w, w the sum of e."""

    k_i = 1000.0

    def __init__(self):
        super().__init__()
        for name in ("x_cmd", "v_cmd", "x", "v"):
            self.DeclareVectorInputPort(name, 6)
        self.DeclareDiscreteState(6)
        self.DeclarePeriodicDiscreteUpdateEvent(0.001, 0.0, lambda c, s: s.set_value(self._w(c) + 0.001 * self._e(c)))
        self.DeclareVectorOutputPort("a_ref", 6, self._output)

    def _w(self, context):
        return context.get_discrete_state_vector().CopyToVector()

    def _e(self, context):
        return self.GetInputPort("x_cmd").Eval(context) - self.GetInputPort("x").Eval(context)

    def _output(self, context, output):
        v = self.GetInputPort("v_cmd").Eval(context) - self.GetInputPort("v").Eval(context)
        output.set_value(350.0 * self._e(context) + 120.0 * v + self.k_i * self._w(context))


def test_the_integrator_of_a_users_own_box_carries_the_load():
    loop = build_loop(IDEAL, "pd", replace={"pd": Integral()})
    np.testing.assert_allclose(loop.equilibrium.q, loop.q_start, atol=1e-9)
    q, _, _ = state_after(loop, 0.09)
    np.testing.assert_allclose(q, loop.q_start, atol=1e-7)
    assert np.abs(loop.equilibrium.states["pd"]).max() > 1e-3


class Counting(Integral):
    """Counts its periods, which no output depends on, in the place of summing the error."""

    k_i = 0.0

    def _e(self, context):
        return np.zeros(6)

    def _w(self, context):
        return super()._w(context) + 1.0


@pytest.mark.parametrize(
    "fields, replace, reason",
    [
        ({}, {"pd": Counting}, "pd does not come to rest"),
        ({"arm.torque_scale": 0.03}, {}, "joint L would need more than its 6.42 N m"),
        ({"controller.k_p": 60.0}, {}, "the table would carry the blade or the block"),
    ],
)
def test_where_there_is_none_one_line_says_what_to_do(fields, replace, reason):
    loop = build_loop(IDEAL.with_overrides(fields), "pd", replace=replace)
    with pytest.raises(NoEquilibriumError, match=f"no equilibrium to start from: {reason}") as caught:
        loop.context()
    assert "valid is simulation.start: hold or switch-on" in str(caught.value) and "\n" not in str(caught.value)


def test_a_world_in_which_the_arm_cannot_be_held_is_an_outcome_of_its_own():
    weak = IDEAL.with_overrides({"arm.torque_scale": 0.03})
    outcome = fly(weak, "pd", ideal_plan(), None)
    assert outcome.mode == "no start" and outcome.failure.startswith("no start: no equilibrium to start from: joint L")
