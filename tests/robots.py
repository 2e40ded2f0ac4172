"""Arms of other people's packages, as files for the tests."""

from importlib.metadata import files
from pathlib import Path


def package_file(ending):
    """Path of the file of example-robot-data whose name ends so."""
    (found,) = [file for file in files("example-robot-data") if str(file).endswith(ending)]
    return str(Path(str(found.locate())).resolve())


UR5 = {
    "arm.file": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "arm.base": "base_link",
    "arm.flange": "tool0",
    "arm.reflected_inertia": (1.5, 1.5, 1.0, 0.3, 0.3, 0.3),
}
"""Fields of the scenario; the file as `package_file` takes it."""
PANDA = {
    "arm.file": "panda_description/urdf/panda.urdf",
    "arm.base": "panda_link0",
    "arm.flange": "panda_link8",
    "arm.base_pose": (0.0, 0.0, -0.2, 0.0),
    "arm.mount_angle": 0.75,
    "task.start_x": 0.55,
    "arm.reflected_inertia": (0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2),
}
"""The same of an arm with seven joints."""
