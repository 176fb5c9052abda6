"""The eight infrared proximity sensors: from poses to raw readings to distances (thesis 3.1.4.1, Appendix B).

Each sensor casts three rays. Their responses are summed, and corrected so that the reading of a flat wall straight
ahead is that of the centre ray alone: F(left) + F(centre) + F(right) - 2 F(centre / cos 15 deg) (Enki 2.x).
"""

import math

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.cell_list import REACH_CM, CellList, cells_around, members_in_row
from epuck_sim.embodied.ray_casting import to_disc, to_segment
from epuck_sim.util.jit import jit

SENSORS = len(epuck.INFRARED_POSITIONS_CM)
"""Number of proximity sensors."""

RAYS = 3
"""Rays of each sensor."""

_X = np.ascontiguousarray(epuck.INFRARED_POSITIONS_CM[:, 0])
_Y = np.ascontiguousarray(epuck.INFRARED_POSITIONS_CM[:, 1])
_ANGLES = epuck.INFRARED_DIRECTIONS_RAD[:, None] + epuck.INFRARED_SPREAD_RAD * np.array([-1, 0, 1])
_COS = np.cos(_ANGLES)
_SIN = np.sin(_ANGLES)
_STRETCH = 1 / math.cos(epuck.INFRARED_SPREAD_RAD)
_RADIUS = epuck.RADIUS_CM
_RANGE = epuck.INFRARED_RANGE_CM
_PEAK = epuck.INFRARED_PEAK_COUNTS
_PEAK_CM = epuck.INFRARED_PEAK_CM
_WIDTH = epuck.INFRARED_WIDTH_CM2
_REACH = REACH_CM - epuck.RADIUS_CM  # largest distance from the body's centre to the end of a ray
_TABLE_COUNTS = epuck.INFRARED_TABLE_COUNTS
_TABLE_MM = epuck.INFRARED_TABLE_MM
_NOTHING_MM = epuck.OUT_OF_RANGE_MM
_ROUNDING_MM = 1e-6  # added before truncation to whole mm: a wall 40 mm away must not read 39


@jit
def response(distance_cm: float) -> float:
    """Return the reading in counts for a surface at `distance_cm`: F of Enki's e-puck, 0 beyond the range."""
    if distance_cm > _RANGE:
        return 0.0
    if distance_cm < _PEAK_CM:
        return _PEAK
    return _PEAK * (_WIDTH - _PEAK_CM**2) / (distance_cm**2 - 2.0 * _PEAK_CM * distance_cm + _WIDTH)


@jit
def inverse_response_mm(reading: float) -> int:
    """Return the distance in whole mm at which `response` gives `reading`; OUT_OF_RANGE_MM where none does."""
    if reading < response(_RANGE):
        return _NOTHING_MM
    share = 1.0 - _PEAK / min(reading, _PEAK)
    return int(10.0 * (_PEAK_CM + math.sqrt((_PEAK_CM**2 - _WIDTH) * share)) + _ROUNDING_MM)


@jit
def firmware_table_mm(reading: float) -> int:
    """Return the distance in whole mm by the firmware's table; OUT_OF_RANGE_MM below its last entry."""
    if reading >= _TABLE_COUNTS[0]:
        return int(_TABLE_MM[0])
    for entry in range(1, len(_TABLE_COUNTS)):
        high, low = _TABLE_COUNTS[entry - 1], _TABLE_COUNTS[entry]
        if reading >= low:
            share = (high - reading) / (high - low)
            return int(_TABLE_MM[entry - 1] + share * (_TABLE_MM[entry] - _TABLE_MM[entry - 1]) + _ROUNDING_MM)
    return _NOTHING_MM


@jit
def sense_infrared(
    poses: FloatArray,
    width_cm: float,
    height_cm: float,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    sees_robots: bool,
    observer: int,
    readings: FloatArray,
) -> None:
    """Write the readings of some robots, without noise.

    Args:
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        width_cm: Width of the arena.
        height_cm: Height of the arena.
        circles: (k, 3) cm: round obstacles, see `arena.Arena`.
        edges: (m, 4) cm: edges of the other obstacles, see `arena.Arena`.
        cells: Cell list sorted by `poses`.
        sees_robots: Whether rays end at robots; else only at walls and obstacles.
        observer: Number of the first robot that senses.
        readings: (observers, 8) counts: the readings of the robots from `observer` on; written.
    """
    distances = np.empty((SENSORS, RAYS))
    for row in range(len(readings)):
        robot = observer + row
        x, y = poses[robot, 0], poses[robot, 1]
        cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
        distances[:] = math.inf
        _meet_walls(x, y, cos, sin, width_cm, height_cm, distances)
        if sees_robots:
            _meet_robots(poses, robot, cos, sin, cells, distances)
        for k in range(len(circles)):
            dx, dy, radius = circles[k, 0] - x, circles[k, 1] - y, circles[k, 2]
            if dx * dx + dy * dy <= (_REACH + radius) ** 2:
                _meet_disc(dx * cos + dy * sin, dy * cos - dx * sin, radius, distances)
        for k in range(len(edges)):
            ax, ay, bx, by = edges[k, 0] - x, edges[k, 1] - y, edges[k, 2] - x, edges[k, 3] - y
            _meet_edge(ax * cos + ay * sin, ay * cos - ax * sin, bx * cos + by * sin, by * cos - bx * sin, distances)
        for sensor in range(SENSORS):
            left, centre, right = distances[sensor, 0], distances[sensor, 1], distances[sensor, 2]
            if min(left, centre, right) > _RANGE:
                readings[row, sensor] = 0.0
                continue
            total = response(left) + response(centre) + response(right) - 2.0 * response(centre * _STRETCH)
            readings[row, sensor] = min(max(total, 0.0), _PEAK)


