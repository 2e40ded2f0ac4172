"""Model files with faults drawn at random: each is read, or refused in one line, and soon."""

import xml.etree.ElementTree as ElementTree

import pytest
from elbow import FORMATS, HOME, LIMITS
from hostile.table import patience
from hypothesis import given, settings
from hypothesis import strategies as st
from ideal import IDEAL
from patience import loaded
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.errors import InputError
from flipdiagram.robot.model_files import block_sdf, model_path, spatula_urdf
from flipdiagram.robot.parts import add_parts, arm_of

SECONDS = 10
"""For one file on a free machine."""
ELBOW = {"arm.flange": "tcp", "arm.home": HOME} | {f"arm.{field}": value for field, value in LIMITS.items()}
MODELS = {
    **{f"elbow's {name}": (name, make(), "arm.file", ELBOW) for name, make in FORMATS.items()},
    "mh3f.urdf": ("arm.urdf", model_path("mh3f.urdf").read_text(encoding="utf-8"), "arm.file", {}),
    "tool": ("tool.urdf", spatula_urdf(IDEAL), "tool.file", {}),
    "object": ("object.sdf", block_sdf(IDEAL), "object.file", {}),
}
TEXTS = st.sampled_from(
    [
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
    ]
    + ["world", "fixed", "floating", "planar", "continuous", "prismatic", "ball", "ü \u202e", "x" * 300, "../a", "{}"]
)
FAULTS = st.tuples(
    st.sampled_from(["remove", "twice", "elsewhere", "rename", "attribute", "unset", "text"]),
    st.integers(0, 10**6),
    st.integers(0, 10**6),
    TEXTS,
)


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


def read(folder, name, text, field, fields):
    """Make controller's arm and cell of a file with this text."""
    (folder / name).write_text(text, encoding="utf-8")
    scenario = IDEAL.with_overrides(fields | {field: str(folder / name)})
    arm = arm_of(scenario)
    arm.task_jacobian(arm.home)
    arm.mass_matrix(arm.home)
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    add_parts(plant, scenario)
    plant.Finalize()


@pytest.mark.parametrize("model", MODELS)
def test_a_model_with_faults_is_read_or_refused(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    name, text, field, fields = MODELS[model]

    @settings(max_examples=17, deadline=None)
    @given(st.lists(FAULTS, min_size=1, max_size=3))
    def check(faults):
        with patience(loaded(SECONDS)):
            try:
                read(folder, name, spoiled(text, faults), field, fields)
            except InputError as error:
                assert "\n" not in str(error)

    check()
