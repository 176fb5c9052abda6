"""A naive implementation of thesis chapters 3 and 5: slow, for comparison with the kernel.

It was written from the thesis (2.4, 3.1, 5.1, Appendix D) and from nothing else. Phases and positions are updated at
every event, neighbours are searched for among all agents, and a cascade is computed with sets. Only two things are
taken from the simulation that it is compared with: the initial state, and each agent's streams of random numbers.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from epuck_sim import ParticleScenario, ParticleSimulation
from epuck_sim.arrays import BoolArray, FloatArray, StreamArray
from epuck_sim.util.rng import uniform

SIMULTANEITY_CYCLES = 1e-12  # firings that are no farther apart than this happen at once


class NaiveEvent(NamedTuple):
    """What happens at one time, and how close its decisions were."""

    time: float  # cycles since the beginning
    turned: int | None
    fired: frozenset[int]
    received: frozenset[int]
    margin: float  # relative margin of the closest decision; one of the size of rounding errors may go either way


def receivers_of(
    scenario: ParticleScenario, positions: FloatArray, headings: FloatArray, firing: int
) -> tuple[BoolArray, FloatArray]:
    """Return which agents receive a pulse, by their positions among all, and the relative margin of each decision."""
    rule, side = scenario.neighbourhood, scenario.space.side_cm
    others, margin = np.arange(len(positions)) != firing, np.full(len(positions), np.inf)
    if rule.kind == "all":
        return others, margin
    way = positions - positions[firing]
    if scenario.space.boundary == "cyclic":  # the shorter one along each axis
        way = (way + side / 2) % side - side / 2
    distance = np.linalg.norm(way, axis=1)
    if rule.kind == "nearest":
        ranked = np.append(np.sort(distance[others]), np.inf)
        last, next_one = ranked[rule.k - 1 : rule.k + 1]
        margin[others & (last <= distance) & (distance <= next_one)] = (next_one - last) / side
        return others & (distance <= last), margin
    receives = others.copy()
    if rule.radius_cm is not None:
        receives &= distance <= rule.radius_cm
        margin = np.abs(distance - rule.radius_cm) / side
    if rule.kind != "range" and rule.angle_deg < 360:
        unit = way / np.where(others, distance, 1)[:, None]
        # the cone is the receiver's, or that of the agent that fires
        ahead = (-unit * headings).sum(axis=1) if rule.kind == "cone_of_vision" else unit @ headings[firing]
        edge = math.cos(math.radians(rule.angle_deg / 2))
        margin = np.where(receives, np.minimum(margin, np.abs(ahead - edge)), margin)
        receives &= ahead >= edge
    return receives, np.where(others, margin, np.inf)


def shift(curve: str, coupling: float, parameters: Mapping[str, float], phase: float) -> float:
    """Return the response to a pulse at a phase beyond the refractory period (2.4, eqs. 5.3 to 5.5)."""
    if curve == "additive":
        return coupling
    if curve == "mirollo_strogatz":  # a state, concave down, is raised by the coupling
        b = parameters["dissipation"]
        state = math.log(1 + math.expm1(b) * phase) / b
        return math.expm1(b * (state + coupling)) / math.expm1(b) - phase
    if curve == "piecewise_linear":
        return coupling * phase * (parameters["early_slope"] if phase <= parameters["knee"] else 1)
    if curve == "multiplicative":
        return coupling * phase
    if curve == "sine":
        return -coupling * math.sin(2 * math.pi * phase)
    return -coupling * phase if phase <= 0.5 else coupling * (1 - phase)


class NaiveModel:
    """A second implementation, which starts from the state of a fresh simulation."""

    def __init__(self, swarm: ParticleSimulation) -> None:
        self.scenario = swarm.scenario
        arrays = swarm._arrays
        agents = range(self.scenario.agents.count)
        self.positions = [[float(x) for x in arrays.origin[:, agent]] for agent in agents]
        self.headings = [[float(x) for x in arrays.heading[:, agent]] for agent in agents]
        self.speeds = [float(speed) for speed in arrays.speed]
        self.periods = [float(period) for period in arrays.period]
        self.phases = [1 - float(arrays.next_firing[agent]) / self.periods[agent] for agent in agents]
        self.streams = arrays.streams.copy()
        self.receiver_streams = arrays.receiver_streams.copy()
        self.run_speeds = arrays.run_speeds.copy()
        self.left_of_runs = [math.inf] * len(self.phases)
        for agent in agents if arrays.scene.has_runs else ():
            self.left_of_runs[agent] = float(arrays.run_end_cycle[agent] + arrays.run_end_time[agent])
        self.time = 0.0
        self.cycles = 0
        self.order: float | None = None
        self.is_synchronised = False

    # --- from one event to the next ------------------------------------------------------------------

    def step(self) -> NaiveEvent:
        """Simulate up to the next event and return it."""
        agents = range(len(self.phases))
        left = [(1 - self.phases[agent]) * self.periods[agent] for agent in agents]
        walls = [min(self.wall_hit(agent), (self.left_of_runs[agent], -1, False)) for agent in agents]
        firing, wall = min(left), min(walls)
        others = sorted([*left, *(until for until, _, _ in walls)])
        self.is_synchronised = False
        if wall[0] <= firing:
            self.advance(wall[0])
            turned = walls.index(wall)
            if wall[1] >= 0:
                self.reflect(turned, wall[1], wall[2])
            else:
                self.begin_run(turned)
            return NaiveEvent(self.time, turned, frozenset(), frozenset(), others[1] - wall[0])
        self.advance(firing)
        at_once = {agent for agent in agents if left[agent] <= firing + SIMULTANEITY_CYCLES}
        # merged oscillators differ by rounding; those about as far apart as the limit may or may not fire with them
        margins = [
            abs(gap - firing - SIMULTANEITY_CYCLES) if gap - firing > SIMULTANEITY_CYCLES / 10 else 1.0 for gap in left
        ]
        margins += [abs(until - firing) for until, _, _ in walls]
        fired, received = self.cascade(at_once, margins)
        return NaiveEvent(self.time, None, frozenset(fired), frozenset(received), min(margins))

    def advance(self, cycles: float) -> None:
        """Let time pass (eqs. 3.1 and 5.9); nothing else happens."""
        for agent, position in enumerate(self.positions):
            self.phases[agent] += cycles / self.periods[agent]
            for axis, ahead in enumerate(self.headings[agent]):
                position[axis] += ahead * self.speeds[agent] * cycles
            self.left_of_runs[agent] -= cycles
        self.time += cycles

    # --- motion (3.1, 5.1.2, D) ----------------------------------------------------------------------

    def wall_hit(self, agent: int) -> tuple[float, int, bool]:
        """Return when, from now, an agent reaches a wall, along which axis, and whether it is the far one."""
        found = (math.inf, 0, False)
        for axis, (place, ahead) in enumerate(zip(self.positions[agent], self.headings[agent], strict=True)):
            pace = ahead * self.speeds[agent]
            if pace:
                way = self.scenario.space.side_cm - place if pace > 0 else place
                found = min(found, (max(way, 0.0) / abs(pace), axis, pace > 0))
        return found

    def reflect(self, agent: int, axis: int, is_far: bool) -> None:
        """Reflect an agent at a wall in a random direction; in a cyclic space, let it enter on the opposite side."""
        side = self.scenario.space.side_cm
        self.positions[agent][axis] = side if is_far else 0.0
        if self.scenario.space.boundary == "cyclic":
            self.positions[agent][axis] = 0.0 if is_far else side
            return
        normal = -1.0 if is_far else 1.0
        if self.scenario.space.boundary == "mirrored":
            self.headings[agent][axis] = normal * abs(self.headings[agent][axis])
            return
        heading, stream = self.headings[agent], self.streams[agent]
        if len(heading) == 1:
            heading[0] = normal
        elif len(heading) == 2:
            angle = -math.pi / 2 + math.pi * uniform(stream)
            heading[axis], heading[1 - axis] = normal * math.cos(angle), math.sin(angle)
        else:  # uniform over a hemisphere: so is the height above its rim (Archimedes)
            height, azimuth = 1 - uniform(stream), 2 * math.pi * uniform(stream)
            self.set_heading(heading, axis, normal * height, azimuth)

    def reorient(self, agent: int) -> None:
        """Turn an agent in a random direction (D.1)."""
        heading, stream = self.headings[agent], self.streams[agent]
        if len(heading) == 1:
            heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
        elif len(heading) == 2:
            angle = 2 * math.pi * uniform(stream)
            heading[:] = math.cos(angle), math.sin(angle)
        else:
            height, azimuth = 2 * uniform(stream) - 1, 2 * math.pi * uniform(stream)
            self.set_heading(heading, 2, height, azimuth)

    # --- random walks (6.2) --------------------------------------------------------------------------

    def begin_run(self, agent: int) -> None:
        """Turn an agent at the end of its run, and draw when the next one ends, and its speed."""
        walk, stream = self.scenario.agents.walk, self.streams[agent]
        self.turn(self.headings[agent], walk.persistence or 0.0, stream)
        mean_or_shortest = walk.run_s / self.scenario.clocks.period_s
        if walk.kind == "levy":  # the share of runs longer than t is (t / shortest) ** (1 - exponent)
            self.left_of_runs[agent] = mean_or_shortest * (1 - uniform(stream)) ** (-1 / (walk.exponent - 1))
        else:
            self.left_of_runs[agent] = -mean_or_shortest * math.log(1 - uniform(stream))
        if self.scenario.agents.speed_per_run:
            self.speeds[agent] = float(self.run_speeds[int(uniform(stream) * len(self.run_speeds))])

    @staticmethod
    def turn(heading: list[float], g: float, stream: StreamArray) -> None:
        """Turn a heading by a random angle of mean cosine g."""
        if len(heading) == 1:
            heading[0] *= -1 if uniform(stream) < (1 - g) / 2 else 1
        elif len(heading) == 2:  # the inverse of the wrapped Cauchy distribution
            angle = 2 * math.atan((1 - g) / (1 + g) * math.tan(math.pi * (uniform(stream) - 0.5)))
            angle += math.atan2(heading[1], heading[0])
            heading[:] = math.cos(angle), math.sin(angle)
        else:  # the inverse of that of Henyey and Greenstein, as it stands in their field
            share, azimuth = 1 - uniform(stream), 2 * math.pi * uniform(stream)
            cosine = 2 * share - 1
            if g > 0:
                cosine = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * share)) ** 2) / (2 * g)
            old, rim = np.array(heading), math.sqrt(max(1 - cosine**2, 0))
            side = math.copysign(1, old[2])
            ab = -old[0] * old[1] / (side + old[2])  # an orthonormal basis (Duff et al. 2017)
            one = np.array([1 - side * old[0] ** 2 / (side + old[2]), side * ab, -side * old[0]])
            other = np.cross(old, one)
            heading[:] = (cosine * old + rim * (math.cos(azimuth) * one + math.sin(azimuth) * other)).tolist()

    @staticmethod
    def set_heading(heading: list[float], axis: int, height: float, azimuth: float) -> None:
        rim = math.sqrt(1 - height**2)
        heading[axis] = height
        heading[(axis + 1) % 3] = rim * math.cos(azimuth)
        heading[(axis + 2) % 3] = rim * math.sin(azimuth)

    # --- neighbourhoods (3.1.2, 5.1.3) ---------------------------------------------------------------

    def neighbours(self, firing: int, margins: list[float]) -> set[int]:
        """Return the agents that receive the pulse of a firing agent."""
        rule = self.scenario.neighbourhood
        if rule.kind == "random":
            others = [agent for agent in range(len(self.phases)) if agent != firing]
            return self.draw(others, rule.k, self.receiver_streams[firing])
        receives, margin = receivers_of(self.scenario, np.array(self.positions), np.array(self.headings), firing)
        margins.append(float(margin.min()))
        return set(np.flatnonzero(receives).tolist())

    @staticmethod
    def draw(others: list[int], k: int, stream: StreamArray) -> set[int]:
        """Draw k of the others, each set of k with the same chance (Bentley and Floyd 1987)."""
        drawn: set[int] = set()
        for last in range(len(others) - k, len(others)):
            chosen = others[int(uniform(stream) * (last + 1))]
            drawn.add(others[last] if chosen in drawn else chosen)
        return drawn

    # --- pulses (3.1.1, 3.1.3, 5.1.1) ----------------------------------------------------------------

    def cascade(self, at_once: set[int], margins: list[float]) -> tuple[set[int], set[int]]:
        """Fire these agents and all that their pulses make fire; return the agents that fired, and that received."""
        response = self.scenario.response
        fired, received, reached, waiting = set(at_once), set(), set(), set(at_once)
        while waiting:
            for receiver in self.neighbours(waiting.pop(), margins):
                reached.add(receiver)
                phase, refractory = self.phases[receiver], response.refractory
                if receiver in fired or receiver in received:
                    continue
                margins.append(abs(phase - refractory))
                if phase <= refractory:
                    continue
                received.add(receiver)
                after = phase + shift(response.curve, response.coupling, response.parameters, phase)
                if response.curve == "sawtooth":
                    margins.append(abs(phase - 0.5))
                if response.curve == "piecewise_linear":
                    margins.append(abs(phase - response.parameters["knee"]))
                if response.coupling:
                    is_exact = response.curve == "sawtooth"  # and kappa = 1: exactly 1
                    margins.append(abs(after - 1) or float(is_exact))
                self.phases[receiver] = min(max(after, 0.0), 1.0)
                if after >= 1 - SIMULTANEITY_CYCLES:
                    fired.add(receiver)
                    waiting.add(receiver)
        for agent in fired:
            self.phases[agent] = 0.0
        motion = self.scenario.agents.reorient_on
        turned = {"emitting": fired, "receiving": received, "arriving": reached}
        for agent in set().union(*(turned[pulses] for pulses in motion)):
            self.reorient(agent)
        if self.scenario.stop.reference in fired:
            self.cycles += 1
            self.order = self.measure_order()
            threshold = self.scenario.stop.order_parameter
            if threshold is not None and len(self.phases) > 1:
                self.is_synchronised = self.order >= threshold
        return fired, received

    # --- the metric (3.1.5, 5.1.4) -------------------------------------------------------------------

    def measure_order(self) -> float:
        """Return the order parameter: eq. 5.7 or 3.4."""
        angles = [2 * math.pi * phase for phase in self.phases]
        eta = sum(map(math.cos, angles)) / len(angles)
        if self.scenario.stop.metric == "reference":
            return eta
        return math.hypot(eta, sum(map(math.sin, angles)) / len(angles))
