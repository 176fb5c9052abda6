"""Our own elementary functions, near exact values and alike in compiled code; seeds, streams and random numbers: the
published generator, trials apart from each other, and numpy's bit for bit, but for the tail of normal numbers.
"""

import hashlib
import itertools
import math
import re
import struct
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from numba import njit

from epuck_sim import elementary
from epuck_sim.util import elementary as kernels, generators as ours
from epuck_sim.util.rng import next_word, randint, uniform
from epuck_sim.util.seeds import robot_streams, seed_words, trial_seed

DIGESTS = {  # of what each function gives, on every machine
    "sin": "e1d96b6307f7f3be",
    "cos": "040f3a79bf9523b0",
    "tan": "ac3eed5848beee1d",
    "atan": "60d2eb0ccb74dbf8",
    "exp": "7a0c865da9fa100b",
    "expm1": "e1b6ad23ce3c606b",
    "log": "f06e75d6abbd35c0",
    "log1p": "8611d7aa3241ef3e",
}
# near multiples of a quarter turn, on both sides of where the reduction changes
near = st.integers(-700_000, 700_000).map(lambda quarter: quarter * math.pi / 2)
angles = st.one_of(st.floats(-10, 10), near, st.floats(allow_nan=False, allow_infinity=False))
numbers = st.one_of(st.floats(-2, 2), st.floats(-800, 800), st.floats(allow_nan=False))


def ulps(function, *arguments):
    """Return the distance of a result from the exact one, in units in the last place of the latter."""
    with mpmath.workprec(1300):  # as it takes to tell the largest angles apart from multiples of pi
        exact = getattr(mpmath, function)(*map(mpmath.mpf, arguments))
        unit = math.ulp(float(exact))
        return abs(float((mpmath.mpf(getattr(elementary, function)(*arguments)) - exact) / mpmath.mpf(unit)))


def bits(number):
    return "nan" if math.isnan(number) else struct.pack("d", number)


@pytest.mark.parametrize("function", DIGESTS)
@settings(max_examples=60)
@given(number=angles | numbers)
@example(6381956970095103.0 * 2.0**797)  # the nearest to a multiple of a quarter turn (Muller 1997)
@example(math.pi / 2)
@example(math.pi)
@example(22.0)
@example(1e6)
def test_results_are_exact_to_the_last_digit_at_angles_of_any_size_too(function, number):
    low = {"log": 5e-324, "log1p": math.nextafter(-1, 0)}.get(function, -1e308)
    assert ulps(function, min(max(number, low), 709.0 if function in ("exp", "expm1") else 1e308)) < 1


@given(y=st.floats(-100, 100), x=st.floats(-100, 100))
@example(y=0.0, x=-0.0)
@example(y=-0.0, x=-1.0)
def test_directions_and_distances_of_points_are_within_two_units(y, x):
    if y:  # mpmath has no zeros with a sign
        assert ulps("atan2", y, x) < 2
    else:
        assert elementary.atan2(y, x) == math.atan2(y, x)
    if abs(x) + abs(y) > 1e-150:
        assert ulps("hypot", x, y) < 2


def test_special_values_are_right_and_directions_along_axes_and_diagonals_are_python_s():
    inf, nan = math.inf, math.nan
    for function, special in {
        "sin": {inf: nan, -inf: nan, -0.0: -0.0},
        "cos": {inf: nan, -inf: nan, 0.0: 1.0},
        "tan": {inf: nan, -inf: nan},
        "atan": {inf: math.pi / 2, -inf: -math.pi / 2, -0.0: -0.0},
        "exp": {inf: inf, 709.8: inf, 709.78: 1.7928227943945155e308, -745.2: 0.0, -745.0: 5e-324, 0.0: 1.0},
        "expm1": {709.8: inf, -50.0: -1.0, -0.0: -0.0},
        "log": {0.0: -inf, 1.0: 0.0, -1.0: nan, inf: inf},
        "log1p": {-1.0: -inf, -1.5: nan, inf: inf},
    }.items():
        for argument, result in special.items():
            assert bits(getattr(elementary, function)(argument)) == bits(result), (function, argument)
    for y, x in itertools.product([0.0, -0.0, 2.0, -2.0, math.inf, -math.inf], repeat=2):
        assert bits(elementary.atan2(y, x)) == bits(math.atan2(y, x)), (y, x)


@given(st.sampled_from([*DIGESTS]), st.one_of(angles, numbers, st.just(math.nan)), st.floats())
def test_compiled_functions_are_those_of_python_to_the_bit(function, number, other):
    for name, given_ in ((function, (number,)), ("atan2", (number, other)), ("hypot", (number, other))):
        assert bits(getattr(kernels, name)(*given_)) == bits(getattr(elementary, name)(*given_))


