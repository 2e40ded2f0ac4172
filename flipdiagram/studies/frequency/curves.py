"""The curves of Figs 5–10 as entries of summary.json, with the closed form beside each linear one."""

from typing import Any

import numpy as np

from flipdiagram.arrays import Floats
from flipdiagram.studies.frequency.claims import acceleration_gain, phase
from flipdiagram.studies.frequency.laboratory import Loop, Measured, closed_form, peak_force_theory, rms_error_theory
from flipdiagram.studies.frequency.sweep import Response


def curves_of(measured: Measured) -> list[dict[str, Any]]:
    """The `curves` entries: Figs 5, 6, 7, 8a, 8b and 10."""
    g_paper = measured.settings.g_dis
    entries = []
    for friction, responses in ((False, measured.linear), (True, measured.friction)):
        for loop, response in responses.items():
            form, omega = closed_form(measured.settings, loop), response.omega
            if loop[1] in (0.0, g_paper):
                entries.append(_gain(measured, loop, friction))
                exact = rms_error_theory(form, omega)
                entries.append(_entry("7", loop, response, response.rms_error, "m", None if friction else exact))
            number = "8b" if "ff" in loop[0] else "8a"
            exact = np.unwrap(np.angle(form.command(omega)))
            entries.append(_entry(number, loop, response, phase(response), "rad", None if friction else exact))
    for loop, response in measured.noise.items():
        amplitude = measured.study.noise_amplitude
        exact = np.abs(closed_form(measured.settings, loop).noise(response.omega))
        entry = _entry("10", loop, response, response.peak_x / amplitude, "s", exact)
        entries.append(entry | {"fundamental": np.abs(response.x) / amplitude})
    return sorted(entries, key=lambda entry: (int(entry["figure"].rstrip("ab")), entry["figure"]))


def friction_curves(measured: Measured) -> list[dict[str, Any]]:
    """Entries as of Fig. 6 for the responses with friction alone, those of another friction model."""
    return [_gain(measured, loop, friction=True) for loop in measured.friction]


def torque_of(measured: Measured) -> list[dict[str, Any]]:
    """The `torque` entries: Fig. 9, three frequencies; an architecture without observer repeats its one value."""
    entries = []
    for panel, figure in enumerate(("9a", "9b", "9c")):
        omega = float(measured.torque_omega[panel])
        for name, torque in measured.torque.items():
            values = np.broadcast_to(torque[panel], measured.torque_g_dis.shape)
            loops = [(name, g if "dob" in name else 0.0) for g in measured.torque_g_dis]
            exact = [float(peak_force_theory(closed_form(measured.settings, loop), omega)) for loop in loops]
            entry = {"figure": figure, "omega_rad_s": omega, "architecture": name, "g_dis_rad_s": measured.torque_g_dis}
            entries.append(entry | {"max_torque_N": values, "theory": exact})
    return entries


def _gain(measured: Measured, loop: Loop, friction: bool) -> dict[str, Any]:
    """The entry of Fig. 5 or, with friction, 6."""
    response = (measured.friction if friction else measured.linear)[loop]
    exact = None if friction else np.abs(closed_form(measured.settings, loop).acceleration(response.omega))
    entry = _entry("6" if friction else "5", loop, response, acceleration_gain(response), "1", exact)
    return entry | {"fundamental": np.abs(response.a) / response.omega**2}


def _entry(
    figure: str, loop: Loop, response: Response, value: Floats, unit: str, theory: Floats | None
) -> dict[str, Any]:
    """An entry; theory: the closed form, None for a loop with friction."""
    return {
        "figure": figure,
        "architecture": loop[0],
        "g_dis_rad_s": loop[1] or None,
        "friction": theory is None,
        "unit": unit,
        "omega_rad_s": response.omega,
        "value": value,
        "theory": theory,
    }
