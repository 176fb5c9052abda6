"""Claims about Gymnasium's environments: one robot does what it does in a swarm, and swarms in a batch as alone."""

import pickle
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from matplotlib import pyplot

from epuck_sim import ControllerError, ScenarioError, Simulation
from epuck_sim.control.loader import find_controller
from epuck_sim.environments import ROBOT_ENV, RobotEnv, coverage, parallel_env, vector_env
from tests.control.bench import with_step

SWARM = {"name": "free", "robots": [{"count": 3, "controller": "external"}, {"count": 2}]}
AMONG_FIREFLIES = {"robots": [{"count": 2}, {"count": 1, "controller": "external"}]}


def policy(rows):
    """Return actions that depend on all that is observed."""
    return np.tanh(rows @ np.sin(np.outer(np.arange(rows.shape[1]), [1.0, 2.0, 3.0])))


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_swarm_does_what_it_does_alone_to_the_bit(threads):
    """Policies are evaluated in the same batches, as sums of floats depend on them; no reward is of a first moment."""
    task = {"reward": lambda each: np.where(each.time_s > 0, coverage(each), np.nan), "episode_s": 2.0}
    batch = vector_env(SWARM, 4, seed=7, threads=threads, **task)
    rows, _ = batch.reset()
    singles = [parallel_env(SWARM, seed=7 + swarm, **task) for swarm in range(4)]
    alone = [list(env.reset()[0].values()) for env in singles]
    over = np.zeros(4, bool)
    for _ in range(50):
        np.testing.assert_array_equal(rows, np.concatenate(alone))
        assert batch.observation_space.contains(rows)
        actions = policy(rows)
        rows, rewards, terminated, truncated, infos = batch.step(actions)
        for swarm, env in enumerate(singles):
            mine = slice(3 * swarm, 3 * swarm + 3)
            if over[swarm]:
                alone[swarm] = list(env.reset()[0].values())
                assert not rewards[mine].any()
                assert not truncated[mine].any()
                over[swarm] = False
                continue
            acted = dict(zip(env.agents, actions[mine], strict=True))
            seen, got, _, ended, told = env.step(acted)
            assert infos["contacts"][mine].tolist() == [each["contacts"] for each in told.values()]
            alone[swarm] = list(seen.values())
            assert rewards[mine].tolist() == list(got.values())
            assert truncated[mine].tolist() == list(ended.values())
            over[swarm] = truncated[mine].any()
        assert not terminated.any()
    batch.close()


SLOWER = {"schedule": [{"at_s": 0.5, "set": {"robots.1.parameters.speed_cm_s": 1.0}}]}
FAULTY = {"faults": [{"kind": "ring_dead", "share": 0.5, "at_s": 0.5}]}
WITH_FEW_PIXELS = {"robots": [{**SWARM["robots"][0], "camera": {"pixels": 20}}, {"count": 2}]}


@pytest.mark.parametrize("changes", [{}, SLOWER, FAULTY, WITH_FEW_PIXELS])
def test_swarms_do_what_simulations_do(changes):
    """Where Python has a part in steps, and where compiled code takes all of them."""
    batch = vector_env({**SWARM, **changes}, 3, seed=7, control_steps=3)
    rows, _ = batch.reset()
    alone = [Simulation({**SWARM, **changes}, each.seed) for each in batch.simulations]
    steps = [next(each) for each in alone]
    for _ in range(10):
        camera = np.concatenate([step.camera[:3] for step in steps])
        np.testing.assert_array_equal(rows[:, batch.observation_fields["camera"]], camera)
        np.testing.assert_array_equal(batch.look().poses, [step.poses for step in steps])
        actions = policy(rows)
        rows, *_ = batch.step(actions)
        for each, (left, right, ring) in zip(alone, actions.reshape(3, 3, 3).transpose(0, 2, 1), strict=True):
            each.command(*(12.8 * np.array([left, right], float)), ring > 0)
        steps = [each.advance(3) for each in alone]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_copy_steps_swarms_of_its_own_and_has_the_reward_of_its_file(threads, tmp_path):
    (tmp_path / "mine.py").write_text("def reward(situation):\n    return situation.poses[..., 0]\n")
    batch = vector_env(SWARM, 2, seed=7, threads=threads, reward=tmp_path / "mine.py")
    copy = pickle.loads(pickle.dumps(batch))
    rows, _ = copy.reset()
    np.testing.assert_array_equal(batch.reset()[0], rows)
    later = [copy.step(policy(rows))[0] for _ in range(3)][-1]
    np.testing.assert_array_equal(copy.step(policy(rows))[1].reshape(2, 3), copy.look().poses[:, :3, 0])
    assert [each.steps for each in batch.simulations] == [1, 1]
    batch.close()  # which ends its threads alone
    np.testing.assert_array_equal([batch.step(policy(rows))[0] for _ in range(3)][-1], later)
    with pytest.raises(ValueError, match="an episode is under way and cannot be copied"):
        pickle.dumps(batch)


def test_resets_take_one_seed_or_one_for_each_swarm():
    batch = vector_env(SWARM, 3)
    rows, _ = batch.reset(seed=5)
    assert batch.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    again, _ = batch.reset(seed=[5, 6, 7])
    np.testing.assert_array_equal(rows, again)
    assert (batch.reset()[0] != again).any()
    with pytest.raises(ValueError, match="seed holds 2 seeds; allowed: one for each of 3"):
        batch.reset(seed=[1, 2])


