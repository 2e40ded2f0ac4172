"""The world of the tests that compare with closed forms: exact velocities, rigid joints, friction that does not stick."""

from pathlib import Path

from flipdiagram.scenario.scenario import load_scenario

IDEAL = load_scenario(Path(__file__).parents[1] / "examples" / "ideal_servo.yaml")
