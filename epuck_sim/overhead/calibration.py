"""Determines which camera took a film: from the user's options, the film's own description, or its pictures.

The distortion of the lens and the tilt of the camera change the size and the flattening of rings from place to place.
So rings determine the distortion and the tilt; corners determine the place of the floor.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, dropwhile, islice
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field, ValidationError

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.geometry import polygon_area
from epuck_sim.overhead import camera as cameras
from epuck_sim.overhead.camera import CORNERS, LOOKING_DOWN, CameraModel, Frame, Geometry, Lens, Light, simple_lens
from epuck_sim.overhead.floor import check_corners, find_corners
from epuck_sim.overhead.rings import LEAST_LIGHT, Background, RingFinder, is_lit, ring_light
from epuck_sim.overhead.synchrony import spread_threshold_s
from epuck_sim.scenario.arena import OverheadSection
from epuck_sim.scenario.base import Positive, WholeNumber

DESCRIPTION = "the film's description"
LIGHT = "the floor's corners in the lit beginning"
RINGS = "the size and shape of the rings, with the camera aimed at the arena's middle"

LIT_FRAMES = 30  # frames of a lit beginning in which the floor is searched: in some, a hand may hide its corners
AGREE_PX = 2.0  # largest distance of the floor's corners in two frames in a row; those of lamps that flicker move
MAX_TILT_DEG = 75.0  # largest angle between a camera's axis and straight down; beyond it, the floor looks like a line
STUDIED_FRAMES = 400  # dark frames in which rings are studied; a swarm has then flashed a few times
MIN_HEIGHT_CM = 10.0  # minimum height of a camera above the floor: twice the height of robots

# rings of unknown size
MIN_RADIUS_PX = 5.0  # radius of the smallest ring that is searched; the hollow of smaller ones is lost
MAX_RADIUS = 0.2  # radius of the largest ring that is searched, as a fraction of the picture's shorter side
STEP = 1.18  # ratio of successive radii that are searched; a ring is found from 0.8 to 1.2 times a radius
APART_S = 0.2  # time between examined pictures, unless more light comes on: one or two of them show a flash
SURVEYED = 6  # pictures with rings in which all sizes are searched; later only sizes that were found
ENOUGH_PICTURES = 30  # pictures with rings that are examined
ENOUGH_RINGS = 60  # rings that are enough to determine a camera
USUAL_LIGHT = 0.3  # least light of a ring, relative to that of bright ones
VIEW_HEIGHT_CM = 100.0  # height of the imagined camera that searches rings; only the scale that it gives matters

# the fit
TOLERANCE = 1e-12  # relative change of the squares, the pose or the gradient at which the fit of the camera ends
TELLING_RINGS = 8  # fewest rings that determine distortion and tilt
CORNER_PX = 0.5  # standard deviation of a corner that is given
SHAPE_ERRORS = (0.5, 0.1, 0.02)
"""Standard deviation of a ring's size and flattening, relative to its radius, in each of the successive fits: large
errors count for little, and in the first fit all are large."""
SIZE_PRIOR = 0.05  # standard deviation of the radius of real rings around `epuck.RING_RADIUS_CM`, relative to it
K1_PRIOR = 0.15  # standard deviation of usual lenses' radial distortion; keeps it small if rings do not determine it
TILT_PRIOR = 0.3  # standard deviation, in radians, of the camera's tilt if no corners are given
FISHEYE_GAIN = 0.6  # sum of squares of a fisheye, relative to that of a usual lens, below which a lens is a fisheye

_CIRCLE = np.arange(24) * math.tau / 24

DESCRIBED = ("arena_cm", "robots", "period_s")  # options that a film's description may also have


class FilmMetadata(BaseModel):
    """The part of a film's description (see `filming.describe_film`) that tracking uses."""

    arena_cm: tuple[Positive, Positive] | None = None
    robots: Annotated[WholeNumber, Field(ge=1)] | None = None
    period_s: Positive | None = None
    overhead: dict[str, Any] | None = None

    @classmethod
    def of(cls, description: Mapping[str, Any] | None) -> Self:
        """Return the metadata in a film's description; all None if it is missing or of an unknown form."""
        try:
            return cls(**(description or {}))
        except ValidationError:
            return cls()

    def geometry(self, size_px: tuple[int, int], options: "TrackOptions") -> Geometry | None:
        """Return the geometry described; None without one, if options replace it, or for other picture sizes."""
        is_told = options.corners_px or options.arena_cm or options.height_cm or options.lens
        if self.overhead is None or self.arena_cm is None or is_told:
            return None
        try:
            camera = cameras.overhead_camera(OverheadSection(**self.overhead), *self.arena_cm)
        except (EpuckSimError, ValidationError):  # written by another version
            return None
        is_same = (camera.width_px, camera.height_px) == size_px
        return Geometry(camera, self.arena_cm, DESCRIPTION, True, ring_size=math.nan) if is_same else None


