"""What a film tells of its swarm: period, spread of the flashes, and T_sync (thesis 4.3.1, Appendix C)."""

import math
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera_model import Lens
from epuck_sim.overhead.track.history import History
from epuck_sim.overhead.track.period_estimation import (
    estimate_flash_s,
    estimate_period_s,
    spread_at_s,
    spread_threshold_s,
)
from epuck_sim.overhead.track.ring_counter import Tracker
from epuck_sim.overhead.track.spread import Evaluation, evaluate, first_synchronised, frame_ends

FLASH_FRACTION = 0.075
"""For so much of a period a ring is lit (thesis 4.2.1)."""

ENOUGH_PERIODS = 3.5
"""Of a film with fewer, the estimated period may be wrong."""

ODD_SHARE = 0.35
"""Flashes a period may differ by so much from the number of robots: coupling shortens cycles while it acts."""


class Known(NamedTuple):
    """What is known of a film beforehand; None where the film itself must tell."""

    arena_cm: tuple[float, float] | None = None
    """Width and height of the floor."""
    height_cm: float | None = None
    """Of the camera above it."""
    corners_px: tuple[tuple[float, float], ...] | None = None
    """(column, row) of the floor's four corners."""
    period_s: float | None = None
    robots: int | None = None
    threshold_ms: float | None = None
    """Spread at which the swarm counts as synchronised."""
    order_parameter: float | None = None
    """Or the order parameter of the firings, instead."""


class Track(NamedTuple):
    """What was found in a film."""

    film: str
    frames: int
    """Those of a lit beginning among them."""
    fps: float
    """By the median time from a frame to the next."""
    duration_s: float
    start_s: float
    """When the trial began, on the film's clock: with the first dark frame."""
    calibration: str
    """Where the geometry is from."""
    period_s: float
    flash_ms: float
    """For how long a ring is lit; 0.075 periods where that cannot be told."""
    threshold_ms: float
    """Standard deviation of the histogram at which the swarm counts as synchronised."""
    estimated: tuple[str, ...]
    """Which of period_s and threshold_ms were not known beforehand."""
    robots_seen: int
    """Rings lit at once in two frames one after the other, the most."""
    flashes_per_period: float
    """In the time that was seen: none of it in gaps between frames."""
    t_sync_s: float | None
    """From the trial's beginning to the flash around which the histogram was first narrow enough."""
    t_sync_cycles: float | None
    """That in periods."""
    t_sync_flashes: float | None
    """How often a robot had flashed by then: coupling shortens cycles, and a simulated trial counts firings."""
    warnings: tuple[str, ...]
    times_s: FloatArray
    """(frames,) of the trial."""
    counts: IntArray
    """(frames,) lit rings in each of them."""
    evaluations: tuple[Evaluation, ...]
    lens: Lens
    """The camera that took the film."""

    def summary(self) -> dict[str, Any]:
        """Return the values that are text, numbers, or lists of texts."""
        others = {"times_s", "counts", "evaluations", "lens"}
        return {name: value for name, value in self._asdict().items() if name not in others}

    def history(self) -> History:
        """Return what its figure shows."""
        return History(
            times_s=self.times_s,
            counts=self.counts,
            evaluations=self.evaluations,
            period_s=self.period_s,
            start_s=self.start_s,
            threshold_s=self.threshold_ms / 1000,
            t_sync_s=None if self.t_sync_s is None else self.start_s + self.t_sync_s,
        )