def arguments():
    """Return arguments of all sizes, the same on every machine."""
    word, found = 1, []
    for _ in range(4000):
        word = (word * 6364136223846793005 + 1442695040888963407) % 2**64
        found += [(word >> 11) * 2.0**-50 - 4.0, struct.unpack("d", struct.pack("Q", word))[0]]
    return [number for number in found if math.isfinite(number)]


def test_results_are_those_of_every_other_machine_as_compiled_code_rounds_products_before_it_adds():
    for function, digest in DIGESTS.items():
        results = np.array([getattr(elementary, function)(number) for number in arguments()], "<f8")
        assert hashlib.sha256(results[~np.isnan(results)].tobytes()).hexdigest()[:16] == digest, function

    @njit
    def both(angle):
        sine, cosine = kernels.sin_cos(angle)
        return sine * cosine + angle

    both(1.0)
    (code,) = both.inspect_asm().values()
    assert "mul" in code  # what it looks for is there
    assert re.search(r"fn?m(add|sub|la|ls)", code) is None


MASK = 2**64 - 1
WORDS = st.integers(0, MASK)
STATES = st.tuples(WORDS, WORDS, WORDS, WORDS)
ZERO, LARGEST = (0, 5, 7, 0), (0, 5, 7, MASK)  # states whose next word is 0, and 2**64 - 1


def stream(*state):
    return np.array(state, np.uint64)


def xoshiro256pp(state):
    """Return the next word and state, by the algorithm as published (Blackman and Vigna 2019)."""
    s0, s1, s2, s3 = state

    def rotated(word, left):
        return (word << left | word >> (64 - left)) & MASK

    result = (rotated((s0 + s3) & MASK, 23) + s0) & MASK
    t = (s1 << 17) & MASK
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= t
    return result, (s0, s1, s2, rotated(s3, 45))


def test_next_word_gives_the_published_reference_output():
    random = stream(1, 2, 3, 4)
    assert [int(next_word(random)) for _ in range(10)] == [
        *(41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205),
        *(9973669472204895162, 14011001112246962877, 12406186145184390807, 15849039046786891736),
        10450023813501588000,
    ]


@given(state=STATES)
def test_next_word_is_xoshiro256pp_from_every_state(state):
    random = stream(*state)
    for _ in range(5):
        word, state = xoshiro256pp(state)
        assert int(next_word(random)) == word
        assert random.tolist() == list(state)


@given(state=STATES, limit=st.integers(1, 2**31))
@example(ZERO, 2**31)
@example(LARGEST, 2**31 - 1)
@example(LARGEST, 86_400_000)
def test_uniform_is_the_word_s_upper_53_bits_and_randint_a_share_of_its_range(state, limit):
    share = (xoshiro256pp(state)[0] >> 11) / 2**53
    assert uniform(stream(*state)) == share < 1
    assert randint(stream(*state), limit) == int(share * limit) < limit


@given(master=st.integers(0, 2**53) | st.integers(0, 10**100), trial=st.integers(1, 10**7))
def test_trial_0_has_the_master_seed_itself_and_others_have_seeds_of_at_most_53_bits(master, trial):
    assert trial_seed(master, 0) == master
    seed = trial_seed(master, trial)
    assert type(seed) is int
    word = np.random.SeedSequence(master, spawn_key=(trial,)).generate_state(1, np.uint64)[0]
    assert seed == int(word) >> 11 == trial_seed(master, trial)


def test_seeds_use_all_53_bits_and_are_distinct_over_trials_and_masters_and_so_are_streams_of_robots():
    masters = [*range(20), 2**32, 2**53, 2**64, 10**100]
    seeds = [trial_seed(master, trial) for master in masters for trial in range(200)]
    assert len(set(seeds)) == len(seeds)
    assert max(seeds[1:200]) > 2**52
    streams = robot_streams(np.random.SeedSequence(1), 1000)
    assert len({next_word(random) for random in streams}) == 1000


SEEDS = st.integers(0, 2**64 - 1) | st.integers(0, 2**300) | st.sampled_from([0, 2**32 - 1, 2**32, 2**128, 2**160])
FEW = settings(max_examples=40)
KEYS = st.lists(st.integers(0, 10) | st.integers(0, 2**64 - 1), max_size=4)
KINDS = st.sampled_from(["sfc64", "pcg64"])
IN_NUMPY = {"sfc64": np.random.SFC64, "pcg64": np.random.PCG64}
INT64 = st.integers(-(2**63), 2**63 - 1)
BOUNDS = st.tuples(INT64, INT64) | st.tuples(st.just(0), st.integers(1, 2**33))


def sequence_of(words, keys=()):
    sequence = np.zeros(ours.SEQUENCE_WORDS, np.uint64)
    ours.begin_sequence(sequence, words)
    for key in keys:
        ours.spawn(sequence, sequence, np.uint64(key))
    return sequence


def words_of(sequence, count=4):
    words = np.zeros(count, np.uint64)
    ours.draw_words(words, sequence)
    return words.tolist()


