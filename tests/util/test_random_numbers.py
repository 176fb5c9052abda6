"""Seeds and streams of random numbers: the published generator, uniform draws, and trials apart from each other."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from epuck_sim.util.rng import next_word, randint, uniform
from epuck_sim.util.seeds import robot_streams, trial_seed

MASK = 2**64 - 1
WORDS = st.integers(0, MASK)
STATES = st.tuples(WORDS, WORDS, WORDS, WORDS)
ZERO, LARGEST = (0, 5, 7, 0), (0, 5, 7, MASK)
"""States whose next word is 0, and 2**64 - 1."""


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
    assert 0 <= seed < 2**53
    assert seed == trial_seed(master, trial)


def test_seeds_use_all_53_bits_and_are_distinct_over_trials_and_masters():
    masters = [*range(20), 2**32, 2**53, 2**64, 10**100]
    seeds = [trial_seed(master, trial) for master in masters for trial in range(200)]
    assert len(set(seeds)) == len(seeds)
    assert max(seeds[1:200]) > 2**52


@given(seed=st.integers(0, 10**30), few=st.integers(0, 20), more=st.integers(0, 20))
def test_further_robots_leave_the_streams_of_the_others_as_they_were(seed, few, more):
    streams = robot_streams(np.random.SeedSequence(seed), few + more)
    assert streams.shape == (few + more, 4)
    assert (streams[:few] == robot_streams(np.random.SeedSequence(seed), few)).all()


def test_every_robot_has_a_stream_of_its_own():
    streams = robot_streams(np.random.SeedSequence(1), 1000)
    assert len({next_word(random) for random in streams}) == 1000