def conclude(film: str, tracker: Tracker, calibration: str, known: Known, warnings: tuple[str, ...]) -> Track:
    """Return what the counts of a tracker that has looked at a whole film tell; known: what need not be estimated.

    Raises FilmError where there is no light in the film, a single frame of the trial, or a period that can neither be
    told nor is given.
    """
    frames, start_s, times_s, counts = tracker.frames, tracker.start_s, tracker.times_s, tracker.counts
    if not counts.any():
        raise FilmError(
            f"{film}: no lit ring is seen in {frames} frames; is it the right film, are the rings red and about 7 cm "
            "wide, and is the exposure long enough? If --corners, --arena-cm or --height-cm were given, check them"
        )
    if len(times_s) < 2:
        raise FilmError(f"{film}: its trial is one frame long; allowed: two or more, better some periods of them")
    period_s = known.period_s or _period_s(film, times_s, counts)
    flash_s = _flash_s(times_s, counts, period_s)
    threshold_s = choose_threshold_s(period_s, flash_s, known)
    evaluations = evaluate(times_s, counts, period_s, start_s)
    t_sync_s = first_synchronised(evaluations, threshold_s)
    frame_s = float(np.median(np.diff(times_s)))
    seen = int(np.minimum(counts[1:], counts[:-1]).max())
    stood_s = frame_ends(times_s, times_s[-1]) - times_s
    flashes = stood_s * counts / flash_s  # all rings' light over that of one flash
    per_period = float(flashes.sum() / stood_s.sum()) * period_s
    until_s = math.nan if t_sync_s is None else t_sync_s + period_s / 4  # when that flash is over
    flashes_until = float(flashes[times_s <= until_s].sum()) / (known.robots or max(seen, 1))
    return Track(
        film=film,
        frames=frames,
        fps=1 / frame_s,
        duration_s=float(times_s[-1] - times_s[0]) + frame_s,
        start_s=start_s,
        calibration=calibration,
        period_s=period_s,
        flash_ms=1000 * flash_s,
        threshold_ms=1000 * threshold_s,
        estimated=tuple(name for name in ("period_s", "threshold_ms") if getattr(known, name) is None),
        robots_seen=seen,
        flashes_per_period=per_period,
        t_sync_s=None if t_sync_s is None else t_sync_s - start_s,
        t_sync_cycles=None if t_sync_s is None else (t_sync_s - start_s) / period_s,
        t_sync_flashes=None if t_sync_s is None else flashes_until,
        warnings=(
            *warnings,
            *_doubts(seen, per_period, t_sync_s is not None, known.robots),
            *([] if known.period_s else _doubts_of_period(period_s, float(times_s[-1] - times_s[0]))),
        ),
        times_s=times_s,
        counts=counts,
        evaluations=tuple(evaluations),
        lens=tracker.lens,
    )


def _period_s(film: str, times_s: FloatArray, counts: IntArray) -> float:
    period_s = estimate_period_s(times_s, counts)
    if period_s is None:
        raise FilmError(
            f"{film}: the period cannot be told from {times_s[-1] - times_s[0]:.3g} s of film, as the flashes do not "
            "repeat clearly; give --period-s"
        )
    return period_s


def threshold_so_far_s(tracker: Tracker, period_s: float, known: Known) -> float:
    """Return the threshold by what has been seen until now, as `conclude` would choose it."""
    return choose_threshold_s(period_s, _flash_s(tracker.times_s, tracker.counts, period_s), known)


def _flash_s(times_s: FloatArray, counts: IntArray, period_s: float) -> float:
    return estimate_flash_s(times_s, counts) or FLASH_FRACTION * period_s


def choose_threshold_s(period_s: float, flash_s: float, known: Known) -> float:
    """Return the spread at which a swarm counts as synchronised: the one that is known, or that of Appendix C."""
    if known.threshold_ms is not None:
        return known.threshold_ms / 1000
    if known.order_parameter is not None:
        return spread_at_s(period_s, flash_s, known.order_parameter)
    return spread_threshold_s(period_s, flash_s)


def _doubts_of_period(period_s: float, film_s: float) -> list[str]:
    periods = film_s / period_s
    if periods >= ENOUGH_PERIODS:
        return []
    return [f"the period of {period_s:.4g} s was told from {periods:.1f} periods of film; give --period-s to be sure"]


def _doubts(seen: int, flashes: float, is_synchronised: bool, robots: int | None) -> list[str]:
    """Return what speaks against so many robots: those seen at once, or the flashes in a period."""
    if robots is None:
        return []
    if seen > robots:
        return [f"{seen} rings were lit at once, but there are {robots} robots: see --robots, or what else is red"]
    if is_synchronised and seen < robots:
        return [f"the swarm is synchronised, but no more than {seen} rings were lit at once, of {robots} robots"]
    if abs(flashes / robots - 1) > ODD_SHARE:
        return [f"there were {flashes:.1f} flashes in a period, but there are {robots} robots"]
    return []
