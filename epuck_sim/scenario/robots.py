"""Groups of robots that share a controller: their signals, cameras, sensors and controllers, and whether they fit."""

import math
import warnings
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from epuck_sim.control.interface import Controller
from epuck_sim.control.loader import CONTROLLER, find_controller, find_sensor
from epuck_sim.control.names import check_sensed
from epuck_sim.epuck import GRID_SPACING_CM
from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.scenario.arena import ArenaSection
from epuck_sim.scenario.base import LARGEST, ConfigModel, Length, Number, Pose, WholeNumber, check_range, refused_at
from epuck_sim.scenario.robot_kind import FILE, RobotKind, are_groups, resolve_sensor, sensors_by_name
from epuck_sim.user_files import Value
from epuck_sim.util.messages import comma_list, did_you_mean, short_yaml


class CameraSignal(ConfigModel):
    """A signal by the line camera that the group's section `camera` describes (thesis 4.1.1)."""

    kind: Literal["camera"] = "camera"


class SectorSection(ConfigModel):
    """A circular sector (thesis 3.1.2); a disc by default."""

    range_cm: Length | None = None
    """Radius; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)] = 360.0
    """Full opening angle, half of it to either side of straight ahead."""


class ConeSection(SectorSection):
    """A circular sector with a robot's centre as its apex."""

    of: Literal["vision", "emission"] = "vision"
    """Whose cone it is: the receiver's, in which the sender lies, or the sender's, in which the receiver lies."""


class ConeSignal(ConeSection):
    """A signal by an ideal sensor, which perceives lit rings whose centres lie in a cone (thesis 3.1.2, 3.1.4.3)."""

    kind: Literal["cone"]
    occlusion: bool = True
    """Whether other robots and obstacles hide a ring: they block the line between the two robots' centres."""


class EnkiCameraSignal(SectorSection):
    """A signal by Enki's camera, which sees lit rings of robots of which any part shows in a sector (thesis 3.1.4.3).

    The range is measured from the robot's centre to the nearest point of the other; the camera is at the front.
    """

    kind: Literal["enki_camera"]
    occlusion: bool = True
    """Whether other robots and obstacles hide the part of a ring that is behind them."""


