"""When an answer is trusted: flashes, robots and the total light must agree."""

import numpy as np
import pytest

from epuck_sim.overhead.flashes import CountedRings, Flash, FlashLinker, count_lit, count_places, join_broken
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.synchrony import evaluate
from epuck_sim.overhead.verdict import (
    Evidence,
    count_images,
    doubts,
    light_of_no_ring,
    may_be_half_a_period,
    objections,
    recurs_after_two,
)
from tests.overhead.counts import counted
from tests.overhead.films import make_geometry

TIMES = np.arange(240) / 30
ONSETS = np.array([*(0.1 + np.arange(3)[:, None] + np.arange(4) / 5).ravel(), *np.repeat(3.5 + np.arange(4), 4)])


COUNTED = CountedRings(240, 0.0, TIMES, np.zeros(240, int), np.zeros(240, int), (), 0, (), make_geometry())


def evidence(**changes) -> Evidence:
    """Return that of four robots of a period of 1 s that flash together from 3.5 s on."""
    flashes = tuple(Flash(onset, onset + 0.1, 10.0 + 12 * (k % 4), 20.0, 50.0) for k, onset in enumerate(ONSETS))
    counts = counted(ONSETS, 0.1, TIMES)
    known = Evidence(TIMES, counts, 100 * counts, flashes, 1.0, 0.05, 0.0, 4, True)
    return known._replace(**changes)


def sync_of(given: Evidence):
    found = evaluate(given.times_s, given.counts, given.period_s, given.start_s)
    return next((each for each in found if each.spread_s <= given.threshold_s), None)


def test_nothing_is_objected_to_what_adds_up() -> None:
    assert sync_of(evidence()).time_s == pytest.approx(3.55)
    assert objections(evidence(), sync_of(evidence())) == []
    assert objections(evidence(robots=None), sync_of(evidence())) == []


@pytest.mark.parametrize(("cycle_s", "is_odd"), [(0.7, False), (0.54, False), (0.5, True), (1.7, True)])
def test_coupling_shortens_cycles_and_nothing_lengthens_them_by_much(cycle_s: float, is_odd: bool) -> None:
    onsets = np.sort((cycle_s * (np.arange(8 / cycle_s)[:, None] + np.arange(4) / 4)).ravel())
    flashes = tuple(Flash(onset, onset + 0.05, 10.0 + 12 * (k % 4), 20.0, 50.0) for k, onset in enumerate(onsets))
    counts = counted(onsets, 0.05, TIMES)
    found = objections(evidence(flashes=flashes, counts=counts, area=100 * counts), None)
    assert [reason[-41:] for reason in found] == ["flashes per period, but there are 4 robots"[-41:]] * is_odd


@pytest.mark.parametrize(
    ("robots", "why"), [(3, "4 rings were lit at once"), (9, "flashes per period, but there are 9")]
)
def test_other_numbers_of_robots_are_objected(robots: int, why: str) -> None:
    (reason,) = objections(evidence(robots=robots), sync_of(evidence()))
    assert why in reason


def test_light_that_is_together_before_the_rings_is_objected() -> None:
    early = counted(np.repeat(0.5 + np.arange(8), 4), 0.1, TIMES)
    (reason,) = objections(evidence(area=100 * early), sync_of(evidence()))
    assert reason.startswith("the total light is synchronised at 0.6 s")


def test_light_that_is_spread_where_rings_are_together_is_objected() -> None:
    spread = counted((0.1 + np.arange(8)[:, None] + np.arange(4) / 5).ravel(), 0.1, TIMES)
    (reason,) = objections(evidence(area=100 * spread), sync_of(evidence()))
    assert reason.startswith("the total light is spread by")


def test_light_of_a_lamp_is_no_objection() -> None:
    assert objections(evidence(area=evidence().area + 5000), sync_of(evidence())) == []


@pytest.mark.parametrize("turns", [1, 2])
def test_places_that_flash_in_turn_are_noticed(turns: int) -> None:
    places = [Flash(0.5 * k, 0.5 * k + 0.1, 10.0 + 25 * (k % turns), 20.0, 50.0) for k in range(20)]
    assert recurs_after_two(places, 0.5) == (turns == 2)


@pytest.mark.parametrize(("moves_cm", "known", "doubted"), [(9, {}, True), (3, {}, False), (9, {"robots": 1}, False)])
def test_the_double_period_is_doubted_where_robots_move_too_far_to_tell(
    moves_cm: float, known: dict[str, int], doubted: bool
) -> None:
    flashes = tuple(Flash(0.5 + k, 0.6 + k, float(moves_cm * k), 20.0, 50.0) for k in range(12))
    given = evidence(flashes=flashes, robots=None, period_is_given=False)._replace(**known)
    assert may_be_half_a_period(given) == doubted
    assert not may_be_half_a_period(given._replace(period_is_given=True))


