"""Noise gain by spectra: white velocity noise in, position out, Welch's method."""

import numpy as np
from scipy import signal

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.laboratory import Laboratory, Loop

SEGMENT = 2**16
"""Samples of a segment: its length in seconds sets the lowest frequency, about 4 x 2 pi/length."""
PER_DECADE = 16
"""Bins a decade into which the spectral lines are averaged."""


Spectrum = tuple[Floats, Floats, int]
"""omega [rad/s], the gain |S_nx / S_nn| [s] of velocity noise to position averaged over log-spaced bins, segments."""


def noise_spectrum(laboratory: Laboratory, loop: Loop) -> Spectrum:
    """Drive a loop with white noise for the study's noise time and estimate its gain."""
    settings, study = laboratory.settings, laboratory.study
    ticks = max(round(study.noise_time / settings.step), SEGMENT)
    noise, x = laboratory.broadband(loop, ticks)
    highest = min(max(study.frequencies()), 0.9 * np.pi / settings.step)
    return gain_spectrum(noise, x, settings.step, highest)


def gain_spectrum(noise: Floats, x: Floats, period: float, highest: float) -> Spectrum:
    """Welch's estimate from samples of input and output, shape (N,), N >= SEGMENT, taken each period [s].

    Per spectral line |S_nx| / S_nn, the part of x that is coherent with the noise; then the RMS of the lines in a bin.
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
