"""An arena with a camera above it, its pictures of rings, rooms and boards, and what tests ask of them."""

import math
from functools import cache
from typing import Any

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import FloatArray
from epuck_sim.geometry import box_corners
from epuck_sim.overhead.camera import CameraModel, Frame, Picture, overhead_camera
from epuck_sim.overhead.render import ExposureSample, Renderer
from epuck_sim.overhead.rings import Ring, RingFinder, ring_light
from epuck_sim.scenario.arena import OverheadSection
from tests.overhead import webcam

CLEAN = {"noise_levels": 0, "vignetting": 0, "bloom": 0, "blur_px": 0}
"""Settings of a camera that is a pinhole with a radial distortion, and no more."""
ARENA = make_arena(60, 60, [(45, 45, 4)], [box_corners(15, 45, 8, 5, 0.4)])
EMPTY = make_arena(60, 60, [], [])
FLOOR = np.array([(0, 0, 0), (60, 0, 0), (60, 60, 0), (0, 60, 0)], float)
AT_RINGS = np.array([(x, y, epuck.RING_HEIGHT_CM) for x in (4.0, 30.0, 56.0) for y in (4.0, 30.0, 56.0)])
APART_CM = 2 * epuck.RADIUS_CM
PARTS = 10  # moments of an exposure


def camera_of(side_cm: float = 60.0, **settings: Any) -> CameraModel:
    return overhead_camera(OverheadSection(**settings), side_cm, side_cm)


def make_renderer(arena: Arena = ARENA, seed: int = 0, **settings: Any) -> tuple[CameraModel, Renderer]:
    section = OverheadSection(**settings)
    camera = overhead_camera(section, arena.width_cm, arena.height_cm)
    return camera, Renderer(section, camera, arena, seed)


def standing(*poses: tuple[float, float, float], lit: bool = True) -> list[ExposureSample]:
    """Return the one instant of an exposure in which robots stand still, with all rings on or off."""
    return [ExposureSample(np.array(poses, float).reshape(-1, 3), np.full(len(poses), lit))]


def shot(
    *poses: tuple[float, float, float], arena: Arena = ARENA, room: bool = False, lit: bool = True, **settings: Any
) -> tuple[CameraModel, Picture]:
    """Return a camera without faults but those given, and its picture of robots, in the dark or in a lit room."""
    camera, renderer = make_renderer(arena, **CLEAN | settings)
    return camera, painted(renderer, standing(*poses, lit=lit), room)


def painted(renderer: Renderer, samples: list[ExposureSample], room: bool) -> Picture:
    return Frame(0.0, colours=renderer.render(samples, room_is_lit=room)).picture


@cache
def empty_arena(**settings: Any) -> tuple[RingFinder, Renderer]:
    """Return what finds rings by a camera, and what draws its pictures, each with other noise, without obstacles."""
    camera, renderer = make_renderer(EMPTY, **settings)
    return RingFinder(camera), renderer


def picture_of(
    centres_cm: Any, *, room: bool = False, lit: bool = True, shares: Any = 1.0, quality: int = 0, **settings: Any
) -> Picture:
    """Return a picture of robots at (n, 2) cm, whose rings are lit for shares of the exposure; quality: of a JPEG."""
    places = np.reshape(centres_cm, (-1, 2))
    poses = np.column_stack([places, np.random.default_rng(0).uniform(0, math.tau, len(places))])
    on = np.broadcast_to(lit * np.asarray(shares, float), len(poses)) * PARTS
    samples = [ExposureSample(poses, part < on) for part in range(PARTS)]
    picture = painted(empty_arena(**settings)[1], samples, room)
    return webcam.sent(picture, quality) if quality else picture


def rings_in(picture: Picture, **settings: Any) -> list[Ring]:
    levels, room_is_lit = ring_light(Frame(0.0, picture))
    return empty_arena(**settings)[0].find(levels, room_is_lit=room_is_lit)


