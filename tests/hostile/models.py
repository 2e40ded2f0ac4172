"""Model files of an arm, a tool and an object, and faults that can be put into them."""

import xml.etree.ElementTree as ElementTree

from elbow import FORMATS, HOME, LIMITS
from ideal import IDEAL

from flipdiagram.robot.model_files import block_sdf, model_path, spatula_urdf

ELBOW = {"arm.flange": "tcp", "arm.home": HOME} | {f"arm.{field}": value for field, value in LIMITS.items()}
MODELS = {
    **{f"elbow's {name}": (name, make(), "arm.file", ELBOW) for name, make in FORMATS.items()},
    "mh3f.urdf": ("arm.urdf", model_path("mh3f.urdf").read_text(encoding="utf-8"), "arm.file", {}),
    "tool": ("tool.urdf", spatula_urdf(IDEAL), "tool.file", {}),
    "object": ("object.sdf", block_sdf(IDEAL), "object.file", {}),
}
TEXTS = (
    *(
        "",
        "0",
        "-1",
        "1",
        "nan",
        "inf",
        "-inf",
        "1e300",
        "1e-300",
        "0 0 0",
        "1 2",
        "true",
        "base",
        "l1",
        "l6",
        "S",
        "tcp",
    ),
    *("world", "fixed", "floating", "planar", "continuous", "prismatic", "ball", "ü \u202e", "x" * 300, "../a", "{}"),
)
FAULTS = ("remove", "twice", "elsewhere", "rename", "attribute", "unset", "text")


def spoil(root, fault):
    """Change a tree in place: what, at which element, with which other one or attribute, and a text."""
    what, at, other, text = fault
    parents = [(parent, child) for parent in root.iter() for child in parent]
    if not parents:
        return
    parent, child = parents[at % len(parents)]
    names = sorted(child.attrib) or ["name"]
    if what == "remove":
        parent.remove(child)
    elif what == "twice":
        parent.append(ElementTree.fromstring(ElementTree.tostring(child)))
    elif what == "elsewhere":
        parent.remove(child)
        list(root.iter())[other % len(list(root.iter()))].append(child)
    elif what == "rename":
        child.tag = parents[other % len(parents)][1].tag
    elif what == "attribute":
        child.set(names[other % len(names)], text)
    elif what == "unset":
        child.attrib.pop(names[other % len(names)], None)
    else:
        child.text = text


def spoiled(text, faults):
    """The text of a model with all the faults."""
    root = ElementTree.fromstring(text)
    for fault in faults:
        spoil(root, fault)
    return ElementTree.tostring(root, encoding="unicode")
