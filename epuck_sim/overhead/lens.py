"""Calibrates a lens from pictures of a board, and keeps it in a file that `track` and `film` take."""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import cv2
import numpy as np
from pydantic import BaseModel, Field

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import Frame, Lens, Light
from epuck_sim.scenario.base import Positive, WholeNumber
from epuck_sim.util.atomic_write import atomic_write

APART_S = 0.5  # time between frames in which the board is searched

MIN_VIEWS = 6  # pictures of the board from which a lens is calibrated; OpenCV recommends ten or more
MAX_VIEWS = 40  # pictures of the board after which no more are read
MIN_POINTS = 8  # corners of a board that must be seen in a picture
MIN_MOVE_PX = 8.0  # mean distance by which the board must have moved since the last picture that counts
SUBPIXEL = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)  # iterations, px: end corners' refinement
MARKER_SHARE = 0.7  # side of a ChArUco board's markers, relative to that of its squares
UNSURE_FOCUS = 0.03
"""Relative difference of the focal lengths by half of the views and by all from which they do not determine a lens:
seen straight on, or always askew in the same way, a board nearby looks as one farther away through a longer lens."""


class Board(NamedTuple):
    """A board, and its number of squares across and down."""

    kind: Literal["checkerboard", "charuco"]
    columns: int
    rows: int


View = dict[tuple[float, ...], FloatArray]
"""Where a picture shows the corners of a board: (2,) px of each place on it, whose three coordinates are in squares."""


class LensFile(BaseModel):
    """What the file holds."""

    width_px: Annotated[WholeNumber, Field(ge=1)]
    height_px: Annotated[WholeNumber, Field(ge=1)]
    focal_px: Positive
    focal_down_px: Positive
    middle_px: tuple[float, float]
    coefficients: tuple[float, ...] = Field(min_length=4, max_length=14)
    is_fisheye: bool
    views: int = 0
    """Number of pictures that it was calibrated from."""
    error_px: float = 0.0
    """Root mean square distance of the board's corners from where this lens would show them."""
    digest: str = ""
    """That of all the rest; empty in files of version 0.1.0."""

    @property
    def lens(self) -> Lens:
        """The lens."""
        return Lens(self.focal_px, self.focal_down_px, self.middle_px, self.coefficients, self.is_fisheye)


def find_views(frames: Iterable[Frame], board: Board, apart_s: float = APART_S) -> list[View]:
    """Return views of a board in a film in which it, or the camera, moves; it is searched every `apart_s`."""
    find = _charuco_corners if board.kind == "charuco" else _checkerboard_corners
    views: list[View] = []
    last_s = -np.inf
    for frame in frames:
        if frame.time_s - last_s < apart_s:
            continue
        last_s = frame.time_s
        view = find(np.asarray(cv2.cvtColor(frame.picture, cv2.COLOR_RGB2GRAY), np.uint8), board)
        if view and (not views or _has_moved(view, views[-1])):
            views.append(view)
        if len(views) >= MAX_VIEWS:
            break
    return views


def _has_moved(view: View, last: View) -> bool:
    moves = [float(np.linalg.norm(view[place] - last[place])) for place in view.keys() & last.keys()]
    return not moves or sum(moves) / len(moves) >= MIN_MOVE_PX


def _checkerboard_corners(grey: Light, board: Board) -> View:
    inner = board.columns - 1, board.rows - 1
    found, pixels = cv2.findChessboardCorners(grey, inner, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_FAST_CHECK)
    if not found:
        return {}
    pixels = cv2.cornerSubPix(grey, pixels, (5, 5), (-1, -1), SUBPIXEL)
    places = [(column, row, 0.0) for row in range(inner[1]) for column in range(inner[0])]
    return dict(zip(places, pixels.reshape(-1, 2), strict=True))


def _charuco_corners(grey: Light, board: Board) -> View:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), 1.0, MARKER_SHARE, dictionary)
    pixels, numbers, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(grey)
    if numbers is None or len(numbers) < MIN_POINTS:
        return {}
    places = np.asarray(pattern.getChessboardCorners())[np.ravel(numbers)].tolist()
    return dict(zip(map(tuple, places), np.asarray(pixels).reshape(-1, 2), strict=True))