class TrackOptions(NamedTuple):
    """The user's knowledge of a film; None for values that its description or its pictures must provide."""

    arena_cm: tuple[float, float] | None = None  # width and height of the floor
    height_cm: float | None = None  # height of the camera above the floor
    corners_px: tuple[tuple[float, float], ...] | None = None  # (column, row) of each of the floor's four corners
    period_s: float | None = None  # period of the oscillators
    robots: int | None = None  # number of robots
    threshold_ms: float | None = None  # spread at which the swarm counts as synchronised by the histogram
    order_parameter: float | None = None
    """Order parameter of the onsets at which the swarm counts as synchronised; 0.95 if it is None."""

    lens: Path | None = None  # the file of the lens, if it was calibrated
    tags: str | None = None  # dictionary of the ArUco tags on top of robots, by which they are told apart
    tag_numbers: frozenset[int] | None = None  # numbers of the tags in use; if it is None, those that are read often
    start_s: float = 0.0  # time on the film's clock before which frames are left out
    end_s: float = math.inf  # time on the film's clock after which frames are left out
    fps: float | None = None  # frames per second, instead of the film's own time stamps

    def with_defaults(self, metadata: FilmMetadata) -> Self:
        """Return these options; fill in those that are None from a film's metadata."""
        return self._replace(**{name: getattr(self, name) or getattr(metadata, name) for name in DESCRIBED})

    def contradictions(self, metadata: FilmMetadata, size_px: tuple[int, int]) -> list[str]:
        """Return a sentence for each option that the metadata of a film of some picture size contradict."""
        described = metadata.geometry(size_px, TrackOptions())
        height_cm = described and round(float(described.camera.position_cm[2]), 6)
        told = [(name, getattr(self, name), getattr(metadata, name)) for name in DESCRIBED]
        return [
            f"--{name.replace('_', '-')} is {_plain(given)}, but {DESCRIPTION} says {_plain(said)}"
            for name, given, said in (*told, ("height_cm", self.height_cm, height_cm))
            if None not in (given, said) and given != said
        ]

    def threshold_s(self, period_s: float, flash_s: float) -> float:
        """Return the threshold of the histogram: the one given, or the bound of Appendix C."""
        return spread_threshold_s(period_s, flash_s) if self.threshold_ms is None else self.threshold_ms / 1000


def _plain(value: Any) -> str:
    return "x".join(f"{side:g}" for side in np.ravel(value))


