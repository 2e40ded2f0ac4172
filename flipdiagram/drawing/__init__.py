"""Drake Diagram → DOT, SVG, PNG, Mermaid and a table of sample times; ours and anyone's."""

from flipdiagram.drawing.drawing import Drawing, draw
from flipdiagram.drawing.rates import Port, Rate, RateTable, Timing

__all__ = ["Drawing", "Port", "Rate", "RateTable", "Timing", "draw"]
