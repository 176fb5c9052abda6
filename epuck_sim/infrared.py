"""The eight infrared proximity sensors: from poses to raw readings to distances (thesis 3.1.4.1, Appendix B).

Each sensor casts three rays. Their responses are summed, and corrected so that a flat wall straight ahead reads what
the centre ray alone would: F(left) + F(centre) + F(right) - 2 F(centre / cos 15 deg) (Enki 2.x).
"""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.cells import REACH_CM, Cells, slot
from epuck_sim.compiled import kernel
from epuck_sim.rays import to_disc, to_segment, to_walls

Floats = npt.NDArray[np.float64]

SENSORS = len(epuck.INFRARED_POSITIONS_CM)
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
_REACH_ALONE = REACH_CM - epuck.RADIUS_CM
_TABLE_COUNTS = epuck.INFRARED_TABLE_COUNTS
_TABLE_MM = epuck.INFRARED_TABLE_MM
_NOTHING_MM = epuck.OUT_OF_RANGE_MM


@kernel
def response(distance_cm: float) -> float:
    """Return the reading in counts for a surface at `distance_cm`: F of Enki's e-puck, 0 beyond the range."""
    if distance_cm > _RANGE:
        return 0.0
    if distance_cm < _PEAK_CM:
        return _PEAK
    return _PEAK * (_WIDTH - _PEAK_CM**2) / (distance_cm**2 - 2.0 * _PEAK_CM * distance_cm + _WIDTH)


@kernel
def inverse_response_mm(reading: float) -> int:
    """Return the distance in whole mm at which `response` gives `reading`; OUT_OF_RANGE_MM where none does."""
    if reading < response(_RANGE):
        return _NOTHING_MM
    share = 1.0 - _PEAK / min(reading, _PEAK)
    return int(10.0 * (_PEAK_CM + math.sqrt((_PEAK_CM**2 - _WIDTH) * share)))


@kernel
def firmware_table_mm(reading: float) -> int:
    """Return the distance in whole mm by the firmware's table; OUT_OF_RANGE_MM below its last entry."""
    if reading >= _TABLE_COUNTS[0]:
        return int(_TABLE_MM[0])
    for entry in range(1, len(_TABLE_COUNTS)):
        high, low = _TABLE_COUNTS[entry - 1], _TABLE_COUNTS[entry]
        if reading >= low:
            share = (high - reading) / (high - low)
            return int(_TABLE_MM[entry - 1] + share * (_TABLE_MM[entry] - _TABLE_MM[entry - 1]))
    return _NOTHING_MM


@kernel
def sense_infrared(
    poses: Floats, width_cm: float, height_cm: float, circles: Floats, edges: Floats, cells: Cells, readings: Floats
) -> None:
    """Write each robot's (robots, 8) noiseless readings in counts.

    poses: (robots, 3) x cm, y cm, heading rad; circles (k, 3), edges (m, 4): see `arena.Arena`; cells: sorted by poses.
    """
    near = np.empty((len(poses), 2))  # centres of the robots within reach
    for robot in range(len(poses)):
        x, y, heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
        discs = _discs_in_reach(poses, robot, cells, near)
        at_wall = min(min(x, y), min(width_cm - x, height_cm - y)) <= _REACH_ALONE
        if discs == 0 and not at_wall and len(circles) == 0 and len(edges) == 0:
            readings[robot, :] = 0.0
            continue
        cos, sin = math.cos(heading), math.sin(heading)
        for sensor in range(SENSORS):
            ox = x + cos * _X[sensor] - sin * _Y[sensor]
            oy = y + sin * _X[sensor] + cos * _Y[sensor]
            total = 0.0
            for ray in range(3):
                dx = cos * _COS[sensor, ray] - sin * _SIN[sensor, ray]
                dy = sin * _COS[sensor, ray] + cos * _SIN[sensor, ray]
                distance = math.inf
                if at_wall:
                    distance = to_walls(ox, oy, dx, dy, width_cm, height_cm)
                for disc in range(discs):
                    distance = min(distance, to_disc(ox, oy, dx, dy, near[disc, 0], near[disc, 1], _RADIUS))
                for circle in circles:
                    distance = min(distance, to_disc(ox, oy, dx, dy, circle[0], circle[1], circle[2]))
                for edge in edges:
                    distance = min(distance, to_segment(ox, oy, dx, dy, edge[0], edge[1], edge[2], edge[3]))
                total += response(distance)
                if ray == 1:
                    total -= 2.0 * response(distance * _STRETCH)
            readings[robot, sensor] = min(max(total, 0.0), _PEAK)


@kernel
def _discs_in_reach(poses: Floats, robot: int, cells: Cells, near: Floats) -> int:
    """Write the centres of the robots that a ray of `robot` may meet; return how many they are."""
    x, y = poses[robot, 0], poses[robot, 1]
    column = slot(x, cells.width_cm, cells.columns)
    row = slot(y, cells.height_cm, cells.rows)
    found = 0
    for r in range(max(row - 1, 0), min(row + 2, cells.rows)):
        start = cells.first[r * cells.columns + max(column - 1, 0)]
        end = cells.first[r * cells.columns + min(column + 1, cells.columns - 1) + 1]
        for member in range(start, end):
            other = cells.members[member]
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if other != robot and dx * dx + dy * dy <= REACH_CM * REACH_CM:
                near[found, 0] = poses[other, 0]
                near[found, 1] = poses[other, 1]
                found += 1
    return found


@kernel
def to_distances(readings: Floats, noise: Floats, by_table: bool, distances_mm: npt.NDArray[np.int64]) -> None:
    """Add `noise` to `readings`, both (robots, 8) counts, and write the (robots, 8) distances in whole mm."""
    for robot in range(readings.shape[0]):
        for sensor in range(readings.shape[1]):
            reading = min(max(readings[robot, sensor] + noise[robot, sensor], 0.0), _PEAK)
            readings[robot, sensor] = reading
            if by_table:
                distances_mm[robot, sensor] = firmware_table_mm(reading)
            else:
                distances_mm[robot, sensor] = inverse_response_mm(reading)
