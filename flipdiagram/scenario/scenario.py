"""Everything a run depends on, typed, with units and bounds; the defaults are the paper's, as far as it is documented.

A `Scenario` is immutable.  `Scenario()` is the default, `load_scenario` reads a YAML file that may be partial (a delta
on the defaults), `with_overrides` changes single fields by path.  Every bad value ends in a one-line
`ScenarioError`.

Sources of the defaults: (p) the paper; (H) (M) (L) high, medium, low confidence, from published data on the
arm and its drives; (o) our own choice, explained where it is set; (c: low to high) what `flipdiagram calibrate
examples/calibration.yaml` left of what nobody tells, 5 to 95 % or a share, the default its median
rounded; what is documented stays as it is, whatever the calibration says of it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from flipdiagram.files import read_text
from flipdiagram.grid import Grid
from flipdiagram.scenario.cell import JOINTS, Arm, Disturbance, Inertia, JointFriction, Object, Table, Tool
from flipdiagram.scenario.joints import Drive, Joints, Sensors
from flipdiagram.scenario.motion import Planner, Task
from flipdiagram.scenario.one_dof import Frequency, OneDof, check_nyquist
from flipdiagram.scenario.pancake import check_pancake, kind_in, with_defaults
from flipdiagram.scenario.place import Place
from flipdiagram.scenario.text import Section, dump, fields_of, invalid, override, quantity, spans_of, unit_of, validate
from flipdiagram.scenario.yaml_reader import read_mapping, show

FILES = ("arm.file", "tool.file", "object.file")
"""Fields that name a model file."""
ORIGINS = {
    "p": "the paper",
    "H": "published data, high confidence",
    "M": "published data, medium confidence",
    "L": "published data or memory, low confidence",
    "o": "our choice",
}
"""What the marks in the texts of the fields say of where a default comes from; `c` is another, see LEGEND."""
LEGEND = "\n".join(
    [
        "# Behind each field: what it is, (where its default comes from), [its unit, and what is valid].",
        *(f"# ({mark}) {text}" for mark, text in ORIGINS.items()),
        "# (c: low to high) what `flipdiagram calibrate` left of what nobody tells: 5 to 95 %, or a share",
        "# no mark: our choice, or a neutral value that changes nothing; [1] a number without a unit",
        "",
    ]
)
"""What stands above the fields."""
ENCODER_BITS = 13
"""Of the encoders of the MH3F's motors (H: 13 to 16)."""
LEAD_TIMES = {"equilibrium": 0.1, "hold": 2.0, "switch-on": 0.0}
"""Seconds before the motion where a scenario names none: in 0.1 the contact settles, in 2 the observer, to exp(−25)."""
SHOWN = 4
"""Fields that the one line of a Scenario in a terminal shows."""
ARCHITECTURES = ("pd", "pd+ff", "pd+dob", "pd+ff+dob")
Architecture = Literal["pd", "pd+ff", "pd+dob", "pd+ff+dob"]


class Controller(Section):
    """Fig. 4: gains per channel and the observer."""

    period: float = quantity(0.001, "s", "sampling time of the controller (p)", ge=1e-5, le=0.1)
    k_p: float = quantity(350.0, "1/s2", "position gain (p)", ge=0, le=1e8)
    k_v: float = quantity(120.0, "1/s", "velocity gain (p)", ge=0, le=1e6)
    g_dis: float = quantity(12.6, "rad/s", "cut-off of the disturbance observer (p)", ge=0.01, le=100000)
    nominal_inertia: tuple[Inertia, ...] | None = quantity(
        None, "kg m2", "diagonal of M_n per joint; null: the diagonal of M(q) at the start pose (o)", min_length=1
    )
    nominal_inertia_scale: float = quantity(1.4, "1", "factor on M_n (c: 0.9 to 2.6)", ge=0.01, le=100)
    gravity_compensation: float = quantity(
        0.0,
        "1",
        "fraction of the arm's gravity torque that is fed forward; 0 as in the paper: no such box (c: 0 in 29 %, 0.5"
        " and 1 in 35 each)",
        ge=0,
        le=10,
    )


