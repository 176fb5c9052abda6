"""A window of a trial: what some hundreds of control steps held, column by column, until it is written away."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.step import Step
from epuck_sim.recording.level import Level
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.trial.synchrony import SynchronyWatch


class Columns(NamedTuple):
    """Rows, one after the other: control steps of robots, or moments of point-like agents.

    Arrays begin with (rows, count), unless told; those that the level or the model leaves out have no rows.
    """

    time_ns: IntArray
    """(rows,) simulated time."""
    ring_on: BoolArray
    """Of agents: who fired just before."""
    phase_ms: FloatArray
    poses: FloatArray
    """(rows, count, 3) cm, cm, rad."""
    order_parameter: FloatArray
    """(rows,) of all oscillators."""
    flashes: IntArray
    """(flashes, 3) place among the rows, who flashes, and which of its own flashes it is, from 1."""
    firings: IntArray
    """(firings,) places of the rows in which the reference fires."""
    firing_order: FloatArray
    """(firings,) the order parameter that was measured then."""
    ring_before: BoolArray = np.empty((0, 0), np.bool_)
    """The rings of the step before, which are the ones that other robots see."""
    camera: npt.NDArray[np.uint8] = np.empty((0, 0, 0), np.uint8)
    """(rows, robots, pixels)"""
    distance_mm: npt.NDArray[np.uint16] = np.empty((0, 0, SENSORS), np.uint16)
    """(rows, robots, 8)"""
    wheels_cm_s: FloatArray = np.empty((0, 0, 2))
    """(rows, robots, 2)"""
    links: IntArray = np.empty((0, 4), np.int64)
    """(links, 4) place among the rows, who fires, who hears it, and 1 where that shifted a phase; of agents."""


class Window:
    """Gathers steps of robots; to be emptied when it is full."""

    taken: int
    """Steps in the window."""
    _watch: SynchronyWatch

    def __init__(self, scenario: EmbodiedScenario, level: Level, steps: int) -> None:
        """Make room for so many steps."""
        robots, pixels = scenario.robot_count, scenario.camera_pixels
        seen = steps if level is not Level.SUMMARY else 0
        sensed = steps if level is Level.FULL else 0
        self._shapes: dict[str, tuple[tuple[int, ...], type]] = {
            "ring_on": ((steps, robots), np.bool_),
            "phase_ms": ((steps, robots), np.float64),
            "poses": ((seen, robots, 3), np.float64),
            "camera": ((sensed, robots, pixels), np.uint8),
            "distance_mm": ((sensed, robots, SENSORS), np.uint16),
            "wheels_cm_s": ((sensed, robots, 2), np.float64),
        }
        self._steps = steps
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._next = 0  # number of the step to come
        self._cycles = 0  # of the reference
        self._ring_before = np.zeros(robots, np.bool_)
        self._phase_before = np.full(robots, np.nan)
        self._flashes = np.zeros(robots, np.int64)  # of each robot, before this window
        self._begin()

    def _begin(self) -> None:
        """Take new arrays: what was returned is not written to again."""
        self.taken = 0
        self._arrays: dict[str, npt.NDArray[Any]] = {
            name: np.empty(shape, kind) for name, (shape, kind) in self._shapes.items()
        }
        self._filled = [(name, array) for name, array in self._arrays.items() if len(array)]
        self._firings: list[tuple[int, float]] = []

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another step."""
        return self.taken == self._steps

    def take(self, step: Step, watch: SynchronyWatch) -> None:
        """Take note of a step."""
        self._watch = watch
        row = self.taken
        for name, array in self._filled:
            array[row] = getattr(step, name)
        if watch.cycles > self._cycles:
            self._cycles = watch.cycles
            if watch.order_parameter is not None:
                self._firings.append((row, watch.order_parameter))
        self.taken += 1

    def empty(self) -> Columns:
        """Return what is in the window, at least one step; it is empty then."""
        arrays = {name: array[: self.taken] for name, array in self._arrays.items()}
        ring_on, phase_ms = arrays["ring_on"], arrays["phase_ms"]
        ring_before = np.concatenate([self._ring_before[None], ring_on])[:-1]
        phase_before = np.concatenate([self._phase_before[None], phase_ms])[:-1]
        fires = ring_on & (~ring_before | (phase_ms < phase_before))  # as `synchrony.SynchronyWatch` has it
        rows, robots = np.nonzero(fires)
        counts = self._flashes + np.cumsum(fires, axis=0)
        firings = np.array(self._firings, float).reshape(-1, 2)
        columns = Columns(
            time_ns=(self._next + np.arange(self.taken)) * self._step_ns,
            ring_before=ring_before,
            order_parameter=self._watch.measure(phase_ms),
            flashes=np.column_stack([rows, robots, counts[rows, robots]]),
            firings=firings[:, 0].astype(np.int64),
            firing_order=firings[:, 1],
            **arrays,
        )
        self._next += self.taken
        self._ring_before, self._phase_before, self._flashes = ring_on[-1].copy(), phase_ms[-1].copy(), counts[-1]
        self._begin()
        return columns
