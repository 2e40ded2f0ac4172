"""A pancake as a flex of MuJoCo's, a blade that is led and a table, as MJCF, made from a scenario's numbers.

MuJoCo is an optional extra, imported when it is used.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, CoulombFriction

from flipdiagram.arrays import Floats
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.plants.mujoco_contact import Settings, compiled, import_mujoco
from flipdiagram.plants.pancake_cell import STRETCHED
from flipdiagram.robot.model_files import spaced, table_size
from flipdiagram.robot.pancake_mesh import pancake_mesh
from flipdiagram.robot.pancake_stiffness import mesh_modulus
from flipdiagram.scenario.scenario import Scenario

FLEX = Settings(timestep=5e-4, stiffness=1e6, friction_damping=2e3, impratio=10.0, impedance=0.2)
"""How MuJoCo moves a pancake.  Friction has the damping of the normal direction, 2 √stiffness: of a flex's contacts
none of its own can be told.

* Integrator "discrete", the only one of MuJoCo's that takes elasticity implicitly: from 5 kPa to 10 MPa nothing grew at
  any step tried, up to 1 ms.  "Euler", explicit, needs 3e-5 s with the 50 kPa and damping of the default, with 10 MPa
  1e-7 s; "RK4" 3e-5 and 3e-7 s.
* Solver "CG": as "Newton" to 1 ms and 2e-3 rad of touch-down and 0.15 mm of slip, in half the time with 75 vertices, a
  third with 147.  With 100 iterations the centre of a free pancake did not fall as it must where the mesh had 10 MPa.
* ccd_tolerance 1e-12: with MuJoCo's 1e-6 normals of contacts some micrometres deep point inwards; what shall slide
  23.5 mm slid 4.9.
* Radius and margin 0: the surface lies where the mesh lies.  Drake has no self-collision, so there is none here.

The default turned over by pd+ff+dob, 75 vertices (Newton, but for the last): touch-down, and slip on the blade:

| step [ms] | stiffness | impedance | impratio | touch-down [s, rad] | slip [mm] |
|---|---|---|---|---|---|
| 0.5 | 1e6 | 0.2 | 10 | 0.546, 2.557 | 1.86 |
| 0.25 | 1e6 | 0.2 | 10 | 0.545, 2.550 | 1.84 |
| 0.125 | 1e6 | 0.2 | 10 | 0.545, 2.551 | 1.84 |
| 0.5 | 1e6 | 0.2 | 1, 100 | 0.545, 2.549; 0.546, 2.555 | 2.59, 1.85 |
| 0.5 | 1e6 | 0.9 | 10 | 0.547, 2.565 | 2.13 |
| 0.5 | 3e5, 3e6 | 0.1, 0.2 | 10 | 0.546, 2.555; 0.546, 2.558 | 2.16, 1.84 |
| 0.5, CG | 1e6 | 0.2 | 10 | 0.546, 2.557 | 1.91 |

A pancake that lies sinks in by 20 to 40 micrometres.  Each tetrahedron touches with one point, which jumps about its
face: vertices tremble by micrometres, the force of a period by 3 %.  In 0.2 s at 0.9 μ g it creeps 0.2 mm, at 1.2 μ g
it slides within 1 % of Coulomb's law (10 MPa, 75 vertices).

A flip runs at 0.42, 0.20 and 0.10 of real time with 75, 147 and 243 vertices (processor time, the machine shared), and
takes 0.5, 0.7 and 2.7 s to come to rest before.
"""
OLDEST = (4, 0)
"""Version from which MuJoCo's elasticity is that of E and ν: before, tetrahedra had twice Lamé's λ.  The integrator
"discrete" came shortly before."""
BLADE_MASS, BLADE_INERTIA = 1e4, 1e3
"""Of the blade [kg, kg m²]: so large that contact does not move it within a step; then it is put where it shall be."""
BLADE = 6
"""Degrees of freedom of the blade, MuJoCo's first."""


