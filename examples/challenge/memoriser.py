"""Not a controller but a warning: it knows the public worlds by their starts, and looks up what works there.

Every start of the public suites is another number, and an entry is told it.  `memorise.py` reads from the stored
results of other entries which of them turned the block over in which public world, and writes the table beside this
file.  In a public world this entry flies as the best of them did; in one that it does not know, as `computed_torque`.
"""

import importlib.util
import json
from pathlib import Path

from flipdiagram import plan_motion

NAME = "memoriser"
AUTHOR = "flipdiagram"
REFERENCE = "none: it looks up the answers; what it gains is what tuning to the public worlds can gain at most"
FOLDER = Path(__file__).parent
OTHERWISE = "computed_torque"
TABLE = json.loads((FOLDER / "memoriser.json").read_text(encoding="utf-8"))


def chosen(scenario):
    """The entry that flies from a start, as a module."""
    name = TABLE.get(str(scenario.task.start_y), OTHERWISE)
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def plan(scenario):
    """The motion that the chosen one flies."""
    return plan_motion(scenario.with_overrides(chosen(scenario).SETTINGS))


def reset(memory):
    """Let the chosen one fill its memory."""
    memory["chosen"] = chosen(memory["scenario"])
    getattr(memory["chosen"], "reset", lambda memory: None)(memory)


def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):
    """What the chosen one does."""
    return memory["chosen"].control(t, x_cmd, v_cmd, a_cmd, q, qd, memory)
