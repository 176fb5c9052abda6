"""Tracks a film from its file to its `Track`: period, spread of the flashes, and T_sync (thesis 4.3.1, Appendix C)."""

import csv
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, nullcontext
from itertools import compress
from pathlib import Path
from typing import Any, Literal, NamedTuple, TextIO

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead import synchrony
from epuck_sim.overhead.annotate import Annotator, TrackedFrame
from epuck_sim.overhead.calibration import DESCRIPTION, FilmMetadata, TrackOptions, calibrate, excerpt
from epuck_sim.overhead.camera import Frame, Geometry, ProgressWrapper
from epuck_sim.overhead.film import film_file, open_film
from epuck_sim.overhead.flashes import REACH_CM, CountedRings, Flash, FlashTable, RingCounter, count_places, join_broken
from epuck_sim.overhead.rings import MIN_RELATIVE_LIGHT, Ring, searched
from epuck_sim.overhead.tags import Readings, TagReader
from epuck_sim.overhead.verdict import Evidence, doubts, objections, why_never
from epuck_sim.util.atomic_write import atomic_write

FLASH_FRACTION = 0.075  # fraction of a period for which a ring is lit (thesis 4.2.1)

LONG_FLASHES = 6.0  # duration, in medians of all flashes, above which a ring is always lit if no period is known
SHORTEST_STEADY_S = 2.0  # least such duration
OFF_CM = 1.0  # error of places beyond which a flash is too near to a wall
SAME_PLACE_CM = 0.5  # distance within which flashes are at one place
FEWEST_FLICKERS = 6  # flashes at one place above which a lamp flickers there
MOST_FLICKERS = 3.0  # the same relative to the median of all places


class Track(NamedTuple):
    """Flashes, counts and synchrony found in a film."""

    film: str
    frames: int  # number of frames, including those of a lit beginning
    fps: float  # frames per second, by the median time from one frame to the next
    duration_s: float  # duration of the trial
    start_s: float  # beginning of the trial on the film's clock: the first dark frame
    calibration: str  # what the camera was determined from
    period_s: float
    flash_ms: float  # duration of a flash; 0.075 periods if it cannot be estimated
    threshold_ms: float  # standard deviation of the histogram at which the swarm counts as synchronised
    estimated: tuple[str, ...]  # which of `period_s` and `threshold_ms` were estimated from the film
    rings_outside: int  # number of rings seen outside of the floor, in all frames; they are left out
    always_lit: int  # number of places with rings that stayed lit for longer than half a period; they are left out
    position_error_mm: float | None  # standard error of positions that the geometry gives; None if it is not known
    robots_seen: int  # largest number of rings lit at once in two consecutive frames
    flashes_per_period: float  # mean number of flashes per period, over the time without gaps between frames
    t_sync_s: float | None
    """Time from the trial's beginning to the first flash around which a period's flashes have the order parameter of
    synchrony."""
    t_sync_periods: float | None  # the same time in periods
    t_sync_cycles: int | None
    """T_sync as in simulated trials: flashes of a robot up to and including that one; the mean over robots, rounded up,
    as a film does not show which one is the reference."""
    histogram_s: float | None
    """Time from the trial's beginning to the flash around which the histogram was first narrow enough."""
    histogram_periods: float | None  # the same time in periods
    confidence: Literal["high", "low", "none"]
    """Whether T_sync, or that there is none, can be trusted: `low` if it is doubtful, `none` if nothing can be said."""
    reasons: tuple[str, ...]  # sentences about why there is no T_sync; empty if there is one
    warnings: tuple[str, ...]  # sentences about doubts
    times_s: FloatArray
    counts: IntArray
    evaluations: tuple[synchrony.Evaluation, ...]
    flashes: tuple[Flash, ...]
    """Flashes; they and counts are without rings that are always lit. Times, rings and geometry: see `CountedRings`."""
    steady: tuple[Flash, ...]  # rings that are always lit, as flashes
    rings: Sequence[Sequence[Ring]]
    geometry: Geometry
    options: TrackOptions  # what was known of the film
    tags: Readings | None = None  # the tags that were read, if they were looked for

    def summary(self) -> dict[str, Any]:
        """Return the fields that are texts, numbers, or tuples of texts: those before `times_s`."""
        return {name: getattr(self, name) for name in self._fields[: self._fields.index("times_s")]}

    def periods_at(self, time_s: Any) -> Any:
        """Convert a time, or (n,) times, on the film's clock to periods since the beginning of the trial."""
        return (time_s - self.start_s) / self.period_s


