"""Arms of the user's own, from URDF, SDF or MJCF: what a file must have, and how its text is made ready for Drake.

Only the joints between base and flange move; others (the fingers of a gripper) are fixed where they stand.  Collision
shapes of the arm are left out: what touches in this task is blade, block and table.  Meshes that Drake cannot draw are
replaced by cylinders from joint to joint.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram.robot.arm_spec import file_error
from flipdiagram.robot.model_xml import JOINT_TYPES, check_tree
from flipdiagram.scenario.cell import Arm

DRAWABLE = (".obj", ".gltf", ".vtk")
"""Kinds of mesh that Drake draws."""
STAND_IN_RADIUS = 0.04


@dataclass(frozen=True)
class JointNumbers:
    """What an arm's file says of its joints, by name."""

    rated_torque: dict[str, float]  # [N m] attribute `rated_effort`, or `effort` where it is missing; else infinite
    peak_torque: dict[str, float]  # [N m] attribute `effort`; 0 where it is missing
    home: dict[str, float] | None  # [rad] attribute `home`, the middle of the range where one is missing; None: all are
    gear_stiffness: dict[str, float] | None = (
        None  # [N m/rad] attribute `gear_stiffness`; None unless each joint has it
    )


def prepare_urdf(root: ElementTree.Element, arm: Arm, folder: Path) -> None:
    """Change a URDF's tree, from a file in a folder, in place as the module says.

    InputError without base, flange or a chain between them.
    """
    joints = {joint.attrib["name"]: joint for joint in root.iterfind("joint")}
    ends = {name: (_link(joint, "parent"), _link(joint, "child")) for name, joint in joints.items()}
    links = {link.attrib["name"]: link for link in root.iterfind("link")}
    frames = {frame.attrib["name"]: frame.attrib.get("link", "") for frame in root.iterfind("frame")}
    for name in (arm.base, arm.flange):
        if name not in links and name not in frames:
            raise file_error(arm, f"has no link or frame '{name}'", [*links, *frames])
    base, flange = (frames.get(name, name) for name in (arm.base, arm.flange))
    moving = tuple(name for name in chain_between(arm, ends, base, flange) if joints[name].attrib["type"] != "fixed")
    for name in moving:
        if (kind := joints[name].attrib["type"]) not in JOINT_TYPES:
            raise file_error(arm, f"has a joint '{name}' of type '{kind}' in its chain", ", ".join(JOINT_TYPES))
    check_uncoupled(arm, root, moving)
    _keep_what_stands_on(root, base, ends)
    for joint in root.iterfind("joint"):
        _fix_unless(joint, moving)
    for transmission in list(root.iterfind("transmission")):
        driven = transmission.find("joint")
        if driven is None or driven.attrib.get("name") not in moving:
            root.remove(transmission)
    for link in root.iterfind("link"):
        _show_simply(
            link, [joints[name] for name, (parent, _) in ends.items() if parent == link.attrib["name"]], folder
        )


def chain_between(arm: Arm, ends: Mapping[str, tuple[Any, Any]], base: Any, flange: Any) -> list[str]:
    """Names of the joints between an arm's flange and base; ends: parent and child link of every joint, by its name.

    InputError unless the joints make a tree in which the base carries the flange.
    """
    check_tree("arm.file", arm.file, ends)
    by_child = {child: (name, parent) for name, (parent, child) in ends.items()}
    joints = []
    while flange != base:
        if flange not in by_child:
            raise file_error(arm, f"is no chain: '{arm.flange}' is not carried by '{arm.base}'", "one that is")
        joint, flange = by_child[flange]
        joints.append(joint)
    return joints


def check_uncoupled(arm: Arm, root: ElementTree.Element, chain: Iterable[str]) -> None:
    """InputError where a joint of the chain, by name, moves with another: `mimic` of URDF and SDF, equality of MJCF."""
    mimics = [joint for joint in root.iter("joint") if joint.find(".//mimic") is not None]
    coupled = {joint.get("name"): "mimics another" for joint in mimics}
    for equality in root.iterfind("equality/joint"):
        coupled |= {equality.get(end): "stands in an equality" for end in ("joint1", "joint2")}
    for name in chain:
        if name in coupled:
            raise file_error(arm, f"has a joint '{name}' that {coupled[name]}", "a drive for every joint of the chain")


