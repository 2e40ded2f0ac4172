"""Elastic joints against closed forms: two-body frequencies, all joints at once, their rest, and one engine by the other."""

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from shared import ideal_plan

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.drawing import draw
from flipdiagram.errors import InputError, NoEquilibriumError, ScenarioError
from flipdiagram.plants.cell import add_cell
from flipdiagram.plants.handle import add_model
from flipdiagram.plants.mujoco_cell import CELL, add_mujoco_cell
from flipdiagram.plants.mujoco_model import cell_model
from flipdiagram.robot.gears import gears_of, rotor_inertia, stable_damping
from flipdiagram.robot.model_files import urdf_directory
from flipdiagram.robot.parts import add_parts, arm_of

ELASTIC = {"joints.model": "elastic"}
N = 6
FINE = 1e-5
POSES = [None, np.array([0.5, 0.3, 0.2, -0.4, 0.6, 1.0]), np.array([-1.0, -0.8, -1.5, 1.2, -1.0, 2.0])]


def scenario_at(step, **fields):
    """Elastic joints whose plant has this step, and those of its gears that are stable there."""
    return IDEAL.with_overrides(ELASTIC | fields | {"controller.period": step, "simulation.step": step})


def matrices(scenario, q):
    """Rotor inertia on a diagonal, link inertia at q, both (n, n), and the gears, from the controller's rigid arm."""
    arm = arm_of(scenario)
    rotor = np.diag(rotor_inertia(arm))
    return rotor, arm.mass_matrix(q) - rotor, gears_of(scenario, arm)


def step_matrix(M, K, D, h):
    """(x, v) to its next: M (v+ - v) = -h (K x + D v+), x+ = x + h v+."""
    inverse = np.linalg.inv(M + h * D)
    v = np.hstack([-h * inverse @ K, inverse @ M])
    eye, zero = np.eye(len(M)), np.zeros_like(M)
    return np.vstack([np.hstack([eye, zero]) + h * v, v])


def exact_step(scenario, q, h):
    """The same of all rotors and gears, coordinates (q, deflection), in closed form."""
    rotor, link, gears = matrices(scenario, q)
    zero = np.zeros((N, N))
    M = np.block([[rotor + link, link], [link, link]])
    K, D = (np.block([[zero, zero], [zero, np.diag(numbers)]]) for numbers in gears)
    return step_matrix(M, K, D, h)


def drakes_step(scenario, q, h, free=tuple(range(N))):
    """The linearised step of Drake's plant about rest at q without gravity, coordinates (q, deflection) of free joints."""
    plant = MultibodyPlant(h)
    plant.SetUseSampledOutputPorts(False)
    parts = add_parts(plant, scenario)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, parts.arm.arm, q)
    names = arm_of(scenario).joint_names
    joints = [plant.GetJointByName(names[i]) for i in free] + [plant.GetJointByName(f"{names[i]}_gear") for i in free]
    for i in set(range(N)) - set(free):
        plant.GetJointByName(names[i]).Lock(context)
        plant.GetJointByName(f"{names[i]}_gear").Lock(context)
    places = [joint.position_start() for joint in joints]
    places += [plant.num_positions() + joint.velocity_start() for joint in joints]
    rest = context.get_discrete_state_vector().CopyToVector()

    def after(change):
        context.SetDiscreteState(rest + change)
        return plant.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()[places]

    def column(k):
        small = np.zeros_like(rest)
        small[k] = 1e-6
        return (after(small) - after(-small)) / 2e-6

    return np.column_stack([column(k) for k in places])


def swings(step, h):
    """Poles of a step matrix that swing [1/s], sorted."""
    poles = np.log(np.linalg.eigvals(step).astype(complex)) / h
    return np.sort_complex(poles[poles.imag > 1.0])