def excerpt(frames: Iterable[Frame], options: TrackOptions) -> Iterator[Frame]:
    """Yield the frames that options choose, with the times that they give; raise FilmError if they leave too few."""
    time_s, chosen = options.start_s, 0
    for number, frame in enumerate(frames):
        time_s = number / options.fps if options.fps else frame.time_s
        if time_s > options.end_s:
            break
        if time_s >= options.start_s:
            chosen += 1
            frame.time_s = time_s
            yield frame
    if time_s < options.start_s:
        raise FilmError(f"--start-s is {options.start_s:g}, but the film ends at {time_s:.1f} s; allowed: less")
    if chosen < 2 and time_s > options.end_s:
        kept = f"--end-s is {options.end_s:g}, which leaves {chosen} of the film's frames"
        raise FilmError(f"{kept}; allowed: more, so that two or more are left, preferably several periods")


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
    at most `most_frames` from the first dark frame on, or after `most_lit_s` of light. FilmError is raised if the
    options make no sense, the lens does not fit the film, or it shows neither floor nor ring.
    """
    lens = None if options.lens is None else cameras.read_lens(options.lens, size_px)
    floor_cm = options.arena_cm or (cameras.REFERENCE_SIDE_CM, cameras.REFERENCE_SIDE_CM)
    above_cm = options.height_cm or cameras.REFERENCE_HEIGHT_CM / cameras.REFERENCE_SIDE_CM * max(floor_cm)
    if above_cm < MIN_HEIGHT_CM:
        said = f"{floor_cm[0]:g}x{floor_cm[1]:g}: a camera {above_cm:.3g} cm above it would be among the robots"
        allowed = f"another height, {MIN_HEIGHT_CM:g} or more, by --height-cm"
        raise FilmError(f"--arena-cm is {said}; the unit is cm; give {allowed}")
    is_given = options.corners_px is not None
    corners, frames = (np.array(options.corners_px, float), frames) if is_given else _lit_corners(frames)
    background = Background()
    dark = _after_light(frames, most_lit_s)
    rings = measure_rings(dark if corners is None else islice(dark, most_frames), background, most_frames)
    if corners is None and not len(rings.radius_px):
        raise FilmError(
            f"{name}: no lit ring is seen; is it the right film, is the room dark, and is the exposure long enough, "
            f"but not so long that rings are discs? Those of {MIN_RADIUS_PX:g} px radius or more are searched, up to "
            f"{MAX_RADIUS * min(size_px):.0f} px in pictures of {size_px[0]} x {size_px[1]} px, lit up to half of it "
            "wide. If there are, give the floor's corners by --corners, which show their size"
        )
    found = fit_camera(size_px, floor_cm, above_cm, rings, corners, lens)
    if corners is not None and not is_given:
        found = found._replace(calibration=LIGHT)
    if found.tilt_deg > MAX_TILT_DEG:
        said = f"by {found.calibration} the camera is tilted by {found.tilt_deg:.0f} degrees"
        raise FilmError(f"{name}: {said}; allowed: up to {MAX_TILT_DEG:.0f}; give the floor's corners by --corners")
    return found._replace(background=background.levels)


def _after_light(frames: Iterator[Frame], most_lit_s: float) -> Iterator[Frame]:
    """Yield the frames from the first dark one on, or once the room has been lit for `most_lit_s`."""
    if (first := next(frames, None)) is not None:
        until_s = first.time_s + most_lit_s
        yield from dropwhile(lambda frame: frame.time_s < until_s and is_lit(frame.colours), chain([first], frames))


def _lit_corners(frames: Iterator[Frame]) -> tuple[FloatArray | None, Iterator[Frame]]:
    """Return the floor's corners in a lit beginning, if there is one, and the frames after it."""
    before: FloatArray | None = None
    for frame in islice(frames, LIT_FRAMES):
        if not is_lit(frame.colours):
            return None, chain([frame], frames)
        corners = find_corners(frame.picture)
        if corners is not None and before is not None and np.abs(corners - before).max() <= AGREE_PX:
            return corners, frames
        before = corners
    return None, frames


class SeenRings(NamedTuple):
    """How rings look in pictures."""

    places_px: FloatArray  # (n, 2) column and row of their middles
    radius_px: FloatArray  # (n,) mean radii
    flattening: FloatArray
    """(n, 2) cosine and sine amplitudes of the radius along twice the angle, relative to the radius."""
    light: float = 0.0  # median levels by which they are brighter than their inside


def measure_rings(frames: Iterable[Frame], background: Background, most_frames: int) -> SeenRings:
    """Measure the bright rings, of unknown size, in the dark frames of a film, which also update the background.

    Reading ends with enough rings or pictures, or `most_frames` after the first frame with a ring.
    """
    survey, first = _Survey(), background.levels
    last_s, last_lit_px, since = -math.inf, 0, 0
    for frame in frames:
        if first is None and not is_lit(frame.colours):
            first, _ = ring_light(frame)
            background.levels = first
        since += bool(survey.found)
        light, room_is_lit = background.light_beyond(frame)
        if room_is_lit:
            continue
        lit_px = int(np.count_nonzero(light >= LEAST_LIGHT))
        if lit_px and (frame.time_s - last_s >= APART_S or lit_px > last_lit_px):
            last_s, last_lit_px = frame.time_s, lit_px
            survey.examine(light)
        if len(survey.found) >= ENOUGH_RINGS or survey.pictures >= ENOUGH_PICTURES or since >= most_frames:
            break
    if first is not None and not survey.found:  # the light in the first picture never went off
        background.levels = None
        survey.examine(first)
    table = np.array(survey.found).reshape(-1, 7)
    if not len(table):
        return SeenRings(table[:, :2], table[:, 2], table[:, 3:5])
    table = table[table[:, 5] >= USUAL_LIGHT * np.quantile(table[:, 5], 0.9)]
    return SeenRings(table[:, :2], table[:, 2], table[:, 3:5], float(np.median(table[:, 5])))


