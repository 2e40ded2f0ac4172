"""How far a pancake bent in a flip, and how it lay in the end: numbers of its recording."""

import numpy as np

from flipdiagram.simulation.deformation import bends
from flipdiagram.simulation.events import release_index
from flipdiagram.simulation.lying import lying
from flipdiagram.simulation.recording import Recording


def bending(data: Recording) -> dict[str, float] | None:
    """What a recording tells of a pancake's shape; None where the object is rigid.

    The largest elastic energy [J] of the flip; the largest share of the lower face beyond the blade's edges while it
    is carried, nan where it never touches the blade; at the end the share of the former upper face that looks down,
    the centre [m] and its distance [m] from the target.
    """
    if not bends(data):
        return None
    released = data["time"].values[release_index(data)]
    carried = (data["frame_time"].values >= 0) & (data["frame_time"].values <= released)
    over = data["overhang"].values[carried]
    lies, (x, y) = lying(data), data["block_pose"].values[-1, 4:6]
    return {
        "largest_deformation_energy_J": float(data["deformation_energy"].max()),
        "largest_overhang": float(np.nanmax(over)) if np.isfinite(over).any() else float("nan"),
        "turned_share": lies.turned,
        "final_x_m": float(x),
        "final_y_m": float(y),
        "away_m": lies.away_m,
    }
