"""Snapshots of a recorded motion (Fig. 12): real renderings of the cell, without a display or a GPU.

VTK takes its OpenGL from the system (libEGL with Mesa) and ends the process where a part of it is missing. So
it runs in a child process; if that fails, the same instants are drawn as line figures, and the result says
why.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from pydrake.systems.sensors import CameraInfo

from flipdiagram.arrays import Array
from flipdiagram.flips.child_process import die_with
from flipdiagram.rendering.pancake import show_surface
from flipdiagram.rendering.scene import Scene, build_scene
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.pancake_surface import Surface, surface_of

if TYPE_CHECKING:  # the child needs none of it
    import xarray as xr

RENDERER = "vtk"
BACKGROUND = (0.84, 0.88, 0.92)
LIGHT_FROM = np.array([1.1, -0.5, 2.0])  # [m]
LIGHT_ON = np.array([0.4, 0.0, 0.3])  # [m]
SKY = np.array([1.0, 0.5, 1.8])  # [m]
OVERSAMPLING = 2  # pictures are rendered this much larger and averaged down: smooth edges
SHADOW_DETAIL = 2048 / 480  # side of the shadow map over that of the picture
TIME_LIMIT, TIME_EACH = 60.0, 4.0  # [s] for the child, and more for each picture; idle it needs one, and a tenth
ADVICE = "apt install libegl1 libegl-mesa0 libgl1-mesa-dri (Debian, Ubuntu) gives real renderings"


@dataclass(frozen=True)
class Camera:
    """A pinhole camera at X_WC (x right, y down, z ahead); its square picture has `size` pixels a side."""

    X_WC: RigidTransform
    size: int
    fov_y: float
    """Vertical field of view [rad]."""

    @classmethod
    def in_front(cls, y: tuple[float, float], z: tuple[float, float], x: float, size: int) -> Camera:
        """Looks along -x, 10 deg down, at the rectangle y by z [m] in the plane x [m]; +y is right."""
        middle = np.array([x, np.mean(y), np.mean(z)])
        distance, tilt = 1.6, np.deg2rad(10.0)
        eye = middle + distance * np.array([np.cos(tilt), 0.0, np.sin(tilt)])
        forward = (middle - eye) / distance
        right = np.array([0.0, 1.0, 0.0])
        R = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
        half = max(y[1] - y[0], z[1] - z[0]) / 2
        return cls(RigidTransform(R, eye), size, float(2 * np.arctan(half / distance)))

    @property
    def core(self) -> RenderCameraCore:
        """The same camera as Drake's, with OVERSAMPLING times the pixels."""
        pixels = OVERSAMPLING * self.size
        info = CameraInfo(pixels, pixels, self.fov_y)
        return RenderCameraCore(RENDERER, info, ClippingRange(0.1, 10.0), RigidTransform())

    def project(self, p_W: ArrayLike) -> Array:
        """Pixel (column, row) of points p_W (..., 3) [m] in the world."""
        p_C = (np.asarray(p_W) - self.X_WC.translation()) @ self.X_WC.rotation().matrix()
        info = self.core.intrinsics()
        scale = [info.focal_x(), info.focal_y()]
        pixels = p_C[..., :2] / p_C[..., 2:] * scale + [info.center_x() + 0.5, info.center_y() + 0.5]
        return np.asarray(pixels / OVERSAMPLING - 0.5)


@dataclass(frozen=True)
class Snapshots:
    """Pictures (n, size, size, 3) of uint8 at times (n,) [s]; note: None, or why they are only drawn."""

    times: Array
    images: Array
    note: str | None = None


def snapshot_times(recording: xr.Dataset, count: int = 8) -> Array:
    """`count` times [s]: evenly from the start of the motion to the planned touch-down, and the end."""
    touchdown = float(recording.attrs["touchdown_time_s"])
    return np.append(np.linspace(0.0, touchdown, count - 1), float(recording["time"][-1]))


def take_snapshots(
    recording: xr.Dataset,
    scenario: Scenario,
    times: Sequence[float] | Array | None = None,
    size: int = 480,
    python: Sequence[str] = (sys.executable,),
) -> Snapshots:
    """Pictures of the cell; where there is no OpenGL they are drawn, and `note` says so.

    Args:
        recording: of the motion.
        scenario: what was simulated.
        times: of the pictures [s], by default `snapshot_times`.
        size: pixels a side.
        python: starts the interpreter of the child process that renders.
    """
    wanted = snapshot_times(recording) if times is None else np.asarray(times, dtype=float)
    moments = recording.sel(time=wanted, method="nearest")
    q, block, tool = (np.asarray(moments[name].values, dtype=float) for name in ("q", "block_pose", "tool_pose"))
    camera = frame_motion(tool, block, scenario, size)
    skin = surface_of(recording)
    surface = None if skin is None else skin.at(moments["time"])
    return Snapshots(wanted, *pictures(scenario, camera, q, tool, block, surface, python))


