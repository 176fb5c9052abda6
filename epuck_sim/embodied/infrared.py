"""The infrared proximity sensors: from poses to raw readings (thesis 3.1.4.1, Appendix B).

Each sensor casts three rays. Their responses are summed, and corrected so that the reading of a flat wall straight
ahead is that of the centre ray alone: F(left) + F(centre) + F(right) - 2 F(centre / cos 15 deg) (Enki 2.x).
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.cell_list import CellList, cells_around, members_in_row
from epuck_sim.embodied.infrared_response import Response, reading_at
from epuck_sim.embodied.ray_casting import to_disc, to_segment
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.util.jit import jit

RAYS = 3
"""Rays of each sensor."""


class InfraredSensors(NamedTuple):
    """The proximity sensors of a robot, in the body's frame."""

    x: FloatArray
    """(sensors,) cm: positions ahead of the axle's centre."""
    y: FloatArray
    """(sensors,) cm: positions to the left of it."""
    cos: FloatArray
    """(sensors, RAYS) cosines of the rays' directions."""
    sin: FloatArray
    """(sensors, RAYS) sines of the rays' directions."""
    stretch: float
    """Distance of a flat wall on a side ray, relative to that on the centre ray."""
    reach_cm: float
    """Largest distance from the body's centre to the end of a ray."""
    radius_cm: float
    """Radius of the robots that rays meet."""
    response: Response


def make_infrared_sensors(robot: RobotKind) -> InfraredSensors:
    """Return the proximity sensors of a kind of robot; of one without any, they have no rows."""
    section = robot.infrared
    if section is None:
        nothing, no_rays = np.empty(0), np.empty((0, RAYS))
        response = Response(0.0, 0.0, 0.0, 1.0)
        return InfraredSensors(nothing, nothing, no_rays, no_rays, 1.0, 0.0, float(robot.radius_cm), response)
    x, y, direction_deg = np.array(section.sensors).T
    spread_rad = math.radians(section.spread_deg)
    angles = np.radians(direction_deg)[:, None] + spread_rad * np.array([-1, 0, 1])
    return InfraredSensors(
        np.ascontiguousarray(x),
        np.ascontiguousarray(y),
        np.cos(angles),
        np.sin(angles),
        1 / math.cos(spread_rad),
        robot.ray_reach_cm,
        float(robot.radius_cm),
        Response(section.range_cm, section.peak_counts, section.peak_cm, section.width_cm2),
    )


