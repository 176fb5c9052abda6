"""Shares of a sweep: every trial is in one of them, and each takes about as long as any other."""

from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.runs.records import FinishedTrials
from epuck_sim.runs.share import WHOLE, Share


@given(st.integers(1, 50), st.integers(0, 10_000), st.integers(0, 200))
def test_every_trial_is_in_one_share_and_shares_of_a_point_differ_by_one_trial(count, point, trials) -> None:
    parts = [Share(number, count).trials(point, trials) for number in range(1, count + 1)]
    assert sorted(trial for part in parts for trial in part) == [*range(trials)]
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


@given(st.integers(1, 50), st.integers(0, 1000), st.integers(0, 100), st.integers(0, 100))
def test_trials_that_are_added_leave_those_before_them_in_their_share(count, point, trials, more) -> None:
    share = Share(count, count)
    assert [*share.trials(point, trials)] == [trial for trial in share.trials(point, trials + more) if trial < trials]


@settings(max_examples=20, deadline=None)
@given(*map(st.sampled_from, ([5, 8, 10, 13, 20, 21, 32], [4, 10, 20, 40, 64], [1, 7, 30])))
def test_shares_take_about_as_long_even_if_one_speed_takes_a_hundred_times_another(speeds, count, trials) -> None:
    points = range(40 * speeds)
    costs = [
        sum(
            len(Share(number, count).trials(point, trials)) * 100 ** (point % speeds / (speeds - 1)) for point in points
        )
        for number in range(1, count + 1)
    ]
    # a point's trials cannot be divided among shares better than by one trial of 100
    assert max(costs) < 1.1 * sum(costs) / count + 300


def test_a_share_is_read_as_it_is_written() -> None:
    assert str(Share.parse("3/40")) == "3/40"
    assert [*WHOLE.trials(17, 4)] == [0, 1, 2, 3]


@given(
    st.dictionaries(st.integers(0, 2), st.sets(st.integers(0, 20), min_size=1)), st.integers(1, 3), st.integers(0, 30)
)
def test_missing_trials_are_those_wanted_that_are_not_finished(trials, of: int, count: int) -> None:
    finished = FinishedTrials((point, [*numbers]) for point, numbers in trials.items())
    assert {*finished} == {(point, trial) for point, numbers in trials.items() for trial in numbers}
    for point in range(3):
        for number in range(of):
            wanted = Share(number + 1, of).trials(point, count)
            missing = [wanted[place] for place in finished.missing(point, wanted)]
            assert missing == [trial for trial in wanted if trial not in trials.get(point, ())]
            assert finished.count(point, wanted) == len(wanted) - len(missing)
