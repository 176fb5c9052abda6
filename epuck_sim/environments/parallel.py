"""One swarm as a PettingZoo environment: each robot that is driven from outside is an agent."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
import numpy.typing as npt
from pettingzoo import ParallelEnv

from epuck_sim.arrays import BoolArray, Float32Array
from epuck_sim.environments.batch import SwarmBatch
from epuck_sim.environments.rewards import Situation, SituationFunction
from epuck_sim.environments.screen import RENDER_MODES, RenderMode, Screen
from epuck_sim.overhead.camera import Picture
from epuck_sim.scenario.scenario import Scenario


def parallel_env(
    scenario: Scenario | str | Path | Mapping[str, Any],
    *,
    seed: int | None = None,
    reward: SituationFunction | str = "aggregation",
    terminate: Callable[[Situation], BoolArray] | None = None,
    actions: Literal["continuous", "discrete"] = "continuous",
    episode_s: float = 60.0,
    control_steps: int = 1,
    render_mode: RenderMode | None = None,
) -> "SwarmEnv":
    """Return a PettingZoo `ParallelEnv` of one swarm.

    Args:
        scenario: A scenario of robots; what `load_scenario` takes. The agents are its groups that are driven from
            outside, by `controller: external`, `external_wheels` or `external_ring`; if there is none, all robots.
        seed: Seed of the first episode; the scenario's own if None.
        reward: `synchrony`, `aggregation`, `coverage`, or a function of a `Situation` of a batch of swarms; or a file
            with such a function, called `reward`; or the name of a reward that an installed package offers.
        terminate: Function of a `Situation` that returns (swarms,) whether the task is done; none by default.
        actions: Speeds, or numbers of motions.
        episode_s: Simulated seconds after which an episode is truncated.
        control_steps: Control steps, of 0.1 s by default, for which each action holds.
        render_mode: What `render` does: return a picture, or show it in a window.
    """
    batch = SwarmBatch(
        scenario,
        1,
        reward=reward,
        terminate=terminate,
        discrete=actions == "discrete",
        episode_s=episode_s,
        control_steps=control_steps,
    )
    batch.set_seed(0, seed)
    return SwarmEnv(batch, render_mode)


class SwarmEnv(ParallelEnv[str, Float32Array, Any]):  # type: ignore[misc] # PettingZoo has no types
    """A swarm whose robots are agents, `robot_0` and so on by their numbers; see `parallel_env`."""

    def __init__(self, batch: SwarmBatch, render_mode: RenderMode | None) -> None:
        self._batch = batch
        simulation = batch.simulations[0]
        self.render_mode = render_mode
        self.metadata = {
            "name": "epuck_sim_v0",
            "render_modes": RENDER_MODES,
            "render_fps": 1 / (simulation.step_s * batch.control_steps),
            "is_parallelizable": True,
        }
        self.possible_agents = [f"robot_{robot}" for robot in batch.spaces.robots]
        self.agents: list[str] = []
        # agents draw from spaces of their own, as PettingZoo's users seed them one by one
        self.observation_spaces = dict.fromkeys(self.possible_agents, batch.spaces.observation)
        self.action_spaces = {agent: batch.spaces.new_action_space() for agent in self.possible_agents}
        self.observation_fields = batch.spaces.fields
        """Which columns of an observation hold what."""
        self._screen = Screen(simulation.scenario, render_mode)

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
        """Begin an episode; without a seed, the one that follows the last one in a row that the last seed began."""
        self._batch.set_seed(0, seed)
        self._batch.begin([0])
        self.agents = list(self.possible_agents)
        observations = self._batch.observe(self._batch.look())[0]
        return self._of_agents(observations), self._of_agents({} for _ in self.agents)

    def step(self, actions: Mapping[str, Any]) -> tuple[dict[str, Any], ...]:
        """Have all robots act; return observations, rewards, terminations, truncations and infos of all agents.

        Raises:
            ValueError: The episode is over or has not begun, an agent has no action, or an action is not allowed.
        """
        if not self.agents:
            raise ValueError("no episode is under way: it is over, or has not begun; call reset()")
        if actions.keys() != set(self.agents):
            odd = sorted(set(self.agents) ^ actions.keys())
            raise ValueError(f"actions are needed for each of {len(self.agents)} agents; missing or unknown: {odd[:5]}")
        self._batch.act(np.array([[actions[agent] for agent in self.agents]]), np.zeros(1, np.bool_))
        situation = self._batch.look()
        rewards, terminated, truncated = self._batch.judge(situation)
        found = (
            self._of_agents(self._batch.observe(situation)[0]),
            self._of_agents(rewards[0].tolist()),
            dict.fromkeys(self.agents, bool(terminated[0])),
            dict.fromkeys(self.agents, bool(truncated[0])),
            self._of_agents({} for _ in self.agents),
        )
        if terminated[0] or truncated[0]:
            self.agents = []
        return found

    def _of_agents(self, values: Any) -> dict[str, Any]:
        return dict(zip(self.agents, values, strict=True))

    def state(self) -> npt.NDArray[np.float64]:
        """Return (robots, 5) x and y in cm, heading in rad, ring, and phase from 0 to 1 (-1 for none) of all robots."""
        situation = self._batch.look()
        phase = np.nan_to_num(situation.phase[0], nan=-1.0)
        return np.column_stack([situation.poses[0], situation.ring_on[0], phase])

    def render(self) -> Picture | None:
        """Return (height, width, 3) a picture of the arena from above, or show it; see `ArenaView`."""
        return self._screen.render(self._batch.look())

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()
