"""Pictures of lit rings, drawn pixel by pixel from the geometry: slow, and independent of the package's renderer."""

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.overhead.camera import LOOKING_DOWN, WALL_HEIGHT_CM, CameraModel, overhead_camera, simple_lens
from epuck_sim.overhead.light import ring_light
from epuck_sim.overhead.rings import RingFinder
from epuck_sim.scenario.overhead import OverheadSection

APART_CM = 2 * epuck.RADIUS_CM


class Look(NamedTuple):
    """Properties of the light of rings in a picture; the defaults are similar to those of the section `overhead`."""

    peak: float = 3.0  # of the light, over what saturates red
    green: float = 0.2
    modulation: float = 0.4
    cross_cm: float = 0.3
    bloom: float = 0.1
    blur_px: float = 0.7
    vignetting: float = 0.3
    noise: float = 2.0
    jpeg: bool = False


USUAL = Look()
CLEAN = Look(bloom=0.0, noise=0.0, vignetting=0.0)


def straight_camera(width_px=480, height_px=480, k1=-0.05, side_cm=60.0):
    section = OverheadSection(width_px=width_px, height_px=height_px, distortion=k1)
    return overhead_camera(section, side_cm, side_cm)


def tilted_camera(tilt_deg=10.0, turn_deg=20.0, k1=0.0):
    """Return a tilted camera 110 cm above the floor that is aimed at the middle of a 60 x 60 cm arena."""
    tilt, turn = math.radians(tilt_deg), math.radians(turn_deg)
    lean = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    spin = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    rotation = lean @ LOOKING_DOWN @ spin
    ahead = rotation[2]  # the optical axis in the arena's frame
    position = np.array([30.0, 30.0, 0.0]) - ahead * 110.0 / -ahead[2]
    return CameraModel(640, 480, simple_lens(640, 480, 540.0, k1), rotation, position)


def once_per_camera(function):
    """Cache a function of a camera model, which is not hashable."""

    @lru_cache
    def cached(width_px, height_px, lens, rotation, position):
        return function(CameraModel(width_px, height_px, lens, np.reshape(rotation, (3, 3)), np.array(position)))

    return lambda camera: cached(*camera[:3], tuple(camera.rotation.ravel()), tuple(camera.position_cm))


finder_for = once_per_camera(RingFinder)


def rings_in(camera, picture):
    return finder_for(camera).find(ring_light(picture))


@once_per_camera
def ring_height_map(camera):
    return camera.plane_map(epuck.RING_HEIGHT_CM)


def box_around(camera, centre, reach_cm, heights_cm):
    """Return slices of the rows and columns that show points within `reach_cm` of (2,) cm at any of the heights."""
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = [(*(centre + reach_cm * sign), height) for height in heights_cm for sign in signs]
    pixels = np.clip(camera.project(np.array(corners)), 0, (camera.width_px, camera.height_px)).astype(int)
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0) + 1
    return slice(top, bottom), slice(left, right)


def ring_picture(camera, centres_cm, look=USUAL, seed=0, share=None, room=0.0):
    """Return (height_px, width_px, 3): lit rings at (n, 2) cm; share: (n,) of the exposure that each was lit.

    room: grey level of the floor in a lit room, with darker robots on it.
    """
    plane = ring_height_map(camera)
    generator = np.random.default_rng(seed)
    light = np.zeros(plane.shape[:2])
    grey = np.full(plane.shape[:2], room)
    for i, centre in enumerate(np.reshape(centres_cm, (-1, 2))):
        box = box_around(camera, centre, 9.0, [epuck.RING_HEIGHT_CM])
        away = plane[box] - centre
        off = np.hypot(away[..., 0], away[..., 1]) - epuck.RING_RADIUS_CM
        angle = np.arctan2(away[..., 1], away[..., 0]) + generator.uniform(0, 2 * math.pi)
        shape = np.exp(-((off / look.cross_cm) ** 2) / 2) * (1 + look.modulation * np.cos(8 * angle))
        light[box] += (1.0 if share is None else share[i]) * (shape + look.bloom * np.exp(-np.abs(off)))
        grey[box][off < 0.2] = room * 0.5
    light *= look.peak
    if look.blur_px:
        light, grey = (cv2.GaussianBlur(values.astype(np.float32), (0, 0), look.blur_px) for values in (light, grey))
    shade = shade_of(camera, look.vignetting)
    colour = np.array([1.0, look.green, look.green])
    picture = (grey[..., None] + 255 * light[..., None] * colour) * shade[..., None]
    picture += look.noise * generator.standard_normal(picture.shape, np.float32)
    picture = np.clip(np.round(picture), 0, 255).astype(np.uint8)
    if look.jpeg:
        coded = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
        picture = np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1])
    return picture


