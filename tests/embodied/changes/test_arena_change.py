"""Claims about walls and obstacles that change while a trial runs: all that moves and senses has the new ones."""

from itertools import islice

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from tests.embodied.changing import GATE, PILLARS, REBUILT, steps_of

POSES = [[10, 10, 0], [10, 25, 0.5], [10, 40, -0.5], [20, 50, 0], [20, 18, 1], [22, 33, 2]]
GATED = {"arena": {"obstacles": GATE}, "robots": [{"poses": POSES[:3]}, {"poses": POSES[3:]}]}


@pytest.mark.parametrize("signal", [{"kind": "camera"}, {"kind": "cone", "angle_deg": 360}])
@pytest.mark.parametrize("faults", [[], [{"kind": "infrared_dead", "robots": [1]}]])
def test_an_arena_that_is_changed_at_once_is_as_one_that_was_so_from_the_start(signal, faults):
    arena = {"width_cm": 90, "height_cm": 70, "obstacles": PILLARS}
    robots = [{**group, "signal": signal} for group in GATED["robots"]]
    given = {**GATED, "robots": robots, "faults": faults}
    expected = steps_of({**given, "arena": arena}, 120, 1)
    values = {f"arena.{key}": value for key, value in arena.items()}
    found = steps_of({**given, "schedule": [{"at_s": 0, "set": values}]}, 120, 1)
    for name, steps in expected.items():
        assert found[name].tobytes() == steps.tobytes(), name
    assert expected["poses"][..., 0].max() > 70


def test_robots_pass_a_wall_once_it_is_lifted_and_stay_within_walls_that_come():
    simulation = Simulation(
        {**GATED, "schedule": [{"at_s": 10, "set": {"arena.width_cm": 90, "arena.obstacles": []}}]}, 1
    )
    farthest = []
    for number, step in enumerate(islice(simulation, 600)):
        x, y = step.poses[:, 0], step.poses[:, 1]
        farthest.append(x.max())
        gaps = np.column_stack([x, y, (60 if number < 100 else 90) - x, 60 - y]).min(axis=1)
        if number < 100:
            gaps = np.minimum(gaps, np.abs(29 - x))
        touching = {robot for robot, other in step.contacts.tolist() if other == -1}
        assert touching == set(np.flatnonzero(gaps <= 3.7 + 0.16).tolist())
    assert max(farthest[:100]) < 26
    assert max(farthest[100:]) > 70


def test_a_step_shows_the_arena_of_its_time_with_movables_where_they_are():
    simulation = Simulation(REBUILT, 1)
    widths = [simulation.advance(10).arena.width_cm for _ in range(6)]
    assert widths == [60, 60, 60, 65, 65, 90]
    step = simulation.last_step
    assert step.arena.circles[:, :2].tobytes() == step.movables.tobytes()
    simulation.reset()
    assert simulation.last_step.arena.width_cm == 60


def test_a_body_within_a_new_wall_ends_the_trial():
    poses = {"robots": [{"poses": [[10, 10, 0], [50, 10, 0]], "parameters": {"speed_cm_s": 0}}], "arena": {}}
    simulation = Simulation({**GATED, **poses, "schedule": [{"at_s": 1, "set": {"arena.width_cm": 50}}]}, 3)
    simulation.advance(10)
    message = r"schedule\.0, at 1 s, seed 3: robot 1 at \[50, 10\] would be 3\.7 cm into a wall or an obstacle"
    with pytest.raises(ScenarioError, match=message):
        simulation.advance(1)
    movables = {"movables": [{"x_cm": 50, "y_cm": 50, "radius_cm": 3, "mass_kg": 0.05, "friction": 0.1}]}
    touching = [{"at_s": 1, "set": {"arena.width_cm": width}} for width in (53, 52.8)]
    for entry, is_free in zip(touching, (True, False), strict=True):
        simulation = Simulation({"arena": movables, "robots": [{"poses": [[10, 10, 0]]}], "schedule": [entry]}, 3)
        if is_free:
            simulation.advance(12)
        else:
            with pytest.raises(ScenarioError, match=r"movable 0 at \[50, 50\] would be 0\.2 cm"):
                simulation.advance(12)
