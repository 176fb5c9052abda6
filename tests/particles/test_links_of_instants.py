"""Who receives whose pulse, as a simulation of point agents offers it; and events that are made when asked for."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.particles.links import LinkSearch
from epuck_sim.particles.simulation import ParticleSimulation

RULES = [
    {"kind": "nearest", "k": 2},
    {"kind": "cone_of_vision", "angle_deg": 120, "radius_cm": 60},
    {"kind": "cone_of_emission", "angle_deg": 90},
]


def swarm(rule, **agents):
    sections = {"agents": {"count": 12, "speed_cm_s": 20.0, **agents}, "neighbourhood": rule}
    return ParticleSimulation({"model": "particles", "stop": {"order_parameter": None}, **sections}, 4)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule["kind"])
@pytest.mark.parametrize(
    "reorient_on", [[], ["emitting", "receiving"], ["arriving"]], ids=["straight", "turning", "turning on arrivals"]
)
def test_pulse_links_are_found_before_anybody_turns(rule, reorient_on):
    simulation = swarm(rule, reorient_on=reorient_on)
    found, shifted = LinkSearch(simulation.scenario), 0
    before = simulation.headings()
    for _ in range(150):
        event = next(simulation)
        if len(event.fired):
            links = simulation.pulse_links()
            expected = found.pulse_links(simulation.positions(), before, event.fired, event.received)
            assert links.tolist() == expected.tolist()
            assert set(links[links[:, 2] == 1, 1].tolist()) == set(event.received.tolist())
            shifted += int(links[:, 2].sum())
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
