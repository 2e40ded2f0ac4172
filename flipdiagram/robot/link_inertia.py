"""Other masses and inertias for the links of an SDF or MJCF file, whose bodies Drake does not let one change later."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

from pydrake.multibody.tree import SpatialInertia

from flipdiagram.robot.arm_spec import file_error
from flipdiagram.robot.model_xml import MOMENTS, Model
from flipdiagram.scenario.cell import Arm

CARRIER = {"sdf": "link", "mjcf": "body"}
"""The element that an inertia belongs to."""


def with_inertias(arm: Arm, model: Model, inertias: Mapping[str, SpatialInertia]) -> str:
    """The text of an arm's file in which the bodies named have these inertias, about and in their own frames.

    Files that it names relative to itself are named from the root.  InputError where a body has no name in the file.
    """
    root, folder = ElementTree.fromstring(model.text), Path(str(arm.file)).resolve().parent
    elements = {element.get("name"): element for element in root.iter(CARRIER[model.kind])}
    for name, inertia in inertias.items():
        if name not in elements:
            raise file_error(arm, f"has no name for the link that Drake calls '{name}'", "a name for each to be scaled")
        element = elements[name]
        for old in element.findall("inertial"):
            element.remove(old)
        element.append(_element(model.kind, inertia))
    if model.kind == "sdf":
        for uri in root.iter("uri"):
            if "://" not in (uri.text or ""):
                uri.text = str(folder / (uri.text or "").strip())
    else:
        _name_folders(root, folder)
    return ElementTree.tostring(root, encoding="unicode")


def _element(kind: str, inertia: SpatialInertia) -> ElementTree.Element:
    """The element `inertial`: the centre of mass, and the inertia about it."""
    centre = inertia.get_com()
    moment = inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()
    values = {name: repr(float(moment["xyz".index(name[1]), "xyz".index(name[2])])) for name in MOMENTS}
    mass, place = repr(float(inertia.get_mass())), " ".join(repr(float(value)) for value in centre)
    if kind == "mjcf":
        return ElementTree.Element("inertial", pos=place, mass=mass, fullinertia=" ".join(values.values()))
    element = ElementTree.Element("inertial")
    ElementTree.SubElement(element, "pose").text = f"{place} 0 0 0"
    ElementTree.SubElement(element, "mass").text = mass
    moments = ElementTree.SubElement(element, "inertia")
    for name, text in values.items():
        ElementTree.SubElement(moments, name).text = text
    return element


def _name_folders(root: ElementTree.Element, folder: Path) -> None:
    """Of a MJCF: folders of meshes from the root, and no inertias from shapes, as all are given."""
    compilers = root.findall("compiler") or [ElementTree.SubElement(root, "compiler")]
    for compiler in compilers:
        compiler.attrib.pop("inertiafromgeom", None)
        for kind in {"meshdir", "texturedir", "assetdir"} & {"meshdir", *compiler.attrib}:
            inside = compiler.get(kind, "." if "assetdir" not in compiler.attrib else compiler.attrib["assetdir"])
            compiler.set(kind, str(folder / inside))
