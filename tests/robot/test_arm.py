"""The arm as a model, against the modified Denavit-Hartenberg table, finite differences, AutoDiff and hand calculations."""

import itertools
import math

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.symbolic import Expression, MakeVectorVariable

from flipdiagram.errors import InputError, PlanningError
from flipdiagram.robot import task_space
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import ArmSpec
from flipdiagram.robot.assembly import add_arm
from flipdiagram.robot.model_files import model_path
from flipdiagram.robot.task_space import AXES
from flipdiagram.scenario.cell import Arm

# alpha [deg], a [m], d [m], theta_0 [deg] of S L U R B T
MODIFIED_DH = (
    (0, 0, 0.290, 0),
    (-90, 0, 0, -90),
    (0, 0.260, 0, 0),
    (-90, 0.030, 0.270, 0),
    (90, 0, 0, 0),
    (-90, 0, 0.090, 0),
)
START = np.array([0, 0.35, 0, 0.5, 0, 0])
REFLECTED = np.array([0.036, 0.183, 0.052, 0.024, 0.017, 0.011])  # [kg m^2], rotors alone


def dh_flange(q):
    """Flange pose (4, 4) of the modified-DH table: product of Rx(alpha) Tx(a) Rz(theta) Tz(d)."""
    X = np.eye(4)
    for (alpha, a, d, offset), angle in zip(MODIFIED_DH, q, strict=True):
        ca, sa = math.cos(math.radians(alpha)), math.sin(math.radians(alpha))
        c, s = math.cos(angle + math.radians(offset)), math.sin(angle + math.radians(offset))
        X = X @ [[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca], [0, 0, 0, 1]]
    return X


@pytest.fixture(scope="module")
def arm():
    return ArmModel()


@pytest.fixture(scope="module")
def states(arm):
    """Twenty regular states (q, qd) around the start pose."""
    rng = np.random.default_rng(3)
    return [(arm.home + rng.uniform(-0.6, 0.6, 6), rng.uniform(-2, 2, 6)) for _ in range(20)]


def test_flange_is_the_dh_frame_at_random_joint_angles():
    plant = MultibodyPlant(0.0)
    handles = add_arm(plant, ArmSpec())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(1)
    for q in rng.uniform(-math.pi, math.pi, (100, 6)):
        plant.SetPositions(context, q)
        np.testing.assert_allclose(
            handles.flange.CalcPoseInWorld(context).GetAsMatrix4(), dh_flange(q), rtol=0, atol=1e-12
        )


def test_tool_lies_along_the_flange_axis_with_its_normal_along_the_flange_x():
    arm = ArmModel()
    for q in np.random.default_rng(2).uniform(-2, 2, (20, 6)):
        flange, tool = dh_flange(q), arm.X_WT(q).GetAsMatrix4()
        x, y, z = flange[:3, 0], flange[:3, 1], flange[:3, 2]
        np.testing.assert_allclose(tool[:3, :3], np.column_stack([z, -y, x]), rtol=0, atol=1e-12)
        np.testing.assert_allclose(tool[:3, 3], flange[:3, 3] + 0.14 * z, rtol=0, atol=1e-12)


def test_reach_is_532_mm(arm):
    # The wrist centre lies 0.23 m behind T on its x axis; the arm is stretched where the forearm's 30 mm offset is in line.
    stretched = -math.pi / 2 + math.atan2(0.030, 0.270)
    X_WT = arm.X_WT([0, math.pi / 2, stretched, 0, 0, 0])
    wrist = X_WT.translation() - 0.23 * X_WT.rotation().matrix()[:, 0]
    assert np.linalg.norm(wrist - [0, 0, 0.29]) == pytest.approx(0.5317, abs=5e-5)
    assert round(np.linalg.norm(wrist - [0, 0, 0.29]), 3) == 0.532


def test_control_point_is_tool_height_above_the_blade():
    q = [0.3, 0.4, 0.5, 0.6, -0.7, 1.0]
    low, high = (ArmModel(ArmSpec(tool_height=height)) for height in (0.0, 0.02))
    difference = high.task_position(q) - low.task_position(q)
    normal = low.X_WT(q).rotation().matrix()[:, 2]
    np.testing.assert_allclose(difference, [*(0.02 * normal[1:]), 0, 0.02 * normal[0], 0, 0], atol=1e-12)


