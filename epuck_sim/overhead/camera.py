"""The camera above the arena: projects points to pixels and back, by OpenCV's model; its pictures and its lens.

A lens is calibrated from pictures of a board, and kept in a file that `track` and `film` take.

The arena's frame: x to the right, y up in the picture, z above the floor, origin in the lower left corner of the floor.
Pixels: (column, row), measured from the middle of the upper left pixel, as in OpenCV.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from itertools import compress
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.scenario.arena import OverheadSection
from epuck_sim.scenario.base import Positive, WholeNumber
from epuck_sim.util.atomic_write import atomic_write

Picture = npt.NDArray[np.uint8]  # (height_px, width_px, 3) red, green, blue; row 0 is the upper edge
Light = npt.NDArray[np.uint8]  # (rows, columns) one channel of a picture or of the rectified view


class Frame:
    """One picture of a film, given as a whole or by its three colours; only what is given is kept in memory."""

    def __init__(self, time_s: float, picture: Picture | None = None, colours: Sequence[Light] = ()) -> None:
        self.time_s = time_s  # beginning of its exposure, on the film's own clock
        self._picture, self._colours = picture, colours

    @property
    def picture(self) -> Picture:
        """(height_px, width_px, 3) red, green and blue of each pixel."""
        return np.asarray(cv2.merge(self._colours), np.uint8) if self._picture is None else self._picture

    @property
    def colours(self) -> Sequence[Light]:
        """Red, green and blue, (height_px, width_px) each."""
        return self._colours or [np.asarray(colour, np.uint8) for colour in cv2.split(self.picture)]


ProgressWrapper = Callable[[Iterable[Any], float | None], Iterable[Any]]
"""Function that passes on frames, or times in s, and shows the progress.

Its second argument is the last time; None if it is unknown."""

REFERENCE_HEIGHT_CM = 110.0  # height of the camera above the floor in the thesis's experiments (4.3.1)
REFERENCE_SIDE_CM = 60.0  # side of the arena in the thesis's experiments (4.3.1)
WALL_HEIGHT_CM = 6.0  # height of the arena's walls; our estimate: they hide a robot of 4.7 cm from its surroundings

LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])  # rotation from the arena's frame into a camera's (x right, y down, z ahead)
MARGIN = 1.04  # factor by which the default field of view is larger than the floor with its walls

UNDISTORT_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""Termination criterion (iterations, tolerance) for undistortPoints; OpenCV's default of five iterations is off by
whole pixels in the corners of a wide, strongly distorted picture."""

# boards
APART_S = 0.5  # time between frames in which the board is searched
MIN_VIEWS = 6  # fewest pictures of the board to calibrate a lens from; OpenCV recommends ten or more
MAX_VIEWS = 40  # most pictures of the board that are used
MIN_POINTS = 8  # corners of a ChArUco board that must be seen in a picture
MIN_MOVE_PX = 8.0  # mean distance by which the board must have moved since the last picture that counts
SUBPIXEL = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)  # iterations or px, which end the refinement
MARKER_SHARE = 0.7  # side of a ChArUco board's markers, relative to that of its squares
EQUIDISTANT = cv2.CALIB_FIX_PRINCIPAL_POINT | sum(getattr(cv2, f"CALIB_FIX_K{number}") for number in (1, 2, 3, 4))
"""OpenCV's flags to fit only the focal length of a fisheye lens."""
MAX_MISFIT = 5.0  # error of a view, relative to the median, above which it is left out: its corners were misplaced
UNSURE_FOCUS = 0.03
"""Largest relative difference of the focal lengths from half of the views and from all, if they determine a lens: seen
straight on, or always tilted in the same way, a near board looks like a farther one through a longer lens."""


class Lens(NamedTuple):
    """OpenCV's camera matrix and distortion of a usual or fisheye lens, which give the pixel that shows a direction."""

    focal_px: float  # focal length across the picture
    focal_down_px: float  # focal length down the picture; the same where pixels are square
    middle_px: tuple[float, float]  # column and row that the optical axis meets
    coefficients: tuple[float, ...]
    """OpenCV's distortion coefficients: k1, k2, p1, p2, k3 of its usual model, or k1 to k4 of its fisheye model."""
    is_fisheye: bool = False

    @property
    def matrix(self) -> FloatArray:
        """OpenCV's (3, 3) camera matrix."""
        column, row = self.middle_px
        return np.array([[self.focal_px, 0, column], [0, self.focal_down_px, row], [0, 0, 1]])


