"""All robots of many swarms as one Gymnasium vector environment: one policy for all, evaluated on all at once.

Observations and actions are numbers of a size that suits networks. Compiled code takes the steps of all swarms in one
call, or in one call for each thread.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, get_args

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from epuck_sim.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from epuck_sim.embodied.loop import act_together
from epuck_sim.embodied.observers import observe_together, with_room
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import READING, Step
from epuck_sim.embodied.swarm import PIXELS
from epuck_sim.environments.rewards import NO_PHASES, REWARD, Situation, SituationFunction, find_reward, order_of
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import arena_entries
from epuck_sim.scenario.scenario import ScenarioLike
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.messages import whole
from epuck_sim.util.seeds import trial_seed

Actions = Literal["continuous", "discrete"]  # form of actions: speeds, or numbers of motions

MOTIONS = np.array([(0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (0.5, 1.0), (1.0, 0.5)])
"""(7, 2) left and right wheel of each discrete motion, as shares of the wheels' limit: stand still, ahead, back, turn
left and right on the spot, drive an arc to the left and to the right."""


class Task(TypedDict, total=False):
    """Task of the agents: the arguments of every environment, each of which may be left out."""

    seed: int | None
    """Seed of the first episode of the first swarm, `seed + 1` of the second, and so on; by default the scenario's."""
    reward: SituationFunction | str | Path
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


