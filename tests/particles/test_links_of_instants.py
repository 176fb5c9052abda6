"""Who receives whose pulse, as a simulation of point agents offers it; and events that are made when asked for."""

import numpy as np
import pytest

from epuck_sim.errors import ScenarioError
from tests.particles.naive_model import receivers_of
from tests.particles.simulations import make_simulation

RULES = [
    {"kind": "nearest", "k": 2},
    {"kind": "cone_of_vision", "angle_deg": 120, "radius_cm": 60},
    {"kind": "cone_of_emission", "angle_deg": 90},
]


def swarm(rule, **agents):
    return make_simulation(4, agents={"count": 12, "speed_cm_s": 20.0, **agents}, neighbourhood=rule)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule["kind"])
@pytest.mark.parametrize("reorient_on", [[], ["emitting", "receiving"], ["arriving"]], ids=str)
def test_pulse_links_are_found_before_anybody_turns(rule, reorient_on):
    simulation, shifted = swarm(rule, reorient_on=reorient_on), 0
    before = simulation.headings()
    for _ in range(150):
        event = next(simulation)
        if len(event.fired):
            senders, receivers, shifts = simulation.pulse_links().T
            assert receivers[shifts == 1].tolist() == list(dict.fromkeys(receivers[shifts == 1].tolist()))
            assert set(receivers[shifts == 1].tolist()) == set(event.received.tolist())
            assert list(dict.fromkeys(senders.tolist())) == [each for each in event.fired if each in senders]
            for sender in event.fired:
                expected, _ = receivers_of(simulation.scenario, simulation.positions(), before, sender)
                assert sorted(receivers[senders == sender]) == np.flatnonzero(expected).tolist()
            shifted += int(shifts.sum())
        before = simulation.headings()
    assert shifted > 20


def test_agents_drawn_at_random_have_no_links():
    simulation = swarm({"kind": "random", "k": 3}, reorient_on=["arriving"])
    simulation.run(3)
    assert len(simulation.last_instant().fired)
    assert simulation.pulse_links().shape == (0, 3)
    for ask in (simulation.neighbour_links, simulation.adjacency):
        with pytest.raises(ScenarioError, match="receivers are drawn anew for each pulse"):
            ask()
