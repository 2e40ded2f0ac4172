"""Tool and object, ours or the user's own: a file must say what the scenario says, as the planner goes by that."""

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph, SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from flipdiagram.arrays import Floats
from flipdiagram.robot.assembly import add_body, add_tool
from flipdiagram.robot.model_files import block_sdf, spatula_urdf
from flipdiagram.robot.model_xml import model_error, read_model
from flipdiagram.scenario.scenario import Scenario

MASS_TOLERANCE = 0.01
"""Relative difference allowed between the mass of a file and the scenario's."""
SIZE_TOLERANCE = 5e-4
"""Distance [m] allowed between a face of the object's or the blade's box and where the scenario has it."""


def add_object(plant: MultibodyPlant, scenario: Scenario) -> RigidBody:
    """The block, or the object of the user's own file."""
    if file := scenario.object.file:
        return add_body(plant, f"object.file = '{file}'", lambda parser: parser.AddModels(file))
    return add_body(plant, "the block", lambda parser: parser.AddModelsFromString(block_sdf(scenario), "sdf"))


def check_object(scenario: Scenario) -> None:
    """InputError unless the object's own file, where there is one, has the scenario's mass and size."""
    if file := scenario.object.file:
        read_model("object.file", file, ("urdf", "sdf"))
        plant, inspector = _touching_plant()
        body = add_object(plant, scenario)
        _check_mass("object", file, body, scenario.object.mass)
        boxes = [_box(inspector, plant.GetCollisionGeometriesForBody(body), RigidTransform())]
        _check_box("object", file, boxes, np.array(scenario.object.size), np.zeros(3), "width, length and thickness")


def tool_text(scenario: Scenario) -> str:
    """The URDF or SDF of the spatula, or of the user's own tool with the scenario's mass and blade; else InputError."""
    tool = scenario.tool
    if tool.file is None:
        return spatula_urdf(scenario)
    text = read_model("tool.file", tool.file, ("urdf", "sdf")).text
    plant, inspector = _touching_plant()
    body, frame = add_tool(plant, text, f"tool.file = '{tool.file}'")
    _check_mass("tool", tool.file, body, tool.mass)
    X_TB = frame.GetFixedPoseInBodyFrame().inverse()
    shapes = plant.GetCollisionGeometriesForBody(body)
    boxes = [_box(inspector, some, X_TB) for some in (shapes, *([shape] for shape in shapes))]  # a handle may touch too
    size, centre = np.array(tool.blade_size), np.array([0.0, 0.0, -tool.blade_thickness / 2])
    _check_box("tool", tool.file, boxes, size, centre, "blade_length, blade_width and blade_thickness")
    return text


def _touching_plant() -> tuple[MultibodyPlant, SceneGraphInspector]:
    """An empty plant, and whom to ask for the collision shapes of what is added to it."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph.model_inspector()


def _check_mass(section: str, file: str, body: RigidBody, planned: float) -> None:
    mass = body.default_mass()
    if not abs(mass - planned) <= MASS_TOLERANCE * planned:
        raise model_error(f"{section}.file", file, f"weighs {mass:g} kg", f"{section}.mass = {planned:g} kg")


def _check_box(section: str, file: str, boxes: list[Floats], size: Floats, centre: Floats, fields: str) -> None:
    """One of the boxes must be of this size about this centre."""
    wanted = np.array([centre - size / 2, centre + size / 2])
    if not min(np.abs(box - wanted).max() for box in boxes) <= SIZE_TOLERANCE:
        touches = f"touches {_span(boxes[0])}" if np.all(boxes[0][1] > boxes[0][0]) else "has no collision shape"
        raise model_error(f"{section}.file", file, touches, f"a box {_span(wanted)}, by {section}'s {fields}")


def _span(box: Floats) -> str:
    low, high = (", ".join(f"{edge:.4g}" for edge in corner) for corner in box)
    return f"from ({low}) to ({high}) m"


def _box(inspector: SceneGraphInspector, shapes: list[GeometryId], X_FB: RigidTransform) -> Floats:
    """Lowest and highest corner (2, 3) [m] in the frame F of collision shapes of a body; reversed without a shape."""
    corners = np.array([np.full(3, np.inf), np.full(3, -np.inf)])
    for shape in shapes:
        box = inspector.GetObbInGeometryFrame(shape)
        if box is None:  # without end
            return np.array([np.full(3, -np.inf), np.full(3, np.inf)])
        X = X_FB @ inspector.GetPoseInFrame(shape) @ box.pose()
        half = np.abs(X.rotation().matrix()) @ box.half_width()
        corners = np.array(
            [np.minimum(corners[0], X.translation() - half), np.maximum(corners[1], X.translation() + half)]
        )
    return corners
