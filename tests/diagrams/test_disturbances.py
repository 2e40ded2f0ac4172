"""What neither plan nor controller knows, and the boxes that answer to it: each field against its effect in the diagram."""

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from shared import ideal_plan

from flipdiagram.diagrams.controller import nominal_inertia
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError
from flipdiagram.planning import plan_motion
from flipdiagram.robot.parts import add_parts, arm_of
from flipdiagram.scenario.scenario import JOINTS, field_paths
from flipdiagram.simulation.simulate import simulate

G = 9.81
# critically damped and without friction, so that half a second is long enough to come to rest
QUIET = {
    "joint_friction.coulomb": 0.0,
    "joint_friction.viscous": 0.0,
    "controller.k_v": 2 * 350.0**0.5,
    "controller.g_dis": 30.0,
    "simulation.hold_time": 1.0,
}


class AtRest:
    """The loop after its hold: angles, torques, and how far the control point is from the command."""

    def __init__(self, architecture, **fields):
        self.scenario = IDEAL.with_overrides(QUIET | {name.replace("__", "."): v for name, v in fields.items()})
        loop = build_loop(self.scenario, architecture)
        simulator = Simulator(loop.diagram, loop.context(ideal_plan()))
        simulator.AdvanceTo(self.scenario.simulation.hold_time - 0.01)
        context = simulator.get_context()
        mine = loop.cell.plant.GetMyContextFromRoot(context)
        self.arm, self.q_start = loop.arm, loop.q_start
        self.q = loop.cell.plant.GetPositions(mine, loop.cell.parts.arm.arm)
        self.qd = loop.cell.plant.GetVelocities(mine, loop.cell.parts.arm.arm)
        self.tau = loop.boxes.torque_limit.GetOutputPort("tau").Eval(
            loop.boxes.torque_limit.GetMyContextFromRoot(context)
        )
        observer = loop.boxes.disturbance_observer
        if observer is not None:
            self.tau_dis = observer.GetOutputPort("tau_dis").Eval(observer.GetMyContextFromRoot(context))
        assert np.abs(self.qd).max() < 2e-4
        self.error = (
            self.arm.task_position_velocity(self.q, self.qd)[0]
            - (self.arm.task_position_velocity(self.q_start, self.qd)[0])
        )

    def weight(self, mass, frame):
        """Torques (6,) [N m] that hold a mass [kg] at the origin of a frame: J^T m g, from a plant of the test's own."""
        plant = MultibodyPlant(0.0)
        parts = add_parts(plant, IDEAL)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, parts.arm.arm, self.q)
        world = plant.world_frame()
        jacobian = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, getattr(parts.arm, frame), np.zeros(3), world, world
        )
        return jacobian[2, :6] * mass * G

    @property
    def block(self):
        return self.weight(self.scenario.object.mass, "control_point")

    def sag(self, torque):
        """Where the PD's torque M_n J⁻¹ k_p e balances a torque it does not know, (6,) in task space."""
        jacobian = self.arm.task_kinematics(self.q, np.zeros(6))[2]
        inertia = nominal_inertia(self.scenario, self.arm, self.q_start)
        return -jacobian @ (torque / inertia) / self.scenario.controller.k_p


@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_the_pd_arm_sags_by_the_gravity_that_is_left_to_feedback(fraction):
    rest = AtRest("pd", controller__gravity_compensation=fraction)
    weight = rest.arm.gravity_torque(rest.q)
    np.testing.assert_allclose(rest.tau, weight + rest.block, atol=0.02)
    np.testing.assert_allclose(rest.error, rest.sag((1 - fraction) * weight + rest.block), rtol=0.02, atol=2e-5)
    sag = -rest.error[1]
    assert (sag < 5e-3) == (fraction == 1.0), sag  # [m]: under the block alone, or under the arm


def test_the_observer_does_not_observe_what_is_fed_forward():
    """With all gravity fed forward it finds the block's weight alone; with none, both.  Never gravity twice."""
    for fraction in (1.0, 0.0):
        rest = AtRest("pd+dob", controller__gravity_compensation=fraction)
        weight = rest.arm.gravity_torque(rest.q)
        np.testing.assert_allclose(rest.tau, weight + rest.block, atol=0.02)
        np.testing.assert_allclose(rest.tau_dis, (1 - fraction) * weight + rest.block, atol=0.02)
        assert np.abs(rest.error[:3]).max() < 1e-4
        assert np.abs(weight).max() > 10.0  # [N m]: the difference would be seen


def test_an_unknown_payload_is_held_by_feedback_alone():
    rest = AtRest("pd", controller__gravity_compensation=1.0, disturbance__payload=1.0)
    load = rest.weight(1.0, "flange")
    assert np.abs(load).max() > 3.0
    np.testing.assert_allclose(rest.tau, rest.arm.gravity_torque(rest.q) + load + rest.block, atol=0.02)
    np.testing.assert_allclose(rest.error, rest.sag(load + rest.block), rtol=0.02, atol=2e-5)


def test_the_payload_hangs_at_the_flange_and_is_known_to_the_cell_alone():
    scenario = IDEAL.with_overrides({"disturbance.payload": 0.7})
    masses = []
    for chosen in (IDEAL, scenario):
        plant = MultibodyPlant(0.0)
        parts = add_parts(plant, chosen)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        masses.append(plant.CalcTotalMass(context))
    assert masses[1] - masses[0] == pytest.approx(0.7, rel=1e-12)
    place = plant.CalcRelativeTransform(context, parts.arm.flange, plant.GetFrameByName("payload"))
    assert place.IsNearlyIdentity(1e-12)
    q = arm_of(IDEAL).home
    np.testing.assert_array_equal(arm_of(scenario).gravity_torque(q), arm_of(IDEAL).gravity_torque(q))