class Simulation(Section):
    """The physics and how long it runs."""

    engine: Literal["drake", "mujoco"] = Field(
        "drake",
        description="what moves arm, block and table; mujoco: of the extra `mujoco`, with contact settings of its own,"
        " so that the fields on contact below are Drake's alone",
    )
    contact_model: Literal["hydroelastic", "point", "hydroelastic_with_fallback"] = Field(
        "hydroelastic_with_fallback", description="contact model of the cell"
    )
    contact_approximation: Literal["sap", "lagged", "similar", "tamsi"] = Field(
        "similar", description="discrete contact approximation of the plant (lagged loses friction at a patch edge)"
    )
    step: float = quantity(
        0.001, "s", "time step of the plant; the controller period over a power of two", ge=1e-6, le=0.1
    )
    hydroelastic_modulus: float = quantity(1e6, "Pa", "stiffness of the rubber block (o)", ge=1000, le=1e11)
    dissipation: float = quantity(20.0, "s/m", "Hunt-Crossley dissipation of the block (o)", ge=0, le=10000)
    start: Literal["equilibrium", "hold", "switch-on"] = Field(
        "equilibrium",
        description="before the motion: equilibrium: as an endless hold of the start pose ends, joints that stick"
        " unloaded by their friction; hold: at rest there,"
        " the observer at zero, then held for hold_time; switch-on: the same, and the motion begins at once",
    )
    hold_time: float | None = quantity(
        None, "s", "hold of the start pose before the motion (o); null: 2 s of hold, 0.1 s of equilibrium", ge=0, le=600
    )
    settle_time: float = quantity(0.4, "s", "simulated after the plan has ended and the block should lie", ge=0, le=600)

    @model_validator(mode="after")
    def _nothing_before_switch_on(self) -> Simulation:
        if self.start == "switch-on" and self.hold_time:
            raise invalid("hold_time", self.hold_time, "null or 0 [s] where simulation.start is switch-on")
        return self

    @property
    def lead_time(self) -> float:
        """Simulated before the motion starts [s]."""
        return LEAD_TIMES[self.start] if self.hold_time is None else self.hold_time


class Scenario(Section):
    """One run of the flip, complete; see the module's docstring for the sources of the defaults."""

    arm: Arm = Arm()
    joint_friction: JointFriction = JointFriction()
    joints: Joints = Joints()
    drive: Drive = Drive()
    tool: Tool = Tool()
    object: Object = Object()
    table: Table = Table()
    disturbance: Disturbance = Disturbance()
    task: Task = Task()
    planner: Planner = Planner()
    controller: Controller = Controller()
    sensors: Sensors = Sensors()
    simulation: Simulation = Simulation()
    place: Place = Place()
    one_dof: OneDof = OneDof()
    frequency: Frequency = Frequency()

    @model_validator(mode="before")
    @classmethod
    def _defaults_of_a_pancake(cls, data: Any) -> Any:
        return with_defaults(data) if isinstance(data, Mapping) and kind_in(data) == "pancake" else data

    @property
    def encoder_bits(self) -> int:
        """Of the encoders on the motors' side; 0: none."""
        bits, known = self.sensors.encoder_bits, self.arm.file is None and self.sensors.encoder_resolution == 0
        return bits if bits is not None else ENCODER_BITS if known else 0

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        values = self.controller.nominal_inertia
        if self.arm.file is None and values is not None and len(values) != len(JOINTS):
            valid = f"a number for each joint {' '.join(JOINTS)}, or null"
            raise invalid("controller.nominal_inertia", values, valid)
        check_nyquist(self.one_dof, self.frequency)
        self.joints.check(self.simulation.contact_approximation, None if self.arm.file else JOINTS)
        self.drive.check(self.controller.period)
        ratio = self.controller.period / self.simulation.step
        if ratio < 1 or not math.log2(ratio).is_integer():
            # other ratios make Drake split one instant into two ordered events
            valid = f"controller.period = {self.controller.period} [s] divided by 1, 2, 4, 8, …"
            raise invalid("simulation.step", self.simulation.step, valid)
        if self.object.kind == "pancake":
            check_pancake(self.object, self.tool, self.simulation)
            return self
        for edge, side in (("length", "blade_width"), ("width", "blade_length")):
            most = getattr(self.tool, side)
            if getattr(self.object, edge) > most:
                raise invalid(f"object.{edge}", getattr(self.object, edge), f"at most tool.{side} = {most} [m]")
        return self

    def with_overrides(self, overrides: Mapping[str, Any]) -> Scenario:
        """A copy with fields changed by path, {"controller.k_p": 400.0}, or nested, {"controller": {"k_p": 400.0}}.

        Raises ScenarioError for a bad one.
        """
        kind = kind_in(overrides) or overrides.get("object.kind", self.object.kind)
        if kind == self.object.kind == "block":
            return override(Scenario, self.model_dump(), overrides)
        # what was not said takes the defaults of its kind of object, and follows from a diameter
        return override(Scenario, dict.fromkeys(Scenario.model_fields, {}), {**self.changes(), **overrides})

    def changes(self) -> dict[str, Any]:
        """The fields that are not at the defaults of their kind of object, by path: what `with_overrides` takes."""
        of: dict[str, Any] = {"object.kind": self.object.kind} if self.object.kind != Scenario().object.kind else {}
        if of and self.object.diameter is None:
            of["object.diameter"] = None  # other edges are the default of a box than of a disc
        default = override(Scenario, dict.fromkeys(Scenario.model_fields, {}), of)
        follow = ("object.length", "object.width") if self.object.diameter is not None else ()
        paths = [path for path in field_paths() if path not in follow]
        return of | {path: v for path in paths if (v := value_of(self, path)) != value_of(default, path)}

    def __repr__(self) -> str:
        changes = [f"{path}={show(value)}" for path, value in self.changes().items()]
        more = [f"… {len(changes) - SHOWN} more"] if len(changes) > SHOWN else []
        return f"Scenario({', '.join(changes[:SHOWN] + more)})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        fields, default = fields_of(Scenario), Scenario()
        rows = [[p, show(v), show(value_of(default, p)), unit_of(fields[p])] for p, v in self.changes().items()]
        title = f"Scenario: {len(rows) or 'no'} field{'s' * (len(rows) != 1)} not at the default"
        return Grid(["field", "value", "default", "unit"], rows, title).html() if rows else f"<p>{title}</p>"

    def between(self, start: tuple[float, float], target: tuple[float, float]) -> Scenario:
        """A copy whose object starts at (x, y) [m] over the table and shall land at another (x, y): a motion in 3-D.

        The plane of motion is turned so that it holds both.  Recordings are in the frame that turns with it, its y
        along the plane; the start has the same numbers in both frames.
        """
        dx, dy = target[0] - start[0], target[1] - start[1]
        sign = -1.0 if dy < 0 else 1.0
        yaw = math.atan2(-sign * dx, sign * dy) if math.hypot(dx, dy) > 1e-6 else 0.0
        fields = {"task.start_x": start[0], "task.start_y": start[1], "task.yaw": yaw}
        return self.with_overrides(fields | {"task.target_y": start[1] + sign * math.hypot(dx, dy)})

    def to_yaml(self, comments: bool = False) -> str:
        """YAML that `from_yaml` reads back exactly; with comments, each field's text and unit, and what they mean."""
        return (LEGEND if comments else "") + dump(self, comments)