@jit
def _meet_walls(
    x: float, y: float, cos: float, sin: float, width_cm: float, height_cm: float, distances: FloatArray
) -> None:
    """Shorten the rays that meet a wall: (8, 3) `distances` in cm, of a robot at (x, y)."""
    if x <= _REACH:
        _meet_wall(x, -cos, sin, distances)
    if width_cm - x <= _REACH:
        _meet_wall(width_cm - x, cos, -sin, distances)
    if y <= _REACH:
        _meet_wall(y, -sin, -cos, distances)
    if height_cm - y <= _REACH:
        _meet_wall(height_cm - y, sin, cos, distances)


@jit
def _meet_wall(away: float, ahead: float, aside: float, distances: FloatArray) -> None:
    """Shorten the rays that meet the wall at the distance `away` in the direction (ahead, aside), a unit vector."""
    for sensor in range(SENSORS):
        gap = max(away - ahead * _X[sensor] - aside * _Y[sensor], 0.0)
        if gap > _RANGE:
            continue
        for ray in range(RAYS):
            approach = ahead * _COS[sensor, ray] + aside * _SIN[sensor, ray]
            if approach > 0.0 and gap <= _RANGE * approach:
                distances[sensor, ray] = min(distances[sensor, ray], gap / approach)


@jit
def _meet_robots(poses: FloatArray, robot: int, cos: float, sin: float, cells: CellList, distances: FloatArray) -> None:
    """Shorten the rays that meet another robot; those in the cells around are looked at."""
    x, y = poses[robot, 0], poses[robot, 1]
    block = cells_around(x, y, cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for member in range(start, end):
            other = cells.members[member]
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if other != robot and dx * dx + dy * dy <= REACH_CM * REACH_CM:
                _meet_disc(dx * cos + dy * sin, dy * cos - dx * sin, _RADIUS, distances)


@jit
def _meet_disc(ahead: float, aside: float, radius: float, distances: FloatArray) -> None:
    """Shorten the rays that meet the disc centred at (ahead, aside) in the body's frame."""
    for sensor in range(SENSORS):
        fx, fy = ahead - _X[sensor], aside - _Y[sensor]
        beyond_left = fy * _COS[sensor, 2] - fx * _SIN[sensor, 2]
        beyond_right = fx * _SIN[sensor, 0] - fy * _COS[sensor, 0]
        if max(beyond_left, beyond_right) > radius:
            continue  # beside all three rays
        for ray in range(RAYS):
            reach = to_disc(0.0, 0.0, _COS[sensor, ray], _SIN[sensor, ray], fx, fy, radius)
            distances[sensor, ray] = min(distances[sensor, ray], reach)


@jit
def _meet_edge(ax: float, ay: float, bx: float, by: float, distances: FloatArray) -> None:
    """Shorten the rays that meet an obstacle's edge, given by its ends in the body's frame."""
    if min(ax, bx) > _REACH or max(ax, bx) < -_REACH or min(ay, by) > _REACH or max(ay, by) < -_REACH:
        return
    for sensor in range(SENSORS):
        for ray in range(RAYS):
            reach = to_segment(_X[sensor], _Y[sensor], _COS[sensor, ray], _SIN[sensor, ray], ax, ay, bx, by)
            distances[sensor, ray] = min(distances[sensor, ray], reach)


@jit
def to_distances(
    readings: FloatArray,
    gain: FloatArray,
    noise: FloatArray,
    noise_counts: float,
    by_table: bool,
    distances_mm: IntArray,
) -> None:
    """Amplify the readings, add noise, and convert them to distances.

    Args:
        readings: (robots, 8) counts; overwritten with the amplified, noisy readings.
        gain: (robots, 8) factor of each sensor's reading, 1 for an ideal sensor.
        noise: (robots, 8) standard normal numbers; further rows are ignored.
        noise_counts: Standard deviation of the noise in counts.
        by_table: Whether distances come from the firmware's table instead of the inverse response.
        distances_mm: (robots, 8) whole mm; written.
    """
    for robot in range(readings.shape[0]):
        for sensor in range(readings.shape[1]):
            amplified = readings[robot, sensor] * gain[robot, sensor]
            reading = min(max(amplified + noise_counts * noise[robot, sensor], 0.0), _PEAK)
            readings[robot, sensor] = reading
            if by_table:
                distances_mm[robot, sensor] = firmware_table_mm(reading)
            else:
                distances_mm[robot, sensor] = inverse_response_mm(reading)
