"""Planning of the flip, section II-A of the paper: a quadratic program inside a search over the horizon."""

from flipdiagram.planning.plan import Plan
from flipdiagram.planning.planner import Planner, plan_motion

__all__ = ["Plan", "Planner", "plan_motion"]
