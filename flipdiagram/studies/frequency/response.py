"""The frequency response of one controller, of the paper's or of one's own, measured in the loop of section III."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from pydrake.systems.framework import System

from flipdiagram.arrays import Complex, Floats
from flipdiagram.diagrams.controller import check_architecture
from flipdiagram.diagrams.one_dof import build_controller
from flipdiagram.errors import InputError
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario
from flipdiagram.studies.frequency.claims import acceleration_gain, phase
from flipdiagram.studies.frequency.laboratory import Factory, Laboratory
from flipdiagram.studies.frequency.sweep import Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class FrequencyResponse:
    """How the loop with one controller follows x_cmd = −sin ωt; every array has the shape (n,), n frequencies.

    name: of the controller.  friction: whether the mass has the friction of `scenario.one_dof`.  measured: what the
    meters read.
    """

    name: str
    friction: bool
    measured: Response

    @property
    def omega(self) -> Floats:
        """Frequencies of the command [rad/s], rising."""
        return self.measured.omega

    @property
    def response(self) -> Complex:
        """X / X_cmd of the fundamental, complex [1]."""
        return -self.measured.x

    @property
    def gain(self) -> Floats:
        """|X / X_cmd| of the fundamental [1]."""
        return np.abs(self.response)

    @property
    def phase(self) -> Floats:
        """Phase of the fundamental of x against x_cmd, unwrapped over ω [rad]; negative where it lags."""
        return phase(self.measured)

    @property
    def acceleration_gain(self) -> Floats:
        """Peak acceleration over that of the command [1]: Figs 5 and 6."""
        return acceleration_gain(self.measured)

    @property
    def rms_error(self) -> Floats:
        """RMS of x − x_cmd for a command of 1 m, gravity's offset included [m]: Fig. 7."""
        return self.measured.rms_error

    @property
    def max_force(self) -> Floats:
        """Largest force of the controller [N]: Fig. 9."""
        return self.measured.peak_force

    @property
    def steady(self) -> np.ndarray:
        """Whether two successive windows agreed; where not, the numbers are those of the last."""
        return self.measured.steady

    def to_dataset(self) -> xr.Dataset:
        """All of it over `omega`, with units."""
        units = {
            "gain": "1",
            "phase": "rad",
            "acceleration_gain": "1",
            "rms_error": "m",
            "max_force": "N",
            "steady": "1",
        }
        variables: dict[str, Any] = {name: ("omega", getattr(self, name), {"units": u}) for name, u in units.items()}
        coordinates = {"omega": ("omega", self.omega, {"units": "rad/s"})}
        return xr.Dataset(variables, coordinates, {"controller": self.name, "friction": int(self.friction)})

    def plot(self, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Gain and phase [deg] over ω, in two axes of a new Figure or in those given; returns the two."""
        from flipdiagram.studies.frequency.figures import plot_response

        return plot_response(self, ax)

    def __repr__(self) -> str:
        low, high = self.omega[[0, -1]]
        count = f"{len(self.omega)} frequencies from {low:g} to {high:g} rad/s"
        return f"FrequencyResponse({self.name}: {count}, gain {self.gain[0]:.3g} to {self.gain[-1]:.3g})"


def frequency_response(
    controller: str | Callable[[OneDof], Any],
    scenario: Scenario | None = None,
    *,
    omega: ArrayLike | None = None,
    friction: bool = False,
    name: str = "own controller",
) -> FrequencyResponse:
    """Drive the loop of section III with sines until it is steady; gain, phase, error and force of its response.

    Args:
        controller: an architecture, 'pd+ff+dob', or a function that makes a new controller from the loop's settings,
            `lambda settings: Pid(900.0, settings.step)`: a Drake System with an output `force` [N] and some of the
            inputs x_cmd [m], v_cmd [m/s], a_cmd [m/s²], x [m], v [m/s], each of size 1.
        scenario: its sections `one_dof` (mass, gains, cut-offs, friction) and `frequency`; the default where None.
        omega: frequencies [rad/s], shape (n,); by default those of `scenario.frequency`.
        friction: with the friction of `scenario.one_dof`.
        name: what a controller of one's own is called.

    Raises InputError for a bad controller or frequency, and SimulationError for an unstable loop, naming its pole.
    A controller without symbolic form is run by Drake's Simulator, thousands of times slower.
    """
    scenario = scenario or Scenario()
    if omega is not None:
        scenario = scenario.with_overrides({"frequency.omega": np.ravel(np.asarray(omega)).tolist()})
    if isinstance(controller, str):
        name = check_architecture(controller)
    factory = partial(build_controller, name) if isinstance(controller, str) else _checked(controller, name)
    laboratory = Laboratory(scenario.one_dof, scenario.frequency, {name: factory})
    loops = laboratory.loops((scenario.one_dof.g_dis,))
    responses = laboratory.responses(loops, scenario.frequency.frequencies(), "friction" if friction else "linear")
    return FrequencyResponse(name, friction, responses[loops[0]])


def _checked(controller: Any, name: str) -> Factory:
    """A controller of one's own; InputError where it makes none, or has the name of another."""
    if not callable(controller):
        valid = f"a function that makes one, lambda settings: …, or one of {', '.join(ARCHITECTURES)}"
        raise InputError.of("controller", controller, valid, f"controller is a {type(controller).__name__}")
    if name in ARCHITECTURES:
        raise InputError.of("name", name, "a name that no architecture has")

    def make(settings: OneDof) -> System:
        system = controller(settings)
        if not isinstance(system, System):
            raise InputError.of("controller", system, "a Drake System", f"controller made a {type(system).__name__}")
        return system

    return make
