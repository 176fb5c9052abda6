"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step all robots sense the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. Other robots see the effects of a command in the next step.
"""

import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.control.interface import EXTERNAL, Controller
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, to_html
from epuck_sim.embodied.bodies.world import World
from epuck_sim.embodied.changes import schedule
from epuck_sim.embodied.changes.faults import LOGGED_STEPS, begin_faults, take_events
from epuck_sim.embodied.changes.replacement import Replaced, check_alike, parameters_for, replace_controller
from epuck_sim.embodied.layout import make_swarm_block, set_arena
from epuck_sim.embodied.loop import FIRED, MOST_STEPS, ControlLoop, History, Stretch, act_again, check_command
from epuck_sim.embodied.observers import Scene
from epuck_sim.embodied.own_sensors import OwnSensor
from epuck_sim.embodied.sensors.camera import begin_pictures
from epuck_sim.embodied.start import SCHEDULE, draw_places, draw_start, put_at_given_poses, vary
from epuck_sim.embodied.step import Step, shown_steps
from epuck_sim.embodied.swarm import PATCHES, PIXELS
from epuck_sim.embodied.user_code import GroupControllers, RobotError
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.faults import begin_or_end
from epuck_sim.scenario.changes import TrialEvent, timed_entries
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_after
from epuck_sim.scenario.loader import load_of_model
from epuck_sim.scenario.robot_kind import cell_cm, sensor_parameters
from epuck_sim.scenario.robots import resolve_parameters
from epuck_sim.scenario.scenario import ScenarioLike, seed_of_trial
from epuck_sim.user_files import Value
from epuck_sim.util.machine import lack_of_memory
from epuck_sim.util.messages import ANOTHER_THREAD, numbered, whole


class Change(NamedTuple):
    """An external call that changed a simulation: control steps taken before it, the method and its arguments."""

    steps: int
    method: str
    given: tuple[Any, ...]
    values: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A simulation at one moment; can be pickled."""

    scenario: EmbodiedScenario
    seed: int
    steps: int  # control steps taken
    changes: tuple[Change, ...] = field(repr=False)  # commands and changes from outside, in order


