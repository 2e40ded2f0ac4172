"""The Gymnasium environment: its own checker, the same flips as `simulate`, and bad input."""

import re
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv

from flipdiagram import InputError, measure, simulate
from flipdiagram.environment import ID
from flipdiagram.environment.episode import HOLD, Episode, plan_of, worlds_of
from flipdiagram.environment.turn_over import TurnOver
from flipdiagram.robot.native_arm import native_arm
from flipdiagram.robot.parts import arm_of

ENGINES = ("drake", "mujoco")
ARM = native_arm(arm_of(worlds_of("nominal")[0].believed("drake", {})))
LIMITS = [95.5, 213.9, 114.6, 34.3, 28.6, 23.3]


def flown(env, actions):
    """Observations, rewards and what the last step returned, until an episode that has begun ends or actions do."""
    seen, rewards, last = [], [], None
    for action in actions:
        last = env.step(action)
        seen.append(last[0])
        rewards.append(last[1])
        if last[2] or last[3]:
            break
    return np.array(seen), np.array(rewards), last


@pytest.mark.parametrize("engine", ENGINES)
def test_gymnasiums_own_checker_passes_without_a_warning(engine):
    check_env(gymnasium.make(ID, engine=engine, suite="uncertain").unwrapped)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_seed_and_actions_decide_all_that_is_seen(engine):
    """In a world with noise; another seed draws another world."""
    random = np.random.default_rng(0).uniform(-0.3, 0.3, (30, 6)).astype(np.float32)
    runs = []
    for seed in (3, 3, 4):
        env = TurnOver("uncertain", engine)
        first, info = env.reset(seed=seed)
        runs.append((info["world"], first, *flown(env, random)[:2]))
    same, other = [[np.array_equal(a, b) for a, b in zip(runs[0], run, strict=True)] for run in runs[1:]]
    assert all(same) and not any(other[:1] + other[2:])


def test_all_worlds_are_drawn_and_one_can_be_chosen(monkeypatch):
    begun = []
    monkeypatch.setattr("flipdiagram.environment.turn_over.Episode", lambda world, engine, plan: begun.append(world))
    monkeypatch.setattr("flipdiagram.environment.turn_over.plan_of", lambda suite, index: None)
    env = TurnOver("nominal")
    for seed in range(60):
        with pytest.raises(AttributeError):  # None is no episode that can be observed
            env.reset(seed=seed)
    assert {world.index for world in begun} == set(range(8))
    with pytest.raises(AttributeError):
        env.reset(options={"world": 5})
    assert begun[-1] is worlds_of("nominal")[5]


