"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step all robots sense the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. What a controller commands in one step is seen by the other robots in the next.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.control.interface import Controller, Value
from epuck_sim.control.runner import RobotError
from epuck_sim.embodied.arena_change import check_bodies_outside, in_arena
from epuck_sim.embodied.coming_and_going import absent_swarm, put_in, show_present, take_out
from epuck_sim.embodied.commands import Commands
from epuck_sim.embodied.control_loop import make_control_loop, restart_loop
from epuck_sim.embodied.fault_events import take_events
from epuck_sim.embodied.faults import make_faults, restart_faults
from epuck_sim.embodied.group import RobotGroupState, make_group, restart_group, set_parameters
from epuck_sim.embodied.loop_runners import CompiledLoop, InterpretedLoop
from epuck_sim.embodied.placement import place_robots
from epuck_sim.embodied.randomness import Part, Randomness, spawned
from epuck_sim.embodied.relations import Relations
from epuck_sim.embodied.replacement import Replaced, replace_controller
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.schedule import carry_out, timed_entries
from epuck_sim.embodied.snapshot import Change, Command, ParameterChange, ScheduledChange, Snapshot
from epuck_sim.embodied.step import Step, shown_arrays
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS, make_swarm_arrays, restart_swarm_arrays
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.arena_changes import arena_after
from epuck_sim.scenario.controllers import resolve_parameters
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.robot_schedule import RobotScheduleEntry
from epuck_sim.scenario.scenario import Scenario, require_model, seed_of_trial
from epuck_sim.scenario.schedule import TrialEvent
from epuck_sim.util.memory import lack_of_memory


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
    period_ms: FloatArray
    """(robots,) ms: the oscillators' periods; NaN for robots without an oscillator."""
    events: list[TrialEvent]
    """Entries of the schedule that were carried out, and faults that began and ended, in the order of their steps."""
    commands: Commands
    """What is commanded from outside; `command` checks it first, and snapshots know of it."""
    external_wheels: IntArray
    """(n,) numbers of the robots whose wheels are commanded from outside; see `command`."""
    external_rings: IntArray
    """(m,) numbers of the robots whose rings are commanded from outside."""

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        seed: int | None = None,
        *,
        interpret: bool = False,
    ) -> None:
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
        self.scenario = scenario = require_model(
            load_scenario(scenario), EmbodiedScenario, "a Simulation needs model: embodied; use ParticleSimulation"
        )
        seed = seed_of_trial(scenario, seed)
        if lack := lack_of_memory(scenario.memory_bytes):
            raise ScenarioError(f"{scenario.name}: a trial {lack}; give fewer robots, or cameras with fewer pixels")
        robots, arena = scenario.robot_count, scenario.arena.build()
        self.step_s = scenario.timing.step_ms / 1000
        self._step_ms = scenario.timing.step_ms
        self._interpret = interpret
        self._step = np.full(1, -1)  # the number of the last step taken
        self._world = World(
            *(arena, np.zeros((robots, 3)), scenario.contact.friction, scenario.timing.physics_hz),
            touch=scenario.contact.robots,
            drive_force_n=scenario.contact.drive_force_n,
            robot=scenario.robot,
        )
        self._first_arena = arena
        self._swarm = make_swarm_arrays(scenario, arena, self._world)
        self._randomness = Randomness(scenario)
        self._groups = self._make_groups()
        self.period_ms = np.empty(robots)
        self._loop = make_control_loop(
            *(scenario, self._step, self._world.bodies, self._swarm),
            *(self._randomness.variation, self._randomness.variation_streams),
        )
        self._faults = make_faults(scenario) if scenario.faults else None
        absent = absent_swarm(self._swarm) if scenario.members_change else None
        interpreted = InterpretedLoop(self._loop, self._groups, self._faults, absent) if interpret else None
        self._take_steps = interpreted or CompiledLoop(self._loop, self._groups, self._faults, absent)
        self.commands = Commands(self._loop, self._groups, interpreted)
        self.external_wheels = self.commands.arrays.wheel_robots
        self.external_rings = self.commands.arrays.ring_robots
        self._relations = Relations(scenario, self._swarm)
        self._show()
        self._short_rows = self._find_short_rows()
        self._timed = timed_entries(scenario.schedule, self._step_ms)
        self.reset(seed)

    def _make_groups(self) -> list[RobotGroupState]:
        """Return all groups, with their controllers ready to start."""
        groups: list[RobotGroupState] = []
        first_robot = 0
        for section in self.scenario.robots:
            group = make_group(
                self.scenario,
                section,
                first_robot,
                self._swarm,
                infrared_gain=self._randomness.variation.infrared_gain,
                controller_streams=self._randomness.controller_streams,
                signal_streams=self._randomness.signal_streams,
                interpret=self._interpret,
            )
            groups.append(group)
            first_robot += section.count
        return groups

    def _show(self) -> None:
        """Find the arrays that steps show."""
        shown = shown_arrays(self._swarm, [group.runner.memory for group in self._groups])
        self._shown: tuple[Any, ...] = (*shown, self._relations)

    def reset(self, seed: int | None = None) -> None:
        """Start anew, to the same outcome as a new simulation with this seed, but several times as fast.

        Parameters are the scenario's again, and nothing is commanded.

        Args:
            seed: The trial's seed, 0 or more; the present one if None.

        Raises:
            ScenarioError: The seed is not allowed, or the robots do not fit into the arena.
            ControllerError: A controller raises at its start.
        """
        scenario = self.scenario
        seed = self.seed if seed is None else seed_of_trial(scenario, seed)
        poses = place_robots(scenario, spawned(seed, Part.PLACEMENT))
        self.seed = seed
        self._changes: list[Change] = []
        self.events = []
        self._timed.restart()
        self._replaced_at: int | None = None
        self._step[0] = -1
        if self._swarm.arena is not self._first_arena:
            self._change_arena(self._first_arena)
        self._world.place(poses)
        restart_swarm_arrays(self._swarm, self._step_ms)
        self._randomness.restart(seed)
        restart_loop(self._loop, self._step_ms, self._randomness.variation)
        if self._faults is not None:
            restart_faults(self._faults, scenario, spawned(seed, Part.FAULTS))
        self.commands.restart()
        self._relations.restart()
        for group in self._groups:
            try:
                restart_group(group)
            except RobotError as error:
                raise self._located(error, group.robots.start) from error
            self.period_ms[group.robots] = group.period_ms
        if scenario.members_change:
            take_out(np.flatnonzero(~np.array(scenario.present)).tolist(), self._world, self._swarm, self._groups)

    def _find_short_rows(self) -> list[tuple[IntArray, IntArray]]:
        """Return, for each group with fewer pixels than others, the rows that are shown and those of its cameras."""
        shown, short_rows = self._swarm.sensors.camera, []
        for group in self._groups:
            camera = group.runner.arrays.senses.camera
            pixels = camera.shape[1]
            if pixels < shown.shape[1]:
                short_rows.append((shown[group.robots, :pixels], camera))
        return short_rows

    @property
    def steps(self) -> int:
        """Control steps taken so far."""
        return int(self._step[0]) + 1

    def controller_at_work(self) -> tuple[int, int] | None:
        """Return robot and step of the controller that is running, for another thread; None while none is."""
        for group in self._groups:
            robot = int(group.runner.arrays.serving[0])
            if robot >= 0:
                return group.robots.start + robot, int(self._step[0])
        return None

    def __iter__(self) -> Self:
        """Return the simulation itself: a further loop continues where the last one stopped."""
        return self

    def __next__(self) -> Step:
        """Take one control step and return it.

        Bodies move, unless this is the first step; then all robots sense, and their controllers command.

        Returns:
            The step; its arrays are overwritten by the next one.

        Raises:
            ControllerError: A controller raises, or sets a wheel speed or a turn that is not a number.
        """
        return self.advance(1)

    def advance(self, steps: int, until_lit: int | None = None) -> Step:
        """Take several control steps, faster than one by one, and return the last of them.

        Args:
            steps: Number of steps to take, at least 1.
            until_lit: Number of a robot; a step in which its ring is commanded to be lit is the last one.

        Returns:
            The last step; its arrays are overwritten by the next one.

        Raises:
            ValueError: There is no step to take, or no such robot.
            ControllerError: See `__next__`.
        """
        if steps < 1:
            raise ValueError(f"steps is {steps}; allowed: 1 and above")
        if until_lit is not None and not 0 <= until_lit < len(self.period_ms):
            raise ValueError(f"until_lit is {until_lit}; allowed: 0 to {len(self.period_ms) - 1}")
        end = self.steps + steps
        while True:
            while self._timed.next == self.steps:
                self._carry_out(self._timed.take())
            noise_step = self.steps % NOISE_STEPS
            if noise_step == 0:
                self._randomness.draw_noise(self._swarm)
            unseen = min(end - self.steps, NOISE_STEPS - noise_step, self._timed.next - self.steps)
            self._run(unseen, -1 if until_lit is None else until_lit)
            if self._faults is not None:
                self.events += take_events(self._faults, self._step_ms)
            if self.steps == end or (until_lit is not None and self._swarm.ring_commands[until_lit]):
                return self.last_step

    def command(
        self,
        left_cm_s: npt.ArrayLike | None = None,
        right_cm_s: npt.ArrayLike | None = None,
        ring_on: npt.ArrayLike | None = None,
    ) -> None:
        """Command the robots that are driven from outside: those whose controller is `external`, or the like.

        A command follows what was sensed in the last step, in which it takes effect as if a controller had given it:
        robots move accordingly until the next step, and other robots see the rings in that one. It holds until the next
        command. What is left out stays as it was.

        Args:
            left_cm_s: (n,) cm/s: left wheel of each of `external_wheels`, or one number for all; limited to what
                wheels can do, as a controller's.
            right_cm_s: (n,) cm/s: right wheel of each.
            ring_on: (m,) whether the ring of each of `external_rings` is lit, or one value for all.

        Raises:
            ValueError: An array has another shape, a speed is not a number, there is no such robot, or nothing is
                given; then nothing is commanded.
        """
        if left_cm_s is None and right_cm_s is None and ring_on is None:
            raise ValueError("nothing is commanded; give left_cm_s, right_cm_s or ring_on")
        self.commands.set(left_cm_s, right_cm_s, ring_on)
        self.commands.carry_out()
        self._changes.append(Command.of(self.steps, self.commands.arrays))

    def set_parameters(self, group: int = 0, /, **values: Value) -> None:
        """Change parameters of a group's controllers from the next step on; its robots keep what they remember.

        Args:
            group: Number of the group in the scenario.
            values: Parameters by name; those that are left out stay as they are.

        Raises:
            ScenarioError: The controller does not take these parameters.
            ValueError: There is no such group.
        """
        if not 0 <= group < len(self._groups):
            raise ValueError(f"group is {group}; allowed: 0 to {len(self._groups) - 1}")
        self._set_parameters(group, values)
        self._changes.append(ParameterChange(self.steps, group, values))

    def _set_parameters(self, group: int, values: Mapping[str, Value]) -> None:
        """Change parameters of a group's controllers."""
        changed = self._groups[group]
        origin = f"{self.scenario.name}: robots.{group}"
        given = {**changed.parameters, **values}
        set_parameters(changed, resolve_parameters(changed.controller, given, self._step_ms, origin))
        self.period_ms[changed.robots] = changed.period_ms

    def carry_out_scheduled(self, entry: int) -> None:
        """Carry out an entry of the scenario's schedule now: its changes act from the next step on.

        Entries with a time are carried out by the simulation itself, others by `run_trial`.

        Args:
            entry: Number of the entry.
        """
        self._carry_out(entry)
        self._changes.append(ScheduledChange(self.steps, entry))

    def _carry_out(self, entry: int) -> None:
        time_ms = self.steps * self._step_ms
        sequence = np.random.SeedSequence(self.seed, spawn_key=(Part.SCHEDULE, entry))
        section = self.scenario.schedule[entry]
        origin = f"{self.scenario.name}: schedule.{entry}, at {time_ms / 1000:g} s, seed {self.seed}"
        take_out(section.remove, self._world, self._swarm, self._groups)
        if section.arena_values():
            arena = arena_after(self.scenario, entry).build()
            self._change_arena(arena)
            radius_cm = self.scenario.robot.radius_cm
            check_bodies_outside(arena, self._world.poses, radius_cm, self._swarm.sensors.present, origin)
        self._add(section, np.random.SeedSequence(self.seed, spawn_key=(Part.SCHEDULE, entry, Part.PLACEMENT)), origin)
        carry_out(section, self._groups, self._faults, self._set_parameters, sequence, time_ms)
        self.events.append(TrialEvent(self.steps, time_ms / 1000, f"schedule.{entry}", section.what))

    def _add(self, section: RobotScheduleEntry, sequence: np.random.SeedSequence, origin: str) -> None:
        """Put the robots of an entry into the arena."""
        try:
            put_in(section, self._world, self._swarm, self._groups, sequence, origin)
        except RobotError as error:
            raise ControllerError(f"{origin}: {error}") from error

    def _change_arena(self, arena: Arena) -> None:
        """Have all move and sense in another arena, with the same movables, from the next step on."""
        world = self._world
        world.change_arena(arena)
        self._swarm = self._swarm._replace(arena=arena, cells=world.bodies.cells)
        self._groups[:] = [in_arena(group, arena, world.bodies.cells) for group in self._groups]
        self._loop = self._loop._replace(bodies=world.bodies)
        self._take_steps.begin(self._loop, self._groups)
        self._relations.change_arena(self._swarm)
        self._show()

    @property
    def controllers(self) -> list[Controller]:
        """What runs on the robots of each group."""
        return [group.controller for group in self._groups]

    def replace_controller(self, group: int, controller: Controller) -> Replaced:
        """Have the robots of a group go on with another controller from the next step on.

        See `embodied.replacement` for what they remember, and which parameters they keep. Until it is reset, the
        simulation is no longer what its scenario and seed alone decide.

        Args:
            group: Number of the group in the scenario.
            controller: See `control.loader.load_controller`.

        Returns:
            What robots still remember.

        Raises:
            EpuckSimError: It cannot be compiled, raises, or does not fit; then the old one goes on.
        """
        origin = f"{self.scenario.name}: robots.{group}"
        replaced = replace_controller(self._groups[group], controller, self._step_ms, origin, interpret=self._interpret)
        self._groups[group] = replaced.group
        self._take_steps.call_controllers(self._groups)
        self.period_ms[replaced.group.robots] = replaced.group.period_ms
        self._replaced_at = self.steps
        self._show()
        return replaced

    def snapshot(self) -> Snapshot:
        """Return all that is needed to have the simulation as it is now: `restore`, or pickle it for later.

        Raises:
            ValueError: A controller was replaced since the last reset: the steps before could not be simulated again.
        """
        if self._replaced_at is not None:
            raise ValueError(f"a controller was replaced after step {self._replaced_at - 1}; there is no snapshot")
        return Snapshot(self.scenario, self.seed, self.steps, tuple(self._changes))

    def restore(self, snapshot: Snapshot) -> None:
        """Have the simulation as it was at a snapshot, equal to the bit from there on, contacts included.

        The steps up to there are simulated again: pymunk has no copy of a space with contacts that is equal to the bit.

        Raises:
            ValueError: The snapshot is of another scenario.
        """
        if not isinstance(snapshot, Snapshot) or snapshot.scenario != self.scenario:
            raise ValueError(f"a simulation of {self.scenario!r} cannot be restored from {snapshot!r}")
        self.reset(snapshot.seed)
        for change in snapshot.changes:
            self._skip_to(change.steps)
            change.repeat(self)
        self._skip_to(snapshot.steps)

    def _skip_to(self, steps: int) -> None:
        if steps > self.steps:
            self.advance(steps - self.steps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how a copy is made, by `copy` and `pickle`: from a snapshot."""
        return _from_snapshot, (type(self), self.snapshot(), self._interpret)

    @property
    def last_step(self) -> Step:
        """The step that was taken last; before the first one, number -1: where robots are placed, with their phases."""
        for shown, camera in self._short_rows:
            shown[:] = camera
        if self._swarm.shown_poses is not self._swarm.poses:
            show_present(self._swarm)
        number = int(self._step[0])
        return Step(number, number * self._step_ms / 1000, *self._shown)

    def _run(self, steps: int, until_lit: int) -> None:
        """Take control steps for which noise is drawn; a robot whose controller fails is named."""
        try:
            invalid = self._take_steps(steps, until_lit)
        except BaseException as error:  # whatever a user's controller may raise
            for group in self._groups:
                if fault := group.runner.fault(error):
                    raise self._located(fault, group.robots.start) from error
            raise
        if invalid >= 0:
            controller = next(
                group for group in reversed(self._groups) if group.robots.start <= invalid
            ).runner.controller
            raise ControllerError(
                f"{self._location(invalid)}: {controller.path}: sets a wheel speed or a turn that is not a number"
            )

    def _repr_html_(self) -> str:
        """Return the arena with the robots as they are now, for notebooks."""
        from epuck_sim.embodied.notebook import show_simulation  # noqa: PLC0415 is for notebooks alone

        return show_simulation(self.scenario, self.seed, self.last_step)

    def _location(self, robot: int) -> str:
        """Return where a controller failed, for an error."""
        return f"{self.scenario.name}: robot {robot}, step {max(self.steps - 1, 0)}, seed {self.seed}"

    def _located(self, error: RobotError, first_robot: int) -> ControllerError:
        """Return the error of a controller of the group that begins with `first_robot`, with its location."""
        return ControllerError(f"{self._location(first_robot + error.robot)}: {error}")


def _from_snapshot(kind: type[Simulation], snapshot: Snapshot, interpret: bool) -> Simulation:
    """Return a simulation of class `kind` as it was at a snapshot."""
    simulation = kind(snapshot.scenario, snapshot.seed, interpret=interpret)
    simulation.restore(snapshot)
    return simulation
