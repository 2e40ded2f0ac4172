import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flipdiagram.theory.rigid_fit import rigid_fit, spin

RNG = np.random.default_rng(7)
POINTS = RNG.normal(size=(40, 3)) * [0.06, 0.05, 0.01]
MASSES = RNG.uniform(0.5, 2.0, 40)
POINTS -= MASSES @ POINTS / MASSES.sum()


@pytest.mark.parametrize("seed", range(5))
def test_a_rigid_motion_is_found_exactly(seed):
    R = Rotation.random(random_state=seed).as_matrix()
    fit = rigid_fit(POINTS @ R.T + [0.5, -0.1, 0.3], POINTS, MASSES)
    np.testing.assert_allclose(fit.rotation, R, atol=1e-12)
    np.testing.assert_allclose(fit.centre, [0.5, -0.1, 0.3], atol=1e-12)


def test_many_frames_are_as_one_by_one():
    frames = np.stack([POINTS @ Rotation.random(random_state=k).as_matrix().T for k in range(3)])
    together = rigid_fit(frames, POINTS, MASSES)
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(together.rotation[k], rigid_fit(frame, POINTS, MASSES).rotation, atol=1e-12)


def test_no_rotation_near_the_fit_of_a_bent_body_is_better():
    bent = POINTS + np.column_stack([0 * POINTS[:, 0], 0 * POINTS[:, 0], 8 * POINTS[:, 1] ** 2])
    fit = rigid_fit(bent, POINTS, MASSES)

    def misfit(R):
        return MASSES @ np.sum((bent - fit.centre - POINTS @ R.T) ** 2, axis=1)

    best = misfit(fit.rotation)
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        assert misfit(fit.rotation @ Rotation.from_rotvec(0.01 * axis).as_matrix()) > best


def test_a_mirrored_body_is_fitted_by_a_rotation():
    assert np.linalg.det(rigid_fit(POINTS * [1, 1, -1], POINTS, MASSES).rotation) == pytest.approx(1.0)


def test_the_velocity_of_a_rigid_body_is_its_own():
    omega, v = np.array([3.0, -1.0, 0.5]), np.array([0.2, 0.0, -1.0])
    found = spin(POINTS + 1.0, np.cross(omega, POINTS) + v, MASSES)
    np.testing.assert_allclose(found[0], omega, atol=1e-12)
    np.testing.assert_allclose(found[1], v, atol=1e-12)