def test_limits_are_the_published_ones_in_our_signs(arm):
    assert arm.joint_names == ("S", "L", "U", "R", "B", "T") and arm.n_joints == 6
    np.testing.assert_allclose(np.degrees(arm.q_min), [-160, -85, -260, -170, -120, -360], atol=1e-3)
    np.testing.assert_allclose(np.degrees(arm.q_max), [160, 90, 105, 170, 120, 360], atol=1e-3)
    np.testing.assert_allclose(np.degrees(arm.qd_max), [200, 150, 190, 300, 300, 420], rtol=1e-4)
    np.testing.assert_allclose(arm.tau_rated, [31.78, 71.19, 38.14, 11.42, 9.52, 7.76])
    np.testing.assert_allclose(arm.tau_max, 3 * arm.tau_rated, rtol=0.003)


def test_scales_act_on_what_they_name(arm):
    scaled = ArmModel(ArmSpec(Arm(speed_scale=1.5, torque_scale=0.5)))
    np.testing.assert_allclose(scaled.qd_max, 1.5 * arm.qd_max)
    np.testing.assert_allclose(scaled.tau_max, 0.5 * arm.tau_max)
    np.testing.assert_array_equal(scaled.q_max, arm.q_max)
    np.testing.assert_allclose(scaled.mass_matrix(arm.home), arm.mass_matrix(arm.home))


@pytest.mark.parametrize("degrees", [-89.9, -45, 0, 90, 179.9, 180.1, 225, 269.9, 270])
def test_theta_is_unwrapped_into_minus_quarter_to_three_quarter_turn(degrees):
    angle = math.radians(degrees)
    assert task_space.unwrapped_roll(math.sin(angle), math.cos(angle)) == pytest.approx(angle, abs=1e-12)


def test_theta_follows_joint_t_over_the_half_turn(arm):
    q = arm.inverse_kinematics(START)
    for turn in np.linspace(-1.5, 4.6, 30):
        assert arm.task_position(q + [0, 0, 0, 0, 0, turn])[2] == pytest.approx(turn, abs=1e-9)


def test_angles_are_roll_pitch_yaw_as_drake_defines_them():
    for roll, pitch, yaw in itertools.product((-1.0, 0.3, 2.0), (-1.2, 0.0, 0.7), (-2.0, 0.1, 3.0)):
        x = task_space.coordinates(RotationMatrix(RollPitchYaw(roll, pitch, yaw)).matrix(), np.array([1.0, 2.0, 3.0]))
        np.testing.assert_allclose(x, [2.0, 3.0, roll, 1.0, pitch, yaw], atol=1e-12)
    assert AXES == ("y", "z", "theta", "x", "pitch", "yaw")


def test_jacobian_is_the_derivative_of_the_task_coordinates(arm, states):
    h = 1e-6
    for q, qd in states:
        x, v, J, _ = arm.task_kinematics(q, qd)
        steps = h * np.eye(6)
        numeric = np.column_stack([arm.task_position(q + e) - arm.task_position(q - e) for e in steps]) / (2 * h)
        np.testing.assert_allclose(J, numeric, atol=1e-7)
        np.testing.assert_allclose(v, J @ qd, atol=1e-12)
        np.testing.assert_array_equal(arm.task_jacobian(q)[1], J)
        for ours, kinematics in zip(arm.task_position_velocity(q, qd), (x, v), strict=True):
            np.testing.assert_allclose(ours, kinematics, atol=1e-12)


def test_bias_is_the_drift_of_v_at_constant_joint_speed(arm, states):
    h = 1e-5
    for q, qd in states:
        ahead, behind = (arm.task_position_velocity(q + sign * h * qd, qd)[1] for sign in (1, -1))
        bias = arm.task_kinematics(q, qd)[3]
        np.testing.assert_allclose(bias, (ahead - behind) / (2 * h), atol=1e-6 * max(1, np.abs(bias).max()))


