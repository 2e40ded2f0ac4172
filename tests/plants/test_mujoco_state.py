"""State of the Context to MuJoCo's numbers and back, against MuJoCo's own rotation and NumPy's cross product."""

import mujoco
import numpy as np

from flipdiagram.plants import mujoco_state


def rotation(rng):
    quaternion = rng.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def test_a_vector_is_turned_as_mujoco_turns_it():
    rng = np.random.default_rng(1)
    for _ in range(50):
        vector, quaternion, expected = rng.normal(size=3), rotation(rng), np.zeros(3)
        mujoco.mju_rotVecQuat(expected, vector, quaternion)
        np.testing.assert_array_equal(mujoco_state.turned(vector, quaternion, 1.0), expected)
        mujoco.mju_rotVecQuat(expected, vector, quaternion * [1, -1, -1, -1])
        np.testing.assert_array_equal(mujoco_state.turned(vector, quaternion, -1.0), expected)


def test_what_is_put_is_taken_again():
    rng = np.random.default_rng(2)
    positions, velocities = np.array([0, 1, 8, 9, 10, 4, 5, 6, 7]), np.array([2, 3, 14, 15, 16, 11, 12, 13])
    state = rng.normal(size=17 + 8)
    state[4:8] = rotation(rng)
    qpos, qvel, warm = np.zeros(9), np.zeros(8), np.zeros(8)
    mujoco_state.put(state, positions, velocities, 17, qpos, qvel, warm)
    np.testing.assert_array_equal(qpos, state[positions])
    np.testing.assert_array_equal(warm, state[17:])
    assert abs(qvel[5:] - state[11:14]).max() > 0.1, "the spin is in the axes of the block"
    again = mujoco_state.taken(positions, velocities, 17, qpos, qvel, warm)
    np.testing.assert_allclose(again, state, rtol=1e-14, atol=1e-14)


def test_the_wrench_is_the_mean_of_the_steps():
    sensed = np.random.default_rng(3).normal(size=(10, 27))
    force, moment, point = sensed[:, :3], sensed[:, 3:6], sensed[:, 6:9]
    expected = np.r_[
        force.mean(0), sensed[:, 9:12].mean(0), sensed[:, 18:21].mean(0), (moment + np.cross(point, force)).mean(0)
    ]
    np.testing.assert_allclose(mujoco_state.mean_wrench(sensed, mujoco_state.FORCES), expected, rtol=1e-13)
