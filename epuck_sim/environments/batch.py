"""A batch of swarms of one scenario that take their steps together, on threads: compiled steps run side by side."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.environments.rewards import Situation, SituationFunction, find_reward
from epuck_sim.environments.spaces import AgentSpaces, Commanded, gather
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import arena_entries
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.seeds import trial_seed


class SwarmBatch:
    """Swarms that are commanded, stepped and observed together; each has its own seeds and begins anew by itself."""

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        swarms: int,
        *,
        reward: SituationFunction | str,
        terminate: Callable[[Situation], BoolArray] | None,
        discrete: bool,
        episode_s: float,
        control_steps: int,
        threads: int = 1,
    ) -> None:
        """Build the swarms; see `parallel_env` and `vector_env` for the arguments."""
        self._reward = find_reward(reward)
        self._terminate = terminate
        for name, value in (("swarms", swarms), ("control_steps", control_steps), ("threads", threads)):
            if not isinstance(value, int) or value < 1:
                raise ValueError(f"{name} is {value!r}; allowed: whole numbers from 1")
        first = _commanded(Simulation(scenario))
        if first.scenario.members_change or arena_entries(first.scenario):
            raise ScenarioError(
                f"{first.scenario.name}: robots come or go, or walls move; allowed in environments: neither, as "
                "observations and rewards take the robots and the arena to be those of the start"
            )
        self.simulations = [first, *(Simulation(first.scenario) for _ in range(swarms - 1))]
        self.spaces = AgentSpaces(first, discrete=discrete)
        self._oscillators_exist = not np.isnan(first.period_ms).all()
        self.control_steps = control_steps
        self._last_step = episode_s / first.step_s - 1e-6  # 6 s are 60 steps, however 0.1 s is rounded
        if not episode_s >= first.step_s:
            raise ValueError(f"episode_s is {episode_s}; allowed: at least a control step, {first.step_s:g} s")
        self._masters = [first.seed] * swarms
        self._episodes = [-1] * swarms
        self._steps: list[Step] = [None] * swarms  # type: ignore[list-item] # until `begin`
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._shares = [range(share, swarms, threads) for share in range(min(threads, swarms))]

    def set_seed(self, swarm: int, seed: int | None) -> None:
        """Have a swarm's episodes begin from this seed with the next one; go on with the present ones if None."""
        if seed is not None:
            self._masters[swarm], self._episodes[swarm] = int(seed), -1

    def begin(self, swarms: Sequence[int]) -> None:
        """Begin the next episodes of these swarms: their robots are placed, and sense."""
        for swarm in swarms:
            self._episodes[swarm] += 1
            self.simulations[swarm].reset(trial_seed(self._masters[swarm], self._episodes[swarm]))
            self._steps[swarm] = next(self.simulations[swarm])

    def act(self, actions: npt.ArrayLike, resting: BoolArray) -> None:
        """Have the robots do what (swarms, agents, ...) actions command until the next observation.

        Args:
            actions: The actions.
            resting: (swarms,) whether a swarm takes no step.
        """
        commanded = self.spaces.command(actions)
        shares = [[swarm for swarm in share if not resting[swarm]] for share in self._shares]
        if self._pool is None:
            self._advance(shares[0], commanded)
        else:
            for done in [self._pool.submit(self._advance, share, commanded) for share in shares]:
                done.result()

    def _advance(self, swarms: Sequence[int], commanded: Commanded) -> None:
        wheels, rings = commanded
        for swarm in swarms:
            simulation = self.simulations[swarm]
            commands = simulation.commands
            if wheels is not None:
                commands.wheels_cm_s[:] = wheels[swarm]
            if rings is not None:
                commands.rings[:] = rings[swarm]
            commands.carry_out()
            self._steps[swarm] = simulation.advance(self.control_steps)

    def look(self) -> Situation:
        """Return where all robots are and what they do."""
        arena, steps = self.simulations[0].scenario.arena, self._steps
        ring_on = gather([step.ring_on for step in steps])
        if self._oscillators_exist:
            phase = gather([step.phase_ms for step in steps]) / self.simulations[0].period_ms
        else:
            phase = np.full(ring_on.shape, np.nan)
        return Situation(
            time_s=np.array([step.time_s for step in steps]),
            poses=gather([step.poses for step in steps]),
            wheels_cm_s=gather([step.wheels_cm_s for step in steps]),
            ring_on=ring_on,
            phase=phase,
            width_cm=arena.width_cm,
            height_cm=arena.height_cm,
            movables=gather([step.movables for step in steps]),
        )

    def observe(self, situation: Situation) -> Float32Array:
        """Return (swarms, agents, columns) what all agents observe in the present situation."""
        return self.spaces.observe(situation, self._steps)

    def judge(self, situation: Situation) -> tuple[FloatArray, BoolArray, BoolArray]:
        """Return (swarms, agents) rewards, and (swarms,) whether each episode is terminated, and truncated."""
        rewards = _for_each_robot("reward", self._reward(situation), situation)[:, self.spaces.robots]
        terminated = np.zeros(len(self._steps), np.bool_)
        if self._terminate is not None:
            terminated[:] = self._terminate(situation)
        truncated = np.array([step.number >= self._last_step for step in self._steps])
        return rewards, terminated, truncated

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def _commanded(simulation: Simulation) -> Simulation:
    """Return the simulation, or one in which all robots are driven from outside, if none is."""
    if len(simulation.external_wheels) or len(simulation.external_rings):
        return simulation
    commanded = {"controller": "external", "parameters": {}}
    groups = tuple(group.model_copy(update=commanded) for group in simulation.scenario.robots)
    return Simulation(simulation.scenario.model_copy(update={"robots": groups}), simulation.seed)


def _for_each_robot(name: str, values: npt.ArrayLike, situation: Situation) -> FloatArray:
    """Return (swarms, robots) values that were given for each robot, or for each swarm."""
    given = np.asarray(values, float)
    shape = situation.ring_on.shape
    if given.shape not in (shape, shape[:1]) or np.isnan(given).any():
        raise ValueError(
            f"{name} returned {'NaN' if np.isnan(given).any() else f'the shape {given.shape}'}; allowed: numbers of "
            f"the shape {shape[:1]}, one for each swarm, or {shape}, one for each robot"
        )
    return given if given.shape == shape else np.broadcast_to(given[:, None], shape)
