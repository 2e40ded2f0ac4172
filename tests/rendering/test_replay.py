import base64
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from conftest import ALTERNATIVES
from ideal import IDEAL
from patience import HUNG
from synthetic import DROP, RELEASE, recording, recordings

from flipdiagram.errors import InputError
from flipdiagram.rendering import replay
from flipdiagram.scenario.scenario import ARCHITECTURES

MOVING = ("link_s", "link_l", "link_u", "link_r", "link_b", "link_t", "spatula", "block")
STOP = 0.3  # [s] where the browser stops
# Written into a copy of the page: what the viewer shows once it stands still, as text in the document.
PROBE = """
<script>
(function probe() {
  if (!document.body.dataset.animations) { setTimeout(probe, 20); return; }
  setTimeout(read, 300);  // some frames later
})();
function read() {
  const out = {animations: viewer.animator.actions.length, durations: [], blocks: {}, errors: window.trouble || []};
  out.durations = [...new Set(viewer.animator.actions.map(action => action._clip.duration.toFixed(6)))];
  for (const name of NAMES) {
    const p = new MeshCat.THREE.Vector3();
    viewer.scene_tree.find(["cells", name, "block"]).object.getWorldPosition(p);
    viewer.scene.worldToLocal(p);
    const label = [...document.querySelectorAll("#flip-labels div")][Object.keys(out.blocks).length];
    out.blocks[name] = {position: [p.x, p.y, p.z], label: label.innerText, left: parseFloat(label.style.left)};
  }
  out.force = viewer.scene_tree.find(["cells", "pd+dob", "force"]).object.visible;
  out.force_of_dropped = viewer.scene_tree.find(["cells", "pd", "force"]).object.visible;
  const pre = document.createElement("pre");
  pre.id = "probe";
  pre.textContent = JSON.stringify(out);
  document.body.append(pre);
}
</script>
"""


@pytest.fixture(scope="module")
def page():
    return replay.replay_html(recordings(), IDEAL)


class Links(HTMLParser):
    """Everything that an HTML page would load, and its policy."""

    def __init__(self, text):
        super().__init__()
        self.found, self.policy = [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.found += [values[key] for key in ("src", "href", "data", "action", "poster") if key in values]
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]


def test_the_page_loads_nothing_and_forbids_it(page):
    links = Links(page)
    assert links.found == []
    assert links.policy.startswith("default-src 'none';") and "http" not in links.policy and "*" not in links.policy
    # before the first script, or that would run without it
    assert page.index("Content-Security-Policy") < page.index("<script")


def test_every_fetch_reads_from_the_page_itself(page):
    targets = re.findall(r'fetch\("(.{5})', page)
    assert len(targets) > len(ARCHITECTURES) and set(targets) == {"data:"}


def test_every_moving_body_of_every_architecture_is_animated(page):
    packets = [base64.b64decode(data) for data in re.findall(r'fetch\("data:[^,]*,([^"]*)"', page)]
    (animation,) = [packet for packet in packets if b"set_animation" in packet]
    for architecture in ARCHITECTURES:
        for body in MOVING:
            assert f"/cells/{architecture}/{body}".encode() in animation, (architecture, body)
    assert b"/table" not in animation and b"/base" not in animation


def test_the_page_is_small(page):
    assert len(page) < 5e6


def test_names_colours_and_verdicts_stand_in_the_page(page):
    data = json.loads(re.search(r"const data = (\{.*\});\n", page).group(1))
    assert data["slowdown"] == 4 and data["speeds"][:3] == [1, 2, 4]
    for cell, architecture in zip(data["cells"], ARCHITECTURES, strict=True):
        assert cell["success"] == (architecture not in DROP)
        assert ("dropped at 0." if architecture in DROP else "turned over") in cell["verdict"]
    gaps = np.diff([cell["offset"] for cell in data["cells"]])
    np.testing.assert_allclose(gaps, replay.SPACING)


def test_captions_are_what_happened_and_the_verdict_waits_for_it(page):
    cells = json.loads(re.search(r"const data = (\{.*\});\n", page).group(1))["cells"]
    for cell, architecture in zip(cells, ARCHITECTURES, strict=True):
        (left, text), (landed, _) = cell["course"]
        assert left == pytest.approx(DROP.get(architecture, RELEASE), abs=2e-3) and text.startswith("block left")
        assert cell["decided_s"] == (left if architecture in DROP else landed)
    place = replay.replay_html({"pd": recording("pd")}, IDEAL, {"pd": (True, "laid down")})
    (cell,) = json.loads(re.search(r"const data = (\{.*\});\n", place).group(1))["cells"]
    assert cell["verdict"] == "laid down" and cell["decided_s"] == recording("pd")["time"].values[-1]


