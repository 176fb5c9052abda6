"""One group in the section `robots` of a scenario: robots that share a controller, and their sensors."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.sensors import by_name
from epuck_sim.scenario.signals import CameraSignal, RadioSignal, SignalSection


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

    later_keys: ClassVar[tuple[str, ...]] = ("memory", "signal", "present", "sensors")

    count: Annotated[WholeNumber, Field(ge=1, le=100_000)] = 10
    """Number of robots in the group; N of thesis 4.2.1, where there is one group."""
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
