"""The 1-DOF loop of section III in closed form, continuous and as sampled; pure functions of numbers.

Both forms are one set of formulas in a variable γ: γ = s for the continuous loop, γ = (z − 1)/T for the loop that the
discrete blocks make with a zero-order hold of T seconds, z = e^{jωT}.  Derived by hand, block by block:

    plant       m ẍ = f + f_d, force held over T      X = (1 + γT/2)/(m γ²) (F + F_d),   V = (F + F_d)/(m γ)
    velocity    measured exactly                      V̂ = H X + N,  H = γ/(1 + γT/2)
                or pseudo-derivative of x             H = G_v γ/(γ + G_v),  G_v = (1 − e^{−g_v T})/T
    PD and FF   A_ref = k_p (X_cmd − X) + k_v (V_cmd − V̂) + A_cmd, or with feed-forward of measured acceleration
                + D_a V̂ in the place of A_cmd,        D_a = G_a γ/(γ + G_a)
    reference   F_ref = m_ref A_ref,                  m_ref = m, or m_n where the reference is scaled by m_n
    observer    w[k+1] = e^{−gT} w[k] + (1 − e^{−gT}) (f[k] + g m_n v̂[k]),  f = f_ref + w − g m_n v̂, hence
                F = K F_ref − g m_n V̂,                K = (γ + G)/γ,  G = (1 − e^{−gT})/T;  K = 1, g = 0 without

    Δ(γ) = m γ²/(1 + γT/2) + m_ref K [k_p + (k_v − D_a) H] + g m_n H
    X/X_cmd = m_ref K (k_p + jω k_v − ω²)/Δ           (− ω² with FF of the command only; eqs. (13)–(15))
    X/N = −[m_ref K (k_v − D_a) + g m_n]/Δ,           X/F_d = 1/Δ,           F = m γ²/(1 + γT/2) X − F_d

With T → 0, m_ref = m and r = m_n/m this is the known
x/x_cmd = (1 + g/s)(k_v s + k_p + s²)/(s² + g r s + (1 + g/s)(k_v s + k_p)): for r = 1 the observer cancels, whatever
its g_dis.  FF lowers |F/X_cmd| just where |k_p − ω² + jω k_v| < |k_p + jω k_v|, for ω < √(2 k_p), whatever the
observer.  Friction is not part of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from flipdiagram.arrays import Complex
from flipdiagram.errors import InputError, SimulationError


@dataclass(frozen=True)
class Loop1Dof:
    """One architecture with one realisation of its observer, as numbers; InputError for a bad one."""

    mass: float  # m [kg]
    k_p: float  # [1/s²]
    k_v: float  # [1/s]
    g_dis: float  # [rad/s], 0 without the observer
    nominal_mass: float  # m_n in the observer [kg]
    reference_mass: float  # m_ref [kg]
    velocity_cutoff: float | None = None  # g_v [rad/s]; None: measured exactly
    feedforward: Literal["none", "command", "measured"] = "none"  # of the acceleration
    acceleration_cutoff: float = math.inf  # g_a of the measured acceleration [rad/s]
    period: float = 0.0  # T [s], 0 for the continuous loop

    def __post_init__(self) -> None:
        above = ("mass", "reference_mass", *(["acceleration_cutoff"] if self.feedforward == "measured" else []))
        for name in (*above, "k_p", "k_v", "g_dis", "nominal_mass", "period"):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0 or (value == 0 and name in above):
                raise InputError.of(name, value, f"finite and {'above 0' if name in above else 'at least 0'}")

    def command(self, omega: ArrayLike) -> Complex:
        """X/X_cmd at ω [rad/s], any shape: position response to x_cmd = −sin ωt with its v_cmd and a_cmd."""
        terms = self._terms(omega)
        w = np.asarray(omega, dtype=float)
        forward = self.k_p + 1j * w * self.k_v - (w**2 if self.feedforward == "command" else 0.0)
        return np.asarray(self.reference_mass * terms.K * forward / terms.delta, dtype=complex)

    def acceleration(self, omega: ArrayLike) -> Complex:
        """A/A_cmd at ω: A is the mean acceleration over each step, a[k] = (v[k+1] − v[k])/T, A_cmd = −ω² X_cmd."""
        inertial = self._terms(omega).inertial / self.mass
        ratio = inertial / -(np.asarray(omega, dtype=float) ** 2)
        return np.asarray(self.command(omega) * ratio, dtype=complex)

    def noise(self, omega: ArrayLike) -> Complex:
        """X/V_noise at ω [s]: velocity noise enters the PD and the observer (Fig. 10)."""
        terms = self._terms(omega)
        feedback = self.reference_mass * terms.K * (self.k_v - terms.D_a) + self.g_dis * self.nominal_mass
        return -feedback / terms.delta

    def disturbance(self, omega: ArrayLike) -> Complex:
        """X/F_d at ω [m/N]."""
        return 1.0 / self._terms(omega).delta

    def torque(self, omega: ArrayLike) -> Complex:
        """F/X_cmd at ω [N/m]: the force that the actuator delivers, about its mean."""
        return self._terms(omega).inertial * self.command(omega)

    def poles(self) -> Complex:
        """Poles as s [rad/s], z = e^{sT} for the sampled loop; roots of Δ with its denominators multiplied out."""
        gamma, T = Polynomial([0.0, 1.0]), self.period
        (n_K, d_K), (n_H, d_H), (n_D, d_D) = self._fractions(gamma)
        inertial = self.mass * gamma**2 * d_K * d_D
        feedback = self.reference_mass * n_K * (self.k_p * d_H * d_D + (self.k_v * d_D - n_D) * n_H)
        feedback = feedback + self.g_dis * self.nominal_mass * n_H * d_K * d_D
        # 1 + γT/2 of the inertial term is the denominator of H where the velocity is measured exactly, else one more
        total = inertial + feedback if self.velocity_cutoff is None else inertial * d_H + feedback * (1 + gamma * T / 2)
        roots = np.asarray(total.trim(0.0).roots(), dtype=complex)
        return roots if T == 0.0 else np.asarray(np.log(1.0 + T * roots) / T, dtype=complex)

    def check_stable(self, name: str) -> None:
        """Raise SimulationError, naming the loop and its worst pole, unless all poles decay."""
        poles = self.poles()
        worst = poles[np.argmax(poles.real)]
        if worst.real >= 0:
            raise SimulationError(unstable(name, complex(worst)))

    def _terms(self, omega: ArrayLike) -> _Terms:
        w, T = np.asarray(omega, dtype=float), self.period
        if not (np.isfinite(w) & (w > 0)).all() or (T > 0 and (w >= math.pi / T).any()):
            top = f" and below π/T = {math.pi / T:.6g}" if T > 0 else ""
            raise InputError.of("omega", w.tolist(), f"finite, above 0{top} [rad/s]")
        gamma: Any = 1j * w if T == 0.0 else np.expm1(1j * w * T) / T
        K, H, D_a = (numerator / denominator for numerator, denominator in self._fractions(gamma))
        inertial = self.mass * gamma**2 / (1.0 + gamma * T / 2)
        feedback = self.reference_mass * K * (self.k_p + (self.k_v - D_a) * H)
        return _Terms(K, D_a, inertial, inertial + feedback + self.g_dis * self.nominal_mass * H)

    def _fractions(self, gamma: Any) -> tuple[tuple[Any, Any], ...]:
        """Numerator and denominator of K, H and D_a, of γ as numbers or as a polynomial."""
        T = self.period

        def derivative(g: float) -> tuple[Any, Any]:
            G = _cutoff(g, T)
            return G * gamma, gamma + G

        K = (gamma + _cutoff(self.g_dis, T), gamma) if self.g_dis else (1.0, 1.0)
        H = (gamma, 1.0 + gamma * T / 2) if self.velocity_cutoff is None else derivative(self.velocity_cutoff)
        D_a = derivative(self.acceleration_cutoff) if self.feedforward == "measured" else (0.0, 1.0)
        return K, H, D_a


def unstable(name: str, pole: complex) -> str:
    """The message for a loop with a pole s [rad/s] that does not decay."""
    imaginary = f" ± {abs(pole.imag):.4g}j" if abs(pole.imag) > 1e-9 * abs(pole) else ""
    return f"the loop '{name}' is unstable: pole at s = {pole.real:.4g}{imaginary} rad/s"


@dataclass(frozen=True)
class _Terms:
    K: Complex
    D_a: Complex
    inertial: Complex
    delta: Complex


def _cutoff(g: float, T: float) -> float:
    """G = (1 − e^{−gT})/T, g itself for T = 0."""
    return g if T == 0.0 else -math.expm1(-g * T) / T
