"""Analysis of the lit rings in a film: period, spread of the flashes, and T_sync (thesis 4.3.1, Appendix C)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.track.doubts import (
    doubts_about_geometry,
    doubts_about_images,
    doubts_about_lights,
    doubts_about_period,
    why_never,
)
from epuck_sim.overhead.track.film_calibration import TrackOptions
from epuck_sim.overhead.track.flashes import Flash, count_lit, count_places
from epuck_sim.overhead.track.onsets import first_in_order_s
from epuck_sim.overhead.track.period_estimation import estimate_flash_s, estimate_period_s
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.ring_counter import CountedRings, RingCounter
from epuck_sim.overhead.track.spread import Evaluation, evaluate, first_synchronised, frame_ends
from epuck_sim.overhead.track.verdict import Evidence, objections, usual_flashes

FLASH_FRACTION = 0.075
"""Fraction of a period for which a ring is lit (thesis 4.2.1)."""

LONG_FLASHES = 6.0
"""Duration of a flash, in medians of all, from which a ring is always lit where the period is not known."""

SHORTEST_STEADY_S = 2.0
"""Shortest time for which a ring that is always lit is lit where the period is not known."""


def analyse(film: str, counted: CountedRings, options: TrackOptions, warnings: tuple[str, ...]) -> Track:
    """Analyse the counts of a whole film.

    Args:
        film: Name of the film.
        counted: The rings of all frames.
        options: What is known and need not be estimated.
        warnings: Warnings about the film so far.

    Raises:
        FilmError: There is no light in the film, its trial is a single frame, or its period is neither given nor clear.
    """
    frames, start_s, times_s, counts = counted.frames, counted.start_s, counted.times_s, counted.counts
    if not counts.any():
        raise FilmError(
            f"{film}: no lit ring is seen in {frames} frames; is it the right film, are the rings about 7 cm wide, and "
            "is the exposure long enough? If --corners, --arena-cm or --height-cm were given, check them"
        )
    if len(times_s) < 2:
        raise FilmError(f"{film}: its trial is one frame long; allowed: two or more, preferably several periods")
    flashes, steady, counts = without_steady(counted.flashes, times_s, counts, options.period_s)
    period_s = options.period_s or _period_s(film, times_s, counts)
    flash_s = _flash_s(times_s, counts, period_s)
    threshold_s = options.threshold_s(period_s, flash_s)
    evaluations = evaluate(times_s, counts, period_s, start_s)
    sync = first_synchronised(evaluations, threshold_s)
    evidence = Evidence(
        times_s=times_s,
        counts=counts,
        area=counted.areas_px,
        flashes=flashes,
        period_s=period_s,
        threshold_s=threshold_s,
        start_s=start_s,
        robots=options.robots,
        period_is_given=options.period_s is not None,
    )
    reasons = objections(evidence, sync)
    t_sync_s = None if reasons or sync is None else sync.time_s
    lit_always = count_places(
        [*((ring.x_cm, ring.y_cm) for ring in counted.always_lit), *(each[2:4] for each in steady)]
    )
    most_lit = int(np.minimum(counts[1:], counts[:-1]).max())
    doubts = _doubts(counted, evidence, sync, lit_always)
    if t_sync_s is not None and options.robots and most_lit < options.robots:
        doubts.append(
            f"the swarm is synchronised, but at most {most_lit} rings were lit at once, of {options.robots} robots"
        )
    in_order_s = None if reasons else _in_order_s(evidence)
    frame_s = float(np.median(np.diff(times_s)))
    frames_s = frame_ends(times_s, times_s[-1]) - times_s
    lit_s = frames_s * counts / flash_s  # all rings' light over that of one flash
    until_s = math.nan if t_sync_s is None else t_sync_s + period_s / 4  # when that flash is over
    cycles = float(lit_s[times_s <= until_s].sum()) / (options.robots or max(most_lit, 1))
    error_cm = counted.geometry.error_cm
    return Track(
        film=film,
        frames=frames,
        fps=1 / frame_s,
        duration_s=float(times_s[-1] - times_s[0]) + frame_s,
        start_s=start_s,
        calibration=counted.geometry.calibration,
        period_s=period_s,
        flash_ms=1000 * flash_s,
        threshold_ms=1000 * threshold_s,
        estimated=tuple(name for name in ("period_s", "threshold_ms") if getattr(options, name) is None),
        rings_outside=counted.outside,
        always_lit=lit_always,
        position_error_mm=10 * error_cm if error_cm else None,
        robots_seen=most_lit,
        flashes_per_period=float(lit_s.sum() / frames_s.sum()) * period_s,
        t_sync_s=_since(start_s, t_sync_s),
        t_sync_periods=_since(start_s, t_sync_s, period_s),
        t_sync_cycles=None if t_sync_s is None else cycles,
        t_sync_onsets_s=_since(start_s, in_order_s),
        t_sync_onsets_periods=_since(start_s, in_order_s, period_s),
        confidence="none" if reasons else "low" if doubts or warnings else "high",
        reasons=tuple(reasons or ([] if sync else [why_never(evaluations, period_s, flash_s, threshold_s)])),
        warnings=(*warnings, *doubts),
        times_s=times_s,
        counts=counts,
        evaluations=tuple(evaluations),
        flashes=flashes,
        steady=steady,
        geometry=counted.geometry,
        options=options,
    )


def _since(start_s: float, time_s: float | None, unit_s: float = 1.0) -> float | None:
    """Return the time from the start to another time, in units; None if there is no such time."""
    return None if time_s is None else (time_s - start_s) / unit_s


def _in_order_s(evidence: Evidence) -> float | None:
    """Return when the onsets of flashes were first in order, on the film's clock; None if they never were."""
    onsets_s = np.array([flash.onset_s for flash in evidence.flashes])
    filmed_s = float(evidence.times_s[0]), float(evidence.times_s[-1])
    return first_in_order_s(onsets_s, evidence.period_s, filmed_s, usual_flashes(evidence))


