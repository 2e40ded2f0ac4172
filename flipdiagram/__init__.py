"""A robot arm turns a block over on a spatula: acceleration control as a block diagram in Drake.

    from flipdiagram import Scenario, build_loop, measure, simulate

    flip = simulate(Scenario(), "pd+ff+dob")
    print(measure(flip.recording).success, flip.recording["x"])

Every name is loaded at its first use, so that importing the package, and the command line, start at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flipdiagram.compiled import CompiledDiagram, compile_diagram
    from flipdiagram.diagrams.controller import build_controller
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
    from flipdiagram.files import __version__ as __version__
    from flipdiagram.planning import Plan, plan_motion
    from flipdiagram.results.comparison import Comparison, compare
    from flipdiagram.results.info import info
    from flipdiagram.results.opening import open_result
    from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, load
    from flipdiagram.simulation.metrics import FlipMetrics, measure
    from flipdiagram.simulation.simulate import Run, simulate, simulate_loop

__all__ = [
    "ARCHITECTURES",
    "Comparison",
    "CompiledDiagram",
    "Drawing",
    "FlipMetrics",
    "FlipdiagramError",
    "InputError",
    "Loop",
    "MissingProgramError",
    "Plan",
    "PlanningError",
    "Run",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "build_controller",
    "build_loop",
    "compare",
    "compile_diagram",
    "draw",
    "info",
    "load",
    "measure",
    "open_result",
    "plan_motion",
    "simulate",
    "simulate_loop",
]

_ROOMS = {
    "compiled": ("CompiledDiagram", "compile_diagram"),
    "diagrams.controller": ("build_controller",),
    "diagrams.loop": ("Loop", "build_loop"),
    "drawing": ("Drawing", "draw"),
    "files": ("__version__",),
    "planning": ("Plan", "plan_motion"),
    "results": ("Comparison", "compare", "info", "open_result"),
    "scenario.scenario": ("ARCHITECTURES", "Scenario", "load"),
    "simulation.metrics": ("FlipMetrics", "measure"),
    "simulation.simulate": ("Run", "simulate", "simulate_loop"),
}
_HOMES = dict.fromkeys((name for name in __all__ if name.endswith("Error")), "flipdiagram.errors")
_HOMES |= {name: f"flipdiagram.{room}" for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name from its room (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'flipdiagram' has no attribute '{name}'")
    if name in ("simulate", "simulate_loop"):
        import_module("flipdiagram.results")  # gives recordings their accessor `flip`
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
