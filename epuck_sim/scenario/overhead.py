"""The section `overhead` of a scenario: the webcam above the arena (thesis 4.3.1). No trial depends on it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber

PictureSide = Annotated[WholeNumber, Field(ge=64, le=7680, multiple_of=2)]
"""Pixels; even, as H.264 needs it."""


class OverheadSection(ConfigModel):
    """A webcam that looks straight down at the middle of the arena, and the light in the room."""

    height_cm: Positive | None = None
    """Of the lens above the floor; 110 cm where the arena's longer side is 60 cm (thesis 4.3.1), and in proportion."""
    field_of_view_deg: Annotated[Number, Field(gt=0, le=120)] | None = None
    """Across the width of the picture; by default the arena with its walls fits into the picture."""
    width_px: PictureSide = 480
    height_px: PictureSide = 480
    frames_per_s: Annotated[Number, Field(ge=1, le=240)] = 15.0
    """15 to 16 in thesis Appendix C."""
    light: Literal["dark", "lit"] = "dark"
    """`dark`: only rings that are on are seen, as in the experiments; `lit`: bodies, headings and walls, too."""
    lit_start_s: Annotated[Number, Field(ge=0, le=600)] = 0.0
    """The film begins so long before the robots do, in the light: the experiments began when it went off."""
    exposure_ms: Annotated[Number, Field(gt=0, le=1000)] = 20.0
    """Each frame gathers light for so long; a longer one is brighter, and blurs what moves."""
    blur_px: Annotated[Number, Field(ge=0, le=20)] = 0.7
    """Standard deviation of how far the lens spreads a point."""
    bloom: Annotated[Number, Field(ge=0, le=1)] = 0.1
    """How bright the haze around a lit ring is, beside the ring itself."""
    vignetting: Annotated[Number, Field(ge=0, le=1)] = 0.3
    """Share of the light that is lost in the corners of the picture."""
    distortion: Annotated[Number, Field(ge=-0.3, le=0.3)] = -0.05
    """Radial: k1 of OpenCV's camera model; below 0 the picture bulges, as a cheap lens has it."""
    noise_levels: Annotated[Number, Field(ge=0, le=50)] = 2.0
    """Standard deviation of each colour of each pixel, in the 256 levels of a picture."""

    @model_validator(mode="after")
    def _exposes_one_at_a_time(self) -> "OverheadSection":
        longest_ms = 1000 / self.frames_per_s
        if self.exposure_ms > longest_ms:
            raise ValueError(
                f"exposure_ms is {self.exposure_ms:g}; allowed: up to the time from one frame to the next, "
                f"{longest_ms:.4g} ms at {self.frames_per_s:g} frames_per_s"
            )
        return self
