"""The section of the scenario about laying the object down: it slides off a tilted spatula."""

from flipdiagram.scenario.text import Section, quantity


class Place(Section):
    """`flipdiagram place`: the blade comes down tilted, the object slides to the table, the blade is drawn away."""

    target_y: float = quantity(0.10, "m", "where the object's centre shall lie (o)", ge=-10, le=10)
    speed: float = quantity(0.15, "m/s", "planned speed of the object when it reaches the table (o)", ge=0.001, le=5)
    tilt_margin: float = quantity(
        0.03, "rad", "least tilt of the blade beyond the friction angle (o)", ge=0.0001, lt=0.5
    )
    carry_margin: float = quantity(0.12, "rad", "tilt below it while the blade comes down (o)", ge=0.0001, lt=0.5)
    edge_clearance: float = quantity(
        0.004, "m", "height of the blade's lower edge above the table (o)", ge=1e-5, le=0.5
    )
    sampling_time: float = quantity(0.01, "s", "sampling time of the plan (o)", ge=0.001, le=0.5)
    tilt_time: float = quantity(
        0.3, "s", "in which the blade tilts from below to beyond the friction angle (o)", ge=0.01, le=60
    )
    wait: float = quantity(0.1, "s", "from when the object's edge is down until the blade leaves (o)", ge=0, le=60)
    retreat: float = quantity(0.12, "m", "how far the blade is drawn away along itself (o)", ge=0.001, le=2)
    retreat_time: float = quantity(0.5, "s", "in which it is drawn away (o)", ge=0.01, le=60)
