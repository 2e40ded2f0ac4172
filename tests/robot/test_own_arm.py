"""Arms, tools and objects of the user's own: the same arm in three formats, two arms of a package, and what is refused."""

import numpy as np
import pytest
from elbow import EFFORT, FORMATS, HOME, LIMITS, LINKS, SPEED, urdf
from ideal import IDEAL
from pydrake.geometry import Role
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from robots import PANDA, UR5, package_file
from shared import ideal_plan

from flipdiagram.blocks.inverse_jacobian import joint_acceleration
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import InputError, PlanningError
from flipdiagram.planning import plan_motion
from flipdiagram.robot import inverse_kinematics
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.arm_spec import ArmSpec
from flipdiagram.robot.model_files import block_sdf, spatula_urdf
from flipdiagram.robot.parts import add_parts
from flipdiagram.scenario.cell import Arm
from flipdiagram.scenario.scenario import Scenario, load_scenario
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.simulate import simulate


def arm_of(folder, name, base_pose=(0.0, 0.0, 0.0, 0.0), **options):
    (folder / name).write_text(FORMATS[name](), encoding="utf-8")
    fields = {
        "flange": "tcp",
        "home": HOME,
        "mount_angle": np.pi,
        "reflected_inertia_scale": 1.0,
        "base_pose": base_pose,
    }
    return ArmModel(ArmSpec(Arm(file=str(folder / name), **(fields | LIMITS | options))))


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_arm_in_three_formats_has_the_same_kinematics_and_inertia(tmp_path, name):
    arm, reference = arm_of(tmp_path, name), arm_of(tmp_path, "arm.urdf")
    assert arm.joint_names == tuple(joint for joint, *_ in LINKS), "the finger does not move"
    np.testing.assert_allclose([arm.tau_max, arm.qd_max], [[EFFORT] * 6, [SPEED] * 6])
    rng = np.random.default_rng(5)
    for q in rng.uniform(-1, 1, (5, 6)):
        np.testing.assert_allclose(arm.task_position(q), reference.task_position(q), atol=1e-9)
        np.testing.assert_allclose(arm.mass_matrix(q), reference.mass_matrix(q), atol=1e-7)


@pytest.mark.parametrize("name", FORMATS)
def test_what_an_arm_touches_with_is_left_out_of_the_cell(tmp_path, name):
    (tmp_path / name).write_text(FORMATS[name](), encoding="utf-8")
    fields = {"file": str(tmp_path / name), "flange": "tcp"} | LIMITS
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    parts = add_parts(plant, IDEAL.with_overrides({f"arm.{field}": value for field, value in fields.items()}))
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    touching = set(inspector.GetAllGeometryIds(Role.kProximity))
    ours = parts.arm.spatula_body, parts.block, parts.table
    assert touching == {shape for body in ours for shape in plant.GetCollisionGeometriesForBody(body)}


def test_the_tip_of_the_elbow_arm_lies_where_trigonometry_puts_it(tmp_path):
    """In the plane: shoulder at 0.3 m, upper arm 0.26 m, then 0.27 + 0.05 m forward with 0.03 m up, tool 0.14 m out."""
    arm = arm_of(tmp_path, "arm.urdf")
    a, b, c = 0.3, 0.6, -0.9  # turns about y: down is positive
    x_task = arm.task_position([0, a, b, 0, c, 0])
    fore, wrist = a + b, a + b + c
    x = 0.26 * np.sin(a) + 0.27 * np.cos(fore) + 0.03 * np.sin(fore) + 0.19 * np.cos(wrist)
    z = 0.3 + 0.26 * np.cos(a) - 0.27 * np.sin(fore) + 0.03 * np.cos(fore) - 0.19 * np.sin(wrist) + 0.005
    np.testing.assert_allclose(x_task, [0, z, 0, x, wrist, 0], atol=1e-9)


