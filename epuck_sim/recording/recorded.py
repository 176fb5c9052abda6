"""A recorded trial as arrays."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, facts, to_html
from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.rows import population_of
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_after, arena_entries
from epuck_sim.scenario.scenario import Scenario


class Links(NamedTuple):
    """Links of a trial, a row each; what its model does not have has none."""

    sightings: IntArray = np.empty((0, 4), np.int64)  # row, robot that looks, robot in its view, 1 if it is seen lit
    contacts: IntArray = np.empty((0, 3), np.int64)  # row, robot, robot that it touches, or -1: what is no robot
    contact_points: FloatArray = np.empty((0, 2))  # cm: where they touch, in the same order
    pulses: IntArray = np.empty((0, 4), np.int64)  # row, agent that fires, agent that receives, 1 if its phase shifts


class Recorded(NamedTuple):
    """A trial as it was recorded; poses and phases have no rows if the level leaves them out.

    Robots have a row for each control step; point-like agents one for each instant at which some fire, and 20 regular
    ones in each nominal period.
    """

    scenario: Scenario  # with all defaults written out
    seed: int  # seed of the trial
    level: Level  # how much the recording holds
    versions: dict[str, str]  # versions of epuck-sim and its libraries that made the recording
    cycles: int  # number of firings of the reference
    synchronised: bool  # whether the trial ended with the swarm synchronised
    time_s: FloatArray  # (rows,) s: simulated time of each row
    order_parameter: FloatArray  # (rows,) of all oscillators
    flash_s: FloatArray  # (flashes,) s: time of each flash
    flash_robot: IntArray  # (flashes,) number of the robot or agent that flashed
    flash_cycle: IntArray  # (flashes,) which of its own flashes this was, from 1
    firing_s: FloatArray  # (firings,) s: times at which the reference fired
    firing_order: FloatArray  # (firings,) order parameter that the trial measured then
    phase_ms: FloatArray  # (rows, count) ms: phases; count is the number of robots or agents
    positions: Float32Array
    """(rows, count, 2) cm: x and y, in single precision as in the file; a cube is seen from above."""
    headings: FloatArray  # (rows, count) rad in -pi to pi, from arrows in single precision
    ring_on: BoolArray
    """(rows, count) whether the ring is lit; of agents, whether they fired within the last 0.075 of a period."""
    movables: Float32Array  # (rows, movables, 2) cm: x and y of the arena's movables, in single precision
    memory: Mapping[str, FloatArray]
    """(rows, robots) what robots remember, by the names of the fields that are recorded; NaN for robots without one."""
    events: tuple[tuple[float, str], ...]  # time in seconds, and text, of what changed by a schedule, or by faults
    links: Links | None
    """Who was linked to whom; None if the level leaves it out. The properties below raise RecordingError instead."""

    @property
    def sightings(self) -> IntArray:
        """See `Links`."""
        return self._linked("sightings", "embodied")

    @property
    def contacts(self) -> IntArray:
        """See `Links`."""
        return self._linked("contacts", "embodied")

    @property
    def pulses(self) -> IntArray:
        """See `Links`; swarms of 50 agents or more are recorded with the pulses alone that shift a phase."""
        return self._linked("pulses", "particles")

    def arena_at(self, row: int) -> Arena:
        """Return the arena with its walls, and with its movables where they are, in a row."""
        *_, stands = (arena for time_s, arena in self.arenas if time_s <= self.time_s[row])
        return stands.with_movables_at(self.movables[row])

    @property
    def arenas(self) -> list[tuple[float, Arena]]:
        """Times from which on walls and obstacles stand, and the arena with them; its movables are elsewhere."""
        found = [(0.0, population_of(self.scenario).arena)]
        if isinstance(self.scenario, EmbodiedScenario):
            arenas = {f"schedule.{entry}": arena_after(self.scenario, entry) for entry in arena_entries(self.scenario)}
            sources = [(time_s, text.partition(":")[0]) for time_s, text in self.events]
            found += [(time_s, arenas[source].build()) for time_s, source in sources if source in arenas]
        return found

    def _repr_html_(self) -> str:
        """Return the last moment at which most rings were lit, and what is recorded, for notebooks."""
        population = population_of(self.scenario)
        rows = [
            (f"{population.noun}s", str(population.size)),
            ("level", str(self.level)),
            ("duration", f"{self.time_s.max(initial=0):.1f} s, {self.cycles} cycles"),
            ("synchronised", "yes" if self.synchronised else "no"),
            ("rows", str(len(self.time_s))),
        ]
        parts = [element("p", element("b", self.scenario.name), f", seed {self.seed}"), facts(rows)]
        if len(self.ring_on):
            rings = self.ring_on.sum(axis=1)
            moment = int(np.flatnonzero(rings == rings.max())[-1])
            poses = np.column_stack([self.positions[moment], self.headings[moment]])
            parts.append(element("p", f"at {self.time_s[moment]:.2f} s:"))
            parts.append(draw_arena(self.arena_at(moment), poses, population.radii_cm, self.ring_on[moment]))
        return to_html(*parts)

    def _linked(self, what: str, model: str) -> IntArray:
        name, own = self.scenario.name, self.scenario.model
        if own != model:
            raise RecordingError(f"{name}: model: {own} has no {what}; they are of model: {model}")
        if self.links is None:
            again = "record the trial again with --record-level full"
            raise RecordingError(f"{name}: a recording of level {self.level} holds no {what}; {again}")
        found: IntArray = getattr(self.links, what)
        return found