def _keep_what_stands_on(root: ElementTree.Element, base: str, ends: Mapping[str, tuple[str, str]]) -> None:
    """Remove what the base does not carry, such as the world, as the scenario says where the base stands; and what is
    Drake's own: joints of other kinds, constraints, springs.
    """
    kept, before = {base}, 0
    while len(kept) > before:
        before = len(kept)
        kept |= {child for parent, child in ends.values() if parent in kept}
    for element in list(root):
        name = element.get("name", "")
        places = {"link": name, "joint": ends.get(name, ("",))[0], "frame": element.get("link")}
        if places.get(element.tag, base) not in kept or element.tag.startswith("{"):
            root.remove(element)


def joint_numbers(urdf: str, names: Iterable[str]) -> JointNumbers:
    """The torques and home angles that the text of a URDF gives joints of these names."""
    elements = {joint.attrib["name"]: joint for joint in ElementTree.fromstring(urdf).iterfind("joint")}
    limits = {name: {k: v for limit in elements[name].iterfind("limit") for k, v in limit.items()} for name in names}
    middle = {name: (float(limit.get("lower", 0)) + float(limit.get("upper", 0))) / 2 for name, limit in limits.items()}
    return JointNumbers(
        {name: float(limit.get("rated_effort", limit.get("effort", "inf"))) for name, limit in limits.items()},
        {name: float(limit.get("effort", 0)) for name, limit in limits.items()},
        {name: float(limit.get("home", middle[name])) for name, limit in limits.items()}
        if any("home" in limit for limit in limits.values())
        else None,
        {name: float(limit["gear_stiffness"]) for name, limit in limits.items()}
        if all("gear_stiffness" in limit for limit in limits.values())
        else None,
    )


def _link(joint: ElementTree.Element, kind: str) -> str:
    element = joint.find(kind)
    return "" if element is None else element.attrib.get("link", "")


def _fix_unless(joint: ElementTree.Element, moving: tuple[str, ...]) -> None:
    unknown_to_drake = ("safety_controller", "calibration")
    moves = joint.attrib["name"] in moving
    if not moves:
        joint.set("type", "fixed")
    for kind in unknown_to_drake if moves else ("limit", "mimic", "dynamics", "axis", *unknown_to_drake):
        for element in joint.findall(kind):
            joint.remove(element)


def _show_simply(link: ElementTree.Element, joints: list[ElementTree.Element], folder: Path) -> None:
    """No collision shapes, no meshes that Drake cannot draw; a cylinder to each joint where nothing is left."""
    for collision in link.findall("collision"):
        link.remove(collision)
    for visual in link.findall("visual"):
        if (mesh := visual.find("geometry/mesh")) is None:
            continue
        if file := _mesh_file(mesh.attrib["filename"], folder):
            mesh.set("filename", str(file))
        else:
            link.remove(visual)
    for joint in joints if link.find("visual") is None else ():
        origin = joint.find("origin")
        place = "0 0 0" if origin is None else origin.attrib.get("xyz", "0 0 0")
        _add_cylinder(link, joint.attrib["name"], np.array([float(value) for value in place.split()]))


def _mesh_file(name: str, folder: Path) -> Path | None:
    """The file of a mesh that Drake can draw; packages are looked for in the folders above the arm's file."""
    if not name.lower().endswith(DRAWABLE):
        return None
    inside = name.removeprefix("package://")
    places = [folder / inside]
    if inside != name:
        _, _, rest = inside.partition("/")
        places = [above / part for above in folder.resolve().parents for part in (inside, rest)]
    return next((place.resolve() for place in places if place.is_file()), None)


def _add_cylinder(link: ElementTree.Element, name: str, end: np.ndarray) -> None:
    """A cylinder from the link's origin to `end` (3,) [m], unless it were shorter than thick."""
    length = float(np.linalg.norm(end))
    if length <= STAND_IN_RADIUS:
        return
    x, y, z = end / length
    visual = ElementTree.SubElement(link, "visual", name=f"to_{name}")
    roll_pitch = f"0 {float(np.arctan2(np.hypot(x, y), z))!r} {float(np.arctan2(y, x))!r}"
    ElementTree.SubElement(visual, "origin", xyz=" ".join(repr(float(v)) for v in end / 2), rpy=roll_pitch)
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(geometry, "cylinder", radius=repr(STAND_IN_RADIUS), length=repr(length))
    material = ElementTree.SubElement(visual, "material", name="flipdiagram_grey")
    ElementTree.SubElement(material, "color", rgba="0.6 0.64 0.7 1")
