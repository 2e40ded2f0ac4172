"""The cell as a picture: arm, spatula, block and table, posed from a recording; no physics.

The upper half of the block is pale, its lower half keeps the colour of block.sdf, so that a turned block can
be told from one that was not turned. A pancake bends: `pancake.py` shows its surface, and of the rigid body of its
mass nothing is seen here. Frames as in a recording: world = base of the robot; poses are (qw, qx, qy, qz, x, y, z)
[1, m].
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from flipdiagram.arrays import Array
from flipdiagram.robot.parts import Parts, add_parts
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.pancake_surface import surface_of

if TYPE_CHECKING:  # the child that renders needs none of it
    import xarray as xr

TOP_COLOUR = np.array([1.0, 0.87, 0.55, 1.0])
ROOM = 0.02
"""Free distance [m] around what moves, in a picture that shows no more than that."""


@dataclass(frozen=True)
class Scene:
    """The diagram and its parts; make contexts of it with `context()`."""

    diagram: Diagram
    plant: MultibodyPlant
    scene_graph: SceneGraph
    parts: Parts
    bends: bool = False
    """Whether the object is a pancake."""

    def bodies(self) -> list[RigidBody]:
        """What is rigid, is seen and may move: the links of the arm, spatula, block and table."""
        links = [self.plant.get_body(i) for i in self.plant.GetBodyIndices(self.parts.arm.arm)]
        block = [] if self.bends else [self.parts.block]
        return [*links, self.parts.arm.spatula_body, *block, self.parts.table]

    def context(self) -> Context:
        """A new context of the whole diagram."""
        return self.diagram.CreateDefaultContext()

    def pose(self, context: Context, q: ArrayLike, block_pose: ArrayLike) -> None:
        """Put the arm at joint angles q (6,) [rad] and the block at block_pose (7,) in the world."""
        mine = self.plant.GetMyMutableContextFromRoot(context)
        self.plant.SetPositions(mine, self.parts.arm.arm, np.asarray(q, dtype=float))
        self.plant.SetFreeBodyPose(mine, self.parts.block, transform(block_pose))


def transform(pose: ArrayLike) -> RigidTransform:
    """RigidTransform of a recorded pose (7,) = (qw, qx, qy, qz, x, y, z); the quaternion is normalised."""
    values = np.asarray(pose, dtype=float)
    return RigidTransform(Quaternion(values[:4] / np.linalg.norm(values[:4])), values[4:])


def extent_of_motion(recordings: Iterable[xr.Dataset], scenario: Scenario) -> tuple[Array, Array]:
    """Opposite corners (y, z) [m] of the rectangle through which block and blade move, the table's edge included.

    Of a pancake its vertices count, from the first sample of its recording on.
    """
    edge = max(scenario.object.length, scenario.tool.blade_width) / 2 + ROOM
    corners = []
    for data in recordings:
        places = np.vstack([data[name].values[:, 5:] for name in ("tool_pose", "block_pose")])
        corners += [places.min(axis=0) - edge, places.max(axis=0) + edge]
        if (surface := surface_of(data)) is not None:
            skin = surface.vertices[surface.time >= float(data["time"][0]) - 1e-9, :, 1:].reshape(-1, 2)
            corners += [skin.min(axis=0) - ROOM, skin.max(axis=0) + ROOM]
    # a block that fell off the table is not worth a tiny picture
    low = np.maximum(np.min(corners, axis=0), [-np.inf, scenario.table.height - 0.03])
    return low, np.max(corners, axis=0)


def build_scene(scenario: Scenario) -> Scene:
    """The cell of a scenario only to look at; raises InputError for sizes that are not valid."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    parts = add_parts(plant, scenario)
    bends, size = scenario.object.kind == "pancake", scenario.object.size
    if bends:
        for shape in plant.GetVisualGeometriesForBody(parts.block):
            for role in (Role.kIllustration, Role.kPerception):
                scene_graph.RemoveRole(plant.get_source_id(), shape, role)
    else:
        # 0.2 mm larger than the block, or both surfaces would flicker
        upper = Box(size[0] + 2e-4, size[1] + 2e-4, size[2] / 2)
        above = RigidTransform([0.0, 0.0, size[2] / 4 + 1e-4])
        plant.RegisterVisualGeometry(parts.block, above, upper, "upper_half", TOP_COLOUR)
    plant.Finalize()
    return Scene(builder.Build(), plant, scene_graph, parts, bends)
