"""`moved` is the length of a path through the places at cycles, over the time that it takes."""

from types import SimpleNamespace

import numpy as np
import pytest

from epuck_sim.errors import MeasureError, ScenarioError
from epuck_sim.measures.motion import Moved
from epuck_sim.scenario.loader import load_scenario


def told(times_s, places):
    measure = Moved(None)
    for time_s, movables in zip(times_s, places, strict=True):
        measure.cycle(SimpleNamespace(time_s=time_s, movables=np.array(movables, float)), None)
    return measure.value()


def test_it_is_the_mean_path_in_an_hour():
    there_and_back = [[(0, 0), (9, 9)], [(3, 4), (9, 9)], [(0, 0), (9, 9)]]
    assert told([10, 15, 20], there_and_back) == pytest.approx((10 + 0) / 2 * 360)
    assert told([5, 3605], [[(0, 0)], [(0, 7)]]) == pytest.approx(7)


def test_it_needs_two_cycles_and_something_to_move():
    assert told([], []) is None
    assert told([4], [[(1, 1)]]) is None
    with pytest.raises((MeasureError, ScenarioError), match=r"needs arena\.movables"):
        load_scenario({"measures": ["moved"]})
