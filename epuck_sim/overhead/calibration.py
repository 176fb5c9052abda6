"""Determines which camera took a film: from the user's options, the film's own description, or its pictures."""

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera import REFERENCE_HEIGHT_CM, REFERENCE_SIDE_CM, Frame, Geometry, Lens, overhead_camera
from epuck_sim.overhead.camera_fit import fit_camera, measure_rings
from epuck_sim.overhead.floor import find_corners
from epuck_sim.overhead.light import Background, is_lit
from epuck_sim.overhead.synchrony import spread_threshold_s
from epuck_sim.scenario.base import Positive, WholeNumber
from epuck_sim.scenario.overhead import OverheadSection

DESCRIPTION = "the film's description"
LIGHT = "the floor's corners in the lit beginning"

LIT_FRAMES = 30  # frames of a lit beginning in which the floor is searched: in some, a hand may hide its corners
AGREE_PX = 2.0  # largest distance of the floor's corners in two frames in a row; those of lamps that flicker move
MAX_TILT_DEG = 75.0  # largest angle between a camera's axis and straight down; from farther aside the floor is a line
STUDIED_FRAMES = 400  # dark frames in which rings are studied; a swarm has then flashed a few times
MIN_HEIGHT_CM = 10.0  # minimum height of a camera above the floor: twice the height of robots


DESCRIBED = ("arena_cm", "robots", "period_s")  # what users and descriptions may say alike


class FilmMetadata(BaseModel):
    """The part of a film's description (see `filming.describe_film`) that tracking uses."""

    arena_cm: tuple[Positive, Positive] | None = None
    robots: Annotated[WholeNumber, Field(ge=1)] | None = None
    period_s: Positive | None = None
    overhead: dict[str, Any] | None = None


def parse_metadata(description: Mapping[str, Any] | None) -> FilmMetadata:
    """Return the metadata in a film's description; all None if it is missing or of an unknown form."""
    try:
        return FilmMetadata(**(description or {}))
    except ValidationError:
        return FilmMetadata()


class TrackOptions(NamedTuple):
    """What the user knows about a film; None for what its description or its pictures must provide."""

    arena_cm: tuple[float, float] | None = None
    """Width and height of the floor."""
    height_cm: float | None = None
    """Height of the camera above the floor."""
    corners_px: tuple[tuple[float, float], ...] | None = None
    """(column, row) of each of the floor's four corners."""
    period_s: float | None = None
    """Period of the oscillators."""
    robots: int | None = None
    """Number of robots."""
    threshold_ms: float | None = None
    """Spread at which the swarm counts as synchronised by the histogram."""
    order_parameter: float | None = None
    """Order parameter of the onsets at which the swarm counts as synchronised; 0.95 if it is None."""

    lens: Lens | None = None
    """The lens, if it was calibrated."""
    tags: str | None = None
    """Dictionary of the ArUco tags on top of robots, by which they are told apart."""
    tag_numbers: frozenset[int] | None = None
    """Numbers of the tags that there are; all that are read often count if it is None."""
    start_s: float = 0.0
    """Time on the film's clock before which frames are left out."""
    end_s: float = math.inf
    """Time on the film's clock after which frames are left out."""
    fps: float | None = None
    """Frames per second, instead of the film's own time stamps."""

    def with_defaults(self, metadata: FilmMetadata, arena_cm: tuple[float, float] | None = None) -> Self:
        """Return these options, completed where they are None from a film's metadata, or else by an arena's size."""
        told = {name: getattr(self, name) or getattr(metadata, name) for name in DESCRIBED}
        return self._replace(**told | {"arena_cm": told["arena_cm"] or arena_cm})

    def contradictions(self, metadata: FilmMetadata) -> list[str]:
        """Return sentences about what is said otherwise in a film's metadata."""
        told = ((name, getattr(self, name), getattr(metadata, name)) for name in DESCRIBED)
        return [
            f"--{name.replace('_', '-')} is {_plain(given)}, but {DESCRIPTION} says {_plain(said)}"
            for name, given, said in told
            if None not in (given, said) and given != said
        ]

    def threshold_s(self, period_s: float, flash_s: float) -> float:
        """Return the threshold of the histogram: the one given, or the bound of Appendix C."""
        return spread_threshold_s(period_s, flash_s) if self.threshold_ms is None else self.threshold_ms / 1000


def _plain(value: Any) -> str:
    return "x".join(f"{side:g}" for side in np.ravel(value))


