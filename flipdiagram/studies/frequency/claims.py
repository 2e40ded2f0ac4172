"""The claims C1–C14 of section III, each judged by measured numbers; pure functions of `Measured`.

A word of the paper becomes a number here, in the constants below.  Gains are ratios of peak amplitudes, those of
Figs 5 and 6 of the acceleration; phases come from the fundamental.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.laboratory import WITH_OBSERVER, Loop, Measured
from flipdiagram.studies.frequency.sweep import Response

HALF_POWER = math.sqrt(0.5)
"""Gain at which the bandwidth ends."""
FOLLOWS = 0.05
"""Largest deviation of a gain from 1 that counts as following."""
A_BIT = (1.02, 2.0)
"""Range of the ratio of bandwidths that counts as extended a bit (C2)."""
WIDELY = 2.0
"""Least ratio of bands that counts as extended widely (C3, C8)."""
SMALL_LAG = math.radians(10.0)
"""Phase lag up to which it counts as small (C7, C8) [rad]."""
NOTICEABLE = 0.01
"""Least relative difference that counts (C4, C5, C13), and least phase lead (C9) [rad]."""
LITTLE = 1e-3
"""Least relative change of a torque from end to end (C10, C11)."""
SAME = 1e-6
"""Largest relative difference of noise gains that count as the same (C14), and of a torque that does not move."""
TEXTS = {
    "C1": "PD alone follows the acceleration command at low frequency only",
    "C2": "adding the DOB extends the bandwidth a bit",
    "C3": "FF extends it widely",
    "C4": "friction: similar, but the gain is larger at low frequency",
    "C5": "the DOB reduces the RMSE at low frequency, enlarges it at high",
    "C6": "FF alone: larger RMSE at low frequency, kept at high frequency",
    "C7": "the band of small phase lag grows with the DOB and with g_dis",
    "C8": "FF extends that band widely",
    "C9": "FF and DOB together lead in the middle frequency range",
    "C10": "command slower than g_dis: maximum torque falls as g_dis rises",
    "C11": "command faster than g_dis: maximum torque rises with g_dis",
    "C12": "in all three panels the maximum torque is smaller with FF",
    "C13": "the DOB amplifies velocity noise, more so with higher g_dis",
    "C14": "FF does not change the noise gain",
}


@dataclass(frozen=True)
class Claim:
    """One row of the claims table: whether it holds, and the numbers that say so."""

    id: str
    holds: bool
    measured: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """The `claims` entry of summary.json."""
        return {"id": self.id, "claim": TEXTS[self.id], "holds": self.holds, "measured": self.measured}


def evaluate(measured: Measured) -> list[Claim]:
    """C1 to C14.  A claim about a loop that is unstable does not hold, and says which loop."""
    claims = []
    for name, judge in JUDGES.items():
        try:
            holds, numbers = judge(measured)
        except KeyError as missing:
            if (key := missing.args[0]) not in measured.unstable:
                raise
            holds, numbers = False, {"unstable": measured.unstable[key]}
        claims.append(Claim(name, bool(holds), numbers))
    return claims


def acceleration_gain(response: Response) -> Floats:
    """Peak acceleration over that of the command, ω² [1]."""
    return response.peak_a / response.omega**2


def phase(response: Response) -> Floats:
    """Phase of the fundamental of x against x_cmd = −sin ωt, unwrapped from low to high frequency [rad]."""
    return np.unwrap(np.angle(-response.x))


def band(omega: Floats, values: Floats, level: float) -> float | None:
    """Where values first fall below a level, log-interpolated in ω [rad/s]; None where they never do."""
    below = np.nonzero(values < level)[0]
    if not below.size:
        return None
    k = int(below[0])
    if k == 0:
        return float(omega[0])
    part = (values[k - 1] - level) / (values[k - 1] - values[k])
    return float(omega[k - 1] * (omega[k] / omega[k - 1]) ** part)


def _bandwidth(response: Response) -> float | None:
    return band(response.omega, acceleration_gain(response), HALF_POWER)


def _lag_band(response: Response) -> float | None:
    return band(response.omega, phase(response), -SMALL_LAG)


def _ratio(wide: float | None, narrow: float | None, highest: float) -> float:
    """Ratio of two bands; one that never ends in the range counts as the highest frequency measured."""
    return (wide or highest) / (narrow or highest)


def _paper(measured: Measured) -> tuple[Loop, Loop, Loop, Loop]:
    """The four architectures with the g_dis of the settings."""
    g = measured.settings.g_dis
    return ("pd", 0.0), ("pd+ff", 0.0), ("pd+dob", g), ("pd+ff+dob", g)


def _cut_offs(measured: Measured) -> list[float]:
    return sorted({measured.settings.g_dis, *measured.study.g_dis})


Verdict = tuple[bool, dict[str, Any]]


def _c1(m: Measured) -> Verdict:
    response = m.linear["pd", 0.0]
    low, ends = float(acceleration_gain(response)[0]), _bandwidth(response)
    return abs(low - 1) < FOLLOWS and ends is not None, {"gain_at_lowest": low, "bandwidth_rad_s": ends}


def _c2(m: Measured) -> Verdict:
    pd, _, dob, _ = (_bandwidth(m.linear[loop]) for loop in _paper(m))
    ratio = _ratio(dob, pd, float(m.linear["pd", 0.0].omega[-1]))
    return A_BIT[0] < ratio < A_BIT[1], {"pd_rad_s": pd, "pd+dob_rad_s": dob, "ratio": ratio}


def _c3(m: Measured) -> Verdict:
    highest = float(m.linear["pd", 0.0].omega[-1])
    pd, ff, dob, both = (_bandwidth(m.linear[loop]) for loop in _paper(m))
    ratios = _ratio(ff, pd, highest), _ratio(both, dob, highest)
    numbers = {"pd+ff_rad_s": ff, "pd+ff+dob_rad_s": both, "highest_rad_s": highest}
    return min(ratios) > WIDELY, numbers | {"ratio_without_dob": ratios[0], "ratio_with_dob": ratios[1]}


def _c4(m: Measured) -> Verdict:
    gains, similar = {}, True
    for loop in _paper(m):
        rough, smooth = m.friction[loop], m.linear[loop]
        low = float(acceleration_gain(rough)[0]), float(acceleration_gain(smooth)[0])
        gains[loop[0]] = {"with_friction": low[0], "without": low[1]}
        ratio = _ratio(_bandwidth(rough), _bandwidth(smooth), float(rough.omega[-1]))
        similar &= abs(math.log(ratio)) < 0.1
    larger = all(gain["with_friction"] > (1 + NOTICEABLE) * gain["without"] for gain in gains.values())
    omega = float(m.friction["pd", 0.0].omega[0])
    numbers = {"omega_rad_s": omega, "gain_at_lowest": gains, "bandwidths_within_10_percent": similar}
    return larger and similar, numbers | {"friction_model": m.settings.friction_model}


def _c5(m: Measured) -> Verdict:
    pd, _, dob, _ = (m.linear[loop] for loop in _paper(m))
    ratio = dob.rms_error / pd.rms_error
    above = pd.omega > m.settings.g_dis
    k = int(np.argmax(np.where(above, ratio, 0.0)))
    holds = ratio[0] < 1 - NOTICEABLE and ratio[k] > 1 + NOTICEABLE
    numbers = {"pd_at_lowest_m": float(pd.rms_error[0]), "pd+dob_at_lowest_m": float(dob.rms_error[0])}
    return holds, numbers | {"largest_ratio_above_g_dis": float(ratio[k]), "at_rad_s": float(pd.omega[k])}


def _c6(m: Measured) -> Verdict:
    pd, ff, _, both = (m.linear[loop] for loop in _paper(m))
    ends = _bandwidth(pd) or float(pd.omega[-1])
    k = min(int(np.searchsorted(pd.omega, 10 * ends)), len(pd.omega) - 1)
    holds = ff.rms_error[0] > (1 + NOTICEABLE) * both.rms_error[0] and ff.rms_error[k] < 0.1 * pd.rms_error[k]
    numbers = {"pd+ff_at_lowest_m": float(ff.rms_error[0]), "pd+ff+dob_at_lowest_m": float(both.rms_error[0])}
    numbers |= {"high_rad_s": float(pd.omega[k]), "pd+ff_at_high_m": float(ff.rms_error[k])}
    return holds, numbers | {"pd_at_high_m": float(pd.rms_error[k])}


def _c7(m: Measured) -> Verdict:
    bands = [_lag_band(m.friction["pd", 0.0])]
    bands += [_lag_band(m.friction["pd+dob", g]) for g in _cut_offs(m)]
    highest = float(m.friction["pd", 0.0].omega[-1])
    sizes = [value or highest for value in bands]
    holds = all(b > (1 + NOTICEABLE) * a for a, b in zip(sizes, sizes[1:], strict=False))
    return holds, {"lag_rad": SMALL_LAG, "g_dis_rad_s": [0.0, *_cut_offs(m)], "band_rad_s": bands}


def _c8(m: Measured) -> Verdict:
    highest = float(m.friction["pd", 0.0].omega[-1])
    pd, ff, dob, both = (_lag_band(m.friction[loop]) for loop in _paper(m))
    ratios = _ratio(ff, pd, highest), _ratio(both, dob, highest)
    numbers = {"pd_rad_s": pd, "pd+ff_rad_s": ff, "pd+dob_rad_s": dob, "pd+ff+dob_rad_s": both}
    return min(ratios) > WIDELY, numbers | {"ratio_without_dob": ratios[0], "ratio_with_dob": ratios[1]}


def _c9(m: Measured) -> Verdict:
    leads = [phase(m.friction[loop]) for loop in _paper(m)]
    k = int(np.argmax(leads[3]))
    omega = m.friction["pd", 0.0].omega
    others = max(float(lead[k]) for lead in leads[:3])
    holds = leads[3][k] > NOTICEABLE and leads[3][k] > others and 0 < k < len(omega) - 1
    return holds, {"lead_rad": float(leads[3][k]), "at_rad_s": float(omega[k]), "others_there_rad": others}


def _moves(m: Measured, panel: int, sense: int) -> Verdict:
    """Whether the torque of a panel moves one way over those g_dis that are above (below) its frequency."""
    omega, g = float(m.torque_omega[panel]), m.torque_g_dis
    numbers: dict[str, Any] = {"omega_rad_s": omega} | _unstable_cut_offs(m)
    holds = True
    for name in WITH_OBSERVER:
        on_that_side = (g >= omega if sense < 0 else g <= omega) & ~np.isnan(m.torque[name][panel])
        torque = m.torque[name][panel][on_that_side]
        if len(torque) < 2:
            return False, numbers | {"too_few_g_dis": [float(value) for value in g[on_that_side]]}
        numbers |= {"g_dis_rad_s": [float(g[on_that_side][0]), float(g[on_that_side][-1])]}
        numbers[f"{name}_N"] = [float(torque[0]), float(torque[-1])]
        steps = sense * np.diff(torque) / torque[:-1]
        holds &= bool((steps > -SAME).all() and sense * (torque[-1] - torque[0]) > LITTLE * torque[0])
    return holds, numbers


def _unstable_cut_offs(m: Measured) -> dict[str, Any]:
    missing = np.isnan(m.torque["pd+dob"][0]) | np.isnan(m.torque["pd+ff+dob"][0])
    return {"unstable_at_g_dis_rad_s": [float(g) for g in m.torque_g_dis[missing]]} if missing.any() else {}


def _c12(m: Measured) -> Verdict:
    ratios = {}
    for panel, omega in enumerate(m.torque_omega):
        pairs = (("pd+ff", "pd"), ("pd+ff+dob", "pd+dob"))
        both = [np.nanmax(m.torque[a][panel] / m.torque[b][panel]) for a, b in pairs]
        ratios[f"{omega:g}"] = float(max(both))
    in_panels = list(ratios.values())[:3]
    numbers = {"largest_ratio_by_omega_rad_s": ratios, "smaller_below_rad_s": math.sqrt(2 * m.settings.k_p)}
    return all(ratio < 1 for ratio in in_panels), numbers | _unstable_cut_offs(m)


def _c13(m: Measured) -> Verdict:
    gain = {loop: response.peak_x for loop, response in m.noise.items()}
    ratios = [float(np.max(m.noise["pd+dob", g].peak_x / gain["pd", 0.0])) for g in _cut_offs(m)]
    rising = all(b > (1 + NOTICEABLE) * a for a, b in zip(ratios, ratios[1:], strict=False))
    return rising and ratios[0] > 1 + NOTICEABLE, {"g_dis_rad_s": _cut_offs(m), "largest_ratio_to_pd": ratios}


def _c14(m: Measured) -> Verdict:
    pairs = [(("pd+ff", 0.0), ("pd", 0.0))] + [(("pd+ff+dob", g), ("pd+dob", g)) for g in _cut_offs(m)]
    worst = max(float(np.max(np.abs(m.noise[a].peak_x / m.noise[b].peak_x - 1))) for a, b in pairs)
    return worst < SAME, {"largest_relative_difference": worst}


JUDGES: dict[str, Callable[[Measured], Verdict]] = {
    "C1": _c1,
    "C2": _c2,
    "C3": _c3,
    "C4": _c4,
    "C5": _c5,
    "C6": _c6,
    "C7": _c7,
    "C8": _c8,
    "C9": _c9,
    "C10": lambda m: _moves(m, 0, -1),
    "C11": lambda m: _moves(m, 2, 1),
    "C12": _c12,
    "C13": _c13,
    "C14": _c14,
}
