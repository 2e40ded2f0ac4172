"""Any Drake Diagram of sampled, scalar-convertible blocks as a native loop over many channels.

``compile_diagram`` flattens a diagram (``structure``), names its vectors (``layout``), reads each block's update and
outputs through its symbolic form (``read``) into one graph without repeated subexpressions (``graph``), prints that
(``printer``) and compiles it (``kernel``). The result runs batches (``batch``), and
knows its derivatives (``linear``).
"""

from flipdiagram.compiled.batch import BatchDiagram, Run
from flipdiagram.compiled.diagram import CompiledDiagram, SlowWarning, compile_diagram
from flipdiagram.compiled.fallback import SimulatedDiagram
from flipdiagram.compiled.linear import Linearization
from flipdiagram.errors import NotCompilable

__all__ = [
    "BatchDiagram",
    "CompiledDiagram",
    "Linearization",
    "NotCompilable",
    "Run",
    "SimulatedDiagram",
    "SlowWarning",
    "compile_diagram",
]
