"""Who is who in a film, and the tables that follow from it: flashes, a trace, and pairs that flash together."""

import json
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.track.flash_motion import FlashTable
from epuck_sim.overhead.track.flashes import frames_lit
from epuck_sim.overhead.track.identities import Identities, link_flashes
from epuck_sim.overhead.track.onsets import order_over_time
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.robot_phases import Pair, first_in_order, order_of_shares, pairs, phase_shares
from epuck_sim.overhead.track.table_file import Columns, write_table
from epuck_sim.util.provenance import versions

TOGETHER = 0.5
"""Share of the flashes of two robots from which they are counted as a pair that flashes together."""

MANY_UNSURE = 0.05
"""Share of unsure links from which there is a warning."""


class Robots(NamedTuple):
    """The robots of a film, and whose flashes are whose."""

    by: Literal["motion", "tags"]
    """How they are identified."""
    identities: Identities
    numbers: IntArray
    """(robots,) their numbers, ascending: those of their tags, or from 0."""
    poses: FloatArray | None
    """(frames, robots, 3) cm, cm, rad: x, y, heading by tags, NaN where none is read; None without tags."""
    warnings: tuple[str, ...]
    """Sentences about what is doubtful."""


def robots_by_motion(track: Track) -> Robots:
    """Return the robots of a film by how they move from flash to flash."""
    identities = link_flashes(FlashTable.of(track.flashes), track.period_s, track.geometry.floor_cm)
    warnings = []
    if identities.unsure > MANY_UNSURE:
        warnings.append(
            f"{100 * identities.unsure:.0f} % of the links from flash to flash have an alternative that is nearly as "
            "good: robots move too far while they are dark; tags tell them apart (--tags)"
        )
    expected = track.options.robots
    if expected is not None and identities.robots != expected:
        warnings.append(
            f"flashes are linked to {identities.robots} robots, but there are {expected}: some were lost and count anew"
        )
    return Robots("motion", identities, np.arange(identities.robots), None, tuple(warnings))


def summary(track: Track, robots: Robots) -> dict[str, Any]:
    """Return what is known of the robots, as the numbers and texts of a JSON object."""
    flashes = FlashTable.of(track.flashes)
    order = _order(track, robots)
    in_order_s = first_in_order(flashes.onset_s, order)
    after_s = None if in_order_s is None else in_order_s - track.start_s
    found = _pairs(flashes, robots)
    return {
        "by": robots.by,
        "robots": robots.numbers.tolist(),
        "links": int(np.count_nonzero(~np.isnan(robots.identities.certainty))),
        "unsure_share": robots.identities.unsure,
        "flashes_of_no_robot": int(np.count_nonzero(robots.identities.robot < 0)),
        "t_sync_s": after_s,
        "t_sync_periods": None if after_s is None else after_s / track.period_s,
        "pairs_together": sum(pair.together >= TOGETHER * max(pair.flashes, 1) for pair in found),
        "warnings": list(robots.warnings),
    }


def flash_columns(track: Track, robots: Robots) -> Columns:
    """Return a table with a row for each flash: when, how long and where, whose, and how sure that is."""
    flashes, who = FlashTable.of(track.flashes), robots.identities
    onsets_s = flashes.onset_s
    return {
        "onset_s": onsets_s,
        "duration_s": flashes.end_s - onsets_s,
        "x_cm": flashes.places_cm[:, 0],
        "y_cm": flashes.places_cm[:, 1],
        "light": np.array([flash.light for flash in track.flashes]),
        "order_parameter": order_over_time(onsets_s, track.period_s)[0],
        "robot": who.robot,
        "cycle": who.cycle,
        "certainty": who.certainty,
        "phase_order_parameter": _order(track, robots),
    }


def trace_columns(track: Track, robots: Robots) -> Columns:
    """Return a table with a row for each robot in each frame, whose columns a trace of a simulation has, too."""
    times_s = track.times_s
    flashes = FlashTable.of(track.flashes)
    places, is_lit = _while_lit(flashes, robots, times_s)
    if robots.poses is None:
        poses = np.concatenate([places, np.full((*is_lit.shape, 1), np.nan)], axis=2)
    else:
        poses = robots.poses.copy()
        unread = np.isnan(poses[..., 0])
        poses[unread, :2] = places[unread]
    shares = phase_shares(flashes.onset_s, robots.identities.robot, robots.numbers, times_s, track.period_s)
    return {
        "time_s": np.repeat(times_s, len(robots.numbers)),
        "robot": np.tile(robots.numbers, len(times_s)),
        **{name: poses[..., axis].ravel() for axis, name in enumerate(("x_cm", "y_cm", "heading_rad"))},
        "ring_on": is_lit.ravel(),
        "phase_ms": 1000 * track.period_s * shares.ravel(),
    }


def pair_columns(track: Track, robots: Robots) -> Columns:
    """Return a table with a row for each two robots: how many of their flashes come together."""
    found = _pairs(FlashTable.of(track.flashes), robots)
    names = ("robot", "other", "flashes", "together")
    columns: Columns = {name: np.array([getattr(pair, name) for pair in found], np.int64) for name in names}
    return columns | {"share": columns["together"] / np.maximum(columns["flashes"], 1)}


def save_robots(
    track: Track, robots: Robots, flashes: Path | None, trace: Path | None, pairs_file: Path | None
) -> None:
    """Write the tables that are asked for; raise EpuckSimError where one cannot be written."""
    tables = ((flashes, flash_columns), (trace, trace_columns), (pairs_file, pair_columns))
    for path, columns in tables:
        if path is not None:
            write_table(path, columns(track, robots), {"film": track.film, "versions": json.dumps(versions())})


def _order(track: Track, robots: Robots) -> FloatArray:
    """Return (flashes,) order parameters of the robots' phases at each onset."""
    onsets_s = FlashTable.of(track.flashes).onset_s
    return order_of_shares(phase_shares(onsets_s, robots.identities.robot, robots.numbers, onsets_s, track.period_s))


def _pairs(flashes: FlashTable, robots: Robots) -> list[Pair]:
    return pairs(flashes.onset_s, flashes.end_s, robots.identities.robot, robots.numbers)


def _while_lit(flashes: FlashTable, robots: Robots, times_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (frames, robots, 2) cm: where robots are while they are lit, else NaN; and (frames, robots) whether."""
    places = np.full((len(times_s), len(robots.numbers), 2), np.nan)
    is_lit = np.zeros(places.shape[:2], bool)
    spans = frames_lit(flashes.onset_s, flashes.end_s, times_s)
    for index, number in enumerate(robots.identities.robot):
        if number < 0:
            continue
        column, span = np.searchsorted(robots.numbers, number), slice(*spans[index])
        since_s = times_s[span] - times_s[span].mean()
        places[span, column] = flashes.places_cm[index] + since_s[:, None] * flashes.velocities_cm_s[index]
        is_lit[span, column] = True
    return places, is_lit
