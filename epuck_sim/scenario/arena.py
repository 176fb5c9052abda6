"""The sections `arena` of a scenario, the walled rectangle with all that is in it, and `overhead`, the webcam above."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from epuck_sim.arena import Arena, Floor, clearance_cm, make_arena, make_floor
from epuck_sim.arrays import ByteArray, FloatArray
from epuck_sim.errors import extras_named
from epuck_sim.geometry import box_corners, is_convex
from epuck_sim.scenario.base import ConfigModel, Corner, Length, Number, Positive, WholeNumber, check_range, refused_at
from epuck_sim.util.messages import short_yaml

LONGEST_SIDE = 4000  # most rows, and most columns, of a picture of the floor

Brightness = Annotated[Number, Field(ge=0, le=1)]  # brightness of the floor: 0 is black, 1 is white


class Circle(ConfigModel):
    """A round obstacle."""

    shape: Literal["circle"]
    x_cm: Number
    """x of the centre, from the left wall."""
    y_cm: Number
    """y of the centre, from the lower wall."""
    radius_cm: Length
    """Radius."""


class Box(ConfigModel):
    """A rectangular obstacle around (x_cm, y_cm), turned by heading_rad."""

    shape: Literal["box"]
    x_cm: Number
    """x of the centre, from the left wall."""
    y_cm: Number
    """y of the centre, from the lower wall."""
    width_cm: Length
    """Length along the heading."""
    height_cm: Length
    """Length across the heading."""
    heading_rad: Number = 0.0
    """Angle by which the box is turned, counter-clockwise from x."""


class Polygon(ConfigModel):
    """A convex obstacle with its corners counter-clockwise."""

    shape: Literal["polygon"]
    corners_cm: Annotated[tuple[Corner, ...], Field(min_length=3, max_length=100)]
    """`x_cm, y_cm` of each corner."""

    def _check_together(self) -> None:
        if not is_convex(np.array(self.corners_cm)):
            raise ValueError("corners_cm must bound a convex polygon, listed counter-clockwise")


class Movable(Circle):
    """A disc that robots push, at its place at the start: it slides on the floor, and does not turn."""

    shape: Literal["circle"] = "circle"
    mass_kg: Positive
    """Mass."""
    friction: Annotated[Number, Field(ge=0, le=10)]
    """Coefficient of friction with the floor: moving it takes a force of this times its weight."""


class Patch(ConfigModel):
    """A part of the floor that has a brightness of its own."""

    brightness: Brightness
    """From 0, black, to 1, white."""


class CirclePatch(Patch, Circle):
    """A disc on the floor."""


class BoxPatch(Patch, Box):
    """A rectangle on the floor."""


class PolygonPatch(Patch, Polygon):
    """A convex polygon on the floor."""


class FloorSection(ConfigModel):
    """Brightness of the floor, for ground sensors."""

    brightness: Brightness = 1.0
    """From 0, black, to 1, white, where there is no patch."""
    patches: tuple[Annotated[CirclePatch | BoxPatch | PolygonPatch, Field(discriminator="shape")], ...] = ()
    """Patches; later ones lie on top of earlier ones."""
    picture: Annotated[str, Field(min_length=1)] | None = None
    """File of a grey picture in place of `brightness`, stretched between the walls, its top at the largest y."""

    def _check_together(self) -> None:
        if self.picture is not None and self.brightness != 1:
            raise ValueError(f"brightness is {self.brightness:g} and a picture is given; leave one of them out")

    def build(self) -> Floor:
        """Return the floor as arrays; raise ScenarioError if its picture cannot be read."""
        patches = [(patch.brightness, _outline(patch)) for patch in self.patches]
        if self.picture is None:
            return make_floor(self.brightness, patches)
        with refused_at("arena.floor.picture"):
            return make_floor(1.0, patches, read_grey(Path(find_picture(self.picture))))


class Lamp(ConfigModel):
    """A lamp above the floor, which shines alike in all directions."""

    x_cm: Number
    """x, from the left wall."""
    y_cm: Number
    """y, from the lower wall."""
    height_cm: Length = 30.0
    """Height above the floor."""
    strength: Positive = 1.0
    """Light on the floor right below."""


class ArenaSection(ConfigModel):
    """The walled rectangle, what stands in it, its floor and its lamps."""

    later_keys: ClassVar[tuple[str, ...]] = ("movables", "floor", "lamps")

    width_cm: Length = 60.0
    """Length of the floor along x, from the robots' diameter; L of thesis 4.2.1, where the arena is square."""
    height_cm: Length = 60.0
    """Length of the floor along y, from the robots' diameter."""
    obstacles: tuple[Annotated[Circle | Box | Polygon, Field(discriminator="shape")], ...] = ()
    movables: tuple[Movable, ...] = ()
    """Discs that robots can push: as high as robots, they hide rings and are seen by infrared sensors."""
    floor: FloorSection = FloorSection.model_construct()
    """Brightness of the floor, for ground sensors."""
    lamps: tuple[Lamp, ...] = ()
    """Lamps, for light sensors."""

    def _check_together(self) -> None:
        solids = {f"obstacles.{number}": shape for number, shape in enumerate(self.obstacles)}
        solids |= {f"movables.{number}": shape for number, shape in enumerate(self.movables)}
        spans = {key: _span(shape) for key, shape in solids.items()}
        outlines = [np.atleast_2d(_outline(patch))[:, :2] for patch in self.floor.patches]
        centres = {f"floor.patches.{number}": outline.mean(axis=0) for number, outline in enumerate(outlines)}
        centres |= {f"lamps.{number}": np.array([lamp.x_cm, lamp.y_cm]) for number, lamp in enumerate(self.lamps)}
        spans |= {f"the centre of {key}": centre[None] for key, centre in centres.items()}
        for key, span in spans.items():
            if (span < -1e-9).any() or (span > np.array([self.width_cm, self.height_cm]) + 1e-9).any():
                places = " to ".join(f"({x:g}, {y:g})" for x, y in span)
                walls = f"the walls of the {self.width_cm:g} x {self.height_cm:g} cm arena"
                raise ValueError(f"{key} is at {places} cm; allowed: within {walls}")
        for number, movable in enumerate(self.movables):
            others = self.model_copy(update={"movables": self.movables[:number]})._build_solids()
            gap_cm = clearance_cm(others, movable.x_cm, movable.y_cm) - movable.radius_cm
            if gap_cm < -1e-9:
                overlap = f"overlaps an obstacle or an earlier movable by {-gap_cm:.3g} cm"
                raise ValueError(f"movables.{number} {overlap}; allowed: at most touching")

    def build(self) -> Arena:
        """Return the arena as arrays; raise ScenarioError if the picture of its floor cannot be read."""
        lamps = np.array([(lamp.x_cm, lamp.y_cm, lamp.height_cm, lamp.strength) for lamp in self.lamps])
        return replace(self._build_solids(), floor=self.floor.build(), lamps=lamps.reshape(-1, 4))

    def _build_solids(self) -> Arena:
        """Return the arena with a white floor and without lamps."""
        circles = [(o.x_cm, o.y_cm, o.radius_cm) for o in self.obstacles if isinstance(o, Circle)]
        polygons = [_outline(o) for o in self.obstacles if not isinstance(o, Circle)]
        movables = [(m.x_cm, m.y_cm, m.radius_cm, 1000 * m.mass_kg, m.friction) for m in self.movables]
        return make_arena(self.width_cm, self.height_cm, circles, polygons, movables)


