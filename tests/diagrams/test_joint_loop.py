"""The loop around joints alone: poles by hand, slopes by differences of running loops, every scalar."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ZeroOrderHold
from shared import ideal_plan

from flipdiagram.compiled.linearize import linearize_diagram
from flipdiagram.diagrams.joint_loop import build_joint_loop
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.one_dof import build_controller, build_open, theory
from flipdiagram.errors import InputError, NotCompilable
from flipdiagram.plants.joint_model import JointModel
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.theory.poles import listed

pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")

N, T = 6, 1e-3
IDEAL_SENSORS = {"sensors.velocity_cutoff": None, "sensors.encoder_bits": 0, "sensors.delay": 0}
BARE = Scenario().with_overrides(
    IDEAL_SENSORS
    | {"joint_friction.coulomb": 0.0, "joint_friction.viscous": 0.0}
    | {"controller.nominal_inertia": (3.0,) * N, "controller.nominal_inertia_scale": 1.0}
)


@pytest.fixture(scope="module")
def loop():
    """The default one, about the kinematics as they are."""
    return build_joint_loop(Scenario(), "pd+ff+dob", arm=arm_of(Scenario()))


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_poles_of_decoupled_joints_are_the_roots_found_by_hand(architecture):
    """With x[k+1] = x + T v[k+1] and a = -k_p x - k_v v, so that x = T z/(z - 1) v:

    PD: v[k+1] = v + T a, hence z^2 - (2 - T k_v - T^2 k_p) z + 1 - T k_v = 0.  With the observer, e = exp(-g T), w/m = W:
    v[k+1] = v + T (a + W - g v), W[k+1] = W + (1 - e) a, hence
    (z - 1 + T g) (z - 1)^2 + T (k_p T z + k_v (z - 1)) (z - e) = 0.
    """
    zero = np.zeros((N, N))
    q0 = build_loop(BARE, "pd", native=True).q_start
    linear = build_joint_loop(BARE, architecture, model=JointModel(q0, 3.0 * np.eye(N), zero[0], zero)).linearize()
    k_p, k_v, g = BARE.controller.k_p, BARE.controller.k_v, BARE.controller.g_dis
    by_hand = np.roots([1.0, -(2 - T * k_v - T**2 * k_p), 1 - T * k_v])
    if "dob" in architecture:
        e, z = np.exp(-g * T), np.poly1d([1.0, 0.0])
        by_hand = ((z - 1 + T * g) * (z - 1) ** 2 + T * (k_p * T * z + k_v * (z - 1)) * (z - e)).roots
    found = listed(linear.poles(), linear.dt)
    expected = listed(by_hand, T)
    assert [pole.count for pole in found] == [N] * len(expected)
    np.testing.assert_allclose([pole.z for pole in found], [pole.z for pole in expected], atol=1e-7)
    omega = max(pole.omega for pole in found if pole.z.imag) if any(pole.z.imag for pole in found) else None
    assert omega is None or omega == pytest.approx(np.sqrt(k_p), rel=0.2)


@pytest.mark.parametrize("architecture", ["pd", "pd+ff+dob"])
def test_poles_of_the_one_degree_of_freedom_are_those_of_the_closed_form(architecture):
    settings = OneDof()
    linear = linearize_diagram(build_open(build_controller(architecture, settings), settings))
    s = theory(architecture, settings).poles()
    found = np.sort_complex([pole.s for pole in listed(linear.poles(), linear.dt)])
    np.testing.assert_allclose(found, np.sort_complex(s[s.imag >= -1e-9]), rtol=1e-6)


def moved(system, context, k, i, by):
    """The states one period after the i-th number of the k-th group was moved."""
    other = context.Clone()
    values = other.get_discrete_state(k).CopyToVector()
    values[i] += by
    other.SetDiscreteState(k, values)
    after = system.EvalUniquePeriodicDiscreteUpdate(other)
    return np.concatenate([after.get_vector(j).CopyToVector() for j in range(context.num_discrete_state_groups())])


def test_the_slopes_are_differences_of_the_loop_as_it_runs(loop):
    linear, context, step = loop.linearize(), loop.context(), 1e-6
    sizes = [context.get_discrete_state(k).size() for k in range(context.num_discrete_state_groups())]
    columns = [
        (moved(loop.diagram, context, k, i, step) - moved(loop.diagram, context, k, i, -step)) / (2 * step)
        for k, size in enumerate(sizes)
        for i in range(size)
    ]
    np.testing.assert_allclose(linear.A, np.transpose(columns), rtol=1e-6, atol=1e-6 * np.abs(linear.A).max())
    ends, port, unit = [], loop.diagram.GetInputPort("x_cmd"), np.eye(N)[1]
    for by in (step, -step):
        port.FixValue(context, loop.hold + by * unit)
        ends.append(moved(loop.diagram, context, 0, 0, 0.0))
    column = linear.B[:, linear.input_names.index("x_cmd[1]")]
    np.testing.assert_allclose(column, (ends[0] - ends[1]) / (2 * step), rtol=1e-5, atol=1e-6 * np.abs(column).max())


def test_the_joints_move_as_the_arm_in_the_cell():
    """Differences of Drake's cell, a block of 0.1 g lifted off: contact has no slope, it pushes one way only."""
    scenario = Scenario().with_overrides(IDEAL_SENSORS | {"object.mass": 1e-4})
    real = build_loop(scenario, "pd+dob")
    linear = build_joint_loop(scenario, "pd+dob", arm=arm_of(scenario)).linearize()
    plant, arm, block = real.cell.plant, real.cell.parts.arm.arm, real.cell.parts.block
    rest, step, context = real.context(), 1e-5, real.context()
    mine = plant.GetMyMutableContextFromRoot(context)
    away = RigidTransform([0.0, 0.0, 0.5]) @ plant.GetFreeBodyPose(mine, block)

    def after(q, qd):
        context.SetTimeStateAndParametersFrom(rest)
        plant.SetFreeBodyPose(mine, block, away)
        plant.SetPositions(mine, arm, q)
        plant.SetVelocities(mine, arm, qd)
        context.get_mutable_discrete_state().SetFrom(real.diagram.EvalUniquePeriodicDiscreteUpdate(context))
        return np.concatenate([plant.GetPositions(mine, arm), plant.GetVelocities(mine, arm)])

    q, still = real.equilibrium.q, np.zeros(N)
    moves = [(e, still) for e in step * np.eye(N)] + [(still, e) for e in step * np.eye(N)]
    found = np.transpose([(after(q + a, b) - after(q - a, -b)) / (2 * step) for a, b in moves])
    expected = linear.A[: 2 * N, : 2 * N]
    for rows in (slice(0, N), slice(N, 2 * N)):  # angles and speeds are of unlike size
        for columns in (slice(0, N), slice(N, 2 * N)):
            size = np.abs(expected[rows, columns] - np.eye(N) * (rows == columns)).max()
            np.testing.assert_allclose(found[rows, columns], expected[rows, columns], atol=1e-3 * size)


