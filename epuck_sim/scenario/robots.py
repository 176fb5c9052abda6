"""Groups of robots that share a controller: their signals, cameras and sensors, and whether they fit where they are."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from epuck_sim.epuck import GRID_SPACING_CM
from epuck_sim.scenario.arena import ArenaSection
from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.sensors import by_name


class CameraSignal(ConfigModel):
    """By the line camera that the group's section `camera` describes (thesis 4.1.1)."""

    kind: Literal["camera"] = "camera"


class SectorSection(ConfigModel):
    """A circular sector (thesis 3.1.2); a disc by default."""

    range_cm: Positive | None = None
    """Radius; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)] = 360.0
    """Full opening angle, half of it to either side of straight ahead."""


class ConeSection(SectorSection):
    """A circular sector with a robot's centre as its apex."""

    of: Literal["vision", "emission"] = "vision"
    """Whose cone it is: the receiver's, in which the sender lies, or the sender's, in which the receiver lies."""


class ConeSignal(ConeSection):
    """By an ideal sensor, which knows the lit rings whose centres lie in a cone (thesis 3.1.2, 3.1.4.3)."""

    kind: Literal["cone"]
    occlusion: bool = True
    """Whether other robots and obstacles hide a ring: they block the line between the two robots' centres."""


class EnkiCameraSignal(SectorSection):
    """By what Enki's camera sees: lit rings of robots of which any part shows in a sector (thesis 3.1.4.3).

    The range is that from the robot's centre to the nearest point of the other, and the camera is at the front.
    """

    kind: Literal["enki_camera"]
    occlusion: bool = True
    """Whether other robots and obstacles hide the part of a ring that is behind them."""


class RadioSignal(ConeSection):
    """By radio pulses, which nothing blocks (thesis 6.2)."""

    kind: Literal["radio"]
    latency_ms: Annotated[Number, Field(ge=0, le=60_000)] = 0.0
    """Time by which pulses are late; a pulse arrives in the first control step that begins so much later."""
    loss: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Probability with which a robot misses a pulse, for each pulse and robot alone."""
    collisions: bool = False
    """Whether a robot that several pulses reach at once receives none of them."""
    half_duplex: bool = False
    """Whether a robot receives nothing in a control step in which it sends."""


SignalSection = Annotated[CameraSignal | ConeSignal | EnkiCameraSignal | RadioSignal, Field(discriminator="kind")]


class CameraSection(ConfigModel):
    """A group's line camera (thesis 4.1.1; the cone of vision of 3.1.2 by `field_of_view_deg` and `range_cm`)."""

    later_keys: ClassVar[tuple[str, ...]] = ("reflection_range_cm",)

    pixels: Annotated[WholeNumber, Field(ge=1, le=1000)] = 60
    """Number of pixels in the row."""
    field_of_view_deg: Annotated[Number, Field(gt=0, le=360)] = 56.0
    """Angle that the row covers, half of it to either side of straight ahead."""
    central_pixels: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Number of pixels in the middle of the row that are used (thesis 4.2.1); all by default."""
    range_cm: Positive | None = None
    """Distance beyond which nothing is seen; unlimited by default."""
    reflection_range_cm: Annotated[Number, Field(ge=0, le=1e6)] = 0.0
    """Longest way, by a wall to a ring, on which the ring's reflection in the wall is seen (thesis 4.4); 0 for none."""
    frames_per_s: Annotated[Number, Field(ge=0.1, le=1000)] | None = None
    """Pictures a second, about 8 on the real robots (thesis 4.3.1); by default one in each control step."""
    latency_ms: Annotated[Number, Field(ge=0)] = 0.0
    """Largest delay of a picture; each picture reaches the controller after a delay drawn uniformly from 0 to this."""

    @model_validator(mode="after")
    def _check_centred(self) -> "CameraSection":
        central = self.pixels if self.central_pixels is None else self.central_pixels
        if central > self.pixels or (self.pixels - central) % 2:
            raise ValueError(
                f"central_pixels is {central}; allowed: {2 - self.pixels % 2} to {self.pixels} in steps of "
                f"2, so that they lie in the middle of {self.pixels} pixels"
            )
        return self

    @model_validator(mode="after")
    def _check_reflections(self) -> "CameraSection":
        if self.range_cm is not None and self.reflection_range_cm > self.range_cm:
            raise ValueError(
                f"reflection_range_cm is {self.reflection_range_cm:g}; allowed: 0 to range_cm, which is "
                f"{self.range_cm:g}: no mirror image is seen farther than the ring itself"
            )
        return self

    @model_validator(mode="after")
    def _check_latency(self) -> "CameraSection":
        if self.frames_per_s is None and self.latency_ms > 0:
            raise ValueError(
                f"latency_ms is {self.latency_ms:g}, frames_per_s is null; give frames_per_s, or leave latency_ms out"
            )
        if self.frames_per_s is not None and self.latency_ms > 1000 / self.frames_per_s:
            raise ValueError(
                f"latency_ms is {self.latency_ms:g}; allowed: 0 to the time from one picture to the next, "
                f"{1000 / self.frames_per_s:.4g} ms at {self.frames_per_s:g} frames_per_s"
            )
        return self


