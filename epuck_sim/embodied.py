"""A scenario of robots with bodies: the arena, the robots in it, what disturbs them, and when a trial ends.

Every key is optional; the defaults are those of thesis section 4.2.1 (the dashed lines of Figs. 4.2 and 4.3).
"""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from epuck_sim import epuck
from epuck_sim.arena import Arena, box_corners, is_convex, make_arena
from epuck_sim.overhead.section import OverheadSection
from epuck_sim.scenario import Scenario, StopSection
from epuck_sim.section import Number, Positive, Section, Whole


class Circle(Section):
    """A round obstacle."""

    shape: Literal["circle"]
    x_cm: Number
    y_cm: Number
    radius_cm: Positive


class Box(Section):
    """A rectangular obstacle around (x_cm, y_cm), turned by heading_rad."""

    shape: Literal["box"]
    x_cm: Number
    y_cm: Number
    width_cm: Positive
    height_cm: Positive
    heading_rad: Number = 0.0


class Polygon(Section):
    """A convex obstacle with its corners counter-clockwise."""

    shape: Literal["polygon"]
    corners_cm: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3, max_length=100)]

    @model_validator(mode="after")
    def _convex(self) -> "Polygon":
        if not is_convex(np.array(self.corners_cm)):
            raise ValueError("corners_cm must bound a convex polygon, listed counter-clockwise")
        return self


class ArenaSection(Section):
    """The walled rectangle and what stands in it."""

    width_cm: Annotated[Positive, Field(ge=2 * epuck.RADIUS_CM)] = 60.0
    height_cm: Annotated[Positive, Field(ge=2 * epuck.RADIUS_CM)] = 60.0
    obstacles: tuple[Annotated[Circle | Box | Polygon, Field(discriminator="shape")], ...] = ()

    @model_validator(mode="after")
    def _obstacles_inside(self) -> "ArenaSection":
        arena = self.build()
        reach = [(circle[:2] - circle[2], circle[:2] + circle[2]) for circle in arena.circles]
        reach += [(corners.min(axis=0), corners.max(axis=0)) for corners in arena.polygons]
        for low, high in reach:
            if (low < -1e-9).any() or (high > np.array([self.width_cm, self.height_cm]) + 1e-9).any():
                raise ValueError(
                    f"an obstacle reaches from ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) cm, beyond the "
                    f"walls of the {self.width_cm:g} x {self.height_cm:g} cm arena"
                )
        return self

    def build(self) -> Arena:
        """Return the arena as arrays."""
        circles = [(o.x_cm, o.y_cm, o.radius_cm) for o in self.obstacles if isinstance(o, Circle)]
        polygons = [
            np.array(o.corners_cm)
            if isinstance(o, Polygon)
            else box_corners(o.x_cm, o.y_cm, o.width_cm, o.height_cm, o.heading_rad)
            for o in self.obstacles
            if not isinstance(o, Circle)
        ]
        return make_arena(self.width_cm, self.height_cm, circles, polygons)


class CameraSection(Section):
    """A group's line camera (thesis 4.1.1; the cone of vision of 3.1.2 by `field_of_view_deg` and `range_cm`)."""

    pixels: Annotated[Whole, Field(ge=1, le=1000)] = 60
    field_of_view_deg: Annotated[Number, Field(gt=0, le=360)] = 56.0
    central_pixels: Annotated[Whole, Field(ge=1)] | None = None
    """Only so many pixels in the middle of the row are looked at (thesis 4.2.1); all by default."""
    range_cm: Positive | None = None
    """Nothing beyond it is seen; unlimited by default."""

    @model_validator(mode="after")
    def _centred(self) -> "CameraSection":
        central = self.pixels if self.central_pixels is None else self.central_pixels
        if central > self.pixels or (self.pixels - central) % 2:
            raise ValueError(
                f"central_pixels is {central}; allowed: {2 - self.pixels % 2} to {self.pixels} in steps of "
                f"2, so that they lie in the middle of {self.pixels} pixels"
            )
        return self


class InfraredSection(Section):
    """How a group's proximity sensors turn a reading into a distance."""

    distance: Literal["inverse_response", "firmware_table"] = "inverse_response"