def room_picture(camera, robots_cm=(), noise=2.0, seed=0):
    """Return a picture of a 60 x 60 cm arena, its table and robots in the light: pixels are means of 2 x 2 points."""
    size = 2 * camera.width_px, 2 * camera.height_px
    lens = simple_lens(*size, 2 * camera.lens.focal_px, camera.lens.coefficients[0])
    dense = CameraModel(*size, lens, camera.rotation, camera.position_cm)
    floor, rise = dense.plane_map(0.0), WALL_HEIGHT_CM / camera.position_cm[2]
    top = floor + rise * (camera.position_cm[:2] - floor)  # a line of sight is straight
    grey = np.full(floor.shape[:2], 30.0)
    for points, margin, level in ((top, 1.0, 240.0), (top, 0.0, 200.0), (floor, 0.0, 145.0)):
        grey[((points >= -margin) & (points <= 60.0 + margin)).all(axis=-1)] = level
    for centre in np.reshape(robots_cm, (-1, 2)):
        box = box_around(dense, centre, 4.0, [0.0, epuck.HEIGHT_CM])
        for share in np.linspace(0, epuck.HEIGHT_CM / WALL_HEIGHT_CM, 12):
            away = floor[box] + share * (top[box] - floor[box]) - centre
            grey[box][np.hypot(away[..., 0], away[..., 1]) <= epuck.RADIUS_CM] = 70.0
    grey = grey.reshape(camera.height_px, 2, camera.width_px, 2).mean(axis=(1, 3))
    grey = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.7) * shade_of(camera, 0.3)
    generator = np.random.default_rng(seed)
    picture = grey[..., None] + noise * generator.standard_normal((*grey.shape, 3))
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def shade_of(camera, vignetting):
    rows, columns = np.indices((camera.height_px, camera.width_px))
    rho = np.hypot(columns - (camera.width_px - 1) / 2, rows - (camera.height_px - 1) / 2)
    return 1 - vignetting * (rho / rho.max()) ** 2


def touching(count, generator, side_cm=60.0):
    """Return (count, 2) cm: robots that each touch another one, half of them in the directions of a honeycomb."""
    placed = [np.array([side_cm / 2, side_cm / 2])]
    while len(placed) < count:
        honeycomb = 0.2 + math.pi / 3 * generator.integers(6)
        angle = honeycomb if generator.random() < 0.5 else generator.uniform(0, 2 * math.pi)
        place = placed[generator.integers(len(placed))] + APART_CM * np.array([math.cos(angle), math.sin(angle)])
        is_in = (place > epuck.RADIUS_CM).all() and (place < side_cm - epuck.RADIUS_CM).all()
        if is_in and all(np.hypot(*(place - other)) >= APART_CM - 1e-6 for other in placed):
            placed.append(place)
    return np.array(placed)


def honeycomb_cell(centre_cm=(30.0, 30.0), turn=0.3):
    """Return (6, 2) cm: the robots that touch one at the centre all round."""
    angles = turn + math.pi / 3 * np.arange(6)
    return centre_cm + APART_CM * np.column_stack([np.cos(angles), np.sin(angles)])


def scattered(count, generator):
    """Return (count, 2) cm: robots at random in a 60 x 60 cm arena that do not overlap."""
    placed = []
    while len(placed) < count:
        place = generator.uniform(epuck.RADIUS_CM, 60.0 - epuck.RADIUS_CM, 2)
        if all(np.hypot(*(place - other)) >= APART_CM for other in placed):
            placed.append(place)
    return np.array(placed)


def matched(rings, centres_cm, within_cm=0.2):
    """Return how many of the rings found have a true one of their own within `within_cm`."""
    left = [tuple(centre) for centre in np.reshape(centres_cm, (-1, 2))]
    good = 0
    for ring in rings:
        away = [math.hypot(ring.x_cm - x, ring.y_cm - y) for x, y in left]
        if away and min(away) <= within_cm:
            good += 1
            left.pop(away.index(min(away)))
    return good
