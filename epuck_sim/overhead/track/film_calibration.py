"""Which camera took a film: the one its description names, or one that its corners or rings tell."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Annotated, Any, Protocol

from pydantic import BaseModel, Field, ValidationError

from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera_model import HEIGHT_CM, SIDE_CM, Lens, overhead_lens
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.track.calibration import lens_from_corners, lens_from_rings, measure_radius
from epuck_sim.overhead.track.floor_corners import find_corners
from epuck_sim.overhead.track.result import Known
from epuck_sim.overhead.track.ring_detection import is_lit
from epuck_sim.scenario.base import Positive, WholeNumber
from epuck_sim.scenario.overhead import OverheadSection

DESCRIPTION = "the film's description"
CORNERS = "the corners given"
LIGHT = "the floor's corners in the lit beginning"
RINGS = "the size of the rings, as if the camera looked straight down at the arena's middle"

LIT_FRAMES = 30
"""So many frames of a lit beginning may have robots in the corners of the floor, or somebody's hand."""

DARK_FRAMES = 30
"""Rings are measured in so many frames at a time, until there is one; one flash has five."""

LOWEST_CM = 10.0
"""A camera hangs at least so high above the floor: twice as high as robots are."""


class Source(Protocol):
    """A film, or a camera while it films."""

    name: str
    width_px: int
    height_px: int

    def frames(self) -> Iterable[Frame]:
        """Return the frames."""


class Told(BaseModel):
    """What a film says of itself (see `filming.describe_film`), as far as a tracker asks."""

    arena_cm: tuple[Positive, Positive] | None = None
    robots: Annotated[WholeNumber, Field(ge=1)] | None = None
    period_s: Positive | None = None
    overhead: dict[str, Any] | None = None


def told_by(description: Mapping[str, Any] | None) -> Told:
    """Return what a description tells; nothing where another version wrote what makes no sense to this one."""
    try:
        return Told(**(description or {}))
    except ValidationError:
        return Told()


def with_description(known: Known, description: Mapping[str, Any] | None) -> Known:
    """Return what is known of a film, with what the film says of itself where the user says nothing."""
    told = told_by(description)
    return known._replace(
        arena_cm=known.arena_cm or told.arena_cm,
        period_s=known.period_s or told.period_s,
        robots=known.robots or told.robots,
    )


def described_lens(source: Source, known: Known, description: Mapping[str, Any] | None) -> Lens | None:
    """Return the camera that a film's description names; None if there is none, or the user knows better."""
    told = told_by(description)
    if told.overhead is None or told.arena_cm is None or (known.corners_px or known.arena_cm or known.height_cm):
        return None
    try:
        lens = overhead_lens(OverheadSection(**told.overhead), *told.arena_cm)
    except (EpuckSimError, ValidationError):  # of another version
        return None
    is_its_size = (lens.width_px, lens.height_px) == (source.width_px, source.height_px)
    return lens if is_its_size else None  # or else the film was cropped or scaled


def find_lens(source: Source, known: Known) -> tuple[Lens, str]:
    """Return the camera that took a film, and where that is from; looks at as many frames as it needs.

    Corners given tell it, or else those of the floor if the film begins in the light, or else the size of the rings.
    Raises FilmError where nothing tells it.
    """
    size = source.width_px, source.height_px
    floor_cm = known.arena_cm or (SIDE_CM, SIDE_CM)
    above_cm = known.height_cm or HEIGHT_CM / SIDE_CM * max(floor_cm)
    if above_cm < LOWEST_CM:
        raise FilmError(
            f"--arena-cm is {floor_cm[0]:g}x{floor_cm[1]:g}: a camera {above_cm:.3g} cm above it would be "
            f"among the robots; it is in centimetres; --height-cm gives another height, {LOWEST_CM:g} or more"
        )
    if known.corners_px is not None:
        return lens_from_corners(known.corners_px, *size, *floor_cm, above_cm), CORNERS
    frames = iter(source.frames())
    for frame in islice(frames, LIT_FRAMES):
        if not is_lit(frame.picture):
            frames = chain([frame], frames)
            break
        corners = find_corners(frame.picture)
        if corners is not None:
            return lens_from_corners(corners, *size, *floor_cm, above_cm), LIGHT
    radius_px = _ring_radius_px(frames)
    if radius_px is None:
        raise FilmError(
            f"{source.name}: no lit ring is seen; is it the right film, are the rings red, and is the exposure long "
            "enough? If there are some, --corners tells how large they are"
        )
    return lens_from_rings(radius_px, *size, *floor_cm, above_cm), RINGS


def _ring_radius_px(frames: Iterator[Frame]) -> float | None:
    """Return the radius of the first rings that can be measured; None where there are none."""
    for first in frames:
        some = chain([first], islice(frames, DARK_FRAMES - 1))
        radius_px = measure_radius(frame.picture for frame in some)
        if radius_px is not None:
            return radius_px
    return None
