"""Measures of who sees and hears whom, links, words and suspicions: each against a slow twin."""

from functools import partial
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.embodied.observers import find_sightings, make_scene
from epuck_sim.measures.consensus import STREAM, Consensus
from epuck_sim.measures.links import component_sizes, degrees
from tests.measures.test_shipped import AGENTS, CYCLES, ROBOTS, at_cycles, run
from tests.particles.naive_model import receivers_of

CROWD = {**ROBOTS, "robots": [{"count": 8, "camera": {"field_of_view_deg": 90}}]}
COMPONENTS = ("component_count", "largest_component")
LIVELY = {**AGENTS, "neighbourhood": {"kind": "cone_of_vision", "angle_deg": 100, "radius_cm": 60}}


def slow_links(_, simulation):
    """Return the pairs of a sender and a receiver, from the definition of each neighbourhood."""
    places, headings = simulation.positions(), simulation.headings()
    receivers = (receivers_of(simulation.scenario, places, headings, sender)[0] for sender in range(len(places)))
    return {(sender, receiver) for sender, row in enumerate(receivers) for receiver in np.flatnonzero(row).tolist()}


links_of_agents = partial(at_cycles, slow_links)
"""Returns an observer, and the list of the sets of links that it sees at each cycle."""


def links_of_robots():
    """Return an observer, and the list of (sender, receiver) pairs of each cycle, from sightings in its steps."""
    seen, now, cycles = [], set(), []

    def observer(step, state, _):
        now.update((lit, looks) for looks, lit in step.sightings.tolist())
        if state.cycles > len(cycles):
            cycles.append(state.cycles)
            seen.append(set(now))
            now.clear()

    return observer, seen


SWARMS = [(LIVELY, links_of_agents, 15), (CROWD, links_of_robots, 8)]
MODELS = pytest.mark.parametrize(("sections", "watch", "population"), SWARMS, ids=["agents", "robots"])


def slow_components(links, population, connection):
    """Return the components: who reaches whom, by adding what is reached until nothing is added."""
    ways = links | {(b, a) for a, b in links} if connection == "weak" else links
    reached = {one: {one} for one in range(population)}
    changed = True
    while changed:
        changed = False
        for a, b in ways:
            for one in range(population):
                if a in reached[one] and not reached[b] <= reached[one]:
                    reached[one] |= reached[b]
                    changed = True
    return {frozenset(b for b in range(population) if b in reached[a] and a in reached[b]) for a in range(population)}


@settings(max_examples=40)
@given(st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=12), st.sampled_from(["weak", "strong"]))
def test_components_are_those_who_reach_each_other(pairs, connection):
    links = {(a, b) for a, b in pairs if a != b}
    numbers = np.array(sorted(a * 6 + b for a, b in links), np.int64)
    sizes, _ = component_sizes(numbers, 6, connection)
    assert sorted(sizes) == sorted(map(len, slow_components(links, 6, connection)))
    for direction, ends in (("out", [a for a, _ in links]), ("in", [b for _, b in links])):
        assert degrees(numbers, 6, direction)[0].tolist() == [ends.count(one) for one in range(6)]


STATISTICS = {"mean": np.mean, "smallest": min, "largest": max, "sd": np.std}


@MODELS
def test_degrees_count_links_and_the_isolated_have_none(sections, watch, population):
    observer, seen = watch()
    told = list(zip(("both", "in", "out", "in", "out", "in"), [*STATISTICS, "isolated", "isolated"], strict=True))
    degrees = [{"degree": {"direction": way, "statistic": what, "as": what}} for way, what in told[:4]]
    isolated = [{"isolated": {"direction": way, "as": f"isolated_{way}"}} for way, _ in told[4:]]
    _, *values = run(degrees[0], observer, more=[*degrees[1:], *isolated], **sections)
    for (direction, statistic), series in zip(told, values, strict=True):
        expected = []
        for links in seen:
            ends = [end for a, b in links for end in {"out": [a], "in": [b], "both": [a, b]}[direction]]
            counts = [ends.count(one) for one in range(population)]
            reduce = STATISTICS.get(statistic)
            expected.append(float(reduce(counts) if reduce else counts.count(0) / population))
        assert series == pytest.approx(expected)
        assert len(series) == CYCLES
        assert max(series) > 0 or statistic in ("smallest", "isolated")