def both(kind, seed, key=()):
    generator = np.ones(ours.GENERATOR_WORDS, np.uint64)  # which seeding has to overwrite
    {"sfc64": ours.seed_sfc64, "pcg64": ours.seed_pcg64}[kind](generator, sequence_of(seed_words(seed), key))
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
    parent, child = sequence_of(seed_words(seed)), np.zeros(ours.SEQUENCE_WORDS, np.uint64)
    ours.spawn(child, parent, key)
    assert (parent == sequence_of(seed_words(seed))).all()
    assert (child == sequence_of(seed_words(seed), [key])).all()


@FEW
@given(seed=SEEDS, robots=st.integers(0, 30))
def test_streams_are_those_of_the_robots(seed, robots):
    sequence, stream, factor = sequence_of(seed_words(seed), [3]), np.zeros(4, np.uint64), ours.DRAW_BEGIN
    for expected in robot_streams(np.random.SeedSequence(seed, spawn_key=(3,)), robots):
        factor = ours.draw_row(stream, sequence, np.uint64(factor))
        assert (stream == expected).all()


@FEW
@given(kind=KINDS, seed=SEEDS, key=KEYS)
def test_words_and_doubles_are_numpy_s(kind, seed, key):
    generator, random = both(kind, seed, key)
    assert drawn(ours.next_uint64, generator) == random.bit_generator.random_raw(10).tolist()
    assert drawn(ours.next_double, generator) == random.random(10).tolist()
    numbers = np.zeros(5)
    ours.fill_doubles(numbers, generator)
    assert numbers.tolist() == random.random(5).tolist()


@FEW
@given(kind=KINDS, seed=SEEDS, lengths=st.lists(st.integers(0, 3), max_size=10))
def test_halves_of_words_wait_as_in_numpy(kind, seed, lengths):
    """Whole words in between leave the half that waits where it is."""
    generator, random = both(kind, seed)
    for length in lengths:
        expected = random.integers(2**32, size=length)  # of exactly 32 bits
        assert drawn(ours.next_uint32, generator, length) == expected.tolist()
        assert ours.next_double(generator) == random.random()


@FEW
@given(kind=KINDS, seed=SEEDS, bounds=st.lists(BOUNDS, min_size=1, max_size=30))
@example("pcg64", 0, [(0, 1), (0, 2**32), (0, 2**32 - 1), (0, 2**32 + 1), (-5, 3), (0, 8), (-(2**63), 2**63 - 1)])
@example("sfc64", 0, [(0, 2**31 + 1), (0, 3 * 2**30), (0, 2**63 - 1), (-(2**62), 2**61)] * 20)  # often drawn again
def test_integers_are_numpy_s(kind, seed, bounds):
    generator, random = both(kind, seed)
    for low, high in bounds:
        low, high = min(low, high), max(low, high, min(low, high) + 1)  # noqa: PLW2901
        if high < 2**63:
            assert ours.integer_between(low, high, generator) == random.integers(low, high)


@FEW
@given(kind=KINDS, seed=SEEDS, among=st.integers(1, 300), data=st.data())
def test_a_choice_is_numpy_s(kind, seed, among, data):
    generator, random = both(kind, seed)
    chosen, room = np.zeros(data.draw(st.integers(0, among)), np.int64), np.ones(among, np.int64)
    ours.choose(chosen, room, generator)
    assert chosen.tolist() == random.choice(among, len(chosen), replace=False).tolist()
    assert ours.next_uint32(generator) == random.integers(2**32)


def test_a_choice_among_many_is_numpy_s():
    for among, count in [(ours.TAIL_LIMIT, 201), *((20_050, k) for k in (1, 401, 402, 10_000, 20_050))]:
        generator, random = both("pcg64", among + count)
        chosen = np.zeros(count, np.int64)
        ours.choose(chosen, np.ones(among, np.int64), generator)
        assert chosen.tolist() == random.choice(among, count, replace=False).tolist()


@pytest.mark.parametrize("kind", IN_NUMPY)
def test_very_many_normal_numbers_are_numpy_s_and_their_tables_those_in_its_machine_code(kind):
    generator, random = both(kind, 2016)
    numbers = np.zeros(300_000)
    ours.fill_normals(numbers, generator)
    expected = random.standard_normal(len(numbers))
    in_tail = np.abs(expected) > ours.NORMAL_EDGE  # where our logarithm may differ from the system's in the last digit
    assert (numbers == expected)[~in_tail].all()
    assert in_tail.any()
    np.testing.assert_allclose(numbers[in_tail], expected[in_tail], rtol=2**-51, atol=0)
    assert drawn(ours.standard_normal, generator) == random.standard_normal(10).tolist()
    compiled = Path(np.random._generator.__file__).read_bytes()
    assert [table.tobytes() in compiled for table in ours.normal_tables()] == [True] * 3
