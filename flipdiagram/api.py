"""The names that a script or notebook needs first, in one place; importing it also gives recordings their `.flip`."""

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.drawing import draw
from flipdiagram.errors import FlipdiagramError, PlanningError, ScenarioError, SimulationError
from flipdiagram.planning import Plan, plan_motion
from flipdiagram.results import compare, open_result
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, load
from flipdiagram.simulation.metrics import measure
from flipdiagram.simulation.simulate import simulate

__all__ = [
    "ARCHITECTURES", "FlipdiagramError", "Plan", "PlanningError", "Scenario", "ScenarioError", "SimulationError",
    "build_loop", "compare", "draw", "load", "measure", "open_result", "plan_motion", "simulate",
]  # fmt: skip
