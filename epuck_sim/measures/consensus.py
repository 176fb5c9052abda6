"""Agreement on a word that flashes carry: the naming game and the voter model (thesis 6.2 leaves other tasks open).

Each robot or agent begins with a word of its own. A flash carries one of the words that its sender knows; all that see
the flash hear the word, and the sender does not learn which these are. In the naming game, a hearer that knows the word
forgets all others, and one that does not adds it: the variant in which only hearers change (Baronchelli, Phys. Rev. E
83, 046103, 2011), as a flash brings no answer. A voter keeps only the word heard last. Words change no behaviour.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.measures.common import Series, allowed, check_sight, one_of
from epuck_sim.particles.simulation import SHIFTS_ONLY

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
        # by sender, its last flash that was seen: dark steps before it, the word that it carries, and who heard it
        self._flashes: dict[int, tuple[int, int, set[int]]] = {}
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
        return known[self._random.integers(len(known))]

    def hear(self, hearer: int, word: int) -> None:
        """Update the words that a hearer knows."""
        if self.rule == "voter" or word in self.knows[hearer]:
            self.knows[hearer].clear()
        self.knows[hearer].add(word)

    def stretch(self, stretch: Any, state: Any) -> None:
        dark = self._dark + np.cumsum(~stretch.ring_before, axis=0)
        step, hearers, speakers = stretch.sightings.T
        heard = np.array([hearers, speakers, dark[step, speakers]])
        last = np.searchsorted(step, len(dark) - 1)  # first row of the last step, in which the reference may fire
        for rows, cycles in ((heard[:, :last], self._cycles), (heard[:, last:], state.cycles)):
            for hearer, speaker, flash in zip(*rows.tolist(), strict=True):
                if self._flashes.get(speaker, (-1,))[0] != flash:
                    self._flashes[speaker] = flash, self.say(speaker), set()
                _, word, told = self._flashes[speaker]
                if hearer not in told:
                    told.add(hearer)
                    self.hear(hearer, word)
            if rows.size:
                self._note(cycles)
        self._dark, self._cycles = dark[-1], state.cycles

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
