"""Claims about the section `schedule`: what cannot change is refused, in words, when a scenario is read."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml

AGENTS = {"model": "particles"}
STILL = {"robots.0.parameters.speed_cm_s": 0}
DARK = {"kind": "ring_dead", "scheduled": True}


def test_schedules_are_written_and_read_again():
    entry = {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": STILL, "begin": [0]}
    given = {"faults": [DARK], "schedule": [entry, {"at_s": 3, "displace": {"by_cycles": "random"}, "end": [0]}]}
    scenario = load_scenario(given)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_schedules_of_agents_are_written_and_read_again_and_checked_at_each_point_of_a_sweep():
    entry = {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": {"neighbourhood.k": 4}}
    given = {**AGENTS, "schedule": [entry, {"at_s": 3, "displace": {"by_cycles": "random", "agents": [2]}}]}
    scenario = load_scenario(given)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    rules = [{"kind": "nearest", "k": 2}, {"kind": "all"}]
    swept = load_scenario({**given, "sweep": {"grid": {"neighbourhood": rules}}})
    with pytest.raises(ScenarioError, match=r"point 1 .*schedule\.0\.set: neighbourhood\.k: unknown 'k'"):
        points(swept)


@pytest.mark.parametrize(
    ("entry", "others", "message"),
    [
        ({"set": STILL}, {}, "schedule.0: give one of at_s, at_cycle, when"),
        ({"at_s": 1, "at_cycle": 2, "set": STILL}, {}, "schedule.0: give one of at_s, at_cycle, when"),
        ({"at_s": 1}, {}, "nothing changes; give one or more of set, displace, begin, end, remove, add"),
        ({"at_s": 1, "for_cycles": 1, "set": STILL}, {}, "for_cycles is 1; allowed: with when"),
        ({"when": "coverage > 1", "set": STILL}, {}, "schedule.0.when: unknown 'coverage'; measures: none"),
        ({"at_s": 1, "set": {"arena.width_cm": 3}}, {}, "schedule.0.set: arena.width_cm: is 3; allowed: at least 7.4"),
        ({"at_s": 1, "set": {"arena.width_cm": 7.5}}, {}, "schedule.0.set: 10 robots of 7.4 cm do not fit into the"),
        (
            {"at_s": 1, "set": {"arena.movables": []}},
            {},
            "arena.movables cannot change during a trial",
        ),
        (
            {"at_s": 1, "set": {"arena.width_cm": 50}},
            {"arena": {"obstacles": [{"shape": "circle", "x_cm": 50, "y_cm": 30, "radius_cm": 2}]}},
            "schedule.0.set: arena: an obstacle or movable reaches from",
        ),
        (
            {"at_s": 1, "set": {"arena.obstacles": [{"shape": "circle", "x_cm": 50}]}},
            {},
            "schedule.0.set: arena.obstacles.0.y_cm: is missing",
        ),
        ({"at_s": 1, "remove": [10]}, {}, "schedule.0.remove: is 10; allowed: 0 to 9"),
        ({"at_s": 1, "add": [-1]}, {}, "schedule.0.add.0: is -1; allowed: at least 0"),
        ({"at_s": 1, "add": [1, 1]}, {}, "add is .1, 1.; allowed: each robot once"),
        ({"at_s": 1, "add": [1, 2], "poses": [[10, 10, 0]]}, {}, "poses has 1 poses; allowed: one for each"),
        ({"at_s": 1, "remove": [0]}, {}, "schedule.0.remove: 0 is the reference, whose firings are counted, and stays"),
        (
            {"at_s": 1, "add": [0]},
            {"robots": [{"count": 1, "present": False}, {"count": 3}]},
            "stop.reference_robot is 0, which is not present at the start",
        ),
        (
            {"at_s": 1, "remove": [1]},
            {"measures": ["order_parameter", "coverage"]},
            "measures.1: coverage takes all robots to be in the arena, and some come or go; allowed: order_parameter",
        ),
        ({"at_s": 1, "remove": [1]}, AGENTS, "schedule.0.remove: unknown 'remove'"),
        ({"at_s": 1, "set": {"robots.0.count": 3}}, {}, "robots.0.count cannot change during a trial"),
        ({"at_s": 1, "set": {"robots.0.parameters.period_s": 3}}, {}, "period_s cannot change during a trial: cycles"),
        ({"at_s": 1, "set": {"robots.1.parameters.speed_cm_s": 3}}, {}, "robots.1 is no group; allowed: robots.0 to 0"),
        (
            {"at_s": 1, "set": {"robots.0.parameters.speed_cm_s": 99}},
            {},
            "set: robots.0.*allowed: 0 to 12.8",
        ),
        ({"at_s": 1, "set": {"robots.0.parameters.sped": 9}}, {}, "schedule.0.set: robots.0.*'sped'"),
        ({"at_s": 1, "displace": {"robots": [10], "by_cycles": 0.5}}, {}, "displace.robots: is 10; allowed: 0 to 9"),
        ({"at_s": 1, "begin": [0]}, {}, "schedule.0.begin: 0 is no number of a fault with scheduled: true"),
        ({"at_s": 1, "end": [0]}, {"faults": [{"kind": "ring_dead"}]}, "0 is no number of a fault with scheduled"),
        (
            {"at_s": 1, "end": [0]},
            {"faults": [{"kind": "restart", "scheduled": True}]},
            "schedule.0.end: 0 is a restart, which takes no time",
        ),
        (
            {"at_s": 1, "displace": {"by_cycles": 0.5}},
            {"robots": [{"controller": "constant"}]},
            "schedule.0.displace: robots.0 are no oscillators",
        ),
        ({"at_s": 1, "set": STILL, "sett": 1}, {}, "schedule.0.sett: unknown 'sett', did you mean 'set'"),
        ({"at_s": 1, "set": STILL}, AGENTS, "speed_cm_s cannot change during a trial; allowed: agents.speed_cm_s"),
        ({"at_s": 1, "set": {"clocks.period_s": 2}}, AGENTS, "clocks.period_s cannot change during a trial; allowed"),
        ({"at_s": 1, "set": {"response.curve": "sine"}}, AGENTS, "response.curve cannot change during a trial"),
        ({"at_s": 1, "begin": [0]}, AGENTS, "schedule.0.begin: unknown 'begin'.*allowed: at_s, at_cycle, when"),
        ({"at_s": 1}, AGENTS, "nothing changes; give one or more of set, displace$"),
        ({"at_s": 1, "set": {"agents.speed_cm_s": -1}}, AGENTS, "schedule.0.set: agents.speed_cm_s: is -1; allowed"),
        ({"at_s": 1, "set": {"neighbourhood.k": 20}}, AGENTS, "schedule.0.set: neighbourhood.k is 20; allowed: 1 to 1"),
        ({"at_s": 1, "set": {"neighbourhood.radius_cm": 20}}, AGENTS, "schedule.0.set: neighbourhood.radius_cm: unkn"),
        ({"at_s": 1, "set": {"response.parameters.b": 20}}, AGENTS, "schedule.0.set: response: unknown 'b'"),
        (
            {"at_s": 1, "set": {"response.coupling": 2}},
            {**AGENTS, "response": {"curve": "sine"}},
            "schedule.0.set: response: coupling is 2; allowed: 0 to 1 for the sine curve",
        ),
        ({"at_s": 1, "displace": {"agents": [20], "by_cycles": 0.5}}, AGENTS, "agents: is 20; allowed: 0 to 19"),
        ({"at_s": 1, "displace": {"robots": [1], "by_cycles": 0.5}}, AGENTS, "displace.robots: unknown 'robots'"),
        (
            {"at_cycle": 1, "set": {"neighbourhood.k": 2}},
            {**AGENTS, "measures": [{"perturbation": {"displacement": 0.1}}]},
            "measures.0: a trial and its twin change alike at times alone; give at_s",
        ),
        ({"when": "coverage > 1", "set": {"neighbourhood.k": 2}}, AGENTS, "schedule.0.when: unknown 'coverage'"),
        (
            {"at_s": 1, "set": {"agents.speed_cm_s": 2}},
            {
                **AGENTS,
                "agents": {
                    "walk": {"kind": "brownian", "run_s": 2},
                    "speed_distribution": "exponential",
                    "speed_per_run": True,
                },
            },
            "schedule.0.set: agents.speed_cm_s cannot change where agents.speed_per_run is true",
        ),
    ],
)
def test_what_cannot_change_is_refused(entry, others, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario({**others, "schedule": [entry]})