def test_the_base_may_stand_elsewhere_and_the_spatula_be_turned_on_the_flange(tmp_path):
    still, moved = arm_of(tmp_path, "arm.urdf"), arm_of(tmp_path, "arm.urdf", base_pose=(0.1, -0.2, 0.05, 0.0))
    np.testing.assert_allclose(
        moved.task_position(HOME) - still.task_position(HOME), [-0.2, 0.05, 0, 0.1, 0, 0], atol=1e-12
    )
    turned = arm_of(tmp_path, "arm.urdf", mount_angle=np.pi + 0.4)
    assert turned.task_position(HOME)[2] == pytest.approx(0.4, abs=1e-9)


def test_given_rotor_inertia_stands_on_the_diagonal_of_the_mass_matrix(tmp_path):
    rotors = np.array([1.0, 0.9, 0.5, 0.2, 0.1, 0.05])
    bare, geared = arm_of(tmp_path, "arm.urdf"), arm_of(tmp_path, "arm.urdf", reflected_inertia=tuple(rotors))
    np.testing.assert_allclose(geared.mass_matrix(HOME) - bare.mass_matrix(HOME), np.diag(rotors), atol=1e-12)


@pytest.mark.parametrize(("fields", "joints"), [(UR5, 6), (PANDA, 7)], ids=["UR5", "Panda"])
def test_an_arm_of_a_package_turns_the_block_over(fields, joints):
    named = fields | {"arm.file": package_file(fields["arm.file"])}
    scenario = IDEAL.with_overrides(named | {"simulation.hold_time": 1.0})
    plan = plan_motion(scenario)
    assert max(plan.limit_use.values()) <= 1
    flip = simulate(scenario, "pd+ff+dob", plan)
    found = measure(flip.recording)
    assert found.success, found.failure
    assert flip.recording.sizes["joint"] == joints == len(found.max_torque_Nm)
    limits = build_loop(scenario).arm.tau_max
    assert np.all(np.array(found.max_torque_Nm) <= limits + 1e-9)


def test_a_redundant_arm_does_in_its_inner_motion_what_does_not_move_the_tool():
    rng = np.random.default_rng(1)
    for _ in range(5):
        J, bias, a_ref, inner = rng.normal(size=(6, 7)), rng.normal(size=6), rng.normal(size=6), rng.normal(size=7)
        qdd = joint_acceleration(J, bias, a_ref, inner)
        np.testing.assert_allclose(J @ qdd + bias, a_ref, atol=1e-9)
        # what is left of the inner motion is its part in the kernel of J
        kernel = np.linalg.svd(J)[2][-1]
        assert kernel @ qdd == pytest.approx(kernel @ inner, abs=1e-9)


def test_an_arm_out_of_reach_is_said_to_be_so(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf(), encoding="utf-8")
    fields = {"arm.file": str(tmp_path / "arm.urdf"), "arm.flange": "tcp", "arm.base_pose": (0.0, 3.0, 0.0, 0.0)}
    with pytest.raises(PlanningError, match="cannot reach the pose"):
        plan_motion(IDEAL.with_overrides(fields))


