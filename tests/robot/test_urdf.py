"""The model files: every number with its source, physical inertias, collision shapes where they are needed and nowhere else."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.errors import InputError
from flipdiagram.robot import model_files
from flipdiagram.robot.own_files import joint_numbers

FILES = ("mh3f.urdf", "spatula.urdf", "block.sdf", "table.sdf")
DRAKE = "{http://drake.mit.edu}"
DEFAULT = IDEAL
"""Its numbers are those of the files."""


def text_of(name):
    return model_files.model_path(name).read_text(encoding="utf-8")


def parsed(text, kind):
    plant = MultibodyPlant(0.0)
    (instance,) = Parser(plant).AddModelsFromString(text, kind)
    plant.Finalize()
    return plant, instance


@pytest.mark.parametrize("name", FILES)
def test_every_number_stands_under_a_comment_with_its_confidence(name):
    numbers = r"<(?:mass|inertia|limit|drake:gear_ratio|drake:rotor_inertia|drake:hydroelastic_\w+|drake:hunt\w+|drake:mu_static)\b"
    lines = [line.strip() for line in text_of(name).splitlines()]
    found = [i for i, line in enumerate(lines) if re.match(numbers, line)]
    assert found
    for i in found:
        comment = lines[i - 1]
        assert comment.startswith("<!--") and re.search(r"\[[HML][\]:,]", comment), f"{name}:{i + 1} {lines[i]}"


@pytest.mark.parametrize(
    "joint", ElementTree.fromstring(text_of("mh3f.urdf")).findall("joint"), ids=lambda j: j.get("name")
)
def test_every_joint_says_where_its_length_comes_from(joint):
    start = text_of("mh3f.urdf").index(f'<joint name="{joint.get("name")}" type')
    assert re.match(r"<joint [^>]*>\s*<!-- .*\[H\] -->\s*<origin", text_of("mh3f.urdf")[start:])


@pytest.mark.parametrize("name", FILES)
def test_file_loads_without_warning_and_needs_no_mesh(name, caplog):
    assert not re.search(r"mesh|package://|\.(?:obj|stl|dae)", text_of(name))
    plant, instance = parsed(text_of(name), Path(name).suffix[1:])
    assert plant.num_bodies() > 1 and not caplog.records
    for index in plant.GetBodyIndices(instance):
        assert plant.get_body(index).default_spatial_inertia().IsPhysicallyValid()


def test_collision_geometry_is_on_blade_block_and_table_only():
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.001)
    for name in FILES:
        Parser(plant).AddModels(str(model_files.model_path(name)))
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    solid = [inspector.GetName(g) for g in inspector.GetAllGeometryIds(Role.kProximity)]
    assert sorted(solid) == ["block::block", "spatula::blade", "table::table"]
    assert len(inspector.GetAllGeometryIds(Role.kIllustration)) > 25


def test_arm_weighs_what_the_data_sheet_says():
    plant, instance = parsed(text_of("mh3f.urdf"), "urdf")
    masses = {plant.get_body(i).name(): plant.get_body(i).default_mass() for i in plant.GetBodyIndices(instance)}
    assert sum(masses.values()) == pytest.approx(27)
    assert 8.5 < 27 - masses["base"] < 17.8, "between the authors' simulation and the IRB 120 scaled to 27 kg"


def test_inertias_follow_the_rule_that_the_file_states():
    """IRB 120 [kg, kg m^2] times 27/25 times the length ratio; two figures of rounding."""
    cases = {
        "link_s": (3.067, (0.0142, 0.0144, 0.0105), 1.0),
        "link_l": (3.909, (0.0603, 0.0416, 0.0260), 260 / 270),
        "link_u": (2.944, (0.0084, 0.0167, 0.0127), 1.0),
        "link_r": (1.328, (0.0029, 0.0040, 0.0053), 270 / 302),
        "link_b": (0.546, (0.0004, 0.0009, 0.0008), 1.0),
    }
    root = ElementTree.fromstring(text_of("mh3f.urdf"))
    for name, (mass, inertia, length_ratio) in cases.items():
        inertial = root.find(f"link[@name='{name}']/inertial")
        ours = float(inertial.find("mass").get("value"))
        assert ours == pytest.approx(mass * 27 / 25 * length_ratio, rel=0.02)
        scaled = np.array(inertia) * ours / mass * length_ratio**2
        np.testing.assert_allclose(
            [float(inertial.find("inertia").get(k)) for k in ("ixx", "iyy", "izz")], scaled, rtol=0.02
        )


def test_rotor_inertia_times_ratio_squared_is_the_reflected_inertia():
    plant, _ = parsed(text_of("mh3f.urdf"), "urdf")
    reflected = [plant.GetJointActuatorByName(name).default_reflected_inertia() for name in "SLURBT"]
    np.testing.assert_allclose(reflected, [0.036, 0.183, 0.052, 0.024, 0.017, 0.011], rtol=1e-3)
    ratios = [plant.GetJointActuatorByName(name).default_gear_ratio() for name in "SLURBT"]
    np.testing.assert_allclose(ratios, [100, 224, 120, 120, 100, 81.48])
    stiffness = joint_numbers(text_of("mh3f.urdf"), "SLURBT").gear_stiffness
    assert stiffness == {"S": 1.6e4, "L": 3.1e4, "U": 1.6e4, "R": 1.0e4, "B": 4.7e3, "T": 4.7e3}


def test_home_lies_inside_the_limits_and_a_joint_without_it_gets_the_middle():
    text = text_of("mh3f.urdf")
    for name, angle in joint_numbers(text, "SLURBT").home.items():
        limit = ElementTree.fromstring(text).find(f"joint[@name='{name}']/limit")
        assert float(limit.get("lower")) < angle < float(limit.get("upper"))
    plain = re.sub(r' (?:home|rated_effort)="[^"]*"', "", text)
    assert joint_numbers(plain, "SLURBT").home is None
    some = re.sub(r' home="[^"]*"', "", text, count=2)
    assert joint_numbers(some, "SLURBT").home["L"] == pytest.approx(np.radians(2.5), abs=1e-5)
    assert joint_numbers(plain, "SLURBT").rated_torque["L"] == 213.9


def test_spatula_inertia_in_the_file_is_that_of_its_shape():
    """File and formula agree, and the formula agrees with a blade and a rod put together by hand."""
    for text in (text_of("spatula.urdf"), model_files.spatula_urdf(DEFAULT)):
        plant, instance = parsed(text, "urdf")
        inertia = plant.GetBodyByName("spatula").default_spatial_inertia()
        blade, handle = 0.049, 0.101
        centre = (blade * 0.14 + handle * 0.045) / 0.150
        np.testing.assert_allclose(inertia.get_com(), [centre, 0, -0.001], atol=1e-6)
        about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        iyy = blade * ((0.100**2 + 0.002**2) / 12 + (0.14 - centre) ** 2) + handle * (
            (3 * 0.008**2 + 0.090**2) / 12 + (0.045 - centre) ** 2
        )
        assert about_com[1, 1] == pytest.approx(iyy, rel=1e-4)
        assert about_com[0, 0] == pytest.approx(blade * (0.09**2 + 0.002**2) / 12 + handle * 0.008**2 / 2, rel=1e-4)


def test_spatula_takes_the_scenarios_numbers():
    tool = {"blade_length": 0.12, "blade_width": 0.08, "blade_thickness": 0.003, "reach": 0.2, "mass": 0.3}
    scenario = DEFAULT.with_overrides(
        {f"tool.{name}": value for name, value in tool.items()} | {"object.friction": 0.5}
    )
    text = model_files.spatula_urdf(scenario)
    plant, _ = parsed(text, "urdf")
    context = plant.CreateDefaultContext()
    T_in_body = plant.GetFrameByName("tool").CalcPose(context, plant.GetFrameByName("spatula"))
    np.testing.assert_allclose(T_in_body.translation(), [0.2, 0, 0])
    assert plant.GetBodyByName("spatula").default_mass() == pytest.approx(0.3)
    root = ElementTree.fromstring(text)
    assert root.find("link/collision/geometry/box").get("size") == "0.12 0.08 0.003"
    assert root.find("link/collision/origin").get("xyz") == "0.2 0 -0.0015", "top surface at z = 0"
    assert root.find("link/visual[@name='handle']/geometry/cylinder").get("length") == repr(0.2 - 0.06)
    assert [e.get("value") for e in root.iter() if e.tag.startswith(DRAKE + "mu")] == ["0.5", "0.5"]


def test_block_is_a_homogeneous_box_of_the_papers_size():
    for text in (text_of("block.sdf"), model_files.block_sdf(DEFAULT)):
        plant, _ = parsed(text, "sdf")
        inertia = plant.GetBodyByName("block").default_spatial_inertia()
        assert inertia.get_mass() == 0.061
        expected = 0.061 / 12 * np.array([65**2 + 10**2, 62**2 + 10**2, 65**2 + 62**2]) * 1e-6
        np.testing.assert_allclose(inertia.CalcRotationalInertia().get_moments(), expected, rtol=1e-5)
        assert {e.text for e in ElementTree.fromstring(text).iter("size")} <= {"0.062 0.065 0.010", "0.062 0.065 0.01"}


def test_block_takes_the_scenarios_numbers():
    block = {"width": 0.1, "length": 0.08, "thickness": 0.02, "mass": 0.25, "friction": 0.3}
    unknown = {"disturbance.object_mass_scale": 2.0}
    physics = {"simulation.hydroelastic_modulus": 2e5, "simulation.dissipation": 5.0}
    objects = {f"object.{name}": value for name, value in block.items()}
    text = model_files.block_sdf(DEFAULT.with_overrides(objects | unknown | physics))
    root = ElementTree.fromstring(text)
    assert [e.text for e in root.iter("size")] == ["0.1 0.08 0.02"] * 2
    assert float(root.find(".//ixx").text) == pytest.approx(0.5 / 12 * (0.08**2 + 0.02**2))
    contact = {e.tag.removeprefix(DRAKE): e.text for e in root.iter() if e.tag.startswith(DRAKE) and e.text}
    assert contact["mu_static"] == contact["mu_dynamic"] == "0.3"
    assert float(contact["hydroelastic_modulus"]) == 2e5 and float(contact["hunt_crossley_dissipation"]) == 5


def test_table_hangs_below_its_frame():
    root = ElementTree.fromstring(model_files.table_sdf(0.7))
    assert [e.text for e in root.iter("pose")] == ["0 0 -0.01 0 0 0"] * 2
    assert [[float(edge) for edge in e.text.split()] for e in root.iter("size")] == [list(model_files.table_size())] * 2
    assert [e.text for e in root.iter() if e.tag.startswith(DRAKE + "mu")] == ["0.7", "0.7"]


def test_bad_numbers_are_named():
    with pytest.raises(InputError, match="no model file 'mh5.urdf'; choose from .*mh3f.urdf, spatula.urdf"):
        model_files.model_path("mh5.urdf")
    with pytest.raises(InputError, match="leaves no handle; valid is more than half the blade, 0.05 m") as caught:
        model_files.spatula_urdf(DEFAULT.with_overrides({"tool.reach": 0.05}))
    assert (caught.value.field, caught.value.value) == ("tool.reach", 0.05)


def test_files_are_found_in_a_checkout_and_in_a_wheel(monkeypatch, tmp_path):
    for layout in (tmp_path / "wheel" / "flipdiagram" / "urdf", tmp_path / "checkout" / "urdf"):
        layout.mkdir(parents=True)
    (tmp_path / "checkout" / "flipdiagram").mkdir()
    for root, expected in (("wheel", "flipdiagram/urdf"), ("checkout", "urdf")):
        monkeypatch.setattr(model_files, "__file__", str(tmp_path / root / "flipdiagram" / "robot" / "model_files.py"))
        assert model_files.urdf_directory() == (tmp_path / root / expected).resolve()
