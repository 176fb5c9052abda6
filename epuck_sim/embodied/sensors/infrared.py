"""The infrared proximity sensors: raw readings, and the distances that they stand for (thesis 3.1.4.1, Appendix B).

Each sensor casts three rays. Their responses are summed, and corrected so that the reading of a flat wall straight
ahead is that of the centre ray alone: F(left) + F(centre) + F(right) - 2 F(centre / cos 15 deg) (Enki 2.x).
"""

import math
from typing import Any

import numpy as np

from epuck_sim import elementary, epuck
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.cells import cells_around, members_in_row
from epuck_sim.embodied.sensors.sight import to_disc, to_segment
from epuck_sim.embodied.swarm import RAYS, Swarm, swarm_at
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.robots import InfraredSection
from epuck_sim.util.elementary import sin_cos
from epuck_sim.util.jit import jit_inline, jit_no_alloc

_TABLE_COUNTS, _TABLE_MM, _NOTHING_MM = epuck.INFRARED_TABLE_COUNTS, epuck.INFRARED_TABLE_MM, epuck.OUT_OF_RANGE_MM
_ROUNDING_MM = 1e-6  # added before truncation to whole mm: a wall 40 mm away must not read 39


def set_infrared(record: Any, kind: RobotKind, section: InfraredSection, noise_counts: float) -> None:
    """Set INFRARED of a group by its section of a scenario; a kind of robot without any sensors has 0."""
    record.by_table, record.sees_robots = section.distance == "firmware_table", section.robots
    record.noise_counts, record.reach_cm = noise_counts, kind.ray_reach_cm
    record.count = 0
    if kind.infrared is None:
        return
    x, y, direction_deg = np.array(kind.infrared.sensors).T
    spread_rad = math.radians(kind.infrared.spread_deg)
    angles = np.radians(direction_deg)[:, None] + spread_rad * np.array([-1, 0, 1])
    record.count = len(x)
    record.x[: len(x)], record.y[: len(x)] = x, y
    for ray, angle in np.ndenumerate(angles):
        record.sin[ray], record.cos[ray] = elementary.sin_cos(angle)
    record.stretch = 1 / elementary.cos(spread_rad)
    for name in ("range_cm", "peak_counts", "peak_cm", "width_cm2"):
        record[name] = getattr(kind.infrared, name)


