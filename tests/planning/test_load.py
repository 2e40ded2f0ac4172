"""The object's part of the planned torques: against Drake's inverse dynamics, and the largest mass that an arm carries."""

import re

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces, SpatialInertia
from shared import ideal_plan

from flipdiagram.diagrams.controller import build_controller
from flipdiagram.errors import PlanningError
from flipdiagram.planning import placing, planner
from flipdiagram.planning.arm_motion import arm_motion
from flipdiagram.planning.convexification import Convexification
from flipdiagram.planning.limits import TORQUE
from flipdiagram.planning.placing import Placer
from flipdiagram.planning.planner import Planner
from flipdiagram.planning.replanner import Replanner
from flipdiagram.robot.arm_spec import ArmSpec
from flipdiagram.robot.assembly import add_arm
from flipdiagram.robot.parts import arm_of, loaded_arm_of

HEAVY = 5.0
X = IDEAL.task.start_x


class Welded:
    """Arm, spatula and a homogeneous box on it as one plant, made here."""

    def __init__(self, scenario, mass, shift=0.0):
        self.plant = MultibodyPlant(0.0)
        handles = add_arm(self.plant, ArmSpec(scenario.arm, scenario.object.thickness / 2))
        if mass:
            size = scenario.object.width, scenario.object.length, scenario.object.thickness
            box = self.plant.AddRigidBody("box", handles.spatula, SpatialInertia.SolidBoxWithMass(mass, *size))
            self.plant.WeldFrames(handles.control_point, box.body_frame(), RigidTransform([0.0, shift, 0.0]))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()

    def torque(self, q, qd, qdd):
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, qd)
        forces = MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(self.context, forces)
        return self.plant.CalcInverseDynamics(self.context, qdd, forces)


@pytest.fixture(scope="module")
def arm():
    return arm_of(IDEAL)


@pytest.fixture(scope="module")
def heavy():
    return IDEAL.with_overrides({"object.mass": HEAVY, "disturbance.object_mass_scale": 1.7})  # of which nobody knows


@pytest.mark.parametrize("shift", [0.0, 0.012])
@pytest.mark.parametrize("native", [False, True], ids=["plant", "chain"])
def test_planned_torques_are_drakes_of_arm_tool_and_object_until_the_release(arm, heavy, native, shift):
    plan = ideal_plan()
    mover = arm_motion(arm, X, native, loaded_arm_of(heavy))
    mover.shift_load(shift)
    q_start = arm.inverse_kinematics([*plan.states[0, :3], X, 0.0, 0.0])
    motion = mover.follow(plan.states, plan.inputs, q_start, plan.n_contact)
    with_object, without = Welded(IDEAL, HEAVY, shift), Welded(IDEAL, 0.0)
    assert 0 < plan.n_contact < len(plan.inputs)
    for k, a in enumerate(plan.inputs):
        for end in (0, 1):
            q, qd = motion.q[k + end], motion.qd[k + end]
            bias = arm.task_kinematics(q, qd)[3]
            qdd = np.linalg.solve(arm.task_jacobian(q)[1], np.array([*a, 0.0, 0.0, 0.0]) - bias)
            expected = (with_object if k < plan.n_contact else without).torque(q, qd, qdd)
            np.testing.assert_allclose(motion.torque[end, k], expected, rtol=1e-6, atol=1e-5)


def test_first_plan_and_replans_count_the_object_where_it_lies(arm, heavy):
    plan = ideal_plan()
    for horizons in (Convexification(heavy, arm), Replanner(heavy, arm).horizons):
        point = horizons.guess(24, 5)
        _, motion = horizons.rows(point)
        assert motion.carried == 24
        states, inputs = horizons.moving(point)
        bare = horizons.motion.follow(states, inputs, horizons.q_start)
        assert (
            np.abs(motion.torque - bare.torque)[:, :24].max() > 5 and not (motion.torque != bare.torque)[:, 24:].any()
        )
    q = arm.inverse_kinematics([*plan.states[0, :3], X, 0.0, 0.0])
    torques = []
    for shift in (0.0, 0.02, 0.0):
        horizons.restart(plan.states[0] + [shift, 0, 0, 0, 0, 0], q, shift)
        torques.append(horizons.rows(horizons.guess(24, 5))[1].torque[0, 0])
    held = HEAVY * 9.81 * 0.02
    assert np.abs(torques[1] - torques[0]).max() == pytest.approx(held, rel=0.3)
    np.testing.assert_allclose(torques[2], torques[0], atol=1e-12)


ONE_HORIZON = {"planner.contact_samples": (12, 12), "planner.flight_samples": (5, 5)}


@pytest.mark.parametrize(
    ("fields", "words"),
    [({"object.mass": 40.0}, "; largest mass for this arm: less than 40 kg"), ({"arm.torque_scale": 0.02}, "")],
    ids=["heavy object", "weak arm"],
)
def test_a_torque_that_the_object_costs_is_told_apart(monkeypatch, fields, words):
    monkeypatch.setattr(planner, "MASS_SEARCH", 0.0)
    with pytest.raises(PlanningError, match="joint torque limit") as caught:
        Planner(IDEAL.with_overrides(ONE_HORIZON | fields)).plan()
    assert str(caught.value).endswith(words) and ("largest mass" in str(caught.value)) == bool(words)


def test_the_largest_mass_is_the_largest_for_which_there_is_a_motion(arm, monkeypatch):
    tried = []

    def plan(self, longest):
        tried.append(self.scenario.object.mass)
        if tried[-1] > 7.3:
            raise PlanningError("joint torque limit cannot be met")

    monkeypatch.setattr(Planner, "_plan", plan)
    monkeypatch.setattr(Planner, "_object_is_too_heavy", lambda self: True)
    with pytest.raises(PlanningError, match=r"cannot be met; largest mass for this arm: about 7\.[123] kg$"):
        Planner(IDEAL.with_overrides({"object.mass": 50.0}), arm).plan()
    assert tried[0] == 50.0 and len(tried) < 10


def test_the_largest_mass_that_can_be_laid_down_is_exact(arm, monkeypatch):
    monkeypatch.setattr(placing, "CARRY_SAMPLES", (80,))
    with pytest.raises(PlanningError, match="largest mass for this arm: ") as caught:
        Placer(IDEAL.with_overrides({"object.mass": 50.0}), arm).plan()
    most = float(re.search(r"([\d.]+) kg$", str(caught.value))[1])
    use = Placer(IDEAL.with_overrides({"object.mass": most}), arm).plan().plan.limit_use[TORQUE]
    assert use == pytest.approx(1.0, abs=0.005)


def test_controllers_do_not_know_the_mass(arm):
    torques = []
    for mass in (IDEAL.object.mass, HEAVY):
        scenario = IDEAL.with_overrides({"object.mass": mass})
        controller = build_controller(scenario, "pd+ff+dob", arm_of(scenario))
        context = controller.CreateDefaultContext()
        values = {"q": arm.home + 0.1, "qd": 0.2 + 0 * arm.home, "x_cmd": 0.1, "v_cmd": 0.2, "a_cmd": 3.0}
        for name, value in values.items():
            port = controller.GetInputPort(name)
            port.FixValue(context, np.zeros(port.size()) + value)
        torques.append(controller.GetOutputPort("tau").Eval(context))
    np.testing.assert_array_equal(torques[0], torques[1])
