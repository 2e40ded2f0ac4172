"""Recordings of a pancake made up for tests of pictures: the motion of a recorded block, and a bending that oscillates."""

from functools import lru_cache

import numpy as np
import synthetic
from ideal import IDEAL

from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.scenario.scenario import ARCHITECTURES
from flipdiagram.simulation.deformation import STRIDE, SURFACES, with_frames
from flipdiagram.simulation.recording import rotations

PANCAKE = IDEAL.with_overrides({"object.kind": "pancake"})
DEPTH, FREQUENCY = 0.012, 6.0
"""How far the rim hangs below the middle at most [m], and how often [Hz] it swings."""


def bend(recording, scenario):
    """A recording of a rigid block as one of a pancake: its vertices follow block_pose, bent to a paraboloid."""
    mesh, pancake = pancake_mesh(scenario.object), scenario.object
    frames = recording.isel(time=slice(None, None, STRIDE))
    time = frames["time"].values
    swing = DEPTH * np.sin(2 * np.pi * FREQUENCY * time)
    local = np.tile(mesh.vertices, (len(time), 1, 1))
    spread = (mesh.vertices[:, :2] ** 2).sum(axis=1) / (pancake.length / 2) ** 2
    local[:, :, 2] -= np.outer(swing, spread - spread.mean())
    poses = frames["block_pose"].values
    turned = np.einsum("fij,fvj->fvi", rotations(poses).as_matrix(), local)
    touching = {
        pair: recording["contact_force"].sel(pair=pair, direction="z") != 0 for pair in recording["pair"].values
    }
    area = np.pi * pancake.length**2 / 4
    areas = np.column_stack([area * touching["blade-block"], area * touching["table-block"]])
    added = {
        "deformation_energy": (("frame",), 20.0 * swing**2, {"units": "J"}),
        "contact_area": (("time", "surface"), areas, {"units": "m2"}),
        "overhang": (("frame",), 0.1 + 5 * np.abs(swing), {"units": "1"}),
    }
    shown = with_frames(recording, turned + poses[:, None, 4:], mesh).assign(added)
    return shown.assign_coords(surface=SURFACES).assign_attrs(scenario=scenario.to_yaml())


@lru_cache
def recording(architecture="pd+ff+dob"):
    return bend(synthetic.recording(architecture), PANCAKE)


def recordings():
    return {architecture: recording(architecture) for architecture in ARCHITECTURES}