class _Survey:
    """Searches rings of all sizes in picture after picture, and later only of the sizes that were found."""

    def __init__(self) -> None:
        self.found: list[list[float]] = []
        """Column, row, radius, px; flattening, cosine and sine; light, levels; misfit relative to the radius."""
        self.pictures = 0  # with rings
        self._finders: list[RingFinder] = []
        self._useful: set[RingFinder] = set()

    def examine(self, light: Light) -> None:
        """Search rings in the light of a dark picture; of several at one place, keep the one that fits best."""
        above_cm = VIEW_HEIGHT_CM - epuck.RING_HEIGHT_CM
        if not self._finders:
            rows, columns = light.shape
            sizes = math.floor(math.log(MAX_RADIUS * min(rows, columns) / MIN_RADIUS_PX, STEP)) + 1
            px_per_cm = MIN_RADIUS_PX * STEP ** np.arange(sizes) / epuck.RING_RADIUS_CM
            lenses = (simple_lens(columns, rows, focal_px) for focal_px in (px_per_cm * above_cm).tolist())
            place_cm = np.array([0.0, 0.0, VIEW_HEIGHT_CM])
            self._finders = [RingFinder(CameraModel(columns, rows, lens, LOOKING_DOWN, place_cm)) for lens in lenses]
        seen: list[list[float]] = []
        for finder in self._finders:
            if self.pictures < SURVEYED or finder in self._useful:
                for fit in finder.fits(light):
                    self._useful.add(finder)
                    place_px = finder.camera.project(finder.view.centres_cm([fit]))[0].tolist()
                    radius_px = fit.radius_cm * (finder.camera.lens.focal_px / above_cm)
                    along, aside = fit.flattening  # rows of the view count upwards
                    seen.append([*place_px, radius_px, along, -aside, fit.light, fit.misfit_cm / fit.radius_cm])
        kept: list[list[float]] = []
        for ring in sorted(seen, key=lambda each: each[-1]):
            if all(math.dist(ring[:2], other[:2]) > max(ring[2], other[2]) for other in kept):
                kept.append(ring)
        self.found += kept
        self.pictures += bool(seen)


def fit_camera(
    size_px: tuple[int, int],
    floor_cm: tuple[float, float],
    above_cm: float,
    rings: SeenRings,
    corners_px: npt.ArrayLike | None = None,
    lens: Lens | None = None,
) -> Geometry:
    """Fit a camera to the sizes and shapes of rings, and to the floor's corners if they are given.

    Corners are (4, 2) px in any order; the nearest to the picture's lower left corner is the arena's origin. Without
    them, the camera is aimed at the arena's middle, and not turned. Corners seen from straight above do not determine
    its height. Raises the errors of `check_corners`.
    """
    corners = None if corners_px is None else check_corners(corners_px, *size_px)
    kinds = (False, True) if lens is None and len(rings.radius_px) >= TELLING_RINGS else (False,)
    fits = [_fit(size_px, floor_cm, above_cm, rings, corners, lens, is_fisheye) for is_fisheye in kinds]
    _, found = fits[-1] if fits[-1][0] < FISHEYE_GAIN * fits[0][0] else fits[0]
    return found


def _unknowns(
    floor_cm: tuple[float, float], above_cm: float, rings: SeenRings, corners: FloatArray | None, lens: Lens | None
) -> tuple[FloatArray, BoolArray]:
    """Return (8,) values at which a fit begins, and which of them are fitted; the others are held.

    0 to 2: rotation vector; without corners, the third, the turn, is held; without corners and enough rings, all. 3, 4:
    offset relative to the height, held without corners. 5: logarithm of the focal length, or of the relative height if
    the lens is known. 6: k1, held without enough rings, and if the lens is known. 7: logarithm of the rings' relative
    size, held without corners or rings.
    """
    start = np.zeros(8)
    if corners is not None:
        scale = math.sqrt(abs(polygon_area(corners)) / (floor_cm[0] * floor_cm[1]))
        start[2] = math.atan2(*(corners[1] - corners[0])[::-1])
        start[5] = math.log(scale * above_cm)
    else:
        scale = float(np.median(rings.radius_px)) / epuck.RING_RADIUS_CM
        start[5] = math.log(scale * (above_cm - epuck.RING_HEIGHT_CM))
    if lens is not None:  # then the height is fitted instead of the focal length
        start[5] = math.log(lens.focal_px / above_cm) - (start[5] - math.log(above_cm))
    by_corners, by_rings = corners is not None, len(rings.radius_px) >= TELLING_RINGS
    told = [by_corners or by_rings] * 2 + [by_corners] * 3 + [True, lens is None and by_rings]
    return start, np.array([*told, by_corners and len(rings.radius_px) > 0])