class AgentSpaces:
    """The observations and actions of the robots of a scenario that are driven from outside: all alike."""

    def __init__(self, simulation: Simulation, *, discrete: bool) -> None:
        """Find the agents of a simulation, and their actions: numbers of motions if `discrete`, else speeds."""
        wheels, rings = simulation.external_wheels, simulation.external_rings
        name = simulation.scenario.name
        self.robots = np.union1d(wheels, rings)  # (agents,) numbers of the robots that are driven from outside
        if any(0 < len(part) < len(self.robots) for part in (wheels, rings)):
            raise ScenarioError(f"{name}: agents differ in what they drive, wheels or rings; allowed: all alike")
        every = slice(self.robots[0], self.robots[-1] + 1)
        self.chosen = every if np.ptp(self.robots) < len(self.robots) else self.robots  # slices are quicker
        drives, flashes = len(wheels) > 0, len(rings) > 0
        has_phase = not np.isnan(simulation.period_ms[self.robots]).all()
        robot_kinds = simulation.scenario.robot_kinds
        kinds = [robot_kinds[robot] for robot in self.robots]
        self._units = np.array([[kind.wheel_limit_cm_s] * 2 * drives + [1.0] * flashes for kind in kinds])
        wheels_of = MOTIONS if drives else MOTIONS[:1, :0]
        ring_of = np.array([[0.0], [1.0]]) if flashes else np.empty((1, 0))
        motions = [[*wheels, *ring] for ring in ring_of for wheels in wheels_of]
        self._motions = np.array(motions) if discrete else None  # (motions, numbers), in units as speeds are
        sensors = max(len(kind.infrared.sensors) if kind.infrared else 0 for kind in kinds)
        self._readings = {name: values[0].size for name, values in simulation.last_step.readings.items()}
        sizes = {
            "camera": simulation.scenario.camera_pixels,
            "infrared": sensors,
            "wheels": 2,
            "ring": 1,
            **({"phase": 2} if has_phase else {}),  # on a circle
            **{READING + name: size for name, size in self._readings.items()},
        }
        ends = np.cumsum(list(sizes.values())).tolist()
        self.fields = {part: slice(end - size, end) for (part, size), end in zip(sizes.items(), ends, strict=True)}
        """Columns of each part of an observation, as slices by name."""
        low, high = np.zeros(ends[-1], np.float32), np.ones(ends[-1], np.float32)
        for part, columns in self.fields.items():
            if part in ("wheels", "phase"):
                low[columns] = -1.0
            elif part.startswith(READING):  # readings may be any numbers
                low[columns], high[columns] = -np.inf, np.inf
        self.observation = gymnasium.spaces.Box(low, high)
        self.action = self.new_action_space()

    def new_action_space(self) -> gymnasium.Space[Any]:
        """Return a space of the actions of one agent, with a generator of its own."""
        if self._motions is not None:
            return gymnasium.spaces.Discrete(len(self._motions))
        return gymnasium.spaces.Box(-1.0, 1.0, self._units[0].shape, np.float32)

    def observe(
        self, block: ByteArray, places: IntArray, situation: Situation, step: Step
    ) -> tuple[Float32Array, IntArray]:
        """Return (swarms * agents, columns) observations, and (swarms, agents) how many bodies and walls each touches.

        `step` is that of all swarms; for `block` and `places` see `act_together`.
        """
        swarms, robots = situation.ring_on.shape
        seen = np.zeros((swarms, len(self.robots), *self.observation.shape), np.float32)
        contacts = np.empty((swarms, robots), np.int64)
        of_agents = self.robots, self.fields["infrared"].start, self.fields["wheels"].start
        write = partial(observe_together, block, places, *of_agents, situation.poses, seen, contacts)
        with_room(write, np.empty((robots, 3), np.int64), np.empty((robots, 2)))
        if "phase" in self.fields:
            angles = 2 * np.pi * situation.phase[:, self.chosen]
            seen[..., self.fields["phase"]] = np.nan_to_num(np.stack([np.cos(angles), np.sin(angles)], axis=-1))
        for name, size in self._readings.items():
            values = step.readings[name][:, self.chosen]
            flat = values.reshape(*values.shape[:2], size)
            seen[..., self.fields[READING + name]] = np.nan_to_num(flat, posinf=np.inf, neginf=-np.inf)
        return seen.reshape(-1, seen.shape[2]), contacts[:, self.chosen]

    def commands(self, given: npt.NDArray[Any]) -> FloatArray:
        """Return (swarms, agents, numbers) wheels in cm/s, and whether rings are lit, for actions of the agents."""
        shape = self.action.shape or ()
        if given.shape[2:] != shape:
            raise ValueError(f"an agent's action has the shape {given.shape[2:]}; allowed: {shape}")
        numbers = given if given.dtype.kind in "biuf" else np.full(given.shape, np.nan)
        is_allowed, allowed = np.isfinite(numbers), "finite numbers"
        if self._motions is not None:
            is_allowed = (numbers >= 0) & (numbers < len(self._motions)) & (numbers.dtype.kind in "iu")
            allowed = f"whole numbers from 0 to {len(self._motions) - 1}"
        if not is_allowed.all():
            raise ValueError(f"an agent's action has {given[~is_allowed][0]}; allowed: {allowed}")
        shares = given if self._motions is None else self._motions[given]  # robots limit the speeds of their wheels
        commands: FloatArray = np.multiply(shares, self._units, dtype=np.float64, order="C")
        return commands


def vector_env(scenario: ScenarioLike, swarms: int, *, threads: int = 1, **task: Unpack[Task]) -> "SwarmVectorEnv":
    """Return a Gymnasium `VectorEnv` of all agents of a number of swarms of one scenario.

    Row `swarm * agents + agent` of all arrays is one agent. Outcomes do not depend on the number of threads.

    Args:
        scenario: See `parallel_env`.
        swarms: Number of swarms.
        threads: Threads that take the swarms' steps.
        task: See `Task`.
    """
    return SwarmVectorEnv(scenario, swarms, threads=threads, **task)


