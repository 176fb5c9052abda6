"""The result of tracking a film: period, spread of the flashes, and T_sync (thesis 4.3.1, Appendix C)."""

import math
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.film_calibration import TrackOptions
from epuck_sim.overhead.track.period_estimation import estimate_flash_s, estimate_period_s
from epuck_sim.overhead.track.ring_counter import RingCounter
from epuck_sim.overhead.track.spread import Evaluation, evaluate, first_synchronised, frame_ends

FLASH_FRACTION = 0.075
"""Fraction of a period for which a ring is lit (thesis 4.2.1)."""

ENOUGH_PERIODS = 3.5
"""Number of periods in a film below which the estimated period may be wrong."""

ODD_SHARE = 0.35
"""Relative difference of flashes per period from the number of robots that is normal; coupling shortens cycles."""


class Track(NamedTuple):
    """What was found in a film."""

    film: str
    """Name of the film or camera."""
    frames: int
    """Number of frames, including those of a lit beginning."""
    fps: float
    """Frames per second, by the median time from one frame to the next."""
    duration_s: float
    """Duration of the trial."""
    start_s: float
    """Beginning of the trial on the film's clock: the first dark frame."""
    calibration: str
    """What the camera was determined from."""
    period_s: float
    """Period of the oscillators."""
    flash_ms: float
    """Duration of a flash; 0.075 periods if it cannot be estimated."""
    threshold_ms: float
    """Standard deviation of the histogram at which the swarm counts as synchronised."""
    estimated: tuple[str, ...]
    """Which of `period_s` and `threshold_ms` were estimated from the film."""
    robots_seen: int
    """Largest number of rings lit at once in two consecutive frames."""
    flashes_per_period: float
    """Mean number of flashes per period, over the time without gaps between frames."""
    t_sync_s: float | None
    """Time from the beginning of the trial to the flash around which the histogram was first narrow enough."""
    t_sync_cycles: float | None
    """The same time in periods."""
    t_sync_flashes: float | None
    """Mean number of flashes of a robot by that time; coupling shortens cycles, and simulated trials count firings."""
    warnings: tuple[str, ...]
    """Sentences about what is doubtful."""
    times_s: FloatArray
    """(frames,) s: times of the trial's frames on the film's clock."""
    counts: IntArray
    """(frames,) lit rings in each of them."""
    evaluations: tuple[Evaluation, ...]
    """Evaluations of the histogram, in order of time."""
    camera: CameraModel
    """The camera that took the film."""

    def summary(self) -> dict[str, Any]:
        """Return the fields that are texts, numbers, or tuples of texts."""
        others = {"times_s", "counts", "evaluations", "camera"}
        return {name: value for name, value in self._asdict().items() if name not in others}

    def cycles_at(self, time_s: Any) -> Any:
        """Return a time, or (n,) times, on the film's clock in periods since the beginning of the trial."""
        return (time_s - self.start_s) / self.period_s


class Snapshot(NamedTuple):
    """A frame of a film, and the rings found in it."""

    time_s: float
    """Time of the frame on the film's clock."""
    picture: Picture
    rings_px: FloatArray
    """(rings, 3) px: column, row, radius."""


def analyse(
    film: str, counter: RingCounter, calibration: str, options: TrackOptions, warnings: tuple[str, ...]
) -> Track:
    """Analyse the counts of a whole film.

    Args:
        film: Name of the film.
        counter: A counter that has processed all frames.
        calibration: What the camera was determined from.
        options: What is known and need not be estimated.
        warnings: Warnings about the film so far.

    Raises:
        FilmError: There is no light in the film, its trial is a single frame, or its period is neither given nor clear.
    """
    frames, start_s, times_s, counts = counter.frames, counter.start_s, counter.times_s, counter.counts
    if not counts.any():
        raise FilmError(
            f"{film}: no lit ring is seen in {frames} frames; is it the right film, are the rings red and about 7 cm "
            "wide, and is the exposure long enough? If --corners, --arena-cm or --height-cm were given, check them"
        )
    if len(times_s) < 2:
        raise FilmError(f"{film}: its trial is one frame long; allowed: two or more, preferably several periods")
    period_s = options.period_s or _period_s(film, times_s, counts)
    flash_s = _flash_s(times_s, counts, period_s)
    threshold_s = options.threshold_s(period_s, flash_s)
    evaluations = evaluate(times_s, counts, period_s, start_s)
    t_sync_s = first_synchronised(evaluations, threshold_s)
    frame_s = float(np.median(np.diff(times_s)))
    most_lit = int(np.minimum(counts[1:], counts[:-1]).max())
    frames_s = frame_ends(times_s, times_s[-1]) - times_s
    flashes = frames_s * counts / flash_s  # all rings' light over that of one flash
    per_period = float(flashes.sum() / frames_s.sum()) * period_s
    until_s = math.nan if t_sync_s is None else t_sync_s + period_s / 4  # when that flash is over
    flashes_until = float(flashes[times_s <= until_s].sum()) / (options.robots or max(most_lit, 1))
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
        estimated=tuple(name for name in ("period_s", "threshold_ms") if getattr(options, name) is None),
        robots_seen=most_lit,
        flashes_per_period=per_period,
        t_sync_s=None if t_sync_s is None else t_sync_s - start_s,
        t_sync_cycles=None if t_sync_s is None else (t_sync_s - start_s) / period_s,
        t_sync_flashes=None if t_sync_s is None else flashes_until,
        warnings=(
            *warnings,
            *_doubts_about_robots(most_lit, per_period, t_sync_s is not None, options.robots),
            *([] if options.period_s else _doubts_about_period(period_s, float(times_s[-1] - times_s[0]))),
        ),
        times_s=times_s,
        counts=counts,
        evaluations=tuple(evaluations),
        camera=counter.camera,
    )


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


def _doubts_about_period(period_s: float, film_s: float) -> list[str]:
    periods = film_s / period_s
    if periods >= ENOUGH_PERIODS:
        return []
    return [
        f"the period of {period_s:.4g} s is estimated from only {periods:.1f} periods of film; better give --period-s"
    ]


def _doubts_about_robots(most_lit: int, flashes: float, is_synchronised: bool, robots: int | None) -> list[str]:
    """Return what contradicts the number of robots: rings lit at once, or flashes per period."""
    if robots is None:
        return []
    if most_lit > robots:
        return [
            f"{most_lit} rings were lit at once, but there are {robots} robots: check --robots, or what else is red"
        ]
    if is_synchronised and most_lit < robots:
        return [f"the swarm is synchronised, but at most {most_lit} rings were lit at once, of {robots} robots"]
    if abs(flashes / robots - 1) > ODD_SHARE:
        return [f"there were {flashes:.1f} flashes per period, but there are {robots} robots"]
    return []