@pytest.mark.parametrize("step", [0.001, 0.0005])
@pytest.mark.parametrize("delay", [0, 3])
def test_the_controller_answers_to_the_state_of_so_many_samples_ago(delay, step):
    """Its law computed a second time from the recorded state, shifted by exactly the delay."""
    scenario = IDEAL.with_overrides(
        {"sensors.delay": delay, "simulation.step": step, "simulation.start": "hold", "simulation.hold_time": 0.02}
    )
    plan, arm = ideal_plan(), arm_of(scenario)
    run = simulate(scenario, "pd", plan).recording
    q, qd, tau = (run[name].values for name in ("q", "qd", "tau"))
    inertia = nominal_inertia(scenario, arm, q[0])
    gains = scenario.controller
    wrong = 0
    for k in range(delay + 1, len(q), 7):
        if np.abs(q[k] - q[k - 1]).max() < 1e-6:
            continue  # too slow to tell one sample from the next

        def law(i, k=k):
            position, velocity, jacobian, bias = arm.task_kinematics(q[i], qd[i])
            # a plant with a finer step gets the torque computed half a step before, with the command of then
            x, v, _ = plan.at(run["time"].values[k] - (step / 2 if step < 0.001 else 0.0))
            x_cmd = np.array([*x, scenario.task.start_x, 0.0, 0.0])
            v_cmd = np.array([*v, 0.0, 0.0, 0.0])
            a_ref = gains.k_p * (x_cmd - position) + gains.k_v * (v_cmd - velocity)
            torque = inertia * np.linalg.solve(jacobian, a_ref - bias)
            return np.clip(torque, -arm.tau_max, arm.tau_max)

        np.testing.assert_allclose(tau[k], law(k - delay), rtol=1e-6, atol=1e-6)
        wrong += np.abs(tau[k] - law(k - delay - 1)).max() > 1e-3
    assert wrong > 30  # one sample more would have been seen


def inertias(scenario):
    """Mass and inertia of every body, and rotor inertia of every actuator, by name."""
    plant = MultibodyPlant(0.0)
    parts = add_parts(plant, scenario)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    bodies = {}
    for index in plant.GetBodyIndices(parts.arm.arm):
        body = plant.get_body(index)
        spatial = body.CalcSpatialInertiaInBodyFrame(context)
        bodies[body.name()] = (spatial.get_mass(), spatial.CalcRotationalInertia().CopyToFullMatrix3())
    joints = [plant.GetJointByName(name, parts.arm.arm) for name in arm_of(scenario).joint_names]
    rotors = [plant.GetJointActuatorByName(joint.name()).default_rotor_inertia() for joint in joints]
    return bodies, np.array(rotors), [joint.child_body().name() for joint in joints]


@pytest.mark.parametrize("joint", range(6))
def test_a_link_scale_multiplies_the_mass_and_inertia_of_that_link_alone(joint):
    factor = 1.3
    scales = [factor if k == joint else 1.0 for k in range(6)]
    plain, rotors, links = inertias(IDEAL)
    scaled, same_rotors, _ = inertias(IDEAL.with_overrides({"arm.link_inertia_scales": scales}))
    for name, (mass, inertia) in plain.items():
        wanted = factor if name == links[joint] else 1.0
        assert scaled[name][0] == pytest.approx(wanted * mass, rel=1e-12), name
        np.testing.assert_allclose(scaled[name][1], wanted * inertia, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(rotors, same_rotors)
    scaled, turned, _ = inertias(IDEAL.with_overrides({"arm.reflected_inertia_scales": scales}))
    np.testing.assert_allclose(turned, rotors * scales, rtol=1e-12)
    assert [scaled[name][0] for name in plain] == [mass for mass, _ in plain.values()]


def test_all_links_together_are_each_of_them():
    together = inertias(IDEAL.with_overrides({"arm.link_inertia_scale": 1.3}))
    each = inertias(IDEAL.with_overrides({"arm.link_inertia_scales": [1.3] * 6}))
    moved = set(together[2])
    for name in moved:
        assert together[0][name][0] == pytest.approx(each[0][name][0], rel=1e-12)
    assert len(moved) == len(JOINTS)


def test_below_zero_the_plan_uses_more_friction_than_there_is():
    scenario = IDEAL.with_overrides({"object.friction": 0.5, "planner.friction_margin": -0.6})
    found = plan_motion(scenario)
    used = np.tan(found.summary()["max_sliding_angle_rad"])
    assert 0.5 < used <= 0.5 * 1.6 * 1.001


BAD = [
    ("disturbance.payload", -0.1),
    ("controller.gravity_compensation", -0.1),
    ("sensors.delay", -1),
    ("sensors.delay", 1.5),
    ("sensors.delay", 1001),
    ("planner.friction_margin", -2.0),
    ("planner.friction_margin", 1.0),
    ("arm.link_inertia_scales", (1.0, 1.0, 0.0, 1.0, 1.0, 1.0)),
    ("arm.reflected_inertia_scales", ()),
]


@pytest.mark.parametrize(("path", "value"), BAD)
def test_a_value_that_makes_no_sense_is_refused_by_the_name_of_its_field(path, value):
    assert path in field_paths()
    with pytest.raises(InputError, match=path):
        IDEAL.with_overrides({path: value})


@pytest.mark.parametrize("field", ["link_inertia_scales", "reflected_inertia_scales"])
def test_as_many_scales_as_joints_are_needed(field):
    scenario = IDEAL.with_overrides({f"arm.{field}": (1.0, 2.0)})
    with pytest.raises(InputError, match=rf"'arm.{field}' = .* has 2 entries; valid is one per joint"):
        build_loop(scenario)