@MODELS
def test_links_change_and_end(sections, watch, population):  # noqa: ARG001
    observer, seen = watch()
    _, series, life = run("neighbour_change", observer, more=["link_life"], **sections)
    expected = [1 - len(a & b) / len(a | b) if a | b else None for a, b in pairwise(seen)]
    assert series[0] is None
    assert series[1:] == expected
    assert life == sum(map(len, seen[:-1])) / sum(len(a - b) for a, b in pairwise(seen))
    assert life > 1


@MODELS
@pytest.mark.parametrize(("connection", "cycles"), [("weak", 1), ("strong", 3)])
def test_components_are_those_of_the_last_cycles_together(sections, watch, population, connection, cycles):
    observer, seen = watch()
    count, largest = ({each: {"connection": connection, "cycles": cycles}} for each in COMPONENTS)
    _, *found = run(count, observer, more=[largest], **sections)
    expected = [(None, None)] * (cycles - 1)
    for last in range(cycles - 1, CYCLES):
        together = set().union(*seen[last - cycles + 1 : last + 1])
        components = slow_components(together, population, connection)
        expected.append((len(components), max(map(len, components)) / population))
    assert list(zip(*found, strict=True)) == expected


@MODELS
def test_the_spanning_time_is_when_the_links_so_far_connect_all(sections, watch, population):
    observer, seen = watch()
    weak, strong = ({"spanning_time": {"connection": each, "as": each}} for each in ("weak", "strong"))
    _, *values = run(weak, observer, more=[strong], **sections)
    for connection, value in zip(("weak", "strong"), values, strict=True):
        together, found = set(), []
        for links in seen:
            together |= links
            found.append(len(slow_components(together, population, connection)) == 1)
        assert value == (found.index(True) + 1 if True in found else None)


@pytest.mark.parametrize("boundary", ["bounded", "cyclic"])
def test_links_are_found_by_cells_as_without(boundary):
    sections = {"model": "particles", "agents": {"count": 450, "speed_cm_s": 5}, "space": {"boundary": boundary}}
    for rule in ({"kind": "nearest", "k": 4}, {"kind": "cone_of_emission", "angle_deg": 80, "radius_cm": 9}):
        observer, seen = links_of_agents()
        stop = {"order_parameter": None, "max_cycles": 2}
        simulation, _ = run("degree", observer, **sections, neighbourhood=rule, stop=stop)
        codes = sorted(sender * 450 + receiver for sender, receiver in seen[-1])
        assert simulation.neighbour_links().tolist() == codes


FEW = {**AGENTS, "agents": {"count": 12, "speed_cm_s": 20.0}}
FACING = {**ROBOTS, "robots": [{"count": 6, "camera": {"field_of_view_deg": 120}}]}


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
@pytest.mark.parametrize(("sections", "count"), [(FEW, 12), (FACING, 6)], ids=["agents", "robots"])
def test_the_words_of_a_trial_are_those_of_a_slow_twin(sections, count, rule):
    twin = SlowWords(count, rule)
    _, series = run({"words": {"rule": rule}}, twin, **sections)
    assert series == twin.counts
    assert series[-1] < count


def test_consensus_is_when_one_word_is_left():
    for model in (FEW, FACING):
        sections = {**model, "stop": {"max_cycles": 400, "order_parameter": None}}
        _, words, agreed = run({"words": {"rule": "voter"}}, more=[{"consensus": {"rule": "voter"}}], **sections)
        assert words.index(1) in (agreed, agreed + 1)  # words are counted at firings, agreement is noted at once
        assert set(words[words.index(1) :]) == {1}


@pytest.mark.parametrize(("step", "cycles"), [(1, 4), (2, 5)])
def test_a_flash_tells_each_that_sees_it_one_word_once_and_a_new_cycle_may_begin_in_the_last_step(step, cycles) -> None:
    talk = Consensus(SimpleNamespace(scenario=SimpleNamespace(population=3, model="embodied"), seed=0))

    def look(is_lit: list[bool], *sightings: tuple[int, int, int], cycles: int) -> None:
        rings = np.array([[each, False, False] for each in is_lit])
        talk.stretch(SimpleNamespace(ring_before=rings, sightings=np.array(sightings)), SimpleNamespace(cycles=cycles))

    look([False, True], (1, 1, 0), cycles=3)  # step, who sees, whom
    look([True, False, True], (0, 1, 0), (0, 2, 0), cycles=4)  # the same flash, and another that nobody sees
    assert (talk.knows, talk.value()) == ([{0}, {0, 1}, {0, 2}], None)
    look([False, True, True], (step, 1, 0), (step, 2, 0), cycles=5)
    assert (talk.knows, talk.value()) == ([{0}] * 3, cycles)
    talk.knows[0] = {*range(3, 13)}
    talk.simulation.pulse_links = lambda: [(0, 1, 0), (0, 2, 0)]
    talk.event(SimpleNamespace(fired=[0]), SimpleNamespace(cycles=6))
    assert talk.knows[1] == talk.knows[2] != {0}


