"""Other arms and other objects: UR5 and Panda from the package example-robot-data, and three kinds of block.

    pip install example-robot-data
    python examples/own_arm.py

Neither file states the inertia of rotors and gears, so it is given here: our estimates, of the size that published
identifications of such arms have.  The Panda stands 0.2 m lower than the MH3F does, and the motion is 5 cm further out:
at the place of the MH3F's motion its joints have no room to turn.
"""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

from flipdiagram import FlipdiagramError, Scenario, measure, simulate


def robot_file(name: str) -> str:
    """Path of a file of example-robot-data."""
    try:
        (model,) = [file for file in files("example-robot-data") or [] if str(file).endswith(name)]
    except PackageNotFoundError:
        sys.exit("this example needs the arms of a package: pip install example-robot-data")
    return str(Path(str(model.locate())).resolve())


UR5 = {
    "arm.file": robot_file("ur_description/urdf/ur5_joint_limited_robot.urdf"),
    "arm.base": "base_link",
    "arm.flange": "tool0",
    "arm.reflected_inertia": (1.5, 1.5, 1.0, 0.3, 0.3, 0.3),
    "planner.contact_samples": (15, 45),  # its wrist turns at 3.2 rad/s at most: the contact may take 0.9 s, not 0.6
}
PANDA = {
    "arm.file": robot_file("panda_description/urdf/panda.urdf"),
    "arm.base": "panda_link0",
    "arm.flange": "panda_link8",
    "arm.base_pose": (0.0, 0.0, -0.2, 0.0),
    "arm.mount_angle": 0.75,
    "arm.reflected_inertia": (0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2),
    "task.start_x": 0.55,
}
# fmt: off
CASES: dict[str, dict[str, Any]] = {
    "UR5": UR5,
    "Panda, seven joints": PANDA,
    "MH3F, larger block": {
        "object.length": 0.085, "object.width": 0.09, "object.thickness": 0.015, "object.mass": 0.15,
    },
    "MH3F, lighter block": {"object.mass": 0.01},
    "MH3F, slippery block": {"object.friction": 0.5},
}
# fmt: on

for name, fields in CASES.items():
    try:
        flip = simulate(Scenario().with_overrides(fields), "pd+ff+dob")
    except FlipdiagramError as error:
        print(f"{name}: {error}")
        continue
    metrics = measure(flip.recording)
    verdict = "turned over" if metrics.success else metrics.failure
    angle = f" at {metrics.touchdown.theta_rad:.2f} rad" if metrics.touchdown else ""
    print(f"{name}: {verdict}{angle}, slip {1000 * metrics.max_slip_m:.1f} mm, J = {flip.plan.cost:.3f}")
