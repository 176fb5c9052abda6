"""One control step of a simulation, as observers see it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.display.arena_svg import DARK, LIT
from epuck_sim.display.html import element, table, to_html
from epuck_sim.embodied.observers import Scene, find_contacts, find_sightings
from epuck_sim.embodied.swarm import offset_of, poses_of
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import members
from epuck_sim.util.messages import comma_list, did_you_mean


class Step(NamedTuple):
    """One control step of all robots: what they sensed at one instant, and what their controllers then commanded.

    A step does not know whether the trial is over: `run_trial` terminates a trial (synchronised) or censors it (a limit
    is reached). The arrays are read-only views of the simulation's own, which the next step overwrites: copy what you
    keep.
    """

    number: int
    """Number of control steps before this one."""
    time_s: float
    """Simulated time of this instant in seconds."""
    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading at this instant; headings count full turns."""
    infrared: FloatArray
    """(robots, 8) counts: readings of the proximity sensors."""
    distance_mm: IntArray
    """(robots, 8) mm: distances that belong to the readings; `epuck.OUT_OF_RANGE_MM` where nothing is in range."""
    camera: IntArray
    """(robots, pixels): 1 where a lit ring is seen; index 0 is the left edge. Shorter rows are padded with 0."""
    wheels_cm_s: FloatArray
    """(robots, 2) cm/s: left and right wheel as commanded, within the wheels' limit, without noise."""
    ring_on: BoolArray
    """(robots,): whether the ring is lit, as commanded if it has no fault."""
    ring_commands: BoolArray
    """(robots,): whether the ring is commanded to be lit; the reference's commands count as its firings."""
    movables: FloatArray
    """(movables, 2) cm: x, y of the arena's movables at this instant."""
    present: BoolArray
    """(robots,): whether each robot is in the arena; poses and phases of others are NaN, and they sense nothing."""
    arena: Arena
    """Walls, obstacles and movables at this instant; another object after the schedule has changed the arena."""
    memories: tuple[npt.NDArray[Any], ...]
    """One record array for each group: the memory of each of its robots."""
    sensed: tuple[tuple[slice, npt.NDArray[Any]], ...]
    """Robots that have each sensor in a file of its own, and a record array of their readings."""
    scene: Scene
    """The present step's scene, in which `sightings` and `contacts` are found."""
    found: dict[str, IntArray]
    """Results of `sightings` and `contacts` by name, once they are computed."""

    @property
    def phase_ms(self) -> FloatArray:
        """(robots,) ms: the oscillators' phases; NaN for robots whose memory has no phase, or that are not present."""
        phases = memory_values(self.memories, "phase_ms")
        return phases if self.present.all() else np.where(self.present, phases, np.nan)

    @property
    def readings(self) -> dict[str, FloatArray]:
        """(robots, ...) readings of sensors in files of their own, by name; NaN for robots that lack the sensor."""
        found: dict[str, FloatArray] = {}
        for robots, records in self.sensed:
            for name in records.dtype.names or ():
                values = records[name]
                shape = *self.present.shape, *values.shape[records.ndim :]
                found.setdefault(name, np.full(shape, np.nan))[(slice(None),) * (records.ndim - 1) + (robots,)] = values
        return found

    @property
    def flash_seen(self) -> BoolArray:
        """(robots,): whether a robot sees a flash: as its controller decides, or else whether any pixel is red."""
        decided = memory_values(self.memories, "flash_seen")
        return np.where(np.isnan(decided), self.camera.any(axis=1), decided != 0)

    @property
    def sightings(self) -> IntArray:
        """(sightings, 2) robot that looks, and robot whose lit ring is in its view; computed on demand.

        A ring is seen as it was commanded in the step before. A camera with fewer pictures than steps shows it later.
        """
        if "sightings" not in self.found:
            self._require_last("sightings")
            robots = self.scene.swarm.robots
            listed = robots.ring_before[None].copy()
            sightings = find_sightings(self.scene, poses_of(robots)[None].copy(), robots.present, listed)
            self.found["sightings"] = _read_only(sightings[:, 1:].copy())
        return self.found["sightings"]

    @property
    def contacts(self) -> IntArray:
        """(contacts, 2) robot, and the robot that it touches, or -1: a wall, obstacle or movable.

        They are computed on demand. Surfaces at most 1.6 mm apart touch. Two robots have one contact, listed for the
        robot with the lower number.
        """
        if "contacts" not in self.found:
            self._require_last("contacts")
            poses = poses_of(self.scene.swarm.robots)[None].copy()
            self.found["contacts"] = _read_only(find_contacts(self.scene, poses)[0][:, 1:].copy())
        return self.found["contacts"]

    def _require_last(self, what: str) -> None:
        """Raise ValueError if a later step has been taken, as robots stand elsewhere then."""
        if (last := int(self.scene.swarm.scene["step"][0])) != self.number:
            raise ValueError(f"step {self.number} is over: {last} is the last; ask for {what} earlier, and keep them")

    def copied(self) -> "Step":
        """Return this step with arrays of its own, which the next step does not overwrite."""
        own = Step._make(part.copy() if isinstance(part, np.ndarray) else part for part in self)
        sensed = tuple((robots, records.copy()) for robots, records in self.sensed)
        return own._replace(memories=tuple(memory.copy() for memory in self.memories), sensed=sensed)

    def __repr__(self) -> str:
        return f"Step(number={self.number}, time_s={self.time_s:g}, robots={len(self.poses)})"

    def _repr_html_(self) -> str:
        head = element("p", element("b", f"Step {self.number}"), f", {self.time_s:.1f} s")
        readings = self.readings
        rows = []
        for robot, (x, y, heading) in enumerate(self.poses[:MOST_ROBOTS].tolist()):
            nearest_mm, wheels = self.distance_mm[robot].min(), self.wheels_cm_s[robot]
            rows.append(
                [
                    *(str(robot), f"{x:.1f}", f"{y:.1f}", f"{math.remainder(heading, math.tau):.2f}"),
                    "-" if nearest_mm >= epuck.OUT_OF_RANGE_MM else str(nearest_mm),
                    _draw_camera(self.camera[robot]),
                    ", ".join(f"{value:.1f}" for value in wheels),
                    "lit" if self.ring_on[robot] else "dark",
                    *(_in_words(values[robot]) for values in readings.values()),
                ]
            )
        rest = len(self.poses) - len(rows)
        more = [element("p", f"and {rest} robots more")] * bool(rest)
        return to_html(head, table((*HEADINGS, *readings), rows), *more)