def test_steps_need_actions_for_each_agent_of_an_episode_that_has_begun_and_the_controllers_that_were_there():
    batch = vector_env(SWARM, 2)
    for message in ("call reset", "allowed: 6 rows"):
        with pytest.raises(ValueError, match=message):
            batch.step(np.zeros((5, 3)))
        batch.reset()
    batch.simulations[1].replace_controller(1, find_controller("firefly"))
    with pytest.raises(ValueError, match="controller was replaced"):
        batch.step(np.zeros((6, 3)))


def test_an_error_of_a_controller_in_a_thread_reaches_the_caller_and_no_other_thread_goes_on(tmp_path):
    path = tmp_path / "late.py"
    path.write_text(with_step("memory.x += 1; actuators.left_cm_s = 1 / (5 - memory.x)"))
    robots = [{"count": 1, "controller": controller} for controller in ("external", str(path))]
    batch = vector_env({"robots": robots}, 3, threads=2)
    batch.reset()
    for _ in range(3):
        batch.step(np.zeros((3, 3)))
    with pytest.raises(ControllerError, match=r"robot 1, step 4.*late.py"):
        batch.step(np.zeros((3, 3)))
    path.write_text(with_step("memory.x += 1 / (1 - parameters.gain)").replace("{}", "{'gain': 0.0}"))
    robots = [{"count": 1, "controller": "external"}, {"count": 9, "controller": str(path)}]
    batch = vector_env({"robots": robots}, 2, threads=2, control_steps=20_000, episode_s=1e6)
    batch.reset()
    batch.simulations[0].set_parameters(1, gain=1.0)
    with pytest.raises(ControllerError, match=r"robot 1, .*late.py"):
        batch.step(np.zeros((2, 3)))
    assert batch.simulations[1].steps == 20_001


def test_swarms_and_arenas_that_change_are_refused():
    for changes in (
        {"schedule": [{"at_s": 1, "remove": [1]}]},
        {"schedule": [{"at_s": 1, "set": {"arena.width_cm": 90}}]},
        {"robots": [*SWARM["robots"], {"count": 1, "present": False}]},
    ):
        with pytest.raises(ScenarioError, match="robots come or go, or walls move; allowed in environments: neither"):
            vector_env({**SWARM, **changes}, 2)
    for moment in ({"at_cycle": 1}, {"when": "order_parameter > 0.5"}):
        schedule = [{"displace": {"by_cycles": 0.5}, **moment}]
        with pytest.raises(ScenarioError, match=r"schedule\.0: has no at_s; environments need one"):
            vector_env({"robots": [{"controller": "external_wheels"}], "schedule": schedule}, 2)


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


def test_it_does_what_the_agent_of_a_swarm_does_to_the_bit_and_a_batch_by_its_name_what_a_batch_of_swarms_does():
    batch = gymnasium.make_vec(ROBOT_ENV, num_envs=3, scenario=AMONG_FIREFLIES)
    np.testing.assert_array_equal(batch.reset(seed=5)[0], vector_env(AMONG_FIREFLIES, 3).reset(seed=5)[0])
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
    assert isinstance(wrapped, wrappers.TimeLimit)
    wrapped = wrappers.NormalizeObservation(wrappers.FlattenObservation(wrapped))
    wrapped = wrappers.RecordEpisodeStatistics(wrappers.FrameStackObservation(wrapped, 4))
    observation, _ = wrapped.reset(seed=1)
    assert wrapped.observation_space.contains(observation)
    total = 0.0
    for step in range(12):
        observation, reward, terminated, truncated, infos = wrapped.step(wrapped.action_space.sample())
        total += reward
        assert (terminated, truncated) == (False, step == 11)
    assert observation.shape == (4, *wrapped.unwrapped.observation_space.shape)
    assert infos["episode"]["l"] == 12
    assert {"order_parameter", "t_sync_cycles", "synchronised"} <= infos.keys()
    assert infos["episode"]["r"] == pytest.approx(total)
    assert wrapped.render().shape == (480, 480, 3)
    wrapped.close()
    batch = wrappers.vector.RecordEpisodeStatistics(vector_env(SWARM, 2, seed=1, actions="discrete", episode_s=1.0))
    batch.reset(seed=1)
    for _ in range(10):
        *_, truncated, infos = batch.step(batch.action_space.sample())
    assert truncated.all()
    assert infos["episode"]["l"].tolist() == [10] * 6


def test_a_window_shows_each_step_by_itself_and_closes(windows):
    robot = RobotEnv(AMONG_FIREFLIES, render_mode="human")
    robot.reset(seed=np.int64(1))
    robot.step(np.zeros(3))
    assert len(windows) == 2
    robot.close()
    robot.close()
    assert not pyplot.get_fignums()


@pytest.mark.parametrize("make", [RobotEnv, lambda scenario: gymnasium.make_vec(ROBOT_ENV, 2, scenario=scenario)])
def test_swarms_without_exactly_one_driven_robot_are_refused(make):
    for scenario, count in (({"robots": [{"count": 2, "controller": "external"}]}, 2), ("thesis", 10)):
        with pytest.raises(ScenarioError, match=f"{count} robots are driven from outside"):
            make(scenario)
    with pytest.raises(ValueError, match="max_episode_steps is 9; allowed: episode_s, in simulated seconds"):
        gymnasium.make_vec(ROBOT_ENV, 2, max_episode_steps=9)
    with pytest.raises(ValueError, match="render_mode is 'human'; allowed: None; only single environments"):
        gymnasium.make_vec(ROBOT_ENV, 2, render_mode="human")