def simple_lens(width_px: int, height_px: int, focal_px: float, k1: float = 0.0, is_fisheye: bool = False) -> Lens:
    """Return a lens with square pixels whose axis meets the middle of the picture; k1: its radial distortion.

    A fisheye lens with k1 = 0 is equidistant: pixels off the middle are proportional to angles off the axis.
    """
    return Lens(focal_px, focal_px, ((width_px - 1) / 2, (height_px - 1) / 2), (k1, 0.0, 0.0, 0.0), is_fisheye)


class CameraModel(NamedTuple):
    """A camera somewhere above the arena."""

    width_px: int
    height_px: int
    lens: Lens
    rotation: FloatArray  # (3, 3) rotation from the arena's frame into the camera's
    position_cm: FloatArray  # (3,) position of the pinhole in the arena's frame

    def project(self, points_cm: FloatArray) -> FloatArray:
        """Return (n, 2) px: column and row that show (n, 3) points in front of the camera, cm; n > 0."""
        show = cv2.fisheye.projectPoints if self.lens.is_fisheye else cv2.projectPoints
        # rotated here: as the vector that OpenCV takes, about half a turn would be a thousandth of a degree off
        seen = (np.asarray(points_cm, float) - self.position_cm) @ self.rotation.T
        pixels, _ = show(seen[:, None], np.zeros(3), np.zeros(3), self.lens.matrix, np.array(self.lens.coefficients))
        return np.asarray(pixels, float).reshape(-1, 2)

    def back_project(self, pixels: FloatArray, z_cm: float) -> FloatArray:
        """Return (n, 2) cm: x and y of the points `z_cm` above the floor that (n, 2) px show; n > 0.

        A pixel above the horizon shows no such point and gets the one behind the camera on the same line.
        """
        seen = np.ascontiguousarray(pixels, float).reshape(-1, 1, 2)
        straighten = cv2.fisheye.undistortPoints if self.lens.is_fisheye else cv2.undistortPoints
        coefficients = np.array(self.lens.coefficients)
        straight = straighten(seen, self.lens.matrix, coefficients, criteria=UNDISTORT_CRITERIA).reshape(-1, 2)
        straight[~np.isfinite(straight).all(axis=1)] = np.nan  # beyond what a fisheye lens shows
        rays = np.column_stack([straight, np.ones(len(straight))]) @ self.rotation
        distance = (z_cm - self.position_cm[2]) / rays[:, 2]
        return np.asarray(self.position_cm[:2] + distance[:, None] * rays[:, :2])

    def reduced(self, times: int) -> "CameraModel":
        """Return the camera of pictures whose pixels are the means of squares of `times` by `times` pixels."""
        column, row = ((place + 0.5) / times - 0.5 for place in self.lens.middle_px)
        focals_px = self.lens.focal_px / times, self.lens.focal_down_px / times
        lens = Lens(*focals_px, (column, row), self.lens.coefficients, self.lens.is_fisheye)
        return self._replace(width_px=self.width_px // times, height_px=self.height_px // times, lens=lens)

    def plane_map(self, z_cm: float) -> Float32Array:
        """Return (height_px, width_px, 2) cm: the point `z_cm` above the floor that each pixel shows."""
        rows, columns = np.indices((self.height_px, self.width_px), float)
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        return self.back_project(pixels, z_cm).reshape(self.height_px, self.width_px, 2).astype(np.float32)


CORNERS = "the corners given"  # a calibration by which the floor is where the user says


class Geometry(NamedTuple):
    """The camera that took a film, where the floor is in its pictures, and how well both are known."""

    camera: CameraModel
    floor_cm: tuple[float, float]  # width and height, along y, of the floor
    calibration: str  # what the camera was determined from
    knows_floor: bool  # whether the floor's place in the picture is known, so that rings outside of it are left out
    error_cm: float = 0.0
    """Standard error of positions at the floor's corners, or relative to each other; 0 if it is not known."""
    tilt_deg: float = 0.0  # angle between the camera's axis and straight down
    background: Light | None = None  # constant light of the dark scene without rings
    ring_light: float = 0.0
    """Levels by which rings in the dark are usually brighter than their inside; 0 if it is not known."""
    ring_size: float = 1.0  # radius of the rings by the floor's corners, relative to an e-puck's; NaN if described


def overhead_camera(section: OverheadSection, width_cm: float, height_cm: float) -> CameraModel:
    """Return a scenario's camera above an arena's middle; raise EpuckSimError if walls or its lens allow no picture."""
    above_cm = section.height_cm or REFERENCE_HEIGHT_CM / REFERENCE_SIDE_CM * max(width_cm, height_cm)
    if above_cm <= 2 * WALL_HEIGHT_CM:
        allowed = f"more than {2 * WALL_HEIGHT_CM:g}, twice the walls' height"
        raise EpuckSimError(f"overhead.height_cm is {above_cm:g}; allowed: {allowed}")
    rotation, tilt, turn = LOOKING_DOWN, math.radians(section.tilt_deg), math.radians(section.turn_deg)
    if tilt or turn:
        lean = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
        spin = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
        rotation = lean @ LOOKING_DOWN @ spin
    position = np.array([width_cm / 2, height_cm / 2, 0.0]) + above_cm / rotation[2, 2] * rotation[2]
    lens = _lens(section, width_cm, height_cm, above_cm)
    return CameraModel(section.width_px, section.height_px, lens, rotation, position)


def _lens(section: OverheadSection, width_cm: float, height_cm: float, above_cm: float) -> Lens:
    """Return the lens with the given field of view, or else one that just shows floor and walls from straight above."""
    size = section.width_px, section.height_px
    if section.field_of_view_deg is not None:
        focals_px = [section.width_px / 2 / math.tan(math.radians(section.field_of_view_deg) / 2)]
    else:
        sides = zip(size, (width_cm, height_cm), strict=True)
        focals_px = [pixels * (above_cm - WALL_HEIGHT_CM) / (side_cm * MARGIN) for pixels, side_cm in sides]
    if section.lens == "fisheye":
        focals_px = [side / 2 / math.atan(side / 2 / focal) for side, focal in zip(size, focals_px, strict=False)]
        return simple_lens(*size, min(focals_px), is_fisheye=True)
    focal_px = min(focals_px)
    corner = math.hypot(*size) / 2 / focal_px
    lowest = -1 / (3 * (1.5 * corner) ** 2)  # r + k1 r^3 turns back where it is 2/3 of r
    if section.distortion <= lowest:
        said = f"{section.distortion:g}, which would fold the corners of a picture with this field of view"
        raise EpuckSimError(f"overhead.distortion is {said}; allowed: above {lowest:.3g}")
    return simple_lens(*size, focal_px, section.distortion)


View = dict[tuple[float, ...], FloatArray]
"""Corners of a board in a picture: (2,) px of each, by its place on the board, three coordinates in squares."""


class LensFile(BaseModel):
    """Contents of a lens file."""

    width_px: Annotated[WholeNumber, Field(ge=1)]
    height_px: Annotated[WholeNumber, Field(ge=1)]
    focal_px: Positive
    focal_down_px: Positive
    middle_px: tuple[float, float]
    coefficients: tuple[float, ...] = Field(min_length=4, max_length=14)
    is_fisheye: bool
    views: int = 0  # number of pictures that it was calibrated from
    error_px: float = 0.0  # root mean square distance of the board's corners from where this lens would show them
    digest: str = ""  # digest of the other fields; empty in files of version 0.1.0

    @property
    def lens(self) -> Lens:
        """The lens."""
        return Lens(self.focal_px, self.focal_down_px, self.middle_px, self.coefficients, self.is_fisheye)


def find_views(
    frames: Iterable[Frame], squares: tuple[int, int], is_charuco: bool, apart_s: float = APART_S
) -> list[View]:
    """Return different views of a board with `squares` across and down; search it in a frame every `apart_s`."""
    find = _charuco_corners if is_charuco else _checkerboard_corners
    views: list[View] = []
    last, last_s = View(), -np.inf
    for frame in frames:
        if frame.time_s - last_s < apart_s:
            continue
        last_s = frame.time_s
        view = find(np.asarray(cv2.cvtColor(frame.picture, cv2.COLOR_RGB2GRAY), np.uint8), squares)
        moves_px = [np.linalg.norm(view[place] - last[place]) for place in view.keys() & last.keys()]
        if view and (not moves_px or np.mean(moves_px) >= MIN_MOVE_PX):
            views.append(last := view)
        if len(views) >= MAX_VIEWS:
            break
    return views


def _checkerboard_corners(grey: Light, squares: tuple[int, int]) -> View:
    inner = squares[0] - 1, squares[1] - 1
    found, pixels = cv2.findChessboardCorners(grey, inner, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_FAST_CHECK)
    if not found:
        return {}
    pixels = cv2.cornerSubPix(grey, pixels, (5, 5), (-1, -1), SUBPIXEL)
    places = [(column, row, 0.0) for row in range(inner[1]) for column in range(inner[0])]
    return dict(zip(places, pixels.reshape(-1, 2), strict=True))


def _charuco_corners(grey: Light, squares: tuple[int, int]) -> View:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    pattern = cv2.aruco.CharucoBoard(squares, 1.0, MARKER_SHARE, dictionary)
    for is_legacy in (False, True):  # of OpenCV before 4.6, whose boards with even rows differ
        pattern.setLegacyPattern(is_legacy)
        pixels, numbers, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(grey)
        if numbers is not None and len(numbers) >= MIN_POINTS:
            places = np.asarray(pattern.getChessboardCorners())[np.ravel(numbers)].tolist()
            return dict(zip(map(tuple, places), np.asarray(pixels).reshape(-1, 2), strict=True))
    return {}


def calibrate_lens(name: str, views: list[View], size_px: tuple[int, int], is_fisheye: bool) -> LensFile:
    """Return the usual or fisheye lens fitted to views of a board; raise FilmError if they do not determine one."""
    if len(views) < MIN_VIEWS:
        said = f"the board is found in {len(views)} different positions; allowed: {MIN_VIEWS} or more"
        board = "--board (squares across and down, not corners), light it evenly, and show it everywhere and tilted"
        raise FilmError(f"{name}: {said}; check {board}")
    try:
        error, matrix, terms, errors_px = _fit_lens(views, size_px, is_fisheye)
        is_right = errors_px <= MAX_MISFIT * np.median(errors_px)
        if not is_right.all():
            views = list(compress(views, is_right))
            error, matrix, terms, _ = _fit_lens(views, size_px, is_fisheye)
        halves = [_fit_lens(views[first::2], size_px, is_fisheye)[1] for first in (0, 1)]
        if not all(abs(half[0, 0] / matrix[0, 0] - 1) <= UNSURE_FOCUS for half in halves):
            raise ValueError("half of the views give another lens")  # noqa: TRY301 is undetermined, too
        lens = Lens(matrix[0, 0], matrix[1, 1], matrix[:2, 2].tolist(), tuple(np.ravel(terms).tolist()), is_fisheye)
        told: dict[str, Any] = {"width_px": size_px[0], "height_px": size_px[1], **lens._asdict()}
        return LensFile(**told, views=len(views), error_px=error)
    except (cv2.error, ValueError) as failed:  # pydantic's are ValueErrors
        instead = "show it tilted, near and far, and in the corners"
        raise FilmError(f"{name}: the views of the board do not determine a lens; {instead}") from failed


def _fit_lens(
    views: list[View], size_px: tuple[int, int], is_fisheye: bool
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Return the root mean square error in px, the (3, 3) matrix and coefficients of a lens, and each view's error."""
    found: Any
    points = [np.array([*view], np.float32)[:, None] for view in views]
    pixels = [np.array([*view.values()], np.float32)[:, None] for view in views]
    if is_fisheye:
        flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
        points, pixels = ([each.astype(float).swapaxes(0, 1) for each in parts] for parts in (points, pixels))
        found = None, np.zeros((3, 3)), np.zeros((4, 1))
        for more in (EQUIDISTANT, cv2.CALIB_USE_INTRINSIC_GUESS):  # all at once, the fit of wide lenses fails
            found = cv2.fisheye.calibrate(points, pixels, size_px, found[1], found[2], flags=flags | more)
    else:
        found = cv2.calibrateCamera(points, pixels, size_px, np.eye(3), np.zeros(5))
    error, matrix, terms, turns, shifts = found
    show = cv2.fisheye.projectPoints if is_fisheye else cv2.projectPoints
    shown = [show(*view, matrix, terms)[0] for view in zip(points, turns, shifts, strict=True)]
    errors = [math.sqrt(np.mean((one - other) ** 2)) for one, other in zip(shown, pixels, strict=True)]
    return float(error), np.asarray(matrix, float), np.asarray(terms, float), np.array(errors)


def save_lens(path: Path, lens: LensFile) -> None:
    """Write the file of a lens; raise EpuckSimError where it cannot be written."""
    with atomic_write(path) as part:
        part.write_text(lens.model_copy(update={"digest": _digest(lens)}).model_dump_json(indent=2) + "\n")


def _digest(lens: LensFile) -> str:
    return hashlib.sha256(lens.model_dump_json(exclude={"digest"}).encode()).hexdigest()


def read_lens(path: Path, size_px: tuple[int, int]) -> Lens:
    """Return the lens in a file; raise FilmError if it holds none, or one for pictures of another width and height."""
    try:
        held = LensFile.model_validate_json(path.read_text())
    except FileNotFoundError as error:
        raise FilmError(f"{path}: no such file; epuck-sim calibrate writes one") from error
    except ValueError as error:
        raise FilmError(f"{path}: is not a lens that epuck-sim calibrate wrote") from error
    if held.digest and held.digest != _digest(held):
        raise FilmError(f"{path}: was changed since epuck-sim calibrate wrote it; calibrate again")
    if size_px != (held.width_px, held.height_px):
        said = f"for pictures of {held.width_px} x {held.height_px} px, but these are {size_px[0]} x {size_px[1]} px"
        raise FilmError(f"{path}: was calibrated {said}; calibrate in the camera mode that you film in")
    return held.lens