@jit
def sense_infrared(
    poses: FloatArray,
    width_cm: float,
    height_cm: float,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    sensors: InfraredSensors,
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
        sensors: The sensors of each robot.
        sees_robots: Whether rays end at robots; else only at walls and obstacles.
        observer: Number of the first robot that senses.
        readings: (observers, 8) counts: the readings of the robots from `observer` on; written, but for sensors
            that there are not.
    """
    count, reach = len(sensors.x), sensors.reach_cm
    response = sensors.response
    if count == 0:
        return
    distances = np.empty((count, RAYS))
    for row in range(len(readings)):
        robot = observer + row
        x, y = poses[robot, 0], poses[robot, 1]
        cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
        distances[:] = math.inf
        _meet_walls(sensors, x, y, cos, sin, width_cm, height_cm, distances)
        if sees_robots:
            _meet_robots(sensors, poses, robot, cos, sin, cells, distances)
        for k in range(len(circles)):
            dx, dy, radius = circles[k, 0] - x, circles[k, 1] - y, circles[k, 2]
            if dx * dx + dy * dy <= (reach + radius) ** 2:
                _meet_disc(sensors, dx * cos + dy * sin, dy * cos - dx * sin, radius, distances)
        for k in range(len(edges)):
            ax, ay, bx, by = edges[k, 0] - x, edges[k, 1] - y, edges[k, 2] - x, edges[k, 3] - y
            from_x, from_y, to_x, to_y = (
                ax * cos + ay * sin,
                ay * cos - ax * sin,
                bx * cos + by * sin,
                by * cos - bx * sin,
            )
            _meet_edge(sensors, from_x, from_y, to_x, to_y, distances)
        for sensor in range(count):
            left, centre, right = distances[sensor, 0], distances[sensor, 1], distances[sensor, 2]
            if min(left, centre, right) > response.range_cm:
                readings[row, sensor] = 0.0
                continue
            sides = reading_at(left, response) + reading_at(centre, response) + reading_at(right, response)
            total = sides - 2.0 * reading_at(centre * sensors.stretch, response)
            readings[row, sensor] = min(max(total, 0.0), response.peak_counts)


@jit
def _meet_walls(
    sensors: InfraredSensors,
    x: float,
    y: float,
    cos: float,
    sin: float,
    width_cm: float,
    height_cm: float,
    distances: FloatArray,
) -> None:
    """Shorten the rays that meet a wall: (sensors, RAYS) `distances` in cm, of a robot at (x, y)."""
    reach = sensors.reach_cm
    if x <= reach:
        _meet_wall(sensors, x, -cos, sin, distances)
    if width_cm - x <= reach:
        _meet_wall(sensors, width_cm - x, cos, -sin, distances)
    if y <= reach:
        _meet_wall(sensors, y, -sin, -cos, distances)
    if height_cm - y <= reach:
        _meet_wall(sensors, height_cm - y, sin, cos, distances)


@jit
def _meet_wall(sensors: InfraredSensors, away: float, ahead: float, aside: float, distances: FloatArray) -> None:
    """Shorten the rays that meet the wall at the distance `away` in the direction (ahead, aside), a unit vector."""
    range_cm = sensors.response.range_cm
    for sensor in range(len(sensors.x)):
        gap = max(away - ahead * sensors.x[sensor] - aside * sensors.y[sensor], 0.0)
        if gap > range_cm:
            continue
        for ray in range(RAYS):
            approach = ahead * sensors.cos[sensor, ray] + aside * sensors.sin[sensor, ray]
            if approach > 0.0 and gap <= range_cm * approach:
                distances[sensor, ray] = min(distances[sensor, ray], gap / approach)


@jit
def _meet_robots(
    sensors: InfraredSensors,
    poses: FloatArray,
    robot: int,
    cos: float,
    sin: float,
    cells: CellList,
    distances: FloatArray,
) -> None:
    """Shorten the rays that meet another robot; those in the cells around are looked at."""
    radius = sensors.radius_cm
    reach = sensors.reach_cm + radius
    x, y = poses[robot, 0], poses[robot, 1]
    block = cells_around(x, y, cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for member in range(start, end):
            other = cells.members[member]
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if other != robot and dx * dx + dy * dy <= reach * reach:
                _meet_disc(sensors, dx * cos + dy * sin, dy * cos - dx * sin, radius, distances)


@jit
def _meet_disc(sensors: InfraredSensors, ahead: float, aside: float, radius: float, distances: FloatArray) -> None:
    """Shorten the rays that meet the disc centred at (ahead, aside) in the body's frame."""
    cos, sin = sensors.cos, sensors.sin
    for sensor in range(len(sensors.x)):
        fx, fy = ahead - sensors.x[sensor], aside - sensors.y[sensor]
        beyond_left = fy * cos[sensor, 2] - fx * sin[sensor, 2]
        beyond_right = fx * sin[sensor, 0] - fy * cos[sensor, 0]
        if max(beyond_left, beyond_right) > radius:
            continue  # beside all three rays
        for ray in range(RAYS):
            reach = to_disc(0.0, 0.0, cos[sensor, ray], sin[sensor, ray], fx, fy, radius)
            distances[sensor, ray] = min(distances[sensor, ray], reach)


@jit
def _meet_edge(sensors: InfraredSensors, ax: float, ay: float, bx: float, by: float, distances: FloatArray) -> None:
    """Shorten the rays that meet an obstacle's edge, given by its ends in the body's frame."""
    reach = sensors.reach_cm
    if min(ax, bx) > reach or max(ax, bx) < -reach or min(ay, by) > reach or max(ay, by) < -reach:
        return
    for sensor in range(len(sensors.x)):
        x, y = sensors.x[sensor], sensors.y[sensor]
        for ray in range(RAYS):
            met = to_segment(x, y, sensors.cos[sensor, ray], sensors.sin[sensor, ray], ax, ay, bx, by)
            distances[sensor, ray] = min(distances[sensor, ray], met)
