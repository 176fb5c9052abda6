"""Judges whether an answer about synchrony can be trusted, from the counts, the flashes and the total lit area."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.flashes import Flash
from epuck_sim.overhead.track.spread import MIN_COVERAGE, Evaluation, evaluate, frame_ends

MOST = 0.75
"""Share of the robots that counts as most of them."""

FEWEST_PER_ROBOT = 0.65
"""Flashes of a robot in a period below which some are missed."""

MOST_PER_ROBOT = 1.9
"""Flashes of a robot in a period above which the period is too long, or something else flashes. Coupling shortens
cycles until all are in step: with a coupling of 1, ten simulated robots flash up to 18.6 times in a period."""

MOST_OF_USUAL = 0.6
"""The same as `MOST` where the number of robots is not known, relative to the flashes in a usual period."""

LIGHT_TOLERANCE = 1.5
"""Factor by which the spread by the total light may differ from that by rings before they contradict each other."""

LATE_PERIODS = 0.75
"""Time in periods by which the total light may be synchronised before the rings."""

TWIN_S = 0.1
"""Time by which a flash and its mirror image may seem to begin or end apart."""

DIMMER = 0.8
"""Light of a mirror image, relative to that of its robot, at most."""

STRAIGHT_CM = 1.0
"""Distance aside of a mirror image from the line across the wall through its robot."""

COMMON_IMAGES = 0.1
"""Share of all flashes that look like mirror images from which it is not chance."""

FEW = 5
"""Number of flashes below which nothing is said about them."""


class Evidence(NamedTuple):
    """What is known of a film once its counts are evaluated."""

    times_s: FloatArray
    counts: IntArray
    """(frames,) rings lit, without those that are no flashes."""
    area: IntArray
    """(frames,) pixels of the floor that are lit."""
    flashes: Sequence[Flash]
    period_s: float
    threshold_s: float
    start_s: float
    robots: int | None
    """Number of robots, if it is given."""
    period_is_given: bool


def objections(evidence: Evidence, sync: Evaluation | None) -> list[str]:
    """Return the reasons for which nothing can be said about T_sync; none if it can be trusted.

    Args:
        evidence: What is known.
        sync: The evaluation that shows synchrony; None if none does.
    """
    found = _about_robots(evidence, sync)
    if not evidence.period_is_given and recurs_after_two(evidence.flashes, evidence.period_s):
        found.append(
            f"places flash again after two periods of {evidence.period_s:.4g} s rather than after one: two groups may "
            f"flash in turn; half of the period fits as well; give --period-s"
        )
    return found + _about_light(evidence, sync)


def _about_robots(evidence: Evidence, sync: Evaluation | None) -> list[str]:
    """Return what does not add up to the number of robots: rings lit at once, or flashes in a period."""
    counts, robots = evidence.counts, evidence.robots
    most_lit = int(np.minimum(counts[1:], counts[:-1]).max(initial=0))
    if robots is not None and most_lit > robots:
        return [
            f"{most_lit} rings were lit at once, but there are {robots} robots: check --robots, or what else is lit"
        ]
    middles_s = np.array([(flash.onset_s + flash.end_s) / 2 for flash in evidence.flashes])
    per_period = flashes_per_period(evidence)
    if robots is not None and not FEWEST_PER_ROBOT <= per_period / robots <= MOST_PER_ROBOT:
        return [f"there were {per_period:.1f} flashes per period, but there are {robots} robots"]
    if sync is None:
        return []
    together = np.count_nonzero(np.abs(middles_s - sync.time_s) <= evidence.period_s / 2)
    if together >= usual_flashes(evidence):
        return []
    if robots is not None:
        return [f"the narrow histogram holds {together} flashes, but there are {robots} robots"]
    return [f"the narrow histogram holds {together} flashes, but a usual period {per_period:.1f}"]


def flashes_per_period(evidence: Evidence) -> float:
    """Return the mean number of flashes in a period, over the time without gaps between frames."""
    times_s = evidence.times_s
    seen_s = float((frame_ends(times_s, times_s[-1]) - times_s).sum())
    return len(evidence.flashes) / seen_s * evidence.period_s


def usual_flashes(evidence: Evidence) -> float:
    """Return the least number of flashes that counts as those of most robots; two at least."""
    robots = evidence.robots
    return max(2.0, MOST_OF_USUAL * flashes_per_period(evidence) if robots is None else MOST * robots)


def recurs_after_two(flashes: Sequence[Flash], period_s: float) -> bool:
    """Return whether places flash again two periods later rather than one period later."""
    one_cm, two_cm = _moves_cm(flashes, period_s)
    return one_cm > 2 * two_cm + 1.0


def may_be_half_a_period(evidence: Evidence) -> bool:
    """Return whether an estimated period may be half of the true one, of two groups that flash in turn.

    Robots that move by more than their diameter between flashes do not tell, unless their number is known.
    """
    if evidence.period_is_given or evidence.robots is not None:
        return False
    one_cm, _ = _moves_cm(evidence.flashes, evidence.period_s)
    return one_cm > 2 * epuck.RADIUS_CM


def _moves_cm(flashes: Sequence[Flash], period_s: float) -> tuple[float, float]:
    """Return the median distances from flashes to the nearest one a period and two later; 0 if there are few."""
    after = [_distances_later(flashes, delay * period_s, period_s / 4) for delay in (1, 2)]
    both = ~np.isnan(after[0]) & ~np.isnan(after[1])
    if np.count_nonzero(both) < FEW:
        return 0.0, 0.0
    one_cm, two_cm = (float(np.median(distances[both])) for distances in after)
    return one_cm, two_cm


def _distances_later(flashes: Sequence[Flash], delay_s: float, within_s: float) -> FloatArray:
    """Return (flashes,) cm from each flash to the nearest one about `delay_s` later; NaN if there is none."""
    onsets = np.array([flash.onset_s for flash in flashes])
    places = np.array([(flash.x_cm, flash.y_cm) for flash in flashes]).reshape(-1, 2)
    nearest = np.full(len(flashes), np.nan)
    for index, (onset_s, place) in enumerate(zip(onsets, places, strict=True)):
        first, end = np.searchsorted(onsets, (onset_s + delay_s - within_s, onset_s + delay_s + within_s))
        if end > first:
            nearest[index] = np.hypot(*(places[first:end] - place).T).min()
    return nearest


def count_images(flashes: Sequence[Flash]) -> int:
    """Return how many flashes may be mirror images; 0 if it may be chance.

    Each is dimmer than another one that is straight across or above or below it, and begins and ends with it.
    """
    if len(flashes) < FEW:
        return 0
    table = np.array(flashes)
    images = 0
    for onset_s, end_s, x_cm, y_cm, light, *_ in table:
        off_s = np.maximum(np.abs(table[:, 0] - onset_s), np.abs(table[:, 1] - end_s))
        off_cm = np.minimum(np.abs(table[:, 2] - x_cm), np.abs(table[:, 3] - y_cm))
        images += bool(((off_s <= TWIN_S) & (off_cm <= STRAIGHT_CM) & (light < DIMMER * table[:, 4])).any())
    return images if images >= max(FEW, COMMON_IMAGES * len(flashes)) else 0


def _about_light(evidence: Evidence, sync: Evaluation | None) -> list[str]:
    """Return how the total light contradicts the rings: it needs neither shapes nor sizes."""
    lit = evidence.counts > 0
    if not evidence.area.any() or np.count_nonzero(lit) < FEW:
        return []
    dark = np.quantile(evidence.area, 0.05) if lit.all() else np.median(evidence.area[~lit])
    area = np.maximum(evidence.area - dark, 0.0)
    both = lit & (area > 0)
    if not both.any():
        return []
    per_ring = float(np.median(area[both] / evidence.counts[both]))
    by_light = np.rint(area / per_ring).astype(np.int64)
    evaluations = [
        each
        for each in evaluate(evidence.times_s, by_light, evidence.period_s, evidence.start_s)
        if each.coverage >= MIN_COVERAGE
    ]
    narrow_s = [each.time_s for each in evaluations if each.spread_s <= evidence.threshold_s / LIGHT_TOLERANCE]
    if narrow_s and (sync is None or narrow_s[0] < sync.time_s - LATE_PERIODS * evidence.period_s):
        return [
            f"the total light is synchronised at {narrow_s[0] - evidence.start_s:.1f} s, but the rings that are found "
            "are not: rings are missed, or something else is lit; give --corners, --arena-cm and --height-cm"
        ]
    if sync is not None:
        near = [
            each.spread_s for each in evaluations if abs(each.time_s - sync.time_s) <= LATE_PERIODS * evidence.period_s
        ]
        if near and min(near) > LIGHT_TOLERANCE * evidence.threshold_s:
            return [
                f"the total light is spread by {1000 * min(near):.0f} ms where the rings that are found are "
                "synchronised: rings are missed, or something else is lit; give --corners, --arena-cm and --height-cm"
            ]
    return []
