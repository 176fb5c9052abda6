"""One instant of sensing for a group of robots, in one call of compiled code.

The sensors themselves are in `infrared` and `line_camera`.
"""

import math
from collections.abc import Iterable
from typing import Any, Self

from numba.core import types
from numba.experimental import structref

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera, make_camera
from epuck_sim.embodied.cell_list import CellList, sort_into_cells
from epuck_sim.embodied.infrared import sense_infrared, to_distances
from epuck_sim.embodied.line_camera import see
from epuck_sim.scenario.robots import CameraSection
from epuck_sim.util.jit import jit


class SensingArrays(structref.StructRefProxy):
    """What a group of robots senses, with which sensors, and where the results are written.

    Compiled code holds it and takes it by reference, so that a call does not unpack each array; its fields can be read
    in compiled code only.
    """

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
    """Cell list of all robots."""
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
    infrared: FloatArray
    """(group, 8) counts: the readings; written."""
    distance_mm: IntArray
    """(group, 8) mm: the distances that belong to them; written."""
    pixels: IntArray
    """(group, pixels): 1 where a lit ring is seen; written."""

    def __new__(cls, **fields: object) -> Self:
        """Return a record of the fields above, all of which are given by name."""
        arrays: Self = _new_sensing_arrays(*_in_order(fields))
        return arrays


@structref.register
class _SensingArraysType(types.StructRef):
    """numba's type of `SensingArrays`; it depends on the fields' own types."""

    def preprocess_fields(self, fields: Iterable[tuple[str, Any]]) -> tuple[tuple[str, Any], ...]:
        return tuple((name, types.unliteral(kind)) for name, kind in fields)


_FIELDS = tuple(SensingArrays.__annotations__)
structref.define_proxy(SensingArrays, _SensingArraysType, _FIELDS)


def _in_order(fields: dict[str, object]) -> list[object]:
    """Return the values of all fields of `SensingArrays` in their order."""
    if fields.keys() != set(_FIELDS):
        raise TypeError(f"SensingArrays takes {', '.join(_FIELDS)}; given: {', '.join(fields)}")
    return [fields[name] for name in _FIELDS]


@jit
def _new_sensing_arrays(*fields: Any) -> Any:
    """Return the record that compiled code holds; numba's own way to make one is not cached on disk."""
    return SensingArrays(*fields)


def build_camera(section: CameraSection) -> Camera:
    """Return the camera that a group's section of a scenario describes."""
    return make_camera(
        section.pixels,
        math.radians(section.field_of_view_deg),
        section.central_pixels or section.pixels,
        section.range_cm or math.inf,
    )


@jit
def sense(group: SensingArrays, noise_step: int) -> None:
    """Write what the robots of a group sense at this instant, with the noise of `infrared_noise[noise_step]`."""
    poses, circles, edges, cells, first = group.poses, group.circles, group.edges, group.cells, group.first_robot
    sort_into_cells(poses, cells)
    sense_infrared(poses, group.width_cm, group.height_cm, circles, edges, cells, first, group.infrared)
    noise = group.infrared_noise[noise_step, first:]
    to_distances(group.infrared, group.infrared_gain, noise, group.noise_counts, group.by_table, group.distance_mm)
    see(poses, group.ring_on, circles, edges, cells, group.camera, first, group.pixels)
