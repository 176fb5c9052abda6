"""Claims about where robots start: at random, on the grid, at given poses, and what is refused."""

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arena import clearance_cm
from epuck_sim.embodied.observers.scene import make_scene
from epuck_sim.embodied.placement import Placement, begin_placement, is_free
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.start import Part, draw_start, spawned
from epuck_sim.embodied.swarm import poses_of
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files

RADIUS_CM = 3.7
OBSTACLES = [
    {"shape": "circle", "x_cm": 20, "y_cm": 20, "radius_cm": 8},
    {"shape": "box", "x_cm": 60, "y_cm": 60, "width_cm": 40, "height_cm": 4, "heading_rad": 0.6},
]
CHI_SQUARE_15 = 37.7  # exceeded once in a thousand, with 15 degrees of freedom
CHI_SQUARE_7 = 24.3  # the same with 7


def placed(*groups, width=60, height=60, obstacles=(), seed=0):
    """Return (robots, 3) the poses at the start of a trial."""
    arena = {"width_cm": width, "height_cm": height, "obstacles": list(obstacles)}
    return placed_as(load_scenario({"arena": arena, "robots": list(groups)}), seed)


def placed_as(scenario, seed):
    """Return (robots, 3) the poses at the start of the trial of a scenario with this seed."""
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    draw_start(scene.block, seed)
    Placement(scene.swarm, scenario).place(scene.block)
    return poses_of(scene.swarm.robots).copy()


def placed_slowly(scenario, seed):
    """Return what `placed_as` does: with numpy's generator, and each robot compared with all before it."""
    arena, radii = scenario.arena.build(), [kind.radius_cm for kind in scenario.robot_kinds]
    random = np.random.default_rng(spawned(seed, Part.PLACEMENT))
    poses, first = {}, 0

    def is_free_of_all(x, y, radius):
        apart = (
            (other_x - x) ** 2 + (other_y - y) ** 2 >= (radii[other] + radius) ** 2
            for other, (other_x, other_y, _) in poses.items()
        )
        return all(apart) and clearance_cm(arena, x, y) >= radius - 1e-6

    numbered = []
    for group in scenario.robots:
        numbered.append((group, range(first, first + group.count)))
        first += group.count
    for group, numbers in numbered:
        if group.placement == "poses":
            poses.update(zip(numbers, group.poses, strict=True))
    for group, numbers in numbered:
        if group.placement == "grid":
            lines = [length / 2 + 10 * (np.arange(n) - (n - 1) / 2) for length, n in grid_sizes(arena)]
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
    return np.array([poses[number] for number in range(first)])


def grid_sizes(arena):
    return [(length, max(1, math.floor(length / 10) - 1)) for length in (arena.width_cm, arena.height_cm)]


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(st.sampled_from(["random", "grid"]), st.integers(1, 8), st.sampled_from([2.0, 3.7, 4.9])),
        min_size=1,
        max_size=4,
    ),
    st.booleans(),
    st.booleans(),
    st.integers(0, 2**70),
)
def test_robots_are_placed_where_a_slow_twin_places_them(groups, has_obstacles, has_poses, seed):
    robots = [
        {"placement": placement, "count": count, "kind": {"radius_cm": radius, "infrared": None, "wheel_base_cm": 2}}
        for placement, count, radius in groups
    ]
    robots += [{"poses": [[10.0, 70.0, 1.0], [20.0, 62.0, 0.0]]}] * has_poses
    arena = {"width_cm": 130, "height_cm": 90, "obstacles": OBSTACLES * has_obstacles}
    scenario = load_scenario({"arena": arena, "robots": robots})
    np.testing.assert_array_equal(placed_as(scenario, seed), placed_slowly(scenario, seed))


def chi_square(values, low, high, bins=16):
    counts, _ = np.histogram(values, bins, (low, high))
    assert counts.sum() == len(values)
    return ((counts - counts.mean()) ** 2 / counts.mean()).sum()


# --- random -----------------------------------------------------------------------------------------


def test_a_robot_placed_at_random_is_uniform_where_bodies_are_off_the_walls():
    poses = np.vstack([placed({"count": 1}, width=60, height=40, seed=seed) for seed in range(1600)])
    low, high = RADIUS_CM, np.array([60, 40]) - RADIUS_CM
    columns, rows = ((poses[:, :2] - low) / (high - low) * 4).T
    assert chi_square(np.floor(columns) + 4 * np.floor(rows) + 0.5, 0, 16) < CHI_SQUARE_15
    assert chi_square(poses[:, 2], 0, 2 * math.pi) < CHI_SQUARE_15


SHIPPED = {name: load_scenario(name) for name in [*builtin_files(ARENAS), *builtin_files(SWEEPS)]}


@pytest.mark.parametrize("arena", [name for name in SHIPPED if isinstance(SHIPPED[name], EmbodiedScenario)])
def test_every_shipped_arena_has_room_for_its_robots_whatever_the_seed(arena):
    scenario = SHIPPED[arena]
    for seed in range(100):
        assert len(placed_as(scenario, seed)) == scenario.robot_count


