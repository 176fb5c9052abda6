"""Identifies robots in a film, by motion or by tags, and makes tables of flashes, a trace, and pairs of robots."""

import json
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.display.table import csv_cell, csv_text
from epuck_sim.errors import FilmError
from epuck_sim.overhead.flashes import FlashTable
from epuck_sim.overhead.identities import LONGEST, Identities, commonest_speed, link_flashes
from epuck_sim.overhead.synchrony import ORDER_PARAMETER, is_filmed, order_over_time
from epuck_sim.overhead.tags import Readings
from epuck_sim.overhead.track import Track
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import versions

MANY_UNSURE = 0.05  # share of unsure links above which there is a warning

TOGETHER = 0.5  # least share of common flashes of two robots that flash together
MOST_KNOWN = 0.75  # least share of robots with a known phase for an order parameter
SELDOM = 0.02  # share of the frames below which a tag's number is a misreading
NEAR_CM = 0.8 * epuck.RADIUS_CM  # largest distance of a flash from its robot's tag; the next robot is two radii away
MAX_GAP_S = 1.5  # longest time between two readings over which a robot's poses are interpolated

TIMES = ("time_s", "onset_s", "duration_s")  # columns of times, which are always known
Columns = dict[str, npt.NDArray[Any]]  # columns of equal length, by their names


class Robots(NamedTuple):
    """The robots of a film, and the flashes of each."""

    track: Track  # what is known of the film otherwise
    by: Literal["motion", "tags"]  # how they are identified
    flashes: FlashTable
    identities: Identities
    numbers: IntArray  # (robots,) their numbers, ascending: those of their tags, or from 0
    poses: FloatArray | None
    """(frames, robots, 3) cm, cm, rad: x, y, heading by tags, NaN where none is read; None without tags."""
    warnings: tuple[str, ...]  # sentences about doubts

    def phases(self, times_s: FloatArray) -> FloatArray:
        """Return (times, robots) the phases of robots at some times, as shares of their cycles; NaN where not known.

        A phase rises evenly from one flash of a robot to its next. It is unknown before the first flash, from a period
        after the last one on, where flashes are missing, and by flashes that may have begun before the first frame.
        """
        onset_s, period_s = self.flashes.onset_s, self.track.period_s
        shares, has_begun = np.full((len(times_s), len(self.numbers)), np.nan), onset_s > self.track.times_s[0]
        for column, number in enumerate(self.numbers):
            own_s = onset_s[has_begun & (self.identities.robot == number)]
            if not len(own_s):
                continue
            cycle_s = np.append(np.diff(own_s), period_s)
            begun = np.searchsorted(own_s, times_s, side="right") - 1
            since_s, lasts_s = times_s - own_s[np.maximum(begun, 0)], cycle_s[np.maximum(begun, 0)]
            is_known = (begun >= 0) & (lasts_s <= LONGEST * period_s) & (since_s < lasts_s)
            shares[is_known, column] = (since_s / lasts_s)[is_known]
        return shares

    def pair_columns(self) -> Columns:
        """Return a table with a row for each pair of robots, those that flash together most often first.

        It has the flashes of the robot with fewer, how many of these overlap with the other's, and their share.
        """
        whose, flashes, found = self.identities.robot, self.flashes, []
        spans = {each: (flashes.onset_s[whose == each], flashes.end_s[whose == each]) for each in self.numbers.tolist()}
        for one, two in combinations(spans, 2):
            few, many = sorted((spans[one], spans[two]), key=lambda span: len(span[0]))
            begun = np.searchsorted(many[0], few[1])  # flashes of the other that begin before each ends
            over = np.searchsorted(many[1], few[0], side="right")  # and those that end before it begins
            found.append((one, two, len(few[0]), np.count_nonzero(begun > over)))
        robot, other, number, together = np.array(found, np.int64).reshape(-1, 4).T
        share = together / np.maximum(number, 1)
        table = {"robot": robot, "other": other, "flashes": number, "together": together, "share": share}
        order = np.argsort(-share, kind="stable")
        return {name: column[order] for name, column in table.items()}

    def summary(self) -> dict[str, Any]:
        """Return the robots as the numbers and texts of a JSON object."""
        least = self.track.options.order_parameter or ORDER_PARAMETER
        in_order_s = self.flashes.onset_s[np.nan_to_num(order_of_shares(self.phases(self.flashes.onset_s))) >= least]
        after_s = float(in_order_s[0]) - self.track.start_s if len(in_order_s) else None
        return {
            "by": self.by,
            "robots": self.numbers.tolist(),
            "links": int(np.count_nonzero(~np.isnan(self.identities.certainty))),
            "unsure_share": self.identities.unsure,
            "flashes_of_no_robot": int(np.count_nonzero(self.identities.robot < 0)),
            "by_phases_s": after_s,
            "by_phases_periods": None if after_s is None else after_s / self.track.period_s,
            "pairs_together": int(np.count_nonzero(self.pair_columns()["share"] >= TOGETHER)),
            "warnings": list(self.warnings),
        }

    def flash_columns(self) -> Columns:
        """Return a table with a row for each flash: its time, duration, place and robot, and how certain that is."""
        flashes, who, span_s = self.flashes, self.identities, (self.track.times_s[0], self.track.times_s[-1])
        order, _ = order_over_time(flashes.onset_s, self.track.period_s)
        return {
            "onset_s": flashes.onset_s,
            "duration_s": flashes.end_s - flashes.onset_s,
            "x_cm": flashes.places_cm[:, 0],
            "y_cm": flashes.places_cm[:, 1],
            "light": flashes.light,
            "order_parameter": np.where(is_filmed(flashes.onset_s, self.track.period_s, span_s), order, np.nan),
            "robot": who.robot,
            "cycle": who.cycle,
            "certainty": who.certainty,
            "phase_order_parameter": order_of_shares(self.phases(self.flashes.onset_s)),
        }

    def trace_columns(self) -> Columns:
        """Return a table with a row for each robot in each frame; traces of simulations have these columns, too."""
        times_s, flashes, spans = self.track.times_s, self.flashes, self.flashes.frames(self.track.times_s)
        poses = np.full((len(times_s), len(self.numbers), 3), np.nan) if self.poses is None else self.poses.copy()
        unread, is_lit = np.isnan(poses[..., 0]), np.zeros(poses.shape[:2], bool)
        for index in np.flatnonzero(self.identities.robot >= 0):
            column, span = np.searchsorted(self.numbers, self.identities.robot[index]), slice(*spans[index])
            since_s = times_s[span] - times_s[span].mean()
            seen_cm = flashes.places_cm[index] + since_s[:, None] * flashes.velocities_cm_s[index]
            poses[span, column, :2] = np.where(unread[span, column, None], seen_cm, poses[span, column, :2])
            is_lit[span, column] = True
        shares = self.phases(times_s)
        return {
            "time_s": np.repeat(times_s, len(self.numbers)),
            "robot": np.tile(self.numbers, len(times_s)),
            **{name: poses[..., axis].ravel() for axis, name in enumerate(("x_cm", "y_cm", "heading_rad"))},
            "ring_on": is_lit.ravel(),
            "phase_ms": 1000 * self.track.period_s * shares.ravel(),
        }

    def save(self, flashes: Path | None, trace: Path | None, pairs: Path | None) -> None:
        """Write the tables whose paths are given; raise EpuckSimError where one cannot be written."""
        metadata = {"film": self.track.film, "versions": json.dumps(versions())}
        for path, columns in ((flashes, self.flash_columns), (trace, self.trace_columns), (pairs, self.pair_columns)):
            if path is not None:
                write_table(path, columns(), metadata)


