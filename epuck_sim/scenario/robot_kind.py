"""The section `robot` of a scenario: the body, wheels and sensors that all of its robots have."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from epuck_sim import epuck, kilobot
from epuck_sim.control.interface import SENSORS, Wheels
from epuck_sim.scenario.base import ConfigModel, Number, Positive

ROUNDING_CM = 1e-9
"""Distance by which a sensor may lie beyond the body's edge."""

_EPUCK_SENSORS = tuple(
    (x, y, direction)
    for (x, y), direction in zip(
        epuck.INFRARED_POSITIONS_CM.tolist(), epuck.INFRARED_DIRECTIONS_DEG.tolist(), strict=True
    )
)


class ProximitySection(ConfigModel):
    """The infrared proximity sensors of a robot, `null` for one without any; what is left out is the e-puck's."""

    sensors: Annotated[tuple[tuple[Number, Number, Number], ...], Field(min_length=1, max_length=SENSORS)] = (
        _EPUCK_SENSORS
    )
    """`x_cm, y_cm, direction_deg` of each: x ahead and y left of the axle's centre, directions counter-clockwise."""
    spread_deg: Annotated[Number, Field(gt=0, le=80)] = epuck.INFRARED_SPREAD_DEG
    """Angle between a sensor's centre ray and each of its two side rays."""
    range_cm: Annotated[Positive, Field(le=100)] = epuck.INFRARED_RANGE_CM
    """Range of a ray."""
    peak_counts: Positive = epuck.INFRARED_PEAK_COUNTS
    """Largest reading: m of the response m (c - x0^2) / (x^2 - 2 x0 x + c) to a surface at a distance of x cm."""
    peak_cm: Annotated[Number, Field(ge=0, le=100)] = epuck.INFRARED_PEAK_CM
    """Distance of the largest reading, x0; nearer surfaces read as much."""
    width_cm2: Positive = epuck.INFRARED_WIDTH_CM2
    """Width of the peak, c; above x0^2."""

    @model_validator(mode="after")
    def _check_response(self) -> "ProximitySection":
        if self.width_cm2 <= self.peak_cm**2:
            raise ValueError(
                f"width_cm2 is {self.width_cm2:g}; allowed: above the square of peak_cm, {self.peak_cm**2:g}"
            )
        if self.peak_cm >= self.range_cm:
            raise ValueError(f"peak_cm is {self.peak_cm:g}; allowed: below range_cm, {self.range_cm:g}")
        return self


class CameraMount(ConfigModel):
    """Where a robot's camera is, `null` for one without any; what it sees is a matter of each group of robots."""

    forward_cm: Annotated[Number, Field(ge=0)] | None = None
    """Distance ahead of the axle's centre; by default at the front of the body, where the e-puck's is."""


class RobotKind(ConfigModel):
    """What kind of robot all robots of the scenario are: a shipped kind, or one that differs from it in some keys."""

    kind: Literal["epuck", "kilobot"] = "epuck"
    """The shipped kind, whose values the other keys have by default."""
    radius_cm: Annotated[Positive, Field(ge=0.5, le=50)] = epuck.RADIUS_CM
    """Radius of the body, a disc around the axle's centre."""
    height_cm: Positive = epuck.HEIGHT_CM
    """Height of the body; films alone depend on it."""
    mass_g: Positive = epuck.MASS_G
    """Mass; among robots of one mass it matters only where there are `arena.movables`."""
    wheel_base_cm: Positive = epuck.WHEEL_BASE_CM
    """Distance between the wheels."""
    wheel_limit_cm_s: Positive = epuck.WHEEL_LIMIT_CM_S
    """Largest speed of a wheel, forwards or backwards; commands are limited to it."""
    ring_radius_cm: Positive = epuck.RING_RADIUS_CM
    """Radius of the ring of LEDs; films alone depend on it."""
    ring_height_cm: Positive = epuck.RING_HEIGHT_CM
    """Height of the ring above the floor; films alone depend on it."""
    infrared: ProximitySection | None = ProximitySection()
    camera: CameraMount | None = CameraMount()

    @model_validator(mode="before")
    @classmethod
    def _start_from_kind(cls, given: Any) -> Any:
        section = {"kind": given} if isinstance(given, str) else given
        if not isinstance(section, Mapping):
            return section
        kind = section.get("kind", "epuck")
        return {**(KINDS.get(kind, {}) if isinstance(kind, str) else {}), **section}

    @model_validator(mode="after")
    def _check_body(self) -> "RobotKind":
        if self.wheel_base_cm > 2 * self.radius_cm:
            raise ValueError(
                f"wheel_base_cm is {self.wheel_base_cm:g}; allowed: up to {2 * self.radius_cm:g}, the body's diameter"
            )
        if self.camera is not None and self.camera_forward_cm > self.radius_cm:
            raise ValueError(
                f"camera.forward_cm is {self.camera_forward_cm:g}; allowed: up to {self.radius_cm:g}, the body's radius"
            )
        for number, (x, y, _) in enumerate(self.infrared.sensors if self.infrared else ()):
            if math.hypot(x, y) > self.radius_cm + ROUNDING_CM:
                raise ValueError(
                    f"infrared.sensors.{number} is {math.hypot(x, y):.3g} cm from the axle's centre; allowed: up to "
                    f"{self.radius_cm:g}, the body's radius; infrared: null stands for a robot without such sensors"
                )
        return self

    @property
    def wheels(self) -> Wheels:
        """What controllers know of the wheels."""
        return Wheels(limit_cm_s=float(self.wheel_limit_cm_s), base_cm=float(self.wheel_base_cm))

    @property
    def camera_forward_cm(self) -> float:
        """Distance of the camera ahead of the axle's centre, cm; at the front of the body if there is no camera."""
        forward = self.camera.forward_cm if self.camera else None
        return float(self.radius_cm if forward is None else forward)

    @property
    def ray_reach_cm(self) -> float:
        """Largest distance of the end of an infrared ray from the axle's centre, cm; 0 without such sensors."""
        if self.infrared is None:
            return 0.0
        positions = np.array(self.infrared.sensors)[:, :2]
        return float(np.hypot(*positions.T).max()) + self.infrared.range_cm

    @property
    def cell_cm(self) -> float:
        """Least side of a cell, cm, so that who senses or touches a robot is in its cell or in one around it."""
        return max(self.ray_reach_cm, 3 * self.radius_cm) + self.radius_cm


KINDS: dict[str, dict[str, Any]] = {
    "epuck": {},
    "kilobot": {
        "radius_cm": kilobot.RADIUS_CM,
        "height_cm": kilobot.HEIGHT_CM,
        "mass_g": kilobot.MASS_G,
        "wheel_base_cm": kilobot.WHEEL_BASE_CM,
        "wheel_limit_cm_s": kilobot.WHEEL_LIMIT_CM_S,
        "ring_radius_cm": kilobot.RING_RADIUS_CM,
        "ring_height_cm": kilobot.RING_HEIGHT_CM,
        "infrared": None,
        "camera": None,
    },
}
"""Values in which each shipped kind differs from the e-puck."""

EPUCK = RobotKind()
"""The e-puck."""