def track_film(
    name: str,
    options: TrackOptions,
    rings: Path | None,
    progress: ProgressWrapper,
    simulated: FilmMetadata = FilmMetadata(),  # noqa: B008 is never changed
) -> Track:
    """Track a film, given as a path or an address; if `rings` is given, write a CSV table of all rings in all frames.

    What neither the options nor the film's description tell is as in a simulated trial, if its description is given.
    FilmError is raised if the film cannot be read, or shows no swarm, and EpuckSimError if the table cannot be written.
    """
    with open_film(name) as film, ExitStack() as files:
        size_px, metadata = (film.width_px, film.height_px), FilmMetadata.of(film.description)
        geometry = metadata.geometry(size_px, options)
        doubts = options.contradictions(metadata, size_px)
        if film.is_pictures and options.fps is None:
            doubts.append(f"numbered pictures have no times: {film.rate:g} frames per second are assumed; give --fps")
        options = options.with_defaults(metadata).with_defaults(simulated)
        if geometry is None:
            with open_film(name) as studied:
                geometry = calibrate(name, size_px, excerpt(studied.frames(), options), options)
        counter = RingCounter(geometry)
        reader = None if options.tags is None else TagReader(geometry.camera, options.tags)
        part = None if rings is None else files.enter_context(atomic_write(rings))
        write_rings = ring_writer(None if part is None else files.enter_context(part.open("w", newline="")))
        for frame in progress(excerpt(film.frames(), options), film.duration_s):
            write_rings(frame, counter.process(frame))
            if reader is not None:
                reader.read(frame)
        warnings = (*doubts, *film.warnings)
    counted = counter.counted()
    if reader is not None:  # where tags can be read, robots are bright, too: the total light says nothing about rings
        counted = counted._replace(areas_px=np.zeros_like(counted.areas_px))
    track = analyse(name, counted, options, warnings)
    if film.ended_early and track.t_sync_s is None:
        track = track._replace(confidence="none", reasons=(film.ended_early, *track.reasons))
    return track if reader is None else track._replace(tags=reader.readings(track.start_s))


def track_frames(
    frames: Iterable[Frame], counter: RingCounter, period_s: float, options: TrackOptions
) -> Iterator[TrackedFrame]:
    """Process frames one by one as they are asked for, with the threshold that `analyse` would choose by then."""
    detector: synchrony.SynchronyDetector | None = None
    histogram_s = None
    for frame in frames:
        start_before_s = counter.start_s
        rings = counter.process(frame)
        if detector is None or counter.start_s != start_before_s:
            detector, histogram_s = synchrony.SynchronyDetector(period_s), None
        steady = counter.linker.lit_since(frame.time_s - period_s / 2)  # rings that stay lit do not count
        evaluation = detector.update(frame.time_s, max(0, len(rings) - steady))
        if evaluation is not None and histogram_s is None:
            threshold_s = options.threshold_s(period_s, _flash_s(*counter.lit, period_s))
            histogram_s = evaluation.time_s if synchrony.is_synchronised(evaluation, threshold_s) else None
        yield TrackedFrame(frame, rings, counter.start_s, evaluation, histogram_s)


