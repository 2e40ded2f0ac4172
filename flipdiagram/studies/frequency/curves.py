"""The curves of Figs 5–10 as entries of summary.json, with the closed form beside each linear one."""

from __future__ import annotations

from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.claims import acceleration_gain, phase
from flipdiagram.studies.frequency.laboratory import Loop, Measured, peak_force_theory, rms_error_theory
from flipdiagram.studies.frequency.sweep import Response

PANELS = ("9a", "9b", "9c")


def curves_of(measured: Measured) -> list[dict[str, Any]]:
    """The `curves` entries: Figs 5, 6, 7, 8a, 8b and 10."""
    g_paper = measured.settings.g_dis
    entries = []
    for friction, responses in ((False, measured.linear), (True, measured.friction)):
        for loop, response in responses.items():
            form = measured.theory(loop)
            omega = response.omega
            if loop[1] in (0.0, g_paper):
                gain, exact = acceleration_gain(response), np.abs(form.acceleration(omega))
                fundamental = {"fundamental": np.abs(response.a) / omega**2}
                number = "6" if friction else "5"
                entries.append(_entry(number, loop, friction, response, gain, exact, "1", fundamental))
                error = rms_error_theory(form, omega)
                entries.append(_entry("7", loop, friction, response, response.rms_error, error, "m"))
            number = "8b" if "ff" in loop[0] else "8a"
            angle = np.unwrap(np.angle(form.command(omega)))
            entries.append(_entry(number, loop, friction, response, phase(response), angle, "rad"))
    for loop, response in measured.noise.items():
        amplitude, exact = measured.study.noise_amplitude, np.abs(measured.theory(loop).noise(response.omega))
        fundamental = {"fundamental": np.abs(response.x) / amplitude}
        entries.append(_entry("10", loop, False, response, response.peak_x / amplitude, exact, "s", fundamental))
    return sorted(entries, key=lambda entry: (int(entry["figure"].rstrip("ab")), entry["figure"]))


def friction_curves(measured: Measured) -> list[dict[str, Any]]:
    """Entries as of Fig. 6 for the responses with friction alone, those of another friction model."""
    entries = []
    for loop, response in measured.friction.items():
        gain, fundamental = acceleration_gain(response), {"fundamental": np.abs(response.a) / response.omega**2}
        entries.append(_entry("6", loop, True, response, gain, gain, "1", fundamental))
    return entries


def torque_of(measured: Measured) -> list[dict[str, Any]]:
    """The `torque` entries: Fig. 9, three frequencies; an architecture without observer repeats its one value."""
    entries = []
    for panel, figure in enumerate(PANELS):
        omega = float(measured.torque_omega[panel])
        for name, torque in measured.torque.items():
            values = np.broadcast_to(torque[panel], measured.torque_g_dis.shape)
            exact = [
                float(peak_force_theory(measured.theory((name, g if "dob" in name else 0.0)), omega))
                for g in measured.torque_g_dis
            ]
            entry = {"figure": figure, "omega_rad_s": omega, "architecture": name}
            entries.append(
                entry | {"g_dis_rad_s": measured.torque_g_dis, "max_torque_N": values.copy(), "theory": exact}
            )
    return entries


def _entry(
    figure: str,
    loop: Loop,
    friction: bool,
    response: Response,
    value: Floats,
    theory: Floats,
    unit: str,
    more: dict[str, Any] | None = None,
) -> dict[str, Any]:
    return {
        "figure": figure,
        "architecture": loop[0],
        "g_dis_rad_s": loop[1] or None,
        "friction": friction,
        "unit": unit,
        "omega_rad_s": response.omega,
        "value": value,
        "theory": None if friction else theory,
    } | (more or {})
