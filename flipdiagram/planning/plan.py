"""The result of planning: a motion that can be sampled at any time, saved and loaded."""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, PlainValidator, TypeAdapter, ValidationError

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError
from flipdiagram.files import RESULT_BYTES, read_text
from flipdiagram.grid import Grid, number
from flipdiagram.planning.model import flight
from flipdiagram.theory import contact

SCHEMA = "flipdiagram/motion/1"


def _finite(numbers: Any) -> Floats:
    """An array of them; raises ValueError where they are something else."""
    try:
        array = np.array(numbers, dtype=float)
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from None
    if not np.all(np.isfinite(array)):
        raise ValueError("not finite")
    return array


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1)]
Samples = Annotated[Floats, PlainValidator(_finite)]


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """Samples of the tool's motion, time 0 at its start; all SI.

    The tool carries the object for `n_contact` intervals, releases it, and brakes for `n_brake` intervals while the
    object flies for `n_flight`; each interval lasts `sampling_time` and holds its acceleration (eq. (2)).  Without
    intervals to brake the commanded velocity drops to zero at the release, where the last state has what it was.
    """

    sampling_time: Annotated[Number, Field(gt=0)]
    n_contact: Count
    n_flight: Count
    n_brake: Annotated[int, Field(strict=True, ge=0)]
    states: Samples
    """x̂(k) = [y, z, θ, v_y, v_z, v_θ] of the control point at samples 0 … n_contact + n_brake, shape (N + 1, 6)."""
    inputs: Samples
    """u(k) = [a_y, a_z, a_θ], shape (N, 3)."""
    cost: Number
    """J of eq. (5)."""
    residual: Number
    """Largest violation of a constraint row or of eq. (2) in the last solve, in the row's own unit."""
    max_sliding_angle: Number
    """Largest |φ| of eq. (11) in the contact phase, at both ends of every interval [rad]."""
    friction_angle: Number
    """ϕ = atan μ of the object on the tool [rad]."""
    limit_use: dict[str, Number]
    """Largest use of the joint limits along the motion, 1 = at the limit."""
    solver: str
    iterations: Count
    """Quadratic programs solved, over all horizons searched."""
    solve_time: Number
    """Wall time of the whole planning [s]."""
    program_times: tuple[Number, ...] = ()
    """Wall time of each quadratic program [s]."""
    passed: Annotated[Number, Field(ge=0)] = 0.0
    """How much of its first interval had passed when it was planned again inside it [s]: that one is shorter."""
    limit_divisors: tuple[Number, Number, Number] = (1.0, 1.0, 1.0)
    """By what joint position, speed and torque limits at the samples were divided, for the motion between them."""

    @property
    def t(self) -> Floats:
        """Times of the samples [s], shape (N + 1,)."""
        return np.append(0.0, np.arange(1, len(self.states)) * self.sampling_time - self.passed)

    @property
    def release_time(self) -> float:
        """When the object leaves the tool [s]."""
        return self.n_contact * self.sampling_time - self.passed

    @property
    def touchdown_time(self) -> float:
        """Sample k_g as a time [s]."""
        return (self.n_contact + self.n_flight) * self.sampling_time - self.passed

    @property
    def duration(self) -> float:
        """When the commanded motion has ended [s]."""
        return (self.n_contact + self.n_brake) * self.sampling_time - self.passed

    end_time = duration
    """The same, by the name that a `Command` has for it."""

    @property
    def release(self) -> Floats:
        """x̂ at the release, shape (6,)."""
        return self.states[self.n_contact]

    @property
    def landing(self) -> Floats:
        """x̂(k_g) of the object at touch-down, shape (6,)."""
        matrix, offset = flight(self.n_flight * self.sampling_time)
        return matrix @ self.release + offset

    def sample(self, t: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """x_cmd, v_cmd, a_cmd, each (..., 3) for (y, z, θ), at times t [s]: exact between the samples.

        Before 0 the tool rests at the start, after `duration` at the end.
        """
        t = np.asarray(t, dtype=float)
        # a time that is a sample but for rounding belongs to the interval that starts there
        k = np.where(t < -self.sampling_time * 1e-9, -1, np.floor((t + self.passed) / self.sampling_time + 1e-9))
        inside = np.clip(k, 0, len(self.inputs) - 1).astype(int)
        moving = ((k >= 0) & (k < len(self.inputs)))[..., None]
        tau = (t - np.where(inside > 0, inside * self.sampling_time - self.passed, 0.0))[..., None]
        base, a = self.states[inside], self.inputs[inside]
        x = base[..., :3] + base[..., 3:] * tau + a * tau**2 / 2
        v = base[..., 3:] + a * tau
        rest = np.where((k < 0)[..., None], self.states[0, :3], self.states[-1, :3])
        return np.where(moving, x, rest), np.where(moving, v, 0.0), np.where(moving, a, 0.0)

    def at(self, t: float) -> tuple[list[float], list[float], list[float]]:
        """`sample` for one time, some thirty times faster: the MPC block calls it every millisecond."""
        k = math.floor((t + self.passed) / self.sampling_time + 1e-9)
        if t < -self.sampling_time * 1e-9:
            return self._rows[0][:3], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        if k >= len(self._accelerations):
            return self._rows[-1][:3], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        tau = t - (k * self.sampling_time - self.passed) if k else t
        y, z, theta, v_y, v_z, v_theta = self._rows[k]
        a = self._accelerations[k]
        half = tau * tau / 2
        x = [y + v_y * tau + a[0] * half, z + v_z * tau + a[1] * half, theta + v_theta * tau + a[2] * half]
        return x, [v_y + a[0] * tau, v_z + a[1] * tau, v_theta + a[2] * tau], a[:]

    @cached_property
    def _rows(self) -> list[list[float]]:
        return self.states.tolist()

    @cached_property
    def _accelerations(self) -> list[list[float]]:
        return self.inputs.tolist()

    def object_path(self, t: ArrayLike) -> Floats:
        """Planned y, z, θ of the object (..., 3): on the tool, then in flight, then where it touched down."""
        t = np.asarray(t, dtype=float)
        tau = np.clip(t - self.release_time, 0.0, self.touchdown_time - self.release_time)[..., None]
        flying = self.release[:3] + self.release[3:] * tau
        flying = flying + np.array([0.0, contact.GRAVITY_Z / 2, 0.0]) * tau**2
        return np.where((t < self.release_time)[..., None], self.sample(t)[0], flying)

    def __repr__(self) -> str:
        return (
            f"Plan(release at {self.release_time:.2f} s and {self.release[2]:.2f} rad, touch-down at"
            f" {self.touchdown_time:.2f} s and {self.landing[2]:.2f} rad, J = {self.cost:.3f})"
        )

    def _repr_html_(self) -> str:
        use = ", ".join(f"{kind} {share:.0%}" for kind, share in self.limit_use.items())
        angle = f"{number(self.max_sliding_angle)} (friction angle {number(self.friction_angle)})"
        rows = [
            ["release", "rad", f"{number(self.release[2])} at {number(self.release_time)} s"],
            ["touch-down", "rad", f"{number(self.landing[2])} at {number(self.touchdown_time)} s"],
            ["touch-down at y", "m", number(self.landing[0])],
            ["largest sliding angle", "rad", angle],
            ["limits of the joints used", "", use],
            ["cost J", "1", number(self.cost)],
            ["planned in", "s", f"{number(self.solve_time)}, {self.iterations} quadratic programs"],
        ]
        return Grid(["", "unit", "planned"], rows, "Plan").html()

    def summary(self) -> dict[str, Any]:
        """The `plan` entry of summary.json."""
        return {
            "cost_J": self.cost,
            "release_angle_rad": float(self.release[2]),
            "touchdown_angle_rad": float(self.landing[2]),
            "release_time_s": self.release_time,
            "touchdown_time_s": self.touchdown_time,
            "max_sliding_angle_rad": self.max_sliding_angle,
            "friction_angle_rad": self.friction_angle,
            "iterations": self.iterations,
            "solve_time_s": self.solve_time,
            "samples": {"contact": self.n_contact, "flight": self.n_flight, "brake": self.n_brake},
            "sampling_time_s": self.sampling_time,
            "touchdown_y_m": float(self.landing[0]),
            "touchdown_speed_m_s": float(np.hypot(*self.landing[3:5])),
            "residual": self.residual,
            "limit_use": self.limit_use,
            "solver": self.solver,
        }

    def to_json(self) -> str:
        """JSON text that `from_json` reads back exactly."""
        data = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(self).items()}
        return json.dumps({"schema": SCHEMA, **data}, indent=1)

    @classmethod
    def from_json(cls, text: str, source: str = "plan") -> Plan:
        """Read what `to_json` wrote; raises InputError where it is something else."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{source} is not valid JSON: {error}", field=source, valid="JSON") from None
        if not isinstance(data, dict) or data.pop("schema", None) != SCHEMA:
            raise InputError.of(source, None, f"a file with schema '{SCHEMA}'", f"{source} is no plan file")
        problem = " lacks fields of a plan or has others"
        known = {f.name: f.default is not MISSING for f in fields(cls)}
        wrong = sorted(name for name in set(data) ^ set(known) if not known.get(name))
        if not wrong:
            try:
                plan = TypeAdapter(cls).validate_python(data)
                n = plan.n_contact + plan.n_brake
                shapes = {"states": (n + 1, 6), "inputs": (n, 3)}
                wrong = [name for name, shape in shapes.items() if getattr(plan, name).shape != shape]
            except ValidationError as error:
                wrong = list(dict.fromkeys(str(each["loc"][0]) for each in error.errors()))
            problem = f": {', '.join(wrong)} of another shape or kind"
        if wrong:
            raise InputError.of(source, wrong, "a file written by this version", source + problem)
        return plan

    @classmethod
    def load(cls, path: str | Path) -> Plan:
        """Read a plan file; raises InputError where it cannot be read."""
        text = read_text(path, "plan file", "a file of 'flipdiagram plan'", RESULT_BYTES)
        return cls.from_json(text, f"plan file {str(path)!r}")
