"""Reinforcement learning: importing this registers `flipdiagram/TurnOver-v0` with Gymnasium, and loads no simulator."""

from flipdiagram.errors import InputError

try:
    from gymnasium import register
except ImportError:
    raise InputError("the environment needs Gymnasium: pip install 'flipdiagram[gym]'") from None

ID = "flipdiagram/TurnOver-v0"

register(ID, entry_point="flipdiagram.environment.turn_over:TurnOver")