# --- grid -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("width", "height", "xs", "ys"),
    [(60, 40, (10, 20, 30, 40, 50), (10, 20, 30)), (47, 20, (13.5, 23.5, 33.5), (10,)), (7.4, 7.4, (3.7,), (3.7,))],
)
def test_the_grid_has_equal_padding_to_the_walls(width, height, xs, ys):
    poses = placed({"count": len(xs) * len(ys), "placement": "grid"}, width=width, height=height)
    found = sorted(map(tuple, poses[:, :2].tolist()))
    np.testing.assert_allclose(found, [(x, y) for x in xs for y in ys], rtol=0, atol=1e-9)


def test_robots_on_the_grid_take_any_point_and_any_multiple_of_45_degrees():
    poses = np.array([placed({"count": 10, "placement": "grid"}, seed=seed) for seed in range(200)])
    eighths = poses[..., 2] / (math.pi / 4)
    np.testing.assert_allclose(eighths, np.round(eighths), rtol=0, atol=1e-12)
    assert chi_square(np.round(eighths).ravel(), -0.5, 7.5, bins=8) < CHI_SQUARE_7
    for places in poses[..., :2]:
        assert len({tuple(point) for point in places.tolist()}) == 10
    assert len({tuple(point) for point in poses[..., :2].reshape(-1, 2).tolist()}) == 25


@pytest.mark.parametrize(
    ("count", "obstacles", "allowed"),
    [(26, [], 25), (25, [{"shape": "circle", "x_cm": 30, "y_cm": 30, "radius_cm": 2}], 24)],
)
def test_more_robots_than_free_points_of_the_grid_are_refused(count, obstacles, allowed):
    with pytest.raises(ScenarioError, match=rf"robots\.0\.count: is {count}; allowed: up to {allowed}"):
        placed({"count": count, "placement": "grid"}, obstacles=obstacles)


# --- poses ------------------------------------------------------------------------------------------


def test_poses_are_taken_as_given_and_may_touch():
    poses = [[3.7, 3.7, 1.0], [11.1, 3.7, -20.0], [3.7, 11.1, 0.0], [56.3, 56.3, 7.0]]
    np.testing.assert_array_equal(placed({"poses": poses}), poses)


HERE = {"poses": [[30, 30, 0]]}


@pytest.mark.parametrize(
    ("groups", "where"),
    [
        ([{"poses": [[30, 30, 0], [35, 35, 0]]}], r"robots\.0\.poses\.1: is \[35, 35\] and overlaps"),
        ([HERE, {"poses": [[50, 50, 0], [30, 30, 0]]}], r"robots\.1\.poses\.1: is \[30, 30\] and overlaps"),
        ([HERE, {"poses": [[37.39, 30, 0]]}], r"robots\.1\.poses\.0: is \[37\.39, 30\] and overlaps"),
        ([{"poses": [[10, 3, 0]]}], r"robots\.0\.poses\.0: is \[10, 3\], 0\.7 cm into a wall"),
        ([HERE, {"poses": [[58, 10, 0]]}], r"robots\.1\.poses\.0: is \[58, 10\], 1\.7 cm into a wall"),
        ([{"poses": [[-20, 30, 0]]}], r"robots\.0\.poses\.0: .* wall"),
    ],
)
def test_poses_that_overlap_or_reach_into_walls_are_refused_with_their_key(groups, where):
    with pytest.raises(ScenarioError, match=where):
        placed(*groups)


@pytest.mark.parametrize("place", [[20, 20], [31, 20], [60, 60], [63, 57]])
def test_poses_in_an_obstacle_are_refused_with_their_key(place):
    with pytest.raises(ScenarioError, match=r"robots\.0\.poses\.1: .* obstacle"):
        placed({"poses": [[90, 10, 0], [*place, 0]]}, width=100, height=100, obstacles=OBSTACLES)


# --- mixed, and too many ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "width", "why"),
    [
        (76, 60, "do not fit into the arena"),
        (100_000, 60, "do not fit into the arena"),
        (75, 60, "no free place was found"),
        (50, 60, "no free place was found"),
        (3, 14, "no free place was found"),
    ],
)
def test_more_robots_than_the_arena_can_hold_are_refused_before_long(count, width, why):
    began = time.perf_counter()
    with pytest.raises(ScenarioError, match=why):
        placed({"count": count}, width=width, height=width)
    assert time.perf_counter() - began < 5


def test_a_floor_that_an_obstacle_fills_is_refused_before_long():
    full = {"shape": "box", "x_cm": 30, "y_cm": 30, "width_cm": 54, "height_cm": 54}
    began = time.perf_counter()
    with pytest.raises(ScenarioError, match=r"robots\.0\.count: is 1; no free place was found for robot 0"):
        placed({"count": 1}, obstacles=[full])
    assert time.perf_counter() - began < 5