def _fit(
    size_px: tuple[int, int],
    floor_cm: tuple[float, float],
    above_cm: float,
    rings: SeenRings,
    corners: FloatArray | None,
    lens: Lens | None,
    is_fisheye: bool,
) -> tuple[float, Geometry]:
    """Return half of the remaining sum of squares, and the geometry of the least-squares fit."""
    # loading it takes half a second, and described films do without it
    from scipy.optimize import least_squares  # noqa: PLC0415

    floor = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * (*floor_cm, 0.0)
    start, is_told = _unknowns(floor_cm, above_cm, rings, corners, lens)
    is_told[6] &= not is_fisheye

    def filled(found: FloatArray) -> FloatArray:
        values = start.copy()
        values[is_told] = found
        return values

    def camera_of(values: FloatArray) -> CameraModel:
        rotation = np.asarray(cv2.Rodrigues(values[:3])[0], float) @ LOOKING_DOWN
        rise_cm = above_cm * (1.0 if lens is None else math.exp(values[5]))
        aside = rotation[2] / rotation[2, 2] if corners is None else np.array([*values[3:5], 1.0])
        through = lens or simple_lens(*size_px, math.exp(values[5]), values[6], is_fisheye)
        return CameraModel(*size_px, through, rotation, floor.mean(axis=0) + rise_cm * aside)

    def misses(found: FloatArray, shape_error: float) -> FloatArray:
        values = filled(found)
        parts = [np.array([values[6] / K1_PRIOR, values[7] / SIZE_PRIOR])]
        with np.errstate(all="ignore"):
            camera = camera_of(values)
            if corners is None:
                parts.append(values[:2] / TILT_PRIOR)
            else:
                parts.append((camera.project(floor) - corners).ravel() / CORNER_PX)
            if len(rings.radius_px):
                seen = expected_rings(camera, rings.places_px, epuck.RING_RADIUS_CM * math.exp(values[7]))
                sizes = np.log(np.maximum(seen.radius_px, 1e-3) / rings.radius_px)
                off = (np.column_stack([sizes, seen.flattening - rings.flattening]) / shape_error).ravel()
                parts.append(np.sign(off) * np.sqrt(2 * np.log1p(off**2 / 2)))  # a false ring counts for little
        return np.asarray(np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3), float)

    found = start[is_told]
    until = {"x_scale": "jac", "ftol": TOLERANCE, "xtol": TOLERANCE, "gtol": TOLERANCE}
    for shape_error in SHAPE_ERRORS:
        fit = least_squares(misses, found, args=(shape_error,), **until)
        found = fit.x
    camera, error_cm = camera_of(filled(found)), 0.0
    if len(rings.radius_px):  # error of the corners on the floor, from draws of the fitted values
        covariance, pixels = np.linalg.pinv(fit.jac.T @ fit.jac), camera.project(floor)
        draws = np.random.default_rng(0).multivariate_normal(found, covariance, 32, "ignore", method="svd")
        off_cm = [camera_of(filled(draw)).back_project(pixels, 0.0) - floor[:, :2] for draw in draws]
        error_cm = float(np.sqrt(np.mean(np.sum(np.square(off_cm), axis=2))))
    tilt_deg = math.degrees(math.acos(min(1.0, -camera.rotation[2, 2])))
    by, ring_size = RINGS if corners is None else CORNERS, math.exp(filled(found)[7])
    known = Geometry(camera, floor_cm, by, corners is not None, error_cm, tilt_deg)
    return float(fit.cost), known._replace(ring_light=rings.light, ring_size=ring_size)


def expected_rings(camera: CameraModel, places_px: FloatArray, radius_cm: float) -> SeenRings:
    """Return how a camera would see rings whose middles are at (n, 2) px."""
    centres = camera.back_project(places_px, epuck.RING_HEIGHT_CM)
    rim = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=-1) * radius_cm
    points = np.concatenate([np.zeros((1, 2)), rim]) + centres[:, None]
    height = np.full((*points.shape[:2], 1), epuck.RING_HEIGHT_CM)
    pixels = camera.project(np.concatenate([points, height], axis=2).reshape(-1, 3)).reshape(len(centres), -1, 2)
    x, y = np.moveaxis(pixels[:, 1:] - pixels[:, 1:].mean(axis=1, keepdims=True), -1, 0)
    across, down, mixed = ((one * other).mean(axis=1) for one, other in ((x, x), (y, y), (x, y)))
    flattening = np.column_stack([(across - down) / 2, mixed]) / (across + down)[:, None]
    return SeenRings(places_px, np.sqrt(across + down), flattening)  # moments are half of the axes' squares