class Simulation:
    """A swarm of e-pucks in its arena, an endless iterator over control steps.

    The first step shows the robots where they were placed; each further one first moves the bodies for one control
    interval (0.1 s by default). Then all robots sense that instant, and their controllers command rings and wheels.
    The simulation never ends by itself: `run_trial` decides when a trial is terminated (synchronised) or censored (its
    limit of cycles or of time is reached), and stops asking for steps.

    The outcome depends on the scenario and the seed alone, to the bit.

    >>> simulation = Simulation("thesis", seed=1)
    >>> step = next(iter(simulation))
    >>> step.poses.shape, step.camera.shape
    ((10, 3), (10, 60))
    """

    scenario: EmbodiedScenario
    seed: int
    step_s: float
    """Seconds from one control step to the next."""
    events: list[TrialEvent]
    """Entries of the schedule that were carried out, and faults that began and ended, in the order of their steps."""
    external_wheels: IntArray
    """(n,) numbers of the robots whose wheels are commanded from outside; see `command`."""
    external_rings: IntArray
    """(m,) numbers of the robots whose rings are commanded from outside."""
    is_firing: bool
    """Whether the reference, an oscillator, fires in the last step (thesis 4.2.1)."""

    def __init__(self, scenario: ScenarioLike, seed: int | None = None, *, interpret: bool = False) -> None:
        """Place the robots and start their controllers.

        Args:
            scenario: A scenario of model `embodied` without a sweep, or what `load_scenario` takes.
            seed: The trial's seed, 0 or more; the scenario's own if None.
            interpret: Run controllers as plain Python instead of compiled, with the same outcome.

        Raises:
            ScenarioError: The scenario or the seed is not allowed, or the robots fit neither into the arena nor into
                the memory of this machine.
            ControllerError: A controller cannot be compiled, or raises at its start.
        """
        why = "a Simulation needs model: embodied; use ParticleSimulation"
        self.scenario = scenario = load_of_model(scenario, EmbodiedScenario, why)
        seed = seed_of_trial(scenario, seed)
        if lack := lack_of_memory(scenario.memory_bytes):
            raise ScenarioError(f"{scenario.name}: a trial {lack}; give fewer robots, or cameras with fewer pixels")
        self._step_ms, self._interpret = scenario.timing.step_ms, interpret
        self.step_s = self._step_ms / 1000
        self._most_unseen = LOGGED_STEPS if scenario.faults else MOST_STEPS  # largest number of steps in one call
        self._absent = np.flatnonzero(~np.array(scenario.present)).tolist()
        self._has_replaced, self._turn = False, Lock()  # which a thread holds while it takes steps
        controllers = [find_controller(group.controller) for group in scenario.robots]
        self._own_sensors = [[find_sensor(own["file"]) for own in group.sensors.values()] for group in scenario.robots]
        self._block, self._swarm, self._arenas = make_swarm_block(scenario, controllers, self._own_sensors)
        self._world = World(self._arenas, scenario.robot_kinds, scenario.contact)
        groups = zip(controllers, scenario.robots, strict=True)
        self._build(controllers, [each.parameter_record(section.parameters) for each, section in groups])
        self.reset(seed)

    def _build(self, controllers: list[Controller], parameters: list[npt.NDArray[np.void]]) -> None:
        """Create the objects that use the swarm's block, with these controllers and parameters of the groups."""
        scenario, block, swarm, interpret = self.scenario, self._block, self._swarm, self._interpret
        put_at_given_poses(swarm, scenario)
        self._scene = Scene(scenario.robots, block, swarm)
        self._step: IntArray = swarm.scene["step"]  # (1,) the number of the last step taken
        self._starts: BoolArray = swarm.scene["starts"]  # (1,) whether controllers start
        self._actuators = swarm.robots["actuators"].view(np.ndarray)  # quicker than a recarray
        self._robots_vary = bool(swarm.scene["robots_vary"][0])
        self._groups, self._sensors = [], list[OwnSensor]()
        for number, (controller, section) in enumerate(zip(controllers, scenario.robots, strict=True)):
            own = self._own_sensors[number]
            group = GroupControllers(block, swarm, number, controller, own, interpret=interpret)
            group.parameters[:] = parameters[number]
            self._groups.append(group)
            for (name, given), sensor in zip(section.sensors.items(), own, strict=True):
                sensed = OwnSensor(block, swarm, len(self._sensors), name, sensor, interpret=interpret)
                sensed.parameters[:] = sensor.parameter_record({key: given[key] for key in sensor.parameters})
                self._sensors.append(sensed)
        self._first_parameters = parameters
        self._loop = ControlLoop(scenario, self._scene, self._world, self._sensors, self._groups, interpret=interpret)
        self.memory = block, self._loop.addresses  # the swarm, and where the functions are that it calls
        self.external_wheels, self.external_rings = (
            np.flatnonzero(np.repeat([part in each.external for each in controllers], swarm.groups["count"]))
            for part in EXTERNAL
        )
        swarm.robots["starts"] = self._starts[0] = True
        self._template = block[: swarm.scene[0].at[PIXELS]].copy()
        self._blank = slice(len(self._template), int(swarm.scene[0].at[PATCHES]))  # bytes that a trial begins with as 0
        self._starts[0] = False
        self._show(self._arenas[0])

    def _show(self, arena: Arena) -> None:
        """Prepare the arrays that steps show while the swarm is in this arena."""
        self._arena = arena
        self._history: History | None = None
        memories = [group.memory for group in self._groups]
        sensed = [(sensor.robots, sensor.readings) for sensor in self._sensors]
        self._shown = shown_steps(self.scenario, self._scene, arena, memories, sensed)

    def reset(self, seed: int | None = None) -> None:
        """Restart with the same outcome as a new simulation with this seed, but many times as fast.

        Parameters return to those of the scenario, and commands are cleared. Replaced controllers stay replaced.

        Args:
            seed: The trial's seed, 0 or more; the current one if None.

        Raises:
            ScenarioError: The seed is not allowed, or the robots do not fit into the arena.
            ControllerError: A controller raises at its start.
        """
        scenario, block, addresses = self.scenario, self._block, self._loop.addresses
        self.seed = self.seed if seed is None else seed_of_trial(scenario, seed)
        self._changes: list[Change] = []
        self.events = []
        self._timed = timed_entries(  # by the first control step at or after a time
            scenario.schedule, lambda at_s: math.ceil(round(at_s * 1000, 6) / self._step_ms), sys.maxsize
        )
        self.is_firing = False
        self._clear(block)
        draw_start(block, self.seed)
        for sensor in self._sensors:
            sensor.draw_streams(self.seed)
        if self._robots_vary:
            vary(block)
        draw_places(block, scenario)
        self._world.place()
        if self._arena is not self._arenas[0]:
            self._show(self._arenas[0])
        if scenario.faults:
            begin_faults(block, scenario, self.seed)
        for number, (group, section) in enumerate(zip(self._groups, scenario.robots, strict=True)):
            if not section.count:
                continue
            if section.signal.kind == "camera" and section.camera.frames_per_s is not None:
                begin_pictures(block, number)
            try:
                group.run(block, addresses, number)  # starts all controllers: the template flags them all
            except BaseException as error:  # whatever a user's controller may raise
                raise self.located(error) from error
            for name, value in section.memory.items():
                group.memory[name] = value
        self._starts[0] = False
        schedule.take_out(self._absent, self._swarm, self._world, self._groups)

    def _clear(self, block: ByteArray) -> None:
        block[: len(self._template)] = self._template
        block[self._blank] = 0

    @property
    def controllers(self) -> list[Controller]:
        """The controller of each group."""
        return [group.controller for group in self._groups]

    @property
    def period_ms(self) -> FloatArray:
        """(robots,) ms: the oscillators' periods; NaN for robots without an oscillator."""
        return np.repeat([group.period_ms for group in self._groups], self._swarm.groups["count"])

    @property
    def steps(self) -> int:
        """Control steps taken so far."""
        return self._step.item() + 1

    @property
    def last_step(self) -> Step:
        """The last step; before the first one, a step numbered -1 with the robots' initial poses and phases."""
        number = self._step.item()
        return self._shown(number, number * self._step_ms / 1000)

    def beginning(self) -> tuple[ByteArray, Mapping[int, Any]]:
        """Return the block before anything is drawn, and the functions that control steps call, by index: for pages."""
        block = self._block.copy()
        self._clear(block)
        return block, self._loop.functions

    def at_work(self) -> tuple[int, int, str] | None:
        """Return robot, step and name of the user's code that is running, for another thread; None if none is."""
        robot, sensor = int(self._swarm.scene["serving"][0]), int(self._swarm.scene["sensing"][0])
        code = f"sensor {self._sensors[sensor - 1].name}" if sensor else "controller"
        return (robot, int(self._step[0]), code) if robot >= 0 else None

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Step:
        return self.advance(1)

    def advance(self, steps: int, *, until_firing: bool = False) -> Step:
        """Take several control steps, faster than one by one, and return the last of them.

        Args:
            steps: Number of steps to take, at least 1.
            until_firing: Whether to stop after a step in which the reference fires; see `is_firing`.

        Returns:
            The last step; its arrays are overwritten by the next one.

        Raises:
            ValueError: The number of steps is not a whole number from 1, or another thread is taking steps.
            ControllerError: A controller raises, or sets a wheel speed or a turn that is not a number.
        """
        end = self.steps + whole("steps", steps)
        while True:
            self._run(self._unchanged(end), until_firing)
            step = self.last_step
            if step.number + 1 >= end or (until_firing and self.is_firing):
                return step

    def one_by_one(self, steps: int) -> Iterator[Step]:
        """Take and show up to `steps` steps in one arena, at most to the reference's next firing; see `advance`."""
        taken = self.steps
        for number in range(taken, taken + self._unchanged(taken + steps)):
            self._run(1)
            yield self._shown(number, number * self._step_ms / 1000)
            if self.is_firing:
                return

    def stretch(self, steps: int) -> Stretch:
        """Take up to `steps` steps in one arena, at most to the reference's next firing; return data for measures.

        Raises what `advance` does.
        """
        first = self.steps
        steps = self._unchanged(first + whole("steps", steps))  # in an arena that may be new
        if self._history is None:
            self._history = History(self._scene, self._loop)
        has_movables = self._arena.first_movable < len(self._arena.circles)
        self._run(1 if has_movables else steps, True, self._history)
        return self._history.stretch(first, self.steps - first)

    def _unchanged(self, end: int) -> int:
        """Carry out the entries of the schedule that are due; return how many steps up to `end` may follow at once."""
        taken = self.steps
        while self._timed[0][0] == taken:
            self._carry_out(self._timed.popleft()[1])
        return min(self._timed[0][0] - taken, end - taken, self._most_unseen)

    def _run(self, steps: int, until_firing: bool = True, history: History | None = None) -> None:
        """Take control steps; the error of a controller that fails names the robot."""
        if not self._turn.acquire(False):  # Chipmunk would end the process
            raise ValueError(ANOTHER_THREAD)
        try:
            outcome = history.take(steps) if history else self._loop.take_steps(*self.memory, steps, until_firing)
        except BaseException as error:  # whatever a user's controller may raise
            raise self.located(error) from error
        finally:
            self._turn.release()
        self.conclude(outcome)

    def conclude(self, outcome: int) -> None:
        """Record the outcome of `take_steps`; raise ControllerError, with the robot, if a command is not a number."""
        self.is_firing = outcome == FIRED
        if outcome >= 0:
            path = next(group.controller.path for group in self._groups if outcome < group.robots.stop)
            where = f"{self._location(outcome)}: {path}"
            raise ControllerError(f"{where}: sets a wheel speed or a turn that is not a number")
        if self.scenario.faults:
            self.events += take_events(self._swarm)

    def located(self, error: BaseException) -> BaseException:
        """Return the error of a controller with its location; any other error as it is."""
        for code in (*self._sensors, *self._groups):
            if fault := code.fault(error):
                return ControllerError(f"{self._location(fault.robot)}: {fault}")
        return error

    def _location(self, robot: int) -> str:
        return f"{self.scenario.name}: robot {robot}, step {max(self.steps - 1, 0)}, seed {self.seed}"

    def command(
        self,
        left_cm_s: npt.ArrayLike | None = None,
        right_cm_s: npt.ArrayLike | None = None,
        ring_on: npt.ArrayLike | None = None,
    ) -> None:
        """Command the robots that are driven from outside: those whose controller is `external`, or the like.

        A command takes effect in the last step, as if a controller had given it after sensing in that step: robots move
        accordingly until the next step, in which other robots see the rings. It holds until the next command. Arguments
        that are left out change nothing.

        Args:
            left_cm_s: (n,) cm/s: left wheel of each of `external_wheels`, or one number for all; limited to the
                wheels' largest speed, as commands of controllers are.
            right_cm_s: (n,) cm/s: right wheel of each.
            ring_on: (m,) whether the ring of each of `external_rings` is lit, or one value for all.

        Raises:
            ValueError: An array has another shape, a speed is not a number, there is no such robot, or nothing is
                given; then nothing is commanded.
        """
        given = {"left_cm_s": left_cm_s, "right_cm_s": right_cm_s, "ring_on": ring_on}
        commands = {name: np.array(values) for name, values in given.items() if values is not None}
        if not commands:
            raise ValueError("nothing is commanded; give left_cm_s, right_cm_s or ring_on")
        robots = {name: self.external_rings if name == "ring_on" else self.external_wheels for name in commands}
        for name, values in commands.items():
            check_command(name, values, robots[name])
        for name, values in commands.items():
            self._actuators[name][robots[name]] = values
        act_again(*self.memory)
        self._changes.append(Change(self.steps, "command", (), commands))

    def set_parameters(self, group: int = 0, /, **values: Value) -> None:
        """Change parameters of the controllers of a group, by its number, from the next step on.

        Its robots keep their memories, and parameters that are left out stay as they are.

        Raises:
            ScenarioError: The controller does not take these parameters.
            ValueError: There is no such group.
        """
        self._set_parameters(group, values, self.scenario.name)
        self._changes.append(Change(self.steps, "set_parameters", (group,), values))

    def _set_parameters(self, group: int, values: Mapping[str, Value], origin: str) -> None:
        changed = numbered("group", group, self._groups)
        controller = changed.controller
        given = {**controller.parameter_values(changed.parameters[0]), **values}
        resolved = resolve_parameters(controller, given, self._step_ms, f"{origin}: robots.{group}")
        changed.parameters[:] = controller.parameter_record(resolved)

    def _set_sensor(self, group: int, name: str, values: Mapping[str, Value], origin: str) -> None:
        of = name, self._groups[group].robots
        changed = next(sensor for sensor in self._sensors if (sensor.name, sensor.robots) == of)
        now = {**self.scenario.robots[group].sensors[name], **changed.sensor.parameter_values(changed.parameters[0])}
        resolved = sensor_parameters({name: now}, name, values, f"{origin}: robots.{group}.sensors")
        changed.parameters[:] = changed.sensor.parameter_record(resolved)

    def carry_out_scheduled(self, entry: int) -> None:
        """Carry out an entry of the scenario's schedule, by its number, now: its changes act from the next step on.

        Those with a time the simulation itself carries out, others `run_trial`. ValueError: there is no such entry.
        """
        self._carry_out(entry)
        self._changes.append(Change(self.steps, "carry_out_scheduled", (entry,), {}))

    def _carry_out(self, number: int) -> None:
        scenario, swarm, entry = self.scenario, self._swarm, numbered("entry", number, self.scenario.schedule)
        time_ms = self.steps * self._step_ms
        origin = f"{scenario.name}: schedule.{number}, at {time_ms / 1000:g} s, seed {self.seed}"
        phases = np.random.SeedSequence(self.seed, spawn_key=(SCHEDULE, number))
        places = np.random.SeedSequence(self.seed, spawn_key=(SCHEDULE, number, 0))
        schedule.take_out(entry.remove, swarm, self._world, self._groups)
        if entry.arena_values():
            arena = arena_after(scenario, number).build()
            set_arena(swarm, arena, cell_cm(scenario.group_kinds))
            self._world.change_arena(arena)
            self._show(arena)
            schedule.check_bodies_outside(swarm, origin)
        try:
            schedule.put_in(entry.add, entry.poses, scenario, self._block, self._world, self._groups, places, origin)
        except RobotError as error:
            raise ControllerError(f"{origin}: {error}") from error
        for (group, sensor), values in entry.parameters().items():
            if sensor is None:
                self._set_parameters(group, values, origin)
            else:
                self._set_sensor(group, sensor, values, origin)
        if entry.displace is not None:
            schedule.displace_phases(swarm, self._groups, entry.displace, phases)
        begin_or_end(swarm.affected, len(swarm.robots), entry, time_ms)
        self.events.append(TrialEvent(self.steps, time_ms / 1000, f"schedule.{number}", entry.what))

    def replace_controller(self, group: int, controller: Controller) -> Replaced:
        """Switch the robots of a group, by its number, to another controller from the next step on.

        See `embodied.changes.replacement` for the memory and parameters that they keep. From then on, scenario and seed
        alone no longer determine the simulation: it has neither snapshots nor copies.

        Returns:
            The fields of memory that robots keep, and those that begin anew.

        Raises:
            EpuckSimError: The controller cannot be compiled, raises, or does not fit; then the old one stays in use.
            ValueError: There is no such group, or what is given is no controller.
        """
        return self.replace_controllers([group], controller)[0]

    def replace_controllers(self, groups: list[int], controller: Controller) -> list[Replaced]:
        """Call `replace_controller` for several groups; if it fails for one of them, all keep their controllers."""
        before = dict(vars(self))
        try:
            return [self._replace(group, controller) for group in groups]
        except BaseException:
            vars(self).update(before)
            self._world.use(self._block, self._swarm, self._loop.addresses)
            raise

    def _replace(self, group: int, controller: Controller) -> Replaced:
        old, origin = numbered("group", group, self._groups), f"{self.scenario.name}: robots.{group}"
        check_alike(old.controller, controller)
        now, at_first = (
            parameters_for(controller, old.controller, record, self._step_ms, origin)
            for record in (old.parameters[0], self._first_parameters[group][0])
        )
        first_parameters = list(self._first_parameters)
        first_parameters[group] = controller.parameter_record(at_first)
        controllers = [controller if each is old else each.controller for each in self._groups]
        block, arena = self._block, self._arena
        self._block, self._swarm, _ = make_swarm_block(self.scenario, controllers, self._own_sensors)
        self._build(controllers, first_parameters)
        replaced = replace_controller(block, self._block, group, old, self._groups[group], now)
        self._has_replaced = True
        self._show(arena)
        return replaced

    def snapshot(self) -> Snapshot:
        """Return a snapshot of the simulation as it is now: `restore` it, or pickle it for later.

        Raises:
            ValueError: A controller was replaced: scenario and seed no longer determine this simulation.
        """
        if self._has_replaced:
            raise ValueError("a controller was replaced, so no snapshot: scenario and seed make another simulation")
        return Snapshot(self.scenario, self.seed, self.steps, tuple(self._changes))

    def restore(self, snapshot: Snapshot) -> None:
        """Return to the state of a snapshot; all that follows is equal to the bit, contacts included.

        The steps up to it are simulated again: pymunk cannot copy a space with its contacts to the bit.

        Raises:
            ValueError: The snapshot is of another scenario.
        """
        if not isinstance(snapshot, Snapshot) or snapshot.scenario != self.scenario:
            raise ValueError(f"a simulation of {self.scenario!r} cannot be restored from {snapshot!r}")
        self.reset(snapshot.seed)
        for steps, method, given, values in snapshot.changes:
            self._skip_to(steps)
            getattr(self, method)(*given, **values)
        self._skip_to(snapshot.steps)

    def _skip_to(self, steps: int) -> None:
        if steps > self.steps:
            self.advance(steps - self.steps)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), interpret=self._interpret), (self.scenario, self.seed), self.snapshot()

    __setstate__ = restore

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.scenario!r}, seed={self.seed}, steps={self.steps})"

    def _repr_html_(self) -> str:
        step, radii_cm = self.last_step, [kind.radius_cm for kind in self.scenario.robot_kinds]
        when = f"step {step.number}, {step.time_s:.1f} s" if step.number >= 0 else "before its first step"
        drawn = draw_arena(step.arena, step.poses, radii_cm, step.ring_on)
        return to_html(element("p", element("b", self.scenario.name), f", seed {self.seed}: {when}"), drawn)