@pytest.mark.parametrize(
    ("engine", "architecture"), [("drake", "pd+ff+dob"), ("mujoco", "pd+ff+dob"), ("mujoco", "pd")]
)
def test_the_torques_of_a_recorded_flip_bring_the_same_flip(engine, architecture):
    """A flip of `simulate`, replayed period by period: same verdict, metrics, observations, and the reward follows.

    Torque over limit times limit is another last digit, of which contact can make some micrometres; a sample later the
    tool has moved by 0.7 mm.
    """
    plan = plan_of("nominal", 0)
    truth = worlds_of("nominal")[0].truth(engine, {"simulation.hold_time": HOLD})
    data = simulate(truth, architecture, plan).recording
    found = measure(data)
    assert found.success == (architecture != "pd")

    env = TurnOver("nominal", engine, action_repeat=1)
    first, _ = env.reset(options={"world": 0})
    seen, rewards, (_, _, terminated, truncated, info) = flown(env, data["tau"].values / LIMITS)
    assert terminated and not truncated
    assert info["success"] is found.success and info["failure"] == (found.failure or "")
    for name in ("touchdown_time_s", "touchdown_theta_rad", "release_time_s", "landing_cost_J", "max_slip_m"):
        expected = getattr(found.touchdown, name[10:]) if name.startswith("touchdown") else getattr(found, name)
        assert info["metrics"][name] == pytest.approx(expected, rel=1e-3)

    k = len(seen)
    assert info["time_s"] == pytest.approx(found.touchdown.time_s + 0.001)
    seen = np.vstack([first, seen])
    x_meas = np.array([ARM.task_position(row[:6].astype(float))[:3] for row in seen])
    np.testing.assert_allclose(x_meas[:k], data["x_meas"].values[:k], rtol=0, atol=1e-4)
    for signal, column in (("x_cmd", 12), ("v_cmd", 18), ("a_cmd", 24)):
        np.testing.assert_allclose(seen[:k, column : column + 3], data[signal].values[:k], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(seen[:k, 30], plan.touchdown_time - data["time"].values[:k], atol=1e-6)

    error = data["x"].values - data["x_cmd"].values
    along = np.exp(-(error[:, 0] ** 2 + error[:, 1] ** 2) / 0.02**2 - (error[:, 2] / 0.2) ** 2)
    before = (data["time"].values > -HOLD + 1e-9) & (data["time"].values <= plan.touchdown_time)
    expected = along[before][:k].sum() * 0.001 / (HOLD + plan.touchdown_time) + found.success
    assert rewards.sum() == pytest.approx(expected, abs=3e-3)


def test_a_torque_is_recorded_from_the_sample_whose_sensors_were_seen():
    """In a world with noise: what is seen before a torque is given is what the recording has at the same sample."""
    episode = Episode(worlds_of("uncertain")[0], "mujoco", plan_of("uncertain", 0))
    given, seen = [[0, -60, -20, 0, 0, 0]] * 60 + [[9] * 6] * 50, []
    for k in (*range(60), 60):
        seen.append(episode.seen()["q"])
        episode.apply(np.array(given[k], dtype=float), 50 if k == 60 else 1)
    data = episode.recording()
    np.testing.assert_array_equal(data["tau"].values, given)
    np.testing.assert_allclose(data["time"].values, np.arange(-100, 10) * 0.001, atol=1e-12)
    np.testing.assert_allclose([ARM.task_position(q)[:3] for q in seen], data["x_meas"].values[:61], rtol=0, atol=1e-12)
    assert np.abs(np.diff(data["x_meas"].values, axis=0)).max() > 1e-9 and episode.time == pytest.approx(0.01)


def test_an_action_is_a_share_of_the_limits_and_ends_there():
    env, metrics = TurnOver("nominal", "mujoco"), []
    for action in (np.ones(6, np.float32), np.full(6, 3.0)):
        env.reset(options={"world": 0})
        seen, _, (_, _, terminated, _, info) = flown(env, [action] * 400)
        assert terminated and not info["success"]
        assert all(row in env.observation_space for row in seen)
        metrics.append(info["metrics"])
    np.testing.assert_allclose(metrics[0]["max_torque_cmd_Nm"], LIMITS)
    for name, value in metrics[0].items():
        np.testing.assert_array_equal(value, metrics[1][name], name)


def test_an_arm_that_stays_where_it_is_ends_with_the_time():
    env = TurnOver("nominal", "mujoco", action_repeat=10)
    seen, info = env.reset(options={"world": 0})
    start, rewards = seen[:6].astype(float), []
    for _ in range(200):
        q, qd = seen[:6].astype(float), seen[6:12].astype(float)
        tau = ARM.inverse_dynamics(q, qd, 400 * (start - q) - 40 * qd)
        seen, reward, terminated, truncated, info = env.step(tau / ARM.tau_max)
        rewards.append(reward)
        if terminated or truncated:
            break
    assert truncated and not terminated and not info["success"] and info["failure"]
    plan = plan_of("nominal", 0)
    assert len(rewards) * 0.01 == pytest.approx(HOLD + max(plan.end_time, plan.touchdown_time) + 0.4, abs=0.01)
    assert min(rewards[:9]) > 0.99 * rewards[0] and rewards[-1] == 0 and sum(rewards) < 0.5
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(6))


