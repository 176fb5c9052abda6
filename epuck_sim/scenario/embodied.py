"""A scenario of robots with bodies: the arena, the robots in it, physics, what disturbs them, and when a trial ends.

Every key is optional; the defaults are those of thesis section 4.2.1 (the dashed lines of Figs. 4.2 and 4.3).
"""

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.arena import ArenaSection, OverheadSection, find_picture
from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber, check_range, refused_at
from epuck_sim.scenario.changes import AnyFault, RobotScheduleEntry, check_changes, concerns, notes_on_faults
from epuck_sim.scenario.robot_kind import RobotKind, check_readings, sensor_parameters
from epuck_sim.scenario.robots import RobotGroup, check_robots, members, resolve_group, resolve_parameters
from epuck_sim.scenario.scenario import ORDER_PARAMETER, Scenario, StopSection
from epuck_sim.util.messages import comma_list


class ContactSection(ConfigModel):
    """Contacts of bodies; by default they slide past each other (thesis 3.1.4.1)."""

    later_keys: ClassVar[tuple[str, ...]] = ("robots", "drive_force_n")

    friction: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Coefficient of friction between bodies."""
    robots: bool = True
    """Whether robots touch each other; else they touch walls, obstacles and movables only."""
    drive_force_n: Positive = 0.5
    """Largest force in newtons with which wheels drive or hold a robot where there are `arena.movables`; our estimate:
    the friction of wheels that bear about two thirds of the weight. Elsewhere, wheels set velocities."""


class TimingSection(ConfigModel):
    """How often robots sense and act, and how often bodies move (thesis 3.1.4.1)."""

    control_hz: Annotated[WholeNumber, Field(ge=1, le=1000)] = 10
    """Control steps a second, in each of which every robot senses and acts once."""
    physics_hz: Annotated[WholeNumber, Field(ge=100, le=10_000)] = 100
    """Physics steps a second; with fewer than 100, bodies would overlap by more than 1 mm before a contact is found."""

    def _check_together(self) -> None:
        if 1000 % self.control_hz:
            said = "a control step must be whole milliseconds: give a divisor of 1000"
            raise ValueError(f"control_hz is {self.control_hz}; {said}")
        if self.physics_hz % self.control_hz:
            raise ValueError(f"physics_hz is {self.physics_hz}; allowed: a multiple of control_hz, {self.control_hz}")

    @property
    def step_ms(self) -> int:
        """Milliseconds from one control step to the next."""
        return 1000 // self.control_hz


def noise_keys(given: Any) -> Any:
    """Return the keys that `noise: off` or `on` stands for; any other value stays as it is."""
    if given in ("off", "OFF", "Off", False):
        return {"wheel_speed": 0, "infrared_counts": 0}
    return {} if given in ("on", "ON", "On", True) else given


class NoiseSection(ConfigModel):
    """Noise of sensors and wheels; 0 switches one kind off, `noise: off` both."""

    wheel_speed: Annotated[Number, Field(ge=0, lt=1)] = 0.05
    """Half-width of the uniform factor around 1 by which each wheel's speed is multiplied in each control step (Enki);
    its effect depends on `timing.control_hz` (docs/real_robots.md)."""
    infrared_counts: Annotated[Number, Field(ge=0, le=10_000)] = 10.0
    """Standard deviation of the noise on each infrared reading (Enki)."""

    @model_validator(mode="before")
    @classmethod
    def _on_or_off(cls, given: Any) -> Any:
        keys = noise_keys(given)
        if not isinstance(keys, dict | ConfigModel):
            raise ValueError("on, off, or a mapping of keys to values")  # noqa: TRY004 pydantic gathers ValueErrors
        return keys


class SpreadSection(ConfigModel):
    """Differences between robots (thesis 4.4): half-widths of uniform factors around 1, drawn once a trial."""

    wheel_speed: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the speed of a robot's two wheels together."""
    wheel_imbalance: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the speed of each single wheel."""
    clock_rate: Annotated[Number, Field(ge=0, le=0.1)] = 0.0
    """Spread of the rate of the clock by which a robot's controller measures time."""
    infrared_gain: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the readings of each single infrared sensor."""


class StuckSection(ConfigModel):
    """How robots get stuck from time to time (thesis 4.4): their wheels turn but do not move them."""

    per_hour: Annotated[Number, Field(ge=0, le=3600)] = 0.0
    """Mean number of times in an hour of free motion; 0 for never."""
    mean_s: Positive = 20.0
    """Mean time in seconds until the robot is free again."""


ROBOT_BYTES, GROUP_BYTES, PIXEL_BYTES = 4800, 15_000, 8
"""Memory that a robot takes besides its pixels, a group besides its robots, and a pixel of a picture; the first two as
measured with 10,000 to 100,000 robots and with 4,000 to 20,000 groups."""

OF_PRESENT = ("order_parameter", "group_order", "threshold_cycles", "stays_above", "below_threshold", "moved")
"""Shipped measures that count only the robots in the arena."""

UNLIMITED_S = 600.0
"""Time limit in s, from its last change on, of a trial without a limit of its own whose reference is no oscillator."""

MOST_MASS_RATIO = 20.0
"""Largest ratio of masses of robots for which contacts hold: with 100, the heavy press others 4 cm into walls."""


class EmbodiedStop(StopSection):
    """When a trial ends (thesis 4.2.1)."""

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None = 0.95
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)] = 10_000
    """The trial ends after this number of cycles; without an oscillator, 5 s count as a cycle."""
    reference_robot: Annotated[WholeNumber, Field(ge=0)] = 0
    """Number of the robot whose firings are counted: from 0, in the order of the groups."""
    further_cycles: Annotated[WholeNumber, Field(ge=0, le=10**9)] = 0
    """Number of firings of the reference for which a trial goes on after synchrony, within its limits."""

    def _check_together(self) -> None:
        super()._check_together()
        if self.further_cycles and self.order_parameter is None:
            raise ValueError(f"further_cycles is {self.further_cycles}; allowed: 0 where order_parameter is null")

    def limited(self, changes_until_s: float) -> "EmbodiedStop":
        """Return the section for trials without T_sync: with a time limit after the last change if it has no limit."""
        if self.when is not None or self.max_time_s is not None or "max_cycles" in self.model_fields_set:
            return self
        values: dict[str, Any] = {**dict(self), "max_time_s": changes_until_s + UNLIMITED_S}
        return EmbodiedStop.model_construct(_fields_set=self.model_fields_set, **values)


class EmbodiedScenario(Scenario):
    """A swarm of robots, by default e-pucks (chapter 4)."""

    later_keys: ClassVar[tuple[str, ...]] = ("faults", "schedule", "robot")
    event_method: ClassVar[str] = "step"
    refused: ClassVar[tuple[str, ...]] = ("faults.N.agents",)

    model: Literal["embodied"] = "embodied"
    arena: ArenaSection = ArenaSection.model_construct()
    robot: RobotKind = RobotKind.model_construct()
    robots: tuple[RobotGroup, ...] = (RobotGroup.model_construct(),)
    noise: NoiseSection = NoiseSection.model_construct()
    spread: SpreadSection = SpreadSection.model_construct()
    stuck: StuckSection = StuckSection.model_construct()
    faults: tuple[AnyFault, ...] = ()
    schedule: tuple[RobotScheduleEntry, ...] = ()
    contact: ContactSection = ContactSection.model_construct()
    timing: TimingSection = TimingSection.model_construct()
    stop: EmbodiedStop = EmbodiedStop.model_construct()
    overhead: OverheadSection = OverheadSection.model_construct()

    def _check_together(self) -> None:
        if not self.population:
            raise ValueError("robots: has no robot; allowed: at least one in all groups, such as [{count: 10}]")
        for number, group in enumerate(self.robots):
            key, control_hz = f"robots.{number}.camera.frames_per_s", self.timing.control_hz
            check_range(key, group.camera.frames_per_s, 0.1, control_hz, " (timing.control_hz)")
        places = range(len(self.robots))
        if not any(self._is_swept(place, part) for place in places for part in ("count", "present")):
            self._check_numbers()  # else they are known at each point only
        check_robots(self.group_kinds, self.robots, self.arena, self.timing.physics_hz)

    def _check_numbers(self) -> None:
        """Raise ValueError for numbers of robots, or of groups, that there are not, or that do not fit."""
        reference = self.stop.reference_robot
        check_range("stop.reference_robot", reference, 0, self.population - 1)
        check_changes(self.drawn_faults, self.schedule, "robot", self.population)
        self._check_faults()
        for number, entry in enumerate(self.schedule):
            origin = f"schedule.{number}"
            for group, _ in entry.parameters():
                check_range(f"{origin}.set: the number of a group", group, 0, len(self.robots) - 1)
            if reference in entry.remove:
                said = f"{reference} is the reference, whose firings are counted, and must stay"
                raise ValueError(f"{origin}.remove: {said}; remove others, or give another stop.reference_robot")
        if not self.present[reference]:
            said = f"stop.reference_robot is {reference}, which is not present at the start"
            raise ValueError(f"{said}; allowed: a robot of a group with present: true, as its firings are counted")
        tags = self.overhead.tags
        if tags is not None and self.population > int(tags.partition("_")[2]):
            raise ValueError(f"overhead.tags is {tags!r}, which has too few tags for {self.population} robots")

    def _check_faults(self) -> None:
        for number, fault in enumerate(self.faults):
            where = f"faults.{number}"
            if fault.kind == "sensor_dead" and fault.sensor not in self.sensor_names:
                own = comma_list(self.sensor_names)
                raise ValueError(f"{where}.sensor is {fault.sensor!r}; allowed: a sensor in a file of its own: {own}")
            for place, group, robots in members(self.robots):
                if fault.changes == "flashes" and group.signal.kind == "radio" and concerns(fault.robots, robots):
                    said = f"kind is {fault.kind!r}, but robots.{place} has no camera: its signal is radio"
                    raise ValueError(f"{where}: {said}; give the numbers of others in robots, or robots.*.signal.loss")
                is_named = fault.robots is not None and concerns(fault.robots, robots)
                if fault.kind == "sensor_dead" and is_named and fault.sensor not in group.sensors:
                    raise ValueError(f"{where}: names robots of robots.{place}, which has no sensor {fault.sensor}")

    @property
    def drawn_faults(self) -> tuple[AnyFault, ...]:
        """The faults, of which that of a sensor names the robots that have it, if it names none."""
        owners: dict[str, tuple[int, ...]] = {}
        for _, group, robots in members(self.robots):
            owners |= {name: (*owners.get(name, ()), *robots) for name in group.sensors}
        dead = ((fault, owners.get(getattr(fault, "sensor", ""))) for fault in self.faults)
        return tuple(fault if fault.robots or not by else fault.model_copy(update={"robots": by}) for fault, by in dead)

    @property
    def group_kinds(self) -> tuple[RobotKind, ...]:
        """Kind of robot of each group."""
        return tuple(group.kind or self.robot for group in self.robots)

    @property
    def robot_kinds(self) -> list[RobotKind]:
        """Kind of each robot."""
        return [kind for kind, group in zip(self.group_kinds, self.robots, strict=True) for _ in range(group.count)]

    @property
    def present(self) -> list[bool]:
        """Whether each robot is in the arena at the start."""
        return [group.present for group in self.robots for _ in range(group.count)]

    @property
    def members_change(self) -> bool:
        """Whether robots come and go."""
        return any(entry.remove or entry.add for entry in self.schedule) or not all(self.present)

    @property
    def sensor_names(self) -> list[str]:
        """Names of the sensors in files of their own, of all groups, each once."""
        return list(dict.fromkeys(name for group in self.robots for name in group.sensors))

    @property
    def population(self) -> int:
        """Robots in all groups."""
        return sum(group.count for group in self.robots)

    @property
    def memory_bytes(self) -> int:
        """Estimate of the memory that a trial takes, besides that of the program."""
        shown = self.population * self.camera_pixels
        own = sum(group.count * group.pixels * (group.pictures - 1) for group in self.robots)
        return ROBOT_BYTES * self.population + GROUP_BYTES * len(self.robots) + PIXEL_BYTES * (shown + own)

    @property
    def controllers(self) -> tuple[str, ...]:
        """Controller of each group."""
        return tuple(group.controller for group in self.robots)

    @property
    def has_t_sync(self) -> bool:
        """See `Scenario.has_t_sync`: by a threshold only if the reference is an oscillator."""
        return self.stop.gives_t_sync or (super().has_t_sync and self.has_reference)

    @property
    def notes(self) -> list[str]:
        """Notes of `Scenario.notes`, and those on trials without T_sync and on changes that never happen."""
        stop, found, limit_s = self.stop, super().notes, self.stop.max_time_s
        is_limited = stop.order_parameter is None or "max_time_s" in stop.model_fields_set
        if not is_limited and not self.has_reference:
            ends = f"{stop.max_cycles} cycles of 5 s" if limit_s is None else f"{limit_s:g} simulated seconds"
            said = f"robot {stop.reference_robot} is no oscillator, so trials have no T_sync; they end after {ends}"
            found.append(f"{said}; for another limit: --set stop.max_time_s=3600")
        awaited = {} if self.has_reference else self.conditions
        never = f"never holds: order is measured at firings of robot {stop.reference_robot}, which is no oscillator"
        found += [f"{key} {never}" for key, (each, _) in awaited.items() if each.measure == ORDER_PARAMETER]
        for number, group in enumerate(() if self.sweep else self.robots):
            least, most = group.parameters.get("flash_pixels", 0), group.camera.central_pixels or group.pixels
            if least > most:
                shown = f"signal {group.signal.kind} shows {most} at most: these robots see no flash"
                found.append(f"robots.{number}.parameters.flash_pixels is {least:g}, but {shown}")
            if (most_turned := max((abs(heading) for *_, heading in group.poses or ()), default=0)) > math.tau:
                found.append(f"robots.{number}.poses: a heading is {most_turned:g} rad: 90 degrees are 1.5708")
        masses_g = [kind.mass_g for kind in self.robot_kinds if self.contact.robots] or [1.0]
        if (ratio := max(masses_g) / min(masses_g)) > MOST_MASS_RATIO:
            said = f"masses of robots differ by a factor of {ratio:.3g}: heavier ones press others into walls"
            found.append(f"{said}; keep them within {MOST_MASS_RATIO:g}")
        moved = {robot for entry in self.schedule for robot in entry.remove}
        for number, entry in enumerate(() if self.sweep else self.schedule):
            if always := [robot for robot in entry.add if self.present[robot] and robot not in moved]:
                found.append(f"schedule.{number}.add: in the arena all the time: {', '.join(map(str, always))}")
        return [*found, *notes_on_faults(self.faults, self.schedule, "robot", stop.reference_robot)]

    @property
    def scales(self) -> dict[str, float]:
        """Coupling epsilon and period tau (s) of the first group, number N of robots, root L (cm) of the area."""
        oscillator = self.robots[0].parameters
        return {
            "epsilon": float(oscillator.get("coupling", math.nan)),
            "L": math.sqrt(self.arena.width_cm * self.arena.height_cm),
            "N": float(self.population),
            "tau": float(oscillator.get("period_s", math.nan)),
        }

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        groups = [f"robots.{number}" for number in range(len(self.robots))]
        of_groups = (f"{group}.{key}" for group in groups for key in ("count", "parameters.speed_cm_s"))
        oscillator = (f"{groups[0]}.parameters.{name}" for name in ("coupling", "period_s"))
        return ("arena.width_cm", "arena.height_cm", *of_groups, *oscillator)

    @property
    def camera_pixels(self) -> int:
        """Largest number of pixels in a row that a controller reads."""
        return max(group.pixels for group in self.robots)

    def resolved(self, origin: str, folder: Path | None = None) -> Self:
        """Return the scenario with controllers, measures, parameters and the floor's picture found; see `Scenario`."""
        robots: list[RobotGroup] = []
        for number, group in enumerate(self.robots):
            where, is_swept = f"{origin}: robots.{number}", f"robots.{number}.controller" in self.swept
            robots.append(resolve_group(group, self.timing.step_ms, where, folder, controller_is_swept=is_swept))
        check_readings([group.sensors for group in robots], origin)
        found = self.model_copy(update={"robots": tuple(robots)})
        found._check_oscillators(origin)
        found._check_set_parameters(origin)
        floor, stop = self.arena.floor, self.stop
        with refused_at(f"{origin}: arena.floor.picture"):
            picture = floor.picture and find_picture(floor.picture, folder)
        arena = self.arena.model_copy(update={"floor": floor.model_copy(update={"picture": picture})})
        if not found.has_reference:
            stop = stop.limited(max((each.at_s or 0.0 for each in (*self.schedule, *self.faults)), default=0.0))
        found = found.model_copy(update={"arena": arena, "stop": stop})
        found = super(EmbodiedScenario, found).resolved(origin, folder)
        for number, section in enumerate(found.measures if found.members_change else ()):
            if not section.find().sources and section.measure not in OF_PRESENT:
                said = f"{section.measure} assumes that all robots are in the arena, but some come or go"
                allowed = f"{', '.join(OF_PRESENT)}, and measures of your own"
                raise ScenarioError(f"{origin}: measures.{number}: {said}; allowed: {allowed}")
        if not any(f"{key}.".startswith(("arena.", "robot.", "robots.")) and key.count(".") < 3 for key in self.swept):
            found._check_arenas(f"{origin}: schedule")
        return found

    def _is_swept(self, place: int, part: str) -> bool:
        """Return whether a part of a group, such as its controller, is known at each point of a sweep only."""
        return not {part, "robots", f"robots.{place}", f"robots.{place}.{part}"}.isdisjoint(self.swept)

    def _check_oscillators(self, origin: str) -> None:
        """Raise ScenarioError if faults or a schedule change phases of robots that have none."""
        faults, schedule = enumerate(self.faults), enumerate(self.schedule)
        frozen = ((f"faults.{at}: kind is {each.kind!r}, but", each) for at, each in faults if each.changes == "phase")
        displaced = ((f"schedule.{at}.displace:", each.displace) for at, each in schedule if each.displace)
        changes = [(said, each.robots) for said, each in (*frozen, *displaced)]
        for place, group, robots in members(self.robots):
            said = next((said for said, whom in changes if concerns(whom, robots)), None)
            if said and not self._is_swept(place, "controller"):
                controller = find_controller(group.controller)
                if not controller.is_oscillator:
                    why = f"robots.{place} are no oscillators: their controller is {controller.name}"
                    raise ScenarioError(f"{origin}: {said} {why}; give the numbers of others in robots")

    def _check_set_parameters(self, origin: str) -> None:
        """Raise ScenarioError if a schedule sets parameters that controllers or sensors do not have, or refuse."""
        at_first = [group.parameters for group in self.robots]
        timed = list(at_first)  # after the entries with a time, which come one after the other
        for number, entry in sorted(enumerate(self.schedule), key=lambda numbered: numbered[1].at_s or 0.0):
            present = list(at_first) if entry.at_s is None else timed
            for (place, sensor), values in entry.parameters().items():
                if self._is_swept(place, "sensors" if sensor else "controller"):
                    continue
                group, where = self.robots[place], f"{origin}: schedule.{number}.set: robots.{place}"
                if sensor is not None:
                    sensor_parameters(group.sensors, sensor, values, f"{where}.sensors")
                else:
                    present[place] = {**present[place], **values}
                    resolve_parameters(find_controller(group.controller), present[place], self.timing.step_ms, where)

    def _check_arenas(self, origin: str) -> None:
        """Raise ScenarioError if an entry of the schedule makes an arena that is not allowed.

        All entries that change the arena must set the same keys. So the arena after each is known beforehand, whatever
        entries come before it. A picture of a floor is stretched between walls that do not move.
        """
        entries = arena_entries(self)
        for number in entries:
            values, first = (self.schedule[each].arena_values() for each in (number, entries[0]))
            keys = [", ".join(f"arena.{name}" for name in sorted(each)) for each in (values, first)]
            where = f"{origin}.{number}.set: sets {keys[0]}, but"
            if keys[0] != keys[1]:
                other = f"schedule.{entries[0]}.set sets {keys[1]}"
                raise ScenarioError(f"{where} {other}; set the same keys of the arena in all entries that change it")
            if self.arena.floor.picture is not None and values.keys() - {"obstacles"}:
                advice = "give patches instead, or set arena.obstacles alone"
                raise ScenarioError(f"{where} arena.floor.picture is stretched between the walls; {advice}")
            arena = {**self.arena.model_dump(exclude=STAYING), **values}
            others = self.model_dump(include={"robot", "robots", "timing", "stop"})
            self.validated({**others, "arena": arena}, f"{origin}.{number}.set")

    @property
    def has_reference(self) -> bool:
        """Whether the reference is an oscillator, or may be one at a point of a sweep; else a cycle is 5 s long."""
        return all(
            self._is_swept(place, "controller") or find_controller(group.controller).is_oscillator
            for place, group, robots in members(self.robots)
            if self.stop.reference_robot in robots
        )


STAYING = {"movables", "floor", "lamps"}  # keys of the arena that no schedule changes


def arena_after(scenario: EmbodiedScenario, entry: int) -> ArenaSection:
    """Return the arena after an entry of the schedule, with its movables at their initial places."""
    given = {**scenario.arena.model_dump(exclude=STAYING), **scenario.schedule[entry].arena_values()}
    stays = {key: getattr(scenario.arena, key) for key in STAYING}
    return ArenaSection.model_validate(given).model_copy(update=stays)


def largest_cm(scenario: EmbodiedScenario) -> tuple[float, float]:
    """Return the largest width and height, cm, that the arena has in a trial."""
    sections = [scenario.arena, *(arena_after(scenario, entry) for entry in arena_entries(scenario))]
    return max(section.width_cm for section in sections), max(section.height_cm for section in sections)


def arena_entries(scenario: EmbodiedScenario) -> list[int]:
    """Return the numbers of the entries that change the arena."""
    return [number for number, entry in enumerate(scenario.schedule) if entry.arena_values()]