@jit_no_alloc
def sense_infrared(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Write the readings of a group's proximity sensors, with noise, and the distances that belong to them."""
    swarm = swarm_at(block)
    group, scene = swarm.groups[number], swarm.scene[0]
    sensors = group.infrared
    for member in range(group.first, group.first + group.count):
        robot = swarm.robots[member]
        if sensors.count > 0:
            sin, cos = sin_cos(robot.heading)
            for sensor in range(sensors.count):
                for ray in range(RAYS):
                    sensors.met_cm[sensor, ray] = math.inf
            x, y = robot.x, robot.y
            _meet_wall(sensors, x, -cos, sin)
            _meet_wall(sensors, scene.width_cm - x, cos, -sin)
            _meet_wall(sensors, y, -sin, -cos)
            _meet_wall(sensors, scene.height_cm - y, sin, cos)
            _meet_bodies(swarm, sensors, robot, member, cos, sin)
        _read(sensors, robot)


@jit_inline
def _meet_wall(sensors: Any, away: float, ahead: float, aside: float) -> None:
    """Shorten the rays that meet the wall at the distance `away` in the direction (ahead, aside), a unit vector."""
    range_cm = sensors.range_cm
    for sensor in range(sensors.count if away <= sensors.reach_cm else 0):
        gap = max(away - ahead * sensors.x[sensor] - aside * sensors.y[sensor], 0.0)
        if gap > range_cm:
            continue
        for ray in range(RAYS):
            approach = ahead * sensors.cos[sensor, ray] + aside * sensors.sin[sensor, ray]
            if approach > 0.0 and gap <= range_cm * approach:
                sensors.met_cm[sensor, ray] = min(sensors.met_cm[sensor, ray], gap / approach)


@jit_inline
def _meet_bodies(swarm: Swarm, sensors: Any, robot: Any, number: int, cos: float, sin: float) -> None:
    """Shorten the rays that meet robots, if sensors see them, or obstacles."""
    x, y, reach = robot.x, robot.y, sensors.reach_cm
    near, within = cells_around(x, y, swarm.scene[0]), reach + swarm.scene[0].largest_cm
    for row in range(near.first_row, near.end_row if sensors.sees_robots else 0):
        start, end = members_in_row(near, row, swarm)
        for place in range(start, end):
            member = swarm.members[place]
            dx, dy = member.x - x, member.y - y
            if member.robot != number and dx * dx + dy * dy <= within * within:
                _meet_disc(sensors, dx * cos + dy * sin, dy * cos - dx * sin, member.radius_cm)
    for place in range(swarm.scene[0].circles):
        circle = swarm.circles[place]
        dx, dy = circle.x - x, circle.y - y
        if dx * dx + dy * dy <= (reach + circle.radius) ** 2:
            _meet_disc(sensors, dx * cos + dy * sin, dy * cos - dx * sin, circle.radius)
    for place in range(swarm.scene[0].edges):
        edge = swarm.edges[place]
        ax, ay, bx, by = edge.ax - x, edge.ay - y, edge.bx - x, edge.by - y
        ax, ay, bx, by = ax * cos + ay * sin, ay * cos - ax * sin, bx * cos + by * sin, by * cos - bx * sin
        if min(ax, bx) > reach or max(ax, bx) < -reach or min(ay, by) > reach or max(ay, by) < -reach:
            continue
        for sensor in range(sensors.count):
            from_x, from_y = sensors.x[sensor], sensors.y[sensor]
            for ray in range(RAYS):
                met = to_segment(from_x, from_y, sensors.cos[sensor, ray], sensors.sin[sensor, ray], ax, ay, bx, by)
                sensors.met_cm[sensor, ray] = min(sensors.met_cm[sensor, ray], met)


@jit_inline
def _meet_disc(sensors: Any, ahead: float, aside: float, radius: float) -> None:
    """Shorten the rays that meet the disc centred at (ahead, aside) in the body's frame."""
    cos, sin = sensors.cos, sensors.sin
    for sensor in range(sensors.count):
        fx, fy = ahead - sensors.x[sensor], aside - sensors.y[sensor]
        beyond_left = fy * cos[sensor, 2] - fx * sin[sensor, 2]
        beyond_right = fx * sin[sensor, 0] - fy * cos[sensor, 0]
        if max(beyond_left, beyond_right) > radius:
            continue  # beside all three rays
        for ray in range(RAYS):
            reach = to_disc(0.0, 0.0, cos[sensor, ray], sin[sensor, ray], fx, fy, radius)
            sensors.met_cm[sensor, ray] = min(sensors.met_cm[sensor, ray], reach)


@jit_inline
def _read(sensors: Any, robot: Any) -> None:
    """Write a robot's readings and distances from where its rays end: with its sensors' gains, and with noise."""
    sensed = robot.sensors
    least_counts = reading_at(sensors.range_cm, sensors)
    for sensor in range(sensors.count):
        left, centre, right = sensors.met_cm[sensor, 0], sensors.met_cm[sensor, 1], sensors.met_cm[sensor, 2]
        reading = 0.0
        if min(left, centre, right) <= sensors.range_cm:
            sides = reading_at(left, sensors) + reading_at(centre, sensors) + reading_at(right, sensors)
            total = sides - 2.0 * reading_at(centre * sensors.stretch, sensors)
            reading = min(max(total, 0.0), sensors.peak_counts)
        amplified = reading * robot.infrared_gain[sensor]
        noise_counts = sensors.noise_counts * robot.infrared_noise[sensor]
        reading = min(max(amplified + noise_counts, 0.0), sensors.peak_counts)
        sensed.infrared[sensor] = reading
        if sensors.by_table:
            sensed.distance_mm[sensor] = firmware_table_mm(reading)
        elif reading < least_counts:
            sensed.distance_mm[sensor] = _NOTHING_MM
        else:
            sensed.distance_mm[sensor] = inverse_response_mm(reading, sensors)
    read_nothing(sensed, sensors.count)


@jit_inline
def read_nothing(sensed: Any, first: int = 0) -> None:
    """Set the readings of a robot's sensors from number `first` on to 0, and their distances to none."""
    for sensor in range(first, SENSORS):
        sensed.infrared[sensor] = 0.0
        sensed.distance_mm[sensor] = _NOTHING_MM


@jit_inline
def reading_at(distance_cm: float, sensors: Any) -> float:
    """Return the counts that INFRARED reads at a distance x: m (c - x0^2) / (x^2 - 2 x0 x + c); 0 beyond the range."""
    peak: float = sensors.peak_counts
    peak_cm: float = sensors.peak_cm
    width: float = sensors.width_cm2
    if distance_cm > sensors.range_cm:
        return 0.0
    if distance_cm < peak_cm:
        return peak
    return peak * (width - peak_cm**2) / (distance_cm**2 - 2.0 * peak_cm * distance_cm + width)


@jit_inline
def inverse_response_mm(reading: float, sensors: Any) -> int:
    """Return the distance in whole mm at which `reading_at` gives a reading, which is at least that at the range."""
    share = 1.0 - sensors.peak_counts / min(reading, sensors.peak_counts)
    peak_cm = sensors.peak_cm
    return int(10.0 * (peak_cm + math.sqrt((peak_cm**2 - sensors.width_cm2) * share)) + _ROUNDING_MM)


@jit_inline
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
