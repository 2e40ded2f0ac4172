"""Bookkeeping of recordings: quaternions, roll, and the tool's frame, against Drake's own rotations."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from flipdiagram.simulation import recording

angles = st.floats(-3, 3)


def test_continuous_removes_sign_flips_and_changes_no_rotation():
    rolls = np.linspace(0, 7, 50)
    q = np.column_stack([np.cos(rolls / 2), np.sin(rolls / 2), 0 * rolls, 0 * rolls])
    flipped = q * np.where(np.arange(50) % 3 == 1, -1, 1)[:, None]
    poses = recording.continuous(np.hstack([flipped, np.zeros((50, 3))]))
    np.testing.assert_allclose(poses[:, :4], q, atol=1e-15)


def test_roll_is_unwrapped():
    rolls = np.linspace(0, 7, 50)
    q = np.column_stack([np.cos(rolls / 2), np.sin(rolls / 2), 0 * rolls, 0 * rolls])
    np.testing.assert_allclose(recording.roll(np.hstack([q, np.zeros((50, 3))])), rolls, atol=1e-12)


@given(
    rpy=st.tuples(angles, st.floats(-1.4, 1.4), angles),
    p=st.tuples(angles, angles, angles),
    b=st.tuples(angles, angles, angles),
)
def test_in_tool_is_the_inverse_pose_applied(rpy, p, b):
    import xarray as xr

    R = RotationMatrix(RollPitchYaw(*rpy))
    tool = np.array([[*R.ToQuaternion().wxyz(), *p]])
    block = np.array([[1.0, 0, 0, 0, *b]])
    data = xr.Dataset({"tool_pose": (("time", "pose"), tool), "block_pose": (("time", "pose"), block)})
    expected = RigidTransform(R, p).inverse().multiply(np.array(b))
    np.testing.assert_allclose(recording.in_tool(data)[0], expected, atol=1e-12)