def calibrate_lens(name: str, views: list[View], size_px: tuple[int, int], is_fisheye: bool) -> LensFile:
    """Return the lens, by OpenCV's usual or fisheye model, that shows a board as its views in a film have it.

    Raises:
        FilmError: There are too few views, or they do not determine a lens.
    """
    if len(views) < MIN_VIEWS:
        raise FilmError(
            f"{name}: the board is found in {len(views)} different positions; allowed: {MIN_VIEWS} or more; check "
            "--board (squares across and down), light it evenly, and show it in all parts of the picture and tilted"
        )
    try:
        error, matrix, terms = _fit_lens(views, size_px, is_fisheye)
        halves = [_fit_lens(views[first::2], size_px, is_fisheye)[1] for first in (0, 1)]
        if not all(abs(half[0, 0] / matrix[0, 0] - 1) <= UNSURE_FOCUS for half in halves):
            raise ValueError("half of the views give another lens")  # noqa: TRY301 is undetermined, too
        return LensFile(
            width_px=size_px[0],
            height_px=size_px[1],
            focal_px=matrix[0, 0],
            focal_down_px=matrix[1, 1],
            middle_px=matrix[:2, 2].tolist(),
            coefficients=np.ravel(terms).tolist(),
            is_fisheye=is_fisheye,
            views=len(views),
            error_px=error,
        )
    except (cv2.error, ValueError) as failed:  # pydantic's are ValueErrors
        raise FilmError(
            f"{name}: the views of the board do not determine a lens; show it tilted, near and far, and in the corners"
        ) from failed


def _fit_lens(views: list[View], size_px: tuple[int, int], is_fisheye: bool) -> tuple[float, FloatArray, FloatArray]:
    """Return the root mean square error in px, the (3, 3) camera matrix and the coefficients of a lens."""
    points = [np.array([*view], np.float32)[:, None] for view in views]
    pixels = [np.array([*view.values()], np.float32)[:, None] for view in views]
    if is_fisheye:
        flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
        places, seen = ([each.astype(float).swapaxes(0, 1) for each in parts] for parts in (points, pixels))
        found = cv2.fisheye.calibrate(places, seen, size_px, np.zeros((3, 3)), np.zeros((4, 1)), flags=flags)
    else:
        found = cv2.calibrateCamera(points, pixels, size_px, np.eye(3), np.zeros(5))
    error, matrix, terms, *_ = found
    return float(error), np.asarray(matrix, float), np.asarray(terms, float)


def save_lens(path: Path, lens: LensFile) -> None:
    """Write the file of a lens; raise EpuckSimError where it cannot be written."""
    with atomic_write(path) as part:
        part.write_text(lens.model_copy(update={"digest": _digest(lens)}).model_dump_json(indent=2) + "\n")


def _digest(lens: LensFile) -> str:
    return hashlib.sha256(lens.model_dump_json(exclude={"digest"}).encode()).hexdigest()


def read_lens(path: Path, size_px: tuple[int, int]) -> Lens:
    """Return the lens in a file for pictures of this width and height.

    Raises:
        FilmError: It is no file of a lens, or of a camera with pictures of another size.
    """
    try:
        held = LensFile.model_validate_json(path.read_text())
    except FileNotFoundError as error:
        raise FilmError(f"{path}: no such file; epuck-sim calibrate writes one") from error
    except ValueError as error:
        raise FilmError(f"{path}: is not a lens that epuck-sim calibrate wrote") from error
    if held.digest and held.digest != _digest(held):
        raise FilmError(f"{path}: was changed since epuck-sim calibrate wrote it; calibrate again")
    if size_px != (held.width_px, held.height_px):
        raise FilmError(
            f"{path}: was calibrated for pictures of {held.width_px} x {held.height_px} px, but these are "
            f"{size_px[0]} x {size_px[1]} px; calibrate with the camera's mode that films"
        )
    return held.lens
