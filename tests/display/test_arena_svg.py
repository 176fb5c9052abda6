"""Pictures of the arena show robots where they are, with numbers, and what is lit."""

import math
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from epuck_sim.arena import make_arena
from epuck_sim.display.arena_svg import DARK, LIT, MOST_NUMBERED, draw_arena
from epuck_sim.display.html import element, table, to_html
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate

SQUARE = np.array([[10.0, 10.0], [20.0, 10.0], [20.0, 20.0], [10.0, 20.0]])


def test_robots_lie_where_they_are_with_y_upwards() -> None:
    arena = make_arena(60, 40, [(30, 30, 5)], [SQUARE])
    poses = np.array([[10.0, 30.0, 0.0], [50.0, 5.0, math.pi / 2]])
    drawn = draw_arena(arena, poses, 3.7, np.array([True, False]))
    walls, square = (each.get("points") for each in drawn.findall("polygon"))
    assert walls == "0,0 60,0 60,40 0,40"
    assert square == "10,30 20,30 20,20 10,20"
    first, second = drawn.findall("g")
    assert [(each.find("circle").get("cx"), each.find("circle").get("cy")) for each in (first, second)] == [
        ("10", "10"),
        ("50", "35"),
    ]
    assert [each.find("circle").get("fill") for each in (first, second)] == [LIT, DARK]
    assert [each.find("text").text for each in (first, second)] == ["0", "1"]
    assert (second.find("line").get("x2"), second.find("line").get("y2")) == ("50", "31.3")


def test_many_robots_have_no_numbers() -> None:
    poses = np.zeros((MOST_NUMBERED, 3))
    drawn = draw_arena(make_arena(60, 60, (), ()), poses, 1.0, np.zeros(MOST_NUMBERED, bool))
    assert drawn.findall(".//text") == []


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_agents_are_shown_in_every_space(dimensions: int) -> None:
    simulation = ParticleSimulation({"model": "particles", "space": {"dimensions": dimensions}}, seed=1)
    simulation.run(3)
    drawn = fromstring("<div>" + simulation._repr_html_() + "</div>")
    places = [float(circle.get("cx")) for circle in drawn.findall(".//{*}circle")]
    assert np.allclose(places, simulation.positions()[:, 0], rtol=1e-4)
    assert ("a cube" in simulation._repr_html_()) == (dimensions == 3)


@pytest.mark.parametrize("name", ["thesis", "particles"])
def test_showing_changes_no_outcome(name: str) -> None:
    scenario = load_scenario(name, ["stop.max_cycles=5"])
    looked_at = simulate(scenario, 3)
    assert looked_at._repr_html_()
    watched = run_trial(looked_at, [lambda *_: looked_at._repr_html_()])
    assert watched._replace(wall_s=0) == run_trial(simulate(scenario, 3))._replace(wall_s=0)


def test_a_simulation_says_how_far_it_is() -> None:
    simulation = Simulation("thesis", seed=1)
    assert "before its first step" in simulation._repr_html_()
    simulation.advance(30)
    assert "step 29, 2.9 s" in simulation._repr_html_()


def test_text_is_escaped_wherever_it_stands() -> None:
    nasty = "<b>&\"'"
    html = to_html(element("p", nasty, element("i", nasty), nasty, title=nasty), table([nasty], [[nasty]]))
    assert html.count("&lt;b&gt;&amp;") == 5
    assert 'title="<b&gt;&amp;&quot;' in html  # in an attribute, only > and quotes end something
    assert "<b>" not in html
    assert nasty not in load_scenario({"name": nasty})._repr_html_()
