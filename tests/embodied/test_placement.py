"""Claims about where robots start: at random, on the grid, at given poses, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import Simulation, load_scenario, points
from epuck_sim.arena import clearance_cm
from epuck_sim.embodied.observers import make_scene
from epuck_sim.embodied.placement import begin_placement, draw_places, is_free, put_at_given_poses
from epuck_sim.embodied.start import Part, draw_start, spawned
from epuck_sim.embodied.swarm import poses_of
from epuck_sim.scenario.robots import members

RADIUS_CM = 3.7
shapes = st.tuples(st.sampled_from(["random", "grid"]), st.integers(1, 8), st.sampled_from([2.0, 3.7, 4.9]))
OBSTACLES = [
    {"shape": "circle", "x_cm": 20, "y_cm": 20, "radius_cm": 8},
    {"shape": "box", "x_cm": 60, "y_cm": 60, "width_cm": 40, "height_cm": 4, "heading_rad": 0.6},
]


def placed_as(scenario, seed):
    """Return (robots, 3) the poses at the start of the trial of a scenario with this seed."""
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    draw_start(scene.block, seed)
    put_at_given_poses(scene.swarm, scenario)
    draw_places(scene.block, scenario)
    return poses_of(scene.swarm.robots).copy()


def placed_slowly(scenario, seed):
    """Return what `placed_as` does: with numpy's generator, and each robot compared with all before it."""
    arena, radii = scenario.arena.build(), [kind.radius_cm for kind in scenario.robot_kinds]
    random = np.random.default_rng(spawned(seed, Part.PLACEMENT))
    poses = {}

    def is_free_of_all(x, y, radius):
        apart = (
            (other_x - x) ** 2 + (other_y - y) ** 2 >= (radii[other] + radius) ** 2
            for other, (other_x, other_y, _) in poses.items()
        )
        return all(apart) and clearance_cm(arena, x, y) >= radius - 1e-6

    numbered = [(group, numbers) for _, group, numbers in members(scenario.robots)]
    for group, numbers in numbered:
        if group.placement == "poses":
            poses.update(zip(numbers, group.poses, strict=True))
    for group, numbers in numbered:
        if group.placement == "grid":
            sizes = [(length, max(1, math.floor(length / 10) - 1)) for length in (arena.width_cm, arena.height_cm)]
            lines = [length / 2 + 10 * (np.arange(n) - (n - 1) / 2) for length, n in sizes]
            free = np.array([(x, y) for y in lines[1] for x in lines[0] if is_free_of_all(x, y, radii[numbers[0]])])
            chosen = random.choice(free, group.count, replace=False)
            headings = random.integers(8, size=group.count) * (2 * math.pi / 8)
            poses.update(zip(numbers, np.column_stack([chosen, headings]).tolist(), strict=True))
    for group, numbers in numbered:
        if group.placement == "random":
            for number in numbers:
                free, radius = False, radii[number]
                while not free:
                    x = radius + (arena.width_cm - 2 * radius) * random.random()
                    y = radius + (arena.height_cm - 2 * radius) * random.random()
                    free = is_free_of_all(x, y, radius)
                poses[number] = (x, y, 2 * math.pi * random.random())
    return np.array([poses[number] for number in range(len(radii))])


@settings(max_examples=30)
@given(st.lists(shapes, min_size=1, max_size=4), st.booleans(), st.booleans(), st.integers(0, 2**70))
def test_robots_are_placed_where_a_slow_twin_places_them(groups, has_obstacles, has_poses, seed):
    robots = [
        {"placement": placement, "count": count, "kind": {"radius_cm": radius, "infrared": None, "wheel_base_cm": 2}}
        for placement, count, radius in groups
    ]
    robots += [{"poses": [[10.0, 70.0, 1.0], [20.0, 62.0, 0.0]]}] * has_poses
    arena = {"width_cm": 130, "height_cm": 90, "obstacles": OBSTACLES * has_obstacles}
    scenario = load_scenario({"arena": arena, "robots": robots})
    np.testing.assert_array_equal(placed_as(scenario, seed), placed_slowly(scenario, seed))


def test_poses_are_taken_as_given_and_may_touch_as_a_robot_that_joins_may():
    poses = [[3.7, 3.7, 1.0], [11.1, 3.7, -20.0], [3.7, 11.1, 0.0], [56.3, 56.3, 7.0]]
    scenario = load_scenario({"arena": {"width_cm": 60, "height_cm": 60}, "robots": [{"poses": poses}]})
    np.testing.assert_array_equal(placed_as(scenario, 0), poses)
    scenario = load_scenario({"robots": [{"poses": [[10.0, 10.0, 0.0]]}]})
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    put_at_given_poses(scene.swarm, scenario)
    begin_placement(scene.block)
    assert is_free(scene.swarm, 17.4001, 10.0, 3.7)
    assert not is_free(scene.swarm, 17.39, 10.0, 3.7)


def test_phases_may_be_given_all_else_is_as_the_controller_starts_and_another_one_gets_what_it_can_remember() -> None:
    def start_of(memory) -> np.ndarray:
        robots = [{"poses": [[15, 15, 0.5], [40, 40, 2.0], [15, 40, -1.0]], "memory": memory}]
        return Simulation({"robots": robots}, 4).last_step.memories[0]

    without, given = start_of({}), start_of({"phase_ms": [0, 1200, 4999]})
    assert given["phase_ms"].tolist() == [0, 1200, 4999]
    assert (without["phase_ms"] != given["phase_ms"]).any()
    others = [name for name in given.dtype.names if name != "phase_ms"]
    assert others
    assert all((without[name] == given[name]).all() for name in others)
    assert start_of({"phase_ms": 700})["phase_ms"].tolist() == [700] * 3
    given = {"robots": [{"memory": {"phase_ms": 700, "rotation_time": 3}}]}
    with pytest.warns(UserWarning, match=r"^scenario: oscillator lacks memory rotation_time: left out$"):
        replaced = load_scenario(given, controller="oscillator")
    assert replaced.robots[0].memory == {"phase_ms": 700}
    swept = points({**given, "sweep": {"grid": {"robots.0.controller": ["oscillator", "firefly"]}}})
    memories = [point.scenario.robots[0].memory for point in swept]
    assert memories == [{"phase_ms": 700}, {"phase_ms": 700, "rotation_time": 3}]
