"""A pancake that bends in the replay, in renderings and drawings, and in the video: from its recorded vertices."""

import base64
import json
import os
import re

import numpy as np
import pytest
from bending import PANCAKE, recording
from browser import probe

from flipdiagram.rendering import replay, snapshots, video
from flipdiagram.rendering.pancake import vertex_normals
from flipdiagram.rendering.scene import ROOM, extent_of_motion
from flipdiagram.rendering.sketch import draw_cell
from flipdiagram.simulation.pancake_surface import surface_of

SIZE = 200
AT = 0.2015  # [s] between two frames
CELL = "pd+ff+dob"
# What the meshes hold in the browser at two instants, as text in the document.
PROBE = """
<script>
(function wait() {
  if (!document.body.dataset.animations) { setTimeout(wait, 20); return; }
  setTimeout(read, 300);
})();
function read() {
  const meshes = Object.fromEntries(["upper", "lower", "rim"].map(name =>
    [name, viewer.scene_tree.find(["cells", "CELL", "pancake", name, "<object>"]).object]));
  const held = name => [...meshes[name].geometry.attributes.position.array];
  const out = {errors: window.trouble, before: Object.keys(meshes).map(held), block: !!viewer.scene_tree.find(["cells", "CELL"]).children.block};
  out.normals = [...meshes.upper.geometry.attributes.normal.array];
  out.smooth = Object.values(meshes).every(mesh => !mesh.material.flatShading);
  for (const code of ["ArrowRight", "ArrowRight"]) dispatchEvent(new KeyboardEvent("keydown", {code}));
  viewer.render();
  out.after = held("upper");
  const pre = document.createElement("pre");
  pre.id = "probe";
  pre.textContent = JSON.stringify(out);
  document.body.append(pre);
}
</script>
""".replace("CELL", CELL)


@pytest.fixture(scope="module")
def page():
    return replay.replay_html({CELL: recording()}, PANCAKE)


@pytest.fixture(scope="module")
def surface():
    return surface_of(recording())


@pytest.fixture(scope="module")
def camera():
    low, high = extent_of_motion([recording().sel(time=slice(0, None))], PANCAKE)
    return snapshots.Camera.in_front((low[0], high[0]), (low[1], high[1]), PANCAKE.task.start_x, SIZE)


def unpack(page):
    """Step [m], first instant [s] and vertices (frames, V, 3) [m] of the only cell of a page."""
    data = json.loads(re.search(r"const data = (\{.*\});\n", page).group(1))
    (cell,) = data["cells"]
    bending = cell["bending"]
    numbers = np.frombuffer(base64.b64decode(bending["numbers"]), "<u2")
    vertices = np.array(bending["low"]) + bending["step"] * numbers.reshape(-1, 66, 3)
    return bending["step"], bending["start_s"] + data["step_s"] * np.arange(len(vertices)), vertices


def test_the_page_holds_the_recorded_vertices_and_no_rigid_block(page, surface):
    step, times, vertices = unpack(page)
    assert step < 30e-6 and times[0] == -replay.LEAD_IN and times[-1] > 1.1
    np.testing.assert_allclose(vertices, surface.at(times).vertices, atol=0.51 * step)
    packets = [base64.b64decode(data) for data in re.findall(r'fetch\("data:[^,]*,([^"]*)"', page)]
    paths = b" ".join(packets)
    for mesh in ("upper", "lower", "rim"):
        assert f"/cells/{CELL}/pancake/{mesh}".encode() in paths
    assert f"/cells/{CELL}/spatula".encode() in paths and f"/cells/{CELL}/block".encode() not in paths


def test_the_page_is_small(page):
    data = re.search(r"const data = (\{.*\});\n", page).group(1)
    assert len(data) < 0.25e6 and len(page) < 3e6  # viewer and arm are 2 MB of it, whatever bends


@pytest.mark.needs("chromium")
def test_a_browser_has_the_meshes_where_they_were_recorded(page, surface, tmp_path):
    shown = probe(tmp_path, page, PROBE, "--virtual-time-budget=4000", at=f"#t={AT}")
    before, after = (surface.at([AT + k * replay.FRAME_TIME / replay.SLOWDOWN]).vertices[0] for k in (0, 2))
    for mesh in shown["before"]:
        np.testing.assert_allclose(np.reshape(mesh, (-1, 3)), before, atol=2e-4)
    np.testing.assert_allclose(np.reshape(shown["after"], (-1, 3)), after, atol=2e-4)
    assert np.abs(after - before).max() > 2e-3
    nodes = np.unique(surface.upper)
    expected = vertex_normals(before, surface.upper)[nodes]
    np.testing.assert_allclose(np.reshape(shown["normals"], (-1, 3))[nodes], expected, atol=0.01)
    assert shown["smooth"] and not shown["block"]