def shown_steps(
    scenario: EmbodiedScenario,
    scene: Scene,
    arena: Arena,
    memories: Sequence[npt.NDArray[Any]],
    sensed: Sequence[tuple[slice, npt.NDArray[Any]]],
) -> Callable[[int, float], Step]:
    """Return the function that shows the present step of a swarm in an arena, given its number and time.

    Arrays of steps are read-only views of the scene's block. For memories and what is sensed, see `Step`.
    """
    swarm, robots, widest = scene.swarm, scene.swarm.robots, scenario.camera_pixels
    sources: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []  # copies, and from where each step takes them
    poses, members_change = poses_of(robots), scenario.members_change
    if members_change:
        sources.append((poses.copy(), poses))
        poses = sources[0][0]
    if all(group.pixels == widest for group in scenario.robots):
        camera = swarm.pixels[: len(robots) * widest].reshape(len(robots), widest)
    else:
        camera = np.zeros((len(robots), widest), np.int64)
        for group in swarm.groups:
            rows = swarm.pixels[group.row :][: group.count * group.pixels].reshape(group.count, group.pixels)
            sources.append((camera[group.first :][: group.count, : group.pixels], rows))
    circles = swarm.circles[: swarm.scene[0].circles].view(np.ndarray).view(np.float64).reshape(-1, 3)
    wheels = np.ndarray((len(robots), 2), np.float64, robots, offset_of("left_cm_s"), (robots.strides[0], 8))
    sensors, movables = robots.sensors, circles[swarm.scene[0].first_movable :, :2]
    sensed_arrays = (poses, sensors.infrared, sensors.distance_mm, camera)
    shown: tuple[Any, ...] = (
        *map(_read_only, (*sensed_arrays, wheels, robots.ring_on, robots.ring_command, movables, robots.present)),
        replace(arena, circles=circles),
        tuple(map(_read_only, memories)),
        tuple((robots, _read_only(records)) for robots, records in sensed),
        scene,
    )

    def show(number: int, time_s: float) -> Step:
        for copy, source in sources:
            copy[:] = source
        if members_change:
            poses[~robots.present] = np.nan
        return tuple.__new__(Step, (number, time_s, *shown, {}))  # twice as fast as `Step._make`

    return show


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view(np.ndarray)
    view.flags.writeable = False
    return view


