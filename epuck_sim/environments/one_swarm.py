"""One swarm as an environment: for PettingZoo, where each driven robot is an agent, or for Gymnasium, with one agent.

`gymnasium.register` is called when this module is imported. An entry point of the package would need no such import,
but every program that imports Gymnasium loads all entry points, even if it needs no robots.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Unpack

import gymnasium
import numpy as np
import numpy.typing as npt
from pettingzoo import ParallelEnv

from epuck_sim.arrays import Float32Array
from epuck_sim.environments.vector import SwarmVectorEnv, Task, vector_env
from epuck_sim.errors import ScenarioError, extras_named
from epuck_sim.scenario.scenario import ScenarioLike
from epuck_sim.util.messages import short_repr, whole

if TYPE_CHECKING:
    from epuck_sim.overhead.camera import Picture
    from epuck_sim.overhead.render import ArenaView

ROBOT_ENV = "epuck_sim/Robot-v0"  # name of the environment of one robot for `gymnasium.make`

ONE_OF_TEN = {
    "name": "one of ten",
    "robots": [{"controller": "external", "count": 1}, {"controller": "firefly", "count": 9}],
    "stop": {"reference_robot": 1},
}
"""The default swarm: the thesis's, with one robot driven from outside, and T_sync of the others."""

RenderMode = Literal["rgb_array", "human"]  # what `render` does: return a picture, or show it in a window

RENDER_MODES = ["human", "rgb_array"]


def parallel_env(scenario: ScenarioLike, *, render_mode: RenderMode | None = None, **task: Unpack[Task]) -> "SwarmEnv":
    """Return a PettingZoo `ParallelEnv` of one swarm.

    Args:
        scenario: A scenario of robots; what `load_scenario` takes. The agents are its groups that are driven from
            outside, by `controller: external`, `external_wheels` or `external_ring`; if there is none, all robots.
        render_mode: What `render` does: return a picture, or show it in a window.
        task: See `Task`.
    """
    return SwarmEnv(scenario, render_mode, task)


