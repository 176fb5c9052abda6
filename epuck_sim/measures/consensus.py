"""Agreement on a word that flashes carry: the naming game and the voter model (thesis 6.2 leaves other tasks open).

Each robot or agent begins with a word of its own. A flash carries one of the words that its sender knows; all that see
the flash hear the word, and the sender does not learn which these are. In the naming game, a hearer that knows the word
forgets all others, and one that does not adds it: the variant in which only hearers change (Baronchelli, Phys. Rev. E
83, 046103, 2011), as a flash brings no answer. A voter keeps only the word heard last. Words change no behaviour.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, IntArray
from epuck_sim.measures.common import Series, allowed, check_sight, one_of
from epuck_sim.particles.simulation import SHIFTS_ONLY
from epuck_sim.util.jit import jit

RULES = ("naming_game", "voter")

STREAM = 18  # number that sets the words' random stream apart from the trial's others


@dataclass
class _Talk(Series):
    """Base class of both measures: who knows which words, and the rule by which that changes."""

    rule: str = "naming_game"
    check = staticmethod(allowed(rule=one_of(RULES)))
    MODELS = ("embodied", "particles")

    def __post_init__(self) -> None:
        population = int(self.simulation.scenario.population)
        self._random = np.random.default_rng([self.simulation.seed, STREAM])
        self.knows = [{word} for word in range(population)]  # the words that each robot or agent knows
        self._dark: IntArray = np.zeros(population, np.int64)  # steps in which each ring was dark: tells flashes apart
        robots = population if self.has_bodies else 0
        self._heard: IntArray = np.full((robots, robots), -1)  # last flash of [speaker] that [hearer] saw
        self._said: dict[int, tuple[int, int]] = {}  # by speaker, its last flash that was seen, and the word it carries
        self._agreed: int | None = None  # the first cycle in which all agree
        self._cycles = 0

    @staticmethod
    def check_scenario(scenario: Any, _: Any) -> None:
        check_sight(scenario, _)
        if scenario.model == "particles" and scenario.population >= SHIFTS_ONLY:
            raise ValueError(f"agents.count is {scenario.population}; allowed with words: below {SHIFTS_ONLY}")

    @property
    def words(self) -> int:
        """Number of different words that the swarm knows."""
        return len(set[int]().union(*self.knows))

    def say(self, speaker: int) -> int:
        """Return one of the words that the speaker knows, drawn at random."""
        known = sorted(self.knows[speaker])
        return known[self._random.integers(len(known)) if len(known) > 1 else 0]  # which of one is not drawn

    def hear(self, hearer: int, word: int) -> None:
        """Update the words that a hearer knows."""
        if self.rule == "voter" or word in self.knows[hearer]:
            self.knows[hearer].clear()
        self.knows[hearer].add(word)

    def stretch(self, stretch: Any, state: Any) -> None:
        flashes = begin_flashes(self._heard, self._dark, stretch.sightings, stretch.ring_before)
        heard = np.column_stack([stretch.sightings, flashes])[flashes >= 0]
        last = np.searchsorted(heard[:, 0], len(stretch.ring_before) - 1)  # first row of when the reference may fire
        for rows, cycles in ((heard[:last], self._cycles), (heard[last:], state.cycles)):
            for _, hearer, speaker, flash in rows.tolist():
                if self._said.get(speaker, (-1,))[0] != flash:
                    self._said[speaker] = flash, self.say(speaker)
                self.hear(hearer, self._said[speaker][1])
            if rows.size:
                self._note(cycles)
        self._cycles = state.cycles

    def _note(self, cycles: int) -> None:
        if self._agreed is None and self.words == 1:
            self._agreed = cycles

    def event(self, event: Any, state: Any) -> None:
        if not len(event.fired):
            return
        word, last = -1, -1
        for speaker, hearer, _ in self.simulation.pulse_links():
            if speaker != last:
                word, last = self.say(speaker), speaker
            self.hear(hearer, word)
        self._note(state.cycles)


@jit
def begin_flashes(heard: IntArray, dark: IntArray, sightings: IntArray, is_lit: BoolArray) -> IntArray:
    """Return (sightings,) the number of the flash where the observer first sees it, else -1.

    Updates `heard`, (robots, robots) the last flash that each saw of each other, and `dark`, (robots,) steps without
    light so far, which number flashes. `is_lit` are (steps, robots) rings that show lit.
    """
    begun, row = np.full(len(sightings), -1), 0
    for step in range(len(is_lit)):
        for robot in range(len(dark)):
            dark[robot] += not is_lit[step, robot]
        while row < len(sightings) and sightings[row, 0] == step:
            hearer, speaker = sightings[row, 1], sightings[row, 2]
            if heard[hearer, speaker] != dark[speaker]:
                heard[hearer, speaker] = begun[row] = dark[speaker]
            row += 1
    return begun


class Consensus(_Talk):
    """Cycles until all know the same word and no other (both models)."""

    UNIT = "cycles"

    def value(self) -> int | None:
        """Return the cycles; None if they never agreed."""
        return self._agreed


class Words(_Talk):
    """Number of different words that the swarm knows, at each cycle (series)."""

    def cycle(self, _: Any, __: Any) -> None:
        self._series.append(self.words)