def test_two_groups_in_turn_are_no_swarm_in_step_from_the_beginning() -> None:
    onsets = 0.55 + np.repeat(np.arange(8), 3)
    flashes = tuple(Flash(at, at + 0.1, 20.0 + 12 * at + 2 * (k % 3), 20.0, 50.0) for k, at in enumerate(onsets))
    counts = counted(onsets, 0.1, TIMES)
    given = evidence(flashes=flashes, counts=counts, area=100 * counts, robots=None, period_is_given=False)
    (reason,) = objections(given, sync_of(given))
    assert "2 s are the period and two groups flash in turn" in reason
    assert objections(given._replace(robots=3), sync_of(given)) == []


@pytest.mark.parametrize(("every", "is_doubted"), [(1, False), (5, True)])
def test_flashes_that_are_missed_before_synchrony_are_doubted(every: int, is_doubted: bool) -> None:
    flashes = tuple(flash for k, flash in enumerate(evidence().flashes) if flash.onset_s > 3 or every == 1 or k % every)
    counts = counted(np.array([flash.onset_s for flash in flashes]), 0.1, TIMES)
    given = evidence(flashes=flashes, counts=counts)
    found = doubts(COUNTED._replace(times_s=TIMES, counts=counts), given, sync_of(given), 0)
    assert any("some are missed" in doubt for doubt in found) == is_doubted


@pytest.mark.parametrize(("size", "is_doubted"), [(1.0, False), (1.05, False), (0.88, True), (1.12, True)])
def test_rings_that_are_too_large_by_the_corners_are_doubted(size: float, is_doubted: bool) -> None:
    given = evidence()
    found = doubts(COUNTED._replace(geometry=make_geometry()._replace(ring_size=size)), given, sync_of(given), 0)
    assert any("times as large as they are" in doubt for doubt in found) == is_doubted


def test_a_number_of_robots_that_varies_is_doubted() -> None:
    flashes = tuple(flash for k, flash in enumerate(evidence().flashes) if k not in {14, 17, 22})
    given = evidence(flashes=flashes, robots=None)
    (doubt,) = doubts(COUNTED, given, sync_of(given), 0)
    assert doubt.startswith("3 to 4 flashes are seen in a period of the synchronised swarm")
    assert doubts(COUNTED, evidence(robots=None), sync_of(given), 0) == []


def test_light_of_no_ring_is_measured_and_doubted() -> None:
    given = evidence()
    assert light_of_no_ring(given) == pytest.approx(0, abs=1e-9)
    cut = np.where(np.arange(len(TIMES)) % 3 == 0, 0, given.counts)
    assert light_of_no_ring(given._replace(counts=cut)) == pytest.approx(1 / 3, abs=0.1)
    assert light_of_no_ring(given._replace(counts=0 * given.counts)) == 0
    assert any("is of no ring" in doubt for doubt in doubts(COUNTED, given._replace(counts=cut), sync_of(given), 0))


def test_mirror_images_are_counted() -> None:
    random = np.random.default_rng(0)
    robots = [Flash(t, t + 0.3, *random.uniform(5, 55, 2), 80.0) for t in np.sort(random.uniform(0, 60, 30))]
    images = [flash._replace(x_cm=-flash.x_cm, light=40.0) for flash in robots[::2]]
    assert count_images(robots) == 0
    assert count_images(sorted(robots + images)) == len(images)


def ring(x_cm: float, light: float = 9.0) -> Ring:
    return Ring(x_cm, 20.0, 3.5, 0.0, 0.0, 0.0, light)


def test_rings_are_linked_to_flashes_across_a_frame_that_misses_one() -> None:
    linker = FlashLinker()
    for number, places in enumerate([[10.0], [10.5, 30.0], [30.4], [11.0, 30.8], [], [], [], []]):
        linker.add(float(number), [ring(place) for place in places])
    one, other = linker.flashes
    assert (one.onset_s, one.end_s, other.onset_s, other.end_s) == (0, 4, 1, 4)
    assert (one.x_cm, other.x_cm) == (pytest.approx(10.5), pytest.approx(30.4))
    assert count_lit(linker.flashes, np.arange(8.0)).tolist() == [1, 2, 2, 2, 0, 0, 0, 0]


def test_a_flash_that_breaks_off_is_one() -> None:
    one, rest, other = (
        Flash(*times, x_cm, 20.0, 9.0) for times, x_cm in (((0, 1), 10), ((1.5, 2), 11), ((1.6, 2), 30))
    )
    late = rest._replace(onset_s=3.5, end_s=4.0)
    assert join_broken([one, rest, other, late], 1.0) == (one._replace(end_s=2), other, late)


def test_a_ring_that_is_lit_at_the_end_ends_with_the_film() -> None:
    linker = FlashLinker()
    for number in range(4):
        linker.add(float(number), [ring(10.0)] if number else [])
    (flash,) = linker.flashes
    assert (flash.onset_s, flash.end_s) == (1, 3)
    assert count_lit(linker.flashes, np.arange(4.0)).tolist() == [0, 1, 1, 1]


def test_places_near_each_other_are_one() -> None:
    assert count_places([(1.0, 1.0), (2.0, 1.0), (9.0, 9.0)]) == 2