class Flex:
    """A pancake, blade and table in MuJoCo, stepped with a blade that is led.

    Args:
        scenario: its fields of object, tool, table and disturbance.
        vertices: where the vertices of the object's mesh stand (V, 3) [m] in the world, free of strain.
        tool: pose (7,) of the tool there.
        step: of MuJoCo's [s].

    Raises:
        InputError: where MuJoCo is missing or older than `OLDEST`, or refuses the model.
    """

    def __init__(self, scenario: Scenario, vertices: Floats, tool: Floats, step: float = FLEX.timestep) -> None:
        self._mujoco = mujoco = _module()
        self.masses = pancake_mesh(scenario.object).masses(
            scenario.object.mass * scenario.disturbance.object_mass_scale
        )
        """Of the vertices (V,) [kg]."""
        self.model = compiled(mujoco, mjcf(scenario, vertices, tool, self.masses))
        self.model.opt.timestep = self.period = step
        self.data = mujoco.MjData(self.model)
        self._placed, self._share = vertices, self.masses / self.masses.sum()
        self._largest = STRETCHED * max(scenario.object.size)

    @property
    def vertices(self) -> Floats:
        """(V, 3) [m] in the world."""
        return np.asarray(self._placed + self.data.qpos[BLADE + 1 :].reshape(-1, 3))

    @property
    def velocities(self) -> Floats:
        """Of the vertices (V, 3) [m/s], a view that may be written to."""
        return np.asarray(self.data.qvel[BLADE:].reshape(-1, 3))

    @property
    def forces(self) -> Floats:
        """On the pancake by blade and by table (2, 3) [N] in the last step."""
        reaction = self.data.qfrc_constraint
        blade = -reaction[:3]
        return np.array([blade, reaction[BLADE:].reshape(-1, 3).sum(axis=0) - blade])

    @property
    def moment(self) -> Floats:
        """Of the blade's forces on the pancake about the blade's frame (3,) [N m], in world axes, in the last step."""
        return np.asarray(-self.data.xmat[1].reshape(3, 3) @ self.data.qfrc_constraint[3:BLADE])

    def advance(self, pose: Floats, velocity: Floats) -> None:
        """One step, in which the blade moves from a pose (7,) with a velocity (6,), MuJoCo's of a free body.

        What is inside the pancake does not turn it, so the spin that the integrator takes from it is given back: an
        implicit step along tangents stretches what turns, and stiffness and damping answer that.  Without it a free
        pancake whose mesh had 10 MPa lost half of its 8 rad/s within 0.3 s, with 50 kPa 2 %; with it 0.1 and 0.3 %.

        Raises SimulationError where the state is not finite then, or the pancake is torn apart.
        """
        data = self.data
        data.qpos[:3], data.qpos[3:7], data.qvel[:BLADE] = pose[4:], pose[:4], velocity
        r = self._from_centre()
        spin = _axial((self.masses[:, None] * r).T @ self.velocities)
        self._mujoco.mj_step(self.model, data)
        extent = np.ptp(self.vertices, axis=0).max()
        if not extent < self._largest:
            stretched = f"the pancake is stretched to {extent:.3g} m"
            raise SimulationError(stretched if np.isfinite(extent) else "MuJoCo's state is not finite")
        spin += self.period * _axial(r.T @ data.qfrc_constraint[BLADE:].reshape(-1, 3))
        r = self._from_centre()
        weighted = (self.masses[:, None] * r).T
        spread = weighted @ r
        lost = np.linalg.solve(spread.trace() * np.eye(3) - spread, spin - _axial(weighted @ self.velocities))
        self.velocities[:] += np.cross(lost, r)

    def _from_centre(self) -> Floats:
        x = self.vertices
        return np.asarray(x - self._share @ x)


@contextmanager
def quiet() -> Iterator[None]:
    """MuJoCo's warnings go nowhere meanwhile: it would write a file into the working directory."""
    mujoco = _module()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


