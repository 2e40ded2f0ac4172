"""Files of arms, tools and objects that cannot be, or that contradict the scenario: each is one line."""

import re

import pytest
from elbow import FORMATS, mjcf, sdf, urdf
from hostile.table import Case, check
from ideal import IDEAL

from flipdiagram.robot.model_files import block_sdf, spatula_urdf

ELBOW = {kind: make() for kind, make in FORMATS.items()}
LIMITS = ["--arm.torque_limits", "[90, 90, 90, 90, 90, 90]", "--arm.speed_limits", "[6, 6, 6, 6, 6, 6]"]
URDF, SDF, MJCF = "arm.urdf", "arm.sdf", "arm.xml"
LIMIT = '<limit lower="-2.9"'


def arm(name, file, change, *says, code=2):
    """A case: an arm's file, made of the sound one by a change: old and new text, or all of it."""
    content = change if isinstance(change, str | bytes) else ELBOW[file].replace(*change, 1)
    assert content != ELBOW[file]
    words = ["plan", "--quiet", "--arm.file", file, "--arm.flange", "tcp", *(LIMITS if file != URDF else [])]
    return Case(f"{file}: {name}", words, code, says, {file: content})


def joint(old, new):
    return f'name="j2" type="revolute"{old}', f'name="j2"{new}'


def extra(name, parent, child, kind="fixed"):
    return (
        "</robot>",
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint></robot>',
    )


