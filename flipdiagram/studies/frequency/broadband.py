"""Noise gain by spectra: white velocity noise in, position out, Welch's method."""

from typing import Any

import numpy as np
from scipy import signal

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.laboratory import Laboratory, Measured, closed_form

SEGMENT = 2**16
"""Samples of a segment: its length in seconds sets the lowest frequency, about 4 x 2 pi/length."""
PER_DECADE = 16
"""Bins a decade into which the spectral lines are averaged."""


def noise_gains(laboratory: Laboratory, measured: Measured) -> list[dict[str, Any]]:
    """The `broadband` entries: loops under white noise for the study's noise time, with the closed form beside them."""
    settings, study = laboratory.settings, laboratory.study
    ticks = max(round(study.noise_time / settings.step), SEGMENT)
    highest = min(max(study.frequencies()), 0.9 * np.pi / settings.step)
    entries = []
    for name, g in measured.noise:
        if name != "pd+ff+dob" or g == settings.g_dis:
            omega, gain, segments = gain_spectrum(*laboratory.broadband((name, g), ticks), settings.step, highest)
            entry = {"architecture": name, "g_dis_rad_s": g or None, "omega_rad_s": omega, "value": gain}
            theory = np.abs(closed_form(settings, (name, g)).noise(omega))
            entries.append(entry | {"theory": theory, "segments": segments})
    return entries


def gain_spectrum(noise: Floats, x: Floats, period: float, highest: float) -> tuple[Floats, Floats, int]:
    """Welch's estimate from samples of input and output, shape (N,), N >= SEGMENT, taken each period [s].

    Returns omega [rad/s], the gain [s] averaged over log-spaced bins, and the number of segments.  Per spectral line
    |S_nx| / S_nn, the part of x that is coherent with the noise; then the RMS of the lines in a bin.
    Lines below the fourth are left out, where the window smears the mean of x.
    """
    settings = {"fs": 1 / period, "nperseg": SEGMENT, "window": "hann", "detrend": "constant"}
    frequency, cross = signal.csd(noise, x, **settings)
    _, power = signal.welch(noise, **settings)
    omega, gain = 2 * np.pi * frequency, np.abs(cross) / power
    lowest = omega[4]
    count = max(2, round(PER_DECADE * np.log10(highest / lowest)))
    edges = np.geomspace(lowest, highest, count + 1)
    place = np.digitize(omega, edges) - 1
    bins = [i for i in range(count) if (place == i).any()]
    centre = np.array([np.exp(np.mean(np.log(omega[place == i]))) for i in bins])
    mean = np.array([np.sqrt(np.mean(gain[place == i] ** 2)) for i in bins])
    return centre, mean, 2 * len(noise) // SEGMENT - 1
