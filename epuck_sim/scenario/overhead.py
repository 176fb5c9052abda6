"""The section `overhead` of a scenario: the webcam above the arena (thesis 4.3.1). It does not affect trials."""

from typing import Annotated, Literal

from pydantic import Field

from epuck_sim.scenario.base import ConfigModel, Length, Number, WholeNumber, check_range

PictureSide = Annotated[WholeNumber, Field(ge=64, le=7680, multiple_of=2)]
"""Side of a picture in pixels; even, as H.264 requires."""

TagDictionary = Literal[
    "4X4_50", "4X4_100", "4X4_250", "4X4_1000", "5X5_50", "5X5_100", "5X5_250", "5X5_1000",
    "6X6_50", "6X6_100", "6X6_250", "6X6_1000", "7X7_50", "7X7_100", "7X7_250", "7X7_1000",
]  # fmt: skip
"""Names of OpenCV's dictionaries of ArUco tags: modules along the side, and number of tags."""


class OverheadSection(ConfigModel):
    """A webcam that looks straight down at the middle of the arena, and the light in the room."""

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
