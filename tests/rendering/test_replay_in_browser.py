"""The replay of a real flip in a real browser: it plays, pauses, and the block lies turned over at the end."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from conftest import ALTERNATIVES
from ideal import IDEAL
from patience import HUNG

from flipdiagram.rendering import replay
from flipdiagram.simulation.simulate import simulate

BASE = (
    "--headless --no-sandbox --disable-gpu --enable-unsafe-swiftshader --disable-quic --no-first-run --disable-sync"
    " --disable-background-networking --disable-component-update --disable-extensions --window-size=640,360"
).split()
# Presses play, looks at the clock twice, presses pause, looks twice again, then goes to the end.
PROBE = """
<script>
(function wait() {
  if (!document.body.dataset.animations) { setTimeout(wait, 20); return; }
  const animator = viewer.animator, play = document.getElementById("flip-play");
  const out = {clocks: [], playing: [], errors: window.trouble};
  // in virtual time frames are few: the animator is stepped here as its next frame would
  const look = () => {
    animator.update();
    out.clocks.push(Math.max(...animator.actions.map(action => action.time)));
    out.playing.push(animator.playing);
  };
  const steps = [look, () => play.click(), look, look, () => play.click(), look, look,
    () => { const bar = document.getElementById("flip-time"); bar.value = 1000; bar.oninput({target: bar}); }, look, finish];
  (function next() { steps.shift()(); if (steps.length) setTimeout(next, 400); })();
  function finish() {
    const object = viewer.scene_tree.find(["cells", "pd+ff+dob", "block"]).object;
    const up = new MeshCat.THREE.Vector3(0, 0, 1), origin = new MeshCat.THREE.Vector3(0, 0, 0);
    out.up = viewer.scene.worldToLocal(object.localToWorld(up)).sub(viewer.scene.worldToLocal(object.localToWorld(origin))).toArray();
    const pre = document.createElement("pre");
    pre.id = "probe";
    pre.textContent = JSON.stringify(out);
    document.body.append(pre);
  }
})();
</script>
"""


@pytest.fixture(scope="module")
def page():
    scenario = IDEAL.with_overrides({"simulation.hold_time": 1.0})
    return replay.replay_html({"pd+ff+dob": simulate(scenario, "pd+ff+dob").recording}, scenario)


def browse(folder, page, *options, at=""):
    path = folder / "replay.html"
    path.write_text(page, encoding="utf-8")
    chromium = next(filter(None, map(shutil.which, ALTERNATIVES["chromium"])))
    command = [chromium, *BASE, *options, f"--user-data-dir={folder / 'profile'}", f"{path.as_uri()}{at}"]
    return subprocess.run(command, capture_output=True, timeout=HUNG, text=True)


@pytest.mark.needs("chromium")
def test_it_plays_pauses_and_ends_with_the_block_turned_over(page, tmp_path):
    trouble = "<head><script>window.trouble = []; onerror = text => trouble.push(String(text));</script>"
    probed = page.replace("<head>", trouble, 1).replace("</body>", PROBE + "</body>")
    done = browse(tmp_path, probed, "--virtual-time-budget=12000", "--dump-dom", at="#t=0.1")
    found = re.search(r'<pre id="probe">(.*?)</pre>', done.stdout)
    assert found, done.stderr[-2000:]
    shown = json.loads(found.group(1))
    assert shown["errors"] == []
    stopped, played, later, paused, still, end = shown["clocks"]  # seconds of playing time, four to one of the motion
    assert stopped == pytest.approx((0.1 + replay.LEAD_IN) * replay.SLOWDOWN, abs=0.02) and stopped < played < later
    assert paused == still and end > 4.0
    assert shown["playing"] == [False, True, True, False, False, False]
    np.testing.assert_allclose(shown["up"], [0, 0, -1], atol=0.05)


@pytest.mark.needs("chromium")
def test_two_instants_look_different_and_one_instant_looks_the_same(page, tmp_path):
    pictures = []
    for at in ("#t=0.1", "#t=0.45", "#t=0.45"):
        picture = tmp_path / f"shot{len(pictures)}.png"
        browse(tmp_path, page, "--virtual-time-budget=4000", f"--screenshot={picture}", at=at)
        pictures.append(picture.read_bytes())
    assert pictures[0] != pictures[1] == pictures[2]
