"""What agents observe and how they act, in numbers that networks like: the spaces, and the ways to and from them."""

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, Float32Array, IntArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import READING, Step
from epuck_sim.environments.rewards import Situation
from epuck_sim.errors import ScenarioError

MOTIONS = np.array([(0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (0.5, 1.0), (1.0, 0.5)])
"""(7, 2) left and right wheel of each discrete motion, as shares of the wheels' limit: stand still, ahead, back, turn
left and right on the spot, drive an arc to the left and to the right."""

PHASE_FEATURES = 2  # numbers by which a phase is observed, on a circle


class AgentSpaces:
    """The observations and actions of the robots of a scenario that are driven from outside: all alike."""

    def __init__(self, simulation: Simulation, *, discrete: bool) -> None:
        """Find the agents of a simulation, and what they can do: a number of a motion each, or speeds.

        Raises:
            ScenarioError: Not all robots that are driven from outside are driven alike.
        """
        wheels, rings = simulation.external_wheels, simulation.external_rings
        name = simulation.scenario.name
        self.robots = np.union1d(wheels, rings)  # (agents,) numbers of the robots that are driven from outside
        if any(0 < len(part) < len(self.robots) for part in (wheels, rings)):
            raise ScenarioError(f"{name}: agents differ in what they drive, wheels or rings; allowed: all alike")
        whole = slice(self.robots[0], self.robots[-1] + 1)
        self.chosen = whole if np.ptp(self.robots) < len(self.robots) else self.robots  # slices are quicker
        self.drives, self.flashes = bool(len(wheels)), bool(len(rings))
        self._discrete = discrete
        has_phase = not np.isnan(simulation.period_ms[self.robots]).all()
        robot_kinds = simulation.scenario.robot_kinds
        kinds = [robot_kinds[robot] for robot in self.robots]
        self._limits_cm_s = np.array([[kind.wheel_limit_cm_s] for kind in kinds])
        self._peak_counts = np.array([[kind.infrared.peak_counts if kind.infrared else 1.0] for kind in kinds])
        sensors = max(len(kind.infrared.sensors) if kind.infrared else 0 for kind in kinds)
        self._readings = {name: values[0].size for name, values in simulation.last_step.readings.items()}
        sizes = {
            "camera": simulation.scenario.camera_pixels,
            "infrared": sensors,
            "wheels": 2,
            "ring": 1,
            **({"phase": PHASE_FEATURES} if has_phase else {}),
            **{READING + name: size for name, size in self._readings.items()},
        }
        ends = np.cumsum(list(sizes.values())).tolist()
        self.fields = {part: slice(end - size, end) for (part, size), end in zip(sizes.items(), ends, strict=True)}
        """Which columns of an observation hold what."""
        low, high = np.zeros(ends[-1], np.float32), np.ones(ends[-1], np.float32)
        for part, columns in self.fields.items():
            if part in ("wheels", "phase"):
                low[columns] = -1.0
            elif part.startswith(READING):  # which may be any numbers
                low[columns], high[columns] = -np.inf, np.inf
        self.observation = gymnasium.spaces.Box(low, high)
        self.action = self.new_action_space()

    def new_action_space(self) -> gymnasium.Space[Any]:
        """Return a space of the actions of one agent, with a generator of its own."""
        if self._discrete:
            return gymnasium.spaces.Discrete((len(MOTIONS) if self.drives else 1) * (2 if self.flashes else 1))
        return gymnasium.spaces.Box(-1.0, 1.0, (2 * self.drives + self.flashes,), np.float32)

    def observe(self, situation: Situation, step: Step, camera: IntArray) -> Float32Array:
        """Return (swarms, agents, columns) what the agents of each swarm observe, in a step of all side by side."""
        seen = np.empty((len(situation.poses), len(self.robots), *self.observation.shape), np.float32)
        seen[..., self.fields["camera"]] = camera[:, self.chosen]
        infrared = self.fields["infrared"]
        if sensors := infrared.stop - infrared.start:
            shares = step.infrared[:, self.chosen, :sensors] / self._peak_counts
            seen[..., infrared] = np.minimum(np.maximum(shares, 0), 1)  # `numpy.clip` takes three times as long
        seen[..., self.fields["wheels"]] = situation.wheels_cm_s[:, self.chosen] / self._limits_cm_s
        seen[..., self.fields["ring"]] = situation.ring_on[:, self.chosen, None]
        if "phase" in self.fields:
            angles = 2 * np.pi * situation.phase[:, self.chosen]
            seen[..., self.fields["phase"]] = np.nan_to_num(np.stack([np.cos(angles), np.sin(angles)], axis=-1))
        for name, size in self._readings.items():
            values = step.readings[name][:, self.chosen]
            flat = values.reshape(*values.shape[:2], size)
            seen[..., self.fields[READING + name]] = np.nan_to_num(flat, posinf=np.inf, neginf=-np.inf)
        return seen

    def command(self, actions: npt.ArrayLike, actuators: npt.NDArray[np.void]) -> None:
        """Have (swarms, robots) actuators say what actions, (swarms, agents) or (swarms, agents, numbers), command.

        Raises:
            ValueError: An action is not of the action space; then nothing is commanded.
        """
        given = np.asarray(actions)
        shape = self.action.shape or ()
        if given.shape[2:] != shape:
            raise ValueError(f"an agent's action has the shape {given.shape[2:]}; allowed: {shape}")
        if self._discrete:
            count = int(self.action.n)  # type: ignore[attr-defined]
            is_allowed = (given >= 0) & (given < count) & (given.dtype.kind in "iu")
            allowed = f"whole numbers from 0 to {count - 1}"
        else:
            is_allowed, allowed = np.isfinite(given), "finite numbers"
        if not is_allowed.all():
            raise ValueError(f"an agent's action has {given[~is_allowed][0]}; allowed: {allowed}")
        if self._discrete:
            motions = len(MOTIONS) if self.drives else 1
            self._write(actuators, MOTIONS[given % motions], given // motions == 1)
        else:
            self._write(actuators, np.clip(given[..., :2], -1, 1), given[..., -1] > 0)

    def _write(self, actuators: npt.NDArray[np.void], shares: npt.NDArray[Any], lit: BoolArray) -> None:
        if self.drives:
            wheels = self._limits_cm_s * shares
            actuators["left_cm_s"][:, self.chosen] = wheels[..., 0]
            actuators["right_cm_s"][:, self.chosen] = wheels[..., 1]
        if self.flashes:
            actuators["ring_on"][:, self.chosen] = lit
