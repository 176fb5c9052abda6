"""Claims about the PettingZoo environment: it keeps PettingZoo's rules, and agents act exactly as controllers would."""

import importlib
import math
import sys
import warnings
from functools import partial

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils import AssertOutOfBoundsWrapper, OrderEnforcingWrapper, parallel_to_aec

from epuck_sim import ScenarioError, Simulation, epuck, load_scenario, run_trial
from epuck_sim.environments import parallel_env
from epuck_sim.environments.rewards import Situation, aggregation, coverage, synchrony
from epuck_sim.util.seeds import trial_seed
from tests.control.bench import with_sense

SWARM = {"name": "free", "robots": [{"count": 3, "controller": "external"}, {"count": 2}]}
DANCERS = {"name": "dancers", "robots": [{"count": 4, "controller": "external_wheels"}]}
BLINKERS = {"name": "blinkers", "robots": [{"count": 2, "controller": "external_ring"}]}
TASKS = [(SWARM, "coverage"), (DANCERS, "synchrony"), (BLINKERS, "aggregation")]
AGENTS = ["robot_0", "robot_1", "robot_2"]  # those of `SWARM`


@pytest.mark.parametrize("actions", ["continuous", "discrete"])
@pytest.mark.parametrize(("scenario", "reward"), TASKS)
def test_pettingzoos_tests_pass(scenario, reward, actions):
    make = partial(parallel_env, scenario, reward=reward, actions=actions, episode_s=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(make(), num_cycles=15)
        parallel_seed_test(make, num_cycles=15)
        if actions == "discrete":
            api_test(OrderEnforcingWrapper(AssertOutOfBoundsWrapper(parallel_to_aec(make()))), num_cycles=15)


@pytest.mark.parametrize("scenario", ["thesis", "kilobots", {"robots": [{"memory": {"phase_ms": 9}}]}])
def test_where_no_robot_is_driven_from_outside_all_are_commanded(scenario):
    env = parallel_env(scenario, seed=4)
    env.reset()
    assert len(env.agents) == load_scenario(scenario).population
    env.step({agent: np.array([1, -1, 1], np.float32) for agent in env.agents})
    assert env.state()[:, 3].all()  # rings are lit


@pytest.mark.parametrize("actions", ["continuous", "discrete"])
def test_observations_are_in_their_space_and_mean_what_is_documented(actions):
    env = parallel_env(SWARM, seed=4, actions=actions)
    observations, _ = env.reset()
    assert env.agents == AGENTS
    alone = Simulation(SWARM, 4)
    step = next(alone)
    for _ in range(40):
        for robot, agent in enumerate(env.agents):
            seen = observations[agent]
            assert env.observation_space(agent).contains(seen)
            part = {name: seen[columns] for name, columns in env.observation_fields.items()}
            np.testing.assert_array_equal(part["camera"], step.camera[robot])
            np.testing.assert_allclose(part["wheels"] * 12.8, step.wheels_cm_s[robot], atol=1e-5)
            assert part["ring"] == step.ring_on[robot]
            near = np.clip(step.infrared[robot] / epuck.INFRARED_PEAK_COUNTS, 0, 1)
            np.testing.assert_allclose(part["infrared"], near, atol=1e-6)
        chosen = {agent: env.action_space(agent).sample() for agent in env.agents}
        if actions == "continuous":
            speeds = np.array([chosen[agent] for agent in env.agents], float)  # actions have float32
            alone.command(12.8 * speeds[:, 0], 12.8 * speeds[:, 1], speeds[:, 2] > 0)
        else:
            motions = np.array([(0, 0), (1, 1), (-1, -1), (-1, 1), (1, -1), (0.5, 1), (1, 0.5)]) * 12.8
            numbers = np.array([chosen[agent] for agent in env.agents])
            alone.command(*motions[numbers % 7].T, numbers >= 7)
        observations, *_ = env.step(chosen)
        step = next(alone)


def test_oscillators_observe_their_phase_on_a_circle_and_the_reward_for_synchrony_is_that_of_the_phases_observed():
    """First of one oscillator among robots that never flash, which hears of nothing."""
    others = {"controller": "external_wheels", "count": 1}
    env = parallel_env({"robots": [others, {"controller": "constant", "count": 3}]}, seed=4, reward="synchrony")
    observations, _ = env.reset()
    columns = env.observation_fields["phase"]
    turned = []
    for _ in range(60):
        before = observations["robot_0"][columns]
        observations, rewards, *_ = env.step({"robot_0": np.zeros(2)})
        turned.append(np.angle(complex(*observations["robot_0"][columns]) / complex(*before)))
        assert rewards["robot_0"] == pytest.approx(1)
    as_in_free_run = np.isclose(turned, 2 * np.pi * 0.1 / 5.0, atol=1e-5)
    assert as_in_free_run.sum() >= 58  # but where a cycle ends: what is beyond the period is dropped
    env = parallel_env(DANCERS, seed=4, reward="synchrony")
    env.reset()
    observations, rewards, *_ = env.step({agent: np.zeros(2) for agent in env.agents})
    phases = np.array([complex(*observations[agent][env.observation_fields["phase"]]) for agent in env.agents])
    assert list(rewards.values()) == pytest.approx([abs(phases.mean())] * 4, abs=1e-6)
    assert rewards["robot_0"] < 0.99


@pytest.mark.parametrize("control_steps", [1, 7])
def test_infos_tell_of_the_trial_as_an_observer_of_it_is_told(control_steps):
    """Robots that are told to stand still, and flash by themselves."""
    group = {"count": 6, "controller": "external_wheels", "signal": {"kind": "radio"}, "parameters": {"period_s": 1}}
    still, told = {"robots": [group], "stop": {"order_parameter": 0.6}}, {}

    def note(step, state):
        told[step.number] = [state.outcome.cycles, state.is_synchronised]

    env = parallel_env(still, seed=4, control_steps=control_steps, episode_s=80)
    simulation = env._rows.simulations[0]
    _, infos = env.reset()
    shown = [(simulation.steps - 1, infos)]
    while env.agents:
        *_, infos = env.step({agent: np.zeros(2) for agent in env.agents})
        shown.append((simulation.steps - 1, infos))
    run_trial(Simulation(still, simulation.seed), [note])
    assert [*told.values()][-1][1]
    found = {number: [one["robot_0"][key] for key in ("t_sync_cycles", "synchronised")] for number, one in shown}
    both = told.keys() & found.keys()
    assert {number: found[number] for number in both} == {number: told[number] for number in both}


def test_infos_count_what_each_robot_touches():
    places = [[3.7, 3.7, 0], [11.1, 3.7, 0], [40, 40, 0]]  # in a row from a corner, with more contacts than robots
    env = parallel_env({"robots": [{"controller": "external", "poses": places}]})
    assert [infos["contacts"] for infos in env.reset()[1].values()] == [3, 2, 0]
    assert all(infos.keys() == {"contacts"} for infos in env.reset()[1].values())  # nobody is an oscillator


def test_episodes_end_as_gymnasium_means_it_and_then_only_reset_is_allowed():
    met = {"terminate": lambda situation: situation.time_s > 0.55}
    for given, expected in (({"episode_s": 6 * 0.1}, (False, True)), (met, (True, False))):
        env = parallel_env(SWARM, seed=4, **given)
        with pytest.raises(ValueError, match="call reset"):
            env.step({})
        env.reset()
        with pytest.raises(ValueError, match="allowed: a mapping of agents to actions"):
            env.step(np.zeros((3, 3)))
        still = {agent: np.zeros(3) for agent in env.agents}
        for number in range(6):
            _, _, terminated, truncated, _ = env.step(still)
            ends = expected if number == 5 else (False, False)
            assert (set(terminated.values()), set(truncated.values())) == ({ends[0]}, {ends[1]})
        assert env.agents == []
        with pytest.raises(ValueError, match="call reset"):
            env.step(still)
        env.reset()
        assert len(env.agents) == 3


def test_a_seed_begins_a_row_of_episodes_which_all_differ_and_a_refused_one_changes_nothing():
    def rows(env, seed):
        return [env.reset(seed if number == 0 else None)[0]["robot_0"].tolist() for number in range(3)]

    one, other = parallel_env(SWARM, seed=np.int64(4), render_mode="rgb_array"), parallel_env(SWARM)
    for look in (one.state, one.render):
        with pytest.raises(ValueError, match="call reset"):
            look()
    for seed in (-1, 1.5, [1.5]):
        with pytest.raises(ValueError, match=r"seed is -?1(\.5)?; allowed: whole numbers from 0"):
            one.reset(seed)
    assert one.agents == []
    first = rows(one, None)
    assert rows(other, 4) == first
    assert rows(one, 4) == first
    assert one._rows.simulations[0].seed == trial_seed(4, 2)
    assert len({tuple(row) for row in first}) == 3


def test_infinite_readings_are_observed_as_they_are(tmp_path):
    sense = with_sense("readings.far[0], readings.far[1] = math.inf, -math.inf", "{'far': (float, 2)}")
    (tmp_path / "far.py").write_text(f"import math\n{sense}")
    env = parallel_env({**SWARM, "sensors": [str(tmp_path / "far.py")]})
    assert env.reset()[0]["robot_0"][env.observation_fields["sensors.far"]].tolist() == [math.inf, -math.inf]


def test_rewards_are_given_to_each_agent_or_to_all_and_those_that_are_no_number_for_each_are_refused():
    given = []

    def reward(situation):
        given.append(situation)
        return situation.poses[..., 0]

    env = parallel_env({"robots": [{"count": 2}, {"count": 2, "controller": "external"}]}, reward=reward)
    env.reset()
    _, rewards, *_ = env.step({agent: np.zeros(3) for agent in env.agents})
    assert list(rewards.values()) == given[0].poses[0, 2:, 0].tolist()
    assert env.state()[:, 0].tolist() == given[0].poses[0, :, 0].tolist()
    for name, returned, said in (
        ("reward", [np.nan], "NaN"),
        ("reward", np.ones(3), r"the shape \(3,\)"),
        ("reward", ["one"], "values of the type <U3"),
        ("terminate", [np.nan], "values of the type float64"),
        ("terminate", [True, False], r"values of the type bool and the shape \(2,\)"),
    ):
        env = parallel_env(SWARM, **{name: lambda _, returned=returned: np.array(returned)})
        env.reset()
        with pytest.raises(ValueError, match=f"{name} returned {said}.*; allowed"):
            env.step({agent: np.zeros(3) for agent in env.agents})


def test_a_reward_that_reckons_in_its_arrays_changes_nothing_that_agents_are_told():
    def careless(situation):
        for array in (situation.poses, situation.wheels_cm_s, situation.ring_on, situation.phase):
            array[:] = 0
        return situation.poses[..., 0]

    told = []
    for reward in (careless, "coverage"):
        env = parallel_env("thesis", seed=3, reward=reward)
        env.reset()
        observations, _, _, _, infos = [env.step({agent: np.ones(3) for agent in env.agents}) for _ in range(9)][-1]
        told.append(([*map(np.ndarray.tolist, observations.values())], infos))
    assert told[0] == told[1]


def test_pictures_show_the_arena_from_above():
    env = parallel_env(SWARM, seed=4, render_mode="rgb_array")
    env.reset()
    dark = env.render()
    assert (dark.shape, dark.dtype) == ((480, 480, 3), np.uint8)
    env.step({agent: np.array([0.0, 0.0, 1.0]) for agent in env.agents})
    redder = (env.render()[..., 0].astype(int) - dark[..., 0]) > 50
    assert 1000 < redder.sum() < 30000


@pytest.mark.parametrize(
    ("scenario", "given", "kind", "message"),
    [
        ({"robots": [*DANCERS["robots"], *BLINKERS["robots"]]}, {}, ScenarioError, "agents differ in what they drive"),
        (SWARM, {"reward": "synchronny"}, ScenarioError, "synchrony"),
        (SWARM, {"episode_s": 0.0}, ValueError, "episode_s is 0.0; allowed"),
        (SWARM, {"episode_s": float("nan")}, ValueError, "episode_s is nan; allowed"),
        (SWARM, {"control_steps": 0}, ValueError, "control_steps is 0; allowed"),
        (SWARM, {"episode_s": "5"}, ValueError, "episode_s is '5'; allowed"),
        (SWARM, {"actions": "discret"}, ValueError, "actions is 'discret'; allowed: continuous or discrete"),
        (SWARM, {"render_mode": "x"}, ValueError, "render_mode is 'x'; allowed: human or rgb_array, or None"),
        (SWARM, {"reward": 3}, ScenarioError, "reward is 3; allowed: a name, a function"),
        (SWARM, {"terminate": 3}, ValueError, "terminate is 3; allowed: a function"),
        (SWARM, {"seed": -1}, ValueError, "seed is -1; allowed: whole numbers from 0"),
        ({"robots": [{"controller": "external"}]}, {"reward": "synchrony"}, ScenarioError, "no robot is one"),
        ({"robots": [{"controller": "external"}]}, {"reward": synchrony}, ScenarioError, "no robot is one"),
    ],
)
def test_environments_that_make_no_sense_are_refused(scenario, given, kind, message):
    with pytest.raises(kind, match=message):
        parallel_env(scenario, **given)


def test_actions_that_do_not_fit_are_refused_and_nothing_is_lost():
    for action, message in (
        (dict.fromkeys(AGENTS, np.zeros(2)), r"action of robot_0 has the shape \(2,\); allowed: \(3,\)"),
        (dict.fromkeys(AGENTS, np.zeros(3)) | {"robot_1": 0}, r"action of robot_1 has the shape \(\); allowed: \(3,\)"),
        (dict.fromkeys(AGENTS, np.full(3, np.nan)), "an agent's action has nan; allowed: finite"),
        (dict.fromkeys(AGENTS, ["left"] * 3), "an agent's action has left; allowed: finite"),
        ({"robot_0": np.zeros(3)}, "missing or unknown: .'robot_1', 'robot_2'"),
        ({0: np.zeros(3)}, "missing or unknown: .0, 'robot_0'"),
    ):
        env = parallel_env(SWARM, seed=4)
        env.reset()
        before = env.state()
        with pytest.raises(ValueError, match=message):
            env.step(action)
        np.testing.assert_array_equal(env.state(), before)
        env.step({agent: np.zeros(3) for agent in env.agents})
    env = parallel_env(SWARM, actions="discrete")
    env.reset()
    for number in (-1, 14, 1.0):
        with pytest.raises(ValueError, match=f"an agent's action has {number}; allowed: whole numbers from 0 to 13"):
            env.step(dict.fromkeys(AGENTS, number))


def test_robots_of_another_kind_observe_the_sensors_that_they_have_and_drive_up_to_their_own_limit():
    robot = {"kind": "kilobot", "infrared": {"sensors": [[1.5, 0, 0], [-1.5, 0, 180]], "peak_counts": 1000}}
    group = {"controller": "external", "poses": [[4, 25, math.pi], [40, 25, 0]], "signal": {"kind": "radio"}}
    scenario = {"arena": {"width_cm": 50, "height_cm": 50}, "noise": "off", "robot": robot, "robots": [group]}
    env = parallel_env(scenario, seed=1)
    observations, _ = env.reset()
    part = {name: observations["robot_0"][columns] for name, columns in env.observation_fields.items()}
    assert {name: len(values) for name, values in part.items()} == {"camera": 1, "infrared": 2, "wheels": 2, "ring": 1}
    distance = 4 - 1.5
    assert part["infrared"][0] == pytest.approx((0.7 - 0.09) / (distance**2 - 0.6 * distance + 0.7))
    observations, *_ = env.step(dict.fromkeys(env.agents, np.array([3.0, -0.5, -1.0])))
    assert observations["robot_0"][env.observation_fields["wheels"]].tolist() == [1, -0.5]
    alone = Simulation(scenario, 1)
    next(alone)
    alone.command(1.0, -0.5)
    assert alone.advance(1).wheels_cm_s[0].tolist() == [1, -0.5]
    blind = parallel_env({**scenario, "robot": "kilobot"}, seed=1)
    assert blind.reset()[0]["robot_0"][blind.observation_fields["infrared"]].shape == (0,)


def situation(poses, phase=None, side=60.0):
    poses = np.asarray(poses, float)
    shape = poses.shape[:-1]
    phases = np.full(shape, np.nan) if phase is None else np.asarray(phase, float)
    return Situation(np.zeros(shape[:-1]), poses, np.zeros((*shape, 2)), np.zeros(shape, bool), phases, side, side)


def test_rewards_are_the_order_of_oscillators_the_share_of_others_that_are_near_and_that_of_the_floor_near_robots():
    """Those of a batch are those of its swarms, one by one."""
    phases = [[0.2, 0.2, 0.2, np.nan], [0, 1 / 3, 2 / 3, np.nan], [0, 0.5, 0, np.nan]]
    np.testing.assert_allclose(synchrony(situation(np.zeros((3, 4, 3)), phases)), [1, 0, 1 / 3], atol=1e-12)
    with pytest.raises(ScenarioError, match="synchrony needs oscillators, and no robot is one"):
        synchrony(situation(np.zeros((3, 4, 3))))
    poses = [[10, 10, 0], [20, 10, 0], [34, 10, 0], [60, 60, 0]]
    np.testing.assert_allclose(aggregation(situation(poses)), [1 / 3, 2 / 3, 1 / 3, 0])
    assert aggregation(situation([[10, 10, 0]])).tolist() == [0]
    assert coverage(situation([[30, 30, 0]])) == pytest.approx(np.pi * 100 / 3600, rel=0.2)
    grid = [[x, y, 0] for x in (5, 15, 25, 35, 45, 55) for y in (5, 15, 25, 35, 45, 55)]
    assert coverage(situation(grid)) == 1
    assert coverage(situation([[2, 2, 0]], side=4.0)) == 1
    random = np.random.default_rng(1)
    poses, phases = random.uniform(0, 60, (5, 7, 3)), random.random((5, 7))
    for reward in (synchrony, aggregation, coverage):
        alone = [reward(situation(p, q)) for p, q in zip(poses, phases, strict=True)]
        np.testing.assert_array_equal(reward(situation(poses, phases)), alone)


def test_a_missing_package_is_named_with_the_extra_that_brings_it(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("epuck_sim.environments")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(ModuleNotFoundError, match=r'pip install "epuck-sim\[learning\]"$'):
        importlib.import_module("epuck_sim.environments")