PERIOD_S = 5.0
FACE_TO_FACE = [[20.0, 30.0, 0.0], [40.0, 30.0, np.pi]]
SWARM = {"robots": [{"count": 8, "camera": {"field_of_view_deg": 90}}]}


def value(measure, seconds, faults=(), robots=None, seed=5, observers=()):
    """Return a measure of robots that stand face to face, or of others, after so many seconds."""
    robots = robots or [{"poses": FACE_TO_FACE, "controller": "oscillator"}]
    stop = {"order_parameter": None, "max_time_s": seconds}
    loaded = load_scenario({"robots": robots, "faults": list(faults), "stop": stop, "measures": [measure]})
    (found,) = run_trial(Simulation(loaded, seed), observers).measures.values()
    return found


def test_a_robot_is_suspected_after_the_patience_all_that_fail_must_be_found_and_the_impatient_give_alarms():
    patient, dead = {"detection_delay": {"cycles": 3}}, {"kind": "ring_dead", "robots": [1]}
    assert 3 - 1 < value(patient, 60, [{**dead, "at_s": 20}]) < 3  # up to a period before the fault counts
    assert value(patient, 60, [dead]) == pytest.approx(3, abs=0.041)  # two steps of 0.1 s
    three = [{"poses": [*FACE_TO_FACE, [50.0, 30.0, 0.0]], "controller": "oscillator"}]
    assert value("detection_delay", 60, [{"kind": "ring_dead", "robots": [1]}], three) is not None
    assert value("detection_delay", 60, [{"kind": "ring_dead", "robots": [1, 2]}], three) is None
    assert value("detection_delay", 60) is None
    assert value({"false_alarms": {"cycles": 1.1}}, 600) == 0  # who is always in view
    alarms = value({"false_alarms": {"cycles": 0.5}}, 600)
    assert alarms == pytest.approx(3600 / PERIOD_S, rel=0.12)  # coupling shortens cycles


@pytest.mark.parametrize("at_s", [20, 21.3, 22.6, 23.9])
def test_a_fault_amid_many_steps_is_noticed_as_in_steps_one_by_one(at_s):
    """Some are suspected already when it begins."""
    given = {"detection_delay": {"cycles": 0.5}}, 60, [{"kind": "ring_dead", "robots": [1], "at_s": at_s}]
    assert value(*given) == value(*given, observers=[lambda *_: None])


def slow_alarms(cycles, seconds, dead, seed):
    """Count by going through all pairs of robots in each step."""
    loaded = load_scenario({**SWARM, "faults": [{"kind": "ring_dead", "robots": [dead]}]})
    simulation, robots = Simulation(loaded, seed), 8
    scene = make_scene(loaded.robots, loaded.group_kinds, loaded.arena.build())
    dark = {(i, j): 0.0 for i in range(robots) for j in range(robots)}
    suspects: set[tuple[int, int]] = set()
    alarms = 0
    for step in (simulation.advance(1) for _ in range(int(10 * seconds))):
        seen = {(i, j) for _, i, j in find_sightings(scene, step.poses.copy()[None]).tolist()}
        flashes = set(map(tuple, step.sightings.tolist()))
        dark = {pair: 0.0 if pair in flashes else dark[pair] + 0.1 * (pair in seen) for pair in dark}
        suspected = {pair for pair, dark_s in dark.items() if dark_s > cycles * PERIOD_S - 0.001}
        alarms += sum(pair[1] != dead for pair in suspected - suspects)
        suspects = suspected
    return alarms / robots / (seconds / 3600)


def test_false_alarms_are_those_of_a_slow_twin():
    found = value({"false_alarms": {"cycles": 0.7}}, 120, [{"kind": "ring_dead", "robots": [2]}], SWARM["robots"])
    assert found == pytest.approx(slow_alarms(0.7, 120, 2, 5))
    assert found > 0
