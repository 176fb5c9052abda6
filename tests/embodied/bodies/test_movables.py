"""Claims about movables: they move if the pushers' forces sum to more than friction, hide, are seen, and start anew."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import epuck
from epuck_sim.arena import make_arena
from epuck_sim.embodied.bodies.shapes import DYNES_PER_NEWTON, GRAVITY_CM_S2
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from tests.embodied.bodies.worlds import MovedWorld

DIAMETER_CM = 2 * epuck.RADIUS_CM
DISC_CM = 6.0
STEP_S = 0.01
SETTLING = 25
"""Physics steps that forces take to balance: 18.0 were the most, with four pushers of 2 N each near the threshold."""

DISC = {"x_cm": 50, "y_cm": 30, "radius_cm": DISC_CM, "mass_kg": 1, "friction": 0.1}


def row_of(pushers, force_n, friction_n, mass_g, discs=1):
    """Return a world with robots in a row that touch each other, and discs in a row ahead of them."""
    first = 10 + DIAMETER_CM * (pushers - 1) + epuck.RADIUS_CM + DISC_CM
    friction = friction_n * DYNES_PER_NEWTON / (mass_g * GRAVITY_CM_S2)
    movables = [(first + 2 * DISC_CM * place, 30, DISC_CM, mass_g, friction) for place in range(discs)]
    poses = np.array([[10 + DIAMETER_CM * place, 30, 0] for place in range(pushers)])
    return MovedWorld(make_arena(900, 60, [], [], movables), poses, drive_force_n=force_n)


def way_cm(world, speed, seconds):
    """Return how far the first disc comes in some seconds when all robots drive at a speed, cm/s."""
    disc = world.swarm.circles[0]
    start = disc.x
    for _ in range(round(10 * seconds)):
        world.velocities[:] = speed, 0, 0
        world.advance(10)
    return disc.x - start


@settings(max_examples=12)
@given(
    pushers=st.integers(1, 4),
    force_n=st.floats(0.1, 2),
    share=st.one_of(st.floats(0.1, 0.95), st.floats(1.05, 3)),
    mass_g=st.floats(200, 2000),
    speed=st.floats(0.5, 12.8),
)
def test_a_disc_moves_if_the_forces_of_its_pushers_sum_to_more_than_its_friction(
    pushers, force_n, share, mass_g, speed
):
    """The closed form: it accelerates by what forces are left over to the pushers' speed, which it keeps; or stays."""
    friction_n = share * pushers * force_n
    found = way_cm(row_of(pushers, force_n, friction_n, mass_g), speed, seconds=5)
    if share > 1:
        assert found == pytest.approx(0, abs=SETTLING * STEP_S * speed)
    else:
        left_over = (pushers * force_n - friction_n) * DYNES_PER_NEWTON
        acceleration = left_over / (mass_g + pushers * epuck.MASS_G)
        until_s = min(speed / acceleration, 5)
        expected = acceleration * until_s**2 / 2 + speed * (5 - until_s)
        assert found == pytest.approx(expected, abs=SETTLING * STEP_S * speed)


def abreast(speeds, friction_n):
    """Return how far a disc comes in 10 s that two robots in a lane push at different speeds, cm/s."""
    friction = friction_n * DYNES_PER_NEWTON / (1000 * GRAVITY_CM_S2)
    arena = make_arena(300, 14.9, [], [], [(25, 7.45, 7, 1000, friction)])
    world = MovedWorld(arena, [[10, 3.74, 0], [10, 11.16, 0]], drive_force_n=0.5)
    places = []
    for _ in range(250):
        world.velocities[:, 0] = speeds
        world.velocities[:, 1:] = 0
        world.advance(10)
        places.append(world.swarm.circles[0].x)
    return places[-1] - places[-101]


@pytest.mark.parametrize(
    ("speeds", "friction_n", "way"), [((2, 4), 0.3, 40), ((2, 4), 0.8, 20), ((2, 4), 1.2, 0), ((4, 0), 0.8, 0)]
)
def test_of_two_with_different_speeds_the_faster_moves_it_if_it_can_alone_and_else_the_slower_holds_it_up(
    speeds, friction_n, way
):
    assert abreast(speeds, friction_n) == pytest.approx(way, abs=0.01 if way else 1e-6)


@pytest.mark.parametrize(("discs", "moves"), [(1, True), (2, True), (3, False)])
def test_what_is_pushed_by_what_is_pushed_adds_its_friction(discs, moves):
    found = way_cm(row_of(2, force_n=0.5, friction_n=0.4, mass_g=500, discs=discs), 3.0, seconds=10)
    assert (found > 25) if moves else (abs(found) < 1e-3)


def scene(groups, **arena):
    robots = [
        {"poses": [pose], "controller": "constant", "parameters": {"left_cm_s": v, "right_cm_s": v, "ring_on": lit}}
        for pose, v, lit in groups
    ]
    return {"arena": {"width_cm": 150, "height_cm": 100} | arena, "robots": robots, "noise": "off"}


def test_sensors_see_a_disc_where_it_was_pushed_to_as_an_obstacle_that_stands_there():
    groups = [([50 - DISC_CM - epuck.RADIUS_CM, 30, 0], 5.0, False), ([90, 34, 3], 0.0, False)]
    pushed = Simulation(scene(groups, movables=[DISC | {"friction": 0.02}]), 1).advance(60)
    ((x, y),) = pushed.movables
    assert x > 75
    there = [(pose.tolist(), v, lit) for pose, (_, v, lit) in zip(pushed.poses, groups, strict=True)]
    obstacle = {"shape": "circle", "x_cm": x, "y_cm": y, "radius_cm": DISC_CM - 1e-6}
    still = next(Simulation(scene(there, obstacles=[obstacle]), 1))
    assert (pushed.infrared[1] > 100).any()
    np.testing.assert_allclose(pushed.infrared, still.infrared, rtol=0, atol=0.5)
    assert pushed.contacts.tolist() == [[0, -1]] == still.contacts.tolist()


def test_a_strong_robot_that_touches_nothing_moves_as_where_there_is_nothing_to_push_a_physics_step_later():
    speed = 5
    poses = {"poses": [[50, 50, 1]], "controller": "constant", "parameters": {"left_cm_s": 3, "right_cm_s": 7}}
    far = DISC | {"x_cm": 90, "y_cm": 90}
    arena = {"width_cm": 100, "height_cm": 100}
    with_disc = {"arena": arena | {"movables": [far]}, "robots": [poses], "contact": {"drive_force_n": 1000}}
    ways = [Simulation(each, 1).advance(200).poses.copy() for each in ({"arena": arena, "robots": [poses]}, with_disc)]
    assert 0 < np.hypot(*(ways[0] - ways[1])[0, :2]) < 1.1 * speed * STEP_S
    assert ways[0][0, 2] == pytest.approx(ways[1][0, 2], abs=1e-9)


def test_movables_may_begin_side_by_side():
    load_scenario(scene([([10, 10, 0], 0, False)], movables=[DISC, DISC | {"x_cm": 62}]))