def test_autodiff_gives_the_same_jacobian_and_bias_to_rounding(arm, states):
    dual = arm.to_scalar(AutoDiffXd)
    for q, qd in states[:5]:
        _, _, J, bias = arm.task_kinematics(q, qd)
        q_dual = InitializeAutoDiff(q).ravel()
        np.testing.assert_allclose(ExtractGradient(dual.task_position(q_dual)), J, atol=1e-12)
        qd_dual = np.array([AutoDiffXd(speed, np.zeros(6)) for speed in qd])
        _, v = dual.task_position_velocity(q_dual, qd_dual)
        np.testing.assert_allclose(ExtractGradient(v) @ qd, bias, atol=1e-10)
        again = dual.task_kinematics(q_dual, qd_dual)
        np.testing.assert_allclose([b.value() for b in again[3]], bias, atol=1e-12)


def test_symbolic_form_evaluates_to_the_numbers(arm, states):
    q, qd = states[0]
    names, speeds = MakeVectorVariable(6, "q"), MakeVectorVariable(6, "qd")
    values = dict(zip([*names, *speeds], [*q, *qd], strict=True))
    symbolic = arm.to_scalar(Expression).task_kinematics(names, speeds)
    for expressions, numbers in zip(symbolic, arm.task_kinematics(q, qd), strict=True):
        evaluated = [e.Evaluate(values) if isinstance(e, Expression) else e for e in expressions.ravel()]
        np.testing.assert_allclose(evaluated, numbers.ravel(), atol=1e-11)


def test_an_unknown_scalar_type_is_refused(arm):
    with pytest.raises(InputError, match="choose from float, AutoDiffXd, Expression"):
        arm.to_scalar(int)


def test_pitch_of_ninety_degrees_has_no_rates():
    with pytest.raises(PlanningError, match="straight up or down"):
        task_space.rate_map(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]))


