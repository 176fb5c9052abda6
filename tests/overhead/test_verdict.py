"""Rings are counted and linked to flashes, the counts of a whole film analysed, and an answer trusted or doubted."""

import json
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from epuck_sim import epuck, load_scenario, run_trial
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead import flashes, verdict
from epuck_sim.overhead.calibration import DESCRIPTION, TrackOptions
from epuck_sim.overhead.camera import CORNERS, Frame, Light
from epuck_sim.overhead.compare import track_trial
from epuck_sim.overhead.flashes import CountedRings, Flash, FlashLinker, FlashTable, LightMeter, RingCounter
from epuck_sim.overhead.rings import DISC_LIGHT, Ring, is_lit
from epuck_sim.overhead.synchrony import evaluate, is_synchronised, spread_threshold_s
from epuck_sim.overhead.track import Track, analyse, track_frames, without_steady
from epuck_sim.overhead.verdict import Evidence, doubts, may_be_half_a_period, objections, why_never
from epuck_sim.trial.model import simulate
from tests.overhead.films import TRACK, counted, make_geometry, uneven

RATE = 30.0


class Coded:
    """A substitute for `RingFinder` that reads the number of rings from the first pixel.

    The ring that went on first goes off first, and each that goes on is at another place.
    """

    def __init__(self, *_: object, **__: object) -> None:
        self._lit: list[int] = []
        self._next = 0

    def find(self, levels: Light, **_: object) -> list[Ring]:
        count = int(levels[0, 0])
        self._lit = self._lit[max(0, len(self._lit) - count) :]
        while len(self._lit) < count:
            self._lit.append(self._next)
            self._next += 1
        return [Ring(1 + 5 * (place % 11), 1 + 5 * (place // 11 % 11), 3.5, 10, 10, 5) for place in self._lit]


def coded(times_s: Iterable[float], counts: Iterable[int], lit_room: Iterable[bool]) -> Iterator[Frame]:
    for time_s, count, lit in zip(times_s, counts, lit_room, strict=True):
        picture = np.zeros((16, 16, 3), np.uint8)
        picture[:] = 200 * lit
        picture[0, 0, 2] = count
        yield Frame(float(time_s), picture)


@pytest.fixture(autouse=True, scope="module")
def _rings_are_coded() -> Iterator[None]:
    """Have counters take the rings that `coded` writes into frames."""
    where = "epuck_sim.overhead.flashes"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{where}.RingFinder", Coded)
        patch.setattr(f"{where}.Background.light_beyond", lambda _, shot: (shot.picture[:, :, 2], is_lit(shot.colours)))
        patch.setattr(f"{where}.LightMeter.lit_px", lambda *_: 0)
        yield


def make_counter() -> RingCounter:
    return RingCounter(make_geometry()._replace(knows_floor=False))


def analysed(times_s: Any, counts: Any, options: TrackOptions = TrackOptions(), lit_until_s: float = 0.0) -> Track:  # noqa: B008
    counter = make_counter()
    for frame in coded(times_s, counts, np.asarray(times_s) < lit_until_s):
        counter.process(frame)
    return analyse("film", counter.counted(), options, ("first",))


def swarm(from_s: float = 3.0) -> tuple[FloatArray, IntArray]:
    """Return times and counts of six robots of a period of 1 s that flash for 0.1 s, and together from a time on."""
    times_s, cycles = np.arange(240) / RATE, np.arange(-1, 9)[:, None]
    return times_s, counted(cycles + np.where(cycles + 1 < from_s, 0.5 + np.arange(6) / 6, 0.5), 0.1, times_s)


def test_track_of_a_swarm_in_which_flashes_until_synchrony_count_for_each_robot() -> None:
    track = analysed(*swarm())
    assert (track.film, track.calibration, track.frames, track.robots_seen) == ("film", "somewhere", 240, 6)
    assert track.fps == pytest.approx(RATE)
    assert track.duration_s == pytest.approx(8)
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.flash_ms == pytest.approx(100, abs=5)
    assert track.threshold_ms == pytest.approx(1000 * spread_threshold_s(track.period_s, track.flash_ms / 1000))
    assert track.estimated == ("period_s", "threshold_ms")
    assert track.flashes_per_period == pytest.approx(51 / 8, rel=0.02)
    assert track.histogram_s == pytest.approx(2.55, abs=0.04) or track.histogram_s == pytest.approx(3.55, abs=0.04)
    assert track.histogram_periods == pytest.approx(track.histogram_s, rel=0.02)
    first, doubt = track.warnings
    assert (first, "2 s fits as well" in doubt) == ("first", True)  # no ring of these pictures has its own place
    assert analysed(*swarm(), TrackOptions(robots=6)).warnings == ("first",)
    assert json.loads(json.dumps(track.summary(), allow_nan=False))["robots_seen"] == 6
    times_s = np.arange(600) / RATE
    onsets = np.array([*(0.5 + 0.8 * np.arange(8)), *(7.1 + np.arange(13))])  # cycles are shortened at first
    both = np.where(np.arange(21) < 8, onsets + 0.3, onsets)
    track = analysed(times_s, counted(np.concatenate([onsets, both]), 0.1, times_s), TrackOptions(period_s=1.0))
    assert track.robots_seen == 2
    assert track.histogram_s == pytest.approx(7.15, abs=1 / RATE)
    assert track.t_sync_cycles == 9
    three = counted(np.concatenate([onsets, both, onsets[1:]]), 0.1, times_s)  # on average 8.7
    assert analysed(times_s, three, TrackOptions(period_s=1.0, robots=3)).t_sync_cycles == 9


def test_a_swarm_may_synchronise_never_or_late() -> None:
    times_s, counts = swarm(from_s=math.inf)
    track = analysed(times_s, counts, TrackOptions(period_s=1.0))
    assert (track.histogram_s, track.histogram_periods, track.t_sync_cycles) == (None, None, None)
    (reason,) = track.reasons
    assert track.confidence == "low"
    assert "the order parameter was" in reason
    assert reason.endswith("0.95 is needed")  # and no option that `track` refuses
    assert track.flashes_per_period == pytest.approx(6, rel=0.1)
    assert json.loads(json.dumps(track.summary(), allow_nan=False))["histogram_s"] is None
    times_s, counts = swarm(from_s=6.0)
    late = analysed(times_s, counts, TrackOptions(period_s=1.0, robots=6))
    assert (late.t_sync_s, late.confidence) == (pytest.approx(6.5, abs=0.6), "low")


@pytest.mark.parametrize("seed", [51, 52, 84, 155])
def test_a_film_that_ends_as_run_says_t_sync_is_too_short_to_tell(seed: int) -> None:
    scenario = load_scenario("thesis")
    end_s = run_trial(simulate(scenario, seed)).simulated_s
    film = TRACK._replace(fps=15.0, duration_s=end_s, options=TrackOptions(period_s=5.0, robots=10))
    track = track_trial(scenario, seed, film).track
    assert (track.t_sync_s, track.confidence, "ends too early to tell" in track.reasons[0]) == (None, "none", True)


def only_robots(flashes: Iterable[Flash], period_s: float | None = 1.0, by: str = "somewhere") -> tuple[Any, ...]:
    """Return what `without_steady` returns, for flashes of a film of 8 s."""
    times_s, ordered = np.arange(240) / RATE, tuple(sorted(flashes))
    counts, geometry = FlashTable.of(ordered).count_lit(times_s), make_geometry()._replace(calibration=by)
    return without_steady(CountedRings(240, times_s, counts, 0 * counts, ordered, geometry), period_s)


def test_a_lamp_that_flickers_is_no_robot_nor_a_dim_ring_where_none_fits_if_brightness_is_not_known() -> None:
    robots = [Flash(k + 0.5, k + 0.6, 10.0 + 8 * n + 0.7 * k, 20.0, 50.0) for k in range(8) for n in range(4)]
    lamp = [Flash(0.3 * k, 0.3 * k + 0.1, 50.0, 50.0, 90.0) for k in range(26)]
    others, left_out, without = only_robots(robots + lamp)
    assert (sorted(others), sorted(left_out)) == (sorted(robots), lamp)
    assert without.tolist() == FlashTable.of(sorted(robots)).count_lit(np.arange(240) / RATE).tolist()
    still = tuple(Flash(k + 0.5, k + 0.6, 10.0 + 8 * n, 20.0, 50.0) for k in range(8) for n in range(4))
    for kept in (tuple(robots), (*still, Flash(0.2, 0.3, 55.0, 55.0, 50.0))):
        assert only_robots(kept)[1] == []
    long, short = (Flash(4.0, 4.0 + lit_s, 55.0, 5.0, 50.0) for lit_s in (3.0, 1.0))
    assert only_robots((*robots, long, short), None)[1] == [long]
    robots = [flash(0.5, x_cm)._replace(light=light) for x_cm, light in ((20, 100.0), (30, 90.0), (57.5, 80.0))]
    at_wall, free = (flash(0.5, x_cm)._replace(light=9.0) for x_cm in (2.0, 4.0))
    for by, kept in ((DESCRIPTION, [free, *robots]), (CORNERS, [at_wall, free, *robots])):
        found, steady, without = only_robots((*robots, free, at_wall), by=by)
        assert (list(found), steady, without.max()) == (kept, [], len(kept))


def test_order_parameter_decides_when_the_swarm_is_synchronised_and_is_named_if_track_takes_it() -> None:
    times_s = np.arange(300) / RATE
    off_s = np.where(np.arange(11) < 5, 0.05, 0.0)  # first half in step to 0.1 s, then wholly
    offsets = off_s[:, None] * np.array([-1, -1, 1, 1])
    counts = counted(np.arange(11)[:, None] + 0.5 + offsets, 0.06, times_s)
    strict, loose = (analysed(times_s, counts, TrackOptions(period_s=1.0, order_parameter=r)) for r in (0.9999, 0.9))
    assert loose.t_sync_s == pytest.approx(0.55, abs=0.05)
    assert strict.t_sync_s == pytest.approx(5.5, abs=0.1)
    for phases, is_named in (((0.1, 0.1, 0.1, 0.3), True), ((0.1, 0.1, 0.1, 0.35), False)):
        onsets = (np.arange(7)[:, None] + np.array(phases)).ravel()
        assert ("; --order-parameter" in why_never(evidence(onsets))) == is_named


def test_a_film_without_light_in_the_dark_is_refused_and_a_trial_of_two_frames_has_few_results() -> None:
    told = TrackOptions(period_s=1.0)
    for frames, lit in ((0, 0), (60, 30)):
        counts = np.where(np.arange(frames) < lit, 4, 0)
        with pytest.raises(FilmError, match=rf"^film: no lit ring is seen in {frames} frames;.* px in radius"):
            analysed(np.arange(frames) / RATE, counts, told, lit_until_s=(lit - 0.5) / RATE)
    with pytest.raises(FilmError, match=r"^film: its trial is one frame long"):
        analysed([0.0], [3], told)
    with pytest.raises(FilmError, match=r"from 0\.\d+ s of film \(the room seems lit until 1\.2 s: switch lamps off\)"):
        analysed(np.arange(60) / RATE, np.full(60, 3), lit_until_s=1.19)
    for counts in ([3, 3], [0, 3], [3, 0]):
        track = analysed([0.0, 0.1], counts, told)
        assert (track.histogram_s, track.evaluations) == (None, ())
        json.dumps(track.summary(), allow_nan=False)
        with pytest.raises(FilmError, match=r"^film: the period cannot be estimated from 0\.1 s of film.*--period-s$"):
            analysed([0.0, 0.1], counts)


def process_all(counts: list[int], is_lit: list[bool]) -> RingCounter:
    """Return a counter that has processed frames that are half a second apart."""
    counter = make_counter()
    for frame in coded(np.arange(len(counts)) / 2, counts, is_lit):
        assert len(counter.process(frame)) == frame.picture[0, 0, 2]
    return counter


def test_trial_begins_with_the_first_dark_frame_and_ctrl_c_leaves_as_many_counts_as_times(monkeypatch) -> None:
    counts = [3, 1, 4, 1, 5, 9]
    for lit, first in [
        ([True] * 5 + [False], 5),
        ([True] * 6, 0),
        ([False, True, True, False, False, False], 0),
        ([True, False, True, True, False, True], 1),
    ]:
        counter = process_all(counts, lit)
        found = counter.counted()
        assert (counter.start_s, found.times_s.tolist()) == (first / 2, (np.arange(first, 6) / 2).tolist())
        assert found.counts.tolist() == counts[first:]
    counter = process_all([1, 2], [False, False])

    monkeypatch.setattr(LightMeter, "lit_px", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        counter.process(next(coded([1.0], [3], [False])))
    counted = counter.counted()
    assert len(counted.times_s) == len(counted.counts) == len(counted.areas_px) == 2


@given(
    seed=st.integers(0, 2**32 - 1),
    together_s=st.floats(0, 8),
    lit=st.integers(0, 60),
    flickers=st.lists(st.integers(0, 179), max_size=3),
    threshold_s=st.floats(0.02, 0.2),
)
@settings(max_examples=12)
def test_tracking_frame_by_frame_agrees_with_analysis_of_whole_films(seed, together_s, lit, flickers, threshold_s):
    random = np.random.default_rng(seed)
    onsets = np.arange(-1, 12)[:, None] + 0.5 + random.uniform(-0.05, 0.05, 6)
    onsets = np.where(onsets < together_s, onsets + random.random(6), onsets)
    times_s = uneven(np.arange(180) / 15, random)
    counts = counted(onsets, 0.1, times_s)
    is_lit = np.arange(len(times_s)) < lit
    is_lit[[number for number in flickers if number < len(times_s)]] ^= True
    counter = make_counter()
    frames = coded(times_s, counts, is_lit)
    options = TrackOptions(period_s=1.0, threshold_ms=1000 * threshold_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FlashLinker, "lit_since", lambda *_: 0)
        tracked_frames = list(track_frames(frames, counter, 1.0, options))
    if not counter.counted().counts.any():
        return
    track = analyse("film", counter.counted(), options, ())
    assume(not track.steady)  # overlapping flashes may seem to be one ring that stays lit
    last = tracked_frames[-1]
    assert len(tracked_frames) == track.frames == len(times_s)
    assert last.start_s == track.start_s
    in_trial = [tracked for tracked in tracked_frames if tracked.frame.time_s >= track.start_s]
    assert [tracked.evaluation for tracked in in_trial if tracked.evaluation] == list(track.evaluations)
    if track.confidence != "none":
        assert track.histogram_s == (None if last.histogram_s is None else last.histogram_s - track.start_s)
    is_known = [tracked.histogram_s is not None for tracked in in_trial]
    assert is_known == sorted(is_known)


TIMES = np.arange(240) / 30
ONSETS = np.array([*(0.1 + np.arange(3)[:, None] + np.arange(4) / 5).ravel(), *np.repeat(3.5 + np.arange(4), 4)])


def flash(onset_s: float, x_cm: float, lasts_s: float = 0.1) -> Flash:
    return Flash(onset_s, onset_s + lasts_s, x_cm, 20.0, 50.0)


IN_TURN = (0.1 + np.arange(6)[:, None] + np.arange(4) / 5).ravel()


def evidence(onsets=ONSETS, *, flash_s: float = 0.1, apart_cm: float = 12.0, **changes) -> Evidence:
    """Return that of four robots of a period of 1 s that flash together from 3.5 s on."""
    flashes = tuple(flash(onset, 10.0 + apart_cm * (k % 4), flash_s) for k, onset in enumerate(onsets))
    unseen = CountedRings(240, TIMES, np.zeros(240, int), np.zeros(240, int), (), make_geometry())
    return seen(replace(Evidence(unseen, 0, 1.0, 0.05, None, 4, True), **changes), flashes, flash_s)


def seen(known: Evidence, flashes: tuple[Flash, ...], flash_s: float = 0.1, area=None) -> Evidence:
    """Return evidence with other flashes, and an area of 100 px for each of them or another one."""
    counts = counted(np.array([each.onset_s for each in flashes]), flash_s, TIMES)
    rings = known.counted._replace(counts=counts, areas_px=100 * counts if area is None else area, flashes=flashes)
    found = evaluate(TIMES, counts, known.period_s)
    sync = next((each for each in found if is_synchronised(each, known.threshold_s)), None)
    return replace(known, counted=rings, sync=sync)


def filmed(**changes) -> Evidence:
    """Return evidence with changes to what was counted."""
    given = evidence()
    return replace(given, counted=given.counted._replace(**changes))


def cycles_of(cycle_s: float) -> Evidence:
    """Return evidence of robots that flash in turn, with cycles of another length than the period."""
    onsets = np.sort((cycle_s * (np.arange(8 / cycle_s)[:, None] + np.arange(4) / 4)).ravel())
    return replace(evidence(onsets, flash_s=0.05), sync=None)


@pytest.mark.parametrize(("given", "reason"), [
    (evidence(), ""), (evidence(robots=None), ""),
    # coupling shortens cycles, and nothing lengthens them by much
    (cycles_of(0.7), ""), (cycles_of(0.54), ""),
    *((cycles_of(cycle_s), "per period, but there are 4 robots: check --robots") for cycle_s in (0.5, 1.7)),
    (cycles_of(1.7), "whether rings are burnt out or dim, or not 10 to 16 px in radius, lit up to half of it wide"),
    (evidence(robots=3), "4 rings were lit at once"),
    (evidence(robots=9), "flashes per period, but there are 9"),
    (evidence([*IN_TURN, 6.5, 6.5]), "the narrow histogram holds 2 flashes, but there are 4 robots; check --robots"),
    (evidence([*IN_TURN, 6.5, 6.5, 6.5]), ""),
    *(
        (replace(evidence(), period_s=9.0, robots=robots), "no whole period of 9 s was seen; check --period-s, or film")
        for robots in (None, 4, 1)
    ),
    # what shines is together where rings are not
    (filmed(areas_px=100 * counted(0.5 + np.arange(8).repeat(4), 0.1, TIMES)), "total light is synchronised at 0.6 s"),
    (filmed(areas_px=evidence().counted.areas_px + 5000), ""),  # a lamp
])  # fmt: skip
def test_what_does_not_add_up_is_objected(given: Evidence, reason: str) -> None:
    found = objections(given)
    assert len(found) == bool(reason)
    assert all(reason in each for each in found)


@pytest.mark.parametrize(("moves_cm", "known", "doubted"), [(9, {}, True), (3, {}, False), (9, {"robots": 1}, False)])
def test_the_double_period_is_doubted_where_robots_move_too_far_to_tell(moves_cm, known, doubted) -> None:
    flashes = tuple(flash(0.5 + k, float(moves_cm * k)) for k in range(8))
    given = replace(seen(evidence(robots=None, period_is_given=False), flashes), **known)
    assert may_be_half_a_period(given) == doubted
    assert not may_be_half_a_period(replace(given, period_is_given=True))


def test_places_that_flash_in_turn_are_noticed_and_two_groups_are_no_swarm_in_step_from_the_beginning() -> None:
    for turns in (1, 2):
        places = tuple(flash(0.5 * k, 10.0 + 25 * (k % turns)) for k in range(16))
        given = seen(evidence(robots=None, period_is_given=False, period_s=0.5), places, area=0 * TIMES)
        found = [reason[:48] for reason in objections(given)]
        assert found == ["the same places flash again after two periods of"] * (turns == 2)
    onsets = 0.55 + np.repeat(np.arange(8), 3)
    flashes = tuple(flash(at, 20.0 + 12 * at + 2 * (k % 3)) for k, at in enumerate(onsets))
    given = seen(evidence(robots=None, period_is_given=False), flashes)
    (reason,) = objections(given)
    assert "the period is 2 s and two groups flash in turn" in reason
    assert objections(replace(given, robots=3)) == []


def burnt_out(number: int) -> Evidence:
    """Return evidence in which some flashes are discs."""
    flashes = evidence().counted.flashes
    return filmed(flashes=(*(each._replace(light=DISC_LIGHT) for each in flashes[:number]), *flashes[number:]))


def described(size: float) -> Evidence:
    """Return evidence of a film whose rings are not as large as its description has them, as it was scaled since."""
    ring = Ring(30.0, 30.0, size * epuck.RING_RADIUS_CM, 0.0, 0.0, 0.0, 100.0)
    return filmed(geometry=make_geometry()._replace(ring_size=math.nan), rings=[[ring]])


NEARLY = np.sort([*(k + np.array([0.5, 0.5, 0.6, 0.6]) for k in range(7))], axis=None)
CUT = np.where(np.arange(len(TIMES)) % 3 == 0, 0, evidence().counted.counts)  # without each third frame
MISSED = [onset for k, onset in enumerate(ONSETS) if onset > 3 or k % 5]
SHOWN = evidence(robots=None, period_is_given=False)
IN_STEP = evidence(np.repeat(0.5 + np.arange(7), 4))


@pytest.mark.parametrize(("given", "doubt"), [
    (evidence(), ""), (evidence(robots=None), ""), (SHOWN, ""), (burnt_out(4), ""),
    (filmed(geometry=make_geometry()._replace(ring_size=1.05)), ""),
    (filmed(geometry=make_geometry()._replace(tilt_deg=9.0)), ""),  # by the corners
    (evidence(period_s=100.0), ""),
    (IN_STEP, "are in step from the film's beginning, which may be after T_sync; film robots from their start"),
    (replace(IN_STEP, counted=IN_STEP.counted._replace(frames=300)), ""),  # it began in the light, before the trial
    (evidence([0.1, 0.3, 0.5, 0.8, *np.repeat(1.55 + np.arange(6), 4)]), ""),
    (replace(evidence(), lit_always=2), "left out: 2; check --period-s, or leave out lamps"),
    (filmed(outside=7), "rings outside of the floor, and left out: 7 in 240 frames"),
    (burnt_out(5), "burnt out to discs: 5 of 28;"),
    (filmed(areas_px=100 * counted(0.1 + np.arange(40) / 5, 0.1, TIMES)), "total light is spread"),
    (filmed(counts=CUT), "% of the light is from no ring"),
    *((filmed(geometry=make_geometry()._replace(ring_size=size)), "times as large as") for size in (0.88, 1.12)),
    *((described(size), "times as large as they") for size in (0.9, 1.12)),
    (described(0.95), ""),
    (filmed(geometry=make_geometry()._replace(tilt_deg=3.0, knows_floor=False)), "seems to be tilted by 3 degrees"),
    (evidence(MISSED), "some are missed"),
    (evidence(robots=5), "synchronised swarm, 4 at T_sync, but there are 5 robots: check --robots"),
    (evidence(robots=3), "4 flashes are seen in a period of the synchronised swarm, 4 at T_sync, but there are 3"),
    (filmed(times_s=np.delete(TIMES, range(30, 36))), "gaps longer than 1.5 times the usual 33.3 ms between frames: 1"),
    (evidence(flash_s=0.04), "frames come every 33.3 ms, too seldom"),
    (evidence(NEARLY), "frames come every 33.3 ms, too seldom"),
    (evidence(np.delete(ONSETS, [14, 17, 22]), robots=None), "3 to 4 flashes are seen in a period of the synchronised"),
    *((replace(SHOWN, period_s=each), f"hardly flash every {each:g} s; check --fps") for each in (0.02, 100.0)),
    *((evidence(period_s=each), "robots flash every 1 s, not every") for each in (0.8, 1.1)),
    (evidence(robots=None, period_s=2.0), "flash every 1 s, not every 2 s: check --period-s and --fps, or give"),
    (replace(SHOWN, period_s=2.5), "is estimated from only 3.2 periods of film; better give --period-s"),
])  # fmt: skip
def test_what_is_doubtful_is_said(given: Evidence, doubt: str) -> None:
    found = doubts(given)
    assert any(doubt in each for each in found) if doubt else not found, found


@pytest.mark.parametrize("given", [filmed(counts=CUT), filmed(dazzled=0.1), evidence(lit_always=2), evidence(MISSED)])
def test_corners_that_are_given_are_not_asked_for(given: Evidence) -> None:
    geometry = make_geometry()._replace(calibration=CORNERS)
    (found,) = doubts(replace(given, counted=given.counted._replace(geometry=geometry)))
    assert "--corners" not in found


def test_mirror_images_and_places_are_counted_and_rings_linked_across_a_frame_that_misses_one() -> None:
    random = np.random.default_rng(0)
    robots = [Flash(t, t + 0.3, *random.uniform(5, 55, 2), 80.0) for t in np.sort(random.uniform(0, 60, 30))]
    images = [robot._replace(x_cm=-robot.x_cm, light=40.0) for robot in robots[::2]]
    assert verdict.count_images(FlashTable.of(robots)) == 0
    assert verdict.count_images(FlashTable.of(sorted(robots + images))) == len(images)
    many = tuple(Flash(k / 8, k / 8 + 0.1, k % 61, k % 53, 50.0 + k % 2) for k in range(30_000))  # an hour of a swarm
    began = time.process_time()
    assert verdict.count_images(FlashTable.of(many)) == 0
    assert without_steady(filmed(flashes=many).counted, 1.0)[0] == many
    assert time.process_time() - began < 15  # comparing each with all others takes minutes
    assert flashes.count_places([(1.0, 1.0), (2.0, 1.0), (9.0, 9.0)]) == 2
    one, other = linked([10.0], [10.5, 30.0], [30.4], [11.0, 30.8], [], [], [], [])
    assert (one.onset_s, one.end_s, other.onset_s, other.end_s) == (0, 4, 1, 4)
    assert (one.x_cm, other.x_cm) == (pytest.approx(10.5), pytest.approx(30.4))
    assert FlashTable.of((one, other)).count_lit(np.arange(8.0)).tolist() == [1, 2, 2, 2, 0, 0, 0, 0]
    (last,) = linked([], [10.0], [10.0], [10.0])
    assert (last.onset_s, last.end_s) == (1, 3)
    assert FlashTable.of((last,)).count_lit(np.arange(4.0)).tolist() == [0, 1, 1, 1]
    slow = linked([10.0], [14.2], [18.4], [24.5], per_s=3.0)  # a robot is as fast in it, and touches none
    assert [(each.onset_s, each.end_s) for each in slow] == [(0, 1), (1, 1)]
    one, rest, other = (Flash(*each, 20.0, 9.0) for each in ((0, 1, 10), (1.5, 2, 11), (1.6, 2, 30)))
    late = rest._replace(onset_s=3.5, end_s=4.0)
    assert flashes.join_broken([one, rest, other, late], 1.0) == (one._replace(end_s=2), other, late)


def linked(*places_cm: list[float], per_s: float = 1.0) -> tuple[Flash, ...]:
    """Return the flashes of rings that are seen at places in frames."""
    linker = FlashLinker()
    for number, here in enumerate(places_cm):
        linker.add(number / per_s, [Ring(x_cm, 20.0, 3.5, 0.0, 0.0, 0.0, 9.0) for x_cm in here])
    return linker.flashes
