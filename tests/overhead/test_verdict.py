"""When an answer is trusted: flashes, robots and the total light must agree."""

import numpy as np
import pytest

from epuck_sim.overhead.flashes import (
    CountedRings,
    Flash,
    FlashLinker,
    FlashTable,
    count_lit,
    count_places,
    join_broken,
)
from epuck_sim.overhead.rings import DISC_LIGHT, Ring
from epuck_sim.overhead.synchrony import evaluate, first_synchronised
from epuck_sim.overhead.verdict import (
    Evidence,
    count_images,
    doubts,
    light_of_no_ring,
    may_be_half_a_period,
    objections,
    why_never,
)
from tests.overhead.films import counted, make_geometry

TIMES = np.arange(240) / 30
ONSETS = np.array([*(0.1 + np.arange(3)[:, None] + np.arange(4) / 5).ravel(), *np.repeat(3.5 + np.arange(4), 4)])


def flash(onset_s: float, x_cm: float, lasts_s: float = 0.1) -> Flash:
    return Flash(onset_s, onset_s + lasts_s, x_cm, 20.0, 50.0)


IN_TURN = (0.1 + np.arange(6)[:, None] + np.arange(4) / 5).ravel()


def evidence(onsets=ONSETS, *, flash_s: float = 0.1, apart_cm: float = 12.0, **changes) -> Evidence:
    """Return that of four robots of a period of 1 s that flash together from 3.5 s on."""
    flashes = tuple(flash(onset, 10.0 + apart_cm * (k % 4), flash_s) for k, onset in enumerate(onsets))
    return seen(Evidence(COUNTED, 0, 1.0, 0.05, None, 4, True)._replace(**changes), flashes, flash_s)


COUNTED = CountedRings(240, 0.0, TIMES, np.zeros(240, int), np.zeros(240, int), (), make_geometry())


def seen(known: Evidence, flashes: tuple[Flash, ...], flash_s: float = 0.1, area=None) -> Evidence:
    """Return evidence with other flashes, and an area of 100 px for each of them or another one."""
    counts = counted(np.array([each.onset_s for each in flashes]), flash_s, TIMES)
    rings = known.counted._replace(counts=counts, areas_px=100 * counts if area is None else area, flashes=flashes)
    sync = first_synchronised(evaluate(TIMES, counts, known.period_s), known.threshold_s)
    return known._replace(counted=rings, sync=sync)


def filmed(**changes) -> Evidence:
    """Return evidence with changes to what was counted."""
    given = evidence()
    return given._replace(counted=given.counted._replace(**changes))


def cycles_of(cycle_s: float) -> Evidence:
    """Return evidence of robots that flash in turn, with cycles of another length than the period."""
    onsets = np.sort((cycle_s * (np.arange(8 / cycle_s)[:, None] + np.arange(4) / 4)).ravel())
    return evidence(onsets, flash_s=0.05)._replace(sync=None)


@pytest.mark.parametrize(("given", "reason"), [
    (evidence(), ""), (evidence(robots=None), ""),
    # coupling shortens cycles, and nothing lengthens them by much
    (cycles_of(0.7), ""), (cycles_of(0.54), ""),
    *((cycles_of(cycle_s), "per period, but there are 4 robots: check --robots") for cycle_s in (0.5, 1.7)),
    (evidence(robots=3), "4 rings were lit at once"),
    (evidence(robots=9), "flashes per period, but there are 9"),
    (evidence([*IN_TURN, 6.5, 6.5]), "the narrow histogram holds 2 flashes, but there are 4 robots; check --robots"),
    (evidence([*IN_TURN, 6.5, 6.5, 6.5]), ""),
    (evidence()._replace(period_s=9.0, robots=None), "no whole period of 9 s was seen; check --period-s, or film"),
    # what shines is together or spread where rings are not
    (filmed(areas_px=100 * counted(0.5 + np.arange(8).repeat(4), 0.1, TIMES)), "total light is synchronised at 0.6 s"),
    (filmed(areas_px=100 * counted(0.1 + np.arange(40) / 5, 0.1, TIMES)), "total light is spread"),
    (filmed(areas_px=evidence().counted.areas_px + 5000), ""),  # a lamp
])  # fmt: skip
def test_what_does_not_add_up_is_objected(given: Evidence, reason: str) -> None:
    found = objections(given)
    assert len(found) == bool(reason)
    assert all(reason in each for each in found)


@pytest.mark.parametrize(("phases", "is_named"), [((0.1, 0.1, 0.1, 0.35), True), ((0.1, 0.35, 0.6, 0.85), False)])
def test_an_order_parameter_is_named_if_track_takes_it(phases: tuple[float, ...], is_named: bool) -> None:
    onsets = (np.arange(7)[:, None] + np.array(phases)).ravel()
    assert ("; --order-parameter" in why_never(evidence(onsets))) == is_named


@pytest.mark.parametrize("turns", [1, 2])
def test_places_that_flash_in_turn_are_noticed(turns: int) -> None:
    places = tuple(flash(0.5 * k, 10.0 + 25 * (k % turns)) for k in range(16))
    given = seen(evidence(robots=None, period_is_given=False, period_s=0.5), places, area=0 * TIMES)
    found = [reason[:39] for reason in objections(given)]
    assert found == ["places flash again after two periods of"] * (turns == 2)


