"""A batch of swarms of one scenario that take their steps together, on threads: compiled steps run side by side."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Literal, TypedDict, get_args

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.embodied.observers import find_contacts, make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.environments.rewards import Situation, SituationFunction, find_reward, order_of
from epuck_sim.environments.spaces import AgentSpaces, Commanded, gather
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import arena_entries
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.messages import whole
from epuck_sim.util.seeds import trial_seed

ScenarioLike = Scenario | str | Path | Mapping[str, Any]
"""What `load_scenario` takes."""

Actions = Literal["continuous", "discrete"]
"""What agents may act in: speeds, or numbers of motions."""


class Task(TypedDict, total=False):
    """What agents are to do: the arguments of every environment, each of which may be left out."""

    seed: int | None
    """Seed of the first episode of the first swarm, `seed + 1` of the second, and so on; by default the scenario's."""
    reward: SituationFunction | str
    """`aggregation`, the default, `synchrony`, `coverage`, or a function of a `Situation` of a batch of swarms; or a
    file with such a function, called `reward`; or the name of a reward that an installed package offers."""
    terminate: Callable[[Situation], BoolArray] | None
    """Function of a `Situation` that returns (swarms,) whether the task is done; none by default."""
    actions: Actions
    """Speeds, the default, or numbers of motions."""
    episode_s: float
    """Simulated seconds after which an episode is truncated, 60 by default."""
    control_steps: int
    """Control steps, of 0.1 s by default, for which each action holds; 1 by default."""


class SwarmBatch:
    """Swarms that are commanded, stepped and observed together; each has its own seeds and begins anew by itself."""

    def __init__(
        self,
        scenario: ScenarioLike,
        swarms: int,
        *,
        seed: int | None = None,
        reward: SituationFunction | str = "aggregation",
        terminate: Callable[[Situation], BoolArray] | None = None,
        actions: Actions = "continuous",
        episode_s: float = 60.0,
        control_steps: int = 1,
        threads: int = 1,
    ) -> None:
        """Build the swarms; see `Task` and `vector_env` for the arguments."""
        self._reward = find_reward(reward)
        self._terminate = terminate
        if terminate is not None and not callable(terminate):
            raise ValueError(f"terminate is {terminate!r}; allowed: a function, or None")
        if actions not in get_args(Actions):
            raise ValueError(f"actions is {actions!r}; allowed: {' or '.join(get_args(Actions))}")
        swarms, threads = whole("swarms", swarms), whole("threads", threads)
        first = _commanded(Simulation(scenario))
        if first.scenario.members_change or arena_entries(first.scenario):
            raise ScenarioError(
                f"{first.scenario.name}: robots come or go, or walls move; allowed in environments: neither, as "
                "observations and rewards take the robots and the arena to be those of the start"
            )
        self.simulations = [first, *(Simulation(first.scenario) for _ in range(swarms - 1))]
        self.spaces = AgentSpaces(first, discrete=actions == "discrete")
        arena = first.scenario.arena.build()
        self._scene = make_scene(first.scenario.robots, first.scenario.group_kinds, arena)
        self._oscillators_exist = not np.isnan(first.period_ms).all()
        self.control_steps = whole("control_steps", control_steps)
        if not isinstance(episode_s, int | float | np.number) or not episode_s >= first.step_s:
            raise ValueError(f"episode_s is {episode_s!r}; allowed: at least a control step, {first.step_s:g} s")
        self._last_step = episode_s / first.step_s - 1e-6  # 6 s are 60 steps, however 0.1 s is rounded
        master = first.seed if seed is None else whole("seed", seed, 0)
        self._masters = [master + swarm for swarm in range(swarms)]
        self._episodes = [-1] * swarms
        self._steps: list[Step] = [None] * swarms  # type: ignore[list-item] # until `begin`
        self._watches: list[SynchronyWatch] = [None] * swarms  # type: ignore[list-item]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._shares = [range(share, swarms, threads) for share in range(min(threads, swarms))]

    def begin(self, swarms: Sequence[int], seeds: Sequence[int | None] = ()) -> None:
        """Begin the next episodes of these swarms: their robots are placed, and sense.

        Seeds, one for each of all swarms, begin rows of episodes; where they are None, the present rows go on.
        """
        for swarm, seed in enumerate(seeds):
            if seed is not None:
                self._masters[swarm], self._episodes[swarm] = seed, -1
        for swarm in swarms:
            simulation = self.simulations[swarm]
            self._episodes[swarm] += 1
            simulation.reset(trial_seed(self._masters[swarm], self._episodes[swarm]))
            self._watches[swarm] = SynchronyWatch(simulation)
            self._steps[swarm] = step = next(simulation)
            self._watches[swarm].look(step)

    def act(self, actions: npt.ArrayLike, resting: BoolArray) -> None:
        """Have the robots do what (swarms, agents, ...) actions command, but for swarms that are resting, (swarms,)."""
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
            left, right = (None, None) if wheels is None else wheels[swarm].T
            rings_on = None if rings is None else rings[swarm]
            simulation.commands.carry_out(left_cm_s=left, right_cm_s=right, ring_on=rings_on)
            watch, end = self._watches[swarm], simulation.steps + self.control_steps
            while simulation.steps < end:
                step = simulation.advance(end - simulation.steps, until_firing=watch.measures)
                watch.look(step, may_fire=simulation.is_firing)
            self._steps[swarm] = step

    def look(self) -> Situation:
        """Return where all robots are and what they do."""
        if self._steps[0] is None:
            raise ValueError("no episode has begun; call reset()")
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

    def infos(self, situation: Situation) -> dict[str, npt.NDArray[Any]]:
        """Return (swarms, agents) by key what is worth knowing beside rewards; see docs/learning.md."""
        found: dict[str, npt.NDArray[Any]] = {"contacts": self._contacts(situation)[:, self.spaces.robots]}
        if self._oscillators_exist:
            found["order_parameter"] = order_of(situation.phase)
        if self._watches[0].measures:
            found["t_sync_cycles"] = np.array([watch.outcome.cycles for watch in self._watches])
            found["synchronised"] = np.array([watch.is_synchronised for watch in self._watches])
        shape = found["contacts"].shape
        return {key: each if each.ndim > 1 else np.broadcast_to(each[:, None], shape) for key, each in found.items()}

    def _contacts(self, situation: Situation) -> IntArray:
        """Return (swarms, robots) how many robots, walls and other things each robot touches."""
        if situation.movables.size:
            pairs = [step.contacts for step in self._steps]
            touching = np.column_stack([np.repeat(range(len(pairs)), list(map(len, pairs))), np.concatenate(pairs)])
        else:  # swarms differ in poses alone, and are looked at together
            touching = find_contacts(self._scene, situation.poses)[0]
        swarms, robots = situation.ring_on.shape
        ends = touching[:, :1] * robots + touching[:, 1:]
        counts: IntArray = np.bincount(ends[touching[:, 1:] >= 0], minlength=swarms * robots)
        return counts.reshape(swarms, robots)

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def seeds_from(seed: int | Sequence[int | None] | None, swarms: int) -> Sequence[int | None]:
    """Return the seeds of swarms: those given, or `seed`, `seed + 1`, and so on; none if it is None."""
    if seed is None:
        return ()
    if not isinstance(seed, Sequence | np.ndarray):
        first = whole("seed", seed, 0)
        return [first + swarm for swarm in range(swarms)]
    if len(seed) != swarms:
        raise ValueError(f"seed holds {len(seed)} seeds; allowed: one for each of {swarms} swarms, or one")
    return [None if each is None else whole("seed", each, 0) for each in seed]


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