def touching(count: int, generator: np.random.Generator) -> FloatArray:
    """Return (count, 2) cm: robots that each touch another one, half of them in the directions of a honeycomb."""
    placed = [np.array([30.0, 30.0])]
    while len(placed) < count:
        honeycomb = 0.2 + math.pi / 3 * generator.integers(6)
        angle = honeycomb if generator.random() < 0.5 else generator.uniform(0, math.tau)
        place = placed[generator.integers(len(placed))] + APART_CM * np.array([math.cos(angle), math.sin(angle)])
        is_in = (place > epuck.RADIUS_CM).all() and (place < 60.0 - epuck.RADIUS_CM).all()
        if is_in and all(np.hypot(*(place - other)) >= APART_CM - 1e-6 for other in placed):
            placed.append(place)
    return np.array(placed)


def honeycomb_cell(turn: float = 0.3) -> FloatArray:
    """Return (6, 2) cm: the robots that touch one in the arena's middle all round."""
    angles = turn + math.tau / 6 * np.arange(6)
    cell: FloatArray = 30.0 + APART_CM * np.column_stack([np.cos(angles), np.sin(angles)])
    return cell


def scattered(count: int, generator: np.random.Generator) -> FloatArray:
    """Return (count, 2) cm: robots at random that do not overlap."""
    return np.asarray(webcam.scattered(count, APART_CM, (60.0, 60.0), epuck.RADIUS_CM, generator))


def worst_cm(found: CameraModel, true: CameraModel) -> float:
    """Return how far rings in an arena of 60 cm are misplaced by a camera that was found, at most."""
    back = found.back_project(true.project(AT_RINGS), epuck.RING_HEIGHT_CM)
    return float(np.hypot(*(back - AT_RINGS[:, :2]).T).max())


def floor_corners(camera: CameraModel) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in camera.project(FLOOR).tolist())


def pixel_at(camera: CameraModel, x_cm: float, y_cm: float, z_cm: float = 0.0) -> tuple[int, int]:
    column, row = np.rint(camera.project(np.array([[x_cm, y_cm, z_cm]]))[0]).astype(int)
    return int(row), int(column)


SQUARE_PX = 60


def checkerboard(columns, rows):
    """Return a picture of a board of squares, white around it."""
    cells = np.indices((rows, columns)).sum(axis=0) % 2
    board = np.kron(np.where(cells, 255, 20), np.ones((SQUARE_PX, SQUARE_PX))).astype(np.uint8)
    return np.pad(board, SQUARE_PX, constant_values=255)


def charuco(columns, rows, is_legacy=False):
    """Return a picture of a ChArUco board, white around it; with an even number of rows, OpenCV's before 4.6 differ."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((columns, rows), 1.0, 0.7, dictionary)
    board.setLegacyPattern(is_legacy)
    drawn = board.generateImage((columns * SQUARE_PX, rows * SQUARE_PX))
    return np.pad(drawn, SQUARE_PX, constant_values=255)


def show(board, rays, size, seed):
    """Return a grey picture of a board somewhere before the camera, pixel by pixel through the lens."""
    generator = np.random.default_rng(seed)
    turn = cv2.Rodrigues(generator.uniform(-0.45, 0.45, 3))[0]
    middle = np.array([*generator.uniform(-0.25, 0.25, 2), 1.0]) * generator.uniform(10, 15)
    normal = turn[:, 2]
    points = rays * (middle @ normal / (normal @ rays)) - middle[:, None]
    on_board = turn[:, :2].T @ points
    half = np.array(board.shape[::-1]) / 2
    x, y = (on_board * SQUARE_PX + half[:, None]).astype(np.float32).reshape(2, size[1], size[0])
    shown = cv2.remap(board, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=90)
    return cv2.GaussianBlur(shown, (0, 0), 0.8)


def film_of(board, matrix, coefficients, is_fisheye=False, size=(640, 480), views=14):
    """Yield frames, a second apart, of a board that is moved."""
    columns, rows = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).reshape(-1, 1, 2)
    straighten = cv2.fisheye.undistortPoints if is_fisheye else cv2.undistortPoints
    rays = np.vstack([straighten(pixels, matrix, coefficients).reshape(-1, 2).T, np.ones(len(pixels))])
    for seed in range(views):
        grey = show(board, rays, size, seed)
        yield Frame(float(seed), np.repeat(grey[..., None], 3, axis=2))


def lens_matrix(focal_px, size=(640, 480)):
    return np.array([[focal_px, 0, size[0] / 2 + 6], [0, focal_px * 1.01, size[1] / 2 - 4], [0, 0, 1]])
