"""Compiled code finds each field of a held value as Python does, wherever it lies."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from hypothesis.extra import numpy as arrays

from epuck_sim.util.addresses import compiled_for
from epuck_sim.util.held_values import hold, layout


class Scales(NamedTuple):
    """A part without arrays."""

    factor: float
    is_negative: bool


class Part(NamedTuple):
    """A part with arrays."""

    rows: np.ndarray
    scales: Scales


class Whole(NamedTuple):
    """A value with fields of all kinds."""

    count: int
    records: np.ndarray
    part: Part
    pair: tuple[np.ndarray, np.ndarray]
    sums: np.ndarray


RECORD = np.dtype([("is_on", np.bool_), ("speed", np.float64)])


def _sum_at(address: int) -> None:
    whole = value_at(address)  # noqa: F821 `compile_at` provides it
    total = 0.0
    for row in range(whole.part.rows.shape[0]):
        for column in range(whole.part.rows.shape[1]):
            total += (row + 1) * whole.part.rows[row, column]
    scales = whole.part.scales
    whole.sums[0] = (-total if scales.is_negative else total) * scales.factor
    whole.sums[1] = whole.count
    for index in range(len(whole.records)):
        if whole.records[index].is_on:
            whole.sums[2] += whole.records[index].speed
    whole.sums[3] = whole.pair[0][0] - whole.pair[1][-1]


def whole_of(rows: np.ndarray, *, factor: float = 2.0, is_negative: bool = False, count: int = 3) -> Whole:
    records = np.array([(True, 1.5), (False, 8.0), (True, 0.25)], RECORD)
    pair = np.arange(4.0)[::2], np.arange(3.0)
    return Whole(count, records, Part(rows, Scales(factor, is_negative)), pair, np.zeros(4))


def sums_of(whole: Whole) -> list[float]:
    _owner, address = hold(whole)
    compiled_for(_sum_at, whole)(address)
    return whole.sums.tolist()


@given(
    arrays.arrays(np.float64, some.tuples(some.integers(0, 4), some.integers(0, 4)), elements=some.integers(-9, 9)),
    some.floats(-4, 4),
    some.booleans(),
    some.integers(-(2**40), 2**40),
)
def test_compiled_code_reads_what_python_reads(rows: np.ndarray, factor: float, is_negative: bool, count: int) -> None:
    weighted = (rows * np.arange(1, len(rows) + 1)[:, None]).sum()
    expected = [(-weighted if is_negative else weighted) * factor, count, 1.75, 0 - 2]
    assert sums_of(whole_of(rows, factor=factor, is_negative=is_negative, count=count)) == expected


def test_arrays_with_gaps_and_by_columns_are_read_by_their_strides() -> None:
    rows = np.arange(24.0).reshape(4, 6)
    expected = sums_of(whole_of(rows[::2, ::3].copy()))
    assert sums_of(whole_of(rows[::2, ::3])) == expected
    assert sums_of(whole_of(np.asfortranarray(rows[::2, ::3]))) == expected
    assert len({layout(whole_of(each)) for each in (rows, rows[::2, ::3], np.asfortranarray(rows))}) == 3


def test_the_owner_keeps_arrays_that_nothing_else_refers_to() -> None:
    rows = np.ones((2, 2))
    references = sys.getrefcount(rows)
    owner, _ = hold(Part(rows, Scales(1.0, is_negative=False)))
    assert sys.getrefcount(rows) > references
    del owner
    assert sys.getrefcount(rows) == references


def test_what_cannot_be_held_is_refused() -> None:
    with pytest.raises(TypeError, match="'a name' cannot be held"):
        hold((1, "a name"))
