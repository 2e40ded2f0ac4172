"""The names that a script or notebook needs first, in one place; importing it also gives recordings their `.flip`."""

from flipdiagram.drawing import draw
from flipdiagram.errors import FlipdiagramError, PlanningError, ScenarioError, SimulationError
from flipdiagram.loop import build_loop
from flipdiagram.metrics import measure
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.results import compare, open_result
from flipdiagram.scenario import ARCHITECTURES, Scenario, load
from flipdiagram.simulate import simulate

__all__ = [
    "ARCHITECTURES", "FlipdiagramError", "Plan", "PlanningError", "Scenario", "ScenarioError", "SimulationError",
    "build_loop", "compare", "draw", "load", "measure", "open_result", "plan_motion", "simulate",
]  # fmt: skip
