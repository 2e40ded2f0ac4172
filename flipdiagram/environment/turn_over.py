"""The environment `flipdiagram/TurnOver-v0`: joint torques of an agent in the worlds of the challenge."""

from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from flipdiagram.diagrams.loop import ENGINES
from flipdiagram.environment.episode import HOLD, Episode, plan_of, worlds_of
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.robot.parts import arm_of
from flipdiagram.simulation.metrics import FlipMetrics, measure
from flipdiagram.studies.challenge.suites import load_suites

Vector = NDArray[np.float32]
JOINTS = 6
OBSERVED = {
    "q": (JOINTS, 4 * np.pi),
    "qd": (JOINTS, 100.0),
    "x_cmd": (6, 4 * np.pi),
    "v_cmd": (6, 100.0),
    "a_cmd": (6, 1000.0),
    "time_to_go": (1, 10.0),
}
"""Of what an observation is made, in this order: how many numbers, and where they are cut off, ±, in their unit."""
POSITION_SCALE, ANGLE_SCALE = 0.02, 0.2
"""Errors [m], [rad] at which the reward for following is down to 1/e."""


class TurnOver(gymnasium.Env[Vector, Vector]):
    """Turn the block over: torques of the arm's six joints so that the tool follows a planned motion.

    An episode is one flip in a public world of the challenge.  The arm stands at the start, the block on the blade; the
    start is to be held for 0.1 s (in the challenge 1 s), then the planned motion starts, which is over after 0.4 s or
    so; the block lands 0.1 s later.

    **Action**, Box(-1, 1, (6,), float32): the torque of each joint as a share of its limit, 95.5, 213.9, 114.6, 34.3,
    28.6, 23.3 N m.  It is the whole torque: with 0 the arm falls.  It holds for `action_repeat` periods of 1 ms.

    **Observation**, Box((31,), float32), at the instant from which the next action acts:

    | numbers | signal | unit |
    | --- | --- | --- |
    | 0-5 | q, joint angles as the sensors show them: late, filtered, noisy, as the world has it | rad |
    | 6-11 | qd, joint speeds as the sensors show them | rad/s |
    | 12-17 | x_cmd, planned y, z, theta, x, pitch, yaw of the object on the tool | m, m, rad, m, rad, rad |
    | 18-23 | v_cmd, their planned speeds | per s |
    | 24-29 | a_cmd, their planned accelerations | per s^2 |
    | 30 | time to the planned touch-down of the block, below 0 after it | s |

    Numbers beyond the bounds of the space (q 4 pi, qd and v_cmd 100, a_cmd 1000) are cut off there.

    **Reward**: following pays exp(-(e / 0.02 m)^2 - (e_theta / 0.2 rad)^2) times the share of the time until the
    planned touch-down that the step takes, 1 in all for a tool that is always where it should be; e and e_theta are the
    true errors in the plane y, z and in theta at the end of the step.  A block that is turned over pays 1 at the end.

    **End**: terminated when the block touches the table, or the simulation diverges; truncated 0.4 s after plan and
    planned touch-down are over, as the challenge does.

    **info**: `time_s`, 0 where the motion starts; of `reset` also `suite`, `world`, `hash`; at the end `success`,
    `failure` (why not, in words, else empty) and `metrics`, the fields of `flipdiagram.FlipMetrics` as far as the
    episode went, nan where there is nothing to measure.
    """

    metadata = {"render_modes": []}

    def __init__(
        self, suite: str = "nominal", engine: str = "drake", action_repeat: int = 5, render_mode: str | None = None
    ) -> None:
        """An environment of its own random generator; each `reset` picks a world.

        Args:
            suite: of the challenge: nominal, uncertain, disturbed, hard.
            engine: drake or mujoco.
            action_repeat: periods of 1 ms for which an action holds.
            render_mode: None; nothing is drawn.

        Raises InputError for another value.
        """
        names = load_suites().names
        if suite not in names:
            raise InputError.of("suite", suite, names)
        if engine not in ENGINES:
            raise InputError.of("engine", engine, tuple(ENGINES))
        if isinstance(action_repeat, bool) or not isinstance(action_repeat, int) or action_repeat < 1:
            raise InputError.of("action_repeat", action_repeat, "a whole number of periods from 1")
        if render_mode is not None:
            raise InputError.of("render_mode", render_mode, "None: nothing is drawn")
        self.suite, self.engine, self.action_repeat, self.render_mode = suite, engine, action_repeat, render_mode
        self._worlds = worlds_of(suite)
        self._tau_max = arm_of(self._worlds[0].believed(engine, {})).tau_max
        bounds = np.concatenate([np.full(n, bound, np.float32) for n, bound in OBSERVED.values()])
        self.observation_space = Box(-bounds, bounds, dtype=np.float32)
        self.action_space = Box(-1.0, 1.0, (JOINTS,), np.float32)
        self._episode: Episode | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vector, dict[str, Any]]:
        """Begin a flip in a world drawn from the suite, or in options["world"], its number from 0.

        Raises InputError for another option or number, PlanningError where the arm or the physics allow no motion.
        """
        super().reset(seed=seed)
        index = self._chosen(options or {})
        world = self._worlds[index]
        self._episode = Episode(world, self.engine, plan_of(self.suite, index))
        found = {"suite": self.suite, "world": index, "hash": world.hash, "time_s": self._episode.time}
        return self._observation(self._episode), found

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Send the torques of an action (6,) [share of the limits] for `action_repeat` periods.

        Raises InputError for an action of another shape or one that is not finite, ResetNeeded where no episode runs.
        """
        if (episode := self._episode) is None:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset() first")
        tau = np.clip(_checked(action), -1.0, 1.0) * self._tau_max
        last, begin = self._observation(episode), episode.time
        try:
            episode.apply(tau, self.action_repeat)
        except SimulationError as error:
            self._episode = None
            return last, 0.0, True, False, {"time_s": begin, "success": False, "failure": str(error)}
        reward, info = _following(episode, begin), dict[str, Any](time_s=episode.time)
        terminated, truncated = episode.landed, episode.over and not episode.landed
        if terminated or truncated:
            self._episode = None
            measured = measure(episode.recording())
            reward += float(measured.success)
            info |= {"success": measured.success, "failure": measured.failure or "", "metrics": _numbers(measured)}
        return self._observation(episode), reward, terminated, truncated, info

    def _chosen(self, options: dict[str, Any]) -> int:
        """The number of the next world."""
        if unknown := [name for name in options if name != "world"]:
            raise InputError.of(f"options['{unknown[0]}']", options[unknown[0]], "the option 'world' alone")
        if "world" not in options:
            return int(self.np_random.integers(len(self._worlds)))
        index, last = options["world"], len(self._worlds) - 1
        if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index <= last:
            raise InputError.of("options['world']", index, f"a whole number from 0 to {last}, suite '{self.suite}'")
        return int(index)

    def _observation(self, episode: Episode) -> Vector:
        seen = episode.seen() | {"time_to_go": np.array([episode.plan.touchdown_time - episode.time])}
        flat = np.concatenate([seen[name] for name in OBSERVED])
        assert isinstance(self.observation_space, Box)
        return np.clip(flat, self.observation_space.low, self.observation_space.high).astype(np.float32)


def _checked(action: Any) -> NDArray[np.float64]:
    try:
        share = np.asarray(action, dtype=float)
    except (TypeError, ValueError):
        raise InputError.of("action", action, f"{JOINTS} numbers") from None
    if share.shape != (JOINTS,):
        raise InputError.of("action", action, f"({JOINTS},)", f"action of shape {share.shape}")
    if not np.isfinite(share).all():
        raise InputError.of("action", action, f"{JOINTS} finite numbers", f"action = {share.tolist()}")
    return share


def _following(episode: Episode, begin: float) -> float:
    """The reward for following in a step that began at a time [s]."""
    planned = episode.plan.touchdown_time
    share = (min(episode.time, planned) - begin) / (planned + HOLD)
    if share <= 0:
        return 0.0
    y, z, theta = episode.tool - episode.seen()["x_cmd"][:3]
    return float(share * np.exp(-(y * y + z * z) / POSITION_SCALE**2 - (theta / ANGLE_SCALE) ** 2))


def _numbers(measured: FlipMetrics) -> dict[str, Any]:
    """The metrics that are numbers, the touch-down among them, each always there: so vectorised infos are arrays."""
    fields = asdict(measured)
    landed = fields.pop("touchdown") or dict.fromkeys(("time_s", "y_m", "z_m", "theta_rad"), np.nan)
    fields |= {f"touchdown_{name}": value for name, value in landed.items()}
    lists = {name: np.array(value) for name, value in fields.items() if isinstance(value, list)}
    return {name: float(value) for name, value in fields.items() if isinstance(value, float)} | lists
