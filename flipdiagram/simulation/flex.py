"""The same pancake in a second engine: MuJoCo's flex on the recorded motion of a blade."""

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants.mujoco_flex import BLADE, FLEX, Flex, quiet, settings_text
from flipdiagram.plants.pancake import AT_REST, LONGEST, LOOK, SETTLING
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.scenario.scenario import Scenario, from_yaml
from flipdiagram.simulation.deformation import STRIDE, deformation_energy, overhang, with_frames
from flipdiagram.simulation.events import touching
from flipdiagram.simulation.margins import with_margins
from flipdiagram.simulation.recording import Recording, continuous, in_tool, rotations
from flipdiagram.theory.rigid_fit import rigid_fit


def replay_in_flex(recording: Recording) -> Recording:
    """A flip of a pancake once more, as a flex of MuJoCo's on the recorded motion of the blade.

    The flex has the mesh, mass, E, ν, damping and friction of the recording's scenario.  It begins at rest on the still
    blade at the first recorded pose, where the recorded object lay.  The blade follows `tool_pose` exactly: what the
    pancake does has no effect on it.

    Args:
        recording: of a flip whose scenario has object.kind = pancake.

    Returns:
        The recording with vertices, frame_time, block_pose, deformation_energy, overhang, the contact forces of
        blade-block and table-block, and the margins that follow of them by MuJoCo; all else as it was recorded, but
        contact_area, which MuJoCo does not know, left out.

    Raises:
        InputError: where MuJoCo is missing or too old, or the object is no pancake.
        SimulationError: where the pancake does not come to rest on the blade or the simulation diverges.
    """
    scenario = from_yaml(recording.attrs["scenario"], "the recording's scenario")
    if scenario.object.kind != "pancake":
        raise InputError.of("object.kind", scenario.object.kind, "pancake")
    flight = _Flight(recording, scenario)
    with quiet():
        flight.come_to_rest()
        vertices, force, moment = flight.fly()
    mesh = pancake_mesh(scenario.object)
    fit = rigid_fit(vertices, mesh.vertices, flight.flex.masses)
    pose = np.hstack([Rotation.from_matrix(fit.rotation).as_quat(scalar_first=True), fit.centre])
    forces = recording["contact_force"].copy()
    forces.loc[{"pair": ["blade-block", "table-block"]}] = force
    data = recording.drop_dims("surface", errors="ignore")
    data["contact_force"], data["block_pose"] = forces, recording["block_pose"].copy(data=continuous(pose))
    frames = vertices[::STRIDE]
    data = with_frames(with_margins(data, moment, scenario), frames, mesh)
    beyond = overhang(data, frames, touching(data, "blade-block").astype(float), scenario)
    data = data.assign(
        deformation_energy=("frame", deformation_energy(frames, mesh, scenario.object), {"units": "J"}),
        overhang=("frame", beyond, {"units": "1"}),
    )
    return data.assign_attrs(engine=settings_text())


class _Flight:
    """One replay: the pancake in MuJoCo and the poses through which the blade is led."""

    def __init__(self, recording: Recording, scenario: Scenario) -> None:
        self.time = recording["time"].values
        self.tool = recording["tool_pose"].values
        period = float(self.time[1] - self.time[0])
        self.substeps = math.ceil(period / FLEX.timestep - 1e-9)
        self.step = period / self.substeps
        x, y, _ = in_tool(recording)[0]
        laid = pancake_mesh(scenario.object).vertices + [x, y, scenario.object.thickness / 2]
        self.flex = Flex(scenario, rotations(self.tool[:1]).apply(laid) + self.tool[0, 4:], self.tool[0], self.step)

    def come_to_rest(self) -> None:
        """On the still blade; raises SimulationError where it does not."""
        still, fade, steps = np.zeros(BLADE), math.exp(-SETTLING * self.step), round(LOOK / self.step)
        before = self.flex.vertices
        for _ in range(round(LONGEST / LOOK)):
            mean = np.zeros_like(before)
            for _ in range(steps):
                self._advance(self.tool[0], still, "as it came to rest")
                self.flex.velocities[:] *= fade
                mean += self.flex.vertices / steps
            if np.abs(mean - before).max() < AT_REST * LOOK:
                return
            before = mean
        what = f"the pancake does not come to rest on the blade within {LONGEST:g} s"
        raise SimulationError(f"{what} in MuJoCo; valid is a stiffer one")

    def fly(self) -> tuple[Floats, Floats, Floats]:
        """Vertices (time, V, 3) [m], forces on the pancake by blade and table (time, 2, 3) [N], the blade's moment.

        The moment (time, 3) [N m] is about the world's origin; forces are means over the period that begins.
        """
        samples, n = len(self.time), self.substeps
        poses, velocities = course_of(self.tool, n, self.step)
        vertices = np.empty((samples, len(self.flex.masses), 3))
        force, moment = np.zeros((samples, 2, 3)), np.zeros((samples, 3))
        for k in range(samples):
            vertices[k] = self.flex.vertices
            for i in range(k * n, (k + 1) * n):
                self._advance(poses[i], velocities[i], f"before {self.time[k] + self.step * n:.3f} s")
                forces = self.flex.forces
                force[k] += forces / n
                moment[k] += (np.cross(poses[i, 4:], forces[0]) + self.flex.moment) / n
        return vertices, force, moment

    def _advance(self, pose: Floats, velocity: Floats, when: str) -> None:
        try:
            self.flex.advance(pose, velocity)
        except SimulationError as error:
            raise SimulationError(f"the simulation diverged {when}: {error}") from None


def course_of(tool: Floats, substeps: int, step: float) -> tuple[Floats, Floats]:
    """Poses (steps, 7) at which each step of MuJoCo's begins, and the velocity (steps, 6) that leads to the next.

    Cubic splines through the samples; after the last the blade stands still.  Velocities are MuJoCo's of a free body:
    of the frame in the world, of rotation in the body.
    """
    samples = np.arange(len(tool))
    dense = CubicSpline(samples, tool)(np.arange((len(tool) - 1) * substeps + 1) / substeps)
    dense = np.vstack([dense, np.repeat(dense[-1:], substeps, axis=0)])
    turn = rotations(dense)
    linear = np.diff(dense[:, 4:], axis=0) / step
    return dense[:-1], np.hstack([linear, (turn[:-1].inv() * turn[1:]).as_rotvec() / step])
