"""Claims about pictures of the arena for people: robots are where they are, lit rings are red, and nothing is noisy."""

import numpy as np
import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.overhead.render import ArenaView
from epuck_sim.scenario.loader import load_scenario

SCENARIO = load_scenario("obstacles", ["overhead.noise_levels=20", "overhead.blur_px=5"])
POSES = np.array([[15.0, 45.0, 0.0], [45.0, 15.0, 1.0]])


def test_bodies_are_dark_and_lit_rings_red_where_robots_are():
    scenario = load_scenario("thesis")
    view = ArenaView(scenario, 200, 200)
    empty = view.draw(np.empty((0, 3)), np.empty(0, bool)).astype(int)
    picture = view.draw(POSES, np.array([False, True])).astype(int)
    rows, columns = np.nonzero(np.abs(picture - empty).max(axis=-1) > 20)
    assert {(row < 100, column < 100) for row, column in zip(rows, columns, strict=True)} == {
        (True, True),
        (False, False),
    }
    redness = picture[..., 0] - picture[..., 1]
    assert redness[:100, :100].max() == 0
    assert redness[100:, 100:].max() > 100


def test_the_same_robots_make_the_same_picture_without_the_cameras_faults():
    view = ArenaView(SCENARIO, width_px=120, height_px=80)
    lit = np.array([True, False])
    first = view.draw(POSES, lit)
    assert first.shape == (80, 120, 3)
    np.testing.assert_array_equal(view.draw(POSES, lit), first)
    np.testing.assert_array_equal(ArenaView(load_scenario("obstacles"), 120, 80).draw(POSES, lit), first)


def test_sizes_that_no_film_could_have_are_refused():
    with pytest.raises(ScenarioError, match="width_px"):
        ArenaView(SCENARIO, width_px=101)


def test_a_kilobot_is_drawn_as_wide_as_it_is_and_its_led_where_it_is():
    def drawn(robot) -> tuple[int, int]:
        """Return the number of pixels that show a robot, and of those that are red if it is lit."""
        scenario = load_scenario({"robot": robot, "robots": [{"signal": {"kind": "radio"}}]})
        view = ArenaView(scenario, 400, 400)
        pose = np.array([[30.0, 30.0, 0.3]])  # below the camera, which sees no side
        empty = view.draw(pose[:0], np.zeros(0, bool)).astype(int)
        dark, lit = (view.draw(pose, np.array([on])).astype(int) for on in (False, True))
        red = lit[..., 0] - lit[..., 1] > 100
        return int((np.abs(dark - empty).max(axis=-1) > 20).sum()), int(red.sum())

    (epuck, ring), (kilobot, led) = drawn("epuck"), drawn("kilobot")
    assert kilobot / epuck == pytest.approx((1.65 / 3.7) ** 2, rel=0.1)
    assert 0 < led < 0.3 * ring
