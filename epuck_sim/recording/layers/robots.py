"""What a full recording shows of each model, beside who is where and the phases."""

from collections.abc import Iterable, Iterator
from typing import Protocol

from rerun.chunk import Chunk

from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.layers.images import SpaceTime, pictures, set_pictures
from epuck_sim.recording.layers.robot_overlays import make_stage, scene, set_scene, warm_up
from epuck_sim.recording.layers.time_series import set_wheels, wheels
from epuck_sim.recording.population import Population
from epuck_sim.scenario.embodied import EmbodiedScenario


class Details(Protocol):
    """What belongs to one model."""

    def still(self) -> Iterable[Chunk]:
        """Return what does not move, and how it looks."""

    def moving(self, columns: Columns) -> Iterable[Chunk]:
        """Return what these rows show."""

    def rest(self) -> Iterable[Chunk]:
        """Return what was held back until the end."""


class RobotDetails:
    """What robots see and sense, their wheels, and contacts."""

    def __init__(self, scenario: EmbodiedScenario, subject: Population) -> None:
        self._scenario, self._subject = scenario, subject
        self._stage = make_stage(scenario)
        self._space_time = SpaceTime(scenario)
        warm_up(self._stage)

    def still(self) -> Iterator[Chunk]:
        """Yield what does not move, and how it looks."""
        yield from set_wheels(self._subject)
        yield from set_scene()
        yield from set_pictures(self._scenario)

    def moving(self, columns: Columns) -> Iterator[Chunk]:
        """Yield what these steps show."""
        yield from wheels(columns)
        yield from scene(columns, self._stage)
        yield from pictures(columns)
        yield from self._space_time.pictures(columns)

    def rest(self) -> Iterator[Chunk]:
        """Yield the camera rows of the running minute."""
        return self._space_time.rest()