def look_again(track: Track, annotated: Path | None, progress: ProgressWrapper) -> TrackedFrame:
    """Write a tracked film again, if a path is given, with rings and histogram drawn; raise as `film_file`.

    Return the first frame in which most rings are lit, since T_sync if there is one, without rings that stay lit.
    """
    camera = track.geometry.camera
    annotator = Annotator(camera.width_px, camera.height_px, track.period_s)
    evaluations = deque(track.evaluations)
    moments_s = [math.inf if each is None else track.start_s + each for each in (track.histogram_s, track.t_sync_s)]
    begins_s = track.times_s[np.argmax(track.counts * (track.times_s >= track.start_s + (track.t_sync_s or 0.0)))]
    found: TrackedFrame | None = None
    size_px, about = (annotator.width_px, annotator.height_px), {"annotated": True}
    to = nullcontext() if annotated is None else film_file(annotated, *size_px, about, annotated.stem)
    with open_film(track.film) as film, to as writer:
        frames = progress(excerpt(film.frames(), track.options), film.duration_s)
        for frame, rings in zip(frames, track.rings, strict=False):
            is_due = evaluations and evaluations[0].time_s + track.period_s / 2 <= frame.time_s
            evaluation = evaluations.popleft() if is_due else None
            start_s = track.start_s if frame.time_s >= track.start_s else 0.0
            known_s = [each if each + track.period_s / 2 <= frame.time_s else None for each in moments_s]
            tracked = TrackedFrame(frame, rings, start_s, evaluation, *known_s)
            if found is None and frame.time_s >= begins_s:
                found = tracked
            if writer is not None:
                writer.write(Frame(frame.time_s, annotator.annotate(tracked)))
            elif found is not None:
                break
    if found is None:
        raise FilmError(f"{track.film}: has fewer frames than when it was tracked; save it in a file, and track that")
    steady_cm = [each[2:4] for each in track.steady if each.onset_s <= found.frame.time_s <= each.end_s]
    flashing = [ring for ring in found.rings if all(math.dist(ring[:2], each) > REACH_CM for each in steady_cm)]
    return found._replace(rings=flashing)


def ring_writer(file: TextIO | None) -> Callable[[Frame, Sequence[Ring]], None]:
    """Write the header of a CSV table of rings; return the function that writes a frame's rings, if there is a file."""
    if file is None:
        return lambda *_: None
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["time_s", *Ring._fields])

    def write_rings(frame: Frame, rings: Sequence[Ring]) -> None:
        time_s = f"{frame.time_s:.6f}"  # microseconds, however long the film is
        writer.writerows([time_s, *(f"{value:.6g}" for value in ring)] for ring in rings)

    return write_rings


def analyse(film: str, counted: CountedRings, options: TrackOptions, warnings: tuple[str, ...]) -> Track:
    """Analyse the counts of a whole film, given its name, the options, and the warnings so far.

    FilmError is raised if it has no light, its trial is a single frame, or its period is neither given nor clear.
    """
    times_s, geometry = counted.times_s, counted.geometry
    if not counted.counts.any():
        raise FilmError(
            f"{film}: no lit ring is seen in {counted.frames} frames; is it the right film, are the rings "
            f"{searched(geometry.camera)}, and is the exposure long enough? If --corners, --arena-cm, --height-cm, "
            "--start-s or --end-s were given, check them; if this package made the film and it was scaled or cropped "
            "since, give --arena-cm"
        )
    start_s, is_late = float(times_s[0]), 2 * len(times_s) < counted.frames
    lit = f" (the room seems lit until {start_s:.3g} s: switch lamps off)" if is_late else ""
    if len(times_s) < 2:
        raise FilmError(f"{film}: its trial is one frame long{lit}; allowed: two or more, preferably several periods")
    flashes, steady, counts = without_steady(counted, options.period_s)
    period_s = options.period_s or synchrony.estimate_period_s(times_s, counts)
    if period_s is None:
        said = f"the period cannot be estimated from {times_s[-1] - times_s[0]:.3g} s of film{lit}"
        raise FilmError(f"{film}: {said}, because the flashes do not clearly repeat; give --period-s")
    flash_s = _flash_s(times_s, counts, period_s)
    flashes = join_broken(flashes, flash_s)
    threshold_s = options.threshold_s(period_s, flash_s)
    evaluations = synchrony.evaluate(times_s, counts, period_s)
    sync = next((each for each in evaluations if synchrony.is_synchronised(each, threshold_s)), None)
    lit_always = count_places([*(ring[:2] for ring in counted.always_lit), *(each[2:4] for each in steady)])
    evidence = Evidence(
        counted=counted._replace(counts=counts, flashes=flashes),
        lit_always=lit_always,
        period_s=period_s,
        threshold_s=threshold_s,
        sync=sync,
        robots=options.robots,
        period_is_given=options.period_s is not None,
        order_parameter=options.order_parameter or synchrony.ORDER_PARAMETER,
    )
    in_order_s = evidence.in_order_s
    reasons, found = objections(evidence), doubts(evidence)
    t_sync_s = None if reasons or in_order_s is None else in_order_s - start_s
    histogram_s = None if reasons or sync is None else sync.time_s - start_s
    frame_s = float(np.median(np.diff(times_s)))
    return Track(
        film=film,
        frames=counted.frames,
        fps=1 / frame_s,
        duration_s=float(times_s[-1] - times_s[0]) + frame_s,
        start_s=start_s,
        calibration=geometry.calibration,
        period_s=period_s,
        flash_ms=1000 * flash_s,
        threshold_ms=1000 * threshold_s,
        estimated=tuple(name for name in ("period_s", "threshold_ms") if getattr(options, name) is None),
        rings_outside=counted.outside,
        always_lit=lit_always,
        position_error_mm=10 * geometry.error_cm or None,
        robots_seen=evidence.most_lit,
        flashes_per_period=evidence.flashes_per_period,
        t_sync_s=t_sync_s,
        t_sync_periods=None if t_sync_s is None else t_sync_s / period_s,
        t_sync_cycles=None if reasons or in_order_s is None else evidence.cycles_at(in_order_s),
        histogram_s=histogram_s,
        histogram_periods=None if histogram_s is None else histogram_s / period_s,
        confidence="none" if reasons else "low" if found or warnings else "high",
        reasons=tuple(reasons or ([] if in_order_s else [why_never(evidence)])),
        warnings=(*warnings, *found),
        times_s=times_s,
        counts=counts,
        evaluations=tuple(evaluations),
        flashes=flashes,
        steady=tuple(steady),
        rings=counted.rings,
        geometry=geometry,
        options=options,
    )


