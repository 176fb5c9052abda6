"""Agreement on words, against a slow twin in both models."""

import numpy as np
import pytest

from epuck_sim.measures.consensus import STREAM
from tests.measures.test_shipped import AGENTS, ROBOTS, run

FEW = {**AGENTS, "agents": {"count": 12, "speed_cm_s": 20.0}}
CROWD = {**ROBOTS, "robots": [{"count": 6, "camera": {"field_of_view_deg": 120}}]}


class SlowWords:
    """The same as sets of words, one robot or agent after the other."""

    def __init__(self, count: int, rule: str, seed: int = 5) -> None:
        self.rule, self.random = rule, np.random.default_rng([seed, STREAM])
        self.known = [{one} for one in range(count)]
        self.carried: dict[int, int] = {}
        self.heard: set[tuple[int, int]] = set()
        self.counts: list[int] = []

    def say(self, speaker):
        return self.random.choice(sorted(self.known[speaker]))

    def hear(self, hearer, word):
        if self.rule == "voter" or word in self.known[hearer]:
            self.known[hearer] = {word}
        else:
            self.known[hearer].add(word)

    def __call__(self, event, state, simulation):
        if hasattr(event, "poses"):
            for hearer, speaker in event.sightings.tolist():
                if (hearer, speaker) not in self.heard:
                    self.heard.add((hearer, speaker))
                    self.carried.setdefault(speaker, None)
                    if self.carried[speaker] is None:
                        self.carried[speaker] = self.say(speaker)
                    self.hear(hearer, self.carried[speaker])
            dark = set(np.flatnonzero(~event.ring_on).tolist())
            self.heard = {pair for pair in self.heard if pair[1] not in dark}
            self.carried = {speaker: word for speaker, word in self.carried.items() if speaker not in dark}
        elif len(event.fired):
            pairs = simulation.pulse_links()[:, :2].tolist()
            for speaker in dict.fromkeys(speaker for speaker, _ in pairs):
                word = self.say(speaker)
                for other, hearer in pairs:
                    if other == speaker:
                        self.hear(hearer, word)
        if state.cycles > len(self.counts):
            self.counts.append(len(set.union(*self.known)))


@pytest.mark.parametrize("rule", ["naming_game", "voter"])
@pytest.mark.parametrize(("sections", "count"), [(FEW, 12), (CROWD, 6)], ids=["agents", "robots"])
def test_the_words_of_a_trial_are_those_of_a_slow_twin(sections, count, rule):
    twin = SlowWords(count, rule)
    _, series = run({"words": {"rule": rule}}, twin, **sections)
    assert series == twin.counts
    assert series[-1] < count


@pytest.mark.parametrize("sections", [FEW, CROWD], ids=["agents", "robots"])
def test_consensus_is_when_one_word_is_left(sections):
    stop = {**sections["stop"], "max_cycles": 400}
    _, words = run({"words": {"rule": "voter"}}, **{**sections, "stop": {**stop, "order_parameter": None}})
    _, agreed = run({"consensus": {"rule": "voter"}}, **{**sections, "stop": {**stop, "order_parameter": None}})
    assert 1 in words
    assert words.index(1) in (agreed, agreed + 1)  # words are counted at firings, agreement is noted at once
    assert set(words[words.index(1) :]) == {1}


def test_nobody_agrees_who_hears_nobody():
    alone = {**AGENTS, "agents": {"count": 3, "speed_cm_s": 0.0}, "space": {"side_cm": 1000}}
    alone["neighbourhood"] = {"kind": "cone_of_vision", "angle_deg": 1, "radius_cm": 0.001}
    _, agreed = run("consensus", **alone)
    assert agreed is None