def test_the_search_for_the_start_ends_after_so_many_poses_with_what_it_has(tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(urdf(), encoding="utf-8")
    arm, asked = ArmModel(ArmSpec(Arm(file=str(tmp_path / "arm.urdf"), flange="tcp", mount_angle=np.pi))), []
    monkeypatch.setattr(inverse_kinematics, "MOST_POSES", 300)
    monkeypatch.setattr(arm, "task_jacobian", lambda q, ask=arm.task_jacobian: asked.append(q) or ask(q))
    near, far = [0.0, 0.35, 0.0, 0.5, 0.0, 0.0], [0.0, 0.35, 0.0, 5.0, 0.0, 0.0]
    np.testing.assert_allclose(arm.task_position(arm.inverse_kinematics(near)), near, atol=1e-9)
    assert 300 < len(asked) < 300 + 2 * inverse_kinematics.ITERATIONS
    with pytest.raises(PlanningError, match=r"no joint angles found, 3\d\d poses tried from all over joint space"):
        arm.inverse_kinematics(far)


REFUSED = {
    "no file": ({"file": "nowhere.urdf"}, "arm.file = 'nowhere.urdf' cannot be read"),
    "unknown kind": ({"file": "arm.stl"}, "is of no known format; valid is .urdf, .sdf, .xml"),
    "unknown flange": ({"flange": "tip"}, "has no link or frame 'tip'; choose from"),
    "flange off the base": ({"base": "finger"}, "'tcp' is not carried by 'finger'"),
    "too few joints": ({"base": "l1"}, "has 5 moving joints; valid are at least 6"),
    "home of another arm": (
        {"home": (0.0,)},
        "'arm.home' = [0.0] has 1 entries; valid is one per joint, j1 j2 j3 j4 j5 j6",
    ),
}


@pytest.mark.parametrize(("fields", "message"), REFUSED.values(), ids=REFUSED)
def test_an_arm_that_will_not_do_is_refused_with_the_reason(tmp_path, fields, message):
    (tmp_path / "arm.urdf").write_text(urdf(), encoding="utf-8")
    named = {"file": str(tmp_path / "arm.urdf"), "flange": "tcp"} | fields
    scenario = IDEAL.with_overrides({f"arm.{name}": value for name, value in named.items()})
    with pytest.raises(InputError) as refused:
        build_loop(scenario)
    assert message in str(refused.value) and "\n" not in str(refused.value)


def test_fields_of_another_arm_need_one():
    with pytest.raises(InputError, match=r"'arm.home' = .* valid is the default unless arm.file names another arm"):
        IDEAL.with_overrides({"arm.home": (0.0,) * 6})


@pytest.mark.parametrize("name", ["arm.sdf", "arm.xml"])
def test_links_are_scaled_in_every_format_alike(tmp_path, name):
    scales = {"link_inertia_scale": 1.3, "link_inertia_scales": (1.0, 1.0, 2.0, 1.0, 1.0, 0.5)}
    plain, scaled = arm_of(tmp_path, "arm.urdf"), arm_of(tmp_path, name, **scales)
    of_urdf = arm_of(tmp_path, "arm.urdf", **scales)
    np.testing.assert_allclose(scaled.mass_matrix(HOME), of_urdf.mass_matrix(HOME), rtol=1e-6)
    np.testing.assert_allclose(scaled.gravity_torque(HOME), of_urdf.gravity_torque(HOME), rtol=1e-6, atol=1e-6)
    assert scaled.mass_matrix(HOME)[0, 0] > 1.1 * plain.mass_matrix(HOME)[0, 0]


def test_an_arm_without_inertia_of_its_drives_is_told_that_and_not_of_the_friction(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf(), encoding="utf-8")
    fields = {"arm.file": str(tmp_path / "arm.urdf"), "arm.flange": "tcp", "arm.home": HOME, "arm.mount_angle": np.pi}
    with pytest.raises(
        InputError, match=r"arm.reflected_inertia has the inertia of rotor and gear of joint j6"
    ) as told:
        build_loop(Scenario().with_overrides(fields))
    assert told.value.field == "arm.reflected_inertia" and "\n" not in str(told.value)


def test_our_tool_and_block_as_files_give_the_same_run(tmp_path):
    """A scenario file names them relative to itself."""
    default, short = Scenario(), {"simulation.hold_time": 0.05, "simulation.settle_time": 0.0}
    (tmp_path / "block.sdf").write_text(block_sdf(default))
    (tmp_path / "spatula.urdf").write_text(spatula_urdf(default))
    (tmp_path / "mine.yaml").write_text("tool: {file: spatula.urdf}\nobject: {file: block.sdf}\n")
    plan = ideal_plan()
    ours = simulate(default.with_overrides(short), "pd", plan).recording
    own = simulate(load_scenario(tmp_path / "mine.yaml").with_overrides(short), "pd", plan).recording
    for name in ("x", "tau", "block_pose"):
        np.testing.assert_array_equal(own[name].values, ours[name].values)


def test_an_object_that_weighs_something_else_is_refused(tmp_path):
    (tmp_path / "block.sdf").write_text(block_sdf(IDEAL.with_overrides({"object.mass": 0.2})))
    with pytest.raises(InputError, match=r"weighs 0.2 kg; valid is object.mass = 0.061 kg"):
        build_loop(IDEAL.with_overrides({"object.file": str(tmp_path / "block.sdf")}))