class InfraredSection(ConfigModel):
    """How a group's proximity sensors turn a reading into a distance."""

    later_keys: ClassVar[tuple[str, ...]] = ("robots",)

    distance: Literal["inverse_response", "firmware_table"] = "inverse_response"
    """`inverse_response`: by inverting the mean response; `firmware_table`: by the table of the robots' firmware."""
    robots: bool = True
    """Whether they see other robots; else walls and obstacles only, to avoid walls alone (thesis 3.1.4.1)."""


class RobotGroup(ConfigModel):
    """Robots that share a controller."""

    later_keys: ClassVar[tuple[str, ...]] = ("memory", "signal", "present", "sensors", "kind")

    count: Annotated[WholeNumber, Field(ge=1, le=100_000)] = 10
    """Number of robots in the group; N of thesis 4.2.1, where there is one group."""
    kind: RobotKind | None = None
    """What kind of robot they are; by default that of the section `robot`."""
    present: bool = True
    """Whether its robots are in the arena at the start; else the schedule adds them."""
    placement: Literal["random", "grid", "poses"] = "random"
    """`random`: anywhere without overlap; `grid`: on points 10 cm apart (thesis 4.3.1); `poses`: as in `poses`."""
    poses: tuple[tuple[Number, Number, Number], ...] | None = None
    """`x_cm, y_cm, heading_rad` of each robot, instead of a placement."""
    controller: str = "firefly"
    """Name of a shipped or installed controller, or a file (.py, .c or .so), relative to the scenario's file."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The controller's parameters by name; those that are left out have the controller's defaults."""
    memory: dict[str, Any] = Field(default_factory=dict)
    """What robots remember at the start, by name, instead of what the controller starts with: a number, or one entry
    for each robot; `phase_ms` is an oscillator's phase."""
    signal: SignalSection = CameraSignal()
    camera: CameraSection = CameraSection()
    infrared: InfraredSection = InfraredSection()
    sensors: Annotated[dict[str, dict[str, Any]], BeforeValidator(by_name)] = Field(default_factory=dict)
    """Sensors in files of their own, each with its parameters: `[ground.py, {light.py: {range_cm: 30}}]`."""

    @model_validator(mode="before")
    @classmethod
    def _count_poses(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("poses") is not None:
            poses = given["poses"]
            count = {"count": len(poses)} if isinstance(poses, list | tuple) and poses else {}
            return {"placement": "poses", **count, **given}
        return given

    @model_validator(mode="after")
    def _check_poses(self) -> "RobotGroup":
        if self.poses is None and self.placement == "poses":
            raise ValueError("placement is 'poses' but there are none; give poses: [[x_cm, y_cm, heading_rad], ...]")
        if self.poses is not None and self.placement != "poses":
            raise ValueError(f"placement is {self.placement!r} and poses are given; leave one of them out")
        if self.poses is not None and len(self.poses) != self.count:
            raise ValueError(f"count is {self.count} but there are {len(self.poses)} poses; leave count out")
        return self

    @model_validator(mode="after")
    def _check_signal(self) -> "RobotGroup":
        if self.signal.kind != "camera" and self.camera != CameraSection():
            raise ValueError(
                f"signal.kind is {self.signal.kind!r} and a camera is given; leave the camera out, or choose camera"
            )
        return self

    @property
    def signal_is_random(self) -> bool:
        """Whether random numbers decide when a flash reaches a robot, or if it does."""
        if isinstance(self.signal, RadioSignal):
            return self.signal.loss > 0
        return self.camera.frames_per_s is not None

    @property
    def pixels(self) -> int:
        """Number of pixels in the row that controllers read: the camera's, or one that other signals set."""
        return self.camera.pixels if self.signal.kind == "camera" else 1


def members(groups: Sequence[RobotGroup]) -> Iterator[tuple[int, RobotGroup, range]]:
    """Yield each group with its number, and with the numbers of its robots."""
    first = 0
    for place, group in enumerate(groups):
        yield place, group, range(first, first + group.count)
        first += group.count


STEP_CM = 0.13
"""Largest distance in cm that wheels may drive in a physics step: bodies that meet head-on overlap by 1 mm at most."""


def check_robots(
    kinds: Sequence[RobotKind], groups: Sequence[RobotGroup], arena: ArenaSection, physics_hz: int
) -> None:
    """Check the robots of a scenario.

    Args:
        kinds: What kind of robots each group has.
        groups: The groups of robots.
        arena: The arena.
        physics_hz: Physics steps in a second.

    Raises:
        ValueError: They do not fit into the arena, are too fast, or lack what a group needs.
    """
    _check_room(kinds, [group.count for group in groups], arena)
    for number, (kind, group) in enumerate(zip(kinds, groups, strict=True)):
        if kind.wheel_limit_cm_s > STEP_CM * physics_hz:
            raise ValueError(
                f"{'robot' if group.kind is None else f'robots.{number}.kind'}.wheel_limit_cm_s is "
                f"{kind.wheel_limit_cm_s:g}; allowed: up to {STEP_CM * physics_hz:g} at timing.physics_hz "
                f"{physics_hz}: faster robots would overlap before a contact is found; give a higher physics_hz"
            )
        if kind.camera is None and group.signal.kind in ("camera", "enki_camera"):
            raise ValueError(
                f"robots.{number}.signal.kind is {group.signal.kind!r}, and the robot {kind.kind!r} has none; allowed: "
                "cone or radio, as in signal: {kind: radio, range_cm: 10}"
            )
        if group.placement == "grid" and 2 * kind.radius_cm > GRID_SPACING_CM:
            raise ValueError(
                f"robots.{number}.placement is 'grid', whose points are {GRID_SPACING_CM:g} cm apart, and robots "
                f"are {2 * kind.radius_cm:g} cm wide; allowed: random or poses"
            )


def _check_room(kinds: Sequence[RobotKind], counts: Sequence[int], arena: ArenaSection) -> None:
    wide: Counter[float] = Counter()
    for kind, count in zip(kinds, counts, strict=True):
        wide[2 * kind.radius_cm] += count
    for key, side_cm in (("width_cm", arena.width_cm), ("height_cm", arena.height_cm)):
        if side_cm < max(wide):
            raise ValueError(f"arena.{key}: is {side_cm:g}; allowed: at least {max(wide):g}")
    densest = math.pi / math.sqrt(12) if len(wide) == 1 else 1.0  # of equal discs; others may fill what these leave
    covered_cm2 = sum(robots * math.pi * (diameter_cm / 2) ** 2 for diameter_cm, robots in wide.items())
    if covered_cm2 > densest * arena.width_cm * arena.height_cm:
        listed = " and ".join(f"{robots} robots of {diameter_cm:g} cm" for diameter_cm, robots in wide.items())
        raise ValueError(
            f"{listed} do not fit into the arena of {arena.width_cm:g} x {arena.height_cm:g} cm; give fewer robots or "
            "a larger arena"
        )
