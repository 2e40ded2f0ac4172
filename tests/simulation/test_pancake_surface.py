"""The surface of a recorded pancake: closed, between its frames, and cut along the middle."""

import re

import numpy as np
import pytest
import synthetic
from bending import DEPTH, FREQUENCY, PANCAKE, recording

from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.simulation.course import course
from flipdiagram.simulation.pancake_surface import middle_section, outlines, surface_of
from flipdiagram.simulation.thumbnail import OUTLINES, path_svg


@pytest.fixture(scope="module")
def surface():
    return surface_of(recording())


def test_a_rigid_block_has_none():
    assert surface_of(synthetic.recording()) is None


def test_faces_and_rim_close_around_the_volume_and_are_seen_from_outside(surface):
    triangles = np.concatenate([surface.upper, surface.lower, surface.rim])
    edges = [tuple(edge) for a, b in ((0, 1), (1, 2), (2, 0)) for edge in triangles[:, [a, b]]]
    assert len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)
    flat = surface.vertices[int(np.argmin(np.abs(surface.time)))]  # the swing is zero at t = 0
    enclosed = np.linalg.det(flat[triangles]).sum() / 6
    assert enclosed == pytest.approx(pancake_mesh(PANCAKE.object).volumes.sum(), rel=1e-4)
    # 25 vertices a layer, and of the layer between only its 16 at the rim
    assert surface.vertices.shape[1:] == (25 + 16 + 25, 3) and triangles.max() == 65


def test_between_two_frames_it_moves_straight_and_beyond_the_ends_it_stays(surface):
    first, second, last = surface.vertices[[40, 41, -1]]
    instants = [*surface.time[40:42], surface.time[40:42].mean(), 99.0]
    taken = surface.at(instants)
    np.testing.assert_allclose(taken.vertices, [first, second, (first + second) / 2, last], atol=1e-9)
    np.testing.assert_array_equal(taken.time, instants)
    np.testing.assert_array_equal(surface.at([-99.0]).vertices[0], surface.vertices[0])


def test_the_section_goes_once_around_in_the_plane_of_the_motion(surface):
    upper, lower = middle_section(recording(), surface)
    assert len(upper) == len(lower) == 2 * PANCAKE.object.refinement + 1
    quarter = 1 / (4 * FREQUENCY)  # when it is bent most
    flat, bent = outlines(surface, (upper, lower), [0.0, quarter])
    np.testing.assert_allclose(surface.vertices[:, upper, 0], PANCAKE.task.start_x, atol=1e-6)
    y, z = flat.T
    area = np.abs(np.dot(y, np.roll(z, -1)) - np.dot(z, np.roll(y, -1))) / 2
    assert area == pytest.approx(PANCAKE.object.thickness * np.ptp(y), rel=1e-3)
    assert np.ptp(bent, axis=0)[1] > np.ptp(flat, axis=0)[1] + DEPTH / 2


def test_the_thumbnail_has_its_outlines_and_names_it():
    picture = path_svg(recording())
    assert picture.count("<polygon") == OUTLINES and ">pancake<" in picture and ">block<" not in picture
    places = [float(number) for text in re.findall(r'points="([^"]*)"', picture) for number in re.split("[ ,]", text)]
    assert min(places) >= 0 and max(places) <= 280
    assert "<polygon" not in path_svg(synthetic.recording())


def test_the_course_is_of_a_pancake():
    texts = [text for _, text in course(recording())]
    assert texts and all(text.startswith("pancake ") for text in texts)
