"""One trial of robots, watched until the swarm is synchronised, and the start of agents that start like its robots."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.elementary import sin_cos
from epuck_sim.embodied.loop import MOST_STEPS
from epuck_sim.embodied.observers import make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.start import draw_places, draw_start, put_at_given_poses
from epuck_sim.embodied.step import Step
from epuck_sim.embodied.swarm import poses_of
from epuck_sim.errors import ControllerError, EpuckSimError, ScenarioError
from epuck_sim.order_parameter import METRICS, Firing, from_reference, reference_order_parameter
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import ScenarioLike
from epuck_sim.trial.measuring import Measuring
from epuck_sim.trial.result import Observer, Progress, TrialResult
from epuck_sim.util.messages import BY_OBSERVER
from epuck_sim.util.native import working_s

NOMINAL_PERIOD_S = 5.0  # length of a cycle, in seconds, if the reference is no oscillator (4.2.1)


class SynchronyWatch:
    """Counts the reference robot's firings and measures the order parameter at each (thesis 4.2.1).

    Only oscillators in the arena count. If the reference is no oscillator, no order parameter is measured and every 5 s
    count as a cycle. One oscillator alone is never synchronised. Once the swarm is synchronised it counts as such,
    whatever it does in the further cycles.
    """

    cycles = 0  # firings of the reference so far
    order_parameter: float | None = None  # order parameter at the reference's last firing; None before the first
    _steps = 0
    _synchrony: Firing | None = None

    def __init__(self, simulation: Simulation) -> None:
        self.events: Sequence[TrialEvent] = simulation.events  # changes so far, by the schedule or by faults
        stop = self._stop = simulation.scenario.stop
        self._metric = METRICS[stop.metric]
        self._threshold = math.inf if stop.order_parameter is None else stop.order_parameter
        self._reference = stop.reference_robot
        self._members_change = simulation.scenario.members_change
        self._all_periods = simulation.period_ms
        oscillates = ~np.isnan(self._all_periods)
        self._oscillators = slice(None) if oscillates.all() else oscillates  # a slice copies nothing
        self._periods = self._all_periods[self._oscillators]
        self.measures = bool(oscillates[self._reference])  # whether the reference is an oscillator
        step_ms = simulation.scenario.timing.step_ms
        self._step_s = step_ms / 1000
        self._steps_a_cycle = NOMINAL_PERIOD_S * 1000 / step_ms
        most = stop.max_cycles * self._steps_a_cycle
        if self.measures:  # a trial whose reference never fires ends after twice the time that its cycles should take
            most = 2 * stop.max_cycles * (simulation.period_ms[self._reference] / step_ms + 1)
        self._max_steps = math.ceil(most)
        if stop.max_time_s is not None:
            self._max_steps = min(self._max_steps, math.ceil(stop.max_time_s * 1000 / step_ms - 1e-9))

    def look(self, step: Step, *, is_firing: bool) -> None:
        """Record a step; the reference may fire in it (`Simulation.is_firing`), but not in steps skipped before it."""
        self._steps = step.number + 1
        if not self.measures:
            self.cycles = int(self._steps / self._steps_a_cycle)
            return
        if not is_firing and self._steps < self._max_steps:  # a reference whose phase is not a number fires no more
            return
        counted = step.phase_ms[self._oscillators]
        if self._members_change:
            counted = counted[step.present[self._oscillators]]
        if not math.isfinite(np.add.reduce(counted)):  # then not all of them are
            phases = step.phase_ms.tolist()
            raise ControllerError(f"step {step.number}: an oscillator's phase is not a number: {phases}")
        if is_firing:
            self.cycles += 1
            self.order_parameter = r = float(self.measure(step.phase_ms))
            if self._synchrony is None and r >= self._threshold and len(counted) > 1:
                self._synchrony = Firing(self.cycles, r)

    def measure(self, phase_ms: FloatArray) -> FloatArray:
        """Return (...) the order parameter of the oscillators at (..., robots) phases; NaN where there are none.

        Where robots come and go, those whose phases are NaN are not counted.
        """
        if not len(self._periods):
            return np.full(phase_ms.shape[:-1], np.nan)
        if self.measures and self._metric is reference_order_parameter:
            phase_ms = from_reference(phase_ms, self._all_periods, self._reference)
        phases = np.ascontiguousarray(phase_ms[..., self._oscillators])
        if not self._members_change:
            return self._metric(phases, self._periods)
        rows = phases.reshape(-1, len(self._periods))
        found = [
            float(self._metric(row[present], self._periods[present])) if present.any() else math.nan
            for row, present in zip(rows, ~np.isnan(rows), strict=True)
        ]
        return np.reshape(found, phase_ms.shape[:-1])

    @property
    def oscillators(self) -> int:
        """Number of oscillators."""
        return len(self._periods)

    @property
    def time_s(self) -> float:
        """Simulated time of the last step."""
        return max(self._steps - 1, 0) * self._step_s

    @property
    def steps_left(self) -> int:
        """Steps until the trial ends at its limits, unless the reference fires before; at least 1.

        If the reference is no oscillator, at most the steps until the next cycle is complete.
        """
        end = self._max_steps
        if not self.measures:
            end = min(end, math.ceil((self.cycles + 1) * self._steps_a_cycle))
        return max(end - self._steps, 1)

    @property
    def is_synchronised(self) -> bool:
        """Whether the order parameter has reached its threshold at a firing."""
        return self._synchrony is not None

    @property
    def outcome(self) -> Firing:
        """The firing at which the swarm was synchronised, or else the last one so far."""
        return self._synchrony or Firing(self.cycles, self.order_parameter)

    @property
    def is_over(self) -> bool:
        """Whether the trial ends here: at its limits, or after synchrony and the further cycles."""
        if self.cycles >= self._stop.max_cycles or self._steps >= self._max_steps:
            return True
        return self._synchrony is not None and self.cycles >= self._synchrony.cycles + self._stop.further_cycles


def run_robots(
    simulation: Simulation, observers: Sequence[Observer], progress: Progress | None, measuring: Measuring
) -> TrialResult:
    """Run a fresh simulation of robots to the end of its trial; see `trial.model.Model.run`.

    Without observers, only the steps in which the reference fires are looked at, which is much quicker.
    """
    if simulation.steps:
        raise ValueError(f"a trial needs a fresh simulation; this one has taken {simulation.steps} steps")
    watch = SynchronyWatch(simulation)
    began = working_s()
    while not (watch.is_over or measuring.is_over()):
        if measuring.entries:
            measuring.carry_out(watch, simulation.carry_out_scheduled)
        cycles, most, stretch = watch.cycles, min(watch.steps_left, MOST_STEPS), None
        if measuring.at_stretches:
            stretch = simulation.stretch(1 if observers else most)
            steps: Iterable[Step] = [simulation.last_step]
        elif observers:
            steps = simulation.one_by_one(1 if measuring.waits else most)
        else:
            steps = [simulation.advance(most, until_firing=True)]
        for step in steps:
            watch.look(step, is_firing=simulation.is_firing)
            if progress is not None:
                progress(watch)
            for tell in measuring.at_stretches:
                tell(stretch, watch)
            for observer in observers:
                observer(step, watch)
        for observer in measuring.at_cycles if watch.cycles > cycles else ():
            observer(step, watch)
        if simulation.steps != step.number + 1:
            raise EpuckSimError(BY_OBSERVER)
    outcome, stop = watch.outcome, simulation.scenario.stop
    has_t_sync = stop.gives_t_sync or (watch.measures and stop.has_t_sync)
    is_known = watch.is_synchronised or (stop.gives_t_sync and measuring.is_over())
    return TrialResult(
        scenario=simulation.scenario.name,
        seed=simulation.seed,
        t_sync_cycles=outcome.cycles if is_known else None,
        censored=not is_known if has_t_sync else None,
        cycles=outcome.cycles,
        order_parameter=outcome.order_parameter,
        steps=simulation.steps,
        simulated_s=simulation.steps * simulation.scenario.timing.step_ms / 1000,
        wall_s=working_s() - began,
        events=tuple(simulation.events),
    )


def start_poses(scenario: EmbodiedScenario, seeds: Iterable[int]) -> FloatArray:
    """Return (seeds, robots, 3) cm, cm, rad: poses at the start of trials; raise ScenarioError if there is no room."""
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    poses = []
    for seed in seeds:
        draw_start(scene.block, seed)
        put_at_given_poses(scene.swarm, scenario)
        draw_places(scene.block, scenario)
        poses.append(poses_of(scene.swarm.robots).copy())
    return np.array(poses)


def start_like(robots: ScenarioLike, seed: int) -> dict[str, Any]:
    """Return the section `start` of point agents that start like the robots of a trial.

    Args:
        robots: A scenario of robots that are all oscillators, or what `load_scenario` takes.
        seed: The trial's seed.

    Returns:
        Positions in cm, headings, and phases from 0 to 1 of the robots before their first control step.

    Raises:
        ScenarioError: The scenario is of another model, or robots are no oscillators, or do not fit into the arena.
    """
    simulation = Simulation(robots, seed)
    step = simulation.last_step
    phases = step.phase_ms / simulation.period_ms
    if np.isnan(phases).any():
        raise ScenarioError(f"{simulation.scenario.name}: some robots have no phase, but all agents are oscillators")
    x, y, heading = step.poses.T
    return {
        "phases": phases.tolist(),
        "positions_cm": np.column_stack([x, y]).tolist(),
        "headings": [[*sin_cos(angle)[::-1]] for angle in heading.tolist()],
    }