def order_of_shares(shares: FloatArray) -> FloatArray:
    """Return (times,) order parameters (eq. 4.2) of (times, robots) phases; NaN where too few are known."""
    known = ~np.isnan(shares)
    number = known.sum(axis=1)
    total = np.where(known, np.exp(2j * np.pi * np.nan_to_num(shares)), 0.0).sum(axis=1)
    is_enough = number >= max(2.0, MOST_KNOWN * shares.shape[1])
    return np.asarray(np.where(is_enough, np.abs(total) / np.maximum(number, 1), np.nan))


def write_table(path: Path, columns: Columns, metadata: Mapping[str, str]) -> None:
    """Write columns as CSV, or as Parquet with metadata; NaN is empty in one and null in the other."""
    with atomic_write(path) as part:
        if path.suffix == ".parquet":
            import pyarrow as pa  # noqa: PLC0415 is for Parquet alone
            from pyarrow import parquet  # noqa: PLC0415

            table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
            with part.open("wb") as file:  # pyarrow opens no file whose name is not UTF-8
                parquet.write_table(table.replace_schema_metadata(dict(metadata)), file, compression="zstd")
            return
        kinds = ("{:.6f}".format if name in TIMES else csv_cell for name in columns)  # microseconds in long films, too
        cells = (map(kind, column.tolist()) for kind, column in zip(kinds, columns.values(), strict=True))
        part.write_text(csv_text(columns, zip(*cells, strict=True)), encoding="utf-8", newline="")


def find_robots(track: Track) -> Robots:
    """Return the robots of a film, by tags if the track has them, else by motion; raise FilmError if no tag is read."""
    flashes = FlashTable.of(track.flashes)
    if track.tags is not None:
        return _by_tags(track, flashes, track.tags)
    identities, expected = link_flashes(flashes, track.period_s, track.geometry.floor_cm), track.options.robots
    warnings = []
    if identities.unsure > MANY_UNSURE:
        said = f"{100 * identities.unsure:.0f} % of the links from flash to flash have an alternative"
        too_far = "robots move too far while they are dark; tags tell them apart (--tags)"
        warnings.append(f"{said} that is nearly as good: {too_far}")
    if expected is not None and identities.robots != expected:
        said = f"flashes are linked to {identities.robots} robots, but there are {expected}"
        warnings.append(f"{said}: lost ones are counted anew")
    return Robots(track, "motion", flashes, identities, np.arange(identities.robots), None, tuple(warnings))