def _outline(shape: Circle | Box | Polygon) -> FloatArray:
    """Return (3,) cm, centre x, centre y and radius of a disc, or (v, 2) cm, the corners of another shape."""
    if isinstance(shape, Circle):
        return np.array([shape.x_cm, shape.y_cm, shape.radius_cm])
    if isinstance(shape, Polygon):
        return np.array(shape.corners_cm)
    return box_corners(shape.x_cm, shape.y_cm, shape.width_cm, shape.height_cm, shape.heading_rad)


def _span(shape: Circle | Box | Polygon) -> FloatArray:
    """Return (2, 2) cm: the corners of smallest and of largest x and y of the rectangle around a shape."""
    points, reach = np.atleast_2d(_outline(shape))[:, :2], shape.radius_cm if isinstance(shape, Circle) else 0.0
    return np.array([points.min(axis=0) - reach, points.max(axis=0) + reach])


def find_picture(name: str, folder: Path | None = None) -> str:
    """Return the path of a file with a picture."""
    paths = dict.fromkeys((place / name).absolute() for place in (folder or Path(), Path()))
    for path in paths:
        try:
            if path.is_file():
                read_grey(path)
                return str(path.resolve())
        except (OSError, ValueError) as error:
            raise ValueError(f"{path} {getattr(error, 'strerror', None) or error}") from error
    raise ValueError(f"is {short_yaml(name)}; there is no file {' or '.join(map(str, paths))}")