class RobotGroup(Section):
    """Robots that share a controller."""

    count: Annotated[Whole, Field(ge=1, le=100_000)] = 10
    placement: Literal["random", "grid", "poses"] = "random"
    """`random`: anywhere without overlap; `grid`: on points 10 cm apart (thesis 4.3.1); `poses`: as `poses` says."""
    poses: tuple[tuple[Number, Number, Number], ...] | None = None
    """x_cm, y_cm, heading_rad of each robot, instead of a placement."""
    controller: str = "firefly"
    """A shipped controller's name, or a file that ends in .py, relative to the scenario's file."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The controller's parameters, which it checks itself; what is left out has the controller's default."""
    camera: CameraSection = CameraSection()
    infrared: InfraredSection = InfraredSection()

    @model_validator(mode="before")
    @classmethod
    def _count_poses(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("poses") is not None:
            poses = given["poses"]
            count = {"count": len(poses)} if isinstance(poses, list | tuple) and poses else {}
            return {"placement": "poses", **count, **given}
        return given

    @model_validator(mode="after")
    def _poses_match(self) -> "RobotGroup":
        if self.poses is None and self.placement == "poses":
            raise ValueError("placement is 'poses' but there are none; give poses: [[x_cm, y_cm, heading_rad], ...]")
        if self.poses is not None and self.placement != "poses":
            raise ValueError(f"placement is {self.placement!r} and poses are given; leave one of them out")
        if self.poses is not None and len(self.poses) != self.count:
            raise ValueError(f"count is {self.count} but there are {len(self.poses)} poses; leave count out")
        return self


class NoiseSection(Section):
    """What disturbs sensors and wheels; 0 switches a part off, `noise: off` all."""

    wheel_speed: Annotated[Number, Field(ge=0, lt=1)] = 0.05
    """Each control step each wheel's speed is multiplied by a uniform factor in 1 -+ this (Enki)."""
    infrared_counts: Annotated[Number, Field(ge=0, le=10_000)] = 10.0
    """Standard deviation of what is added to each infrared reading (Enki)."""


class ContactSection(Section):
    """What happens where bodies touch; by default they slide past each other (thesis 3.1.4.1)."""

    friction: Annotated[Number, Field(ge=0, le=10)] = 0.0


class TimingSection(Section):
    """How often robots sense and act, and how often bodies move (thesis 3.1.4.1)."""

    control_hz: Annotated[Whole, Field(ge=1, le=1000)] = 10
    physics_hz: Annotated[Whole, Field(ge=100, le=10_000)] = 100
    """At fewer, bodies would overlap by more than 1 mm before they are known to touch."""

    @model_validator(mode="after")
    def _divide(self) -> "TimingSection":
        if 1000 % self.control_hz:
            raise ValueError(
                f"control_hz is {self.control_hz}; a control step must be whole milliseconds: 1, 2, 4, 5, "
                "8, 10, 20, 25, 40, 50, 100, 125, 200, 250, 500 or 1000"
            )
        if self.physics_hz % self.control_hz:
            raise ValueError(f"physics_hz is {self.physics_hz}; allowed: a multiple of control_hz, {self.control_hz}")
        return self

    @property
    def step_ms(self) -> int:
        """Milliseconds from one control step to the next."""
        return 1000 // self.control_hz


class EmbodiedStop(StopSection):
    """When a trial ends (thesis 4.2.1)."""

    order_parameter: Annotated[Number, Field(gt=0, le=1)] = 0.95
    max_cycles: Annotated[Whole, Field(ge=1, le=10**9)] = 10_000
    """Without an oscillator, 5 s count as a cycle."""
    max_time_s: Annotated[Number, Field(gt=0, le=1e10)] | None = None
    """The trial is censored after this time, too."""
    reference_robot: Annotated[Whole, Field(ge=0)] = 0
    """Robots are numbered from 0, in the order of their groups."""


class EmbodiedScenario(Scenario):
    """A swarm of e-pucks (chapter 4)."""

    model: Literal["embodied"] = "embodied"
    arena: ArenaSection = ArenaSection()
    robots: tuple[RobotGroup, ...] = (RobotGroup(),)
    noise: NoiseSection = NoiseSection()
    contact: ContactSection = ContactSection()
    timing: TimingSection = TimingSection()
    stop: EmbodiedStop = EmbodiedStop()
    overhead: OverheadSection = OverheadSection()

    @model_validator(mode="before")
    @classmethod
    def _noise_off(cls, given: Any) -> Any:
        noise = given.get("noise") if isinstance(given, dict) else None
        if noise in ("off", "OFF", "Off", False):
            return {**given, "noise": {"wheel_speed": 0, "infrared_counts": 0}}
        if noise in ("on", "ON", "On", True):
            return {**given, "noise": {}}
        return given

    @model_validator(mode="after")
    def _fits(self) -> "EmbodiedScenario":
        if not self.robots:
            raise ValueError("robots is []; allowed: at least one group of robots, such as [{count: 10}]")
        if self.stop.reference_robot >= self.robot_count:
            raise ValueError(
                f"stop.reference_robot is {self.stop.reference_robot}; allowed: 0 to {self.robot_count - 1}"
            )
        floor = self.arena.width_cm * self.arena.height_cm
        bodies = self.robot_count * math.pi * epuck.RADIUS_CM**2
        densest = math.pi / math.sqrt(12)  # of equal discs in the plane
        if bodies > densest * floor:
            raise ValueError(
                f"{self.robot_count} robots of {2 * epuck.RADIUS_CM:g} cm do not fit into the arena of "
                f"{self.arena.width_cm:g} x {self.arena.height_cm:g} cm; give fewer robots or a larger arena"
            )
        return self

    @property
    def robot_count(self) -> int:
        """Robots in all groups."""
        return sum(group.count for group in self.robots)

    @property
    def compiled(self) -> tuple[str, ...]:
        """The groups' controllers."""
        return tuple(group.controller for group in self.robots)

    @property
    def camera_pixels(self) -> int:
        """Pixels of the camera that has the most."""
        return max(group.camera.pixels for group in self.robots)