class RadioSignal(ConeSection):
    """A signal by radio pulses, which nothing blocks (thesis 6.2)."""

    kind: Literal["radio"]
    latency_ms: Annotated[Number, Field(ge=0, le=60_000)] = 0.0
    """Delay of pulses; a pulse arrives in the first control step that begins at least this much later."""
    loss: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Probability with which a robot misses a pulse, independently for each pulse and robot."""
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
    range_cm: Length | None = None
    """Distance beyond which nothing is seen; unlimited by default."""
    reflection_range_cm: Annotated[Number, Field(ge=0, le=LARGEST)] = 0.0
    """Longest way, by a wall to a ring, on which the ring's reflection in the wall is seen (thesis 4.4); 0 for none."""
    frames_per_s: Annotated[Number, Field(ge=0.1, le=1000)] | None = None
    """Pictures a second, about 8 on the real robots (thesis 4.3.1); by default one in each control step."""
    latency_ms: Annotated[Number, Field(ge=0)] = 0.0
    """Largest delay of a picture; each picture reaches the controller after a delay drawn uniformly from 0 to this."""

    def _check_together(self) -> None:
        central = self.pixels if self.central_pixels is None else self.central_pixels
        if central > self.pixels or (self.pixels - central) % 2:
            allowed = f"{2 - self.pixels % 2} to {self.pixels} in steps of 2, so that they lie in the middle of the row"
            raise ValueError(f"central_pixels is {central}; allowed: {allowed}")
        if self.range_cm is not None:
            why = " (range_cm): no mirror image is seen farther than the ring itself"
            check_range("reflection_range_cm", self.reflection_range_cm, 0, self.range_cm, why)
        if self.frames_per_s is not None:
            why = f", the time in ms from one picture to the next at {self.frames_per_s:g} frames_per_s"
            check_range("latency_ms", self.latency_ms, 0, 1000 / self.frames_per_s, why)
        elif self.latency_ms > 0:
            said = f"latency_ms is {self.latency_ms:g}, frames_per_s is null"
            raise ValueError(f"{said}; give frames_per_s, or leave latency_ms out")


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

    count: Annotated[WholeNumber, Field(ge=0, le=100_000)] = 10
    """Number of robots in the group, 0 for none; N of thesis 4.2.1, where there is one group."""
    kind: RobotKind | None = None
    """Kind of its robots; by default that of the section `robot`."""
    present: bool = True
    """Whether its robots are in the arena at the start; else the schedule adds them."""
    placement: Literal["random", "grid", "poses"] = "random"
    """`random`: anywhere without overlap; `grid`: on points 10 cm apart (thesis 4.3.1); `poses`: as in `poses`."""
    poses: tuple[Pose, ...] | None = None
    """`x_cm, y_cm, heading_rad` of each robot, instead of a placement."""
    controller: str = "firefly"
    """Name of a shipped or installed controller, or a file (.py, .c or .so), relative to the scenario's file."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The controller's parameters by name; those that are left out have the controller's defaults."""
    memory: dict[str, Any] = Field(default_factory=dict)
    """Memory at the start, by name, instead of what the controller starts with: a number, or one entry
    for each robot; `phase_ms` is an oscillator's phase."""
    signal: SignalSection = CameraSignal.model_construct()
    camera: CameraSection = CameraSection.model_construct()
    infrared: InfraredSection = InfraredSection.model_construct()
    sensors: Annotated[dict[str, dict[str, Any]], BeforeValidator(sensors_by_name)] = Field(default_factory=dict)
    """Sensors in files of their own, each with its parameters: `[ground.py, {light.py: {range_cm: 30}}]`."""

    @classmethod
    def keys_in_files(cls, values: Mapping[str, Any], folder: Path | None) -> dict[str, Sequence[str]]:
        """Return the names of parameters of controller and sensors, and of fields of the controller's memory."""
        names: dict[str, Sequence[str]] = {}
        sensors = values["sensors"]
        files = {name: each[FILE] for name, each in sensors.items()} if isinstance(sensors, Mapping) else {}
        with suppress(EpuckSimError):  # errors in files are reported when the scenario is validated
            found = {name: find_sensor(file, folder).parameters for name, file in files.items()}
            names["sensors"] = [f"{name}.{parameter}" for name, each in found.items() for parameter in each]
        with suppress(EpuckSimError):
            known = find_controller(str(values["controller"]), folder)
            names |= {"parameters": list(known.parameters), "memory": list(known.memory.names or ())}
        return names

    @model_validator(mode="before")
    @classmethod
    def _count_poses(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("poses") is not None:
            poses = given["poses"]
            count = {"count": len(poses)} if isinstance(poses, list | tuple) else {}
            return {"placement": "poses", **count, **given}
        return given

    def _check_together(self) -> None:
        if self.poses is None and self.placement == "poses":
            raise ValueError("placement is 'poses' but there are none; give poses: [[x_cm, y_cm, heading_rad], ...]")
        if self.poses is not None and self.placement != "poses":
            raise ValueError(f"placement is {self.placement!r} and poses are given; leave one of them out")
        if self.poses is not None and len(self.poses) != self.count:
            raise ValueError(f"count is {self.count} but there are {len(self.poses)} poses; leave count out")
        if self.signal.kind != "camera" and self.camera != CameraSection():
            raise ValueError(f"signal.kind is {self.signal.kind!r} and a camera is given; leave one of them out")

    @property
    def signal_is_random(self) -> bool:
        """Whether random numbers decide if, or when, a flash reaches a robot."""
        return self.signal.loss > 0 if isinstance(self.signal, RadioSignal) else self.camera.frames_per_s is not None

    @property
    def pixels(self) -> int:
        """Number of pixels in the row that controllers read: the camera's, or one that other signals set."""
        return self.camera.pixels if self.signal.kind == "camera" else 1

    @property
    def pictures(self) -> int:
        """Number of pictures that a robot holds: the present one, and those in view and not yet delivered, if any."""
        return 1 if self.camera.frames_per_s is None else 3


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
    """Raise ValueError if robots do not fit into the arena, are too fast, or lack what a group needs."""
    _check_room(kinds, [group.count if group.present else 0 for group in groups], arena)
    for number, (kind, group) in enumerate(zip(kinds, groups, strict=True)):
        section = "robot" if group.kind is None else f"robots.{number}.kind"
        why = f" at timing.physics_hz {physics_hz}; faster robots need a higher one, or they overlap"
        check_range(f"{section}.wheel_limit_cm_s", kind.wheel_limit_cm_s, 0, STEP_CM * physics_hz, why)
        if kind.camera is None and group.signal.kind in ("camera", "enki_camera"):
            said = f"is {group.signal.kind!r}, but the robot {kind.kind!r} has no camera"
            allowed = "cone or radio, as in signal: {kind: radio, range_cm: 10}"
            raise ValueError(f"robots.{number}.signal.kind {said}; allowed: {allowed}")
        if group.placement == "grid" and 2 * kind.radius_cm > GRID_SPACING_CM:
            said = f"is 'grid', whose points are {GRID_SPACING_CM:g} cm apart"
            wide = f"robots are {2 * kind.radius_cm:g} cm wide"
            raise ValueError(f"robots.{number}.placement {said}, and {wide}; allowed: random or poses")


def _check_room(kinds: Sequence[RobotKind], counts: Sequence[int], arena: ArenaSection) -> None:
    wide: Counter[float] = Counter()
    for kind, count in zip(kinds, counts, strict=True):
        wide[2 * kind.radius_cm] += count
    for key, side_cm in (("width_cm", arena.width_cm), ("height_cm", arena.height_cm)):
        check_range(f"arena.{key}", side_cm, max(wide), LARGEST)
    densest = math.pi / math.sqrt(12) if len(wide) == 1 else 1.0  # of equal discs; other ones may fill the gaps
    covered_cm2 = sum(robots * math.pi * (diameter_cm / 2) ** 2 for diameter_cm, robots in wide.items())
    if covered_cm2 > densest * arena.width_cm * arena.height_cm:
        listed = " and ".join(f"{robots} robots of {diameter_cm:g} cm" for diameter_cm, robots in (+wide).items())
        size = f"{arena.width_cm:g} x {arena.height_cm:g} cm"
        raise ValueError(f"{listed} do not fit into the arena of {size}; give fewer robots or a larger arena")


def resolve_group(
    group: RobotGroup, step_ms: int, origin: str, folder: Path | None, *, controller_is_swept: bool
) -> RobotGroup:
    """Return the group with all parameters and the paths of its files; a controller that is swept stays as it is."""
    resolved = {name: resolve_sensor(own, f"{origin}.sensors.{name}", folder) for name, own in group.sensors.items()}
    sensors = {name: {FILE: sensor.stored_name, **parameters} for name, (sensor, parameters) in resolved.items()}
    if controller_is_swept:
        return group.model_copy(update={"sensors": sensors})
    with refused_at(f"{origin}.controller"):
        controller = find_controller(group.controller, folder)
        check_sensed(controller, tuple(name for sensor, _ in resolved.values() for name in sensor.readings.names or ()))
    parameters = resolve_parameters(controller, group.parameters, step_ms, origin)
    with refused_at(f"{origin}.memory"):
        for name, value in group.memory.items():
            _check_memory(controller, name, value, group.count, parameters)
    found = {"controller": controller.stored_name, "parameters": parameters, "sensors": sensors}
    return group.model_copy(update=found)


def resolve_parameters(
    controller: Controller, given: Mapping[str, object], step_ms: int, origin: str
) -> dict[str, Value]:
    """Return all parameters of a controller, as given or by default; see `resolve_group`."""
    with refused_at(f"{origin}.parameters"):
        parameters = controller.resolve(given)
        if controller.is_oscillator and controller.period_s(parameters) * 1000 <= step_ms:
            allowed = f"longer than a control step, {step_ms / 1000:g} s"
            raise ValueError(f"period_s is {parameters['period_s']}; allowed: {allowed}")
    return parameters


def _check_memory(controller: Controller, name: str, given: Any, robots: int, parameters: Mapping[str, Value]) -> None:
    known = list(controller.memory.names or ())
    if name not in known:
        raise ValueError(f"{did_you_mean(name, known)}; {controller.name} has {comma_list(known)}")
    field = controller.memory[name]
    try:
        values = np.asarray(given, np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.full(1, np.nan)
    is_whole = np.issubdtype(field.base, np.integer)
    number = "a whole number" if is_whole else "a number"
    shapes = {(): number, (robots, *field.shape): f"a list of {robots}, one for each robot"}
    is_integral = not (is_whole and ((values % 1).any() or (np.abs(values) >= 2.0**63).any()))
    if values.shape not in shapes or not np.isfinite(values).all() or not is_integral:
        raise ValueError(f"{name} is {short_yaml(given)}; allowed: {' or '.join(shapes.values())}")
    if name == "phase_ms" and controller.is_oscillator:
        period_ms = controller.period_s(parameters) * 1000
        if not ((values >= 0) & (values < period_ms)).all():
            raise ValueError(f"phase_ms is {short_yaml(given)}; allowed: 0 to below the period, {period_ms:g}")


def replace_controllers(given: Mapping[str, Any], name: str, origin: str) -> dict[str, Any]:
    """Return a scenario's keys with another controller for all robots, and only the parameters and memory it has."""
    if given.get("model", "embodied") != "embodied":
        raise ScenarioError(f"{origin}: --controller {name}: model is {given['model']}; controllers run on robots")
    groups = given.get("robots", [{}])
    if not are_groups(groups):
        raise ScenarioError(f"{origin}: robots is {short_yaml(groups)}; allowed: a list of groups")
    with refused_at(f"{origin}: --controller {name}"):
        controller = find_controller(name)
    lacking = {
        section: dict.fromkeys(key for group in groups for key in group.get(section) or {} if key not in names)
        for section, names in _own_names(controller).items()
    }
    for section, unknown in lacking.items():
        if unknown:
            kind = "memory" if section == "memory" else "parameters" if len(unknown) > 1 else "the parameter"
            warnings.warn(f"{origin}: {controller.name} lacks {kind} {', '.join(unknown)}: left out", stacklevel=3)
    return {**given, "robots": [{**_without(group, lacking), "controller": controller.stored_name} for group in groups]}


def share_parameters(given: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the scenario of each point before its axes are set to the values in its row.

    Where the controller of a group is an axis, each of these controllers gets only those of the group's parameters and
    memory that it has. A name that none of them has, nor the shipped one that they replace, is refused with the point.
    """
    bases = [list(given.get("robots", ())) for _ in rows]
    for number, group in enumerate(given.get("robots", ())):
        key = f"robots.{number}.controller"
        if key in rows[0]:
            own = [_own_names(find_controller(str(row[key]))) for row in rows]
            shipped = [_own_names(find_controller(name)) for name in {group["controller"]} & set(CONTROLLER.shipped())]
            of_any = {section: set().union(*(names[section] for names in own + shipped)) for section in own[0]}
            for base, names in zip(bases, own, strict=True):
                base[number] = _without(group, {section: of_any[section] - names[section] for section in names})
    return [{**given, "robots": base} if base else dict(given) for base in bases]


def _own_names(controller: Controller) -> dict[str, set[str]]:
    return {"parameters": set(controller.parameters), "memory": set(controller.memory.names or ())}


def _without(group: Mapping[str, Any], lacking: Mapping[str, Collection[str]]) -> dict[str, Any]:
    kept = {
        section: {name: value for name, value in (group[section] or {}).items() if name not in names}
        for section, names in lacking.items()
        if section in group
    }
    return {**group, **kept}
