"""Snapshots: who would receive whose pulse in swarms that are placed at random, and after they have moved freely.

Those of agents are the package's own neighbour search, those of robots what their cameras, cones or radios reach. All
snapshots of a swarm are one array, (snapshots, population, population): whether the first's pulse reaches the second.
"""

import math
from collections.abc import Sequence

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.observers import find_sightings, make_scene
from epuck_sim.embodied.placement import draw_places, put_at_given_poses
from epuck_sim.embodied.start import draw_start
from epuck_sim.embodied.swarm import poses_of
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario, ParticleStop, RandomAgents, ResponseSection, StartSection
from epuck_sim.scenario.robots import ConeSignal, RadioSignal, RobotGroup
from epuck_sim.scenario.scenario import Scenario


def take_snapshots(scenario: Scenario, count: int, seed: int = 0) -> BoolArray:
    """Return the snapshots of a swarm in `count` random placements, those of seeds from `seed` on."""
    seeds = range(seed, seed + count)
    if isinstance(scenario, EmbodiedScenario):
        return _links_of_robots(scenario, _poses(scenario, seeds))
    assert isinstance(scenario, ParticleScenario)
    if isinstance(scenario.neighbourhood, RandomAgents):
        return _drawn(scenario.agents.count, scenario.neighbourhood.k, count, seed)
    return _links_of_agents(scenario, scenario.agents.speed_cm_s, seeds, (0.0,))[0]


def changed_links(scenario: Scenario, speeds_cm_s: Sequence[float], count: int) -> FloatArray:
    """Return (speeds,) share of links that a period of free motion changes at each speed: 1 - |A and B| / |A or B|.

    Agents walk as the scenario says; robots drive straight ahead, and turn at walls as light does. NaN without links.
    """
    seeds, tau_s = range(count), scenario.scales["tau"]
    if isinstance(scenario, EmbodiedScenario):
        poses = _poses(scenario, seeds)
        begin = _links_of_robots(scenario, poses)
        moved = (_moved(scenario, poses, speed * tau_s) for speed in speeds_cm_s)
        found = [[begin, _links_of_robots(scenario, each)] for each in moved]
    else:
        assert isinstance(scenario, ParticleScenario)
        found = [_links_of_agents(scenario, speed, seeds, (0.0, tau_s)) for speed in speeds_cm_s]
    return np.array([_share_changed(before, after) for before, after in found])


def _share_changed(before: BoolArray, after: BoolArray) -> float:
    either = int((before | after).sum())
    return int((before ^ after).sum()) / either if either else math.nan


def _drawn(agents: int, k: int, count: int, seed: int) -> BoolArray:
    ranks = np.random.default_rng(seed).random((count, agents, agents))
    ranks[:, np.arange(agents), np.arange(agents)] = math.inf
    links: BoolArray = ranks.argsort(2).argsort(2) < min(k, agents - 1)
    return links


def _links_of_agents(
    scenario: ParticleScenario, speed_cm_s: float, seeds: range, times_s: Sequence[float]
) -> list[BoolArray]:
    """Return the snapshots at each time of agents that ignore pulses."""
    free = scenario.model_copy(
        update={
            "agents": scenario.agents.model_copy(update={"speed_cm_s": speed_cm_s}),
            "response": ResponseSection(coupling=0),
            "start": StartSection(),
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


def _poses(scenario: EmbodiedScenario, seeds: range) -> FloatArray:
    """Return (snapshots, robots, 3) cm, cm, rad: poses at the start of trials, of those that are there."""
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    poses = []
    for seed in seeds:
        draw_start(scene.block, seed)
        put_at_given_poses(scene.swarm, scenario)
        draw_places(scene.block, scenario)
        poses.append(poses_of(scene.swarm.robots).copy())
    return np.array(poses)


def _links_of_robots(scenario: EmbodiedScenario, poses: FloatArray) -> BoolArray:
    """Return the snapshots of robots at some poses, each with its ring lit."""
    groups = [_with_cone(group) for group in scenario.robots]
    scene = make_scene(groups, scenario.group_kinds, scenario.arena.build())
    present = np.array(scenario.present)
    links = np.zeros((len(poses), len(present), len(present)), np.bool_)
    for number in range(len(groups)):
        snapshot, receiver, sender = find_sightings(scene, poses, number).T
        links[snapshot, sender, receiver] = True
    return links[:, present][:, :, present]


def _with_cone(group: RobotGroup) -> RobotGroup:
    """Return a group that hears pulses by radio as one that sees through bodies: in the same cones."""
    signal = group.signal
    if not isinstance(signal, RadioSignal):
        return group
    cone = ConeSignal(kind="cone", range_cm=signal.range_cm, angle_deg=signal.angle_deg, of=signal.of, occlusion=False)
    return group.model_copy(update={"signal": cone})


def _moved(scenario: EmbodiedScenario, poses: FloatArray, distance_cm: float) -> FloatArray:
    """Return poses after so many cm straight ahead, mirrored at the walls."""
    moved = poses.copy()
    headings = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], -1)
    for axis, side in enumerate((scenario.arena.width_cm, scenario.arena.height_cm)):
        folded = (poses[..., axis] + distance_cm * headings[..., axis]) % (2 * side)
        beyond = folded > side
        moved[..., axis] = np.where(beyond, 2 * side - folded, folded)
        headings[..., axis] *= np.where(beyond, -1, 1)
    moved[..., 2] = np.arctan2(headings[..., 1], headings[..., 0])
    is_absent = ~np.array(scenario.present)  # and far outside
    moved[:, is_absent] = poses[:, is_absent]
    return moved
