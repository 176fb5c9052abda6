"""Claims about values and functions at addresses: compiled code finds the value, and errors come through."""

import os
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit

from epuck_sim.util.addresses import call_at, compile_at, compiled_for, function_address
from epuck_sim.util.held_values import hold, layout
from epuck_sim.util.jit import kernel_digest


class Pair(NamedTuple):
    """What the functions below are given the address of."""

    numbers: np.ndarray
    scale: float


def _add_at(address: int) -> None:
    pair = value_at(address)  # noqa: F821 `compile_at` provides it
    for place in range(len(pair.numbers)):
        if pair.numbers[place] < 0:
            raise ValueError("a number below 0")
        pair.numbers[place] += pair.scale


@njit
def _call(function: int, address: int) -> None:
    call_at(function, address)


def compiled(pair: Pair) -> Any:
    return compile_at(_add_at, pair, kernel_digest(), careful=False)


def test_a_function_that_is_called_by_address_works_on_the_arrays_that_are_held() -> None:
    pair = Pair(np.array([1.0, 2.0]), 0.5)
    owner, address = hold(pair)
    _call(function_address(compiled(pair)), address)
    np.testing.assert_array_equal(pair.numbers, [1.5, 2.5])
    del owner


def test_an_error_comes_through_a_call_by_address() -> None:
    pair = Pair(np.array([1.0, -1.0]), 0.5)
    _owner, address = hold(pair)
    with pytest.raises(ValueError, match="a number below 0"):
        _call(function_address(compiled(pair)), address)
    assert pair.numbers[0] == 1.5


def test_values_of_other_types_have_functions_of_their_own() -> None:
    """Their signatures are the same, an address, and their compiled code must not be mistaken for each other."""
    gaps = Pair(np.arange(6.0)[::2], 1.0)
    whole = Pair(np.arange(3.0), 1.0)
    small = Pair(np.arange(3, dtype=np.float32), 1.0)
    assert len({layout(pair) for pair in (gaps, whole, small)}) == 3
    for pair in (gaps, whole, small):
        before = pair.numbers.copy()
        _owner, address = hold(pair)
        _call(function_address(compiled(pair)), address)
        np.testing.assert_array_equal(pair.numbers, before + 1)


def test_the_layout_of_a_value_does_not_depend_on_its_contents() -> None:
    assert layout(Pair(np.zeros(3), 1.0)) == layout(Pair(np.ones(5), 2.0))
    assert layout(Pair(np.zeros(3), 1.0)) != layout(Pair(np.zeros((3, 1)), 1.0))
    assert layout(Pair(np.zeros(3), 1.0)) != layout((np.zeros(3), 1.0))


ADDS = """
import sys
from typing import NamedTuple

import numpy as np
from numba import njit

from epuck_sim.util.addresses import call_at, compile_at, function_address
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind, digest


def _add_at(address: int):
    value_at(address).sums[0] += NUMBER


@njit
def _call(function, address):
    call_at(function, address)


class Sums(NamedTuple):
    sums: np.ndarray


sums = np.zeros(1)
held = Sums(sums)
owner, address = hold(held)
numbers = [int(number) for number in sys.argv[1:]]
functions = [
    compile_at(bind(_add_at, NUMBER=number), held, digest([b"%d" % number]), careful=False) for number in numbers
]
for function in functions:
    sums[0] = 0
    _call(function_address(function), address)
    print(int(sums[0]))
"""


def test_functions_of_one_name_from_two_processes_are_not_mistaken_for_each_other(tmp_path) -> None:
    (tmp_path / "adds.py").write_text(ADDS)

    def outcome(*numbers: str) -> list[str]:
        command = [sys.executable, str(tmp_path / "adds.py"), *numbers]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.split()

    assert outcome("1") == ["1"]
    assert outcome("2") == ["2"]
    assert outcome("1", "2") == ["1", "2"]


def _raise_at(address: int, times: int, by: float) -> None:
    pair = value_at(address)  # noqa: F821 `compile_at` provides it
    for _ in range(times):
        pair.numbers[0] += by * pair.scale


def test_a_function_may_take_ints_and_floats_after_the_address() -> None:
    pair = Pair(np.array([1.0]), 2.0)
    _owner, address = hold(pair)
    compiled_for(_raise_at, pair)(address, 3, 0.25)
    assert pair.numbers[0] == 2.5
    assert compiled_for(_raise_at, pair) is compiled_for(_raise_at, Pair(np.zeros(2), 1.0))
