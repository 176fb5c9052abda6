"""How well rings were found, against scores counted by hand and a slow twin."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray
from tests.overhead.score import WITHIN_CM, Score, compare

NONE = np.empty((0, 2))
TWO = np.array([[10.0, 10.0], [20.0, 10.0]])


def test_all_found() -> None:
    score = compare(np.add(TWO[::-1], (0.3, -0.4)), TWO, NONE)
    assert score == pytest.approx(Score(found=2, missed=0, false=0, worst_cm=0.5, squares_cm2=0.5))
    assert (score.recall, score.precision, score.rms_cm) == pytest.approx((1, 1, 0.5))


@pytest.mark.parametrize(
    ("reported", "lit", "flickering", "score"),
    [
        (NONE, NONE, NONE, Score()),
        (NONE, TWO, NONE, Score(missed=2)),
        (NONE, NONE, TWO, Score()),
        (TWO, NONE, NONE, Score(false=2)),
        (TWO, TWO[:1], NONE, Score(found=1, false=1)),
        (TWO[:1], TWO, NONE, Score(found=1, missed=1)),
        (TWO, NONE, TWO, Score(found=2)),
        (TWO, TWO[:1], TWO[1:], Score(found=2)),
        (np.add(TWO, (2.0, 0.0)), TWO, NONE, Score(missed=2, false=2)),
        (TWO[[0, 0]], TWO[:1], NONE, Score(found=1, false=1)),
        (TWO[:1], TWO[[0, 0]], NONE, Score(found=2)),
    ],
)
def test_score_counted_by_hand(reported: FloatArray, lit: FloatArray, flickering: FloatArray, score: Score) -> None:
    assert compare(reported, lit, flickering) == score


def test_no_rings_have_no_shape_to_agree_on() -> None:
    assert compare(np.array([]), np.array([]), np.array([])) == Score()
    assert compare(np.array([]), TWO, np.array([])) == Score(missed=2)


def test_scores_of_frames_add_up() -> None:
    total = sum([Score(3, 1, 0, 0.1, 0.02), Score(1, 0, 4, 0.3, 0.14), Score()], Score())
    assert total == pytest.approx(Score(4, 1, 4, 0.3, 0.16))
    assert (total.recall, total.precision, total.rms_cm) == pytest.approx((0.8, 0.5, 0.2))


def test_nothing_to_find_is_no_division_by_zero() -> None:
    assert (Score().recall, Score().precision, Score().rms_cm) == (0, 0, 0)


@given(
    cells=st.lists(st.sampled_from(range(36)), max_size=12, unique=True),
    fates=st.lists(st.tuples(st.sampled_from("lfn"), st.booleans(), st.floats(0, 1.9), st.floats(0, 6.28))),
    extra=st.integers(0, 2),
)
def test_each_ring_counts_once(cells: list[int], fates: list[tuple[str, bool, float, float]], extra: int) -> None:
    kinds: dict[str, list[FloatArray]] = {"l": [], "f": [], "n": []}
    reported: list[FloatArray] = [np.array([100.0 + k, 0.0]) for k in range(extra)]
    found = missed = 0
    false, squares = extra, 0.0
    for cell, (kind, is_reported, off_cm, angle) in zip(cells, fates, strict=False):
        place = np.array(divmod(cell, 6), float) * 7.4
        kinds[kind].append(place)
        if is_reported:
            reported.append(place + off_cm * np.array([math.cos(angle), math.sin(angle)]))
        is_hit = is_reported and kind != "n" and float(np.hypot(*(reported[-1] - place))) <= WITHIN_CM
        found += is_hit
        missed += kind == "l" and not is_hit
        false += is_reported and not is_hit
        squares += off_cm**2 if is_hit else 0
    score = compare(np.reshape(reported, (-1, 2)), np.reshape(kinds["l"], (-1, 2)), np.reshape(kinds["f"], (-1, 2)))
    assert score[:3] == (found, missed, false)
    assert score.squares_cm2 == pytest.approx(squares, abs=1e-9)
