"""The sections of a scenario for section III of the paper: the 1-DOF loop and its frequency study."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from flipdiagram.scenario.text import Section, invalid, quantity

Rate = Annotated[float, Field(ge=1e-4, le=1e6)]


class OneDof(Section):
    """Section III-A: mass, gains, friction, and how the observer is realised; (p) the paper, (o) our own choice."""

    mass: float = quantity(1.0, "kg", "moving mass m (p)", ge=0.001, le=10000)
    k_p: float = quantity(900.0, "1/s2", "position gain (p)", ge=0, le=1e8)
    k_v: float = quantity(60.0, "1/s", "velocity gain (p)", ge=0, le=1e6)
    g_dis: float = quantity(30.0, "rad/s", "cut-off of the disturbance observer (p)", ge=0.001, le=1e6)
    step: float = quantity(1e-4, "s", "sampling time of controller and plant (p)", ge=1e-7, le=0.1)
    coulomb: float = quantity(0.1, "N", "Coulomb friction f_c where there is friction (p)", ge=0, le=10000)
    viscous: float = quantity(0.1, "N s/m", "viscous friction d where there is friction (p)", ge=0, le=10000)
    friction_model: Literal["signum", "stick-slip"] = Field(
        "signum", description="-sgn(v) f_c - d v as the paper writes it, or with true sticking below f_c"
    )
    nominal_mass_ratio: float = quantity(
        0.5, "1", "r = m_n/m inside the observer; 1 leaves the command response as it is (o)", ge=0, le=100
    )
    reference_scaled_by_nominal_mass: bool = quantity(
        False, "1", "whether the reference force is m_n a_ref instead of m a_ref (o)"
    )
    velocity_cutoff: float | None = quantity(
        None, "rad/s", "g_v of the pseudo-derivative g_v s/(s + g_v); null: exact velocity (o)", ge=0.01, le=1e7
    )
    feedforward: Literal["command", "measured"] = Field(
        "command", description="acceleration fed forward: of the command, or measured (section I advises against it)"
    )
    acceleration_cutoff: float = quantity(
        60.0, "rad/s", "g_a of the measured acceleration g_a s/(s + g_a) v (o)", ge=0.01, le=1e7
    )

    @model_validator(mode="after")
    def _consistent(self) -> OneDof:
        most = 1e-3 * self.mass / self.step
        if self.viscous > most:
            raise invalid("viscous", self.viscous, f"at most 0.001 mass/step = {most:g} [N s/m]")
        if self.reference_scaled_by_nominal_mass and self.nominal_mass_ratio == 0:
            raise invalid("nominal_mass_ratio", 0.0, "above 0 where the reference force is scaled by m_n")
        return self


class Frequency(Section):
    """The study behind Figs 5-10: which frequencies, which cut-offs, and when a response counts as steady."""

    lowest: float = quantity(0.1, "rad/s", "lowest command frequency (p)", ge=0.0001, le=1e6)
    highest: float = quantity(5000.0, "rad/s", "highest command frequency (p)", ge=0.0001, le=1e6)
    count: int = quantity(64, "1", "frequencies, evenly spaced on a log axis (o)", ge=2, le=2000)
    omega: tuple[Rate, ...] | None = quantity(None, "rad/s", "the frequencies one by one instead", min_length=1)
    g_dis: tuple[Rate, ...] = quantity((10.0, 100.0), "rad/s", "further cut-offs in Figs 8 and 10 (o)", min_length=1)
    torque_omega: tuple[Rate, Rate, Rate] = quantity(
        (10.0, 30.0, 40.0), "rad/s", "command frequencies of Fig. 9: below, at and above g_dis (o)"
    )
    torque_g_dis: tuple[Rate, Rate] = quantity((3.0, 300.0), "rad/s", "range of cut-offs in Fig. 9 (o)")
    torque_count: int = quantity(21, "1", "cut-offs in Fig. 9, evenly spaced on a log axis", ge=2, le=1000)
    noise_amplitude: float = quantity(
        0.01, "m/s", "amplitude and RMS of the velocity noise in Fig. 10 (o)", ge=1e-9, le=1000
    )
    noise_time: float = quantity(100.0, "s", "length of the broadband noise in Fig. 10", ge=0.1, le=100000)
    seed: int = quantity(1, "1", "seed of the broadband noise", ge=1, le=2147483646)
    tolerance: float = quantity(
        1e-5, "1", "two successive windows that differ by less than this, relatively, are steady (o)", ge=1e-12, lt=1
    )
    most_windows: int = quantity(5, "1", "windows tried until two agree", ge=2, le=1000)

    @model_validator(mode="after")
    def _ranges(self) -> Frequency:
        if not self.lowest < self.highest:
            raise invalid("highest", self.highest, f"above frequency.lowest = {self.lowest:g} [rad/s]")
        if not self.torque_g_dis[0] < self.torque_g_dis[1]:
            raise invalid("torque_g_dis", self.torque_g_dis, "low and high with low < high [rad/s]")
        return self

    def frequencies(self) -> tuple[float, ...]:
        """The command frequencies [rad/s], rising."""
        if self.omega is not None:
            return tuple(sorted(set(self.omega)))
        return tuple(float(w) for w in np.geomspace(self.lowest, self.highest, self.count))


def check_nyquist(loop: OneDof, study: Frequency) -> None:
    """Raise a validator's error for a frequency at or above half the sampling rate, pi/step."""
    top = math.pi / loop.step
    for name, highest in (
        ("highest" if study.omega is None else "omega", max(study.frequencies())),
        ("torque_omega", max(study.torque_omega)),
    ):
        if highest >= top:
            valid = f"below the Nyquist frequency pi/one_dof.step = {top:g} [rad/s]"
            raise invalid(f"frequency.{name}", getattr(study, name), valid)
