"""Control steps of robots, gathered in arrays of fixed size."""

from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.step import Step
from epuck_sim.recording.buffers.row_batch import RowBatch
from epuck_sim.recording.level import Level
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.trial.synchrony import SynchronyWatch


class RobotBuffer:
    """Gathers steps of robots, a row each; it must be flushed when it is full."""

    row_count: int
    """Rows in the buffer."""
    _watch: SynchronyWatch

    def __init__(self, scenario: EmbodiedScenario, level: Level, capacity: int) -> None:
        """Reserve memory for `capacity` rows."""
        robots, pixels, movables = scenario.robot_count, scenario.camera_pixels, len(scenario.arena.movables)
        posed = capacity if level is not Level.SUMMARY else 0
        sensed = capacity if level is Level.FULL else 0
        self._shapes: dict[str, tuple[tuple[int, ...], type]] = {
            "ring_on": ((capacity, robots), np.bool_),
            "phase_ms": ((capacity, robots), np.float64),
            "poses": ((posed, robots, 3), np.float64),
            "movables": ((posed if movables else 0, movables, 2), np.float64),
            "camera": ((sensed, robots, pixels), np.uint8),
            "distance_mm": ((sensed, robots, SENSORS), np.uint16),
            "wheels_cm_s": ((sensed, robots, 2), np.float64),
        }
        self._capacity = capacity
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._next_step = 0
        self._cycles = 0  # of the reference
        self._ring_before = np.zeros(robots, np.bool_)
        self._phase_before = np.full(robots, np.nan)
        self._flashes = np.zeros(robots, np.int64)  # of each robot, before the first row
        self._clear()

    def _clear(self) -> None:
        """Take new arrays: those that were returned are not written to again."""
        self.row_count = 0
        self._arrays: dict[str, npt.NDArray[Any]] = {
            name: np.empty(shape, kind) for name, (shape, kind) in self._shapes.items()
        }
        self._filled = [(name, array) for name, array in self._arrays.items() if len(array)]
        self._firings: list[tuple[int, float]] = []
        self._arenas: list[tuple[int, Arena]] = []

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another step."""
        return self.row_count == self._capacity

    def append(self, step: Step, watch: SynchronyWatch) -> None:
        """Add a step."""
        self._watch = watch
        row = self.row_count
        for name, array in self._filled:
            array[row] = getattr(step, name)
        if not row or step.arena is not self._arenas[-1][1]:
            self._arenas.append((row, step.arena))
        if watch.cycles > self._cycles:
            self._cycles = watch.cycles
            if watch.order_parameter is not None:
                self._firings.append((row, watch.order_parameter))
        self.row_count += 1

    def flush(self) -> RowBatch:
        """Return the rows, of which there must be one at least, and remove them."""
        arrays = {name: array[: self.row_count] for name, array in self._arrays.items()}
        ring_on, phase_ms = arrays["ring_on"], arrays["phase_ms"]
        ring_before = np.concatenate([self._ring_before[None], ring_on])[:-1]
        phase_before = np.concatenate([self._phase_before[None], phase_ms])[:-1]
        fires = ring_on & (~ring_before | (phase_ms < phase_before))  # by the rule of `synchrony.SynchronyWatch`
        rows, robots = np.nonzero(fires)
        counts = self._flashes + np.cumsum(fires, axis=0)
        firings = np.array(self._firings, float).reshape(-1, 2)
        batch = RowBatch(
            time_ns=(self._next_step + np.arange(self.row_count)) * self._step_ns,
            ring_before=ring_before,
            order_parameter=self._watch.measure(phase_ms),
            flashes=np.column_stack([rows, robots, counts[rows, robots]]),
            firings=firings[:, 0].astype(np.int64),
            firing_order=firings[:, 1],
            arenas=tuple(self._arenas),
            **arrays,
        )
        self._next_step += self.row_count
        self._ring_before, self._phase_before, self._flashes = ring_on[-1].copy(), phase_ms[-1].copy(), counts[-1]
        self._clear()
        return batch