@pytest.mark.parametrize(("moves_cm", "known", "doubted"), [(9, {}, True), (3, {}, False), (9, {"robots": 1}, False)])
def test_the_double_period_is_doubted_where_robots_move_too_far_to_tell(
    moves_cm: float, known: dict[str, int], doubted: bool
) -> None:
    flashes = tuple(flash(0.5 + k, float(moves_cm * k)) for k in range(8))
    given = seen(evidence(robots=None, period_is_given=False), flashes)._replace(**known)
    assert may_be_half_a_period(given) == doubted
    assert not may_be_half_a_period(given._replace(period_is_given=True))


def test_two_groups_in_turn_are_no_swarm_in_step_from_the_beginning() -> None:
    onsets = 0.55 + np.repeat(np.arange(8), 3)
    flashes = tuple(flash(at, 20.0 + 12 * at + 2 * (k % 3)) for k, at in enumerate(onsets))
    given = seen(evidence(robots=None, period_is_given=False), flashes)
    (reason,) = objections(given)
    assert "2 s are the period and two groups flash in turn" in reason
    assert objections(given._replace(robots=3)) == []


def burnt_out(number: int) -> Evidence:
    """Return evidence in which some flashes are discs."""
    flashes = evidence().counted.flashes
    return filmed(flashes=(*(each._replace(light=DISC_LIGHT) for each in flashes[:number]), *flashes[number:]))


NEARLY = np.sort([*(k + np.array([0.5, 0.5, 0.6, 0.6]) for k in range(7))], axis=None)
CUT = np.where(np.arange(len(TIMES)) % 3 == 0, 0, evidence().counted.counts)
"""Counts without each third frame."""
MISSED = [onset for k, onset in enumerate(ONSETS) if onset > 3 or k % 5]
SHOWN = evidence(robots=None, period_is_given=False)


@pytest.mark.parametrize(("given", "doubt"), [
    (evidence(), ""), (evidence(robots=None), ""), (SHOWN, ""), (burnt_out(4), ""),
    (filmed(geometry=make_geometry()._replace(ring_size=1.05)), ""),
    (filmed(geometry=make_geometry()._replace(tilt_deg=9.0)), ""),  # by the corners
    (evidence(period_s=100.0), ""),
    (evidence()._replace(lit_always=2), "left out: 2; check --period-s, or leave lamps"),
    (filmed(outside=7), "rings outside of the floor, and left out: 7 in 240 frames"),
    (burnt_out(5), "burnt out to discs: those of 5 of 28 flashes"),
    (filmed(counts=CUT), "is of no ring"),
    *((filmed(geometry=make_geometry()._replace(ring_size=size)), "times as large as") for size in (0.88, 1.12)),
    (filmed(geometry=make_geometry()._replace(tilt_deg=3.0, knows_floor=False)), "seems to be tilted by 3 degrees"),
    (evidence(MISSED), "some are missed"),
    (evidence(robots=5), "synchronised swarm, 4 at T_sync, but there are 5 robots: check --robots"),
    (evidence(robots=3), "4 to 4 flashes are seen in a period of the synchronised swarm, 4 at T_sync, but there are 3"),
    (filmed(times_s=np.delete(TIMES, range(30, 36))), "gaps longer than 1.5 times the usual 33.3 ms between frames: 1"),
    (evidence(flash_s=0.04), "frames come every 33.3 ms, too seldom"),
    (evidence(NEARLY), "frames come every 33.3 ms, too seldom"),
    (evidence(np.delete(ONSETS, [14, 17, 22]), robots=None), "3 to 4 flashes are seen in a period of the synchronised"),
    *((SHOWN._replace(period_s=each), f"hardly flash every {each:g} s; check --fps") for each in (0.02, 100.0)),
    *((evidence(period_s=each), "swarm flashes every 1 s, not every") for each in (0.8, 1.1)),
    (SHOWN._replace(period_s=2.5), "is estimated from only 3.2 periods of film; better give --period-s"),
])  # fmt: skip
def test_what_is_doubtful_is_said(given: Evidence, doubt: str) -> None:
    found = doubts(given)
    assert any(doubt in each for each in found) if doubt else not found, found


def test_light_of_no_ring_is_measured() -> None:
    counts, area = evidence().counted.counts, evidence().counted.areas_px
    assert light_of_no_ring(area, counts) == pytest.approx(0, abs=1e-9)
    assert light_of_no_ring(area, CUT) == pytest.approx(1 / 3, abs=0.1)
    assert light_of_no_ring(area, 0 * counts) == 0


def test_mirror_images_are_counted() -> None:
    random = np.random.default_rng(0)
    robots = [Flash(t, t + 0.3, *random.uniform(5, 55, 2), 80.0) for t in np.sort(random.uniform(0, 60, 30))]
    images = [robot._replace(x_cm=-robot.x_cm, light=40.0) for robot in robots[::2]]
    assert count_images(FlashTable.of(robots)) == 0
    assert count_images(FlashTable.of(sorted(robots + images))) == len(images)


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


def test_a_robot_is_as_fast_in_a_slow_film_and_touches_none() -> None:
    linker = FlashLinker()
    for number, place in enumerate([10.0, 14.2, 18.4, 24.5]):
        linker.add(number / 3, [ring(place)])
    assert [(flash.onset_s, flash.end_s) for flash in linker.flashes] == [(0, 1), (1, 1)]


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
