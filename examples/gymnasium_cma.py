"""An evolution strategy teaches a PD law to turn the block over.

The law alone loses the block.  CMA-ES (Hansen; the library `cma`) searches three gains of a linear residual on top of
it in one world of the challenge, and the best is flown in worlds that it has not seen.  Half a minute on one core.

    pip install 'flipdiagram[examples]'
    python examples/gymnasium_cma.py
"""

from typing import Any

import cma
import gymnasium
import numpy as np
from numpy.typing import NDArray

import flipdiagram.environment as environment
from flipdiagram import Scenario
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of

Array = NDArray[np.float64]
ARM = native_arm(arm_of(Scenario()))
K_P, K_V = 200.0, 28.0
"""Of the PD law: [1/s^2], [1/s]."""
GENERATIONS, FLIPS = 4, 6


def action(observation: Array, gains: Array) -> Array:
    """Shares of the torque limits (6,): PD on the tool, and the residual gains (3,) of its errors and of a_cmd."""
    q, qd, x_cmd, v_cmd, a_cmd = np.split(observation[:30].astype(float), [6, 12, 18, 24])
    x, v, J, bias = ARM.task_kinematics(q, qd)
    a = K_P * (1 + gains[0]) * (x_cmd - x) + K_V * (1 + gains[1]) * (v_cmd - v) + gains[2] * a_cmd
    return np.asarray(ARM.inverse_dynamics(q, qd, np.linalg.solve(J, a - bias)) / ARM.tau_max)


def fly(env: gymnasium.Env[Any, Any], gains: Array, world: int) -> tuple[float, str]:
    """The return of one flip, and how it ended."""
    observation, _ = env.reset(options={"world": world})
    total, ended, info = 0.0, False, dict[str, Any]()
    while not ended:
        observation, reward, terminated, truncated, info = env.step(action(observation, gains).astype(np.float32))
        total, ended = total + float(reward), terminated or truncated
    return total, info["failure"] or "turned over"


def main() -> None:
    """Learn in world 0 of the suite `nominal`, then fly others."""
    env = gymnasium.make(environment.ID, suite="nominal", engine="mujoco")
    print("PD alone:      return {:.2f}, {}".format(*fly(env, np.zeros(3), 0)))
    search = cma.CMAEvolutionStrategy(np.zeros(3), 1.0, {"seed": 1, "popsize": FLIPS, "verbose": -9})
    for generation in range(1, GENERATIONS + 1):
        asked = search.ask()
        search.tell(asked, [-fly(env, gains, 0)[0] for gains in asked])
        print(f"generation {generation}:  best return {-search.best.f:.2f}, gains {search.best.x.round(2)}")
    for world in (2, 4, 6):
        print("world {}:       return {:.2f}, {}".format(world, *fly(env, search.best.x, world)))


if __name__ == "__main__":
    main()
