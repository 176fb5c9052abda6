"""Determines which camera took a film: from the user's options, the film's own description, or its pictures."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Annotated, Any, NamedTuple, Protocol, Self

from pydantic import BaseModel, Field, ValidationError

from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera_model import REFERENCE_HEIGHT_CM, REFERENCE_SIDE_CM, CameraModel, overhead_camera
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.track.calibration import camera_from_corners, camera_from_rings, measure_radius
from epuck_sim.overhead.track.floor_corners import find_corners
from epuck_sim.overhead.track.period_estimation import spread_at_s, spread_threshold_s
from epuck_sim.overhead.track.ring_detection import is_lit
from epuck_sim.scenario.base import Positive, WholeNumber
from epuck_sim.scenario.overhead import OverheadSection

DESCRIPTION = "the film's description"
CORNERS = "the corners given"
LIGHT = "the floor's corners in the lit beginning"
RINGS = "the size of the rings, as if the camera looked straight down at the arena's middle"

LIT_FRAMES = 30
"""Number of frames of a lit beginning in which the floor is searched; robots or a hand may hide its corners in some."""

DARK_FRAMES = 30
"""Number of frames in a batch from which rings are measured, until one batch has a ring; a flash has five frames."""

MIN_HEIGHT_CM = 10.0
"""Minimum height of a camera above the floor: twice the height of robots."""


class FrameSource(Protocol):
    """A film, or a camera while it films."""

    name: str
    width_px: int
    height_px: int

    def frames(self) -> Iterable[Frame]:
        """Return the frames."""


class FilmMetadata(BaseModel):
    """The part of a film's description (see `film_trial.describe_film`) that tracking uses."""

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
    """Spread at which the swarm counts as synchronised."""
    order_parameter: float | None = None
    """Order parameter of the firings at which the swarm counts as synchronised; used if `threshold_ms` is None."""

    def with_defaults(self, metadata: FilmMetadata) -> Self:
        """Return these options, completed from a film's metadata where they are None."""
        return self._replace(
            arena_cm=self.arena_cm or metadata.arena_cm,
            period_s=self.period_s or metadata.period_s,
            robots=self.robots or metadata.robots,
        )

    def threshold_s(self, period_s: float, flash_s: float) -> float:
        """Return the spread at which a swarm counts as synchronised: the one given, or the bound of Appendix C.

        Args:
            period_s: Period of the oscillators.
            flash_s: Duration of a flash.
        """
        if self.threshold_ms is not None:
            return self.threshold_ms / 1000
        if self.order_parameter is not None:
            return spread_at_s(period_s, flash_s, self.order_parameter)
        return spread_threshold_s(period_s, flash_s)


def described_camera(source: FrameSource, options: TrackOptions, metadata: FilmMetadata) -> CameraModel | None:
    """Return the camera in a film's metadata; None if there is none, or the user's options describe another one."""
    if metadata.overhead is None or metadata.arena_cm is None:
        return None
    if options.corners_px or options.arena_cm or options.height_cm:
        return None
    try:
        camera = overhead_camera(OverheadSection(**metadata.overhead), *metadata.arena_cm)
    except (EpuckSimError, ValidationError):  # written by another version
        return None
    has_its_size = (camera.width_px, camera.height_px) == (source.width_px, source.height_px)
    return camera if has_its_size else None  # the film was cropped or scaled


def calibrate(source: FrameSource, options: TrackOptions) -> tuple[CameraModel, str]:
    """Determine the camera that took a film, reading no more frames than needed.

    The camera follows from the corners in the options; or else from the floor's corners, if the film begins in the
    light; or else from the size of the rings.

    Args:
        source: The film or camera; its next frames are read.
        options: What is known of it.

    Returns:
        The camera, and what it was determined from.

    Raises:
        FilmError: The options make no sense, or the film shows neither a floor nor a ring.
    """
    size = source.width_px, source.height_px
    floor_cm = options.arena_cm or (REFERENCE_SIDE_CM, REFERENCE_SIDE_CM)
    above_cm = options.height_cm or REFERENCE_HEIGHT_CM / REFERENCE_SIDE_CM * max(floor_cm)
    if above_cm < MIN_HEIGHT_CM:
        raise FilmError(
            f"--arena-cm is {floor_cm[0]:g}x{floor_cm[1]:g}: a camera {above_cm:.3g} cm above it would be "
            f"among the robots; the unit is cm; give another height, {MIN_HEIGHT_CM:g} or more, by --height-cm"
        )
    if options.corners_px is not None:
        return camera_from_corners(options.corners_px, *size, *floor_cm, above_cm), CORNERS
    frames = iter(source.frames())
    for frame in islice(frames, LIT_FRAMES):
        if not is_lit(frame.picture):
            frames = chain([frame], frames)
            break
        corners = find_corners(frame.picture)
        if corners is not None:
            return camera_from_corners(corners, *size, *floor_cm, above_cm), LIGHT
    radius_px = _ring_radius_px(frames)
    if radius_px is None:
        raise FilmError(
            f"{source.name}: no lit ring is seen; is it the right film, are the rings red, and is the exposure long "
            "enough? If there are rings, give the floor's corners by --corners, which determine their size"
        )
    return camera_from_rings(radius_px, *size, *floor_cm, above_cm), RINGS


def _ring_radius_px(frames: Iterator[Frame]) -> float | None:
    """Return the radius of the first rings that can be measured; None if there are none."""
    for first in frames:
        batch = chain([first], islice(frames, DARK_FRAMES - 1))
        radius_px = measure_radius(frame.picture for frame in batch)
        if radius_px is not None:
            return radius_px
    return None