def _doubts(counted: CountedRings, evidence: Evidence, sync: Evaluation | None, lit_always: int) -> list[str]:
    """Return sentences about what is doubtful in the lights, the geometry, and the period."""
    early = [each for each in evidence.flashes if sync is None or each.onset_s < sync.time_s - evidence.period_s / 2]
    return [
        *doubts_about_lights(counted, lit_always),
        *doubts_about_geometry(counted.geometry),
        *doubts_about_images(early, counted.geometry),
        *doubts_about_period(evidence),
    ]


def without_steady(
    flashes: tuple[Flash, ...], times_s: FloatArray, counts: IntArray, period_s: float | None
) -> tuple[tuple[Flash, ...], tuple[Flash, ...], IntArray]:
    """Return flashes, those of rings that are always lit, and (frames,) counts without these.

    Without a period, a ring is always lit if it is lit for much longer than usual.
    """
    durations_s = np.array([flash.end_s - flash.onset_s for flash in flashes])
    longest_s = period_s / 2 if period_s else max(LONG_FLASHES * float(np.median(durations_s)), SHORTEST_STEADY_S)
    steady = tuple(flash for flash, lasts_s in zip(flashes, durations_s, strict=True) if lasts_s > longest_s)
    others = tuple(flash for flash, lasts_s in zip(flashes, durations_s, strict=True) if lasts_s <= longest_s)
    if not others:
        return flashes, (), counts
    return others, steady, np.maximum(counts - count_lit(steady, times_s), 0)


def _period_s(film: str, times_s: FloatArray, counts: IntArray) -> float:
    period_s = estimate_period_s(times_s, counts)
    if period_s is None:
        raise FilmError(
            f"{film}: the period cannot be estimated from {times_s[-1] - times_s[0]:.3g} s of film, because the "
            "flashes do not clearly repeat; give --period-s"
        )
    return period_s


def current_threshold_s(counter: RingCounter, period_s: float, options: TrackOptions) -> float:
    """Return the threshold that `analyse` would choose from the counts so far."""
    return options.threshold_s(period_s, _flash_s(counter.times_s, counter.counts, period_s))


def _flash_s(times_s: FloatArray, counts: IntArray, period_s: float) -> float:
    return estimate_flash_s(times_s, counts) or FLASH_FRACTION * period_s
