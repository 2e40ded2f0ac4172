"""A block that slides on the blade, in both engines, against Coulomb's law along the motion that the blade made.

Where friction is less than the planner believes, the block slides by some millimetres; an engine whose contact hops, or
sticks, has another border between keeping and losing it.
"""

import numpy as np
import pytest
from ideal import IDEAL

from flipdiagram.planning import plan_motion
from flipdiagram.simulation.recording import in_tool
from flipdiagram.simulation.simulate import simulate

G = 9.81
TURNED = 1.2  # [rad]: until then the face lies on the blade


@pytest.fixture(scope="module")
def plan():
    return plan_motion(IDEAL)


def slid(data, friction, until):
    """Way along the blade by Coulomb's law [m]: a flat block, its normal acceleration the blade's.

    s'' = -A_s -+ mu N with N = A_n + theta'' s + 2 theta' s', A the acceleration of where it lies, less gravity.
    """
    t, theta = data["time"].values[:until], data["x"].values[:until, 2]
    v, a, period = data["v"].values, data["a"].values, 1e-3
    s = speed = 0.0
    for k in range(int(np.searchsorted(t, 0.0)), until):
        along, normal = np.array([np.cos(theta[k]), np.sin(theta[k])]), np.array([-np.sin(theta[k]), np.cos(theta[k])])
        felt = a[k, :2] + [0, G]
        pull = felt @ along - v[k, 2] ** 2 * s
        most = friction * max(felt @ normal + a[k, 2] * s + 2 * v[k, 2] * speed, 0.0)
        if speed == 0 and abs(pull) <= most:
            continue
        direction = np.sign(speed) or -np.sign(pull)
        after = speed + period * (-pull - direction * most)
        speed = 0.0 if after * speed < 0 else after
        s += period * speed
    return s


@pytest.mark.parametrize("engine", ["drake", "mujoco"])
def test_a_block_slides_as_coulombs_law_says(engine, plan):
    friction = 1.32
    world = IDEAL.with_overrides({"object.friction": friction, "simulation.engine": engine})
    data = simulate(world, "pd+dob", plan).recording
    start = int(np.searchsorted(data["time"].values, 0.0))
    until = int(np.argmax(data["x"].values[:, 2] > TURNED))
    way = in_tool(data)[until, 1] - in_tool(data)[start, 1]
    expected = slid(data, friction, until)
    assert expected < -4e-3
    assert way == pytest.approx(expected, abs=2.5e-3)
