"""Random numbers in compiled code, each compared with numpy's own, bit for bit but for the tail of normal numbers."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.util.generators import (
    DRAW_BEGIN,
    GENERATOR_WORDS,
    NORMAL_EDGE,
    SEQUENCE_WORDS,
    TAIL_LIMIT,
    begin_sequence,
    choose,
    draw_row,
    draw_words,
    fill_doubles,
    fill_normals,
    integer_between,
    next_double,
    next_uint32,
    next_uint64,
    normal_tables,
    seed_pcg64,
    seed_sfc64,
    seed_words,
    spawn,
    standard_normal,
)
from epuck_sim.util.seeds import robot_streams

SEEDS = st.integers(0, 2**64 - 1) | st.integers(0, 2**300) | st.sampled_from([0, 2**32 - 1, 2**32, 2**128, 2**160])
FEW = settings(max_examples=40)
KEYS = st.lists(st.integers(0, 10) | st.integers(0, 2**64 - 1), max_size=4)
KINDS = st.sampled_from(["sfc64", "pcg64"])
IN_NUMPY = {"sfc64": np.random.SFC64, "pcg64": np.random.PCG64}
INT64 = st.integers(-(2**63), 2**63 - 1)
BOUNDS = st.tuples(INT64, INT64) | st.tuples(st.just(0), st.integers(1, 2**33))


def sequence_of(words, keys=()):
    sequence = np.zeros(SEQUENCE_WORDS, np.uint64)
    begin_sequence(sequence, words)
    for key in keys:
        spawn(sequence, sequence, np.uint64(key))
    return sequence


def words_of(sequence, count=4):
    words = np.zeros(count, np.uint64)
    draw_words(words, sequence)
    return words.tolist()


def both(kind, seed, key=()):
    """Return a generator for compiled code, and numpy's."""
    generator = np.ones(GENERATOR_WORDS, np.uint64)  # which seeding has to overwrite
    {"sfc64": seed_sfc64, "pcg64": seed_pcg64}[kind](generator, sequence_of(seed_words(seed), key))
    return generator, np.random.Generator(IN_NUMPY[kind](np.random.SeedSequence(seed, spawn_key=key)))


def drawn(draw, generator, count=10):
    return [draw(generator) for _ in range(count)]


@FEW
@given(seed=SEEDS, key=KEYS, words=st.integers(0, 20))
def test_a_sequence_draws_what_numpy_s_does(seed, key, words):
    expected = np.random.SeedSequence(seed, spawn_key=key).generate_state(words, np.uint64)
    assert words_of(sequence_of(seed_words(seed), key), words) == expected.tolist()


@FEW
@given(seeds=st.lists(SEEDS, min_size=1, max_size=4))
def test_a_seed_may_be_several_numbers_and_zeros_may_follow_up_to_four_words(seeds):
    expected = np.random.SeedSequence(seeds).generate_state(4, np.uint64)
    words = seed_words(*seeds)
    for each in (words, np.pad(words, (0, max(0, 4 - len(words))))):
        assert words_of(sequence_of(each)) == expected.tolist()


@FEW
@given(seed=SEEDS, key=st.integers(0, 2**62))
def test_a_parent_stays_as_it_is(seed, key):
    parent, child = sequence_of(seed_words(seed)), np.zeros(SEQUENCE_WORDS, np.uint64)
    spawn(child, parent, key)
    assert (parent == sequence_of(seed_words(seed))).all()
    assert (child == sequence_of(seed_words(seed), [key])).all()


@FEW
@given(seed=SEEDS, robots=st.integers(0, 30))
def test_streams_are_those_of_the_robots(seed, robots):
    sequence, stream, factor = sequence_of(seed_words(seed), [3]), np.zeros(4, np.uint64), DRAW_BEGIN
    for expected in robot_streams(np.random.SeedSequence(seed, spawn_key=(3,)), robots):
        factor = draw_row(stream, sequence, np.uint64(factor))
        assert (stream == expected).all()


@FEW
@given(kind=KINDS, seed=SEEDS, key=KEYS)
def test_words_and_doubles_are_numpy_s(kind, seed, key):
    generator, random = both(kind, seed, key)
    assert drawn(next_uint64, generator) == random.bit_generator.random_raw(10).tolist()
    assert drawn(next_double, generator) == random.random(10).tolist()
    numbers = np.zeros(5)
    fill_doubles(numbers, generator)
    assert numbers.tolist() == random.random(5).tolist()


@FEW
@given(kind=KINDS, seed=SEEDS, lengths=st.lists(st.integers(0, 3), max_size=10))
def test_halves_of_words_wait_as_in_numpy(kind, seed, lengths):
    """Whole words in between leave the half that waits where it is."""
    generator, random = both(kind, seed)
    for length in lengths:
        expected = random.integers(2**32, size=length)  # of exactly 32 bits
        assert drawn(next_uint32, generator, length) == expected.tolist()
        assert next_double(generator) == random.random()


@FEW
@given(kind=KINDS, seed=SEEDS, bounds=st.lists(BOUNDS, min_size=1, max_size=30))
@example("pcg64", 0, [(0, 1), (0, 2**32), (0, 2**32 - 1), (0, 2**32 + 1), (-5, 3), (0, 8), (-(2**63), 2**63 - 1)])
@example("sfc64", 0, [(0, 2**31 + 1), (0, 3 * 2**30), (0, 2**63 - 1), (-(2**62), 2**61)] * 20)  # often drawn again
def test_integers_are_numpy_s(kind, seed, bounds):
    generator, random = both(kind, seed)
    for low, high in bounds:
        low, high = min(low, high), max(low, high, min(low, high) + 1)  # noqa: PLW2901
        if high < 2**63:
            assert integer_between(low, high, generator) == random.integers(low, high)


@FEW
@given(kind=KINDS, seed=SEEDS, among=st.integers(1, 300), data=st.data())
def test_a_choice_is_numpy_s(kind, seed, among, data):
    generator, random = both(kind, seed)
    chosen, room = np.zeros(data.draw(st.integers(0, among)), np.int64), np.ones(among, np.int64)
    choose(chosen, room, generator)
    assert chosen.tolist() == random.choice(among, len(chosen), replace=False).tolist()
    assert next_uint32(generator) == random.integers(2**32)


def test_a_choice_among_many_is_numpy_s():
    for among, count in [(TAIL_LIMIT, 201), *((20_050, k) for k in (1, 401, 402, 10_000, 20_050))]:
        generator, random = both("pcg64", among + count)
        chosen = np.zeros(count, np.int64)
        choose(chosen, np.ones(among, np.int64), generator)
        assert chosen.tolist() == random.choice(among, count, replace=False).tolist()


def test_the_tables_are_those_in_numpy_s_machine_code():
    compiled = Path(np.random._generator.__file__).read_bytes()
    assert [table.tobytes() in compiled for table in normal_tables()] == [True] * 3


@pytest.mark.parametrize("kind", IN_NUMPY)
def test_very_many_normal_numbers_are_numpy_s(kind):
    generator, random = both(kind, 2016)
    numbers = np.zeros(300_000)
    fill_normals(numbers, generator)
    expected = random.standard_normal(len(numbers))
    in_tail = np.abs(expected) > NORMAL_EDGE  # where our logarithm may differ from the system's in the last digit
    assert (numbers == expected)[~in_tail].all()
    assert in_tail.any()
    np.testing.assert_allclose(numbers[in_tail], expected[in_tail], rtol=2**-51, atol=0)
    assert drawn(standard_normal, generator) == random.standard_normal(10).tolist()