def _by_tags(track: Track, flashes: FlashTable, readings: Readings) -> Robots:
    warnings: list[str] = []
    expected, expected_robots = track.options.tag_numbers, track.options.robots
    readings = _only_once(_only_expected(readings, expected, len(track.times_s), warnings), warnings)
    if not len(readings.number):
        is_lit = "that the room is lit (at least by infrared light)"
        check = f"the dictionary, {is_lit}, and that a module of a tag is three pixels wide or more"
        raise FilmError(f"{track.film}: no tag is read, or all are seen twice; check {check}")
    numbers = np.unique(readings.number)
    if expected is not None and (unread := sorted(expected - set(numbers.tolist()))):
        warnings.append(f"tags that are never read: {', '.join(map(str, unread))}")
    own = [readings.of(readings.number == number) for number in numbers]
    poses = np.stack([_poses_at(track.times_s, each) for each in own], axis=1)
    middle = np.searchsorted(track.times_s, (flashes.onset_s + flashes.end_s) / 2)
    at_cm = poses[np.clip(middle, 0, len(track.times_s) - 1), :, :2]
    away_cm = np.nan_to_num(np.linalg.norm(at_cm - flashes.places_cm[:, None], axis=2), nan=np.inf)
    robot = np.where(away_cm.min(axis=1) <= NEAR_CM, numbers[away_cm.argmin(axis=1)], -1)
    is_whole = (flashes.onset_s > track.times_s[0]) & (flashes.end_s < track.times_s[-1])  # if cut, it may be one frame
    if unknown := np.count_nonzero((robot < 0) & is_whole):
        said = f"flashes that are under no tag: {unknown} of {len(robot)}"
        warnings.append(f"{said}; some robots have no tag, or one that cannot be read")
    if expected_robots is not None and expected_robots != len(numbers):
        warnings.append(f"robots whose tags are read: {len(numbers)}, but there are {expected_robots}")
    cycle = np.ones(len(robot), np.int64)
    for number in numbers:
        cycle[robot == number] = np.arange(1, 1 + np.count_nonzero(robot == number))
    certainty = np.where(cycle > 1, 1.0, np.nan)  # links by tags are certain
    speed_cm_s = commonest_speed(flashes.speeds_cm_s) if len(robot) else 0.0
    identities = Identities(robot, cycle, certainty, speed_cm_s)
    return Robots(track, "tags", flashes, identities, numbers, poses, tuple(warnings))


def _only_expected(readings: Readings, expected: frozenset[int] | None, frames: int, warnings: list[str]) -> Readings:
    """Return the readings of the expected tags, or of those read often; warn of others."""
    numbers, counts = np.unique(readings.number, return_counts=True)
    others = seldom = counts < max(2.0, SELDOM * frames)
    named, why = numbers[seldom], f"are read in less than {100 * SELDOM:.0f} % of the frames"
    if expected is not None:
        others = ~np.isin(numbers, list(expected))
        named, why = numbers[others & ~seldom], "are not among those given"
    if len(named):
        warnings.append(f"tags that {why}, and are left out: {', '.join(map(str, named))}")
    return readings.of(np.isin(readings.number, numbers[~others]))


def _only_once(readings: Readings, warnings: list[str]) -> Readings:
    """Return the readings of tags that a frame shows once; warn of those that it shows twice."""
    key = np.stack([readings.time_s, readings.number])
    _, inverse, counts = np.unique(key, axis=1, return_inverse=True, return_counts=True)
    is_twice = counts[np.ravel(inverse)] > 1
    for number in np.unique(readings.number[is_twice]):
        frames = len(np.unique(readings.time_s[is_twice & (readings.number == number)]))
        said = f"tag {number} is seen twice in {frames} frames, and left out there"
        warnings.append(f"{said}: two robots have it, or it is mirrored")
    return readings.of(~is_twice)


def _poses_at(times_s: FloatArray, own: Readings) -> FloatArray:
    """Return (times, 3) cm, cm, rad: the poses of a robot between its readings; NaN where these are too far apart."""
    columns = (own.poses[:, 0], own.poses[:, 1], np.unwrap(own.poses[:, 2]))
    poses = np.column_stack([np.interp(times_s, own.time_s, column, np.nan, np.nan) for column in columns])
    before, after = (np.searchsorted(own.time_s, times_s, side) for side in ("right", "left"))
    padded_s = np.concatenate([own.time_s[:1], own.time_s, own.time_s[-1:]])
    poses[padded_s[after + 1] - padded_s[before] > MAX_GAP_S] = np.nan
    return poses
