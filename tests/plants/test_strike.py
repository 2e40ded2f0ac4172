"""A blade that strikes the table: the springs of the model files, in both engines."""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from flipdiagram.planning import plan_motion
from flipdiagram.plants.handle import add_model
from flipdiagram.plants.mujoco_contact import BLOW, Spring, compiled, contact_boxes, give_way, springs
from flipdiagram.robot.model_files import spatula_urdf
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.events import strike_index
from flipdiagram.simulation.simulate import simulate
from flipdiagram.theory.impact import damping_ratio, restitution

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'flipdiagram[mujoco]'")


@pytest.mark.parametrize(("mass", "spring"), [(3.0, Spring(1.5e5, 2.0)), (0.5, Spring(4e4, 0.0))])
def test_a_ball_comes_back_from_a_spring_as_the_closed_form_says(mass, spring):
    text = f"""<mujoco><option timestep="2e-5" gravity="0 0 0" cone="elliptic"/><worldbody>
      <body name="blade" pos="0 0 0.1"><freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
        <geom name="ball" type="sphere" size="0.05" contype="0" conaffinity="0"/></body>
      <geom name="floor" type="plane" size="1 1 1" contype="0" conaffinity="0"/></worldbody>
      <contact><pair name="hit" geom1="ball" geom2="floor" solimp="0.02 0.02 0.001"/></contact></mujoco>"""
    model = compiled(mujoco, text)
    give_way(model, {"hit": spring})
    data = mujoco.MjData(model)
    data.qvel[2], touched, deepest = -BLOW, 0.0, 0.0
    for _ in range(20_000):
        mujoco.mj_step(model, data)
        touched += data.ncon * 2e-5
        deepest = max(deepest, 0.05 - data.qpos[2])
    omega, back = math.sqrt(spring.stiffness / mass), restitution(spring.dissipation, BLOW)
    zeta = damping_ratio(back)
    root = math.sqrt(1 - zeta**2)
    # of a damped oscillator: its greatest way is where the speed is zero
    way = BLOW / omega * math.exp(-zeta / root * math.atan2(root, zeta))
    assert data.qvel[2] == pytest.approx(back * BLOW, rel=0.03)
    assert deepest == pytest.approx(way, rel=0.03)
    assert touched == pytest.approx(math.pi / root / omega, rel=0.05)


def test_two_springs_in_a_row_are_what_drake_makes_of_them():
    plant, scene_graph = MultibodyPlant(0.001), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parts = add_model(plant, Scenario())
    boxes = contact_boxes(plant, scene_graph, parts)
    found = springs(boxes, ("blade-block", "table-block", "table-blade"))
    # 2 E l (t / w)³: 100 x 90 x 2 mm of aluminium; the table is so hard that the blade alone gives way; a rubber block
    # names no spring
    blade = Spring(pytest.approx(2 * 70e9 * 0.1 * (2 / 90) ** 3, rel=1e-3), pytest.approx(2.0, rel=1e-3))
    assert found == {"table-blade": blade}
    halved = {name: [box._replace(spring=Spring(1e5, 1.0)) for box in of_body] for name, of_body in boxes.items()}
    halved["table"] = [box._replace(spring=Spring(3e5, 5.0)) for box in boxes["table"]]
    # three quarters of the way are the softer's
    assert springs(halved, ("table-blade",))["table-blade"] == Spring(pytest.approx(75e3), pytest.approx(2.0))


def test_a_thicker_blade_is_stiffer_by_the_cube():
    def stiffness(thickness):
        text = spatula_urdf(Scenario().with_overrides({"tool.blade_thickness": thickness}))
        element = ElementTree.fromstring(text).find(".//{http://drake.mit.edu}point_contact_stiffness")
        return float(element.attrib["value"])

    assert stiffness(0.004) == pytest.approx(8 * stiffness(0.002))


@pytest.mark.parametrize("architecture", ["pd", "pd+ff"])
def test_both_engines_throw_the_blade_back_alike(architecture):
    scenario = Scenario().with_overrides({"simulation.step": 0.0005})
    speeds, times, plan = [], [], plan_motion(scenario)
    for engine in ("drake", "mujoco"):
        data = simulate(scenario.with_overrides({"simulation.engine": engine}), architecture, plan).recording
        hit = strike_index(data)
        speeds.append(data["v"].values[hit - 1 : hit + 25, 1])
        times.append(float(data["time"][hit]))
    assert times[0] == pytest.approx(times[1], abs=1.5e-3)
    drake, mujoco_ = (np.array([speed[0], speed.max()]) for speed in speeds)
    assert drake[0] == pytest.approx(mujoco_[0], abs=0.02)
    assert drake[1] == pytest.approx(mujoco_[1], rel=0.15)  # 0.14 m/s apart where MuJoCo's contact was of its own