@pytest.mark.parametrize("joint", range(N))
def test_one_gear_whose_neighbours_are_locked_swings_as_two_bodies_on_a_spring(joint):
    """omega^2 = k (1/J_r + 1/J_l), damping ratio d omega / 2 k."""
    scenario = scenario_at(FINE)
    q = arm_of(scenario).home
    rotor, link, gears = matrices(scenario, q)
    J = 1 / (1 / rotor[joint, joint] + 1 / link[joint, joint])
    k, d = gears.stiffness[joint], gears.damping[joint]
    omega, ratio = np.sqrt(k / J), d / 2 / np.sqrt(k * J)
    (pole,) = swings(drakes_step(scenario, q, FINE, (joint,)), FINE)
    assert abs(pole) == pytest.approx(omega, rel=2e-3)
    assert -pole.real / abs(pole) == pytest.approx(ratio, rel=0.05)
    assert 100 < omega < 10_000 and ratio == pytest.approx(0.05)


@pytest.mark.parametrize("q", POSES, ids=["home", "one", "other"])
@pytest.mark.parametrize("h", [FINE, 1e-3])
def test_all_joints_swing_as_the_linear_equations_say(q, h):
    scenario = scenario_at(h)
    q = arm_of(scenario).home if q is None else q
    np.testing.assert_allclose(drakes_step(scenario, q, h), exact_step(scenario, q, h), atol=2e-5)
    assert np.abs(np.linalg.eigvals(exact_step(scenario, q, h))).max() < 1 + 1e-9


def test_the_slow_gears_swing_at_1_ms_as_they_do_in_continuous_time():
    scenario = scenario_at(1e-3)
    q = arm_of(scenario).home
    coarse = swings(exact_step(scenario, q, 1e-3), 1e-3)
    fine = swings(exact_step(scenario_at(FINE), q, FINE), FINE)
    slow = [i for i, pole in enumerate(np.sort_complex(coarse)) if abs(pole) < 700]
    assert len(slow) >= 3
    for pole in coarse[slow]:
        near = fine[np.argmin(np.abs(fine - pole))]
        assert pole.imag == pytest.approx(near.imag, rel=0.02)


def test_mujoco_swings_at_the_same_frequencies():
    mujoco = pytest.importorskip("mujoco")
    scenario = IDEAL.with_overrides(ELASTIC)
    arm = arm_of(scenario)
    plant, scene_graph = MultibodyPlant(0.001), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parts = add_model(plant, scenario)
    h = CELL.timestep
    model = mujoco.MjModel.from_xml_string(cell_model(plant, scene_graph, parts, arm.joint_names, CELL, h).mjcf)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[: 2 * N : 2], data.qpos[2 * N : 2 * N + 3] = arm.home, [0.0, 0.0, 50.0]
    A, nv = np.zeros((2 * model.nv, 2 * model.nv)), model.nv
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    arms = np.r_[0 : 2 * N, nv : nv + 2 * N]
    found, expected = swings(A[np.ix_(arms, arms)], h), swings(exact_step(scenario, arm.home, h), h)
    assert len(found) == len(expected) >= N - 1
    np.testing.assert_allclose(np.sort(np.abs(found)), np.sort(np.abs(expected)), rtol=2e-3)


@pytest.mark.parametrize("k, J", [(1e4, 1e-3), (4700.0, 1e-4), (3e4, 0.2)])
def test_the_least_damping_is_stable_also_with_half_the_inertia(k, J):
    h = 1e-3
    d = stable_damping(np.array([k]), np.array([J]), h)[0]
    assert (d == 0) == (h**2 * k <= 2 * J)
    matrix = [np.array([[value]]) for value in (J / 2 * 1.001, k, d)]
    assert np.abs(np.linalg.eigvals(step_matrix(*matrix, h))).max() < 1 + 1e-12
    if d > 0:
        matrix = [np.array([[value]]) for value in (J / 2, k, 0.9 * d - J / h)]
        assert np.abs(np.linalg.eigvals(step_matrix(*matrix, h))).max() > 1