class SwarmEnv(ParallelEnv[str, Float32Array, Any]):  # type: ignore[misc] # PettingZoo has no types
    """A swarm whose robots are agents, `robot_0` and so on by their numbers; see `parallel_env`."""

    def __init__(self, scenario: ScenarioLike, render_mode: RenderMode | None, task: Task) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode is {render_mode!r}; allowed: {' or '.join(RENDER_MODES)}, or None")
        self._rows = vector_env(scenario, 1, **task)  # an agent each
        self.render_mode: str | None = render_mode
        self.metadata = {
            "name": "epuck_sim_v0",
            "render_modes": RENDER_MODES,
            "render_fps": 1 / (self._rows.simulations[0].step_s * self._rows.control_steps),
            "is_parallelizable": True,
        }
        spaces = self._rows.spaces
        self.observation_fields = spaces.fields
        """Columns of each part of an observation, as slices by name."""
        self.possible_agents = [f"robot_{robot}" for robot in spaces.robots]
        self.agents: list[str] = []
        # each agent has its own space of actions, as PettingZoo's users seed them one by one
        self.observation_spaces = dict.fromkeys(self.possible_agents, spaces.observation)
        self.action_spaces = {agent: spaces.new_action_space() for agent in self.possible_agents}
        self._view: ArenaView | None = None

    def observation_space(self, agent: str) -> gymnasium.Space[Any]:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.Space[Any]:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self,
        seed: int | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002 PettingZoo's signature
    ) -> tuple[dict[str, Float32Array], dict[str, dict[str, Any]]]:
        """Begin an episode: the first one of a seed or, without a seed, the next one of the last seed."""
        rows, infos = self._rows.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return self._of_agents(rows), self._infos_of_agents(infos)

    def step(self, actions: Mapping[str, Any]) -> tuple[dict[str, Any], ...]:
        """Have all robots act; return observations, rewards, terminations, truncations and infos of all agents.

        ValueError is raised outside of an episode, and for an action that is missing or not allowed.
        """
        if not self.agents:
            raise ValueError("no episode is under way: it is over, or has not begun; call reset()")
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions are {short_repr(actions)}; allowed: a mapping of agents to actions")  # noqa: TRY004
        if actions.keys() != set(self.agents):
            odd = sorted(set(self.agents) ^ actions.keys(), key=str)
            raise ValueError(f"actions are needed for each of {len(self.agents)} agents; missing or unknown: {odd[:5]}")
        allowed = self._rows.single_action_space.shape
        if odd := [agent for agent in self.agents if np.shape(actions[agent]) != allowed]:
            raise ValueError(f"the action of {odd[0]} has the shape {np.shape(actions[odd[0]])}; allowed: {allowed}")
        rows, *values, infos = self._rows.step([actions[agent] for agent in self.agents])
        rewards, terminated, truncated = (self._of_agents(each.tolist()) for each in values)
        found = self._of_agents(rows), rewards, terminated, truncated, self._infos_of_agents(infos)
        if any(terminated.values()) or any(truncated.values()):
            self.agents = []
        return found

    def _of_agents(self, values: Any) -> dict[str, Any]:
        return dict(zip(self.agents, values, strict=True))

    def _infos_of_agents(self, infos: dict[str, Any]) -> dict[str, dict[str, Any]]:
        columns = {key: values.tolist() for key, values in infos.items() if not key.startswith("_")}
        rows = zip(*columns.values(), strict=True)
        return self._of_agents(dict(zip(columns, values, strict=True)) for values in rows)

    def state(self) -> npt.NDArray[np.float64]:
        """Return (robots, 5) x and y in cm, heading in rad, ring, and phase from 0 to 1 (-1 for none) of all robots."""
        situation = self._rows.look()
        phase = np.nan_to_num(situation.phase[0], nan=-1.0)
        return np.column_stack([situation.poses[0], situation.ring_on[0], phase])

    @extras_named()
    def render(self) -> "Picture | None":
        """Return (height, width, 3) a picture of the arena from above, or show it; see `ArenaView`."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() needs render_mode='rgb_array' or 'human'")
            return None
        if self._view is None:
            from epuck_sim.overhead.render import ArenaView  # noqa: PLC0415 takes OpenCV, which `learning` lacks

            self._view = ArenaView(self._rows.simulations[0].scenario)
        situation = self._rows.look()
        picture = self._view.draw(situation.poses[0], situation.ring_on[0], situation.movables[0])
        if self.render_mode == "rgb_array":
            return picture
        from matplotlib import pyplot  # noqa: PLC0415 slow, and only windows need it

        if not hasattr(self, "_image"):
            self._window = pyplot.figure("epuck-sim", frameon=False)
            self._image = self._window.add_axes((0.0, 0.0, 1.0, 1.0)).imshow(picture)
        self._image.set_data(picture)
        pyplot.pause(0.001)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if hasattr(self, "_image"):
            from matplotlib import pyplot  # noqa: PLC0415 see `render`

            pyplot.close(self._window)
            del self._image


class RobotEnv(gymnasium.Env[Float32Array, Any]):
    """Environment of the one robot of a swarm that is driven from outside."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 Gymnasium's own type

    def __init__(
        self, scenario: ScenarioLike = ONE_OF_TEN, *, render_mode: RenderMode | None = None, **task: Unpack[Task]
    ) -> None:
        """Build the swarm.

        Args:
            scenario: A scenario of robots, one of which is driven from outside; what `load_scenario` takes.
            render_mode: What `render` does: return a picture, or show it in a window, which each step then updates.
            task: See `Task`.

        Raises:
            ScenarioError: No robot is driven from outside, or several are.
        """
        self._swarm = swarm = SwarmEnv(scenario, render_mode, task)
        _check_only_agent(len(swarm.possible_agents))
        (self._agent,) = swarm.possible_agents
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": swarm.metadata["render_fps"]}
        self.observation_space = swarm.observation_space(self._agent)
        self.action_space = swarm.action_space(self._agent)
        self.observation_fields = swarm.observation_fields
        """Columns of each part of an observation, as slices by name."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode: the first one of a seed or, without a seed, the next one of the last seed."""
        seed = None if seed is None else whole("seed", seed, 0)  # Gymnasium refuses numpy's numbers
        gymnasium.Env.reset(self, seed=seed, options=options)
        observations, infos = self._swarm.reset(seed)
        if self.render_mode == "human":
            self.render()
        return observations[self._agent], infos[self._agent]

    def step(self, action: Any) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        """Have the robot act; return its observation, reward, whether terminated, whether truncated, and infos.

        Raises:
            ValueError: The episode is over or has not begun, or the action is not allowed.
        """
        observation, reward, terminated, truncated, infos = (
            values[self._agent] for values in self._swarm.step({self._agent: action})
        )
        if self.render_mode == "human":
            self.render()
        return observation, reward, terminated, truncated, infos

    def render(self) -> "Picture | None":  # Gymnasium's is of any type
        """Return (height, width, 3) a picture of the arena from above, or show it; see `ArenaView`."""
        return self._swarm.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._swarm.close()


def robot_vector_env(
    num_envs: int = 1,
    scenario: ScenarioLike = ONE_OF_TEN,
    max_episode_steps: int | None = None,
    render_mode: str | None = None,
    **settings: Any,
) -> SwarmVectorEnv:
    """Return a `vector_env` of swarms with one robot each that is driven from outside, for `gymnasium.make_vec`.

    ScenarioError is raised if none or several are, ValueError for an episode's length in steps or a `render_mode`.
    """
    if max_episode_steps is not None:
        raise ValueError(f"max_episode_steps is {max_episode_steps}; allowed: episode_s, in simulated seconds")
    if render_mode is not None:
        raise ValueError(f"render_mode is {render_mode!r}; allowed: None; only single environments draw pictures")
    env = vector_env(scenario, num_envs, **settings)
    _check_only_agent(env.agents)
    return env


def _check_only_agent(agents: int) -> None:
    if agents != 1:
        raise ScenarioError(f"{agents} robots are driven from outside; allowed: one, or use parallel_env")


gymnasium.register(
    ROBOT_ENV,
    entry_point=f"{__name__}:{RobotEnv.__name__}",
    vector_entry_point=f"{__name__}:{robot_vector_env.__name__}",
)
