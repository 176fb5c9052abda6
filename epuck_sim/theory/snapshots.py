"""Snapshots: who would receive whose pulse in swarms that are placed at random, and after they have moved freely.

Those of agents come from the package's own neighbour search, those of robots from the reach of their cameras, cones or
radios. All snapshots of a swarm are one array, (snapshots, population, population): whether the first's pulse reaches
the second. Measures of their graphs are means over snapshots, and shares of snapshots, with intervals.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.observers import find_sightings, make_scene
from epuck_sim.estimate import Estimate
from epuck_sim.measures.links import find_components
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario, ParticleStop, RandomAgents, ResponseSection, StartSection
from epuck_sim.scenario.robots import ConeSignal, RadioSignal
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.statistic import wilson_interval
from epuck_sim.statistics.survival import QUANTILE
from epuck_sim.trial.embodied import start_poses


def take_snapshots(scenario: Scenario, count: int) -> BoolArray:
    """Return the snapshots of a swarm in `count` random placements, those of seeds from 0 on."""
    if isinstance(scenario, EmbodiedScenario):
        return _links_of_robots(scenario, start_poses(scenario, range(count)))
    assert isinstance(scenario, ParticleScenario)
    if not isinstance(scenario.neighbourhood, RandomAgents):
        return _links_of_agents(scenario, scenario.agents.speed_cm_s, range(count), (0.0,))[0]
    agents = scenario.agents.count
    ranks = np.random.default_rng(0).random((count, agents, agents))
    ranks[:, np.arange(agents), np.arange(agents)] = math.inf
    return ranks.argsort(2).argsort(2) < min(scenario.neighbourhood.k, agents - 1)


def changed_links(scenario: Scenario, speeds_cm_s: Sequence[float], count: int) -> FloatArray:
    """Return (speeds,) share of links that a period of free motion changes at each speed: 1 - |A and B| / |A or B|.

    Agents walk as in the scenario; robots drive straight ahead, and are reflected at walls. NaN without links.
    """
    seeds, tau_s = range(count), scenario.scales["tau"]
    if isinstance(scenario, EmbodiedScenario):
        poses = start_poses(scenario, seeds)
        begin = _links_of_robots(scenario, poses)
        moved = (_moved(scenario, poses, speed * tau_s) for speed in speeds_cm_s)
        found = [[begin, _links_of_robots(scenario, each)] for each in moved]
    else:
        assert isinstance(scenario, ParticleScenario)
        found = [_links_of_agents(scenario, speed, seeds, (0.0, tau_s)) for speed in speeds_cm_s]
    counts = [(int((before ^ after).sum()), int((before | after).sum())) for before, after in found]
    return np.array([changed / either if either else math.nan for changed, either in counts])


def _links_of_agents(
    scenario: ParticleScenario, speed_cm_s: float, seeds: range, times_s: Sequence[float]
) -> list[BoolArray]:
    """Return the snapshots at each time of agents that ignore pulses."""
    free = scenario.model_copy(
        update={
            "agents": scenario.agents.model_copy(update={"speed_cm_s": speed_cm_s}),
            "response": ResponseSection(coupling=0),
            "start": StartSection(),
            "faults": (),
            "schedule": (),
            "measures": (),
            "stop": ParticleStop(order_parameter=None),
        }
    )
    simulation, agents = ParticleSimulation(free, 0), scenario.agents.count
    found = [np.zeros((len(seeds), agents, agents), np.bool_) for _ in times_s]
    for place, seed in enumerate(seeds):
        simulation.reset(seed)
        for snapshots, time_s in zip(found, times_s, strict=True):
            if time_s:
                simulation.run_to(time_s)
            snapshots[place].ravel()[simulation.neighbour_links()] = True
    return found


def _links_of_robots(scenario: EmbodiedScenario, poses: FloatArray) -> BoolArray:
    """Return the snapshots of robots at some poses, each with its ring lit.

    Groups that receive pulses by radio are taken as ones that see through bodies, in the same cones.
    """
    groups = list(scenario.robots)
    for number, group in enumerate(groups):
        if isinstance(radio := group.signal, RadioSignal):
            reach: Any = {"range_cm": radio.range_cm, "angle_deg": radio.angle_deg, "of": radio.of}
            cone = ConeSignal(kind="cone", occlusion=False, **reach)
            groups[number] = group.model_copy(update={"signal": cone})
    scene = make_scene(groups, scenario.group_kinds, scenario.arena.build())
    present = np.array(scenario.present)
    links = np.zeros((len(poses), len(present), len(present)), np.bool_)
    snapshot, receiver, sender = find_sightings(scene, poses).T
    links[snapshot, sender, receiver] = True
    return links[:, present][:, :, present]


def _moved(scenario: EmbodiedScenario, poses: FloatArray, distance_cm: float) -> FloatArray:
    """Return poses after a distance straight ahead, mirrored at the walls."""
    moved = poses.copy()
    headings = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], -1)
    for axis, side in enumerate((scenario.arena.width_cm, scenario.arena.height_cm)):
        folded = (poses[..., axis] + distance_cm * headings[..., axis]) % (2 * side)
        beyond = folded > side
        moved[..., axis] = np.where(beyond, 2 * side - folded, folded)
        headings[..., axis] *= np.where(beyond, -1, 1)
    moved[..., 2] = np.arctan2(headings[..., 1], headings[..., 0])
    is_absent = ~np.array(scenario.present)  # absent robots stay where they are, far outside
    moved[:, is_absent] = poses[:, is_absent]
    return moved


class GraphMeasures(NamedTuple):
    """Measures of the graphs in a swarm's snapshots."""

    links: Estimate  # links per agent: the number of others that its pulse reaches
    reciprocity: Estimate  # share of links whose receiver has a link back; NaN without links
    components: Estimate  # number of strongly connected components over that of agents
    sources: Estimate  # share of agents that are heard and hear nobody
    frustrated: Estimate
    """Probability of two or more components without a way in: clusters that nothing brings together (Beardo et al.)."""
    joined: Estimate  # probability that one component reaches all others, so that a swarm that stands can synchronise