def farthest(scenario: Scenario, sections: Collection[str], most: int = 3) -> list[str]:
    """'field = value' of those numbers that are nearest to an end of their range, the first the nearest."""
    shares = {}
    for path, field in fields_of(Scenario).items():
        value, default = value_of(scenario, path), field.default
        if path.split(".")[0] in sections and isinstance(default, float) and value != default:
            ((low, high),) = spans_of(field)
            end = high if value > default else low
            there, before, last = (
                math.log(x) if low > 0 else math.asinh(x / (abs(default) or 1.0)) for x in (value, default, end)
            )
            shares[path] = (there - before) / (last - before)
    ranked = sorted(shares, key=lambda path: -shares[path])
    return [f"{path} = {value_of(scenario, path)!r}" for path in ranked[:most]]


def field_paths() -> list[str]:
    """All field paths of a Scenario in order: 'arm.link_inertia_scale', …"""
    return list(fields_of(Scenario))


def with_unit(path: str) -> str:
    """A field with its unit, 'object.mass [kg]'; as it is where it has none, or where the name is of no field."""
    field = fields_of(Scenario).get(path)
    unit = unit_of(field) if field else ""
    return path if unit in ("", "1") else f"{path} [{unit}]"


def value_of(scenario: Scenario, path: str) -> Any:
    """A field by its path."""
    section, name = path.split(".")
    return getattr(getattr(scenario, section), name)


def from_mapping(data: Mapping[str, Any]) -> Scenario:
    """A Scenario from nested mappings, absent fields at their defaults; ScenarioError for a bad one."""
    return validate(Scenario, data)


def from_yaml(text: str, source: str = "scenario") -> Scenario:
    """A Scenario from YAML text; ScenarioError where it is not YAML, no mapping, or a field is bad."""
    data, _ = read_mapping(text, source)
    return from_mapping({section: {} if values is None else values for section, values in data.items()})


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Read a scenario file; model files that it names are looked for beside it first.

    Raises InputError naming the file where it cannot be read.
    """
    text = read_text(path, "scenario file", "a YAML file")
    scenario, changes = from_yaml(text, f"scenario file {str(path)!r}"), {}
    for field in FILES:
        section, name = field.split(".")
        beside = Path(path).parent / str(getattr(getattr(scenario, section), name))
        if os.path.isfile(beside):  # files are named from where the scenario stands, else from where the command runs
            changes[field] = str(beside)
    return scenario.with_overrides(changes) if changes else scenario
