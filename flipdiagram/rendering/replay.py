"""Recordings -> one `replay.html`: the architectures side by side in 3-D, slowed down, in any browser.

Drake's Meshcat brings viewer and animation; names, what happened, verdicts, keys and a pane for each architecture
are an HTML overlay of our own (replay_overlay.html), as Meshcat has no text. It needs no network:
a Content-Security-Policy in the page forbids every request to a server. `replay.html#t=0.3&cell=2` opens stopped at
0.3 s, at the third cell. A pancake bends: the overlay moves its vertices, which Meshcat's animations cannot.
"""

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, MeshcatCone, MeshcatParams, Rgba, Role
from pydrake.math import RigidTransform, RotationMatrix

from flipdiagram.arrays import Array
from flipdiagram.errors import SimulationError
from flipdiagram.figures.style import NAMES, style_of
from flipdiagram.files import write_atomically
from flipdiagram.rendering.pancake import COLOURS, add_surface, pack
from flipdiagram.rendering.scene import Scene, build_scene, extent_of_motion
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.simulation import verdict as verdicts
from flipdiagram.simulation.course import course, decided_at
from flipdiagram.simulation.pancake_surface import surface_of

SLOWDOWN = 4.0  # at first
SPEEDS = (1, 2, 4, 8, 16, 32)  # to choose from: one over the speed
FRAME_TIME = 0.016  # [s] of playing time: 62.5 frames per second; at a quarter of the speed, each 4 ms
LEAD_IN = 0.25  # [s] of the hold phase that is shown
SPACING = 0.95  # [m] between two cells, along y
METRES_PER_NEWTON = 0.1  # length of the force arrow; the block weighs 0.6 N
STILL = 1e-5  # [m, 1] a pose that has changed less since the frame before has not moved
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline';"
    " img-src data: blob:; connect-src data: blob:; font-src data:"
)


Verdicts = Mapping[str, tuple[bool, str]]


def write_replay(
    recordings: Mapping[str, xr.Dataset], scenario: Scenario, path: str | Path, verdicts: Verdicts | None = None
) -> Path:
    """Write the replay as one HTML page; returns its path.

    Args:
        recordings: by architecture.
        scenario: what was simulated.
        path: of the file.
        verdicts: (success, text) by architecture, where it is not the flip that is judged.

    Raises InputError where the file cannot be written, SimulationError where Meshcat finds no free port.
    """
    return write_atomically(path, replay_html(recordings, scenario, verdicts))


def replay_html(recordings: Mapping[str, xr.Dataset], scenario: Scenario, verdicts: Verdicts | None = None) -> str:
    """The replay as the text of one HTML page."""
    for name in recordings:
        style_of(name)
    names = [name for name in ARCHITECTURES if name in recordings]
    meshcat = _quiet_meshcat()
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    animation = MeshcatAnimation(1 / FRAME_TIME)
    animation.set_repetitions(1000)
    scene = build_scene(scenario)
    shown = {name: recordings[name].sel(time=slice(-LEAD_IN, None)) for name in names}
    frames = {name: _frames(recording) for name, recording in shown.items()}
    # the viewer repeats each clip after its own last key frame: all must end together
    last = max((len(f["time"]) for f in frames.values()), default=1) - 1
    cells = []
    for k, name in enumerate(names):
        root, offset = f"/cells/{name}", SPACING * (k - (len(names) - 1) / 2)
        meshcat.SetTransform(root, RigidTransform([0.0, offset, 0.0]))
        _add_shapes(meshcat, scene, root)
        _add_paths(meshcat, scenario, root, name, shown[name])
        _animate_bodies(meshcat, animation, scene, root, frames[name], last)
        _animate_force(meshcat, animation, root, frames[name], last)
        cells.append(_describe(name, shown[name], offset, (verdicts or {}).get(name)))
        cells[-1]["bending"] = _add_pancake(meshcat, root, frames[name])
    meshcat.SetAnimation(animation)
    return _with_overlay(meshcat.StaticHtml(), cells, extent_of_motion(shown.values(), scenario), scenario)