MANY = "".join(f'<link name="x{k}"/>' for k in range(200))
UNPHYSICAL = "none larger than the sum of the two others"
ARMS = [
    arm("a joint without type", URDF, joint("", ""), "joint 'j2' without a type", "valid is revolute"),
    arm("a joint without name", URDF, ('name="j2" ', ""), "a joint without a name"),
    arm("a link without name", URDF, ('<link name="l2">', "<link>"), "a link without a name"),
    arm("two links of a name", URDF, ('<link name="l2">', '<link name="l1">'), "two links of the name 'l1'"),
    arm("two joints of a name", URDF, ('name="j2"', 'name="j1"'), "two joints of the name 'j1'"),
    arm("a limit in words", URDF, ('lower="-2.9"', 'lower="low"'), "limit lower = 'low' in joint 'j1'"),
    arm("a limit that is none", URDF, ('upper="2.9"', 'upper="nan"'), "limit upper = 'nan' in joint 'j1'"),
    arm("a range upside down", URDF, ('lower="-2.9"', 'lower="3"'), "limit lower = 3", "at most limit upper = 2.9"),
    arm("a speed below 0", URDF, ('velocity="6.0"', 'velocity="-6"'), "velocity = '-6'", "a number of at least 0"),
    arm("a torque below 0", URDF, ('effort="90.0"', 'effort="-6"'), "effort = '-6'", "a number of at least 0"),
    arm("a home in words", URDF, (LIMIT, f'{LIMIT} home="here"'), "limit home = 'here'"),
    arm("an axis of length 0", URDF, ('axis xyz="0 0 1"', 'axis xyz="0 0 0"'), "axis xyz = '0 0 0' in joint 'j1'"),
    arm("a place in words", URDF, ('origin xyz="0 0 0.3"', 'origin xyz="0 0 up"'), "origin xyz = '0 0 up'"),
    arm("a place of two numbers", URDF, ('origin xyz="0 0 0.3"', 'origin xyz="0 0"'), "valid is 3 numbers"),
    arm("a place beyond sense", URDF, ('origin xyz="0 0 0.3"', 'origin xyz="0 0 1e300"'), "none beyond 1e+09"),
    arm("inertia in words", URDF, ('ixx="0.01"', 'ixx="much"'), "inertia ixx = 'much' in link 'l1'"),
    arm("a mass below 0", URDF, ('mass value="2.0"', 'mass value="-2"'), "mass value = '-2' in link 'l3'"),
    arm("inertia below 0", URDF, ('ixx="0.01"', 'ixx="-0.01"'), UNPHYSICAL, "in link 'l1'"),
    arm("inertia of no body", URDF, ('ixx="0.01"', 'ixx="1"'), UNPHYSICAL, "in link 'l1'"),
    arm("inertia without mass", URDF, ('<mass value="3.0"/>', ""), UNPHYSICAL, "in link 'l1'"),
    arm("a planar joint", URDF, joint("", ' type="planar"'), "joint 'j2' of type 'planar'", "valid is revolute"),
    arm("a floating joint", URDF, joint("", ' type="floating"'), "joint 'j2' of type 'floating'"),
    arm("an unknown joint", URDF, joint("", ' type="hing"'), "type = 'hing' in joint 'j2'"),
    arm("a mimic in the chain", URDF, (LIMIT, f'<mimic joint="j2"/>{LIMIT}'), "joint 'j1' that mimics another"),
    arm("two parents", URDF, extra("x", "l1", "l4"), "is no tree: the joints 'j4' and 'x' carry the same link"),
    arm("its own parent", URDF, ('parent link="l2"', 'parent link="l3"'), "is no tree: the joint 'j3' carries itself"),
    arm("a cycle", URDF, ('parent link="base"', 'parent link="l6"'), "is no tree: the joint 'j1' carries itself"),
    arm("a cycle through the base", URDF, ('parent link="world"', 'parent link="l6"'), "is no tree", "carries itself"),
    arm("a cycle beside the chain", URDF, extra("x", "finger", "finger"), "is no tree"),
    arm("a parent that is not there", URDF, ('parent link="l2"', 'parent link="l9"'), "joint 'j3' whose parent is 'l9'"),
    arm("a joint without child", URDF, ('<child link="l3"/>', ""), "joint 'j3' whose child is ''"),
    arm("in two pieces", URDF, ('<parent link="l2"/><child link="l3"/>', '<parent link="world"/><child link="l3"/>'), "'tcp' is not carried by 'base'"),
    arm("too many links", URDF, ("</robot>", f"{MANY}</robot>"), "too many links; valid is at most 200"),
    arm("20,000 links", URDF, ("</robot>", f"{MANY * 100}</robot>"), "valid is"),
    arm("depth without end", URDF, "<a>" * 100_000, "is too large"),
    arm("entities that grow", URDF, f'<!DOCTYPE a [<!ENTITY e "{"a" * 99}">]>{urdf()}', "without <!DOCTYPE>"),
    arm("an unknown encoding", URDF, f'<?xml version="1.0" encoding="klingon"?>{urdf()}', "unknown encoding: klingon"),
    arm("an empty file", URDF, "", "is not valid XML"),
    arm("no text", URDF, bytes(range(256)), "is not valid XML"),
    arm("another format", URDF, sdf(), "begins with <sdf>; valid is <robot>"),
    arm("no reach at all", URDF, re.sub(' xyz="[^"]*"(?= |/><axis)', ' xyz="0 0 0"', urdf()), "cannot reach the pose", code=3),
    arm("a mass below 0", SDF, ("<mass>2.0", "<mass>-2"), "mass = '-2' in link 'l3'"),
    arm("a mass that is none", SDF, ("<mass>2.0", "<mass>nan"), "mass = 'nan' in link 'l3'"),
    arm("inertia below 0", SDF, ("<ixx>0.01", "<ixx>-0.01"), UNPHYSICAL, "in link 'l1'"),
    arm("a cycle", SDF, ("<parent>base", "<parent>l6"), "is no tree: the joint 'j1' carries itself"),
    arm("two parents", SDF, ("</model>", "<joint name='x' type='fixed'><parent>l1</parent><child>l4</child></joint></model>"), "is no tree: the joints 'j4' and 'x'"),
    arm("a joint without type", SDF, joint("", ""), "Required attribute[type]"),
    arm("a ball", SDF, joint("", ' type="ball"'), "joint 'j2' of type 'ball_rpy'", "valid is revolute"),
    arm("a screw", SDF, joint("", ' type="screw"'), "joint 'j2' of type 'screw'"),
    arm("a speed below 0", SDF, ("<velocity>6.0", "<velocity>-6"), "velocity = '-6' in joint 'j1'"),
    arm("a mimic in the chain", SDF, ("</limit>", "</limit><mimic joint='j2'><multiplier>1</multiplier><offset>0</offset><reference>0</reference></mimic>"), "joint 'j1' that mimics another"),
    arm("itself inside", SDF, ("</model>", "<include><uri>arm.sdf</uri></include></model>"), "includes another file"),
    arm("two models", SDF, ("<model", "<model name='o'><link name='q'/></model><model"), "can only contain one model"),
    arm("a mass below 0", MJCF, ('mass="2.0"', 'mass="-2"'), "inertial mass = '-2' in body 'l3'"),
    arm("a place that is none", MJCF, ('pos="0.2', 'pos="nan'), "body pos = 'nan 0 0.03' in body 'l4'"),
    arm("a range upside down", MJCF, ('range="-2.9', 'range="3'), "joint range = '3 2.9' in joint 'j1'"),
    arm("bodies without end", MJCF, ('<body name="finger">', "<body>" * 5000), "is too large"),
    arm("a free joint", MJCF, ('name="j2"', 'name="j2" type="free"'), "arm.file = 'arm.xml'"),
    arm("an equality", MJCF, ("<actuator>", "<equality><joint joint1='j1'/></equality><actuator>"), "'j1' that stands in an equality"),
    arm("itself inside", MJCF, ("<worldbody>", "<include file='arm.xml'/><worldbody>"), "includes another file"),
    arm("a body of no mass", MJCF, ('mass="0.1"', 'mass="0"'), "inertial mass = '0' in body 'finger'"),
    arm("another format", MJCF, urdf(), "begins with <robot>; valid is <mujoco>"),
    Case("an arm of another kind", ["plan", "--quiet", "--arm.file", "arm.stl"], 2, ("valid is .urdf, .sdf, .xml",), {"arm.stl": ""}),
]  # fmt: skip


