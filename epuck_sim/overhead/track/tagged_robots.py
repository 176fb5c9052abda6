"""Whose flashes are whose, and where robots are in the dark, by the tags on top of them."""

from collections.abc import Iterable

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.track.flash_motion import FlashTable, commonest_speed
from epuck_sim.overhead.track.identities import Identities
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.robots import Robots
from epuck_sim.overhead.track.tag_reading import Readings

SELDOM = 0.02
"""Share of the frames below which a number is a misreading of another tag, or of none."""

NEAR_CM = 0.8 * epuck.RADIUS_CM
"""Largest distance of a flash from the tag on the same robot; the next robot is two radii away."""

MAX_GAP_S = 1.5
"""Longest time without a reading over which a robot's way is taken to be straight."""


def robots_by_tags(track: Track, readings: Readings, expected: frozenset[int] | None) -> Robots:
    """Return the robots of a film by their tags.

    Args:
        track: What was found in the film.
        readings: The tags that were read in it.
        expected: Numbers of the tags that there are; None if all that are read often count.

    Raises:
        FilmError: No tag is read.
    """
    warnings: list[str] = []
    readings = _only_expected(readings, expected, len(track.times_s), warnings)
    readings = _only_once(readings, warnings)
    if not len(readings.number):
        raise FilmError(
            f"{track.film}: no tag is read, or all are seen twice; check the dictionary, that the film is lit, by "
            "infrared light at least, and that a module of a tag is three pixels wide or more"
        )
    numbers = np.unique(readings.number)
    if expected is not None and (unread := sorted(expected - set(numbers.tolist()))):
        warnings.append(f"tags that are never read: {_listed(unread)}")
    poses = np.full((len(track.times_s), len(numbers), 3), np.nan)
    for column, number in enumerate(numbers):
        own = readings.of(readings.number == number)
        poses[:, column] = _poses_at(track.times_s, own)
    robot = _whose(FlashTable.of(track.flashes), numbers, poses, track.times_s)
    unknown = int(np.count_nonzero(robot < 0))
    if unknown:
        warnings.append(
            f"flashes that are under no tag: {unknown} of {len(robot)}; there are robots without a tag, or whose tag "
            "cannot be read"
        )
    expected_robots = track.options.robots
    if expected_robots is not None and expected_robots != len(numbers):
        warnings.append(f"robots whose tags are read: {len(numbers)}, but there are {expected_robots}")
    return Robots("tags", _identities(robot, track), numbers, poses, tuple(warnings))


def _only_expected(readings: Readings, expected: frozenset[int] | None, frames: int, warnings: list[str]) -> Readings:
    """Return the readings of tags that there are, and say which others there were."""
    numbers, counts = np.unique(readings.number, return_counts=True)
    seldom = counts < max(2.0, SELDOM * frames)
    if expected is not None:
        unknown = ~np.isin(numbers, list(expected))
        if (unknown & ~seldom).any():
            warnings.append(
                f"tags that are not among those given, and are left out: {_listed(numbers[unknown & ~seldom])}"
            )
        keep = numbers[~unknown]
    else:
        if seldom.any():
            warnings.append(
                f"tags that are read in less than {100 * SELDOM:.0f} % of the frames, and are left out: "
                f"{_listed(numbers[seldom])}"
            )
        keep = numbers[~seldom]
    return readings.of(np.isin(readings.number, keep))


def _only_once(readings: Readings, warnings: list[str]) -> Readings:
    """Return the readings of numbers that a frame has once, and say which it has twice."""
    key = np.stack([readings.time_s, readings.number])
    _, inverse, counts = np.unique(key, axis=1, return_inverse=True, return_counts=True)
    is_twice = counts[np.ravel(inverse)] > 1
    for number in np.unique(readings.number[is_twice]):
        frames = len(np.unique(readings.time_s[is_twice & (readings.number == number)]))
        warnings.append(
            f"tag {number} is seen twice in {frames} frames, and left out there: two robots have it, or it is mirrored"
        )
    return readings.of(~is_twice)


def _poses_at(times_s: FloatArray, own: Readings) -> FloatArray:
    """Return (times, 3) cm, cm, rad: the poses of a robot between its readings; NaN where these are too far apart."""
    if not len(own.time_s):
        return np.full((len(times_s), 3), np.nan)
    turned = np.unwrap(own.poses[:, 2])
    columns = (own.poses[:, 0], own.poses[:, 1], turned)
    poses = np.column_stack([np.interp(times_s, own.time_s, column) for column in columns])
    after = np.searchsorted(own.time_s, times_s)
    before_s = own.time_s[np.maximum(np.searchsorted(own.time_s, times_s, side="right") - 1, 0)]
    after_s = own.time_s[np.minimum(after, len(own.time_s) - 1)]
    is_known: BoolArray = (before_s <= times_s) & (times_s <= after_s) & (after_s - before_s <= MAX_GAP_S)
    poses[~is_known] = np.nan
    return poses


def _whose(flashes: FlashTable, numbers: IntArray, poses: FloatArray, times_s: FloatArray) -> IntArray:
    """Return (flashes,) the numbers of the tags nearest to flashes, -1 where none is near."""
    middle = np.searchsorted(times_s, (flashes.onset_s + flashes.end_s) / 2)
    at = poses[np.clip(middle, 0, len(times_s) - 1), :, :2]
    distances = np.linalg.norm(at - flashes.places_cm[:, None], axis=2)
    distances = np.where(np.isnan(distances), np.inf, distances)
    nearest = distances.argmin(axis=1)
    whose: IntArray = np.where(distances.min(axis=1) <= NEAR_CM, numbers[nearest], -1)
    return whose


def _identities(robot: IntArray, track: Track) -> Identities:
    """Return identities by tags: links are certain."""
    cycle, certainty = np.ones(len(robot), np.int64), np.full(len(robot), np.nan)
    flashed: dict[int, int] = {}
    for index, number in enumerate(robot.tolist()):
        if number >= 0:
            flashed[number] = flashed.get(number, 0) + 1
            cycle[index] = flashed[number]
            certainty[index] = 1.0 if flashed[number] > 1 else np.nan
    speeds = FlashTable.of(track.flashes).speeds_cm_s
    return Identities(robot, cycle, certainty, commonest_speed(speeds) if len(speeds) else 0.0)


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(str(number) for number in numbers)