def test_normals_look_outwards(surface):
    flat = surface.at([0.0]).vertices[0]
    rim = vertex_normals(flat, surface.rim)
    middle = flat.mean(axis=0)
    for face in (surface.upper, surface.lower, surface.rim):
        normals, nodes = vertex_normals(flat, face), np.unique(face)
        np.testing.assert_allclose(np.linalg.norm(normals[nodes], axis=1), 1.0)
        assert (np.sum(normals[nodes] * (flat[nodes] - middle), axis=1) > 0).all()
    assert rim.shape == flat.shape and vertex_normals(flat, surface.upper)[surface.lower[0, 0]].tolist() == [0, 0, 1]


def test_the_view_holds_every_vertex_and_ends_close_to_one(surface):
    carried = recording().sel(time=slice(0, 0.4))
    (low, high), (low_all, high_all) = (extent_of_motion([data], PANCAKE) for data in (carried, recording()))
    for part, lowest, highest in ((surface.time >= 0, low, high), (surface.time >= -1, low_all, high_all)):
        seen = surface.vertices[part][:, :, 1:].reshape(-1, 2)
        assert (seen.min(axis=0)[0] > lowest[0]) and (seen.max(axis=0) <= highest - ROOM + 1e-9).all()
    swollen = recording().assign(vertices=recording()["vertices"] + np.float32([0, 0, 0.5]))
    assert extent_of_motion([swollen], PANCAKE)[1][1] == pytest.approx(surface.vertices[:, :, 2].max() + 0.5 + ROOM)


def pale_and_rubber(picture, without):
    """Pixels (n, 2) as (column, row) of the pale face and of the others; without: the same picture without it."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    changed = np.abs(picture.astype(int) - without).max(axis=-1) > 20
    coloured = changed & (red - blue > 50)  # not its grey shadow
    pale = coloured & (green > 0.7 * red)
    return (np.argwhere(mask)[:, ::-1] for mask in (pale, coloured & ~pale))


@pytest.fixture(scope="module", params=["rendered", "drawn"])
def shown(request, camera, surface):
    """Pictures, rendered or drawn, of the pancake as it lies at first and as it lies turned over in the end; and it."""
    times = np.array([0.04, 1.16, 0.04, 1.16])  # when it is bent most
    moments, taken = recording().sel(time=times, method="nearest"), surface.at(times)
    taken.vertices[2:] -= [0.0, 0.0, 50.0]  # out of sight
    q, tool, block = (moments[name].values for name in ("q", "tool_pose", "block_pose"))
    if request.param == "drawn":
        return draw_cell(PANCAKE, camera.project, SIZE, q, tool, block, taken), taken
    images, reason = snapshots.render_in_child(PANCAKE, camera, q, block, taken)
    if images is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(f"no renderings here: {reason}")
    return images, taken


def test_a_picture_shows_the_pancake_with_its_upper_face_pale(shown, camera):
    images, surface = shown
    for k, turned in enumerate((False, True)):
        seen = camera.project(surface.vertices[k])
        pale, rubber = pale_and_rubber(images[k], images[k + 2])
        assert len(rubber) > 40 and (len(pale) < 0.05 * len(rubber) if turned else len(pale) > 100), (
            len(pale),
            len(rubber),
        )
        pixels = np.vstack([pale, rubber])
        np.testing.assert_allclose(pixels.min(axis=0), seen.min(axis=0), atol=2.5)
        np.testing.assert_allclose(pixels.max(axis=0), seen.max(axis=0), atol=2.5)


def test_the_video_takes_a_picture_wherever_it_bends(surface, camera):
    times = np.arange(0.8, 1.0, 0.02)  # the arm rests, and the rigid pose too: only the bending goes on
    taken = []

    def grey(scenario, camera, q, tool, block, surface):
        taken.append(surface.vertices)
        return np.full((len(q), SIZE, SIZE, 3), 128, np.uint8), None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(snapshots, "pictures", grey)
        video._films([recording()], PANCAKE, camera, times)
    np.testing.assert_allclose(np.concatenate(taken), surface.at(times).vertices, atol=1e-9)