@pytest.mark.parametrize("engine", ["drake", "mujoco"])
def test_at_rest_the_gears_give_way_by_the_load_over_their_stiffness(engine):
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    fields = ELASTIC | {"simulation.engine": engine, "joint_friction.model": "elasto-plastic", "controller.k_p": 3000.0}
    loop = build_loop(IDEAL.with_overrides(fields), "pd+ff")
    context, cell = loop.context(ideal_plan()), loop.cell

    def now(port):
        return port.Eval(port.get_system().GetMyContextFromRoot(context))

    load = arm_of(loop.scenario).gravity_torque(now(cell.q_link))
    load += cell.holding_torque(loop.equilibrium.q) - arm_of(loop.scenario).gravity_torque(now(cell.q_link))
    deflection = now(cell.q_link) - now(cell.q)
    np.testing.assert_allclose(deflection, -load / cell.parts.gears.stiffness, atol=1e-12)
    bare = -arm_of(loop.scenario).gravity_torque(now(cell.q_link)) / cell.parts.gears.stiffness
    np.testing.assert_allclose(deflection, bare, atol=3e-5)  # the block adds 0.6 N half a metre out
    assert np.abs(deflection).max() > 3e-4
    Simulator(loop.diagram, context).AdvanceTo(0.09)
    np.testing.assert_allclose(now(cell.q), loop.equilibrium.q, atol=1e-6)
    np.testing.assert_allclose(now(cell.q_link) - now(cell.q), deflection, atol=1e-6)


def test_the_holding_torque_is_the_slope_of_the_energy_of_arm_block_and_springs():
    loop = build_loop(IDEAL.with_overrides(ELASTIC))
    plant, context = loop.cell.plant, loop.diagram.CreateDefaultContext()
    mine = plant.GetMyContextFromRoot(context)

    def energy(q):
        loop.cell.stand(context, q)
        return plant.CalcPotentialEnergy(mine)

    q = loop.q_start + [0.3, 0.2, -0.3, 0.4, 0.2, 0.1]
    slope = [(energy(q + step) - energy(q - step)) / 2e-5 for step in 1e-5 * np.eye(N)]
    np.testing.assert_allclose(loop.cell.holding_torque(q), slope, atol=1e-6)


def test_a_push_of_the_motors_moves_both_engines_alike():
    pytest.importorskip("mujoco")
    ends = []
    for add in (add_cell, add_mujoco_cell):
        scenario = IDEAL.with_overrides(ELASTIC | {"simulation.step": 0.001 / 8})
        arm, builder, q_start = arm_of(scenario), DiagramBuilder(), build_loop(scenario).q_start
        cell = add(builder, scenario, arm, q_start)
        torque = builder.AddSystem(ConstantVectorSource(cell.holding_torque(q_start) + 0.3 * arm.tau_rated))
        builder.Connect(torque.get_output_port(), cell.tau)
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()
        cell.stand(context, q_start)
        Simulator(diagram, context).AdvanceTo(0.05)
        ports = cell.q, cell.q_link, cell.qd, cell.qd_link
        ends.append([port.Eval(port.get_system().GetMyContextFromRoot(context)) for port in ports])
    (q, link, *speeds), (other_q, other_link, *other_speeds) = ends
    moved = np.abs(q - q_start).max()
    assert moved > 0.03
    np.testing.assert_allclose(q, other_q, atol=0.01 * moved)
    np.testing.assert_allclose(link - q, other_link - other_q, atol=5e-5)
    np.testing.assert_allclose(speeds, other_speeds, atol=0.05)


def test_rigid_joints_have_one_side():
    cell = build_loop(IDEAL).cell
    assert cell.parts.gears is None
    assert cell.q_link is cell.q and cell.qd_link is cell.qd


@pytest.mark.parametrize("engine", ["drake", "mujoco"])
def test_a_drawing_shows_all_of_an_elastic_cell_as_the_robot(engine):
    if engine == "mujoco":
        pytest.importorskip("mujoco")
    loop = build_loop(IDEAL.with_overrides(ELASTIC | {"simulation.engine": engine}))
    rigid = build_loop(IDEAL.with_overrides({"simulation.engine": engine}))
    assert {line.source for line in draw(loop).lines} == {line.source for line in draw(rigid).lines}
    assert len(loop.cell.systems) == len(rigid.cell.systems) + 2


def test_a_hold_begins_with_gears_that_carry_the_arm():
    loop = build_loop(IDEAL.with_overrides(ELASTIC | {"simulation.start": "hold"}), "pd")
    plant, mine = loop.cell.plant, loop.cell.plant.GetMyContextFromRoot(loop.context(ideal_plan()))
    np.testing.assert_array_equal(plant.GetPositions(mine, loop.cell.parts.arm.arm), loop.q_start)
    deflection = plant.GetPositions(mine, loop.cell.parts.gears.model)
    expected = -loop.cell.holding_torque(loop.q_start) / loop.cell.parts.gears.stiffness
    np.testing.assert_allclose(deflection, expected, atol=1e-12)


