"""Section III as experiments: every loop compiled once, then driven by commands, noise and swept cut-offs."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import System

from flipdiagram.arrays import Complex, Floats
from flipdiagram.compiled import NotCompilable, compile_diagram
from flipdiagram.diagrams.one_dof import build_controller, build_experiment, build_open, theory
from flipdiagram.errors import SimulationError
from flipdiagram.scenario.one_dof import Frequency, OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.studies.frequency.periodicity import repetitions
from flipdiagram.studies.frequency.sweep import Response, Windows, measure, settling_ticks
from flipdiagram.theory.contact import GRAVITY_Z
from flipdiagram.theory.transfer import Loop1Dof, unstable

Loop = tuple[str, float]
"""Architecture (or the name of another controller), and g_dis [rad/s], 0 where it has none."""
Kind = Literal["linear", "friction", "noise"]
"""Driven by commands without friction or with it, or by velocity noise without friction."""
Factory = Callable[[OneDof], System]
"""Makes a controller for a loop with these settings: a new System at each call."""
WITH_OBSERVER = ("pd+dob", "pd+ff+dob")
ON_THE_CIRCLE = 1e-6
"""|z| − 1 from which a pole of a linearised controller counts as unstable; a switching one may have poles at 1."""


@dataclass(frozen=True)
class Measured:
    """What one set of settings gave: responses by loop, and the peak forces of Fig. 9 [N], shape (omega, g_dis)."""

    settings: OneDof
    study: Frequency
    linear: dict[Loop, Response] = field(default_factory=dict)
    friction: dict[Loop, Response] = field(default_factory=dict)
    noise: dict[Loop, Response] = field(default_factory=dict)
    torque_omega: Floats = field(default_factory=lambda: np.zeros(0))
    torque_g_dis: Floats = field(default_factory=lambda: np.zeros(0))
    torque: dict[str, Floats] = field(default_factory=dict)
    unstable: dict[Loop, str] = field(default_factory=dict)

    @property
    def kinds(self) -> dict[Kind, dict[Loop, Response]]:
        """The responses by what drove the loops."""
        return {"linear": self.linear, "friction": self.friction, "noise": self.noise}

    @property
    def omega(self) -> Floats:
        """The frequencies of all responses [rad/s]."""
        return np.asarray(self.study.frequencies(), dtype=float)


class Laboratory:
    """Loops with the same settings, compiled at first use.

    `steps` counts channel-steps; `sweep_steps` and `seconds` those of the sweeps, whose ratio is the speed measured.

    controllers: factories by name, by default the four architectures.
    lenient: an unstable loop is noted and left out, instead of raised as SimulationError.
    """

    def __init__(
        self,
        settings: OneDof,
        study: Frequency,
        controllers: Mapping[str, Factory] | None = None,
        *,
        lenient: bool = False,
    ) -> None:
        self.settings, self.study, self.lenient = settings, study, lenient
        self.controllers = dict(controllers or {name: partial(build_controller, name) for name in ARCHITECTURES})
        self.steps, self.sweep_steps, self.seconds = 0, 0, 0.0
        self.unstable: dict[Loop, str] = {}
        self._loops: dict[str, Any] = {}
        self._poles: dict[Loop, complex | None] = {}

    def loops(self, g_dis: Sequence[float]) -> list[Loop]:
        """Every controller; those with an observer once per g_dis."""
        return [(name, g) for name in self.controllers for g in (g_dis if name in WITH_OBSERVER else (0.0,))]

    def responses(self, loops: Sequence[Loop], omega: ArrayLike, kind: Kind = "linear") -> dict[Loop, Response]:
        """Responses to x_cmd = −sin ωt, with gravity, and for "friction" with the settings' friction.

        For "noise" those to v_noise = sin ωt of the study's amplitude, with x_cmd = 0, without friction.
        """
        responses: dict[Loop, Response] = {}
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        stable, study = self.stable(loops), self.study
        for name in dict.fromkeys(name for name, _ in stable):
            group = [loop for loop in stable if loop[0] == name]
            compiled, each = self.compiled(name), np.tile(w, len(group))
            settling = np.repeat([settling_ticks(self._pole(loop), self.settings.step) for loop in group], len(w))
            parameters = {key: np.repeat(value, len(w)) for key, value in self._parameters(group, kind).items()}
            begin = time.perf_counter()
            windows = Windows(compiled, each, parameters, settling, name=name)
            response = measure(windows, tolerance=study.tolerance, most_windows=study.most_windows)
            self.seconds += time.perf_counter() - begin
            self.steps, self.sweep_steps = self.steps + windows.steps, self.sweep_steps + windows.steps
            for i, loop in enumerate(group):
                responses[loop] = response.select(slice(i * len(w), (i + 1) * len(w)))
        return responses

    def repetitions(self, loop: Loop, response: Response, kind: Kind) -> list[dict[str, Any]]:
        """What the unsteady channels of a response do, in their order: one of `responses`."""
        unsteady = response.select(~response.steady)
        if not unsteady.omega.size:
            return []
        settling = settling_ticks(self._pole(loop), self.settings.step)
        parameters = self._parameters([loop], kind)
        channels = self.compiled(loop[0]), unsteady.omega, unsteady.ticks, parameters, settling
        verdicts, steps = repetitions(*channels, tolerance=self.study.tolerance, name=loop[0])
        self.steps += steps
        return verdicts

    def broadband(self, loop: Loop, ticks: int) -> tuple[Floats, Floats]:
        """(noise [m/s], x [m]), one sample a tick, under white velocity noise, x_cmd = 0, after 2 s."""
        compiled = self.compiled(loop[0])
        given = self._parameters([loop], "linear") | {"command.amplitude": 0.0}
        given["white_noise.rms"] = self.study.noise_amplitude
        first = compiled.run(math.ceil(2.0 / self.settings.step), parameters=given, threads=1)
        more: Any = {"log": ("white_noise", "x"), "threads": 1}
        run = compiled.run(ticks, parameters=given, state=first.final, start=first.ticks, **more)
        self.steps += int(run.ticks.sum())
        return run.log["white_noise"][0, :ticks, 0], run.log["x"][0, :ticks, 0]

    def compiled(self, name: str) -> Any:
        """The experiment of one controller as a native stepper; of another's that has no symbolic form, Drake's own."""
        if name not in self._loops:
            controller = self.controllers[name](self.settings)
            diagram = build_experiment(controller, self.settings, friction=True, seed=self.study.seed)
            diagram.set_name(name)
            names = [f"{box}.omega" for box in ("command", "noise", "lockin_x", "lockin_a")]
            self._loops[name] = compile_diagram(diagram, tie={"omega": names}, fallback=name not in ARCHITECTURES)
        return self._loops[name]

    def stable(self, loops: Sequence[Loop]) -> list[Loop]:
        """Those loops whose poles all decay; raises SimulationError for another unless lenient."""
        stable = []
        for loop in loops:
            try:
                self._pole(loop)
                stable.append(loop)
            except SimulationError as error:
                if not self.lenient:
                    raise
                self.unstable[loop] = str(error)
        return stable

    def _parameters(self, group: Sequence[Loop], kind: Kind) -> dict[str, Floats]:
        """Numeric parameters that differ between loops of one controller and experiments, one per loop."""
        friction, noise = float(kind == "friction"), float(kind == "noise")
        values = {
            "plant.f_c": friction * self.settings.coulomb,
            "plant.d": friction * self.settings.viscous,
            "command.amplitude": 1.0 - noise,
            "noise.amplitude": noise * self.study.noise_amplitude,
        }
        given = {name: np.full(len(group), value) for name, value in values.items()}
        if group[0][0] in WITH_OBSERVER:
            given["controller::disturbance_observer.0"] = np.array([g for _, g in group])
        return given

    def _pole(self, loop: Loop) -> complex | None:
        """The slowest pole s [rad/s]; None where a linearisation does not tell.  SimulationError if it grows."""
        if loop not in self._poles:
            name, g = loop
            if name in ARCHITECTURES:
                form = closed_form(self.settings, loop)
                form.check_stable(f"{name}, g_dis = {g:g}" if g else name)
                poles = form.poles()
            else:
                poles = _linear_poles(name, self.controllers[name](self.settings), self.settings)
            self._poles[loop] = complex(poles[np.argmax(poles.real)]) if poles.size else None
        return self._poles[loop]


def closed_form(settings: OneDof, loop: Loop) -> Loop1Dof:
    """The sampled closed form of an architecture with one g_dis [rad/s]."""
    name, g = loop
    return theory(name, settings.model_copy(update={"g_dis": g}) if g else settings)


def rms_error_theory(form: Loop1Dof, omega: ArrayLike) -> Floats:
    """RMS error of x [m] for x_cmd = −sin ωt under gravity: |X/X_cmd − 1|²/2 and the square of the mean."""
    mean = 0.0 if form.g_dis else form.mass * GRAVITY_Z / (form.reference_mass * form.k_p)
    return np.sqrt(np.abs(form.command(omega) - 1.0) ** 2 / 2 + mean**2)


def peak_force_theory(form: Loop1Dof, omega: ArrayLike) -> Floats:
    """Largest modulus of the force [N] for x_cmd = −sin ωt under gravity: m |g_z| + |F/X_cmd|."""
    return form.mass * abs(GRAVITY_Z) + np.abs(form.torque(omega))


def _linear_poles(name: str, controller: System, settings: OneDof) -> Complex:
    """Poles s [rad/s] of a loop linearised at rest; empty where poles on the circle leave the matter open."""
    try:
        compiled = compile_diagram(build_open(controller, settings), check=0)
    except NotCompilable:
        return np.zeros(0, dtype=complex)
    linear = compiled.linearize(inputs=dict.fromkeys(compiled.inputs, 0.0))
    z = np.asarray(linear.poles(), dtype=complex)
    worst = z[np.argmax(np.abs(z))]
    if abs(worst) > 1.0 + ON_THE_CIRCLE:
        raise SimulationError(unstable(name, complex(np.log(worst) / settings.step)))
    if abs(worst) > 1.0 - ON_THE_CIRCLE:
        return np.zeros(0, dtype=complex)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(z[np.abs(z) > 0]) / settings.step, dtype=complex)
