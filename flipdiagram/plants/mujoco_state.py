"""Between the state in the Context and MuJoCo's own numbers, as machine code: it is asked twice a period.

To be imported where a plant is made: numba takes half a second.
"""

import numpy as np

from flipdiagram.arrays import Floats, Indices
from flipdiagram.robot.jit import jit

FORCES = np.r_[:3, 9:12, 18:21, 3:6]
"""Where the sensors have the force of each pair, and the first pair's moment: of each its force, moment and point."""


@jit
def turned(vector: Floats, quaternion: Floats, sign: float) -> tuple[float, float, float]:
    """A vector in the axes of the block turned into the world's, or back (sign = -1); (w, x, y, z) of norm 1."""
    w, x, y, z = quaternion[0], sign * quaternion[1], sign * quaternion[2], sign * quaternion[3]
    a, b, c = vector[0], vector[1], vector[2]
    s = w * a + y * c - z * b
    t = w * b + z * a - x * c
    u = w * c + x * b - y * a
    return a + 2 * (y * u - z * t), b + 2 * (z * s - x * u), c + 2 * (x * t - y * s)


@jit
def put(
    state: Floats, positions: Indices, velocities: Indices, accelerations: int, qpos: Floats, qvel: Floats, warm: Floats
) -> None:
    """Write the state to qpos, qvel and the accelerations from which the solver starts; the block is the last body.

    Where they stand in the state: positions and velocities one by one, accelerations from there on.
    """
    for i in range(qpos.size):
        qpos[i] = state[positions[i]]
    for i in range(qvel.size):
        qvel[i] = state[velocities[i]]
        warm[i] = state[accelerations + i]
    # MuJoCo has the spin of a free body in the axes of that body
    qvel[-3], qvel[-2], qvel[-1] = turned(qvel[-3:], qpos[-4:], -1.0)


@jit
def taken(
    positions: Indices, velocities: Indices, accelerations: int, qpos: Floats, qvel: Floats, warm: Floats
) -> Floats:
    """The state that MuJoCo's numbers are; arguments as of `put`."""
    state = np.empty(accelerations + warm.size)
    for i in range(qpos.size):
        state[positions[i]] = qpos[i]
    for i in range(qvel.size):
        state[velocities[i]] = qvel[i]
        state[accelerations + i] = warm[i]
    spin = turned(qvel[-3:], qpos[-4:], 1.0)
    for k in range(3):
        state[velocities[qvel.size - 3 + k]] = spin[k]
    return state


@jit
def mean_wrench(sensed: Floats, forces: Indices) -> Floats:
    """The port `contact_wrench` (12,) of what the sensors gave in each step of MuJoCo's (steps, 27)."""
    wrench = np.zeros(12)
    for row in sensed:
        for i in range(12):
            wrench[i] += row[forces[i]]
        x, y, z, fx, fy, fz = row[6], row[7], row[8], row[0], row[1], row[2]
        wrench[9] += y * fz - z * fy  # the moment about the world's origin
        wrench[10] += z * fx - x * fz
        wrench[11] += x * fy - y * fx
    return wrench / len(sensed)
