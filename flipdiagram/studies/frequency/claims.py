"""The claims C1–C14 of section III, each judged by measured numbers; pure functions of `Measured`.

A word of the paper becomes a number here, in the constants below.  Gains are ratios of peak amplitudes, those of
Figs 5 and 6 of the acceleration; phases come from the fundamental.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.laboratory import WITH_OBSERVER, Loop, Measured
from flipdiagram.studies.frequency.sweep import Response

PD, FF = ("pd", 0.0), ("pd+ff", 0.0)
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


Verdict = tuple[bool, dict[str, Any]]
"""Whether a claim holds, and the numbers that say so."""


def evaluate(measured: Measured) -> list[dict[str, Any]]:
    """C1 to C14 as the `claims` of summary.json.

    A claim about a loop that is unstable does not hold, and says which loop.
    """
    claims = []
    for name, judge in JUDGES.items():
        try:
            holds, numbers = judge(measured)
        except KeyError as missing:
            if (key := missing.args[0]) not in measured.unstable:
                raise
            holds, numbers = False, {"unstable": measured.unstable[key]}
        claims.append({"id": name, "claim": TEXTS[name], "holds": bool(holds), "measured": numbers})
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


def _bandwidths(responses: Mapping[Loop, Response], loops: Iterable[Loop]) -> list[float | None]:
    return [band(r.omega, acceleration_gain(r), HALF_POWER) for r in map(responses.__getitem__, loops)]


def _lag_bands(m: Measured, loops: Iterable[Loop]) -> list[float | None]:
    return [band(m.omega, phase(m.friction[loop]), -SMALL_LAG) for loop in loops]


def _ratio(m: Measured, wide: float | None, narrow: float | None) -> float:
    """Ratio of two bands; one that never ends in the range counts as the highest frequency measured."""
    highest = float(m.omega[-1])
    return (wide or highest) / (narrow or highest)


def _rises(values: Sequence[float]) -> bool:
    return all(b > (1 + NOTICEABLE) * a for a, b in pairwise(values))


def _paper(m: Measured) -> tuple[Loop, Loop, Loop, Loop]:
    """The four architectures with the g_dis of the settings."""
    g = m.settings.g_dis
    return PD, FF, ("pd+dob", g), ("pd+ff+dob", g)


def _cut_offs(m: Measured) -> list[float]:
    return sorted({m.settings.g_dis, *m.study.g_dis})


def _c1(m: Measured) -> Verdict:
    low, (ends,) = float(acceleration_gain(m.linear[PD])[0]), _bandwidths(m.linear, [PD])
    return abs(low - 1) < FOLLOWS and ends is not None, {"gain_at_lowest": low, "bandwidth_rad_s": ends}


def _c2(m: Measured) -> Verdict:
    pd, _, dob, _ = _bandwidths(m.linear, _paper(m))
    ratio = _ratio(m, dob, pd)
    return A_BIT[0] < ratio < A_BIT[1], {"pd_rad_s": pd, "pd+dob_rad_s": dob, "ratio": ratio}


def _widely(m: Measured, bands: Sequence[float | None]) -> Verdict:
    """Whether feed-forward widens the band without and with the observer; bands as of `_paper`."""
    pd, ff, dob, both = bands
    ratios = _ratio(m, ff, pd), _ratio(m, both, dob)
    numbers = {"pd_rad_s": pd, "pd+ff_rad_s": ff, "pd+dob_rad_s": dob, "pd+ff+dob_rad_s": both}
    return min(ratios) > WIDELY, numbers | {"ratio_without_dob": ratios[0], "ratio_with_dob": ratios[1]}


def _c3(m: Measured) -> Verdict:
    holds, numbers = _widely(m, _bandwidths(m.linear, _paper(m)))
    del numbers["pd_rad_s"], numbers["pd+dob_rad_s"]  # they are C2's
    return holds, numbers | {"highest_rad_s": float(m.omega[-1])}


def _c4(m: Measured) -> Verdict:
    gains, similar = {}, True
    rough, smooth = (_bandwidths(responses, _paper(m)) for responses in (m.friction, m.linear))
    for loop, *bandwidths in zip(_paper(m), rough, smooth, strict=True):
        low = [float(acceleration_gain(responses[loop])[0]) for responses in (m.friction, m.linear)]
        gains[loop[0]] = {"with_friction": low[0], "without": low[1]}
        similar &= abs(math.log(_ratio(m, *bandwidths))) < 0.1
    larger = all(gain["with_friction"] > (1 + NOTICEABLE) * gain["without"] for gain in gains.values())
    numbers = {"omega_rad_s": float(m.omega[0]), "gain_at_lowest": gains, "bandwidths_within_10_percent": similar}
    return larger and similar, numbers | {"friction_model": m.settings.friction_model}


def _c5(m: Measured) -> Verdict:
    pd, _, dob, _ = (m.linear[loop] for loop in _paper(m))
    ratio = dob.rms_error / pd.rms_error
    above = m.omega > m.settings.g_dis
    k = int(np.argmax(np.where(above, ratio, 0.0)))
    holds = ratio[0] < 1 - NOTICEABLE and ratio[k] > 1 + NOTICEABLE
    numbers = {"pd_at_lowest_m": float(pd.rms_error[0]), "pd+dob_at_lowest_m": float(dob.rms_error[0])}
    return holds, numbers | {"largest_ratio_above_g_dis": float(ratio[k]), "at_rad_s": float(m.omega[k])}


def _c6(m: Measured) -> Verdict:
    pd, ff, _, both = (m.linear[loop] for loop in _paper(m))
    ends = _bandwidths(m.linear, [PD])[0] or float(m.omega[-1])
    k = min(int(np.searchsorted(m.omega, 10 * ends)), len(m.omega) - 1)
    holds = ff.rms_error[0] > (1 + NOTICEABLE) * both.rms_error[0] and ff.rms_error[k] < 0.1 * pd.rms_error[k]
    numbers = {"pd+ff_at_lowest_m": float(ff.rms_error[0]), "pd+ff+dob_at_lowest_m": float(both.rms_error[0])}
    numbers |= {"high_rad_s": float(m.omega[k]), "pd+ff_at_high_m": float(ff.rms_error[k])}
    return holds, numbers | {"pd_at_high_m": float(pd.rms_error[k])}


def _c7(m: Measured) -> Verdict:
    bands = _lag_bands(m, [PD, *(("pd+dob", g) for g in _cut_offs(m))])
    numbers = {"lag_rad": SMALL_LAG, "g_dis_rad_s": [0.0, *_cut_offs(m)], "band_rad_s": bands}
    return _rises([value or float(m.omega[-1]) for value in bands]), numbers


def _c9(m: Measured) -> Verdict:
    leads = [phase(m.friction[loop]) for loop in _paper(m)]
    k = int(np.argmax(leads[3]))
    others = max(float(lead[k]) for lead in leads[:3])
    holds = leads[3][k] > NOTICEABLE and leads[3][k] > others and 0 < k < len(m.omega) - 1
    return holds, {"lead_rad": float(leads[3][k]), "at_rad_s": float(m.omega[k]), "others_there_rad": others}


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
    ratios = [float(np.max(m.noise["pd+dob", g].peak_x / m.noise[PD].peak_x)) for g in _cut_offs(m)]
    return _rises([1.0, *ratios]), {"g_dis_rad_s": _cut_offs(m), "largest_ratio_to_pd": ratios}


def _c14(m: Measured) -> Verdict:
    pairs = [(FF, PD)] + [(("pd+ff+dob", g), ("pd+dob", g)) for g in _cut_offs(m)]
    worst = max(float(np.max(np.abs(m.noise[a].peak_x / m.noise[b].peak_x - 1))) for a, b in pairs)
    return worst < SAME, {"largest_relative_difference": worst}


_JUDGES: tuple[Callable[[Measured], Verdict], ...] = (
    *(_c1, _c2, _c3, _c4, _c5, _c6, _c7),
    lambda m: _widely(m, _lag_bands(m, _paper(m))),
    _c9,
    lambda m: _moves(m, 0, -1),
    lambda m: _moves(m, 2, 1),
    *(_c12, _c13, _c14),
)
JUDGES = dict(zip(TEXTS, _JUDGES, strict=True))