class SwarmVectorEnv(VectorEnv[Float32Array, Any, Any]):
    """All agents of many swarms; see `vector_env`. A swarm whose episode is over begins anew in the next step."""

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 Gymnasium's own type
    _pool: ThreadPoolExecutor | None = None  # Gymnasium closes what was refused, too

    def __init__(
        self,
        scenario: ScenarioLike,
        swarms: int,
        *,
        threads: int = 1,
        seed: int | None = None,
        reward: SituationFunction | str | Path = "aggregation",
        terminate: Callable[[Situation], BoolArray] | None = None,
        actions: Actions = "continuous",
        episode_s: float = 60.0,
        control_steps: int = 1,
    ) -> None:
        self._reward = find_reward(reward)
        self._reward_as_given = reward if callable(reward) else REWARD.locate(str(reward)).name
        self._terminate = terminate
        if terminate is not None and not callable(terminate):
            raise ValueError(f"terminate is {terminate!r}; allowed: a function, or None")
        if actions not in get_args(Actions):
            raise ValueError(f"actions is {actions!r}; allowed: {' or '.join(get_args(Actions))}")
        self.swarms, threads = whole("swarms", swarms), whole("threads", threads)
        first = _commanded(Simulation(scenario))
        if first.scenario.members_change or arena_entries(first.scenario):
            raise ScenarioError(
                f"{first.scenario.name}: robots come or go, or walls move; allowed in environments: neither, as "
                "observations and rewards assume the robots and the arena of the start"
            )
        for number, entry in enumerate(first.scenario.schedule):
            if entry.at_s is None:  # only trials carry these out
                raise ScenarioError(f"{first.scenario.name}: schedule.{number}: has no at_s; environments need one")
        self.simulations = [first, *(Simulation(first.scenario) for _ in range(self.swarms - 1))]
        self.spaces = AgentSpaces(first, discrete=actions == "discrete")
        self.agents = len(self.spaces.robots)
        self.num_envs = self.swarms * self.agents
        self.single_observation_space, self.single_action_space = self.spaces.observation, self.spaces.action
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_fields = self.spaces.fields
        """Columns of each part of an observation, as slices by name."""
        self._oscillators_exist = not np.isnan(first.period_ms).all()
        if self._reward is find_reward("synchrony") and not self._oscillators_exist:
            raise ScenarioError(f"{first.scenario.name}: {NO_PHASES}")
        self.control_steps = whole("control_steps", control_steps)
        self._shares = [range(share, self.swarms, threads) for share in range(min(threads, self.swarms))]
        self._arrange()
        if not isinstance(episode_s, int | float | np.number) or not episode_s >= first.step_s:
            raise ValueError(f"episode_s is {episode_s!r}; allowed: at least a control step, {first.step_s:g} s")
        self._last_step = episode_s / first.step_s - 1e-6  # 6 s are 60 steps, however 0.1 s is rounded
        master = first.seed if seed is None else whole("seed", seed, 0)
        self._masters = [master + swarm for swarm in range(self.swarms)]
        self._episodes = [-1] * self.swarms
        self._watches: dict[int, SynchronyWatch] = {}
        self._is_over = np.ones(self.swarms, np.bool_)

    def _arrange(self) -> None:
        """Find all swarms in memory for compiled code, make copies of them side by side, and open the threads."""
        self._pool = ThreadPoolExecutor(len(self._shares)) if len(self._shares) > 1 else None
        step = self.simulations[0].last_step
        swarm, scenario = step.scene.swarm, self.simulations[0].scenario
        needs_python = scenario.schedule or scenario.faults or swarm.scene[0].moved_publicly
        self._steps_together = 0 if needs_python else self.control_steps
        self._memories = [simulation.memory for simulation in self.simulations]
        places = np.array([[each.ctypes.data for each in memory] for memory in self._memories])
        self._copies = np.array([block[: swarm.scene[0].at[PIXELS]] for block, _ in self._memories])
        self._places, shown = places - places[0], (swarm.scene["step"], tuple(step))
        numbers, beside = _side_by_side(shown, self._memories[0][0], self._copies)
        self._numbers, self._step = numbers[:, 0], Step._make(beside)

    def __getstate__(self) -> dict[str, Any]:
        """Refuse copies in the middle of an episode: a simulation's copy does not repeat the actions of agents."""
        if any(simulation.steps > 1 for simulation in self.simulations):
            raise ValueError("an episode is under way and cannot be copied; copy it before its first step")
        return {**vars(self), "_pool": None, "_reward": None}  # a function of a file cannot be pickled

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._reward = find_reward(self._reward_as_given)
        self._arrange()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002 Gymnasium's signature
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode of each swarm: with its own seed, `seed` + its number, or the next of its last seed.

        `seed` is one for each swarm, that of the first, or None; `options` are ignored.
        """
        for swarm, each in enumerate(_seeds_from(seed, self.swarms)):
            if each is not None:
                self._masters[swarm], self._episodes[swarm] = each, -1
        self._begin(range(self.swarms))
        self._is_over[:] = False
        return self._observe(self.look())

    def _begin(self, swarms: Sequence[int]) -> None:
        for swarm in swarms:
            simulation = self.simulations[swarm]
            self._episodes[swarm] += 1
            simulation.reset(trial_seed(self._masters[swarm], self._episodes[swarm]))
            self._watches[swarm] = SynchronyWatch(simulation)
            self._watches[swarm].look(next(simulation), is_firing=simulation.is_firing)
            self._copies[swarm] = self._memories[swarm][0][: self._copies.shape[1]]

    def step(self, actions: npt.ArrayLike) -> tuple[Float32Array, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Have all robots act; those of swarms whose episodes are over begin a new one instead.

        Actions have (swarms * agents, ...) entries, one for each agent; so have observations, rewards, whether
        terminated, whether truncated, and the arrays of infos, which are returned. ValueError is raised if `reset` was
        not called, a controller was replaced, or an action is not of the action space.
        """
        self._check_begun()
        if any(each.memory is not known for each, known in zip(self.simulations, self._memories, strict=True)):
            raise ValueError("a robot's controller was replaced after the environment was made; make a new one")
        given = np.asarray(actions)
        if given.shape[:1] != (self.num_envs,):
            raise ValueError(f"actions have the shape {given.shape}; allowed: {self.num_envs} rows, one for each agent")
        resting, rests = self._is_over, self._is_over.tolist()
        commands = self.spaces.commands(given.reshape(self.swarms, self.agents, *given.shape[1:]))
        shares = [[swarm for swarm in share if not rests[swarm]] for share in self._shares]
        if self._pool is None:
            for share in shares:
                self._advance(share, commands)
        else:
            working = [self._pool.submit(self._advance, share, commands) for share in shares]
            wait(working)  # even after an error: no thread may still run when the swarms begin anew
            for done in working:
                done.result()
        self._begin([swarm for swarm in range(self.swarms) if rests[swarm]])
        situation = self.look()
        observations, infos = self._observe(situation)  # before users' functions change the arrays they get
        terminated = self._ends(situation) & ~resting
        rewards = _for_each_robot(self._reward(situation), situation, resting)[:, self.spaces.chosen]
        truncated = (self._numbers >= self._last_step) & ~resting
        self._is_over = terminated | truncated
        flags = terminated.repeat(self.agents), truncated.repeat(self.agents)
        return observations, rewards.ravel(), *flags, infos

    def _ends(self, situation: Situation) -> BoolArray:
        """Return (swarms,) whether the user's condition ends each swarm's episode."""
        if self._terminate is None:
            return np.zeros(self.swarms, np.bool_)
        given = np.asarray(self._terminate(situation))
        if given.dtype != np.bool_ or given.shape not in ((), (self.swarms,)):
            shape = f"values of the type {given.dtype} and the shape {given.shape}"
            raise ValueError(f"terminate returned {shape}; allowed: truth values, ({self.swarms},), one for each swarm")
        return np.broadcast_to(given, self.swarms)

    def _advance(self, swarms: Sequence[int], commands: FloatArray) -> None:
        """Have the robots of these swarms act, and take the steps for which actions hold."""
        ends, outcomes = (self._numbers + (1 + self.control_steps)).tolist(), np.array(swarms, np.int64)
        how: tuple[Any, ...] = self._steps_together, self.spaces.robots, commands
        try:
            act_together(*self._memories[0], self._places, self._copies, outcomes, *how)
        except BaseException as error:  # whatever a user's controller may raise
            raise self.simulations[swarms[int(outcomes.argmin())]].located(error) from error
        for swarm, outcome in zip(swarms, outcomes.tolist(), strict=True):
            simulation, watch = self.simulations[swarm], self._watches[swarm]
            simulation.conclude(outcome)
            if simulation.is_firing:
                watch.look(simulation.last_step, is_firing=True)
            elif self._steps_together:
                continue
            while simulation.steps < ends[swarm]:
                step = simulation.advance(ends[swarm] - simulation.steps, until_firing=True)
                watch.look(step, is_firing=simulation.is_firing)
            self._copies[swarm] = self._memories[swarm][0][: self._copies.shape[1]]

    def _check_begun(self) -> None:
        if len(self._watches) < self.swarms:
            raise ValueError("no episode has begun; call reset()")

    def look(self) -> Situation:
        """Return the places and states of all robots."""
        self._check_begun()
        first, step = self.simulations[0], self._step
        return Situation(
            time_s=self._numbers * first.scenario.timing.step_ms / 1000,
            poses=step.poses.copy(),
            wheels_cm_s=step.wheels_cm_s.copy(),
            ring_on=step.ring_on.copy(),
            phase=step.phase_ms / first.period_ms,
            width_cm=first.scenario.arena.width_cm,
            height_cm=first.scenario.arena.height_cm,
            movables=step.movables.copy(),
        )

    def _observe(self, situation: Situation) -> tuple[Float32Array, dict[str, Any]]:
        """Return observations, and infos as Gymnasium has them: for each key an array, and a mask of who has it."""
        block, _ = self._memories[0]
        observations, contacts = self.spaces.observe(block, self._places, situation, self._step)
        found: dict[str, npt.NDArray[Any]] = {"contacts": contacts}
        if self._oscillators_exist:
            found["order_parameter"] = order_of(situation.phase)
        watches = self._watches.values()
        if self._watches[0].measures:
            found["t_sync_cycles"] = np.array([watch.outcome.cycles for watch in watches])
            found["synchronised"] = np.array([watch.is_synchronised for watch in watches])
        values = {key: each.ravel() if each.ndim > 1 else np.repeat(each, self.agents) for key, each in found.items()}
        return observations, values | {f"_{key}": np.ones(self.num_envs, np.bool_) for key in values}

    def close_extras(self, **_: Any) -> None:
        """End the threads; whoever goes on does so without."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None


def _side_by_side(value: Any, block: ByteArray, copies: ByteArray) -> Any:
    """Return views of an array in copies of its block, (copies, ...); of each in a tuple; other values as they are."""
    if type(value) is tuple:
        return tuple(_side_by_side(each, block, copies) for each in value)
    first = value.ctypes.data - block.ctypes.data if isinstance(value, np.ndarray) else -1
    if not 0 <= first < copies.shape[1]:
        return value
    return np.ndarray((len(copies), *value.shape), value.dtype, copies, first, (copies.strides[0], *value.strides))


def _seeds_from(seed: int | Sequence[int | None] | None, swarms: int) -> Sequence[int | None]:
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
    commanded = {"controller": "external", "parameters": {}, "memory": {}}
    groups = tuple(group.model_copy(update=commanded) for group in simulation.scenario.robots)
    return Simulation(simulation.scenario.model_copy(update={"robots": groups}), simulation.seed)


def _for_each_robot(rewards: npt.ArrayLike, situation: Situation, resting: BoolArray) -> FloatArray:
    """Return (swarms, robots) rewards that were given for each robot, or for each swarm; 0 where swarms rest."""
    given, shape = np.asarray(rewards), situation.ring_on.shape
    if given.dtype.kind not in "biuf":
        wrong = f"values of the type {given.dtype}"
    elif given.shape not in (shape, shape[:1]):
        wrong = f"the shape {given.shape}"
    else:
        counted = np.empty(shape)
        counted.T[:] = given.T
        counted[resting] = 0.0
        if not np.isnan(counted).any():
            return counted
        wrong = "NaN"
    allowed = f"{shape[:1]}, one for each swarm, or {shape}, one for each robot"
    raise ValueError(f"reward returned {wrong}; allowed: numbers of the shape {allowed}")
