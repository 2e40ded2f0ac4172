"""The cell against closed forms, conservation laws and bodies at rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from ideal import IDEAL
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from flipdiagram.errors import InputError, rounded_up
from flipdiagram.plants.cell import add_cell
from flipdiagram.robot.parts import arm_of

G = 9.81
STEP = 0.001


class Bench:
    """The cell alone, a constant torque on its arm."""

    def __init__(self, scenario, torque=None):
        self.arm = arm_of(scenario)
        self.q = self.arm.inverse_kinematics(
            [scenario.task.start_y, scenario.task.start_z, 0.0, scenario.task.start_x, 0.0, 0.0]
        )
        builder = DiagramBuilder()
        self.cell = add_cell(builder, scenario, self.arm)
        source = builder.AddSystem(ConstantVectorSource(np.zeros(6) if torque is None else torque))
        builder.Connect(source.get_output_port(), self.cell.tau)
        builder.ExportOutput(self.cell.contact_wrench, "wrench")
        self.diagram = builder.Build()

    def start(self, X_WB, V_WB=None, lock=True):
        """A simulator at time 0, arm at the start pose, locked or free; block at a pose with a velocity."""
        plant, parts = self.cell.plant, self.cell.parts
        context = self.diagram.CreateDefaultContext()
        self.context = plant.GetMyMutableContextFromRoot(context)
        plant.SetPositions(self.context, parts.arm.arm, self.q)
        plant.SetFreeBodyPose(self.context, parts.block, X_WB)
        if V_WB is not None:
            plant.SetFreeBodySpatialVelocity(self.context, parts.block, V_WB)
        if lock:
            for index in plant.GetJointIndices(parts.arm.arm):
                joint = plant.get_joint(index)
                if joint.num_velocities() == 1:
                    joint.Lock(self.context)
        simulator = Simulator(self.diagram, context)
        simulator.Initialize()
        return simulator

    def block(self):
        X_WB = self.cell.plant.EvalBodyPoseInWorld(self.context, self.cell.parts.block)
        V_WB = self.cell.plant.EvalBodySpatialVelocityInWorld(self.context, self.cell.parts.block)
        return X_WB, V_WB

    def force(self, simulator):
        return self.diagram.GetOutputPort("wrench").Eval(simulator.get_context())[:9].reshape(3, 3)


@pytest.fixture(scope="module")
def bench():
    return Bench(IDEAL)


def on_blade(scenario):
    return RigidTransform([scenario.task.start_x, scenario.task.start_y, scenario.task.start_z])


def on_table(scenario):
    return RigidTransform([0.5, 0.1, scenario.table.height + scenario.object.thickness / 2])


@pytest.mark.parametrize(("place", "pair"), [(on_blade, 0), (on_table, 1)])
def test_a_block_at_rest_stays_at_rest_and_its_weight_is_carried(bench, place, pair):
    scenario = IDEAL
    X_0 = place(scenario)
    simulator = bench.start(X_0)
    simulator.AdvanceTo(1.0)
    X, V = bench.block()
    # the soft block sinks in by micrometres, then nothing moves
    assert np.abs(X.translation() - X_0.translation()).max() < 5e-6
    assert X_0.rotation().InvertAndCompose(X.rotation()).ToAngleAxis().angle() < 1e-5
    assert np.abs(V.get_coeffs()).max() < 1e-6
    expected = np.zeros((3, 3))
    expected[pair, 2] = scenario.object.mass * G
    np.testing.assert_allclose(bench.force(simulator), expected, atol=1e-5)


@hypothesis_settings(max_examples=8)
@given(velocity=st.tuples(*[st.floats(-1.5, 1.5)] * 3), spin=st.floats(-20, 20), milliseconds=st.integers(1, 300))
def test_free_flight_follows_the_steppers_closed_form_and_the_parabola(bench, velocity, spin, milliseconds):
    p_0, v_0 = np.array([0.5, 0.0, 3.0]), np.array(velocity)
    simulator = bench.start(RigidTransform(p_0), SpatialVelocity([spin, 0, 0], v_0))
    simulator.AdvanceTo(milliseconds * STEP)
    X, V = bench.block()
    k, t, gravity = milliseconds, milliseconds * STEP, np.array([0, 0, -G])
    # semi-implicit Euler: v_k = v_0 + k h g, p_k = p_0 + h (v_1 + … + v_k)
    np.testing.assert_allclose(V.translational(), v_0 + t * gravity, atol=1e-9)
    np.testing.assert_allclose(X.translation(), p_0 + t * v_0 + gravity * STEP**2 * k * (k + 1) / 2, atol=1e-9)
    # the parabola lies half a step's velocity gain away: order h
    parabola = p_0 + t * v_0 + gravity * t**2 / 2
    np.testing.assert_allclose(X.translation(), parabola, atol=G * t * STEP / 2 + 1e-9)
    # x is a principal axis: the spin about it stays, and each step adds h ω/2 to the quaternion and normalises it
    np.testing.assert_allclose(V.rotational(), [spin, 0, 0], atol=1e-9)
    turned = k * 2 * np.arctan(spin * STEP / 2)
    assert abs((RollPitchYaw(X.rotation()).roll_angle() - turned + np.pi) % (2 * np.pi) - np.pi) < 1e-9


def test_a_landing_block_gives_the_table_its_momentum(bench):
    scenario = IDEAL
    drop = on_table(scenario).translation() + [0, 0, 0.02]
    simulator = bench.start(RigidTransform(drop))
    impulse, mass, end = 0.0, scenario.object.mass, 0.4
    for k in range(round(end / STEP)):
        simulator.AdvanceTo(k * STEP)
        # the force of the step that begins at t
        impulse += bench.force(simulator)[1, 2] * STEP
    simulator.AdvanceTo(end)
    _, V = bench.block()
    gained = mass * V.translational()[2]
    assert gained == pytest.approx(impulse - mass * G * end, abs=1e-6)
    assert abs(gained) < 1e-6


def test_joint_friction_only_takes_energy(bench):
    simulator = bench.start(RigidTransform([0.5, 0, 5.0]), lock=False)
    plant, context = bench.cell.plant, bench.context
    energies = []
    for k in range(0, 300, 10):
        simulator.AdvanceTo(k * STEP)
        potential = plant.CalcPotentialEnergy(context)
        energies.append(potential + plant.CalcKineticEnergy(context))
    # without a torque nothing can raise the energy by more than the stepper's error of order h
    assert energies[-1] < energies[0] - 0.1
    assert np.diff(energies).max() < 2e-3 * (energies[0] - energies[-1])


def test_blade_and_table_report_their_contact():
    scenario = IDEAL.with_overrides({"table.height": 0.35})
    bench = Bench(scenario)
    simulator = bench.start(RigidTransform([0.5, 0.2, 2.0]), lock=False)  # Drake drops contacts of locked bodies
    force = bench.force(simulator)
    # the blade stands 7 mm into the table: it is pushed up, the block is left alone
    assert force[2, 2] > 0
    np.testing.assert_array_equal(force[:2], 0)


@hypothesis_settings(max_examples=4)
@given(table=st.floats(0.05, 0.15), block=st.floats(0.1, 2.0))
def test_a_sliding_block_is_braked_by_the_combined_friction(table, block):
    bench = Bench(IDEAL.with_overrides({"object.friction": block, "table.friction": table}))
    # slowly and on little friction: Drake's convex contact lifts a block that is set sliding fast
    simulator = bench.start(on_table(IDEAL), SpatialVelocity([0, 0, 0], [0, -0.4, 0]))
    settled, milliseconds = 0.06, 20
    simulator.AdvanceTo(settled)
    _, V_0 = bench.block()
    simulator.AdvanceTo(settled + milliseconds * STEP)
    _, V_1 = bench.block()
    mu = 2 * table * block / (table + block)
    braked = (V_1.translational()[1] - V_0.translational()[1]) / (milliseconds * STEP)
    assert braked == pytest.approx(mu * G, rel=0.02)


def test_friction_that_would_chatter_is_refused():
    scenario = IDEAL.with_overrides({"joint_friction.transition_velocity": 0.001})
    with pytest.raises(InputError, match=r"transition_velocity' = 0.001 .* valid is at least"):
        Bench(scenario)


STICKING = {"joint_friction.model": "elasto-plastic"}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"joint_friction.presliding": 1e-5}, r"presliding' = 1e-05 rad makes joint T chatter .* valid is at least"),
        ({"joint_friction.viscous": 3.0}, r"viscous' = 3.0 is unstable at this step; valid is below"),
    ],
)
def test_sticking_that_would_chatter_is_refused(fields, message):
    with pytest.raises(InputError, match=message):
        Bench(IDEAL.with_overrides(STICKING | fields))


def test_the_least_value_that_a_message_names_is_valid():
    for value, text in ((0.00013371, "0.0001338"), (2.3, "2.3"), (11.11951, "11.12"), (9999.6, "1e+04"), (0.0, "0")):
        assert rounded_up(value) == text
    with pytest.raises(InputError) as caught:
        Bench(IDEAL.with_overrides({"joint_friction.transition_velocity": 0.001}))
    named = float(str(caught.value).split("at least ")[1].split()[0])
    Bench(IDEAL.with_overrides({"joint_friction.transition_velocity": named}))


@pytest.mark.parametrize("joints", ["rigid", "elastic"])
def test_the_smallest_presliding_that_is_valid_does_not_chatter_and_the_arm_comes_to_rest(joints):
    """All joints coupled, the smallest inertia included: struck, they come to rest, bent by what loads them."""
    kind = STICKING | {"joints.model": joints, "joint_friction.coulomb": 0.1}
    with pytest.raises(InputError) as caught:
        Bench(IDEAL.with_overrides(kind | {"joint_friction.presliding": 1e-6}))
    scenario = IDEAL.with_overrides(kind | {"joint_friction.presliding": 1.001 * caught.value.valid})
    arm = arm_of(scenario)
    bench = Bench(scenario, arm.gravity_torque(Bench(scenario).q) + 0.4 * 0.1 * arm.tau_rated)
    simulator = bench.start(RigidTransform([0.5, 0, 50.0]), lock=False)
    bench.cell.plant.SetVelocities(bench.context, bench.cell.parts.arm.arm, np.full(6, 0.05))
    moved = []
    for k in range(1, 60):
        simulator.AdvanceTo(0.01 * k)
        moved.append(np.abs(bench.cell.plant.GetVelocities(bench.context, bench.cell.parts.arm.arm)).max())
    assert moved[-1] < 1e-3 * moved[0]  # to chatter would be to keep 0.01 rad/s and more
