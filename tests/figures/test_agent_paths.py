"""Paths of agents between rows: all that is drawn lies on the true path, and corners at walls are not cut."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.trial_page import TOLERANCE, agent_path

SIDE_CM = 50.0
ROWS = 40


def walk(seed: int, travelled_cm: FloatArray, dimensions: int, *, is_cyclic: bool) -> tuple[FloatArray, ...]:
    """Move an agent straight from wall to wall, to a random direction at each.

    Returns:
        (rows, 2) cm, positions after each distance; (rows,) rad, headings; (pieces, 4) cm, ends of straight pieces.
    """
    random = np.random.default_rng(seed)
    here = np.where(np.arange(2) < dimensions, random.uniform(0, SIDE_CM, 2), 0.0)
    heading = random.uniform(-math.pi, math.pi) if dimensions == 2 else 0.0
    positions, headings, pieces, gone = [], [], [], 0.0
    for goal in travelled_cm:
        while True:
            along = np.array([math.cos(heading), math.sin(heading) if dimensions == 2 else 0.0])
            room = [((SIDE_CM if v > 0 else 0) - p) / v if v else math.inf for p, v in zip(here, along, strict=True)]
            way = min(goal - gone, *room)
            pieces.append([*here, *(here + way * along)])
            here, gone = here + way * along, gone + way
            if goal - gone < 1e-9:
                break
            axis = int(np.argmin(room))
            if is_cyclic:
                here[axis] = 0.0 if along[axis] > 0 else SIDE_CM
            elif dimensions == 1:
                heading = math.pi - heading
            else:
                inwards = (math.pi if along[0] > 0 else 0) if axis == 0 else (-1 if along[1] > 0 else 1) * math.pi / 2
                heading = inwards + random.uniform(-1.5, 1.5)
        positions.append(here.copy())
        headings.append(math.remainder(heading, 2 * math.pi))
    return np.array(positions), np.array(headings), np.array(pieces)


def farthest(path: FloatArray, pieces: FloatArray) -> float:
    """Return how far, in cm, the middles and ends of a path's pieces are from the nearest true piece."""
    worst = 0.0
    for (_, *start), (_, *end) in pairwise(path):
        if np.isnan([*start, *end]).any():
            continue
        for share in (0.0, 0.3, 0.5, 0.9, 1.0):
            point = (1 - share) * np.array(start) + share * np.array(end)
            begin, along = pieces[:, :2], pieces[:, 2:] - pieces[:, :2]
            square = np.maximum((along**2).sum(axis=1), 1e-30)
            nearest = np.clip(((point - begin) * along).sum(axis=1) / square, 0, 1)
            worst = max(worst, np.hypot(*(begin + nearest[:, None] * along - point).T).min())
    return worst


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.floats(0.01, 45), st.sampled_from([1, 2]), st.booleans())
def test_nothing_is_drawn_where_the_agent_was_not(seed: int, step_cm: float, dimensions: int, is_cyclic: bool) -> None:
    travelled = step_cm * np.arange(ROWS)
    positions, headings, pieces = walk(seed, travelled, dimensions, is_cyclic=is_cyclic)
    path = agent_path(travelled / 30, positions.astype(np.float32), headings, SIDE_CM, is_cyclic=is_cyclic)
    drawn = path[~np.isnan(path[:, 0])]
    is_straight_once = np.hypot(*np.diff(positions, axis=0).T).max() > 0.999 * step_cm
    if step_cm < SIDE_CM / 2 if is_cyclic else is_straight_once:  # otherwise no two rows show the speed
        assert farthest(path, pieces) < 3 * TOLERANCE * SIDE_CM
        assert (np.diff(drawn[:, 0]) >= -1e-4).all()
    assert {*map(tuple, positions.astype(np.float32).tolist())} <= {*map(tuple, drawn[:, 1:].tolist())}


def test_a_corner_at_a_wall_is_not_cut() -> None:
    # 5 cm a row: 3 cm to the wall, 2 cm back at a right angle to the way there
    half = math.sqrt(0.5)
    positions = np.array([[40 - 3 * half, 5], [40, 5 + 3 * half], [40 - 2 * half, 5 + 5 * half]])
    start = positions[0] - 5 * half * np.array([1, 1])
    path = agent_path(
        np.array([0.0, 1.0, 2.0]),
        np.array([start, positions[0], positions[2]], np.float32),
        np.array([math.pi / 4, math.pi / 4, 3 * math.pi / 4]),
        40.0,
        is_cyclic=False,
    )
    np.testing.assert_allclose(path[:, 1:], [start, positions[0], positions[1], positions[2]], atol=1e-4)
    assert path[2, 0] == pytest.approx(1.6)


def test_an_agent_that_stands_still_stays_where_it_is() -> None:
    places = np.full((5, 2), 7, np.float32)
    path = agent_path(np.arange(5.0), places, np.zeros(5), 20.0, is_cyclic=False)
    np.testing.assert_array_equal(path, np.column_stack([np.arange(5.0), places]))