def _frames(recording: xr.Dataset) -> xr.Dataset:
    """The samples that are shown, FRAME_TIME of playing time apart."""
    time = recording["time"].values
    stride = max(1, round(FRAME_TIME / SLOWDOWN / float(time[1] - time[0]))) if len(time) > 1 else 1
    return recording.isel(time=slice(None, None, stride))


def _describe(name: str, recording: xr.Dataset, offset: float, verdict: tuple[bool, str] | None) -> dict[str, Any]:
    """What the overlay says of a cell at y = offset [m], and when."""
    decided = float(recording["time"][-1])
    if verdict is None:
        success, failure = verdicts.judge(recording)
        verdict, decided = (success, failure or "turned over"), decided_at(recording)
    return {
        "path": name,
        "name": recording.attrs.get("entry", NAMES[name]),
        "color": style_of(name).color,
        "course": course(recording),
        "verdict": verdict[1],
        "success": verdict[0],
        "decided_s": decided,
        "offset": offset,
        "start_s": float(recording["time"][0]),
    }


def _add_shapes(meshcat: Meshcat, scene: Scene, root: str) -> None:
    inspector = scene.scene_graph.model_inspector()
    for body in scene.bodies():
        frame = scene.plant.GetBodyFrameIdOrThrow(body.index())
        for geometry in inspector.GetGeometries(frame, Role.kIllustration):
            path = f"{root}/{body.name()}/{inspector.GetName(geometry).rpartition('::')[2]}"
            properties = inspector.GetIllustrationProperties(geometry)
            colour = properties.GetPropertyOrDefault("phong", "diffuse", Rgba(0.7, 0.7, 0.7, 1.0))
            meshcat.SetObject(path, inspector.GetShape(geometry), colour)
            meshcat.SetTransform(path, inspector.GetPoseInFrame(geometry))


def _animate_bodies(
    meshcat: Meshcat, animation: MeshcatAnimation, scene: Scene, root: str, frames: xr.Dataset, last: int
) -> None:
    context, bodies = scene.context(), scene.bodies()
    mine = scene.plant.GetMyContextFromRoot(context)
    poses: list[list[RigidTransform]] = []
    for q, block in zip(frames["q"].values, frames["block_pose"].values, strict=True):
        scene.pose(context, q, block)
        poses.append([body.EvalPoseInWorld(mine) for body in bodies])
    for column, body in enumerate(bodies):
        path = f"{root}/{body.name()}"
        motion = [row[column] for row in poses]
        meshcat.SetTransform(path, motion[0])
        matrices = np.array([X.GetAsMatrix34() for X in motion])
        for k in key_frames(matrices.reshape(len(motion), -1)):
            animation.SetTransform(k, path, motion[k])
            animation.SetTransform(last, path, motion[-1])


def key_frames(values: Array) -> list[int]:
    """Frames that the viewer needs: all but those inside a stretch of rest; none if nothing ever moves."""
    moves = np.abs(np.diff(values, axis=0)).max(axis=1) > STILL
    if not moves.any():
        return []
    needed = np.append(moves, False) | np.append(False, moves)
    needed[[0, -1]] = True
    return [int(k) for k in np.flatnonzero(needed)]


def _add_pancake(meshcat: Meshcat, root: str, frames: xr.Dataset) -> dict[str, Any] | None:
    """Show a pancake as it is at first; what the overlay needs to bend it, None where the object is rigid."""
    surface = surface_of(frames)
    if surface is None:
        return None
    surface = surface.at(frames["time"])
    add_surface(meshcat, root, surface)
    return {"start_s": float(surface.time[0]), "meshes": list(COLOURS), **pack(surface.vertices)}


def _add_paths(meshcat: Meshcat, scenario: Scenario, root: str, name: str, recording: xr.Dataset) -> None:
    """Paths of the control point, planned (black) and real (the architecture's colour), and of the block."""
    moving = recording.sel(time=slice(0.0, None))
    plane = np.full(len(moving["time"]), scenario.task.start_x)
    red, green, blue = to_rgb(style_of(name).color)
    for label, data, width, colour in (
        ("planned", moving["x_cmd"].values[:, :2], 2.0, Rgba(0.0, 0.0, 0.0, 1.0)),
        ("real", moving["x"].values[:, :2], 4.0, Rgba(red, green, blue, 1.0)),
        ("object", moving["block_pose"].values[:, 5:7], 2.0, Rgba(0.85, 0.85, 0.85, 1.0)),
    ):
        meshcat.SetLine(f"{root}/path_{label}", np.column_stack([plane, data])[::4].T, width, colour)


