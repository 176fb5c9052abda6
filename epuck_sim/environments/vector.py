"""All robots of many swarms as one Gymnasium vector environment: one policy for all, evaluated on all at once."""

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.environments.batch import ScenarioLike, SwarmBatch, Task, seeds_from
from epuck_sim.environments.rewards import Situation


def vector_env(scenario: ScenarioLike, swarms: int, *, threads: int = 1, **task: Unpack[Task]) -> "SwarmVectorEnv":
    """Return a Gymnasium `VectorEnv` of all agents of a number of swarms of one scenario.

    Row `swarm * agents + agent` of all arrays is one agent. Outcomes do not depend on the number of threads.

    Args:
        scenario: See `parallel_env`.
        swarms: Number of swarms.
        threads: Threads that take the swarms' steps.
        task: See `Task`.
    """
    return SwarmVectorEnv(SwarmBatch(scenario, swarms, threads=threads, **task))


class SwarmVectorEnv(VectorEnv[Float32Array, Any, Any]):
    """All agents of many swarms; see `vector_env`. A swarm whose episode is over begins anew in the next step."""

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 Gymnasium's own type

    def __init__(self, batch: SwarmBatch) -> None:
        self.batch = batch
        self.swarms, self.agents = len(batch.simulations), len(batch.spaces.robots)
        self.num_envs = self.swarms * self.agents
        self.single_observation_space = batch.spaces.observation
        self.single_action_space = batch.spaces.action
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_fields = batch.spaces.fields
        """Which columns of an observation hold what."""
        self._is_over = np.ones(self.swarms, np.bool_)
        self._has_begun = False

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002 Gymnasium's signature
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode of each swarm.

        Args:
            seed: Seed of the first swarm, `seed + 1` of the second, and so on; or one for each swarm; or None, to go on
                in the rows of seeds that have begun.
            options: Ignored.
        """
        self.batch.begin(range(self.swarms), seeds_from(seed, self.swarms))
        self._is_over[:] = False
        self._has_begun = True
        situation = self.batch.look()
        return self._rows(self.batch.observe(situation)), self._infos(situation)

    def step(self, actions: npt.ArrayLike) -> tuple[Float32Array, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Have all robots act; those of swarms whose episodes are over begin a new one instead.

        Args:
            actions: (swarms * agents, ...) an action for each agent.

        Returns:
            (swarms * agents, ...) observations, rewards, whether terminated, whether truncated; and infos, arrays
            of one for each agent.

        Raises:
            ValueError: `reset` was not called, or actions are not of the action space.
        """
        if not self._has_begun:
            raise ValueError("no episode has begun; call reset()")
        given = np.asarray(actions)
        if given.shape[:1] != (self.num_envs,):
            raise ValueError(f"actions have the shape {given.shape}; allowed: {self.num_envs} rows, one for each agent")
        resting = self._is_over.copy()
        self.batch.act(given.reshape(self.swarms, self.agents, *given.shape[1:]), resting)
        self.batch.begin(np.flatnonzero(resting).tolist())
        situation = self.batch.look()
        rewards, terminated, truncated = self.batch.judge(situation)
        rewards = np.where(resting[:, None], 0.0, rewards)
        terminated &= ~resting
        truncated &= ~resting
        self._is_over = terminated | truncated
        each = self.agents
        flags = np.repeat(terminated, each), np.repeat(truncated, each)
        return self._rows(self.batch.observe(situation)), rewards.ravel(), *flags, self._infos(situation)

    def _infos(self, situation: Situation) -> dict[str, Any]:
        """Return infos as Gymnasium has them of vectors: an array by each key, and which agents it tells of."""
        values = {key: each.ravel() for key, each in self.batch.infos(situation).items()}
        return values | {f"_{key}": np.ones(self.num_envs, np.bool_) for key in values}

    def _rows(self, values: Float32Array) -> Float32Array:
        return values.reshape(self.num_envs, *values.shape[2:])

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        self.batch.close()