# What robots remember at the start

POSES = [[15, 15, 0.5], [40, 40, 2.0], [15, 40, -1.0]]


def start_of(memory, controller="firefly", **group):
    """Return what three robots remember before the first step."""
    robots = [{"poses": POSES, "controller": controller, "memory": memory, **group}]
    return Simulation({"robots": robots}, 4).last_step.memories[0]


def test_phases_of_robots_may_be_given_and_all_else_is_as_the_controller_starts() -> None:
    without, given = start_of({}), start_of({"phase_ms": [0, 1200, 4999]})
    assert given["phase_ms"].tolist() == [0, 1200, 4999]
    assert (without["phase_ms"] != given["phase_ms"]).any()
    others = [name for name in given.dtype.names if name != "phase_ms"]
    assert others
    assert all((without[name] == given[name]).all() for name in others)
    assert start_of({"phase_ms": 700})["phase_ms"].tolist() == [700] * 3


@pytest.mark.parametrize("interpret", [False, True])
def test_robots_whose_phases_are_given_flash_at_these_times(interpret) -> None:
    robots = [{"poses": POSES, "controller": "oscillator", "memory": {"phase_ms": [4000, 0, 2000]}}]
    simulation = Simulation({"robots": robots, "noise": "off"}, 1, interpret=interpret)
    assert next(step.time_s for step in simulation if step.ring_on[0]) == pytest.approx(1.0, abs=0.11)


@pytest.mark.parametrize(
    ("memory", "message"),
    [
        ({"phase": 3}, "unknown 'phase', did you mean 'phase_ms'?; firefly has "),
        (
            {"phase_ms": [1, 2]},
            "phase_ms is [1, 2]; allowed: a number or a list of 3, one for each robot, whole numbers",
        ),
        ({"phase_ms": 0.5}, "phase_ms is 0.5; allowed: a number or a list of 3, one for each robot, whole numbers"),
        ({"phase_ms": "early"}, "phase_ms is 'early'; allowed: a number or a list of 3"),
        ({"phase_ms": 5000}, "phase_ms is 5000; allowed: 0 to below the period, 5000"),
        ({"phase_ms": [0, -1, 0]}, "phase_ms is [0, -1, 0]; allowed: 0 to below the period, 5000"),
    ],
)
def test_memory_that_does_not_fit_is_refused_in_words(memory, message) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario({"robots": [{"poses": POSES, "memory": memory}]})
    assert str(caught.value).startswith(f"scenario: robots.0.memory: {message}")


def test_phases_can_be_swept() -> None:
    sweep = {"grid": {"robots.0.memory.phase_ms": [0, 100]}}
    early, late = points({"robots": [{"count": 2}], "sweep": sweep})
    assert (early.scenario.robots[0].memory, late.scenario.robots[0].memory) == ({"phase_ms": 0}, {"phase_ms": 100})


def test_another_controller_gets_what_it_can_remember() -> None:
    given = {"robots": [{"memory": {"phase_ms": 700, "rotation_time": 3}}]}
    with pytest.warns(UserWarning, match=r"^scenario: oscillator lacks memory rotation_time: left out$"):
        replaced = load_scenario(given, controller="oscillator")
    assert replaced.robots[0].memory == {"phase_ms": 700}
    swept = points({**given, "sweep": {"grid": {"robots.0.controller": ["oscillator", "firefly"]}}})
    assert [point.scenario.robots[0].memory for point in swept] == [
        {"phase_ms": 700},
        {"phase_ms": 700, "rotation_time": 3},
    ]


def test_what_no_controller_of_a_sweep_remembers_is_refused() -> None:
    sweep = {"grid": {"robots.0.controller": ["oscillator", "firefly"]}}
    with pytest.raises(ScenarioError, match=r"robots.0.memory: .*'wait'"):
        points({"robots": [{"memory": {"wait": 1}}], "sweep": sweep})


def test_twice_the_groups_take_little_more_than_twice_the_time_to_place():
    def place_s(groups):
        scenario = load_scenario({"arena": {"width_cm": 2000, "height_cm": 2000}, "robots": [{"count": 1}] * groups})
        begin = time.process_time()
        placed_as(scenario, 0)
        return time.process_time() - begin

    place_s(10)
    ratios = [place_s(1600) / place_s(200) for _ in range(3)]
    assert min(ratios) < 24  # 8 if each group costs the same, 64 if each looks at all before it


def test_a_robot_that_joins_may_touch_others_as_one_that_starts_may() -> None:
    scenario = load_scenario({"robots": [{"poses": [[10.0, 10.0, 0.0]]}]})
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    Placement(scene.swarm, scenario)
    begin_placement(scene.block)
    assert is_free(scene.swarm, 17.4001, 10.0, 3.7)
    assert not is_free(scene.swarm, 17.39, 10.0, 3.7)
