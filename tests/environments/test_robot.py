"""Claims about the environment of one robot: it keeps Gymnasium's rules, and does what it does in a swarm's."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import (
    FlattenObservation,
    FrameStackObservation,
    NormalizeObservation,
    RecordEpisodeStatistics,
    TimeLimit,
)
from matplotlib import pyplot

from epuck_sim.environments import ROBOT_ENV, RobotEnv, parallel_env
from epuck_sim.errors import ScenarioError

AMONG_FIREFLIES = {"robots": [{"count": 2}, {"count": 1, "controller": "external"}]}


@pytest.fixture
def windows(monkeypatch) -> list[float]:
    """Return the pauses in which windows are drawn, none of which is waited for."""
    drawn: list[float] = []
    monkeypatch.setattr(pyplot, "pause", drawn.append)
    return drawn


@pytest.mark.parametrize("actions", ["continuous", "discrete"])
def test_gymnasiums_check_passes_by_the_registered_name(actions, windows):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(f"epuck_sim.environments:{ROBOT_ENV}", actions=actions).unwrapped)
    assert windows
    assert not pyplot.get_fignums()


def test_it_does_what_the_agent_of_a_swarm_does_to_the_bit():
    robot = RobotEnv(AMONG_FIREFLIES, seed=3, reward="coverage", episode_s=2.0)
    swarm = parallel_env(AMONG_FIREFLIES, seed=3, reward="coverage", episode_s=2.0)
    for _ in range(2):
        observation, infos = robot.reset()
        rows, expected_infos = swarm.reset()
        while swarm.agents:
            np.testing.assert_array_equal(observation, rows["robot_2"])
            action = swarm.action_space("robot_2").sample()
            observation, *found, infos = robot.step(action)
            rows, *expected, expected_infos = swarm.step({"robot_2": action})
            assert found == [values["robot_2"] for values in expected]
            assert infos == expected_infos["robot_2"]
        with pytest.raises(ValueError, match="call reset"):
            robot.step(action)


def test_wrappers_that_people_use_work():
    wrapped = gymnasium.make(ROBOT_ENV, max_episode_steps=12, reward="coverage", render_mode="rgb_array")
    assert isinstance(wrapped, TimeLimit)
    wrapped = RecordEpisodeStatistics(FrameStackObservation(NormalizeObservation(FlattenObservation(wrapped)), 4))
    observation, _ = wrapped.reset(seed=1)
    assert wrapped.observation_space.contains(observation)
    total = 0.0
    for step in range(12):
        observation, reward, terminated, truncated, infos = wrapped.step(wrapped.action_space.sample())
        total += reward
        assert (terminated, truncated) == (False, step == 11)
    assert observation.shape == (4, *wrapped.unwrapped.observation_space.shape)
    assert infos["episode"]["l"] == 12
    assert infos["episode"]["r"] == pytest.approx(total)
    assert wrapped.render().shape == (480, 480, 3)
    wrapped.close()


def test_a_batch_of_robots_has_the_same_episodes_as_robots_one_by_one():
    batch = gymnasium.make_vec(ROBOT_ENV, num_envs=3, scenario=AMONG_FIREFLIES)
    singles = [gymnasium.make(ROBOT_ENV, scenario=AMONG_FIREFLIES) for _ in range(3)]
    assert batch.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    rows, _ = batch.reset(seed=5)
    alone = [env.reset(seed=5 + swarm)[0] for swarm, env in enumerate(singles)]
    for _ in range(20):
        np.testing.assert_array_equal(rows, alone)
        actions = batch.action_space.sample()
        rows, *_ = batch.step(actions)
        alone = [env.step(action)[0] for env, action in zip(singles, actions, strict=True)]
    batch.close()


def test_a_window_shows_each_step_by_itself_and_closes(windows):
    robot = RobotEnv(AMONG_FIREFLIES, render_mode="human")
    robot.reset(seed=np.int64(1))
    robot.step(np.zeros(3))
    assert len(windows) == 2
    robot.close()
    robot.close()
    assert not pyplot.get_fignums()


@pytest.mark.parametrize("make", [RobotEnv, lambda scenario: gymnasium.make_vec(ROBOT_ENV, 2, scenario=scenario)])
@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ({"robots": [{"count": 2, "controller": "external"}]}, "2 robots of the scenario are driven from outside"),
        ("thesis", "10 robots of the scenario are driven from outside"),
    ],
)
def test_swarms_without_exactly_one_driven_robot_are_refused(make, scenario, message):
    with pytest.raises(ScenarioError, match=message):
        make(scenario)
