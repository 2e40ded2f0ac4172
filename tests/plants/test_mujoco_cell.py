"""The cell in MuJoCo against Drake's, and against what Newton and Coulomb say."""

import threading

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from robots import UR5, package_file
from shared import ideal_flip, ideal_plan

from flipdiagram.cli import main as cli
from flipdiagram.diagrams.loop import ENGINES, build_loop
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants import mujoco_cell
from flipdiagram.plants.handle import add_model
from flipdiagram.plants.mujoco_cell import CELL
from flipdiagram.plants.mujoco_contact import compiled
from flipdiagram.plants.mujoco_model import cell_model
from flipdiagram.robot.model_files import block_sdf, model_path
from flipdiagram.robot.parts import arm_of
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.simulate import simulate, simulate_loop

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'flipdiagram[mujoco]'")

G = 9.81
MUJOCO = {"simulation.engine": "mujoco"}
FREE = {"joint_friction.coulomb": 0.0, "joint_friction.viscous": 0.0}
PANDA = {
    "arm.file": "panda_description/urdf/panda.urdf",
    "arm.base": "panda_link0",
    "arm.flange": "panda_link8",
    "arm.base_pose": (0.1, 0.05, -0.2, 0.3),
    "arm.mount_angle": 0.75,
}
ARMS = {
    "MH3F": {},
    "MH3F with a load": {
        "disturbance.payload": 0.7,
        "disturbance.object_mass_scale": 1.3,
        "task.yaw": 0.4,
        "arm.link_inertia_scales": (1.1, 1.2, 0.9, 1.3, 1.0, 0.7),
        "arm.reflected_inertia_scale": 1.5,
    },
    "UR5": UR5,
    "Panda": PANDA,
}


def scenario_of(fields):
    named = {"arm.file": package_file(fields["arm.file"])} if "arm.file" in fields else {}
    return IDEAL.with_overrides(fields | named)


class Models:
    """One cell as Drake's plant and as MuJoCo's model."""

    def __init__(self, scenario):
        self.plant, graph = MultibodyPlant(1e-3), SceneGraph()
        self.plant.RegisterAsSourceForSceneGraph(graph)
        self.parts = add_model(self.plant, scenario)
        self.names = arm_of(scenario).joint_names
        text, self.X_LS, _ = cell_model(self.plant, graph, self.parts, self.names, CELL, 1e-4)
        self.graph, self.model = graph, compiled(mujoco, text)
        self.data, self.context = mujoco.MjData(self.model), self.plant.CreateDefaultContext()
        self.n = len(self.names)

    def put(self, q, qd, X_WB, V_WB):
        """The same state in both; angular velocities are the world's in Drake, the block's own in MuJoCo."""
        plant, block = self.plant, self.parts.block
        plant.SetPositions(self.context, self.parts.arm.arm, q)
        plant.SetVelocities(self.context, self.parts.arm.arm, qd)
        plant.SetFreeBodyPose(self.context, block, X_WB)
        plant.SetFreeBodySpatialVelocity(self.context, block, V_WB)
        R = X_WB.rotation()
        self.data.qpos[:] = [*q, *X_WB.translation(), *R.ToQuaternion().wxyz()]
        self.data.qvel[:] = [*qd, *V_WB.translational(), *(R.inverse() @ V_WB.rotational())]
        mujoco.mj_forward(self.model, self.data)
        n, first = self.n, block.floating_velocities_start_in_v()
        order = [plant.GetJointByName(name, self.parts.arm.arm).velocity_start() for name in self.names]
        #  v_drake[order] = T v_mujoco; T changes with the block, but T' v is zero, as ω × ω
        T = np.zeros((n + 6, n + 6))
        T[:n, :n], T[n : n + 3, n + 3 :], T[n + 3 :, n : n + 3] = np.eye(n), R.matrix(), np.eye(3)
        return [*order, *range(first, first + 6)], T


def random_state(rng, n):
    quaternion = rng.normal(size=4)
    X_WB = RigidTransform(Quaternion(quaternion / np.linalg.norm(quaternion)), rng.uniform(-1, 1, 3))
    V_WB = SpatialVelocity(rng.uniform(-9, 9, 3), rng.uniform(-2, 2, 3))
    return rng.uniform(-2.5, 2.5, n), rng.uniform(-4, 4, n), X_WB, V_WB


