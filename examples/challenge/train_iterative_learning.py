"""Learn the numbers of iterative_learning.py anew: the nominal world is flown again and again, and the file rewritten.

    python examples/challenge/train_iterative_learning.py [--iterations 6] [--engine mujoco]

Prints for each iteration what is still missing, the RMS of e'' + K_V e' + K_P e over the motion.
"""

import argparse
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flipdiagram import Plan, build_loop
from flipdiagram.arrays import Floats
from flipdiagram.simulation.simulate import simulate_loop
from flipdiagram.studies.challenge.boxes import refereed
from flipdiagram.studies.challenge.entry import Entry, load_entry
from flipdiagram.studies.challenge.flying import plan_entry
from flipdiagram.studies.challenge.suites import World, load_suites

FILE = Path(__file__).with_name("iterative_learning.py")
STARTS = (0.0, 0.06, 0.14)
"""Of the object on y [m]: one correction for all of them."""
GAMMA = 0.7


def improved(w: Floats, time: Floats, missing: Floats, knots: Floats, gamma: float = GAMMA) -> Floats:
    """w + gamma Q missing: w (K, m) at the knots (K,) [s], missing (N, m) at times (N,) [s] within the knots.

    Q fits by least squares what is linear between the knots, so what lies there already shrinks by 1 - gamma.
    """
    hats = np.maximum(0.0, 1.0 - np.abs(time[:, None] - knots) / (knots[1] - knots[0]))
    fitted: Floats = np.linalg.lstsq(hats, missing, rcond=None)[0]
    return w + gamma * fitted


def flip(entry: Entry, world: World, plan: Plan, w: Floats, engine: str) -> Any:
    """The recording of one flip in which w is added."""

    def reset(memory: dict[str, Any]) -> None:
        memory["w"] = w
        entry.laws["reset"](memory)

    scenario = world.truth(engine, entry.settings)
    learning = replace(entry, laws={**entry.laws, "reset": reset})
    controller, _ = refereed(learning, world.believed(engine, entry.settings), scenario.simulation.lead_time)
    loop = build_loop(scenario, entry.architecture, record=True, replace={"controller": controller})
    return simulate_loop(loop, plan).recording


def missing_in(recording: Any, end: float, k_p: float, k_v: float) -> tuple[Floats, Floats]:
    """Times (N,) [s] until `end` [s], and e'' + K_V e' + K_P e (N, 3) there, of y, z, theta."""
    part = recording.sel(time=slice(0.0, end))
    e, de, dde = (part[f"{name}_cmd"].values - part[name].values for name in ("x", "v", "a"))
    return part["time"].values, dde + k_v * de + k_p * e


def learn(iterations: int, engine: str) -> Floats:
    """What is to be added, (knots, 3), after so many iterations from nothing."""
    entry = load_entry(FILE)
    settings: dict[str, Any] = entry.laws["control"].__globals__
    knots, gains = settings["KNOTS"], (settings["K_P"], settings["K_V"])
    worlds = [w for w in load_suites().worlds(["nominal"]) if w.trial.overrides["task.start_y"] in STARTS]
    plans = [Plan.from_json(str(plan_entry(w.believed(engine, entry.settings), FILE)[0])) for w in worlds]
    added = np.zeros((len(knots), 3))
    for iteration in range(iterations):
        flown = []
        for world, plan in zip(worlds, plans, strict=True):
            end = min(plan.release_time, knots[-1])
            flown.append(missing_in(flip(entry, world, plan, added, engine), end, *gains))
        rms = [np.sqrt(np.mean(missing**2, axis=0)) for _, missing in flown]
        print(f"iteration {iteration}: missing", " ".join(f"{value:.2f}" for value in np.mean(rms, axis=0)), flush=True)
        time, missing = (np.concatenate(parts) for parts in zip(*flown, strict=True))
        added = improved(added, time, missing, knots)
    return added


def write(numbers: Floats) -> None:
    """Put what was learned into the entry, between its two marks."""
    text = FILE.read_text(encoding="utf-8")
    rows = "\n".join("    [" + ", ".join(f"{value:.2f}" for value in row) + "]," for row in numbers)
    block = f"# learned: begin\n# fmt: off\nLEARNED = np.array([\n{rows}\n])\n# fmt: on\n# learned: end"
    FILE.write_text(re.sub(r"# learned: begin.*?# learned: end", block, text, flags=re.S), encoding="utf-8")


def main() -> None:
    """Read the arguments, learn, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--iterations", type=int, default=6)
    parser.add_argument("--engine", choices=("drake", "mujoco"), default="mujoco")
    given = parser.parse_args()
    write(learn(given.iterations, given.engine))


if __name__ == "__main__":
    main()