def test_the_view_holds_block_and_blade_and_little_more(page):
    data = json.loads(re.search(r"const data = (\{.*\});\n", page).group(1))
    low = np.array(data["middle"][1:]) - [data["width"] / 2, data["height"] / 2]
    for moving in (recording(name)["block_pose"].sel(time=slice(-0.25, None)).values[:, 5:] for name in ARCHITECTURES):
        assert (moving > low).all() and (moving < low + [data["width"], data["height"]]).all()
    assert data["width"] < 0.5 and data["height"] < 0.5


def test_the_same_recordings_give_the_same_page(page):
    assert replay.replay_html(recordings(), IDEAL) == page


def test_one_architecture_and_recordings_of_different_lengths():
    long, short = recording("pd+dob"), recording("pd").sel(time=slice(None, 0.8))
    html = replay.replay_html({"pd+dob": long, "pd": short}, IDEAL)
    assert [cell in html for cell in ('"PD"', '"PD + DOB"', '"PD + FF"')] == [True, True, False]


def test_unknown_architecture_is_refused():
    with pytest.raises(InputError, match="'pid'"):
        replay.replay_html({"pid": recording("pd")}, IDEAL)


def test_the_file_is_written_whole_and_without_a_word(tmp_path, capfd):
    path = replay.write_replay({"pd+dob": recording("pd+dob")}, IDEAL, tmp_path / "replay.html")
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert [entry.name for entry in tmp_path.iterdir()] == ["replay.html"]
    assert capfd.readouterr() == ("", "")


def test_rest_needs_no_key_frames():
    still = np.zeros((10, 3))
    assert replay.key_frames(still) == []
    moves = np.array([0, 0, 0, 0, 1, 2, 2, 2, 2, 2.0])[:, None]
    assert replay.key_frames(moves) == [0, 3, 4, 5, 9]


@pytest.mark.needs("chromium")
def test_a_browser_without_network_shows_each_block_where_the_recording_has_it(page, tmp_path):
    probe = PROBE.replace("NAMES", json.dumps(ARCHITECTURES))
    trouble = "<head><script>window.trouble = []; onerror = text => trouble.push(String(text));</script>"
    path = tmp_path / "replay.html"
    path.write_text(page.replace("<head>", trouble, 1).replace("</body>", probe + "</body>"), encoding="utf-8")
    chromium = next(filter(None, map(shutil.which, ALTERNATIVES["chromium"])))
    options = (
        "--headless --no-sandbox --disable-gpu --enable-unsafe-swiftshader --disable-quic --no-first-run --disable-sync"
        " --disable-background-networking --disable-component-update --disable-extensions --window-size=640,360"
        " --virtual-time-budget=4000 --dump-dom"
    ).split()
    command = [chromium, *options, f"--user-data-dir={tmp_path / 'profile'}", f"{path.as_uri()}#t={STOP}"]
    done = subprocess.run(command, capture_output=True, timeout=HUNG, text=True)
    found = re.search(r'<pre id="probe">(.*?)</pre>', done.stdout)
    assert found, done.stderr[-2000:]
    shown = json.loads(found.group(1))
    assert shown["errors"] == []
    assert shown["animations"] == len(ARCHITECTURES) * (len(MOVING) + 3)  # 3: the arrow, its shaft and head
    assert len(shown["durations"]) == 1  # else parts of the scene would repeat out of step
    assert shown["force"] and not shown["force_of_dropped"]
    for k, architecture in enumerate(ARCHITECTURES):
        block = shown["blocks"][architecture]
        expected = recording(architecture)["block_pose"].sel(time=STOP, method="nearest").values[4:]
        offset = [0, replay.SPACING * (k - 1.5), 0]
        np.testing.assert_allclose(block["position"], expected + offset, atol=2e-3)
        assert ("dropped at" in block["label"]) == ("block left the blade" in block["label"]) == (architecture in DROP)
        assert "turned over" not in block["label"] and replay.NAMES[architecture] in block["label"]
    places = [block["left"] for block in shown["blocks"].values()]
    assert 0 < places[0] < places[1] < places[2] < places[3] < 640