def excerpt(frames: Iterable[Frame], options: TrackOptions) -> Iterator[Frame]:
    """Yield the frames of a film that the options choose, at the times that they say; after the last none is read.

    Raises:
        FilmError: The film ends before the first of them, or they end before the second.
    """
    time_s, chosen = options.start_s, 0
    for number, frame in enumerate(frames):
        time_s = number / options.fps if options.fps else frame.time_s
        if time_s > options.end_s:
            break
        if time_s >= options.start_s:
            chosen += 1
            yield Frame(time_s, frame.picture)
    if time_s < options.start_s:
        raise FilmError(f"--start-s is {options.start_s:g}, but the film ends at {time_s:.1f} s; allowed: less")
    if chosen < 2 and time_s > options.end_s:
        kept = f"--end-s is {options.end_s:g}, which leaves {chosen} of the film's frames"
        raise FilmError(f"{kept}; allowed: more, so that two or more are left, preferably several periods")


def described_geometry(size_px: tuple[int, int], options: TrackOptions, metadata: FilmMetadata) -> Geometry | None:
    """Return the geometry in a film's metadata; None if there is none, or options or pictures are not like it."""
    is_told = options.corners_px or options.arena_cm or options.height_cm or options.lens
    if metadata.overhead is None or metadata.arena_cm is None or is_told:
        return None
    try:
        camera = overhead_camera(OverheadSection(**metadata.overhead), *metadata.arena_cm)
    except (EpuckSimError, ValidationError):  # written by another version
        return None
    is_same = (camera.width_px, camera.height_px) == size_px
    return Geometry(camera, metadata.arena_cm, DESCRIPTION, True) if is_same else None


def calibrate(
    name: str,
    size_px: tuple[int, int],
    frames: Iterator[Frame],
    options: TrackOptions,
    most_frames: int = STUDIED_FRAMES,
    most_lit_s: float = math.inf,
) -> Geometry:
    """Determine the camera that took a film, reading no more of its next frames than needed.

    The place of the floor follows from the corners in the options; or else from the floor's corners, if the film begins
    in the light; without them the camera is aimed at the arena's middle. Distortion and scale follow from the rings, in
    `most_frames` at most once the room is dark, for which it is waited for `most_lit_s`.

    Raises:
        FilmError: The options make no sense, or the film shows neither a floor nor a ring.
    """
    floor_cm = options.arena_cm or (REFERENCE_SIDE_CM, REFERENCE_SIDE_CM)
    above_cm = options.height_cm or REFERENCE_HEIGHT_CM / REFERENCE_SIDE_CM * max(floor_cm)
    if above_cm < MIN_HEIGHT_CM:
        raise FilmError(
            f"--arena-cm is {floor_cm[0]:g}x{floor_cm[1]:g}: a camera {above_cm:.3g} cm above it would be "
            f"among the robots; the unit is cm; give another height, {MIN_HEIGHT_CM:g} or more, by --height-cm"
        )
    is_given = options.corners_px is not None
    corners, frames = (np.array(options.corners_px, float), frames) if is_given else _lit_corners(frames)
    background = Background()
    dark = _after_light(frames, most_lit_s)
    rings = measure_rings(dark if corners is None else islice(dark, most_frames), background, most_frames)
    if corners is None and not rings.number:
        raise FilmError(
            f"{name}: no lit ring is seen; is it the right film, and is the exposure long enough, but not so "
            "long that rings are discs? If there are rings, give the floor's corners by --corners, which determine "
            "their size"
        )
    found = fit_camera(size_px, floor_cm, above_cm, rings, corners, options.lens)
    if corners is not None and not is_given:
        found = found._replace(calibration=LIGHT)
    if found.tilt_deg > MAX_TILT_DEG:
        raise FilmError(
            f"{name}: by {found.calibration} the camera is tilted by {found.tilt_deg:.0f} degrees; allowed: up "
            f"to {MAX_TILT_DEG:.0f}; give the floor's corners by --corners"
        )
    return found._replace(background=background.levels)


def _after_light(frames: Iterator[Frame], most_lit_s: float) -> Iterator[Frame]:
    """Yield the frames from the first dark one on, or from when it has been lit for so long."""
    begin_s: float | None = None
    for frame in frames:
        begin_s = frame.time_s if begin_s is None else begin_s
        if frame.time_s - begin_s >= most_lit_s or not is_lit(frame.picture):
            yield frame
            yield from frames


def _lit_corners(frames: Iterator[Frame]) -> tuple[FloatArray | None, Iterator[Frame]]:
    """Return the floor's corners in a lit beginning, if there is one, and the frames after it."""
    before: FloatArray | None = None
    for frame in islice(frames, LIT_FRAMES):
        if not is_lit(frame.picture):
            return None, chain([frame], frames)
        corners = find_corners(frame.picture)
        if corners is not None and before is not None and np.abs(corners - before).max() <= AGREE_PX:
            return corners, frames
        before = corners
    return None, frames