def pictures(
    scenario: Scenario,
    camera: Camera,
    q: Array,
    tool: Array,
    block: Array,
    surface: Surface | None = None,
    python: Sequence[str] = (sys.executable,),
) -> tuple[Array, str | None]:
    """Pictures (n, size, size, 3) of uint8, rendered, or drawn where there is no OpenGL, and then the reason.

    Args:
        scenario: what was simulated.
        camera: sees all of them.
        q: joint angles (n, 6) [rad].
        tool: poses (n, 7).
        block: poses (n, 7).
        surface: of a pancake, at these n instants.
        python: starts the interpreter of the child process that renders.
    """
    images, trouble = render_in_child(scenario, camera, q, block, surface, python)
    if images is not None:
        return images, None
    from flipdiagram.rendering.sketch import draw_cell

    note = f"the motion is drawn, not rendered: {trouble}; {ADVICE}"
    return draw_cell(scenario, camera.project, camera.size, q, tool, block, surface), note


def frame_motion(tool: Array, block: Array, scenario: Scenario, size: int) -> Camera:
    """The camera that shows all of the motion and the arm behind it, from poses (n, 7) of tool and block."""
    positions = np.vstack([tool[:, 5:], block[:, 5:]])
    edge = max(scenario.object.length, scenario.tool.blade_width)
    low = np.minimum(positions.min(axis=0) - edge, -0.16)
    high = np.maximum(positions.max(axis=0) + edge, [0.16, 0.66])
    # a block that fell off the table is not worth a tiny picture
    low[1] = scenario.table.height - (0.15 if positions[:, 1].min() < scenario.table.height else 0.05)
    return Camera.in_front((low[0], high[0]), (low[1], high[1]), scenario.task.start_x, size)


def add_renderer(scene: Scene, size: int) -> None:
    """Give the scene a VTK renderer RENDERER for pictures of `size` pixels a side; call before making contexts."""
    aim = (LIGHT_ON - LIGHT_FROM) / np.linalg.norm(LIGHT_ON - LIGHT_FROM)
    sun, sky, eye = LIGHT_FROM, SKY, np.zeros(3)
    # point lights cast no shadows: they brighten those of the first
    lights = [
        LightParameter(type="spot", frame="world", position=sun, direction=aim, cone_angle=35, intensity=0.4),
        LightParameter(type="point", frame="world", position=sky, intensity=0.35),
        LightParameter(type="point", frame="camera", position=eye, intensity=0.5),
    ]
    # the shadow map takes half of the time: no finer than the picture shows
    shadows = round(SHADOW_DETAIL * size)
    parameters = RenderEngineVtkParams(
        default_clear_color=np.array(BACKGROUND), lights=lights, cast_shadows=True, shadow_map_size=shadows
    )
    scene.scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(parameters))


def render(scene: Scene, context: Context, camera: Camera) -> Array:
    """One picture (size, size, 3) of uint8 of the scene as posed in the context."""
    graph = scene.scene_graph
    query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
    image = query.RenderColorImage(ColorRenderCamera(camera.core), graph.world_frame_id(), camera.X_WC)
    fine = np.asarray(image.data)[:, :, :3].reshape(camera.size, OVERSAMPLING, camera.size, OVERSAMPLING, 3)
    return np.asarray(fine.mean(axis=(1, 3)).round().astype(np.uint8))


def render_in_child(
    scenario: Scenario,
    camera: Camera,
    q: Array,
    block: Array,
    surface: Surface | None = None,
    python: Sequence[str] = (sys.executable,),
) -> tuple[Array | None, str]:
    """Renderings (n, size, size, 3) of joint angles q (n, 6) and block poses (n, 7), or None and the reason.

    surface: of a pancake, with its vertices at the n instants.
    """
    package = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    with tempfile.TemporaryDirectory() as folder:
        task, result = Path(folder) / "task.npz", Path(folder) / "images.npy"
        np.savez(
            task,
            q=q,
            block=block,
            X_WC=camera.X_WC.GetAsMatrix4(),
            size=camera.size,
            fov_y=camera.fov_y,
            scenario=np.array(scenario.model_dump_json()),
            **({} if surface is None else surface._asdict()),
        )
        code = (
            f"from flipdiagram.rendering.snapshots import _child; _child({str(task)!r}, {str(result)!r}, {os.getpid()})"
        )
        limit = TIME_LIMIT + TIME_EACH * len(q)
        try:
            done = subprocess.run(
                [*python, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, timeout=limit
            )
            if done.returncode == 0:
                return np.load(result), ""
        except (OSError, ValueError) as error:
            return None, str(error)
        except subprocess.TimeoutExpired:
            return None, f"the renderer did not answer within {limit:g} s"
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    reason = f" ({lines[-1][:160]})" if lines else ""
    return None, f"the renderer ended with code {done.returncode}{reason}"


def _child(task: str, result: str, parent: int) -> None:
    die_with(parent)
    with np.load(task) as data:
        scene = build_scene(Scenario.model_validate_json(str(data["scenario"])))
        camera = Camera(RigidTransform(data["X_WC"]), int(data["size"]), float(data["fov_y"]))
        add_renderer(scene, camera.size)
        context = scene.context()
        surface = Surface(*(data[name] for name in Surface._fields)) if Surface._fields[0] in data else None
        images = []
        for k, (q, block) in enumerate(zip(data["q"], data["block"], strict=True)):
            scene.pose(context, q, block)
            if surface is not None:
                show_surface(scene, context, surface, surface.vertices[k])
            images.append(render(scene, context, camera))
    np.save(result, np.stack(images))