@pytest.mark.parametrize("joints", ["rigid", "elastic"])
def test_what_is_shown_of_mujocos_cell_are_the_links(joints):
    pytest.importorskip("mujoco")
    scenario = IDEAL.with_overrides({"joints.model": joints, "simulation.engine": "mujoco"})
    loop = build_loop(scenario, meshcat=Meshcat())
    context, plant, parts = loop.context(ideal_plan()), loop.cell.plant, loop.cell.parts
    positions = loop.diagram.GetSubsystemByName("positions")
    shown, seen = plant.CreateDefaultContext(), positions.GetMyContextFromRoot(context)
    plant.SetPositions(shown, positions.get_output_port().Eval(seen))
    poses = loop.cell.poses.Eval(loop.cell.poses.get_system().GetMyContextFromRoot(context))
    for body in (parts.arm.spatula_body, parts.block):
        assert body.EvalPoseInWorld(shown).IsNearlyEqualTo(poses[int(body.index())], 1e-12)
    arm = arm_of(scenario)
    link = loop.cell.q_link.Eval(loop.cell.q_link.get_system().GetMyContextFromRoot(context))
    assert arm.X_WT(link).IsNearlyEqualTo(parts.arm.tool.CalcPoseInWorld(shown), 1e-9)


def own_arm(tmp_path, *without):
    """The MH3F as a file of the user's own, without some attributes."""
    text = (urdf_directory() / "mh3f.urdf").read_text(encoding="utf-8")
    for name in without:
        text = text.replace(name, f"no_{name}")
    file = tmp_path / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    return {"arm.file": str(file)} | ELASTIC


def test_an_arm_of_the_users_own_gets_gears_too(tmp_path):
    own = IDEAL.with_overrides(own_arm(tmp_path))
    home = arm_of(own).home
    np.testing.assert_array_equal(drakes_step(own, home, 1e-3), drakes_step(IDEAL.with_overrides(ELASTIC), home, 1e-3))
    numbers = {"joints.stiffness": (2e4,) * N, "joints.stiffness_scale": 0.5}
    given = own.with_overrides(own_arm(tmp_path, "gear_stiffness") | numbers)
    np.testing.assert_array_equal(gears_of(given, arm_of(given)).stiffness, np.full(N, 1e4))


@pytest.mark.parametrize(
    "without, fields, message",
    [
        (
            ["gear_stiffness"],
            {},
            "joints.model = 'elastic' needs joints.stiffness; valid is one per joint, S L U R B T",
        ),
        (
            ["rotor_inertia"],
            {"joint_friction.coulomb": 0.0},
            "joints.model = 'elastic' needs arm.reflected_inertia; valid is one above 0",
        ),
        ([], {"joints.stiffness": (1e4,) * 5}, "'joints.stiffness' .* has 5 entries"),
        ([], {"joints.damping": (1.0,) * 6}, "joint T unstable at this step; valid is at least 2.3"),
        ([], {"joint_friction.transition_velocity": 0.04}, "makes joint S chatter"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_line(tmp_path, without, fields, message):
    with pytest.raises(InputError, match=message) as caught:
        build_loop(IDEAL.with_overrides(own_arm(tmp_path, *without) | fields))
    assert "\n" not in str(caught.value) and caught.value.exit_code == 2


def test_gears_that_give_way_without_end_and_tamsi_are_refused():
    with pytest.raises(NoEquilibriumError, match="the gears give way; valid is a larger joints.stiffness"):
        build_loop(IDEAL.with_overrides(ELASTIC | {"joints.stiffness": (5.0,) * N}), "pd").context()
    with pytest.raises(
        ScenarioError, match="'tamsi' is not valid; valid is sap, lagged or similar with elastic joints"
    ):
        IDEAL.with_overrides(ELASTIC | {"simulation.contact_approximation": "tamsi"})
