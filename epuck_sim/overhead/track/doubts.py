"""What is said of an answer: what is doubtful, and why a swarm never synchronised."""

import math
from collections.abc import Sequence

from epuck_sim.overhead.track.flashes import Flash
from epuck_sim.overhead.track.geometry import Geometry
from epuck_sim.overhead.track.period_estimation import spread_at_s
from epuck_sim.overhead.track.ring_counter import CountedRings
from epuck_sim.overhead.track.spread import MIN_COVERAGE, MIN_RINGS, Evaluation
from epuck_sim.overhead.track.verdict import Evidence, count_images, may_be_half_a_period

ENOUGH_PERIODS = 3.5
"""Number of periods in a film below which the estimated period may be wrong."""

TILTED_DEG = 3.0
"""Tilt of a camera from which positions are doubtful if no corners are given."""


def doubts_about_lights(counted: CountedRings, steady: int) -> list[str]:
    """Return what is said of rings that stay lit, or are outside of the floor."""
    doubts = []
    if steady:
        doubts.append(f"rings that stayed lit for longer than half a period, and are left out: {steady}")
    if counted.outside:
        doubts.append(
            f"rings outside of the floor, and left out: {counted.outside} in {len(counted.times_s)} frames; they are "
            "mirror images, a neighbour's, or --corners or --arena-cm are wrong"
        )
    return doubts


def doubts_about_images(unsynchronised: Sequence[Flash], geometry: Geometry) -> list[str]:
    """Return whether there are mirror images, from flashes that do not all come together."""
    images = 0 if geometry.knows_floor else count_images(unsynchronised)
    if not images:
        return []
    return [
        f"flashes that may be mirror images in the walls: {images}; they come with those of their robots and do not "
        "move T_sync, but they count as robots; give the floor's corners by --corners"
    ]


def doubts_about_geometry(geometry: Geometry) -> list[str]:
    """Return what is said of a camera that seems to be tilted, where nothing but the rings tells it."""
    if geometry.knows_floor or geometry.tilt_deg < TILTED_DEG:
        return []
    return [
        f"the camera seems to be tilted by {geometry.tilt_deg:.0f} degrees: positions depend on it; "
        "give the floor's corners by --corners"
    ]


def doubts_about_period(evidence: Evidence) -> list[str]:
    """Return what is said of a period that was estimated: from a short film, or perhaps half of the true one."""
    if evidence.period_is_given:
        return []
    doubts = []
    period_s = evidence.period_s
    periods = float(evidence.times_s[-1] - evidence.times_s[0]) / period_s
    if periods < ENOUGH_PERIODS:
        doubts.append(
            f"the period of {period_s:.4g} s is estimated from only {periods:.1f} periods of film; "
            "better give --period-s"
        )
    if may_be_half_a_period(evidence):
        doubts.append(
            f"the period is estimated; {2 * period_s:.4g} s fit as well, if two groups flash in turn, and robots move "
            "too far between flashes to tell; give --period-s or --robots"
        )
    return doubts


def why_never(evaluations: Sequence[Evaluation], period_s: float, flash_s: float, threshold_s: float) -> str:
    """Return how near to synchrony the swarm came, and which criterion it would have met."""
    seen = [each for each in evaluations if each.coverage >= MIN_COVERAGE]
    seen_s = [each.spread_s for each in seen if each.rings >= MIN_RINGS]
    if seen and not seen_s:
        return "no two rings were lit at once, and a robot that flashes alone is in step with nobody"
    if not seen_s:
        return f"no whole period of {period_s:.4g} s was seen around a flash; film for longer, or check --period-s"
    loose_s = spread_at_s(period_s, flash_s)
    least_s = min(seen_s)
    what = f"the flashes were spread by {1000 * least_s:.0f} ms or more, the threshold is {1000 * threshold_s:.0f} ms"
    if least_s <= loose_s > threshold_s:
        return f"{what}; --order-parameter 0.95, a threshold of {1000 * loose_s:.0f} ms, would be met"
    return f"{what}; a criterion that would be met is --threshold-ms {math.ceil(1000 * least_s)}"
