"""One robot of a swarm as a Gymnasium environment; the others run their controllers.

`gymnasium.register` is called when this module is imported. An entry point of the package would do without that import,
but every program that imports Gymnasium loads all entry points, whether it wants robots or not.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np

from epuck_sim.arrays import BoolArray, Float32Array
from epuck_sim.environments.batch import SwarmBatch
from epuck_sim.environments.rewards import Situation, SituationFunction
from epuck_sim.environments.screen import RENDER_MODES, RenderMode, Screen
from epuck_sim.environments.vector import SwarmVectorEnv, vector_env
from epuck_sim.errors import ScenarioError
from epuck_sim.overhead.camera import Picture
from epuck_sim.scenario.scenario import Scenario

ROBOT_ENV = "epuck_sim/Robot-v0"
"""Name of the environment for `gymnasium.make`."""

ONE_OF_TEN = {
    "name": "one of ten",
    "robots": [{"controller": "external", "count": 1}, {"controller": "firefly", "count": 9}],
}
"""The swarm if none is given: the thesis's, with one robot driven from outside."""


class RobotEnv(gymnasium.Env[Float32Array, Any]):
    """The robot of a swarm that is driven from outside."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 Gymnasium's own type

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any] = ONE_OF_TEN,
        *,
        seed: int | None = None,
        reward: SituationFunction | str = "aggregation",
        terminate: Callable[[Situation], BoolArray] | None = None,
        actions: Literal["continuous", "discrete"] = "continuous",
        episode_s: float = 60.0,
        control_steps: int = 1,
        render_mode: RenderMode | None = None,
    ) -> None:
        """Build the swarm.

        Args:
            scenario: A scenario of robots, one of which is driven from outside; what `load_scenario` takes.
            seed: See `parallel_env`, also for the other arguments.
            reward: See `parallel_env`.
            terminate: See `parallel_env`.
            actions: See `parallel_env`.
            episode_s: See `parallel_env`.
            control_steps: See `parallel_env`.
            render_mode: What `render` does: return a picture, or show it in a window, as each step then does by itself.

        Raises:
            ScenarioError: Not one robot is driven from outside, but none, or several.
        """
        self._batch = SwarmBatch(
            scenario,
            1,
            reward=reward,
            terminate=terminate,
            discrete=actions == "discrete",
            episode_s=episode_s,
            control_steps=control_steps,
        )
        self._batch.set_seed(0, seed)
        simulation, spaces = self._batch.simulations[0], self._batch.spaces
        _check_only_agent(len(spaces.robots))
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": 1 / (simulation.step_s * control_steps)}
        self.observation_space, self.action_space = spaces.observation, spaces.action
        self.observation_fields = spaces.fields
        """Which columns of an observation hold what."""
        self._screen = Screen(simulation.scenario, render_mode)
        self._is_over = True

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode; without a seed, the one that follows the last one in a row that the last seed began."""
        super().reset(seed=seed, options=options)
        self._batch.set_seed(0, seed)
        self._batch.begin([0])
        self._is_over = False
        return self._observe(self._batch.look()), {}

    def step(self, action: Any) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        """Have the robot act; return its observation and reward, whether terminated, whether truncated, and no infos.

        Raises:
            ValueError: The episode is over or has not begun, or the action is not allowed.
        """
        if self._is_over:
            raise ValueError("no episode is under way: it is over, or has not begun; call reset()")
        self._batch.act([[action]], np.zeros(1, np.bool_))
        situation = self._batch.look()
        rewards, terminated, truncated = self._batch.judge(situation)
        self._is_over = bool(terminated[0] or truncated[0])
        return self._observe(situation), float(rewards[0, 0]), bool(terminated[0]), bool(truncated[0]), {}

    def _observe(self, situation: Situation) -> Float32Array:
        """Return what the robot observes; show it, if that is the mode."""
        if self.render_mode == "human":
            self._screen.render(situation)
        observation: Float32Array = self._batch.observe(situation)[0, 0]
        return observation

    def render(self) -> Picture | None:
        """Return (height, width, 3) a picture of the arena from above, or show it; see `ArenaView`."""
        return self._screen.render(self._batch.look())

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()


def robot_vector_env(
    num_envs: int = 1, scenario: Scenario | str | Path | Mapping[str, Any] = ONE_OF_TEN, **settings: Any
) -> SwarmVectorEnv:
    """Return a `vector_env` of swarms each with one robot driven from outside, as `gymnasium.make_vec` asks for it.

    Args:
        num_envs: Number of swarms.
        scenario: See `RobotEnv`.
        settings: See `vector_env`.

    Raises:
        ScenarioError: Not one robot of a swarm is driven from outside, but none, or several.
    """
    env = vector_env(scenario, num_envs, **settings)
    _check_only_agent(env.agents)
    return env


def _check_only_agent(agents: int) -> None:
    if agents != 1:
        raise ScenarioError(
            f"{agents} robots of the scenario are driven from outside; allowed: one, or use parallel_env"
        )


gymnasium.register(
    ROBOT_ENV,
    entry_point=f"{__name__}:{RobotEnv.__name__}",
    vector_entry_point=f"{__name__}:{robot_vector_env.__name__}",
)
