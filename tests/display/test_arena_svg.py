"""Pictures of the arena show robots where they are, with numbers, and what is lit."""

import math
from base64 import b64decode
from xml.etree.ElementTree import fromstring

import cv2
import numpy as np
import pytest

from epuck_sim import ParticleSimulation, load_scenario
from epuck_sim.arena import make_arena, make_floor
from epuck_sim.display.arena_svg import DARK, LIT, draw_arena
from epuck_sim.display.html import element, table, to_html
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


def test_text_is_escaped_wherever_it_stands() -> None:
    nasty = "<b>&\"'"
    html = to_html(element("p", nasty, element("i", nasty), nasty, title=nasty), table([nasty], [[nasty]]))
    assert html.count("&lt;b&gt;&amp;") == 5
    assert 'title="<b&gt;&amp;&quot;' in html  # in an attribute, only > and quotes end something
    assert "<b>" not in html
    assert nasty not in load_scenario({"name": nasty})._repr_html_()


NOBODY = np.empty((0, 3)), 3.7, np.empty(0, bool)


def test_patches_lie_in_their_order_below_everything_and_end_at_the_walls() -> None:
    floor = make_floor(0.8, [(0, (10, 30, 5)), (1, SQUARE), (0.5, (59, 1, 9))])
    drawn = draw_arena(make_arena(60, 40, [(30, 30, 5)], [], floor=floor), *NOBODY)
    ground, walls, obstacle = drawn
    assert (ground.tag, ground.get("viewBox"), ground.get("y"), walls.tag) == ("svg", "0 0 60 40", "0", "polygon")
    assert [(part.tag, part.get("fill")) for part in ground] == [
        ("rect", "#cccccc"),
        ("circle", "#000000"),
        ("polygon", "#ffffff"),
        ("circle", "#808080"),
    ]
    assert (ground[1].get("cx"), ground[1].get("cy"), ground[2].get("points")) == (
        "10",
        "10",
        "10,30 20,30 20,20 10,20",
    )
    assert obstacle.tag == "circle"
    assert draw_arena(make_arena(60, 40, [], []), *NOBODY).find("svg") is None


def test_a_picture_of_the_floor_is_in_the_page() -> None:
    levels = np.array([[0, 100, 200], [50, 150, 250]], np.uint8)
    arena = make_arena(60, 40, [], [], floor=make_floor(1, [(0.5, (30, 20, 5))], levels))
    picture, patch = draw_arena(arena, *NOBODY)[0]
    kind, _, coded = picture.get("href").partition(",")
    shown = cv2.imdecode(np.frombuffer(b64decode(coded), np.uint8), cv2.IMREAD_UNCHANGED)
    assert kind == "data:image/png;base64"
    assert (picture.get("width"), picture.get("height"), patch.get("fill")) == ("60", "40", "#808080")
    assert shown.shape == (213, 320)
    np.testing.assert_array_equal(shown[53::107, 53::107], levels)


def test_lamps_are_dots_that_say_how_high_and_how_strong_they_are() -> None:
    drawn = draw_arena(make_arena(60, 40, [], [], lamps=[(10, 30, 25, 2)]), *NOBODY)
    (lamp,) = drawn.findall("g")
    dot = lamp.find("circle")
    assert lamp.find("title").text == "lamp: 25 cm, strength 2"
    assert (dot.get("cx"), dot.get("cy")) == ("10", "10")
