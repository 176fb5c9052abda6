"""One instant of sensing for a group of robots, in one call of compiled code.

The sensors themselves are in `infrared` and `camera`. Arguments come flat, because numba needs as long to unpack one
named tuple as for all sensors of a robot: a group's are gathered once.
"""

import math
from typing import Any

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList, sort_into_cells
from epuck_sim.embodied.infrared import sense_infrared, to_distances
from epuck_sim.embodied.line_camera import Camera, make_camera, see
from epuck_sim.scenario.robots import CameraSection
from epuck_sim.util.jit import jit


def build_camera(section: CameraSection) -> Camera:
    """Return the camera that a group's section of a scenario describes."""
    return make_camera(
        section.pixels,
        math.radians(section.field_of_view_deg),
        section.central_pixels or section.pixels,
        section.range_cm or math.inf,
    )


def gather(poses: FloatArray, ring_on: BoolArray, arena: Arena, cells: CellList, camera: Camera) -> tuple[Any, ...]:
    """Return the first arguments of `sense`, those that are not the observers' own."""
    return (
        *(poses, ring_on, arena.width_cm, arena.height_cm, arena.circles, arena.edges),
        *cells,
        *camera,
    )


@jit
def sense(
    poses: FloatArray,
    ring_on: BoolArray,
    width_cm: float,
    height_cm: float,
    circles: FloatArray,
    edges: FloatArray,
    columns: int,
    lines: int,
    cell_width_cm: float,
    cell_height_cm: float,
    first_member: IntArray,
    members: IntArray,
    first_pixel: int,
    end_pixel: int,
    left_rad: float,
    pixels_per_rad: float,
    half_view_rad: float,
    range_cm: float,
    pixel_cos: FloatArray,
    pixel_sin: FloatArray,
    observer: int,
    readings: FloatArray,
    gain: FloatArray,
    noise: FloatArray,
    noise_counts: float,
    by_table: bool,
    distance_mm: IntArray,
    rows: IntArray,
) -> None:
    """Write what the robots from number `observer` on sense at this instant.

    Everybody's: poses (robots, 3), ring_on (robots,). The arena's: see `arena.Arena`; the cells': see `cells.CellList`;
    the camera's: see `camera.Camera`. The observers': gain and noise (observers, 8), see `infrared.to_distances`;
    written are readings and distance_mm (observers, 8), and rows (observers, pixels).
    """
    cells = CellList(columns, lines, cell_width_cm, cell_height_cm, first_member, members)
    camera = Camera(first_pixel, end_pixel, left_rad, pixels_per_rad, half_view_rad, range_cm, pixel_cos, pixel_sin)
    sort_into_cells(poses, cells)
    sense_infrared(poses, width_cm, height_cm, circles, edges, cells, observer, readings)
    to_distances(readings, gain, noise, noise_counts, by_table, distance_mm)
    see(poses, ring_on, circles, edges, cells, camera, observer, rows)
