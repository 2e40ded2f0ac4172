"""The cell as a line drawing, seen by the same camera as a rendering: what `snapshots.py` falls back on."""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from pydrake.math import RigidTransform
from scipy.spatial import ConvexHull

from flipdiagram.arrays import Array
from flipdiagram.rendering.pancake import COLOURS
from flipdiagram.rendering.scene import TOP_COLOUR, build_scene, transform
from flipdiagram.robot.model_files import table_size
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.pancake_surface import Surface

Projection = Callable[[Array], Array]
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
BACKGROUND, TABLE, ARM, BLADE, RUBBER = "#d6e0eb", "#a9a08c", "#5b6b7d", "#39424e", "#de5c38"


def draw_cell(
    scenario: Scenario,
    project: Projection,
    size: int,
    q: Array,
    tool: Array,
    block: Array,
    surface: Surface | None = None,
) -> Array:
    """Pictures (n, size, size, 3) of uint8 of n instants.

    Args:
        scenario: what was simulated.
        project: takes points (..., 3) of the world to pixels (..., 2): column, row.
        size: pixels a side.
        q: joint angles (n, 6) [rad].
        tool: poses (n, 7).
        block: poses (n, 7).
        surface: of a pancake, at these n instants.
    """
    scene = build_scene(scenario)
    context = scene.context()
    mine = scene.plant.GetMyContextFromRoot(context)
    links = [scene.plant.get_body(i).body_frame() for i in scene.plant.GetBodyIndices(scene.parts.arm.arm)]
    pictures = []
    for k, (q_k, tool_k, block_k) in enumerate(zip(q, tool, block, strict=True)):
        scene.pose(context, q_k, block_k)
        joints = [frame.CalcPoseInWorld(mine).translation() for frame in [*links, scene.parts.arm.tool]]
        thing = transform(block_k) if surface is None else surface.some(np.array([k]))
        pictures.append(_draw(scenario, project, size, np.array(joints), transform(tool_k), thing))
    return np.stack(pictures)


def _draw(
    scenario: Scenario,
    project: Projection,
    pixels: int,
    joints: Array,
    X_WT: RigidTransform,
    thing: RigidTransform | Surface,
) -> Array:
    """One picture; thing: the block by its pose in the world, or the surface of a pancake at this instant."""
    dpi = 100
    figure = Figure(figsize=(pixels / dpi, pixels / dpi), dpi=dpi, facecolor=BACKGROUND)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0, 0, 1, 1), xlim=(-0.5, pixels - 0.5), ylim=(pixels - 0.5, -0.5))
    ax.set_axis_off()
    tool, task = scenario.tool, scenario.task
    top = RigidTransform([task.start_x, task.target_y, scenario.table.height])
    arm = project(joints)
    ax.plot(*arm.T, color=ARM, linewidth=pixels / 24, solid_capstyle="round", solid_joinstyle="round")
    ax.plot(*arm.T, "o", color="white", markersize=pixels / 60)
    plate = table_size()
    _box(ax, project, top, plate, (0.0, 0.0, -plate[2] / 2), TABLE)
    _box(ax, project, X_WT, tool.blade_size, (0.0, 0.0, -tool.blade_thickness / 2), BLADE)
    if isinstance(thing, Surface):
        _skin(ax, project, thing)
    else:
        _layers(ax, project, thing, scenario)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:, :, :3]


def _layers(ax: Axes, project: Projection, X_WB: RigidTransform, scenario: Scenario) -> None:
    """The block's two halves."""
    size = np.array(scenario.object.size) * [1.0, 1.0, 0.5]
    layers = [(-size[2] / 2, RUBBER), (size[2] / 2, tuple(TOP_COLOUR))]
    if (X_WB.rotation().matrix()[2, 2]) < 0:  # seen from above: what lies higher is painted last
        layers.reverse()
    for height, colour in layers:
        _box(ax, project, X_WB, size, (0.0, 0.0, height), colour)


def _skin(ax: Axes, project: Projection, surface: Surface) -> None:
    """The triangles of a pancake that face the camera, which looks along -x: the nearest are painted last."""
    points, faces = surface.vertices[0], {name: getattr(surface, name) for name in COLOURS}
    triangles = np.concatenate(list(faces.values()))
    colours = np.repeat([COLOURS[name][:3] for name in faces], [len(face) for face in faces.values()], axis=0)
    corners, seen = points[triangles], project(points)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upwards = normals[:, 2] / np.linalg.norm(normals, axis=1)
    colours = colours * (0.8 + 0.2 * upwards[:, None])
    (right, down), (right_2, down_2) = ((seen[:, k] - seen[:, 0]).T for k in (1, 2))
    facing = right * down_2 - down * right_2 < 0  # rows of pixels count downwards
    for k in np.argsort(corners[:, :, 0].sum(axis=1)):
        if facing[k]:
            ax.add_patch(Polygon(seen[k], facecolor=colours[k], edgecolor=colours[k], linewidth=0.6, zorder=3))


def _box(ax: Axes, project: Projection, X: RigidTransform, size: Any, centre: Any, colour: Any) -> None:
    corners = CORNERS * np.asarray(size) + np.asarray(centre)
    seen = project(corners @ X.rotation().matrix().T + X.translation())
    outline = seen[ConvexHull(seen).vertices]
    ax.add_patch(Polygon(outline, closed=True, facecolor=colour, edgecolor="black", linewidth=0.6, zorder=3))