def memory_values(memories: Sequence[npt.NDArray[Any]], field: str) -> FloatArray:
    """Return (..., robots) a copy of a field of all groups' memories; NaN for robots that have no such field."""
    parts = [
        np.array(memory[field], float) if field in (memory.dtype.names or ()) else np.full(memory.shape, np.nan)
        for memory in memories
    ]
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)  # a concatenation takes as long as all else


READING = "sensors."
"""Prefix of readings of sensors in files of their own: `sensors.ground`, or `sensors.ground.2` of an array."""


def reading_fields(scenario: EmbodiedScenario) -> list[str]:
    """Return the names of all readings of sensors in files of their own, one for each number."""
    fields: dict[str, None] = {}
    for section in (each for group in scenario.robots for each in group.sensors.values()):
        readings = find_sensor(section["file"]).readings
        for name in readings.names or ():
            size = int(np.prod(readings[name].shape, dtype=int))
            of_array = [f"{READING}{name}.{place}" for place in range(size)]
            fields |= dict.fromkeys(of_array if readings[name].shape else [f"{READING}{name}"])
    return list(fields)


def field_values(step: Step, field: str) -> FloatArray:
    """Return (robots,) the values of a field of the robots' memories, or of a reading; NaN for robots that lack it."""
    if not field.startswith(READING):
        return memory_values(step.memories, field)
    name, _, place = field.removeprefix(READING).partition(".")
    return step.readings[name].reshape(len(step.poses), -1)[:, int(place or 0)]


def check_field(scenario: EmbodiedScenario, field: str, robot: int | None = None) -> None:
    """Raise ValueError unless a controller, or that of `robot`, has this field in its memory, and it is one number."""
    if scenario.sweep is not None and any(key.endswith(".controller") for key in scenario.sweep.keys):
        return  # nothing is known yet
    fields: dict[str, tuple[int, ...]] = {}
    for _, group, robots in members(scenario.robots):
        if robot is None or robot in robots:
            memory = find_controller(group.controller).memory
            fields |= {name: memory[name].shape for name in memory.names or ()}
    if field not in fields:
        raise ValueError(f"{did_you_mean(field, fields)}; in memory: {comma_list(fields)}")
    if fields[field]:
        raise ValueError(f"{field} is an array of shape {fields[field]}; allowed: fields that are one number")


def check_fields(scenario: EmbodiedScenario, fields: Sequence[str]) -> None:
    """Raise ScenarioError unless controllers of a scenario have these fields of memory; see `check_field`."""
    with refused_at(f"{scenario.name}: memory"):
        for field in fields:
            check_field(scenario, field)


MOST_ROBOTS = 50  # maximum number of robots in a table
PIXEL_PX, ROW_PX = 2, 12  # width and height of a camera's pixel in a table, in pixels of the screen

HEADINGS = ("robot", "x [cm]", "y [cm]", "heading [rad]", "nearest [mm]", "camera", "wheels [cm/s]", "ring")


def _in_words(reading: FloatArray) -> str:
    return ", ".join("-" if np.isnan(value) else f"{value:.3g}" for value in reading.ravel().tolist())


def _draw_camera(row: IntArray) -> Element:
    """Return a camera's row, (pixels,), as a strip that is red where a lit ring is seen."""
    red = (
        element("rect", x=PIXEL_PX * pixel, width=PIXEL_PX, height=ROW_PX, fill=LIT)
        for pixel in np.flatnonzero(row).tolist()
    )
    width = PIXEL_PX * len(row)
    return element("svg", element("rect", width=width, height=ROW_PX, fill=DARK), *red, width=width, height=ROW_PX)