def _animate_force(meshcat: Meshcat, animation: MeshcatAnimation, root: str, frames: xr.Dataset, last: int) -> None:
    """An arrow at the block: the force of the blade on it [N], in world axes."""
    path, colour = f"{root}/force", Rgba(0.8, 0.47, 0.65, 1.0)
    meshcat.SetObject(f"{path}/shaft/rod", Cylinder(0.003, 1.0), colour)
    meshcat.SetTransform(f"{path}/shaft/rod", RigidTransform([0.0, 0.0, 0.5]))
    meshcat.SetObject(f"{path}/head/cone", MeshcatCone(0.02, 0.008, 0.008), colour)
    meshcat.SetTransform(f"{path}/head/cone", RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, 0.02]))
    force = frames["contact_force"].sel(pair="blade-block").values
    points = frames["block_pose"].values[:, 4:]
    length = np.clip(np.linalg.norm(force, axis=1) * METRES_PER_NEWTON, 0.0, 0.4)
    shown = length > 0.005
    meshcat.SetProperty(path, "visible", bool(shown[0]))
    changes = np.flatnonzero(np.append(True, shown[1:] != shown[:-1]))
    for frame, k in [*((int(k), k) for k in changes), (last, -1)]:
        animation.SetProperty(frame, path, "visible", bool(shown[k]))
    visible = np.flatnonzero(shown)
    for frame, k in [*((int(k), k) for k in visible), *((last, k) for k in visible[-1:])]:
        animation.SetTransform(frame, path, RigidTransform(_turn_z_to(force[k]), points[k]))
        animation.SetProperty(frame, f"{path}/shaft", "scale", [1.0, 1.0, float(length[k])])
        animation.SetProperty(frame, f"{path}/head", "position", [0.0, 0.0, float(length[k])])


def _with_overlay(html: str, cells: list[dict[str, Any]], extent: tuple[Array, Array], scenario: Scenario) -> str:
    low, high = extent
    data = {
        "slowdown": SLOWDOWN,
        "speeds": SPEEDS,
        "step_s": FRAME_TIME / SLOWDOWN,
        "cells": cells,
        "middle": [scenario.task.start_x, *((low + high) / 2)],
        "width": float(high[0] - low[0]),
        "height": float(high[1] - low[1]),
        "scale": METRES_PER_NEWTON,
        "object": scenario.object.kind,
    }
    overlay = (Path(__file__).parent / "replay_overlay.html").read_text(encoding="utf-8")
    # "<" cannot end the script element then, whatever a name holds
    overlay = overlay.replace("/*DATA*/null", json.dumps(data, ensure_ascii=False).replace("<", "\\u003c"))
    policy = f'<head>\n  <meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    html = html.replace("<head>", policy, 1).replace(
        "<title>Drake MeshCat</title>", "<title>flipdiagram replay</title>"
    )
    head, end, tail = html.rpartition("</body>")
    return head + overlay + end + tail


def _turn_z_to(direction: Array) -> RotationMatrix:
    """The smallest turn that takes z to the direction; it changes steadily with it."""
    unit = direction / np.linalg.norm(direction)
    axis = np.array([-unit[1], unit[0], 0.0])
    sine = float(np.linalg.norm(axis))
    return RotationMatrix(AngleAxis(np.arctan2(sine, unit[2]), axis / sine if sine > 1e-9 else [1.0, 0.0, 0.0]))


def _quiet_meshcat() -> Meshcat:
    """A Meshcat that does not announce its address: nobody shall go there, it only writes a file."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.WARNING)
    try:
        return Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    except RuntimeError as error:
        raise SimulationError(f"Meshcat, which writes the replay, does not start: {error}") from None
    finally:
        log.setLevel(level)
