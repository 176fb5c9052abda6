"""Claims about arenas that a schedule changes, as scenarios give them."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import arena_after, arena_entries, largest_cm
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml

BOX = {"shape": "box", "x_cm": 30, "y_cm": 30, "width_cm": 2, "height_cm": 60}
DISC = {"x_cm": 40, "y_cm": 30, "radius_cm": 3, "mass_kg": 1, "friction": 0.1}
SCENARIO = {
    "arena": {"obstacles": [BOX], "movables": [DISC]},
    "schedule": [
        {"at_s": 1, "set": {"arena.obstacles": [], "arena.width_cm": 90}},
        {"at_s": 2, "displace": {"by_cycles": 0.1}},
        {"at_cycle": 3, "set": {"arena.width_cm": 50, "arena.obstacles": [{**BOX, "x_cm": 20}]}},
    ],
}


def test_each_entry_makes_the_arena_that_its_values_say_with_what_stays():
    scenario = load_scenario(SCENARIO)
    assert arena_entries(scenario) == [0, 2]
    wide, narrow = (arena_after(scenario, entry) for entry in (0, 2))
    assert (wide.width_cm, wide.height_cm, wide.obstacles) == (90, 60, ())
    assert (narrow.width_cm, narrow.height_cm, narrow.obstacles[0].x_cm) == (50, 60, 20)
    assert wide.movables == narrow.movables == scenario.arena.movables
    assert largest_cm(scenario) == (90, 60)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_entries_whose_order_would_decide_are_refused():
    schedule = [{"at_s": 1, "set": {"arena.obstacles": []}}, {"at_s": 2, "set": {"arena.width_cm": 70}}]
    message = r"schedule\.1\.set: sets arena\.width_cm, and .*schedule\.0\.set sets arena\.obstacles; give all entries"
    with pytest.raises(ScenarioError, match=message):
        load_scenario({**SCENARIO, "schedule": schedule})


def test_arenas_are_checked_at_each_point_of_a_sweep():
    schedule = [{"at_s": 1, "set": {"arena.width_cm": 20}}]
    swept = load_scenario({"schedule": schedule, "sweep": {"grid": {"robots.0.count": [5, 40]}}})
    with pytest.raises(ScenarioError, match=r"point 1 .*schedule\.0\.set: 40 robots of 7\.4 cm do not fit"):
        points(swept)
