"""Finds the lit rings in a picture of the overhead camera (thesis 4.3.1), by their light without the room's.

This light is rectified to a view from straight above. A matched filter on a coarse grid finds candidates. From the
brightest on, each candidate is a ring if a circle of the right size is lit nearly all round, is hollow, and does not
overlap the rings found before: robots may touch, but not overlap.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.overhead.camera import CameraModel, Frame, Light

# the light
LIT_LEVEL = 40  # least median level of a picture's darkest colour in a lit room: haze of rings is coloured
LIT_SAMPLES = 80  # pixels along the shorter side that show whether the room is lit
LEAST_LIGHT = 12  # least level of a pixel that shows light; noise in the dark hardly reaches it
RISE_PER_S = 10.0  # levels by which the background follows light that stays; a flash of half a second adds 5 of 255
SPARSE = 8  # distance of the pixels, across and down, that give the usual level of the background

# the view from above
COARSE_PER_CM = 2  # cells per cm of the coarse grid in which rings are searched; a ring is 14 cells wide
MAX_FINE_CELLS = 3  # fine cells along a coarse one, at most: 6 a cm locate a ring to a tenth of a millimetre
MAX_CELLS_PER_PIXEL = 4  # most fine cells, unless the coarse grid has more: oblique pixels show much of the plane
MAX_REACH_HEIGHTS = 2.0  # reach of the view from below the camera, in its heights; a visible horizon has no end
STRAY_CM = 0.5  # largest error when a point is projected and back; beyond the fold of a strong distortion it is larger

# candidates
MAX_CANDIDATES = 200  # number of brightest candidates that are examined in a picture
FILTER_WIDTH_CM = 0.45  # standard deviation of the matched filter across the ring, about 1 cm thick when overexposed
DARK_RADIUS_CM = 2.3  # radius of the dark inside of a ring in the matched filter
MIN_RELATIVE_LIGHT = 0.25  # light of a ring, relative to the brightest one; reflections on walls and floor are weaker
MIN_LEVEL_DARK = 8  # levels by which a ring in the dark is brighter than its inside, at its eight points
POINTS_SHARE = 0.25  # mean light along a ring, relative to that at its points: a short exposure is dark between them
MIN_LEVEL_LIT = 12  # levels by which a ring in a lit room is more coloured than its inside: its core is nearly white
CLOSE_CM = 1.5  # margin of the view around a candidate, which may be beside the centre of its ring
CORE_CM = 1.0  # width of gaps in the colour that are filled in a lit room, where a ring is white between colours

# the fit
BINS = 72  # directions in which a ring is examined: nine for each of its LEDs
LED_BINS = BINS // 8  # directions from one LED to the next, over which light is joined: short exposures show points
STEP_CM = 0.125  # distance of samples along a direction
REACH_CM = 6.0  # distance from the centre up to which a direction is sampled
INSIDE = 0.5  # share of the radius beyond which a ring's light is searched
OUTSIDE_CM = 1.0  # distance outside of the radius up to which a ring's light is searched
EDGE = 0.5  # level of the edge of a ring, between that of its inside (0) and its median brightness (1)
HALF_CM = 0.4  # distance from the inner edge of a ring to its crest, as a first estimate
ON_CM = 0.25  # largest distance from a circle of light that counts as on it
BEYOND_CM = (0.5, 1.2)  # distances outside of a circle between which the light of neighbours is measured
MIN_BETWEEN_LEDS = 0.35  # brightness of a ring between two LEDs, between that of its inside (0) and its median (1)
OUTLIER_CM = 0.25  # distance from the circle beyond which edges are left out of the fit
STEADY_CM = 0.02  # movement of the centre below which the fit ends
MAX_ROUNDS = 5  # rounds of the fit
MIN_CM, MAX_CM = 1.0, 4.2  # bounds of the radius while it is fitted
RIDGE = 1e-6  # weight that keeps the least squares solvable where few directions have an edge

# what is a ring
MIN_DISTANCE_CM = 0.88 * 2 * epuck.RADIUS_CM  # of two centres: robots touch at 2 radii; the scale may be off by a tenth
RADII = (0.75, 1.2)  # bounds of a ring's radius, relative to the true one: the scale is an estimate, lit rooms pale it
MAX_RELATIVE_RADIUS = 1.12  # radius relative to the mean of rings found before; six rings enclose a circle 1/6 larger
MAX_FLATTENING = 0.25  # of a ring, relative to its radius: the lens and the tilt are estimates, too
MAX_MISFIT_CM = 0.2  # root mean square distance of the light's inner edge from the circle; 0.04 cm in usual pictures
MIN_COVERED = 0.85  # share of the directions in which a ring is lit
MAX_INSIDE = 0.9  # light within half a ring's radius, relative to that on the ring; a webcam burns rings out
MAX_BEYOND = 0.85  # light outside of a ring, relative to that on it; around an unlit robot light grows outwards
MAX_BEYOND_LIT = 1.5  # the same in a lit room, where haze is coloured and cores are pale; grey things have no colour

# rings that are burnt out
SATURATED_LEVEL = 220  # level, without the background, of light that is burnt out in all colours
HOLE_CM = 2.0  # width of holes in a disc that are filled; the inside of a ring that is not burnt out is 5 cm wide
DISC_RADII_CM = (2.8, 9.0)  # bounds of the radius of rings that are burnt out to discs
DISC_LIGHT = 256.0  # light of such a ring: more than a picture's levels can show
_NEAR = np.ones((5, 5), np.uint8)

_ANGLES = np.arange(BINS) * (2 * np.pi / BINS)
_RADII = np.arange(round(REACH_CM / STEP_CM)) * STEP_CM
_ROUND = np.column_stack([np.ones(BINS), np.cos(_ANGLES), np.sin(_ANGLES)])
_DESIGN = np.column_stack([_ROUND, np.cos(2 * _ANGLES), np.sin(2 * _ANGLES)])
_ROWS = np.arange(BINS)
_FROM_LED_TO_LED = np.ones((LED_BINS, 1), np.uint8)


def is_lit(colours: Sequence[Light]) -> bool:
    """Return whether the room's lights are on, judged by the picture's middle; the table around may be black."""
    rows, columns = colours[0].shape
    step = max(min(rows, columns) // LIT_SAMPLES, 1)
    middle = np.s_[rows // 4 : rows - rows // 4 : step, columns // 4 : columns - columns // 4 : step]
    return median(np.minimum.reduce([colour[middle] for colour in colours])) >= LIT_LEVEL


def median(levels: npt.NDArray[np.uint8]) -> float:
    """Return the median of some levels, several times as fast as NumPy's function: bytes are sorted by radix."""
    ordered = np.sort(levels, axis=None, kind="stable")
    return (float(ordered[(levels.size - 1) // 2]) + float(ordered[levels.size // 2])) / 2


def ring_light(frame: Frame, times: int = 1) -> tuple[Light, bool]:
    """Return the light of rings in a picture, `reduced` so many times, and whether the room is lit.

    The light is the mean of the colours: a ring that burns out in one still has its shape in the others. In a lit room
    it is their difference: grey things are no rings.
    """
    colours = frame.colours
    red, green, blue = (reduced(colour, times) for colour in colours)
    if is_lit(colours):
        most, least = (combine(combine(red, green), blue) for combine in (cv2.max, cv2.min))
        return np.asarray(cv2.subtract(most, least), np.uint8), True
    mean = cv2.addWeighted(cv2.addWeighted(red, 1 / 2, green, 1 / 2, 0), 2 / 3, blue, 1 / 3, 0)
    return np.asarray(mean, np.uint8), False


def reduced(levels: Light, times: int) -> Light:
    """Return the means of levels in squares of `times` by `times` pixels; pixels that fill no square are left out."""
    if times == 1:
        return levels
    rows, columns = (side // times for side in levels.shape)
    whole = levels[: rows * times, : columns * times]
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)


def extent(is_lit: BoolArray, margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and the columns of a picture in which something is lit, with a margin on all sides."""
    column, row, columns, rows = cv2.boundingRect(is_lit.view(np.uint8))
    return slice(max(row - margin, 0), row + rows + margin), slice(max(column - margin, 0), column + columns + margin)


class Background:
    """Learns the background of the dark frames of a film: the least light of each pixel, which rises slowly.

    Light that goes off leaves the background at once; light that goes on joins it within half a minute.
    """

    def __init__(self, levels: Light | None = None, times: int = 1) -> None:
        """Begin with some levels, if they are known; times: how many pixels across and down are joined to one."""
        self._times = times
        self.levels = None if levels is None else reduced(levels, times)
        self._rise = self._last_s = 0.0

    def light_beyond(self, frame: Frame) -> tuple[Light, bool]:
        """Learn from the next frame; return the light of its rings without background, and whether the room is lit."""
        light, room_is_lit = ring_light(frame, self._times)
        if room_is_lit:
            return light, True
        levels = np.zeros_like(light) if self.levels is None else self.levels
        self._rise += RISE_PER_S * min(max(frame.time_s - self._last_s, 0.0), 1.0)
        self._last_s = frame.time_s
        whole = int(self._rise)
        self._rise -= whole
        raised = cv2.convertScaleAbs(levels, beta=whole) if whole else levels
        self.levels = np.asarray(cv2.min(raised, light), np.uint8)
        return np.asarray(cv2.subtract(light, self.levels), np.uint8), False

    def usual(self) -> float:
        """Return its median level, which is near the even light of a room; 0 if there is no background yet."""
        return 0.0 if self.levels is None else median(self.levels[::SPARSE, ::SPARSE])


def _least_squares(design: FloatArray) -> FloatArray:
    """Return the (terms, n) matrix that gives the least-squares terms of n values."""
    squares = design.T @ design + RIDGE * np.eye(design.shape[1])
    return np.asarray(np.linalg.solve(squares, design.T), np.float64)


_ROUND_FROM_ALL, _DESIGN_FROM_ALL = _least_squares(_ROUND), _least_squares(_DESIGN)


class Ring(NamedTuple):
    """Centre and radius of a lit ring: in cm in the arena's frame, and in px (column, row)."""

    x_cm: float
    y_cm: float
    radius_cm: float
    x_px: float
    y_px: float
    radius_px: float
    light: float = 0.0  # levels by which the ring is brighter than its inside


class Fit(NamedTuple):
    """A circle fitted to a ring of light."""

    column: float
    row: float  # its centre is in this row of the view
    radius_cm: float
    flattening: tuple[float, float]
    """Amplitude of the radius along twice the angle, cosine and sine, relative to the radius: 0 for a circle."""
    misfit_cm: float
    """Root mean square distance of the inner edge from the circle, without edges more than `OUTLIER_CM` off."""
    covered: float  # share of the directions in which there is light on the circle
    light: float  # median level on the circle, above that of its inside
    inside: float  # mean level within half the radius, relative to the median level on the circle
    beyond: float  # mean level outside of the circle, relative to that on the circle; both above the inside


class RingFinder:
    """Finds rings in the pictures of one camera."""

    def __init__(
        self, camera: CameraModel, usual_light: float = 0.0, *, sees_discs: bool = False, times: int = 1
    ) -> None:
        """Prepare what all pictures share; usual_light: levels by which dark rings exceed their inside, if known.

        If `sees_discs`, discs of saturated light are rings, too; the scale must be known. Rings are searched in light
        that is `reduced` so many times.
        """
        self.camera = camera
        self._sees_discs = sees_discs
        self._least_dark = max(MIN_LEVEL_DARK, MIN_RELATIVE_LIGHT * usual_light)
        self.view = RectifiedView(camera.reduced(times))

    def find(self, levels: Light, *, room_is_lit: bool = False) -> list[Ring]:
        """Return the lit rings in the light of a picture, see `ring_light`, from left to right."""
        fits = self.fits(levels, room_is_lit=room_is_lit)
        if not fits:
            return []
        centres = self.view.centres_cm(fits)
        around = np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        radii = np.array([fit.radius_cm for fit in fits])
        points = (centres[:, None] + radii[:, None, None] * around).reshape(-1, 3)
        pixels = self.camera.project(points).reshape(-1, 5, 2)
        radii_px = np.linalg.norm(pixels[:, 1:] - pixels[:, :1], axis=2).mean(axis=1)
        table = np.column_stack([centres[:, :2], radii, pixels[:, 0], radii_px, [fit.light for fit in fits]])
        return [Ring(*row) for row in table[np.lexsort((table[:, 4], table[:, 3]))].tolist()]

    def fits(self, levels: Light, *, room_is_lit: bool = False) -> list[Fit]:
        """Return circles fitted to the rings in the light of a picture, in its rectified view, brightest first."""
        least = float(MIN_LEVEL_LIT) if room_is_lit else self._least_dark
        if cv2.minMaxLoc(levels)[1] < least:
            return []
        gaps_cm, most_beyond = (CORE_CM, MAX_BEYOND_LIT) if room_is_lit else (0.0, MAX_BEYOND)
        cells = self.view.cells_per_cm
        candidates, mean_least = self.view.candidates(levels, gaps_cm, least if room_is_lit else POINTS_SHARE * least)
        fits: list[Fit] = []
        for column, row in candidates:
            if _is_free(column, row, fits, cells):
                view, left, low = self.view.around(levels, column, row, gaps_cm)
                fit = fit_ring(view, cells, column - left, row - low, max(least, mean_least))
                fit = fit and fit._replace(column=fit.column + left, row=fit.row + low)
                if fit is not None and _is_ring(fit, most_beyond, fits, cells):
                    fits.append(fit)
        return fits + self._discs(levels, fits) if self._sees_discs and not room_is_lit else fits

    def _discs(self, levels: Light, found: list[Fit]) -> list[Fit]:
        """Return further rings that are burnt out to discs: middles of saturated light, widest first."""
        if cv2.minMaxLoc(levels)[1] < SATURATED_LEVEL:
            return []
        cells = self.view.cells_per_cm
        saturated = _close_gaps(np.asarray(self.view.sample(levels) >= SATURATED_LEVEL, np.uint8), HOLE_CM * cells)
        if np.count_nonzero(saturated) < math.pi * (DISC_RADII_CM[0] * cells) ** 2:
            return []
        within = np.asarray(cv2.distanceTransform(saturated, cv2.DIST_L2, 5), np.float32) / cells
        rows, columns = np.nonzero((within >= cv2.dilate(within, _NEAR)) & (within >= DISC_RADII_CM[0]))
        discs: list[Fit] = []
        for index in np.argsort(-within[rows, columns], kind="stable"):
            column, row = float(columns[index]), float(rows[index])
            if within[rows[index], columns[index]] <= DISC_RADII_CM[1] and _is_free(column, row, found + discs, cells):
                discs.append(Fit(column, row, epuck.RING_RADIUS_CM, (0.0, 0.0), 0.0, 1.0, DISC_LIGHT, 1.0, 0.0))
        return discs


def searched(camera: CameraModel) -> str:
    """Return words about the rings that are searched in the middle of a camera's pictures."""
    radius_px = epuck.RING_RADIUS_CM * camera.lens.focal_px / (camera.position_cm[2] - epuck.RING_HEIGHT_CM)
    return f"{RADII[0] * radius_px:.0f} to {RADII[1] * radius_px:.0f} px in radius, lit up to half of it wide"


def _is_ring(fit: Fit, most_beyond: float, found: list[Fit], cells_per_cm: int) -> bool:
    """Return whether a fit is a ring that is apart from those found, and not the space that they enclose."""
    usual_cm = np.mean([other.radius_cm for other in found]) if found else math.inf
    return bool(
        RADII[0] <= fit.radius_cm / epuck.RING_RADIUS_CM <= RADII[1]
        and fit.radius_cm <= MAX_RELATIVE_RADIUS * usual_cm
        and fit.misfit_cm <= MAX_MISFIT_CM
        and math.hypot(*fit.flattening) <= MAX_FLATTENING
        and fit.inside <= MAX_INSIDE
        and fit.beyond <= most_beyond
        and fit.covered >= MIN_COVERED
        and _is_free(fit.column, fit.row, found, cells_per_cm)
    )


def _is_free(column: float, row: float, found: list[Fit], cells_per_cm: int) -> bool:
    distance = MIN_DISTANCE_CM * cells_per_cm
    return all((column - other.column) ** 2 + (row - other.row) ** 2 >= distance * distance for other in found)


def _ring_filter() -> Float32Array:
    """Return the matched filter on the coarse grid: mean light on the circle minus mean light inside."""
    half = round((epuck.RING_RADIUS_CM + 2 * FILTER_WIDTH_CM) * COARSE_PER_CM)
    offsets = np.arange(-half, half + 1) / COARSE_PER_CM
    radius = np.hypot(offsets[:, None], offsets)
    ring = np.exp(-(((radius - epuck.RING_RADIUS_CM) / FILTER_WIDTH_CM) ** 2) / 2)
    inner = (radius <= DARK_RADIUS_CM).astype(float)
    return np.asarray(ring / ring.sum() - inner / inner.sum(), np.float32)


_RING_FILTER = _ring_filter()
_WITHIN_1_CM = np.ones((2 * COARSE_PER_CM + 1, 2 * COARSE_PER_CM + 1), np.uint8)


def _close_gaps(view: Light, width: float) -> Light:
    """Fill dark gaps and dots up to `width` cells wide (morphological closing)."""
    size = round(width) // 2 * 2 + 1
    if size == 1:
        return view
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.morphologyEx(view, cv2.MORPH_CLOSE, disc), np.uint8)


class RectifiedView:
    """The plane of the rings, as far as a camera sees it, from straight above: square cells along the arena's axes."""

    def __init__(self, camera: CameraModel) -> None:
        above_cm, below = camera.position_cm[2] - epuck.RING_HEIGHT_CM, camera.position_cm[:2]
        edge, reach = np.linspace(0, 1, 33), MAX_REACH_HEIGHTS * above_cm
        border = np.concatenate([np.column_stack([edge, np.full(33, end)]) for end in (0.0, 1.0)])
        border = np.concatenate([border, border[:, ::-1]]) * (camera.width_px - 1, camera.height_px - 1)
        shown = camera.back_project(border, epuck.RING_HEIGHT_CM)  # the extent of the plane that the picture shows
        low, high = np.clip([shown.min(axis=0), shown.max(axis=0)], below - reach, below + reach)
        densest = math.sqrt(MAX_CELLS_PER_PIXEL * camera.width_px * camera.height_px / np.prod(high - low))
        cells = min(max(round(min(camera.lens.focal_px / above_cm, densest) / COARSE_PER_CM), 1), MAX_FINE_CELLS)
        self.cells_per_cm, self.origin_cm = cells * COARSE_PER_CM, low  # middle of row 0, the lowest, and column 0
        columns, rows = (np.ceil((high - low) * COARSE_PER_CM).astype(int) + 2).tolist()  # one more all round
        coarse = _map_of_plane(camera, low - (1 + 1 / cells) / (2 * COARSE_PER_CM), columns, rows)
        fine = np.asarray(cv2.resize(coarse, None, fx=cells, fy=cells))  # linear: lenses bend little within 5 mm
        self._fine = _fixed_point_map(fine[cells:-cells, cells:-cells])
        self._coarse = _fixed_point_map(coarse[1:-1, 1:-1])
        self._smooth_px = max(2 * round((camera.lens.focal_px / above_cm / COARSE_PER_CM - 1) / 2) + 1, 1)

    def sample(self, light: Light, part: tuple[slice, slice] = np.s_[:, :]) -> Light:
        """Return (rows, columns) the view, or a part of it, of one channel of a picture, (height_px, width_px)."""
        pixels, fractions = self._fine
        return np.asarray(cv2.remap(light, pixels[part], fractions[part], cv2.INTER_LINEAR), np.uint8)

    def around(self, light: Light, column: float, row: float, gaps_cm: float) -> tuple[Light, int, int]:
        """Return the part of the view that a ring around a cell is fitted to, and its first column and row."""
        half = math.ceil((REACH_CM + CLOSE_CM) * self.cells_per_cm)
        left, low = max(int(column) - half, 0), max(int(row) - half, 0)
        part = slice(low, int(row) + half), slice(left, int(column) + half)
        return _close_gaps(self.sample(light, part), gaps_cm * self.cells_per_cm), left, low

    def candidates(self, light: Light, gaps_cm: float, least: float) -> tuple[FloatArray, float]:
        """Return (n, 2) columns and rows of candidates, the brightest first, and the least light that they may have.

        The light of a ring is the mean on it less the mean inside: at least `least`, and not dim beside the brightest.
        """
        smooth = cv2.blur(light, (self._smooth_px, self._smooth_px))
        coarse = np.asarray(cv2.remap(smooth, *self._coarse, cv2.INTER_LINEAR), np.uint8)
        coarse = _close_gaps(coarse, gaps_cm * COARSE_PER_CM)
        part = extent(coarse >= least, len(_RING_FILTER) - 1)  # at its edges the response is not right
        response = np.asarray(cv2.filter2D(coarse[part].astype(np.float32), cv2.CV_32F, _RING_FILTER))
        least = max(least, MIN_RELATIVE_LIGHT * float(response.max()))
        rows, columns = np.nonzero((response >= cv2.dilate(response, _WITHIN_1_CM)) & (response >= least))
        order = np.argsort(-response[rows, columns], kind="stable")[:MAX_CANDIDATES]
        cells = self.cells_per_cm // COARSE_PER_CM
        places = np.column_stack([columns[order] + part[1].start, rows[order] + part[0].start])
        return places * cells + (cells - 1) / 2, least

    def centres_cm(self, fits: list[Fit]) -> FloatArray:
        """Return (fits, 3) cm: the centres of rings in the arena's frame."""
        cells = np.array([(fit.column, fit.row) for fit in fits])
        return np.column_stack([self.origin_cm + cells / self.cells_per_cm, np.full(len(fits), epuck.RING_HEIGHT_CM)])


def _map_of_plane(camera: CameraModel, first_cm: FloatArray, columns: int, rows: int) -> Float32Array:
    """Return (rows, columns, 3) where the picture shows the coarse grid whose first cell is at (2,) cm.

    That is column and row, and 1 where the pixel there shows another place, as beyond the fold of a lens's distortion.
    """
    corner = np.append(first_cm, epuck.RING_HEIGHT_CM) - camera.position_cm
    to_camera = camera.rotation @ np.column_stack([*np.eye(3)[:2] / COARSE_PER_CM, corner])
    fill = cv2.fisheye.initUndistortRectifyMap if camera.lens.is_fisheye else cv2.initUndistortRectifyMap
    grid, coefficients = np.linalg.inv(to_camera), np.array(camera.lens.coefficients)
    shown = fill(camera.lens.matrix, coefficients, np.eye(3), grid, (columns, rows), cv2.CV_32FC1)
    pixels = np.dstack(shown).astype(float)
    stray = np.zeros((rows, columns), bool)
    if camera.lens.is_fisheye or any(camera.lens.coefficients):
        back = camera.back_project(pixels.reshape(-1, 2), epuck.RING_HEIGHT_CM).reshape(rows, columns, 2)
        cells = np.dstack(np.meshgrid(np.arange(columns), np.arange(rows)))
        stray = np.abs(back - first_cm - cells / COARSE_PER_CM).max(axis=2) > STRAY_CM
    return np.dstack([pixels, stray]).astype(np.float32)


def _fixed_point_map(cells: npt.NDArray[Any]) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]:
    """Return OpenCV's map, whole pixels and fractions, from (rows, columns, 3) cells; see `_map_of_plane`."""
    at_column, at_row = np.moveaxis(np.where(cells[..., 2:] > 0, -10, cells[..., :2]), -1, 0)  # outside: no light
    whole, fractions = cv2.convertMaps(at_column.astype(np.float32), at_row.astype(np.float32), cv2.CV_16SC2)
    return np.asarray(whole, np.int16), np.asarray(fractions, np.uint16)


def fit_ring(view: Light, cells_per_cm: int, column: float, row: float, least: float) -> Fit | None:
    """Fit a circle to a ring whose centre is within about 1 cm of a cell of the view.

    If the centre is off by (dx, dy), the inner edge of the light is at r(theta) = R + dx cos(theta) + dy sin(theta),
    plus two terms of twice the angle. They are fitted by least squares over `BINS` directions, again and again from the
    new centre. The inner edge is used, because other rings that touch the ring shine outside of it. The result is None
    if half of the ring is missing, or if its median level is not `least` above its inside.
    """
    radius = epuck.RING_RADIUS_CM
    for _ in range(MAX_ROUNDS):
        profile, joined = _polar(view, cells_per_cm, column, row)
        ring = slice(math.ceil(INSIDE * radius / STEP_CM), math.floor((radius + OUTSIDE_CM) / STEP_CM) + 1)
        inside = cv2.mean(profile[:, : math.floor(max(radius / 2, STEP_CM) / STEP_CM) + 1])[0]
        bright = median(joined[:, ring].max(axis=1))
        if bright - inside < least:
            return None
        edge, has = _edge(joined[:, ring], inside + EDGE * (bright - inside))
        if np.count_nonzero(has) <= BINS / 2:
            return None
        shape, off = _circle(edge + _RADII[ring][0], has)
        column, row = column + float(shape[1]) * cells_per_cm, row + float(shape[2]) * cells_per_cm
        radius = float(shape[0]) + HALF_CM
        if not MIN_CM < radius < MAX_CM:
            return None
        if math.hypot(shape[1], shape[2]) < STEADY_CM:
            break
    outline = _outline(profile, _DESIGN @ shape + HALF_CM, inside + EDGE / 2 * (bright - inside))
    radius = float(outline[0])
    if not MIN_CM < radius < MAX_CM:
        return None
    is_on = slice(math.ceil((radius - ON_CM) / STEP_CM), math.floor((radius + ON_CM) / STEP_CM) + 1)
    on = joined[:, is_on].max(axis=1)
    bright = median(on)
    if bright - inside < least:
        return None
    near = off[off <= OUTLIER_CM]
    first, last = ((radius + beyond_cm) / STEP_CM for beyond_cm in BEYOND_CM)
    crest, beyond = (
        cv2.mean(profile[:, part])[0] - inside for part in (is_on, slice(math.ceil(first), math.floor(last) + 1))
    )
    return Fit(
        column,
        row,
        radius,
        flattening=(float(outline[3] / radius), float(outline[4] / radius)),
        misfit_cm=math.sqrt(near @ near / len(near)) if len(near) else math.inf,
        covered=np.count_nonzero((on - inside >= MIN_BETWEEN_LEDS * (bright - inside)) & ~(off > OUTLIER_CM)) / BINS,
        light=bright - inside,
        inside=inside / bright,
        beyond=beyond / max(crest, 1e-9),
    )


def _polar(view: Light, cells_per_cm: int, column: float, row: float) -> tuple[Light, Light]:
    """Return (BINS, radii) the light along each direction from a cell; and the same, filled from LED to LED."""
    flags = cv2.INTER_LINEAR | cv2.WARP_POLAR_LINEAR | cv2.WARP_FILL_OUTLIERS
    profile = cv2.warpPolar(view, (len(_RADII), BINS), (column, row), REACH_CM * cells_per_cm, flags)
    around = cv2.copyMakeBorder(profile, LED_BINS, LED_BINS, 0, 0, cv2.BORDER_WRAP)
    joined = cv2.morphologyEx(around, cv2.MORPH_CLOSE, _FROM_LED_TO_LED)
    return np.asarray(profile, np.uint8), np.asarray(joined[LED_BINS:-LED_BINS], np.uint8)


def _edge(profile: Light, level: float) -> tuple[FloatArray, BoolArray]:
    """Return (BINS,) cm from the first sample to where (BINS, n) samples reach a level; and whether they reach it."""
    first = (profile >= level).argmax(axis=1)
    after = profile[_ROWS, first].astype(np.float64)
    before = profile[_ROWS, np.maximum(first - 1, 0)]
    back = np.where(after > before, (after - level) / np.maximum(after - before, 1), 0.0)
    return STEP_CM * (first - back), after >= level


def _circle(edge: FloatArray, has: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Fit a circle, and then a flattened one, to the (BINS,) distances of the edge in the directions that have one.

    Return (5,) cm: radius, centre, and amplitudes along twice the angle; (BINS,) cm: distance of the edge, or NaN.
    """
    near = has
    for terms, from_all in ((_ROUND, _ROUND_FROM_ALL), (_DESIGN, _DESIGN_FROM_ALL)):
        shape = from_all @ edge if near.all() else _least_squares(terms[near]) @ edge[near]
        off = np.abs(edge - terms @ shape)
        near = has & (off <= OUTLIER_CM)
        if 2 * np.count_nonzero(near) < np.count_nonzero(has):
            near = has & (off <= np.median(off[has]))
    return shape, np.where(has, off, np.nan)


def _outline(profile: Light, expected: FloatArray, level: float) -> FloatArray:
    """Fit the middle of the light itself, mostly at the LEDs: light with joined gaps would be less flattened.

    It is near the (BINS,) expected distances; light below the level does not count. Return (5,) cm as `_circle`.
    """
    away = _RADII - expected[:, None]
    weights = np.where(np.abs(away) <= OUTSIDE_CM, np.maximum(profile - level, 0.0), 0.0)
    total = weights.sum(axis=1)
    middles = expected + (weights * away).sum(axis=1) / np.maximum(total, RIDGE)
    design = _DESIGN * total[:, None]
    return np.asarray(np.linalg.solve(_DESIGN.T @ design + RIDGE * np.eye(5), design.T @ middles))
