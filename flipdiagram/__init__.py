"""A robot arm turns a block over on a spatula: acceleration control as a block diagram in Drake.

    from flipdiagram import Scenario, build_loop, measure, simulate

    flip = simulate(Scenario(), "pd+ff+dob")
    print(measure(flip.recording).success, flip.recording["x"])

Every name is loaded at its first use, so that importing the package, and the command line, start at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flipdiagram.campaign.run import run_campaign
    from flipdiagram.compiled import CompiledDiagram, compile_diagram
    from flipdiagram.compiled.linearize import linearize_diagram
    from flipdiagram.diagrams.controller import build_controller
    from flipdiagram.diagrams.joint_loop import JointLoop, build_joint_loop
    from flipdiagram.diagrams.loop import Loop, build_loop
    from flipdiagram.drawing import Drawing, draw
    from flipdiagram.errors import (
        FlipdiagramError,
        InputError,
        MissingProgramError,
        PlanningError,
        ScenarioError,
        SimulationError,
    )
    from flipdiagram.figures.motion import plot_plan
    from flipdiagram.files import __version__ as __version__
    from flipdiagram.planning import Plan, plan_motion
    from flipdiagram.results.comparing import compare
    from flipdiagram.results.comparison import Comparison
    from flipdiagram.results.info import info
    from flipdiagram.results.opening import open_campaign, open_result
    from flipdiagram.results.running import run_study
    from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, load_scenario
    from flipdiagram.simulation.metrics import FlipMetrics, measure
    from flipdiagram.simulation.simulate import Run, simulate, simulate_loop
    from flipdiagram.studies.frequency.response import FrequencyResponse, frequency_response
    from flipdiagram.studies.place.run import Placement, place

__all__ = [
    "ARCHITECTURES",
    "Comparison",
    "CompiledDiagram",
    "Drawing",
    "FlipMetrics",
    "FlipdiagramError",
    "FrequencyResponse",
    "InputError",
    "JointLoop",
    "Loop",
    "MissingProgramError",
    "Placement",
    "Plan",
    "PlanningError",
    "Run",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "build_controller",
    "build_joint_loop",
    "build_loop",
    "compare",
    "compile_diagram",
    "draw",
    "frequency_response",
    "info",
    "linearize_diagram",
    "load_scenario",
    "measure",
    "open_campaign",
    "open_result",
    "place",
    "plan_motion",
    "plot_plan",
    "run_campaign",
    "run_study",
    "simulate",
    "simulate_loop",
]

_ROOMS = {
    "campaign.run": ("run_campaign",),
    "compiled": ("CompiledDiagram", "compile_diagram"),
    "compiled.linearize": ("linearize_diagram",),
    "diagrams.controller": ("build_controller",),
    "diagrams.joint_loop": ("JointLoop", "build_joint_loop"),
    "diagrams.loop": ("Loop", "build_loop"),
    "drawing": ("Drawing", "draw"),
    "figures.motion": ("plot_plan",),
    "files": ("__version__",),
    "planning": ("Plan", "plan_motion"),
    "results": ("Comparison", "compare", "info", "open_campaign", "open_result", "run_study"),
    "scenario.scenario": ("ARCHITECTURES", "Scenario", "load_scenario"),
    "simulation.metrics": ("FlipMetrics", "measure"),
    "simulation.simulate": ("Run", "simulate", "simulate_loop"),
    "studies.frequency.response": ("FrequencyResponse", "frequency_response"),
    "studies.place.run": ("Placement", "place"),
}
_HOMES = dict.fromkeys((name for name in __all__ if name.endswith("Error")), "flipdiagram.errors")
_HOMES |= {name: f"flipdiagram.{room}" for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name from its room (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'flipdiagram' has no attribute '{name}'")
    if name in ("place", "simulate", "simulate_loop"):
        import_module("flipdiagram.results")  # gives recordings their accessor `flip`
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