def test_the_block_is_a_part_of_the_tool():
    """Its kinetic energy as it moves along is what it adds to the arm's inertia."""
    loop, scenario = build_loop(Scenario(), "pd", native=True), Scenario()
    model, plant = build_joint_loop(scenario, "pd").model, loop.cell.plant
    context, arm, block = plant.CreateDefaultContext(), loop.cell.parts.arm, loop.cell.parts.block
    qd = np.array([0.3, -0.2, 0.5, 0.4, -0.7, 0.6])
    loop.cell.put_arm(context, model.q0)
    plant.SetVelocities(context, arm.arm, qd)
    X_WT = arm.tool.CalcPoseInWorld(context)
    X_WB = X_WT @ loop.cell.X_TB
    plant.SetFreeBodyPose(context, block, X_WB)
    alone = plant.CalcKineticEnergy(context)
    V_WT = arm.tool.CalcSpatialVelocityInWorld(context)
    along = V_WT.Shift(X_WB.translation() - X_WT.translation())
    plant.SetFreeBodySpatialVelocity(context=context, body=block, V_JpJc=along)
    added = model.M - loop.arm.mass_matrix(model.q0)
    assert plant.CalcKineticEnergy(context) - alone == pytest.approx(qd @ added @ qd / 2, rel=1e-9)


def test_with_a_plan_it_converts_to_every_scalar():
    plan = ideal_plan()
    of_plan = build_joint_loop(Scenario(), "pd+ff+dob", plan).diagram
    context, time = of_plan.CreateDefaultContext(), Scenario().simulation.lead_time + 0.05
    context.SetTime(time)
    expected = of_plan.GetOutputPort("tau").Eval(context)
    for other in (of_plan.ToAutoDiffXd(), of_plan.ToSymbolic()):
        own = other.CreateDefaultContext()
        own.SetTimeStateAndParametersFrom(context)
        tau = other.GetOutputPort("tau").Eval(own)
        values = [e.Evaluate() if hasattr(e, "Evaluate") else e.value() for e in tau]
        np.testing.assert_allclose(values, expected, rtol=1e-9)
    assert of_plan.num_input_ports() == 0


class Plain(LeafSystem):
    """A sampled block in Python without other scalars."""

    def __init__(self):
        super().__init__()
        self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(T, 0.0, lambda context, values: None)
        self.DeclareVectorOutputPort("y", 1, lambda context, output: None)


def test_what_does_not_convert_is_named_and_ends_nothing():
    builder = DiagramBuilder()
    plain, hold = builder.AddNamedSystem("mine", Plain()), builder.AddNamedSystem("hold", ZeroOrderHold(T, 1))
    builder.Connect(plain.get_output_port(), hold.get_input_port())
    with pytest.raises(NotCompilable, match=r"^block 'mine' \(Plain\) does not convert to AutoDiffXd; valid are"):
        linearize_diagram(builder.Build())
    real = build_loop(Scenario(), "pd")
    with pytest.raises(NotCompilable, match=r"^block 'mpc' .* has abstract state"):
        linearize_diagram(real.diagram, real.context())
    with pytest.raises(InputError, match=r"'joints\.model' = 'elastic' has no joint model here; valid is rigid"):
        build_joint_loop(Scenario().with_overrides({"joints.model": "elastic"}))