def test_a_simulation_that_diverges_ends_the_episode(monkeypatch):
    from flipdiagram import SimulationError

    env = TurnOver("nominal", "mujoco")
    first, _ = env.reset(seed=0)

    def diverges(tau, periods):
        raise SimulationError("the simulation diverged")

    monkeypatch.setattr(env._episode, "apply", diverges)
    seen, reward, terminated, truncated, info = env.step(np.zeros(6))
    assert (reward, terminated, truncated, info["success"]) == (0.0, True, False, False)
    assert "diverged" in info["failure"] and np.array_equal(seen, first)


def test_two_processes_that_know_the_name_of_the_module_alone_fly_what_one_flies():
    """spawn: the tests' own process has run threads, which a fork may not survive."""
    name = f"flipdiagram.environment:{ID}"
    vector = AsyncVectorEnv([lambda: gymnasium.make(name, suite="uncertain", engine="mujoco")] * 2, context="spawn")
    try:
        begun, _ = vector.reset(seed=7)
        ended = [vector.step(np.ones((2, 6), np.float32)) for _ in range(40)]
    finally:
        vector.close()
    for k in range(2):
        env = TurnOver("uncertain", "mujoco")
        assert np.array_equal(begun[k], env.reset(seed=7 + k)[0])
        seen, rewards, (_, _, terminated, _, info) = flown(env, [np.ones(6, np.float32)] * 40)
        last = len(seen) - 1
        assert np.array_equal(seen, [step[0][k] for step in ended[: last + 1]])
        assert terminated and ended[last][2][k]
        assert ended[last][4]["failure"][k] == info["failure"]
        assert ended[last][4]["metrics"]["touchdown_time_s"][k] == info["metrics"]["touchdown_time_s"]


BAD_KEYWORDS = {
    "suite": ({"suite": "easy"}, "suite = 'easy'; choose from nominal, uncertain, disturbed, hard"),
    "engine": ({"engine": "bullet"}, "engine = 'bullet'; choose from drake, mujoco"),
    "repeat": ({"action_repeat": 0}, "action_repeat = 0; valid is a whole number of periods from 1"),
    "part": ({"action_repeat": 2.5}, "action_repeat = 2.5; valid is a whole number"),
    "render": ({"render_mode": "human"}, "render_mode = 'human'; valid is None"),
}


@pytest.mark.parametrize("case", BAD_KEYWORDS)
def test_a_bad_keyword_is_refused_in_one_line(case):
    given, said = BAD_KEYWORDS[case]
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        TurnOver(**given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"world": 8}, "options['world'] = 8; valid is a whole number from 0 to 7, suite 'nominal'"),
        ({"world": -1}, "options['world'] = -1; valid is"),
        ({"world": "first"}, "options['world'] = 'first'; valid is"),
        ({"word": 1}, "options['word'] = 1; valid is the option 'world' alone"),
    ],
)
def test_a_bad_option_is_refused_in_one_line(options, said):
    with pytest.raises(InputError, match=re.escape(said)):
        TurnOver().reset(options=options)


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (np.zeros(5), "action of shape (5,); valid is (6,)"),
        ("up", "action = 'up'; valid is 6 numbers"),
        ([0, 0, float("nan"), 0, 0, 0], "nan, 0.0, 0.0, 0.0]; valid is 6 finite numbers"),
    ],
)
def test_a_bad_action_is_refused_in_one_line(action, said):
    env = TurnOver("nominal", "mujoco")
    env.reset(options={"world": 0})
    with pytest.raises(InputError, match=re.escape(said)):
        env.step(action)


def test_without_gymnasium_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "flipdiagram.environment")
    with pytest.raises(InputError, match=re.escape("pip install 'flipdiagram[gym]'")):
        __import__("flipdiagram.environment")