def read_grey(path: Path) -> ByteArray:
    """Return (rows, columns) levels of a picture, from 0 for black to 255 for white; it is read again if it changes.

    It raises OSError if the file cannot be read, ValueError if it is no picture or a larger one than allowed.
    """
    status = path.stat()
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=8)
@extras_named()
def _read(path: Path, *_stamp: int) -> ByteArray:
    import cv2  # noqa: PLC0415 is needed where there are pictures

    try:
        picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error:
        picture = None
    if picture is None:
        raise ValueError("is no picture that can be read; give a PNG, say")
    rows, columns = picture.shape
    if max(rows, columns) > LONGEST_SIDE:
        raise ValueError(f"is a picture of {columns} x {rows} pixels; allowed: up to {LONGEST_SIDE} x {LONGEST_SIDE}")
    return np.asarray(picture, np.uint8)


PictureSide = Annotated[WholeNumber, Field(ge=64, le=7680, multiple_of=2)]
"""Side of a picture in pixels; even, as H.264 requires."""

TagDictionary = Literal[
    "4X4_50", "4X4_100", "4X4_250", "4X4_1000", "5X5_50", "5X5_100", "5X5_250", "5X5_1000",
    "6X6_50", "6X6_100", "6X6_250", "6X6_1000", "7X7_50", "7X7_100", "7X7_250", "7X7_1000",
]  # fmt: skip
"""Names of OpenCV's dictionaries of ArUco tags: modules along the side, and number of tags."""


class OverheadSection(ConfigModel):
    """A webcam that looks straight down at the middle of the arena, and the light in the room.

    It does not affect trials.
    """

    height_cm: Length | None = None
    """Height of the lens above the floor; by default 110/60 of the arena's longer side (thesis 4.3.1)."""
    field_of_view_deg: Annotated[Number, Field(gt=0, le=120)] | None = None
    """Field of view across the picture's width; by default the arena and its walls just fit into the picture."""
    width_px: PictureSide = 480
    """Width of the picture."""
    height_px: PictureSide = 480
    """Height of the picture."""
    frames_per_s: Annotated[Number, Field(ge=1, le=240)] = 15.0
    """Frame rate; 15 to 16 in thesis Appendix C."""
    light: Literal["dark", "lit"] = "dark"
    """`dark`: only lit rings are visible, as in the experiments; `lit`: bodies, headings and walls, too."""
    lit_start_s: Annotated[Number, Field(ge=0, le=600)] = 0.0
    """Duration of a beginning in the light, before the robots start; the experiments began when the light went off."""
    exposure_ms: Annotated[Number, Field(gt=0, le=1000)] = 20.0
    """Exposure time of a frame; a longer exposure is brighter and blurs what moves."""
    blur_px: Annotated[Number, Field(ge=0, le=20)] = 0.7
    """Standard deviation of the lens's blur."""
    bloom: Annotated[Number, Field(ge=0, le=1)] = 0.1
    """Brightness of the haze at a lit ring, relative to the ring."""
    vignetting: Annotated[Number, Field(ge=0, le=1)] = 0.3
    """Fraction of the light lost in the corners of the picture."""
    lens: Literal["usual", "fisheye"] = "usual"
    """`fisheye`: off the middle, pixels are proportional to angles, without further distortion."""
    distortion: Annotated[Number, Field(ge=-0.3, le=0.3)] = -0.05
    """Radial distortion, k1 of OpenCV's camera model; below 0 the picture bulges, as with a cheap lens."""
    tilt_deg: Annotated[Number, Field(ge=0, le=60)] = 0.0
    """Angle between the camera's axis and straight down; the camera stays aimed at the arena's middle."""
    turn_deg: Annotated[Number, Field(ge=-180, le=180)] = 0.0
    """Angle by which the camera is turned about the vertical."""
    gain: Annotated[Number, Field(gt=0, le=100)] = 1.0
    """Factor of the rings' light; automatic exposure in the dark burns them out, as 4 and more do."""
    led_points: bool = False
    """Whether a ring is seen as the eight points of its LEDs, as in a short exposure."""
    gloss: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Brightness of the walls' mirror images of rings, relative to the rings."""
    ambient: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Light in the dark room, relative to the lit one."""
    tags: TagDictionary | None = None
    """Dictionary of the ArUco tags on top of robots, each with its robot's number; by default they have none."""
    tag_cm: Annotated[Number, Field(gt=0, le=100)] = 4.0
    """Side of a tag with its black border, without the white around it."""
    noise_levels: Annotated[Number, Field(ge=0, le=50)] = 2.0
    """Standard deviation of the noise of each colour of each pixel, in levels from 0 to 255."""

    def _check_together(self) -> None:
        why = f", the time in ms from one frame to the next at {self.frames_per_s:g} frames_per_s"
        check_range("exposure_ms", self.exposure_ms, 0, 1000 / self.frames_per_s, why)
