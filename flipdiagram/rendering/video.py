"""Recordings -> one short video: the architectures side by side, slowed down, each with what happened and its verdict.

The pictures are those of `snapshots.py`: they need no display. Pillow, which Matplotlib brings along, writes animated
GIF, which every README and every slide shows, and WebP, which is smaller; an encoder of films would be a download of
30 MB for six seconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from os import cpu_count
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path

if TYPE_CHECKING:  # the command line checks a name before it needs them
    import xarray as xr
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

    from flipdiagram.arrays import Array
    from flipdiagram.rendering.snapshots import Camera
    from flipdiagram.scenario.scenario import Scenario
    from flipdiagram.simulation.course import Happening
    from flipdiagram.simulation.pancake_surface import Surface

FORMATS = (".gif", ".webp")
SLOWDOWN, FRAME = 4, 80
"""Played at 1/SLOWDOWN of real speed, a picture every FRAME ms; GIF counts in 10 ms."""
BEFORE, AFTER = 0.06, 0.25
"""What is shown [s] before the motion and after the block has come down, or could have."""
LAST = 2400
"""How long the last picture stays [ms], before all begins again."""
SIZE, MARGIN, NAME, TEXT, LINE = 250, 6, 16, 12, 16
"""Pixels: side of a picture, margin, letters of name and text, distance of lines."""
LINES = 6
"""Lines of text below a picture."""
STILL = 2e-4
"""Change of a joint [rad] or of the block [m, 1] that shows in no picture."""
COLOURS = 128
"""Of a GIF, all pictures together; with more it grows and looks the same."""
GOOD, BAD, INK, PAPER = "#00664b", "#a33c00", "#303030", "white"


class _Cell(NamedTuple):
    """One architecture: its pictures (n, SIZE, SIZE, 3), and what is said of it; decided: since when [s]."""

    images: Array
    name: str
    colour: str
    course: Sequence[Happening]
    verdict: str
    success: bool
    decided: float


def video_file(name: str) -> Path:
    """The name of a video as a path; InputError where its ending is no format or its folder is not there."""
    path = Path(name)
    if path.suffix.lower() not in FORMATS:
        raise InputError.of("--video", name, f"a name that ends in {' or '.join(FORMATS)}")
    if "\0" in name or path.is_dir() or not path.parent.is_dir():
        raise InputError.of("--video", name, "a file in a folder that exists")
    return path


def write_video(recordings: Mapping[str, xr.Dataset], scenario: Scenario, path: str | Path) -> str | None:
    """Write the flips as a GIF or WebP, by the ending of the path; returns a note where they are drawn, not rendered.

    Args:
        recordings: by architecture.
        scenario: what was simulated.
        path: of the file.

    Raises InputError for another ending, and where the file cannot be written.
    """
    from flipdiagram.scenario.scenario import ARCHITECTURES

    target = video_file(str(path))
    shown = {name: recordings[name] for name in ARCHITECTURES if name in recordings}
    times, camera = _times(shown), _frame(shown.values(), scenario)
    films, note = _films(shown.values(), scenario, camera, times)
    cells = [_cell(name, data, images) for (name, data), images in zip(shown.items(), films, strict=True)]
    frames = [_compose(cells, k, float(time)) for k, time in enumerate(times)]
    durations = [FRAME] * (len(frames) - 1) + [LAST]
    settings: dict[str, Any] = {"save_all": True, "duration": durations, "loop": 0}
    if target.suffix.lower() == ".gif":
        frames = _reduce(frames)
    else:
        settings |= {"quality": 70, "method": 4}
    with atomic_path(target) as temporary:
        frames[0].save(temporary, append_images=frames[1:], **settings)
    return note


def _times(recordings: Mapping[str, xr.Dataset]) -> Array:
    """Instants of the pictures [s]."""
    from flipdiagram.simulation.events import touchdown

    first = next(iter(recordings.values()))
    landed = [down.time_s for data in recordings.values() if (down := touchdown(data)) is not None]
    end = max([float(first.attrs["touchdown_time_s"]), *landed]) + AFTER
    last = max(float(data["time"][-1]) for data in recordings.values())
    return np.arange(-BEFORE, min(end, last) + 1e-9, FRAME / 1000 / SLOWDOWN)


def _frame(recordings: Iterable[xr.Dataset], scenario: Scenario) -> Camera:
    """The camera that shows block and blade all the way, and no more; the same for all."""
    from flipdiagram.rendering.scene import extent_of_motion
    from flipdiagram.rendering.snapshots import Camera

    moving = (data.sel(time=slice(-BEFORE, None)) for data in recordings)
    low, high = extent_of_motion(moving, scenario)
    return Camera.in_front((low[0], high[0]), (low[1], high[1]), scenario.task.start_x, SIZE)


def _films(
    recordings: Iterable[xr.Dataset], scenario: Scenario, camera: Camera, times: Array
) -> tuple[list[Array], str | None]:
    """Pictures of each architecture, and the note of `pictures`; one that equals the one before is taken once."""
    from flipdiagram.rendering.snapshots import pictures

    moments = [data.sel(time=times, method="nearest") for data in recordings]
    q, tool, block = (np.vstack([at[name].values for at in moments]) for name in ("q", "tool_pose", "block_pose"))
    surface = _surfaces(moments)
    moving = [q, block] if surface is None else [q, surface.vertices.reshape(len(q), -1)]
    new = np.abs(np.diff(np.hstack(moving), axis=0, prepend=np.inf)).max(axis=1) > STILL
    new[:: len(times)] = True
    with ThreadPoolExecutor() as pool:  # each waits for a child process that renders its share
        shares = np.array_split(np.flatnonzero(new), cpu_count() or 1)
        taken = list(
            pool.map(
                lambda k: pictures(scenario, camera, q[k], tool[k], block[k], surface and surface.some(k)),
                filter(len, shares),
            )
        )
    images = np.concatenate([share for share, _ in taken])[np.cumsum(new) - 1]
    return np.split(images, len(moments)), next((note for _, note in taken if note), None)


def _surfaces(moments: Sequence[xr.Dataset]) -> Surface | None:
    """Of pancakes, all in one, at the instants of one recording after the other."""
    from flipdiagram.simulation.pancake_surface import surface_of

    found = [surface.at(data["time"]) for data in moments if (surface := surface_of(data)) is not None]
    if not found:
        return None
    time, vertices = (np.concatenate([surface[k] for surface in found]) for k in (0, 1))
    return found[0]._replace(time=time, vertices=vertices)


def _cell(name: str, data: xr.Dataset, images: Array) -> _Cell:
    from flipdiagram.figures.style import NAMES, style_of
    from flipdiagram.simulation.course import course, decided_at
    from flipdiagram.simulation.verdict import judge

    success, failure = judge(data)
    verdict = failure or "turned over"
    return _Cell(images, NAMES[name], style_of(name).color, course(data), verdict, success, decided_at(data))


def _compose(cells: Sequence[_Cell], k: int, time: float) -> Image:
    """Picture k of the video, at a time [s]."""
    from PIL import Image, ImageDraw

    width = len(cells) * (SIZE + MARGIN) - MARGIN
    top = NAME + 2 * MARGIN
    sheet = Image.new("RGB", (width, top + SIZE + LINES * LINE + MARGIN), PAPER)
    draw = ImageDraw.Draw(sheet)
    for column, cell in enumerate(cells):
        left = column * (SIZE + MARGIN)
        draw.rectangle((left, top - 4, left + SIZE - 1, top), fill=cell.colour)
        draw.text((left + 2, MARGIN - 2), cell.name, INK, _font(NAME, bold=True))
        sheet.paste(Image.fromarray(cell.images[k]), (left, top))
        lines = [(f"{at:.2f} s  {text}", INK, False) for at, text in cell.course if at <= time]
        if time >= cell.decided:
            colour = GOOD if cell.success else BAD
            lines += [(line, colour, True) for line in wrap(cell.verdict, SIZE // 8)]
        for row, (line, colour, bold) in enumerate(lines[:LINES]):
            draw.text((left + 2, top + SIZE + MARGIN / 2 + row * LINE), line, colour, _font(TEXT, bold))
        _clock(draw, (left, top), f"{time:.2f} s".replace("-", "−") + ("" if column else f", at 1/{SLOWDOWN} speed"))
    return sheet


def _clock(draw: ImageDraw, corner: tuple[int, int], text: str) -> None:
    place, font = (corner[0] + 8, corner[1] + 9), _font(TEXT)
    left, top, right, bottom = draw.textbbox(place, text, font)
    draw.rectangle((left - 3, top - 3, right + 3, bottom + 3), PAPER)
    draw.text(place, text, INK, font)


@cache
def _font(size: int, bold: bool = False) -> FreeTypeFont:
    """DejaVu Sans of Matplotlib, as in the figures."""
    from matplotlib import get_data_path
    from PIL import ImageFont

    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans{'-Bold' if bold else ''}.ttf", size)


def _reduce(frames: list[Image]) -> list[Image]:
    """The pictures with one palette for all, made of some of them, and without dither, which would not compress."""
    from PIL import Image

    some = frames[:: max(1, len(frames) // 6)] + frames[-1:]
    width, height = some[0].size
    sheet = Image.new("RGB", (width, height * len(some)))
    for row, frame in enumerate(some):
        sheet.paste(frame, (0, row * height))
    palette = sheet.quantize(COLOURS, method=Image.Quantize.FASTOCTREE)  # keeps the few pixels of the block
    return [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
