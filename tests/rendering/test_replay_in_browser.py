"""The replay of a real flip in a real browser: it plays, pauses, and the block lies turned over at the end."""

import numpy as np
import pytest
from browser import browse, probe
from ideal import IDEAL

from flipdiagram.rendering import replay
from flipdiagram.simulation.course import course
from flipdiagram.simulation.simulate import simulate

SCENARIO = IDEAL.with_overrides({"simulation.hold_time": 1.0})
# Each key as a user presses it, and the clock of the motion after it; the speed while it plays.
KEYS = """
<script>
(function wait() {
  if (!document.body.dataset.animations) { setTimeout(wait, 20); return; }
  const animator = viewer.animator, out = {errors: window.trouble, clocks: [], rates: []};
  for (const code of ["ArrowRight", "ArrowRight", "ArrowLeft", "ArrowDown", "ArrowDown", "ArrowDown", "ArrowUp"]) {
    dispatchEvent(new KeyboardEvent("keydown", {code}));
    out.clocks.push(Math.max(...animator.actions.map(action => action.time)));
  }
  const speed = document.getElementById("flip-speed");
  out.speeds = [...speed.options].map(option => option.text);
  for (const part of ["1", "4", "16"]) {
    speed.value = part;
    speed.onchange({target: speed});
    out.rates.push(animator.mixer.timeScale);
  }
  const pre = document.createElement("pre");
  pre.id = "probe";
  pre.textContent = JSON.stringify(out);
  document.body.append(pre);
})();
</script>
"""
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
def flown():
    return simulate(SCENARIO, "pd+ff+dob").recording


@pytest.fixture(scope="module")
def page(flown):
    return replay.replay_html({"pd+ff+dob": flown}, SCENARIO)


@pytest.mark.needs("chromium")
def test_arrow_keys_step_and_jump_and_the_speed_can_be_chosen(page, flown, tmp_path):
    shown = probe(tmp_path, page, KEYS, "--virtual-time-budget=4000", at="#t=0.1")
    clocks = np.array(shown["clocks"]) / replay.SLOWDOWN - replay.LEAD_IN
    step = replay.FRAME_TIME / replay.SLOWDOWN
    (left, _), (landed, _) = course(flown)
    end = clocks[-2]
    np.testing.assert_allclose(clocks[:5], [0.1 + step, 0.1 + 2 * step, 0.1 + step, left, landed], atol=2e-3)
    assert end > landed + 0.1 and clocks[-1] == pytest.approx(landed, abs=2e-3)
    assert shown["speeds"] == ["real", "1/2", "1/4", "1/8", "1/16", "1/32"] and shown["rates"] == [4, 1, 0.25]


@pytest.mark.needs("chromium")
def test_it_plays_pauses_and_ends_with_the_block_turned_over(page, tmp_path):
    shown = probe(tmp_path, page, PROBE, "--virtual-time-budget=12000", at="#t=0.1")
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
