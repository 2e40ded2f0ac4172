"""Poles of a sampled loop as people read them: in z, and as frequency and damping of the motion between samples."""

import math
from dataclasses import dataclass

import numpy as np

from flipdiagram.arrays import Complex

SAME = 1e-6
"""Distance in z below which poles are listed as one."""
GONE = 1e-3
"""|z| below which a motion is gone after one sample: that of a delay, whose z = 0 is found to some digits only."""


@dataclass(frozen=True)
class Pole:
    """One pole z, or a pair z, z* by that with Im z >= 0, sampled every `period` [s]; `count` such poles or pairs."""

    z: complex
    period: float
    count: int = 1

    @property
    def s(self) -> complex | None:
        """ln(z)/T [rad/s], None where the motion is gone after one sample."""
        if abs(self.z) < GONE:
            return None
        return complex(math.log(abs(self.z)), np.angle(self.z)) / self.period

    @property
    def omega(self) -> float | None:
        """Natural frequency |s| [rad/s]."""
        return None if self.s is None else abs(self.s)

    @property
    def damping(self) -> float | None:
        """Damping ratio -Re s/|s| [1]; None at z = 1, where nothing moves."""
        return None if not self.omega or self.s is None else -self.s.real / self.omega

    @property
    def stable(self) -> bool:
        """Whether the motion decays."""
        return abs(self.z) < 1.0


def listed(z: Complex, period: float) -> list[Pole]:
    """The poles z (n,) of a real system sampled every `period` [s], slowest first, pairs and equal ones once."""
    upper = sorted((complex(pole) for pole in z if pole.imag >= -SAME), key=lambda pole: (-abs(pole), pole.imag))
    groups: list[list[complex]] = []
    for pole in upper:
        pole = complex(pole.real, pole.imag if pole.imag > SAME else 0.0)
        if groups and (abs(pole - groups[-1][0]) < SAME or max(abs(pole), abs(groups[-1][0])) < GONE):
            groups[-1].append(pole)
        else:
            groups.append([pole])
    return [Pole(group[0], period, len(group)) for group in groups]
