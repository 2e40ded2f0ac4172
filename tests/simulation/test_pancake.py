"""What a recording keeps of a pancake, and how it lies in the end: hand-made shapes, no flip."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.deformation import deformation_energy, overhang, with_frames
from flipdiagram.simulation.lying import lying
from flipdiagram.simulation.recording import POSE
from flipdiagram.simulation.verdict import cause_of

SCENARIO = Scenario().with_overrides({"object.kind": "pancake", "object.refinement": 3})
MESH = pancake_mesh(SCENARIO.object)
OVER = np.diag([1.0, -1.0, -1.0])  # half a turn about x


def recorded(shape, y=0.0):
    """A recording that ends with this shape (V, 3), its centre at y."""
    frames = np.stack([MESH.vertices, MESH.vertices, shape]) + [0.5, y, 0.2]
    time = np.arange(9) * 1e-3
    pose = np.tile([1.0, 0, 0, 0, 0.5, y, 0.2], (9, 1))
    tool = np.tile([1.0, 0, 0, 0, 0.5, 0.0, 0.2], (9, 1))
    poses = {"block_pose": (("time", "pose"), pose), "tool_pose": (("time", "pose"), tool)}
    data = xr.Dataset(poses, coords={"time": time, "pose": POSE}, attrs={"target_y_m": 0.0})
    return with_frames(data, frames, MESH)


def folded(over):
    """Turned over, then the part beyond y = `over` of the upside-down disc folded back underneath."""
    turned = MESH.vertices @ OVER.T
    far = turned[:, 1] > over
    turned[far, 1] = 2 * over - turned[far, 1]
    turned[far, 2] = -0.013 - turned[far, 2]
    return turned


def test_turned_over_flat():
    lies = lying(recorded(MESH.vertices @ OVER.T))
    assert lies.turned == pytest.approx(1.0) and lies.steepest_rad == pytest.approx(0.0, abs=1e-3)
    assert lies.failure is None


@pytest.mark.parametrize("tilt", [0.3, -0.3])
def test_a_tilt_is_the_angle_to_the_vertical(tilt):
    shape = MESH.vertices @ OVER.T @ Rotation.from_rotvec([tilt, 0, 0]).as_matrix().T
    assert lying(recorded(shape)).steepest_rad == pytest.approx(abs(tilt), abs=1e-3)


def test_not_turned():
    failure = lying(recorded(MESH.vertices)).failure
    assert failure == "not turned, 100 % of its upper face look up"
    assert cause_of(failure) == "not turned"


def test_folded_under():
    lies = lying(recorded(folded(0.02)))
    # what is beyond y of a disc: a segment; the cells that the fold cuts count as one side or the other
    a = np.arccos(0.02 / 0.06)
    assert 1 - lies.turned == pytest.approx((a - np.sin(a) * np.cos(a)) / np.pi, abs=0.08)
    assert cause_of(lies.failure) == "folded"
    assert lying(recorded(folded(-0.02))).failure.startswith("not turned")


def test_off_target():
    assert lying(recorded(MESH.vertices @ OVER.T, y=0.029)).failure is None
    failure = lying(recorded(MESH.vertices @ OVER.T, y=-0.034)).failure
    assert failure == "off target by 3.4 cm" and cause_of(failure) == "off target"


def test_the_energy_of_a_uniform_strain_and_of_a_rotation():
    material = SCENARIO.object
    R = Rotation.random(random_state=1).as_matrix()
    E, nu = mesh_modulus(material), material.poissons_ratio
    stretch = np.diag([1 + 1e-3, 1 - nu * 1e-3, 1 - nu * 1e-3])
    frames = np.stack([MESH.vertices @ R.T, MESH.vertices @ stretch @ R.T])
    energy = deformation_energy(frames, MESH, material)
    assert energy[0] == pytest.approx(0.0, abs=1e-15)
    assert energy[1] == pytest.approx(E * 1e-6 / 2 * MESH.volumes.sum(), rel=1e-9)  # tension along one axis


def test_overhang_is_the_share_beyond_the_blade():
    scenario = SCENARIO.with_overrides({"tool.blade_width": 0.06})
    data = recorded(MESH.vertices).isel(time=slice(0, 9))
    frames = np.stack([MESH.vertices, MESH.vertices, MESH.vertices]) + [0.5, 0.0, 0.2]
    share = overhang(data, frames, np.array([1.0] * 5 + [0.0] * 4), scenario)
    a = np.arccos(0.5)  # two segments beyond half the radius
    assert share[0] == pytest.approx(2 * (a - np.sin(a) * np.cos(a)) / np.pi, abs=0.08)
    assert np.isnan(share[2])  # nothing touches the blade then
