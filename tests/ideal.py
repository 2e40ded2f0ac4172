"""The world of the tests that compare with closed forms: exact velocities, rigid joints, friction that does not stick."""

from pathlib import Path

from flipdiagram.scenario.scenario import load

IDEAL = load(Path(__file__).parents[1] / "examples" / "ideal_servo.yaml")
