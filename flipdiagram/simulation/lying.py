"""How a pancake lies in the end: which face looks down, whether it is folded, how far from its target."""

from typing import NamedTuple

import numpy as np

from flipdiagram.simulation.deformation import doubled_normals
from flipdiagram.simulation.recording import Recording

TURNED = 0.5
"""Share of the former upper face that must look down: most of it."""
FOLDED = 0.02
"""Share of it that may look up without the pancake being folded: of a rim that stands."""
NEAR = 0.03
"""Distance [m] of its centre from the target that is near enough."""


class Lying(NamedTuple):
    """The last frame of a recording."""

    turned: float
    """Share of the former upper face that looks down."""
    steepest_rad: float
    """Largest angle between the downward vertical and the outward normal of a triangle of that face."""
    away_m: float
    """Of the centre from the target, in the plane of the table [m]."""

    @property
    def failure(self) -> str | None:
        """Why it does not lie as it should; None where it does."""
        up = 1 - self.turned
        if self.turned <= TURNED:
            return f"not turned, {100 * up:.0f} % of its upper face look up"
        if up > FOLDED:
            return f"folded, {100 * up:.0f} % of its upper face look up"
        return f"off target by {100 * self.away_m:.1f} cm" if self.away_m > NEAR else None


def lying(data: Recording) -> Lying:
    """How the pancake of a recording lies at its end."""
    normals = doubled_normals(data["vertices"].values[-1].astype(float), data["upper_face"].values)
    area = np.linalg.norm(normals, axis=1)
    down = -normals[:, 2] / area
    x, y = data["block_pose"].values[-1, 4:6]
    away = np.hypot(x - data["tool_pose"].values[0, 4], y - float(data.attrs["target_y_m"]))
    return Lying(float(area[down > 0].sum() / area.sum()), float(np.arccos(np.clip(down, -1, 1)).max()), float(away))
