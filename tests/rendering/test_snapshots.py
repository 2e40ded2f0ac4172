import os
import re
import sys

import numpy as np
import pytest
from ideal import IDEAL
from synthetic import END, TOUCHDOWN, recording

from flipdiagram.rendering.sketch import draw_cell
from flipdiagram.rendering.snapshots import Camera, render_in_child, snapshot_times, take_snapshots

SIZE = 240
FAR_AWAY = [1, 0, 0, 0, 0.5, 0, -50]
TURNED = [0, 1, 0, 0]
PLACES = np.array([[0.5, -0.1, 0.3], [0.5, 0.12, 0.3], [0.5, 0.12, 0.45]])


@pytest.fixture(scope="module")
def camera():
    return Camera.in_front((-0.3, 0.3), (0.1, 0.7), 0.5, SIZE)


@pytest.fixture(scope="module")
def pictures(camera):
    """Without the block, at three places, turned over at the last, and the first of all once more; the arm at rest."""
    q = recording()["q"].values[0]
    level = [[1, 0, 0, 0, *place] for place in PLACES]
    blocks = np.array([FAR_AWAY, *level, [*TURNED, *PLACES[-1]], FAR_AWAY], dtype=float)
    images, reason = render_in_child(IDEAL, camera, np.tile(q, (len(blocks), 1)), blocks)
    if images is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(f"no renderings here: {reason}")
    return images.astype(int)


def block_pixels(picture, without):
    """Pixels (n, 2) as (column, row) that changed and have a colour: the block, not its grey shadow."""
    changed = np.abs(picture - without).max(axis=-1) > 20
    coloured = np.ptp(picture, axis=-1) > 60
    return np.argwhere(changed & coloured)[:, ::-1]


def test_camera_projects_as_a_pinhole_does(camera):
    middle = (SIZE - 1) / 2
    np.testing.assert_allclose(camera.project([0.5, 0.0, 0.4]), [middle, middle], atol=1e-9)
    # the rectangle's width, in the plane through the middle, fills the picture; +y is right, +z up
    np.testing.assert_allclose(camera.project([0.5, 0.3, 0.4]), [SIZE - 0.5, middle], atol=1e-6)
    np.testing.assert_allclose(camera.project([0.5, -0.3, 0.4]), [-0.5, middle], atol=1e-6)
    assert camera.project([0.5, 0.0, 0.5])[1] < middle


def test_the_block_is_where_it_should_be(camera, pictures):
    for place, picture in zip(PLACES, pictures[1:4], strict=True):
        centre = block_pixels(picture, pictures[0]).mean(axis=0)
        np.testing.assert_allclose(centre, camera.project(place), atol=4.0)  # of 240: what is seen is not the middle
    turned = block_pixels(pictures[4], pictures[0]).mean(axis=0)
    np.testing.assert_allclose(turned, camera.project(PLACES[-1]), atol=4.0)


def test_one_sees_whether_the_block_is_turned(pictures):
    level, turned = (
        np.median(pictures[k][tuple(block_pixels(pictures[k], pictures[0]).T[::-1])], axis=0) for k in (3, 4)
    )
    pale, rubber = level[1] / level[0], turned[1] / turned[0]  # green over red
    assert pale > 0.7 and rubber < 0.5


def test_the_same_scene_gives_the_same_picture(pictures):
    np.testing.assert_array_equal(pictures[0], pictures[-1])


def test_snapshots_are_taken_from_start_to_rest():
    times = snapshot_times(recording())
    assert len(times) == 8 and times[0] == 0.0 and times[-2] == TOUCHDOWN and times[-1] == pytest.approx(END)
    assert np.all(np.diff(times) > 0)


@pytest.mark.parametrize(
    "python, reason",
    [
        (["false"], "ended with code 1"),
        (
            [sys.executable, "-c", "import os, sys; print('no EGL', file=sys.stderr, flush=True); os.abort()"],
            r"code -6 \(.*no EGL",
        ),
        (["/no/such/python"], "No such file"),
    ],
)
def test_where_nothing_renders_the_motion_is_drawn_and_the_reason_given(python, reason):
    taken = take_snapshots(recording(), IDEAL, times=[0.0, END], size=SIZE, python=python)
    assert taken.note is not None and "drawn, not rendered" in taken.note and "apt install" in taken.note
    assert re.search(reason, taken.note)
    assert taken.images.shape == (2, SIZE, SIZE, 3) and taken.images.dtype == np.uint8
    np.testing.assert_array_equal(taken.times, [0.0, END])


def test_the_drawing_shows_the_block_at_its_place(camera):
    data = recording()
    q, tool = data["q"].values[:1], data["tool_pose"].values[:1].copy()
    tool[:, 6] = -50  # the blade would hide a part of the block
    images = draw_cell(IDEAL, camera.project, SIZE, q, tool, np.array([[*TURNED, 0.5, 0.15, 0.4]]))
    rubber = np.argwhere(np.abs(images[0].astype(int) - [0xDE, 0x5C, 0x38]).max(axis=-1) < 8)[:, ::-1]
    assert len(rubber) > 100
    np.testing.assert_allclose(rubber.mean(axis=0), camera.project([0.5, 0.15, 0.4]), atol=4.0)