def without_steady(counted: CountedRings, period_s: float | None) -> tuple[tuple[Flash, ...], list[Flash], IntArray]:
    """Return flashes, flashes of rings that are always lit, and (frames,) counts without the latter.

    Without a period, a ring is always lit if it is lit for much longer than usual. Many times more flashes at one place
    than at others are those of a lamp that the camera sees now and then. As a description does not say how bright rings
    are, dim flashes that are nearer to a wall than robots can be are left out, too.
    """
    onset_s, end_s, places, _, light = FlashTable.of(counted.flashes)
    longest_s = period_s / 2 if period_s else max(LONG_FLASHES * np.median(end_s - onset_s), SHORTEST_STEADY_S)
    x_cm, y_cm = places.T  # SciPy's tree takes longer to load than this takes for 6,000 flashes
    parts = np.array_split(places, 1 + len(places) // 100)
    apart_2 = ((part[:, :1] - x_cm) ** 2 + (part[:, 1:] - y_cm) ** 2 for part in parts)
    here = np.concatenate([np.count_nonzero(each <= SAME_PLACE_CM**2, axis=1) for each in apart_2])
    is_steady = (end_s - onset_s > longest_s) | (here > max(FEWEST_FLICKERS, MOST_FLICKERS * np.median(here)))
    to_wall_cm = np.minimum(places, counted.geometry.floor_cm - places).min(axis=1)
    is_none = (to_wall_cm < epuck.RADIUS_CM - OFF_CM) & (light < MIN_RELATIVE_LIGHT * np.median(light))
    is_none &= counted.geometry.calibration == DESCRIPTION
    chosen = is_steady, is_none, ~(is_steady | is_none)
    steady, none, others = (list(compress(counted.flashes, each)) for each in chosen)
    if not others:
        return counted.flashes, [], counted.counts
    gone = FlashTable.of(sorted({*steady, *none})).count_lit(counted.times_s)
    return tuple(others), steady, np.maximum(counted.counts - gone, 0)


def _flash_s(times_s: FloatArray, counts: IntArray, period_s: float) -> float:
    return synchrony.estimate_flash_s(times_s, counts) or FLASH_FRACTION * period_s
