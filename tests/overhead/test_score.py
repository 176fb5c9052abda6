"""How well rings were found, against scores counted by hand and a slow twin."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray
from tests.overhead.score import WITHIN_CM, compare

NONE = np.empty((0, 2))


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
