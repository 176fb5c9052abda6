"""The response of infrared proximity sensors: from raw readings to distances (thesis 3.1.4.1, Appendix B)."""

import math
from typing import NamedTuple

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.util.jit import jit

_TABLE_COUNTS = epuck.INFRARED_TABLE_COUNTS
_TABLE_MM = epuck.INFRARED_TABLE_MM
_NOTHING_MM = epuck.OUT_OF_RANGE_MM
_ROUNDING_MM = 1e-6  # added before truncation to whole mm: a wall 40 mm away must not read 39


class Response(NamedTuple):
    """How the reading of a ray depends on the distance of what it meets: m (c - x0^2) / (x^2 - 2 x0 x + c)."""

    range_cm: float
    """Distance beyond which the reading is 0."""
    peak_counts: float
    """Largest reading, m."""
    peak_cm: float
    """Distance of the largest reading, x0."""
    width_cm2: float
    """Width of the peak, c."""


@jit
def reading_at(distance_cm: float, response: Response) -> float:
    """Return the reading in counts for a surface at `distance_cm`; 0 beyond the range."""
    peak, peak_cm, width = response.peak_counts, response.peak_cm, response.width_cm2
    if distance_cm > response.range_cm:
        return 0.0
    if distance_cm < peak_cm:
        return peak
    return peak * (width - peak_cm**2) / (distance_cm**2 - 2.0 * peak_cm * distance_cm + width)


@jit
def inverse_response_mm(reading: float, response: Response) -> int:
    """Return the distance in whole mm at which `reading_at` gives `reading`; OUT_OF_RANGE_MM where none does."""
    if reading < reading_at(response.range_cm, response):
        return _NOTHING_MM
    share = 1.0 - response.peak_counts / min(reading, response.peak_counts)
    peak_cm = response.peak_cm
    return int(10.0 * (peak_cm + math.sqrt((peak_cm**2 - response.width_cm2) * share)) + _ROUNDING_MM)


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
def to_distances(
    readings: FloatArray,
    response: Response,
    sensors: int,
    gain: FloatArray,
    noise: FloatArray,
    noise_counts: float,
    by_table: bool,
    distances_mm: IntArray,
) -> None:
    """Amplify the readings, add noise, and convert them to distances.

    Args:
        readings: (robots, 8) counts; overwritten with the amplified, noisy readings.
        response: The sensors' response.
        sensors: Number of sensors of each robot; those that it lacks read 0, and nothing is in their range.
        gain: (robots, 8) factor of each sensor's reading, 1 for an ideal sensor.
        noise: (robots, 8) standard normal numbers; further rows are ignored.
        noise_counts: Standard deviation of the noise in counts.
        by_table: Whether distances come from the firmware's table instead of the inverse response.
        distances_mm: (robots, 8) whole mm; written.
    """
    for robot in range(readings.shape[0]):
        for sensor in range(sensors, SENSORS):
            readings[robot, sensor] = 0.0
            distances_mm[robot, sensor] = _NOTHING_MM
        for sensor in range(sensors):
            amplified = readings[robot, sensor] * gain[robot, sensor]
            reading = min(max(amplified + noise_counts * noise[robot, sensor], 0.0), response.peak_counts)
            readings[robot, sensor] = reading
            if by_table:
                distances_mm[robot, sensor] = firmware_table_mm(reading)
            else:
                distances_mm[robot, sensor] = inverse_response_mm(reading, response)