def close(ours, drakes, size=None):
    scale = np.abs(drakes).max() if size is None else size
    np.testing.assert_allclose(ours, drakes, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("fields", ARMS.values(), ids=ARMS)
def test_inertia_bias_and_kinematics_are_drakes(fields):
    models, rng = Models(scenario_of(fields)), np.random.default_rng(3)
    plant, model, data, context, n = models.plant, models.model, models.data, models.context, models.n
    for _ in range(100):
        order, T = models.put(*random_state(rng, n))
        M = plant.CalcMassMatrix(context)[np.ix_(order, order)]
        columns = []
        for unit in np.eye(n + 6):
            columns.append(np.zeros(n + 6))
            mujoco.mj_mulM(model, data, columns[-1], unit)
        close(np.array(columns), T.T @ M @ T, np.abs(M).max())
        gravity = plant.CalcGravityGeneralizedForces(context)
        bias = (plant.CalcBiasTerm(context) - gravity)[order]
        close(data.qfrc_bias, T.T @ bias)
        X_WL = RigidTransform(RotationMatrix(data.body("blade").xmat.reshape(3, 3)), data.body("blade").xpos)
        X_WS = plant.EvalBodyPoseInWorld(context, models.parts.arm.spatula_body)
        close((X_WL @ models.X_LS).GetAsMatrix34(), X_WS.GetAsMatrix34())


def test_boxes_friction_damping_limits_and_gravity_are_drakes(tmp_path):
    scenario = scenario_of({"object.friction": 1.2, "table.friction": 0.4, "disturbance.table_error": 0.01, **PANDA})
    models = Models(scenario)
    model, plant, inspector = models.model, models.plant, models.graph.model_inspector()
    models.put(*random_state(np.random.default_rng(1), 7))
    bodies = {"blade": models.parts.arm.spatula_body, "block": models.parts.block, "table": models.parts.table}
    for name, body in bodies.items():
        (geometry,) = plant.GetCollisionGeometriesForBody(body)
        X_WG = plant.EvalBodyPoseInWorld(models.context, body) @ inspector.GetPoseInFrame(geometry)
        np.testing.assert_allclose(2 * model.geom(name).size, inspector.GetShape(geometry).size(), rtol=1e-12)
        np.testing.assert_allclose(models.data.geom(name).xpos, X_WG.translation(), atol=1e-12)
        np.testing.assert_allclose(models.data.geom(name).xmat.reshape(3, 3), X_WG.rotation().matrix(), atol=1e-12)
    np.testing.assert_allclose(model.pair_friction[:, :2], [[1.2, 1.2], [0.6, 0.6], [0.6, 0.6]])
    joints = [plant.GetJointByName(name) for name in models.names]
    np.testing.assert_array_equal(model.dof_damping[:7], [joint.default_damping() for joint in joints])
    assert model.dof_damping[0] > 0
    np.testing.assert_array_equal(model.jnt_range[:7, 0], [joint.position_lower_limit() for joint in joints])
    np.testing.assert_array_equal(model.opt.gravity, [0, 0, -G])


class Bench:
    """The cell alone in an engine, a constant torque on its arm, the blade tilted by an angle [rad]."""

    def __init__(self, engine, torque=None, tilt=0.0, **fields):
        named = {name.replace("__", "."): value for name, value in fields.items()}
        self.scenario = IDEAL.with_overrides(named | {"simulation.engine": engine})
        self.arm = arm_of(self.scenario)
        task = self.scenario.task
        level, self.q = (
            self.arm.inverse_kinematics([task.start_y, task.start_z, angle, task.start_x, 0.0, 0.0])
            for angle in (0.0, tilt)
        )
        builder = DiagramBuilder()
        self.cell = ENGINES[engine](builder, self.scenario, self.arm, level)
        held = self.cell.holding_torque(self.q) if torque is None else torque
        source = builder.AddSystem(ConstantVectorSource(held))
        builder.Connect(source.get_output_port(), self.cell.tau)
        self.diagram = builder.Build()

    def start(self, X_WB=None, V_WB=None):
        """A simulator, the arm at rest at the start; the block on the blade, or at a pose with a velocity."""
        context, cell = self.diagram.CreateDefaultContext(), self.cell
        cell.stand(context, self.q)
        if X_WB is not None:
            V_WB = V_WB or SpatialVelocity(np.zeros(6))
            if self.scenario.simulation.engine == "drake":
                own = cell.plant.GetMyMutableContextFromRoot(context)
                cell.plant.SetFreeBodyPose(own, cell.parts.block, X_WB)
                cell.plant.SetFreeBodySpatialVelocity(own, cell.parts.block, V_WB)
            else:
                own = cell.robot.GetMyMutableContextFromRoot(context)
                cell.robot.put(own, self.q, X_WB)
                state = own.get_discrete_state_vector().CopyToVector()
                state[19:25] = V_WB.get_coeffs()
                own.SetDiscreteState(state)
        simulator = Simulator(self.diagram, context)
        simulator.Initialize()
        return simulator

    def read(self, simulator, name):
        port = getattr(self.cell, name)
        return port.Eval(port.get_system().GetMyContextFromRoot(simulator.get_context()))


def on_table(scenario, y=0.1):
    return RigidTransform([0.5, y, scenario.table.height + scenario.object.thickness / 2])


@pytest.mark.parametrize("place", ["blade", "table"])
def test_a_block_at_rest_stays_at_rest_and_its_weight_is_carried(place):
    bench = Bench("mujoco")
    simulator = bench.start(on_table(bench.scenario) if place == "table" else None)
    X_0 = bench.read(simulator, "block")[:7]
    simulator.AdvanceTo(0.5)
    block, wrench = bench.read(simulator, "block"), bench.read(simulator, "contact_wrench")
    sunk = [0, 0, 0, 0, 0, 0, G / (4 * CELL.stiffness)]  # each corner bears a quarter
    np.testing.assert_allclose(block[:7], X_0 - sunk, atol=5e-7)
    np.testing.assert_allclose(block[7:], 0, atol=1e-5)
    weight = np.array([0, 0, bench.scenario.object.mass * G])
    expected = np.zeros(12)
    expected[(3 if place == "table" else 0) :][:3] = weight
    if place == "blade":
        expected[9:] = np.cross(block[4:7], weight)
    np.testing.assert_allclose(wrench, expected, atol=1e-3 * weight[2])


@pytest.mark.parametrize("friction", [0.4, 1.2])
@pytest.mark.parametrize("engine", ["drake", "mujoco"])
def test_on_a_tilted_blade_the_block_sticks_below_the_friction_angle_and_slides_above_it(engine, friction):
    """Above it with a = g (sin θ − μ cos θ), once it moves."""
    for share, slides in ((0.97, False), (1.1, True)):
        tilt = share * np.arctan(friction)
        bench = Bench(engine, tilt=tilt, object__friction=friction)
        simulator = bench.start()
        speeds, times = [], (0.04, 0.08)
        before = bench.read(simulator, "block")[4:7]
        for until in times:
            simulator.AdvanceTo(until)
            speeds.append(np.linalg.norm(bench.read(simulator, "block")[10:]))
        moved = np.linalg.norm(bench.read(simulator, "block")[4:7] - before)
        if slides:
            gained = (speeds[1] - speeds[0]) / (times[1] - times[0])
            assert gained == pytest.approx(
                G * (np.sin(tilt) - friction * np.cos(tilt)), rel=0.06
            )  # the blade yields a little
        else:
            assert moved < 2e-4 and speeds[1] < 5e-3


def test_the_wrench_is_what_changes_the_blocks_momentum():
    """While it falls askew on blade and table: m Δv = ∫ F dt less gravity, and the same of the angular momentum where
    the blade alone pushes."""
    bench = Bench("mujoco")
    X = RigidTransform(RotationMatrix.MakeXRotation(0.3), [0.5, 0.01, 0.38])
    simulator = bench.start(X, SpatialVelocity([1.0, 2.0, 3.0], [0.1, 0.0, -0.5]))
    mass, inertia = bench.scenario.object.mass, bench.cell.parts.block.default_rotational_inertia()
    moments = np.diag(inertia.CopyToFullMatrix3())
    seen = []
    for k in range(60):
        simulator.AdvanceTo(1e-3 * (k + 0.5))
        seen.append((bench.read(simulator, "block"), bench.read(simulator, "contact_wrench")))
    touched = 0
    for (before, wrench), (after, _) in zip(seen, seen[1:], strict=False):
        gained = mass * (after[10:] - before[10:]) / 1e-3
        np.testing.assert_allclose(gained + [0, 0, mass * G], wrench[:3] + wrench[3:6], atol=1e-5)

        def about_origin(b):
            R = Quaternion(b[:4] / np.linalg.norm(b[:4])).rotation()
            return R @ (moments * (R.T @ b[7:10])) + np.cross(b[4:7], mass * b[10:])

        turned = (about_origin(after) - about_origin(before)) / 1e-3
        middle = (before[4:7] + after[4:7]) / 2
        if np.any(wrench[:3]) and not np.any(wrench[3:6]):
            touched += 1
            expected = wrench[9:] + np.cross(middle, [0, 0, -mass * G])
            np.testing.assert_allclose(turned, expected, atol=0.02 * np.abs(wrench[9:]).max() + 1e-4)
    assert touched > 5


def test_flight_and_swing_come_nearer_to_drakes_as_the_step_halves():
    """The block spins about all axes, the arm falls: Drake's error is of the order of the step, MuJoCo's of a tenth."""
    away = []
    for step in (1e-3, 5e-4, 2.5e-4):
        ends = []
        for engine in ENGINES:
            bench = Bench(
                engine, np.zeros(6), simulation__step=step, **{k.replace(".", "__"): v for k, v in FREE.items()}
            )
            simulator = bench.start(RigidTransform([0.5, 0.0, 3.0]), SpatialVelocity([6, -3, 2], [0.5, 1, 2]))
            simulator.AdvanceTo(0.15)
            ends.append(np.concatenate([bench.read(simulator, name) for name in ("q", "qd", "block")]))
        assert np.abs(ends[0][:6] - bench.q).max() > 0.1, "the arm falls"
        away.append(np.split(np.abs(ends[1] - ends[0]), [6, 12, 16, 19]))
    for coarse, fine in zip(away, away[1:], strict=False):
        for part, (one, other) in enumerate(zip(coarse, fine, strict=True)):
            assert other.max() < 0.6 * one.max(), part
    assert max(part.max() for part in away[-1]) < 0.01


def test_a_joint_stops_at_its_limit_as_in_drake():
    ends = []
    for engine in ENGINES:
        bench = Bench(engine, simulation__step=1e-3)
        torque = bench.cell.holding_torque(bench.q) + [0, 0, 0, 0, 0, 5.0]
        bench = Bench(engine, torque)
        simulator = bench.start(on_table(bench.scenario, -0.3))
        simulator.AdvanceTo(1.5)
        ends.append(bench.read(simulator, "q")[5])
    limit = bench.arm.q_max[5]
    np.testing.assert_allclose(ends, limit, atol=0.01)


def test_a_push_changes_the_speeds_as_in_drake():
    pushed = {"disturbance__push": (30.0, -20.0), "disturbance__push_time": 0.01, "disturbance__push_duration": 0.02}
    gained = []
    for engine in ENGINES:
        speeds = []
        for force in ({}, pushed):
            bench = Bench(engine, simulation__start="switch-on", **force)
            simulator = bench.start(on_table(bench.scenario, -0.3))
            simulator.AdvanceTo(0.01)
            assert np.abs(bench.read(simulator, "qd")).max() < 0.02
            simulator.AdvanceTo(0.03)
            speeds.append(bench.read(simulator, "qd"))
        gained.append(speeds[1] - speeds[0])
    assert np.abs(gained[0]).max() > 0.1
    np.testing.assert_allclose(gained[1], gained[0], atol=0.01 * np.abs(gained[0]).max())


def test_poses_and_holding_torque_are_drakes():
    fields = {"disturbance__payload": 0.5, "task__yaw": 0.4, "disturbance__table_error": 0.01}
    benches = [Bench(engine, **fields) for engine in ENGINES]
    rng = np.random.default_rng(2)
    for q in benches[0].q + rng.uniform(-0.5, 0.5, (5, 6)):
        torque, poses, block = [], [], []
        for bench in benches:
            simulator = bench.start()
            bench.cell.stand(simulator.get_mutable_context(), q)
            torque.append(bench.cell.holding_torque(q))
            poses.append([X.GetAsMatrix34() for X in bench.read(simulator, "poses")])
            block.append(bench.read(simulator, "block"))
        np.testing.assert_array_equal(*torque)
        np.testing.assert_allclose(*poses, atol=1e-12)
        np.testing.assert_allclose(*block, atol=1e-12)


@pytest.mark.parametrize("start", ["hold", "switch-on"])
def test_the_default_context_is_drakes(start):
    fields = {"simulation.start": start, "disturbance.start_error": 0.01, "disturbance.block_offset": 0.005}
    ports = []
    for engine in ENGINES:
        loop = build_loop(IDEAL.with_overrides(fields | {"simulation.engine": engine}), "pd")
        context, cell = loop.context(ideal_plan()), loop.cell
        read = [port.Eval(port.get_system().GetMyContextFromRoot(context)) for port in (cell.q, cell.qd, cell.block)]
        np.testing.assert_array_equal(read[0], loop.q_start)
        ports.append(np.concatenate(read))
    np.testing.assert_allclose(*ports, atol=1e-12)


def test_contexts_share_nothing_and_a_run_goes_on_from_its_context_to_the_bit():
    bench = Bench("mujoco")

    def run(simulator, times):
        for t in times:
            simulator.AdvanceTo(t)
        return np.concatenate([bench.read(simulator, name) for name in ("q", "qd", "block", "contact_wrench")])

    def starts():
        askew = RigidTransform(RotationMatrix.MakeXRotation(0.3), [0.5, 0.01, 0.36])
        return bench.start(), bench.start(askew)

    times = np.arange(1, 81) * 1e-3
    alone = [run(simulator, times) for simulator in starts()]
    assert not np.array_equal(*alone)
    one, other = starts()
    for t in times:
        both = run(one, [t]), run(other, [t])
    np.testing.assert_array_equal(both, alone)

    first = starts()[1]
    run(first, times[:40])
    second = Simulator(bench.diagram, first.get_context().Clone())
    run(starts()[0], times)  # something else in between
    np.testing.assert_array_equal(run(second, times[40:]), alone[1])

    ends = {}
    threads = [
        threading.Thread(target=lambda i=i, s=s: ends.__setitem__(i, run(s, times))) for i, s in enumerate(starts())
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal([ends[0], ends[1]], alone)


@pytest.fixture(scope="module")
def flips():
    """The default flip in MuJoCo, by architecture."""
    return {name: simulate(IDEAL.with_overrides(MUJOCO), name, ideal_plan()).recording for name in ("pd", "pd+ff+dob")}


def test_the_flip_turns_over_and_fails_as_in_drake(flips):
    best, drake = measure(flips["pd+ff+dob"]), measure(ideal_flip().recording)
    assert best.success and drake.success
    assert abs(best.touchdown.theta_rad - drake.touchdown.theta_rad) < 0.06
    assert abs(best.touchdown.time_s - drake.touchdown.time_s) < 0.005
    assert best.max_slip_m < 0.6e-3
    assert best.position_rmse_m == pytest.approx(drake.position_rmse_m, rel=0.05)
    worst, drakes = measure(flips["pd"]), measure(simulate(IDEAL, "pd", ideal_plan()).recording)
    assert not worst.success and not drakes.success
    assert worst.failure.split()[0] == drakes.failure.split()[0], (worst.failure, drakes.failure)


def test_the_recording_names_the_engine(flips):
    said = flips["pd"].attrs["engine"]
    assert said.startswith(f"MuJoCo {mujoco.__version__}, step ") and "elliptic" in said and "\n" not in said
    assert ideal_flip().recording.attrs["engine"] == "Drake, step 1 ms, hydroelastic_with_fallback, similar"


def test_nothing_moves_before_the_motion_starts(flips):
    for name, recording in flips.items():
        before = recording.sel(time=slice(-0.09, -0.002))
        assert before["time"].size > 85
        assert np.ptp(before["q"].values, axis=0).max() < 1e-6, name
        assert np.abs(before["qd"].values).max() < 5e-5, name  # the block sinks by micrometres
        lifted = before["contact_force"].sel(pair="blade-block", direction="z").values
        np.testing.assert_allclose(lifted, 0.061 * G, rtol=1e-2)


def test_a_step_is_computed_once_for_update_and_log(monkeypatch):
    loop = build_loop(IDEAL.with_overrides(MUJOCO | {"simulation.settle_time": 0.0}), record=True)
    loop.context(ideal_plan())  # the equilibrium looks at contact too
    count, once = [], mujoco.mj_step
    monkeypatch.setattr(mujoco, "mj_step", lambda *given: (count.append(1), once(*given)))
    data = simulate_loop(loop, ideal_plan()).recording
    # the last sample is logged, and not left by an update
    assert len(count) == data.sizes["time"] * loop.cell.robot.substeps
    # an update whose effect on the block is that of the force logged with it
    data = data.sel(time=slice(-0.1, 0.45))  # an impact moves it by when within a period it comes
    v = np.diff(data["block_pose"].values[:, 4:], axis=0) / 1e-3
    force = data["contact_force"].values
    gained = 0.061 * np.diff(v[:, 2]) / 1e-3 + 0.061 * G
    felt = force[:, 0, 2] + force[:, 1, 2]
    delays = [np.abs(gained[5:-5] - np.roll(felt[1:-1], lag)[5:-5]).mean() for lag in (-1, 0, 1)]
    assert np.argmin(delays) == 1, delays


def test_a_replanning_mpc_and_its_camera_fly_in_mujoco():
    fields = {"planner.replan_period": 0.2, "sensors.camera_period": 0.02, "disturbance.push": (5.0, 0.0)}
    fields["simulation.settle_time"] = 0.1
    recording = simulate(IDEAL.with_overrides(MUJOCO | fields), "pd+ff+dob", ideal_plan()).recording
    assert measure(recording).success


def test_a_finer_plant_step_works():
    recording = simulate(IDEAL.with_overrides(MUJOCO | {"simulation.step": 5e-4}), "pd+ff+dob", ideal_plan())
    assert measure(recording.recording).success


def test_meshcat_sees_the_cell():
    loop = build_loop(IDEAL.with_overrides(MUJOCO), "pd", meshcat=Meshcat())
    context = loop.context(ideal_plan())
    port = loop.diagram.GetSubsystemByName("geometry_poses").get_output_port()
    poses = port.Eval(port.get_system().GetMyContextFromRoot(context))
    frame = loop.cell.plant.GetBodyFrameIdOrThrow(loop.cell.parts.block.index())
    block = loop.cell.block.Eval(loop.cell.block.get_system().GetMyContextFromRoot(context))
    np.testing.assert_array_equal(poses.value(frame).translation(), block[4:7])
    assert 0.25 < block[6] < 0.4


def test_without_mujoco_one_line_says_how_to_install_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(SystemExit) as left:
        raise SystemExit(cli.main(["flip", "--simulation.engine", "mujoco", "--out", str(tmp_path / "out")]))
    error = capsys.readouterr().err.strip()
    assert left.value.code == 2
    assert "pip install 'flipdiagram[mujoco]'" in error and "\n" not in error


def test_the_diagram_of_the_loop_is_drawn(tmp_path):
    words = ["diagram", "--architecture", "pd+ff+dob", "--format", "dot", "--out"]
    texts = []
    for engine in ENGINES:
        assert cli.main([*words, str(tmp_path / f"{engine}.dot"), "--simulation.engine", engine]) in (0, None)
        texts.append((tmp_path / f"{engine}.dot").read_text())
    assert "robot" in texts[1] and texts[0] == texts[1], "the cell is one box in both"


def test_another_shape_than_a_box_is_refused(tmp_path):
    text = block_sdf(IDEAL)
    text = text.replace(
        "<box><size>0.062 0.065 0.01</size></box>", "<ellipsoid><radii>0.031 0.0325 0.005</radii></ellipsoid>"
    )
    hint = "<drake:mesh_resolution_hint>0.002</drake:mesh_resolution_hint>"
    text = text.replace("<drake:compliant_hydroelastic />", f"<drake:compliant_hydroelastic />{hint}")
    (tmp_path / "ball.sdf").write_text(text)
    scenario = IDEAL.with_overrides(MUJOCO | {"object.file": str(tmp_path / "ball.sdf")})
    with pytest.raises(InputError, match="Ellipsoid of the block; valid is Box") as refused:
        build_loop(scenario)
    assert "\n" not in str(refused.value)


def test_a_sliding_joint_is_refused(tmp_path):
    text = model_path("mh3f.urdf").read_text(encoding="utf-8")
    (tmp_path / "sliding.urdf").write_text(
        text.replace('<joint name="T" type="revolute">', '<joint name="T" type="prismatic">')
    )
    scenario = IDEAL.with_overrides(MUJOCO | {"arm.file": str(tmp_path / "sliding.urdf")})
    builder = DiagramBuilder()
    with pytest.raises(InputError, match="moves chains of revolute joints, and this arm is none; valid is drake"):
        ENGINES["mujoco"](builder, scenario, arm_of(scenario), None)


def test_a_state_that_is_not_finite_ends_in_an_error(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    bench = Bench("mujoco", np.full(6, np.nan))
    simulator = bench.start()
    with pytest.raises(SimulationError, match="diverged: MuJoCo's state is not finite"):
        simulator.AdvanceTo(0.01)


def test_the_settings_are_of_the_convergence_study():
    """A step that does not divide the period is shortened until it does; a penetration takes many of them."""
    assert CELL.timestep * np.sqrt(CELL.stiffness) < 0.1
    assert Bench("mujoco", simulation__step=2.5e-4).cell.robot.substeps == int(np.ceil(2.5e-4 / CELL.timestep - 1e-9))
    assert mujoco_cell.CELL is CELL
