"""One instant of sensing for a group of robots.

The sensors themselves are in `infrared` and `line_camera`.
"""

import math
from typing import NamedTuple

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera, make_camera
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.infrared import sense_infrared, to_distances
from epuck_sim.embodied.line_camera import see
from epuck_sim.scenario.robots import CameraSection
from epuck_sim.util.jit import jit


class SensingArrays(NamedTuple):
    """What a group of robots senses, with which sensors, and where the results are written."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading of all robots."""
    ring_on: BoolArray
    """(robots,) whether each robot's ring is lit."""
    width_cm: float
    """Width of the arena."""
    height_cm: float
    """Height of the arena."""
    circles: FloatArray
    """(k, 3) cm: round obstacles, see `arena.Arena`."""
    edges: FloatArray
    """(m, 4) cm: edges of the other obstacles, see `arena.Arena`."""
    cells: CellList
    """Cell list sorted by `poses`."""
    camera: Camera
    """Camera of the group."""
    first_robot: int
    """Number of the group's first robot."""
    infrared_gain: FloatArray
    """(group, 8) factor of each sensor's reading."""
    infrared_noise: FloatArray
    """(steps, robots, 8) standard normal numbers for some steps and all robots."""
    noise_counts: float
    """Standard deviation of the noise of a reading, in counts."""
    by_table: bool
    """Whether distances come from the firmware's table instead of the inverse response."""
    sees_robots: bool
    """Whether infrared rays end at robots."""
    infrared: FloatArray
    """(group, 8) counts: the readings; written."""
    distance_mm: IntArray
    """(group, 8) mm: the distances that belong to them; written."""
    pixels: IntArray
    """(group, pixels): 1 where a lit ring is seen; written."""


def build_camera(section: CameraSection) -> Camera:
    """Return the camera that a group's section of a scenario describes."""
    return make_camera(
        section.pixels,
        math.radians(section.field_of_view_deg),
        section.central_pixels or section.pixels,
        section.range_cm or math.inf,
        section.reflection_range_cm,
    )


@jit
def sense(group: SensingArrays, noise_step: int) -> None:
    """Write what the robots of a group sense at this instant, with the noise of `infrared_noise[noise_step]`."""
    sense_proximity(group, noise_step)
    cells, first = group.cells, group.first_robot
    see(group.poses, group.ring_on, group.circles, group.edges, cells, group.camera, first, group.pixels)


@jit
def sense_proximity(group: SensingArrays, noise_step: int) -> None:
    """Write the readings of the infrared sensors of a group, and the distances that belong to them."""
    poses, circles, edges, cells, first = group.poses, group.circles, group.edges, group.cells, group.first_robot
    walls = group.width_cm, group.height_cm
    sense_infrared(poses, *walls, circles, edges, cells, group.sees_robots, first, group.infrared)
    noise = group.infrared_noise[noise_step, first:]
    to_distances(group.infrared, group.infrared_gain, noise, group.noise_counts, group.by_table, group.distance_mm)