def _module() -> Any:
    mujoco = import_mujoco()
    if tuple(int(part) for part in mujoco.__version__.split(".")[:2]) < OLDEST:
        wanted = f"{'.'.join(map(str, OLDEST))} or newer"
        message = f"a pancake in the second engine needs MuJoCo {wanted}, not {mujoco.__version__}"
        raise InputError(f"{message}: pip install 'mujoco>=4'", field="mujoco", value=mujoco.__version__, valid=wanted)
    return mujoco


def _axial(product: Floats) -> Floats:
    """Σ a × b of the matrix Σ a bᵀ."""
    return np.array([product[1, 2] - product[2, 1], product[2, 0] - product[0, 2], product[0, 1] - product[1, 0]])


def settings_text() -> str:
    """Engine and settings in one line, for a report."""
    solver = f"discrete, CG, elliptic cone, impratio {FLEX.impratio:g}"
    contact = f"solref {' '.join(f'{number:g}' for number in FLEX.solref)}, solimp {FLEX.impedance:g}, condim 3"
    return f"MuJoCo {import_mujoco().__version__}, flex, step {FLEX.timestep * 1e3:g} ms, {solver}, {contact}"


def mjcf(scenario: Scenario, vertices: Floats, tool: Floats, masses: Floats) -> str:
    """The model's text; arguments as of `Flex`, masses (V,) [kg] of the vertices."""
    pancake, mesh = scenario.object, pancake_mesh(scenario.object)
    half = np.array(scenario.tool.blade_size) / 2
    plate = table_size() / 2
    height = scenario.table.height + scenario.disturbance.table_error
    table = np.array([scenario.task.start_x, scenario.task.target_y, height - plate[2]])
    own, of_table = (CoulombFriction(mu, mu) for mu in (pancake.friction, scenario.table.friction))
    combined = CalcContactFrictionFromSurfaceProperties(own, of_table).dynamic_friction()
    points = "".join(
        f'<body name="v{i}" pos="{spaced(point)}"><inertial pos="0 0 0" mass="{float(mass)!r}"'
        f' diaginertia="1e-9 1e-9 1e-9"/>{SLIDES}</body>'
        for i, (point, mass) in enumerate(zip(vertices, masses, strict=True))
    )
    return f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="{FLEX.timestep!r}" integrator="discrete" cone="elliptic" impratio="{FLEX.impratio!r}"
          solver="CG" iterations="1000" tolerance="1e-8" ccd_tolerance="1e-12" ccd_iterations="100">
    <flag autoreset="disable"/></option>
  <worldbody>
    <body name="blade" pos="{spaced(tool[4:])}" quat="{spaced(tool[:4])}" gravcomp="1"><freejoint/>
      <inertial pos="0 0 0" mass="{BLADE_MASS!r}" diaginertia="{spaced([BLADE_INERTIA] * 3)}"/>
      {_box("blade", half, np.array([0.0, 0.0, -half[2]]), pancake.friction)}</body>
    {_box("table", plate, table, combined)}
    {points}
  </worldbody>
  <deformable><flex name="pancake" dim="3" radius="0" body="{" ".join(f"v{i}" for i in range(len(vertices)))}"
                    element="{" ".join(map(str, mesh.tetrahedra.ravel()))}">
    <contact selfcollide="none" contype="1" conaffinity="0"/>
    <elasticity young="{mesh_modulus(pancake)!r}" poisson="{pancake.poissons_ratio!r}" damping="{pancake.damping!r}"/>
  </flex></deformable>
</mujoco>"""


SLIDES = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))


def _box(name: str, half: Floats, centre: Floats, friction: float) -> str:
    """A box that touches the pancake alone, and whose priority makes friction and compliance its own."""
    impedance = spaced((FLEX.impedance, FLEX.impedance, 1e-3, 0.5, 2.0))
    return (
        f'<geom name="{name}" type="box" size="{spaced(half)}" pos="{spaced(centre)}" contype="0" conaffinity="1"'
        f' priority="1" condim="3" friction="{friction!r} 0 0" solref="{spaced(FLEX.solref)}" solimp="{impedance}"/>'
    )
