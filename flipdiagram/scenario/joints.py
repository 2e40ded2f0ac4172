"""The sections of a scenario that describe what lies between controller and joints: gears, drives and sensors.

The sources of the defaults are marked as in `scenario.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from flipdiagram.scenario.text import Section, invalid, quantity

MOST_PERIODS = 1000
"""Longest delay of the torque, in periods of the controller."""
MOST_SEED = 2**32 - 1


class Joints(Section):
    """What joins rotor and link of each joint, unknown to planner and controller, whose arm is rigid."""

    model: Literal["rigid", "elastic"] = Field(
        "rigid",
        description="rigid: as one (c: 53 %); elastic: the gear between them gives way; encoders see the rotor's angle",
    )
    stiffness: tuple[Annotated[float, Field(ge=1, le=1e8)], ...] | None = quantity(
        None,
        "N m/rad",
        "of each gear at the joint; null: the file's, of harmonic drives of that torque (L)",
        min_length=1,
    )
    stiffness_scale: float = quantity(1.0, "1", "factor on the stiffness of every gear", ge=0.01, le=1000)
    damping: tuple[Annotated[float, Field(ge=1e-6, le=1e5)], ...] | None = quantity(
        None, "N m s/rad", "of each gear; null: a damping ratio of 0.05 (o), or what the step needs", min_length=1
    )

    def check(self, approximation: str, joints: Sequence[str] | None) -> None:
        """For a validator: numbers for each of the joints, where they are known, and a solver that moves them."""
        for name in ("stiffness", "damping"):
            values = getattr(self, name)
            if joints is not None and values is not None and len(values) != len(joints):
                raise invalid(f"joints.{name}", values, f"a number for each joint {' '.join(joints)}, or null")
        if self.model == "elastic" and approximation == "tamsi":  # it does not converge with them
            valid = "sap, lagged or similar with elastic joints"
            raise invalid("simulation.contact_approximation", approximation, valid)


class Drive(Section):
    """How the torque of the motors differs from the one that the controller sends; by default it does not."""

    ripple: float = quantity(
        0.0, "rated torque", "amplitude of the torque ripple, fraction of rated torque; 0: none", ge=0, le=1
    )
    ripple_cycles: float = quantity(
        2.0,
        "1/turn",
        "periods of the ripple in a turn of the motor; 2: the wave generator of a harmonic drive (o)",
        ge=0.001,
        le=1000,
    )
    delay: float = quantity(
        0.0,
        "s",
        "of the torque behind what the controller sends, whole periods of the controller; 0: none",
        ge=0,
        le=10,
    )

    def check(self, period: float) -> None:
        """For a validator: the delay is a whole number of periods of the controller [s]."""
        periods = self.delay_periods(period) if self.delay / period <= MOST_PERIODS else -1
        if periods < 0 or abs(self.delay / period - periods) > 1e-6:
            valid = f"a multiple of controller.period = {period} [s], at most {MOST_PERIODS} of them"
            raise invalid("drive.delay", self.delay, valid)

    def delay_periods(self, period: float) -> int:
        """The delay in periods of the controller [s]."""
        return round(self.delay / period)


class Sensors(Section):
    """What the controller sees of the joints."""

    encoder_resolution: float = quantity(0.0, "rad", "quantisation of the joint angles; 0: none", ge=0, le=0.1)
    encoder_bits: int | None = quantity(
        None,
        "bit",
        "of an encoder on the motor's side of the gear, 2^bits steps per turn of the motor (H: 13 to 16); 0: none;"
        " null: 13 for the MH3F, none for another arm or where encoder_resolution is above 0",
        ge=0,
        le=32,
    )
    velocity_cutoff: float | None = quantity(
        62.8,
        "rad/s",
        "g_v of the pseudo-derivative g_v s/(s + g_v), 10 Hz (H) (c: 45 to 66); null: exact velocity",
        ge=0.1,
        le=100000,
    )
    camera_period: float | None = quantity(
        None, "s", "how often a camera sees where the object lies on the blade; null: no camera", ge=0.001, le=10
    )
    camera_delay: float = quantity(0.02, "s", "age of what it reports", ge=0, le=10)
    camera_noise: float = quantity(0.0005, "m", "standard deviation of what it reports", ge=0, le=0.1)
    camera_seed: int = quantity(0, "1", "seed of that noise", ge=0, le=MOST_SEED)
    delay: int = quantity(1, "periods", "delay of q and qd, in periods of the controller (c: 0 to 3)", ge=0, le=1000)
    position_noise: float = quantity(
        0.0, "rad", "standard deviation of the noise of the joint angles, drawn anew each period; 0: none", ge=0, le=1
    )
    velocity_noise: float = quantity(
        0.0, "rad/s", "the same of the joint velocities, measured or derived", ge=0, le=100
    )
    noise_seed: int = quantity(0, "1", "seed of both", ge=0, le=MOST_SEED)

    @model_validator(mode="after")
    def _one_encoder(self) -> Sensors:
        if self.encoder_bits and self.encoder_resolution > 0:
            raise invalid("encoder_bits", self.encoder_bits, "null or 0 where sensors.encoder_resolution is above 0")
        return self