def test_start_pose_is_level_and_inside_the_limits(arm):
    q = arm.inverse_kinematics(START)
    np.testing.assert_allclose(arm.task_position(q), START, atol=1e-10)
    np.testing.assert_allclose(arm.X_WT(q).rotation().matrix(), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(arm.X_WT(q).translation(), [0.5, 0, 0.345], atol=1e-9)
    assert ((q > arm.q_min) & (q < arm.q_max)).all()
    assert np.abs(q - arm.home).max() < math.radians(3), "home is meant to be near the start pose"


def test_inverse_kinematics_returns_to_the_joint_angles_it_came_from(arm):
    rng = np.random.default_rng(4)
    for _ in range(20):
        q = arm.home + rng.uniform(-0.25, 0.25, 6)
        np.testing.assert_allclose(arm.inverse_kinematics(arm.task_position(q), q + 0.02), q, atol=1e-7)


def test_inverse_kinematics_finds_the_whole_flip_region_from_home(arm):
    for y, z, theta in itertools.product((-0.15, 0.1, 0.3), (0.2, 0.4, 0.6), (0.0, 1.2, 2.4)):
        pose = np.array([y, z, theta, 0.5, 0, 0])
        q = arm.inverse_kinematics(pose)
        np.testing.assert_allclose(arm.task_position(q), pose, atol=1e-9)
        assert ((q >= arm.q_min) & (q <= arm.q_max)).all()


def test_a_pose_out_of_reach_is_named(arm):
    with pytest.raises(PlanningError, match=r"z = 0\.35 m.*x = 0\.9 m"):
        arm.inverse_kinematics([0, 0.35, 0, 0.9, 0, 0])
    with pytest.raises(PlanningError, match=r"joint L would be at 118\.\d deg; valid is -85\.0 to 90\.0 deg"):
        arm.inverse_kinematics([0, -0.1, 0, 0.45, 0, 0])


def flip_path(samples):
    s = np.linspace(0, 1, samples)
    zeros = np.zeros(samples)
    theta = 2.4 * s**2 * (3 - 2 * s)
    return np.column_stack([0.2 * s, 0.35 + 0.1 * np.sin(3 * s), theta, 0.5 + zeros, zeros, zeros])


def test_path_follows_every_sample_on_one_branch(arm):
    xs = flip_path(100)
    qs = arm.inverse_kinematics_path(xs)
    np.testing.assert_allclose([arm.task_position(q) for q in qs], xs, atol=1e-9)
    assert np.abs(np.diff(qs, axis=0)).max() < 0.06
    coarse = arm.inverse_kinematics_path(xs[::9])
    np.testing.assert_allclose(coarse, qs[::9], atol=1e-8)


def test_a_path_that_leaves_the_limits_names_sample_and_joint(arm):
    zs = np.linspace(0.35, -0.1, 46)
    xs = np.tile([0, 0.35, 0, 0.45, 0, 0], (46, 1))
    xs[:, 1] = zs
    with pytest.raises(PlanningError, match=r"at sample \d+: .*joint L would be at") as caught:
        arm.inverse_kinematics_path(xs)
    qs = arm.inverse_kinematics_path(xs, check_limits=False)
    first = int(np.argmax(qs[:, 1] > arm.q_max[1]))
    assert 0 < first and f"sample {first}:" in str(caught.value)


def test_mass_matrix_is_symmetric_positive_definite(arm, states):
    for q, _ in states:
        M = arm.mass_matrix(q)
        np.testing.assert_allclose(M, M.T, atol=1e-12)
        assert np.linalg.eigvalsh(M).min() > 0


def test_reflected_inertia_is_in_mass_matrix_and_inverse_dynamics(states):
    bare, rotors, tripled = (ArmModel(ArmSpec(Arm(reflected_inertia_scale=scale))) for scale in (0, 1, 3))
    q, qd = states[0]
    np.testing.assert_allclose(rotors.mass_matrix(q) - bare.mass_matrix(q), np.diag(REFLECTED), rtol=1e-3, atol=1e-12)
    qdd = np.arange(1.0, 7.0)
    extra = tripled.inverse_dynamics(q, qd, qdd) - bare.inverse_dynamics(q, qd, qdd)
    np.testing.assert_allclose(extra, 3 * REFLECTED * qdd, rtol=1e-3)
    assert ArmModel().mass_matrix(q) == pytest.approx(tripled.mass_matrix(q)), "three times is the default"


def test_inverse_dynamics_is_linear_in_acceleration_with_slope_m(arm, states):
    for q, qd in states[:5]:
        qdd = qd[::-1] * 3
        difference = arm.inverse_dynamics(q, qd, qdd) - arm.inverse_dynamics(q, qd, 0 * qdd)
        np.testing.assert_allclose(difference, arm.mass_matrix(q) @ qdd, atol=1e-10)
        np.testing.assert_allclose(arm.inverse_dynamics(q, 0 * qd, 0 * qdd), arm.gravity_torque(q), atol=1e-10)


def test_the_torques_power_is_the_change_of_energy(arm, states):
    context = arm.plant.CreateDefaultContext()

    def energy(q, qd):
        arm.plant.SetPositions(context, q)
        return qd @ arm.mass_matrix(q) @ qd / 2 + arm.plant.CalcPotentialEnergy(context)

    h = 1e-5
    for q, qd in states[:5]:
        qdd = np.linspace(-3, 3, 6)
        ahead, behind = (energy(q + t * qd + t * t * qdd / 2, qd + t * qdd) for t in (h, -h))
        power = arm.inverse_dynamics(q, qd, qdd) @ qd
        assert power == pytest.approx((ahead - behind) / (2 * h), abs=1e-5)


def test_gravity_torque_of_the_horizontal_arm_by_hand(arm):
    # L at +90 deg, U at -90 deg: upper arm, forearm and spatula in one horizontal line. kg and m from the L axis.
    moments = (
        4.10 * 0.097
        + 3.20 * (0.26 + 0.023)
        + 1.30 * (0.53 - 0.069)
        + 0.60 * 0.53
        + 0.15 * (0.62 - 0.009)
        + 0.150 * (0.62 + 0.076033)
    )
    holding = arm.gravity_torque([0, math.pi / 2, -math.pi / 2, 0, 0, 0])
    assert holding[1] == pytest.approx(-9.81 * moments, rel=1e-6)
    assert holding[0] == pytest.approx(0, abs=1e-12)


def test_link_inertia_scale_scales_all_but_rotors_and_spatula(arm):
    q = arm.home
    masses = [
        ArmModel(ArmSpec(Arm(link_inertia_scale=s, reflected_inertia_scale=0))).mass_matrix(q) for s in (1, 1.3, 1.6)
    ]
    np.testing.assert_allclose(masses[2] - masses[1], masses[1] - masses[0], atol=1e-12)
    without_links = masses[0] - (masses[1] - masses[0]) / 0.3
    assert without_links[1, 1] == pytest.approx(0.150 * (0.5 - 0.064) ** 2, rel=0.05), "the spatula's about L"


@pytest.mark.parametrize("height", [-0.1, math.nan, math.inf])
def test_a_bad_height_is_named_and_carried(height):
    with pytest.raises(InputError, match=rf"tool_height = {height}; valid is a number of at least 0") as caught:
        ArmSpec(tool_height=height)
    assert caught.value.field == "tool_height" and caught.value.value is height


@pytest.mark.parametrize(
    ("path", "message"),
    [("nowhere.urdf", "cannot be read"), ("arm.step", "no known format; valid is .urdf, .sdf, .xml")],
)
def test_a_file_that_is_no_arm_is_named(path, message):
    with pytest.raises(InputError, match=f"arm.file = '{path}' .*{message}"):
        ArmSpec(Arm(file=path))


@pytest.mark.parametrize("name", ["link_inertia_scales", "reflected_inertia_scales"])
def test_factors_per_joint_must_be_one_each(name):
    with pytest.raises(InputError, match=rf"{name}' = \[1.0, 2.0\] has 2 entries; valid is one per joint, S L U R B T"):
        ArmModel(ArmSpec(Arm(**{name: (1.0, 2.0)})))


def test_bad_vectors_are_named(arm):
    with pytest.raises(InputError, match=r"q has shape \(5,\); valid is \(6,\): S L U R B T"):
        arm.task_position(np.zeros(5))
    with pytest.raises(InputError, match=r"qd has shape"):
        arm.task_kinematics(np.zeros(6), np.zeros((6, 1)))
    with pytest.raises(InputError, match=r"xs has shape \(6,\); valid is \(N, 6\)"):
        arm.inverse_kinematics_path(START)
    with pytest.raises(InputError, match="not finite"):
        arm.inverse_kinematics([0, math.nan, 0, 0.5, 0, 0])


def test_another_arm_may_have_another_number_of_joints(tmp_path):
    """A seventh joint under the base: the same poses are reached, with joint names and limits from that file."""
    text = model_path("mh3f.urdf").read_text(encoding="utf-8")
    extra = """
      <link name="base"/>
      <joint name="E" type="revolute"><parent link="base"/><child link="turntable"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" velocity="2" effort="50"/></joint>
      <transmission><type>transmission_interface/SimpleTransmission</type><joint name="E"/><actuator name="E"/></transmission>
    """
    text = text.replace('link name="base"', 'link name="turntable"').replace(
        'parent link="base"', 'parent link="turntable"'
    )
    path = tmp_path / "seven.urdf"
    path.write_text(text.replace("</robot>", extra + "</robot>"), encoding="utf-8")
    arm = ArmModel(ArmSpec(Arm(file=str(path))))
    assert arm.joint_names == ("E", "S", "L", "U", "R", "B", "T") and arm.tau_rated[0] == 50
    np.testing.assert_allclose(arm.q_max[:2], [1, math.radians(160)], atol=1e-6)
    q = arm.inverse_kinematics(START + [0.1, 0, 0.5, 0, 0, 0])
    np.testing.assert_allclose(arm.task_position(q), START + [0.1, 0, 0.5, 0, 0, 0], atol=1e-10)
    assert arm.task_kinematics(q, np.ones(7))[2].shape == (6, 7)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('frame name="flange"', 'frame name="face"', "has no link or frame 'flange'"),
        ('effort="95.5"', 'effort="0"', "joint 'S' has no torque limit"),
        ('parent link="base"', 'parent link="nothing"', "parent is 'nothing'; valid is one link of the file"),
        ("</robot>", "", "not valid XML"),
    ],
)
def test_an_arm_file_that_lacks_something_is_refused(tmp_path, old, new, message):
    path = tmp_path / "arm.urdf"
    path.write_text(model_path("mh3f.urdf").read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        ArmModel(ArmSpec(Arm(file=str(path))))