def own(name, part, text, *says, command=("plan",), words=()):
    """A case of a tool or an object: the text of its file."""
    file = f"{part}.sdf" if "<sdf" in text else f"{part}.urdf"
    return Case(f"{part}: {name}", [*command, "--quiet", f"--{part}.file", file, *words], 2, (f"{part}.file", *says), {file: text})  # fmt: skip


BLOCK, SPATULA = block_sdf(IDEAL), spatula_urdf(IDEAL)
HEAVY = block_sdf(IDEAL.with_overrides({"object.mass": 0.2}))
BOX = "valid is a box from (-0.031, -0.0325, -0.005) to (0.031, 0.0325, 0.005) m"
NO_SHAPE = re.compile("<collision.*</collision>", re.DOTALL)
THINGS = [
    own("another mass", "object", HEAVY, "weighs 0.2 kg; valid is object.mass = 0.061 kg"),
    own("another size", "object", BLOCK.replace("0.062 0.065 0.01<", "0.062 0.075 0.01<"), "-0.0375", BOX),
    own("a size below 0", "object", BLOCK.replace("0.062 0.065 0.01<", "0.062 -0.065 0.01<"), "size = '0.062 -0.065"),
    own("no collision shape", "object", NO_SHAPE.sub("", BLOCK), "has no collision shape", BOX),
    own("an empty file", "object", "", "is not valid XML"),
    own("an arm", "object", sdf(), "has 8 bodies; valid is one"),
    own("a mass below 0", "object", BLOCK.replace("<mass>0", "<mass>-0"), "mass = '-0.061'"),
    *(
        own(f"another mass, {words[0]}", "object", HEAVY, "weighs 0.2 kg", command=words)
        for words in (("flip", "--yes"), ("place",), ("experiment", "--yes"), ("borders", "--yes"), ("frequency",))
    ),
    Case("object: another mass, diagram", ["diagram", "--object.file", "object.sdf"], 2, ("object.file = 'object.sdf' weighs 0.2 kg",), {"object.sdf": HEAVY}),
    own("another mass", "tool", SPATULA.replace('mass value="0.15"', 'mass value="0.3"'), "weighs 0.3 kg; valid is tool.mass = 0.15 kg"),
    own("another blade", "tool", SPATULA, "valid is a box from (-0.05, -0.05,", words=("--tool.blade_width", "0.1")),
    own("no collision shape", "tool", NO_SHAPE.sub("", SPATULA), "has no collision shape"),
    own("no frame", "tool", SPATULA.replace('frame name="tool"', 'frame name="tip"'), "lacks a frame"),
    own("an empty file", "tool", "", "is not valid XML"),
    own("a spring that pulls", "tool", SPATULA.replace('point_contact_stiffness value="', 'point_contact_stiffness value="-'), "point_contact_stiffness value = '-15", "above 0"),
    own("a spring without end", "tool", SPATULA.replace('point_contact_stiffness value="', 'point_contact_stiffness value="1e300'), "point_contact_stiffness value = '1e300", "none beyond 1e+09"),
    own("another format", "tool", mjcf(), "begins with <mujoco>; valid is <robot> or <sdf>"),
    Case("an object that is nowhere", ["plan", "--quiet", "--object.file", "no/such.sdf"], 2, ("object.file = 'no/such.sdf' cannot be read: No such file",)),
]  # fmt: skip


@pytest.mark.parametrize("case", [*ARMS, *THINGS], ids=str)
def test_a_model_file_that_cannot_be_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)