def measure_graphs(snapshots: BoolArray) -> GraphMeasures:
    """Return the measures of snapshots, (snapshots, population, population): sender, receiver.

    >>> ring = np.roll(np.eye(4, dtype=bool), 1, axis=1)
    >>> measured = measure_graphs(np.array([ring, ring]))
    >>> measured.links.value, measured.reciprocity.value, measured.joined.value
    (1.0, 0.0, 1.0)
    """
    out, into = snapshots.any(2), snapshots.any(1)
    links = snapshots.sum((1, 2))
    back = (snapshots & snapshots.transpose(0, 2, 1)).sum((1, 2))
    components, without_way_in = count_components(snapshots)
    population = snapshots.shape[1]
    return GraphMeasures(
        links=mean(links / population),
        reciprocity=mean(back[links > 0] / links[links > 0]),
        components=mean(components / population),
        sources=mean((out & ~into).mean(1)),
        frustrated=share(without_way_in > 1),
        joined=share(without_way_in == 1),
    )


def count_components(snapshots: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (snapshots,) number of strongly connected components, and number of those without a way in."""
    count, population, _ = snapshots.shape
    which, sender, receiver = np.nonzero(snapshots)
    ends = which * population + sender, which * population + receiver
    component, snapshot_of = find_components(*ends, population, count, "strong")
    has_way_in = np.zeros(len(snapshot_of), np.bool_)
    one, other = component[ends[0]], component[ends[1]]
    has_way_in[other[one != other]] = True
    return np.bincount(snapshot_of, minlength=count), np.bincount(snapshot_of[~has_way_in], minlength=count)


def mean(values: FloatArray) -> Estimate:
    """Return the mean of independent values with its 95 % interval."""
    if len(values) < 2:
        return Estimate(float(values.mean()) if len(values) else math.nan)
    value, reach = float(values.mean()), QUANTILE * float(values.std(ddof=1)) / math.sqrt(len(values))
    return Estimate(value, value - reach, value + reach)


def share(true: BoolArray) -> Estimate:
    """Return the share of values that are true, with Wilson's 95 % interval."""
    value = float(true.mean())
    return Estimate(value, *wilson_interval(value, len(true)))
