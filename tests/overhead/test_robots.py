"""Who is who in a film: by how robots move from flash to flash or by tags on top of them, and the tables of it."""

import math
from itertools import permutations
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead import identities
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.flashes import Flash, FlashLinker, FlashTable
from epuck_sim.overhead.identities import SURE, Habits, commonest_speed, link_flashes, ways_between
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.robots import Robots, find_robots, order_of_shares
from epuck_sim.overhead.tags import Readings, TagReader
from epuck_sim.overhead.track import Track
from tests.overhead.cameras import make_renderer, painted
from tests.overhead.films import TRACK, even
from tests.runs.made_folders import rows

FLOOR_CM = (60.0, 60.0)
PERIOD_S = 5.0


def straight(places, velocities, phases_s, cycles: int) -> tuple[FlashTable, IntArray]:
    """Return the flashes of robots that drive straight ahead, in order of their onsets, and whose they are."""
    robots = len(places)
    onsets = (phases_s + PERIOD_S * np.arange(cycles)[:, None]).ravel()
    whose = np.tile(np.arange(robots), cycles)
    at = places[whose] + onsets[:, None] * velocities[whose]
    order = np.argsort(onsets, kind="stable")
    table = FlashTable(onsets[order], onsets[order] + 0.4, at[order], velocities[whose[order]], onsets[order])
    return table, whose[order]


def test_robots_that_cross_in_step_are_told_apart_by_their_velocities_and_others_linked_with_half_a_certainty() -> None:
    places = np.array([(10.0, 30.0), (50.0, 31.0), (30.0, 8.0)])
    velocities = np.array([(1.5, 0.0), (-1.5, 0.0), (0.0, 1.5)])
    flashes, whose = straight(places, velocities, np.zeros(3), 5)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    assert found.robots == 3
    for robot in range(3):
        assert len(set(found.robot[whose == robot])) == 1
        assert found.cycle[whose == robot].tolist() == [1, 2, 3, 4, 5]
    assert found.unsure == 0
    assert found.speed_cm_s == pytest.approx(1.5)
    # two robots that stand 1 cm apart and flash at once: neither place nor time tells
    places = np.array([(30.0, 30.0), (30.3, 30.0), (10.0, 10.0)])
    flashes, _ = straight(places, np.zeros((3, 2)), np.array([0.0, 0.0, 2.0]), 6)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    is_twin = flashes.places_cm[:, 0] > 20
    certainty = found.certainty[~np.isnan(found.certainty)]
    assert len(certainty) == 15
    assert (found.certainty[is_twin & (found.cycle > 1)] < SURE).all()
    assert (found.certainty[~is_twin & (found.cycle > 1)] > SURE).all()
    assert found.unsure == pytest.approx(10 / 15)


def test_a_flash_that_is_missed_does_not_make_another_robot_but_one_too_far_away_does() -> None:
    places = np.array([(10.0, 10.0), (45.0, 15.0), (30.0, 45.0)])
    flashes, whose = straight(places, np.full((3, 2), 0.1), np.array([0.0, 1.5, 3.0]), 8)
    keep = np.arange(len(whose)) != np.flatnonzero(whose == 1)[3]
    found = link_flashes(FlashTable(*(column[keep] for column in flashes)), PERIOD_S, FLOOR_CM)
    assert found.robots == 3
    assert found.cycle[whose[keep] == 1].tolist() == [1, 2, 3, 4, 5, 6, 7]
    moved = flashes.places_cm.copy()
    moved[np.flatnonzero(whose == 0)[2:]] += (0.0, 30.0)  # someone carried it
    found = link_flashes(flashes._replace(places_cm=moved), PERIOD_S, FLOOR_CM)
    assert found.robots == 4
    assert len(set(found.robot[whose == 1])) == 1


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=8)
def test_a_long_film_is_linked_in_parts_as_whole(seed: int) -> None:
    generator = np.random.default_rng(seed)
    grid = np.array([(x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 50.0)])
    phases = np.sort(generator.uniform(0, 5, 6))
    flashes, whose = straight(grid, generator.normal(0, 0.02, (6, 2)), phases, 30)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    assert found.robots == 6
    assert all(len(set(found.robot[whose == robot])) == 1 for robot in range(6))


@settings(max_examples=40)
@given(st.lists(st.lists(st.floats(-5, 0), min_size=4, max_size=4), min_size=1, max_size=4))
def test_links_cost_least(costs: list[list[float]]) -> None:
    rows, flashes = len(costs), len(costs) + 4
    table = np.zeros((flashes, flashes))
    table[:rows, rows:] = costs
    source, target = np.nonzero(table)
    given_costs = source, target, table[source, target]
    parts, links = (identities._link(np.arange(float(flashes)), given_costs, block_s) for block_s in (2.0, 20.0))
    total = sum(table[source, target] for source, target in enumerate(links) if target >= 0)
    least = min(sum(costs[row][target] for row, target in enumerate(each)) for each in permutations(range(4), rows))
    assert total == pytest.approx(least)
    for taken in (parts[parts >= 0].tolist(), links[links >= 0].tolist()):
        assert len(set(taken)) == len(taken)


def test_a_flash_that_follows_one_long_before_or_after_is_no_alternative() -> None:
    links, onset_s = np.array([2, 3, -1, -1]), np.array([0.0, 5.0, 6.0, 7.0])
    costs = np.array([0, 0, 1]), np.array([2, 3, 3]), np.full(3, -5.0)
    certainty = identities._certainties(links, costs, onset_s, 1.0)
    assert certainty == pytest.approx([np.nan, np.nan, 1 / (1 + np.exp(-5)), 1 / (1 + np.exp(-5))], nan_ok=True)


def table(*rows: tuple[float, float, float, float, float]) -> FlashTable:
    """Return flashes with an onset, a place and a velocity each."""
    return FlashTable.of([Flash(at, at + 0.4, x, y, at, *velocity) for at, x, y, *velocity in rows])


def test_a_way_is_straight_or_has_a_turn_no_faster_than_robots_drive_and_cycles_and_speeds_are_learnt() -> None:
    flashes = table((0, 10, 10, 2, 0), (5, 20, 10, 2, 0), (5, 20, 13, 2, 0), (5, 17, 10, 2, 0))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.zeros(3, int), np.arange(1, 4), habits)
    assert habits.speed_cm_s == 2
    assert ways.along == pytest.approx([0, 0, -3])
    assert ways.aside == pytest.approx([0, 3, 0])
    assert ways.swerve == pytest.approx(0)
    assert ways.distance == pytest.approx([10, math.hypot(10, 3), 7])
    assert np.argmax(habits.log_likelihood(ways)) == 0
    # 2 s ahead to (14, 10), a turn of 1 s to the left, and 2 s upwards
    flashes = table((0, 10, 10, 2, 0), (5, 14, 14, 0, 2))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.array([0]), np.array([1]), habits)
    assert ways.has_turn.all()
    assert ways.turn_s == pytest.approx(1.0)
    assert ways.swerve == pytest.approx(math.pi / 2)
    assert ways.wall_s == pytest.approx((60 - 3.7 - 10) / 2, abs=0.1)
    assert not ways_between(flashes, np.array([1]), np.array([0]), habits).has_turn.any()
    flashes = table((0, 10, 10, 1, 0), (5, 14, 10, -0.5, 1), (5, 50, 50, 1, 0))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    near, far = habits.log_likelihood(ways_between(flashes, np.zeros(2, int), np.array([1, 2]), habits))
    assert far < near - 50
    flashes = table(*((5 * k * 0.8, 10 + 0.1 * k, 30, 0.02, 0) for k in range(12)))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.arange(11), np.arange(1, 12), habits)
    learnt = habits.relearnt(ways)
    assert (learnt.log_likelihood(ways) - habits.log_likelihood(ways) > 1).all()
    assert learnt.kinds.sum() == pytest.approx(1)
    generator = np.random.default_rng(0)
    straight, turning = generator.normal(3, 0.2, 200), generator.uniform(0, 2.5, 150)
    assert commonest_speed(np.concatenate([straight, turning])) == pytest.approx(3, rel=0.02)
    assert commonest_speed(np.full(5, 1.5)) == 1.5
    assert commonest_speed(np.zeros(5)) == 0


POSES = np.array([(8.0, 9.0, 0.4), (27.0, 10.0, 2.0), (10.0, 27.0, -3.0), (26.0, 26.0, -1.1)])
TIMES = np.arange(60) / 10


def test_tags_are_read_where_robots_are_and_gathered() -> None:
    for lit, in_the_light, tilt_deg in [((1,), False, 15.0), ((), False, 0.0), ((0, 2), True, 0.0), ((), True, 0.0)]:
        settings = {"width_px": 240, "height_px": 240, "tags": "4X4_50", "ambient": 0.2, "tilt_deg": tilt_deg}
        camera, renderer = make_renderer(make_arena(36, 36, [], []), **settings)
        samples = [ExposureSample(POSES, np.isin(range(4), lit))]
        picture = painted(renderer, samples, in_the_light)
        reader = TagReader(camera, "4X4_50")
        reader.read(Frame(0.0, picture))
        found = reader.readings(0.0)
        assert found.number.tolist() == [0, 1, 2, 3]
        assert np.hypot(*(found.poses - POSES)[:, :2].T).max() < 0.15
        assert np.abs(np.exp(1j * found.poses[:, 2]) - np.exp(1j * POSES[:, 2])).max() < 0.06
    for time_s, shown_then in ((1.0, picture), (2.0, np.zeros_like(picture)), (3.0, picture)):
        reader.read(Frame(time_s, shown_then))
    readings = reader.readings(1.0)
    assert readings.time_s.tolist() == [1] * 4 + [3] * 4
    assert readings.number.tolist() == [0, 1, 2, 3] * 2
    assert readings.poses.shape == (8, 3)


def read(numbers=(4, 7), without=()) -> Readings:
    """Return readings of robots that drive along x, but for those of (time, number)."""
    seen = [(time, *each) for time in TIMES for each in enumerate(numbers) if (round(time, 1), each[1]) not in without]
    columns = np.array([(t, number, 5.0 + t + 10 * row, 10.0, 3.1 + 0.1 * t) for t, row, number in seen])
    return Readings(columns[:, 0], columns[:, 1].astype(int), columns[:, 2:])


def track(*flashes: tuple[float, float], **options) -> Track:
    """Return a track with flashes at times, of robots that were at x 0 s after the start."""
    made = tuple(Flash(time, time + 0.3, x + time + 0.15, 10.3, 80.0) for time, x in flashes)
    return TRACK._replace(flashes=made, times_s=TIMES, start_s=0.0, options=TRACK.options._replace(**options))


def test_flashes_are_those_of_the_tags_above_them() -> None:
    dark = {(round(0.1 * k, 1), 7) for k in range(20, 26)}  # unread while lit
    tracked = track((1.0, 5.0), (2.1, 15.0), (2.2, 5.0), (3.0, 5.0), (5.9, 40.0), robots=2)
    robots = find_robots(tracked._replace(tags=read(without=dark)))
    assert robots.warnings == ()  # the last flash may be one frame of a flash
    assert robots.numbers.tolist() == [4, 7]
    table = robots.flash_columns()
    assert table["robot"].tolist() == [4, 7, 4, 4, -1]
    assert table["cycle"].tolist() == [1, 1, 2, 3, 1]
    assert table["certainty"] == pytest.approx([np.nan, np.nan, 1, 1, np.nan], nan_ok=True)
    trace = robots.trace_columns()
    own = {name: column[trace["robot"] == 7] for name, column in trace.items()}
    assert own["x_cm"] == pytest.approx(15 + TIMES)  # also where it was not read
    assert own["heading_rad"] == pytest.approx(3.1 + 0.1 * TIMES)
    assert own["ring_on"].sum() == 3
    assert robots.summary()["by"] == "tags"


def test_where_tags_are_unread_or_seen_twice_and_which_are_unknown_seldom_or_missing_is_said() -> None:
    gap = {(round(0.1 * k, 1), 4) for k in range(20, 40)}
    robots = find_robots(track((3.0, 5.0))._replace(tags=read(without=gap)))
    assert robots.poses is not None
    assert np.isnan(robots.poses[20:40, 0]).all()
    assert not np.isnan(robots.poses[:20, 0]).any()
    assert robots.identities.robot.tolist() == [-1]
    (warning,) = robots.warnings
    assert warning.startswith("flashes that are under no tag: 1 of 1; some robots have no tag")
    other = read(numbers=(4,))
    there = other._replace(poses=other.poses + 20)
    double = Readings(*(np.concatenate([a, b[:20]]) for a, b in zip(read(), there, strict=True)))
    robots = find_robots(track((1.0, 5.0))._replace(tags=double))
    assert "tag 4 is seen twice in 20 frames, and left out there" in robots.warnings[0]
    assert robots.poses is not None
    assert np.isnan(robots.poses[:19, 0]).all()
    assert robots.poses[30, 0, 0] == pytest.approx(8)
    seldom = Readings(np.array([1.0]), np.array([33]), np.zeros((1, 3)))
    both = Readings(*(np.concatenate(columns) for columns in zip(read(), seldom, strict=True)))
    (warning,) = find_robots(track()._replace(tags=both)).warnings
    assert warning == "tags that are read in less than 2 % of the frames, and are left out: 33"
    found = find_robots(track(robots=5, tag_numbers=frozenset({4, 5}))._replace(tags=both)).warnings
    assert found == (
        "tags that are not among those given, and are left out: 7",
        "tags that are never read: 5",
        "robots whose tags are read: 1, but there are 5",
    )
    with pytest.raises(FilmError, match=r"^film.mp4: no tag is read, or all are seen twice; check the dictionary"):
        find_robots(track(tag_numbers=frozenset({8}))._replace(tags=both))


CYCLES = 6
HOMES = np.array([(10.0, 10.0), (45.0, 15.0), (30.0, 45.0)])


def track_of(phases_s: list[float], cycles: int = CYCLES) -> Track:
    """Return what is found in a film of robots that drive at 0.5 cm/s and flash at phases of a period of 1 s."""
    onsets = [(k, k + phase, *home) for k in range(cycles) for phase, home in zip(phases_s, HOMES, strict=True)]
    flashes = [Flash(at, at + 0.1, x + 0.5 * k, y, 80.0, 0.5, 0.0) for k, at, x, y in onsets]
    return TRACK._replace(flashes=tuple(sorted(flashes)), times_s=even(cycles, 20), start_s=0.0)


def test_flashes_have_their_velocity() -> None:
    linker = FlashLinker()
    for number in range(8):
        linker.add(number / 10, [Ring(10 + 0.4 * number, 20 - 0.2 * number, 3.5, 0, 0, 5, 90)] * (number < 5))
    (flash,) = linker.flashes
    assert flash == pytest.approx((0.0, 0.5, 10.8, 19.6, 90.0, 4.0, -2.0))
    linker = FlashLinker()
    linker.add(0.0, [Ring(10, 20, 3.5, 0, 0, 5, 90)])
    assert linker.flashes[0][5:] == (0, 0)


def test_a_trace_tells_what_is_seen_until_the_last_frame_and_leaves_out_what_is_not() -> None:
    track = track_of([0.1, 0.4, 0.7])
    table = find_robots(track).trace_columns()
    assert list(table) == ["time_s", "robot", "x_cm", "y_cm", "heading_rad", "ring_on", "phase_ms"]
    assert len({len(column) for column in table.values()}) == 1
    own = {name: column[table["robot"] == 1] for name, column in table.items()}
    assert len(own["time_s"]) == len(track.times_s)
    assert own["ring_on"].sum() == 2 * CYCLES
    assert (np.isnan(own["x_cm"]) == ~own["ring_on"]).all()
    assert np.isnan(own["heading_rad"]).all()
    assert own["y_cm"][own["ring_on"]] == pytest.approx(15)
    first, second = own["x_cm"][own["ring_on"]][:2]
    assert second - first == pytest.approx(0.5 * 0.05)
    at = own["time_s"] >= 0.4 - 1e-9
    assert np.isnan(own["phase_ms"][~at]).all()
    # the threshold of a period of 1 s: from one flash to the next in 1000 ms
    assert own["phase_ms"][at] == pytest.approx(1000 * ((own["time_s"][at] - 0.4 + 1e-9) % 1), abs=1e-3)
    last_s = float(track.times_s[-1])
    late = Flash(last_s, last_s, 30.0, 45.0, 80.0)
    track = track._replace(flashes=(*(flash for flash in track.flashes if flash.onset_s < last_s - 0.5), late))
    table = find_robots(track).trace_columns()
    is_last = table["time_s"] == last_s
    assert table["ring_on"][is_last].sum() == 1
    assert table["y_cm"][is_last & table["ring_on"]] == pytest.approx(45)


def test_flashes_tell_whose_they_are_and_the_order_of_phases_but_for_those_that_the_first_frame_shows() -> None:
    track = track_of([0.5, 0.5, 0.52])
    robots = find_robots(track)
    table = robots.flash_columns()
    assert table["robot"].tolist()[:3] == [0, 1, 2]
    assert np.isnan(table["order_parameter"]).tolist() == [False] * 15 + [True] * 3  # the film ends before its period
    assert sorted(table["cycle"].tolist()) == sorted([*range(1, CYCLES + 1)] * 3)
    assert np.isnan(table["certainty"]).sum() == 3
    assert np.nanmin(table["certainty"]) > 0.95
    assert table["phase_order_parameter"][-1] == pytest.approx(np.abs(np.exp(2j * np.pi * 0.02) + 2) / 3, abs=1e-6)
    found = robots._replace(track=track._replace(start_s=0.1)).summary()
    assert (found["by"], found["robots"], found["links"], found["unsure_share"]) == ("motion", [0, 1, 2], 15, 0)
    assert found["by_phases_s"] == pytest.approx(0.42)
    assert found["pairs_together"] == 3
    apart = track_of([0.1, 0.1, 0.3])  # with an order parameter of 0.832
    for asked, is_met in ((None, False), (0.83, True), (0.84, False)):
        track = apart._replace(options=apart.options._replace(order_parameter=asked))
        assert (find_robots(track).summary()["by_phases_s"] is not None) == is_met
    assert robots.pair_columns()["share"].tolist() == [1, 1, 1]
    track = track_of([0.0, 0.0, 0.0])
    robots = find_robots(track)
    phases_ms = robots.trace_columns()["phase_ms"].reshape(-1, 3)
    assert np.isnan(phases_ms[track.times_s < 1]).all()
    assert phases_ms[track.times_s == 1.5] == pytest.approx(500)
    assert np.isnan(robots.flash_columns()["phase_order_parameter"]).tolist() == [True] * 3 + [False] * 15
    assert robots.summary()["by_phases_s"] == pytest.approx(1)


def test_what_is_doubtful_is_said() -> None:
    track = track_of([0.1, 0.4, 0.7])
    told = track._replace(options=track.options._replace(robots=4))
    assert find_robots(track).warnings == ()
    (warning,) = find_robots(told).warnings
    assert warning == "flashes are linked to 3 robots, but there are 4: lost ones are counted anew"
    together = enumerate(track_of([0.1] * 3).flashes)
    close = tuple(flash._replace(x_cm=20.0 + 0.1 * (index % 3), y_cm=20.0) for index, flash in together)
    (warning,) = find_robots(track._replace(flashes=close)).warnings
    assert " % of the links from flash to flash have an alternative that is nearly as good" in warning


def test_tables_are_written_as_csv_and_as_parquet_alike_without_rows_for_a_film_without_flashes(tmp_path: Path) -> None:
    track = track_of([0.1, 0.4, 0.7])
    robots = find_robots(track)
    robots.save(tmp_path / "f.csv", tmp_path / "t.parquet", tmp_path / "p.csv")
    robots.save(tmp_path / "f.parquet", tmp_path / "t.csv", None)
    for name, expected in (("f", robots.flash_columns()), ("t", robots.trace_columns())):
        written, texts = pq.read_table(tmp_path / f"{name}.parquet"), rows(tmp_path / f"{name}.csv")
        assert written.column_names == list(texts[0]) == list(expected)
        for column, values in expected.items():
            kept = np.array([np.nan if value is None else value for value in written[column].to_pylist()], float)
            assert kept == pytest.approx(values.astype(float), nan_ok=True)
            words = [{"": "nan", "true": "1", "false": "0"}.get(row[column], row[column]) for row in texts]
            assert np.array(words, float) == pytest.approx(values.astype(float), nan_ok=True, rel=1e-5, abs=1e-6)
    assert written.schema.metadata[b"film"] == b"film.mp4"
    assert link_flashes(FlashTable.of(()), PERIOD_S, FLOOR_CM)[::3] == (pytest.approx(np.empty(0)), 0)
    assert link_flashes(table((1, 30, 30, 0, 0)), PERIOD_S, FLOOR_CM).robot.tolist() == [0]
    robots = find_robots(TRACK._replace(flashes=()))
    for ending in ("csv", "parquet"):
        robots.save(*(tmp_path / f"{name}.{ending}" for name in "ftp"))
    assert (tmp_path / "t.csv").read_text() == "time_s,robot,x_cm,y_cm,heading_rad,ring_on,phase_ms\n"
    assert robots.summary()["by_phases_s"] is None


def robots_of(onsets_s: FloatArray, whose: IntArray, count: int, start_s: float = 0.0) -> Robots:
    """Return robots with flashes of 0.1 s and a period of 1 s, in a film that begins at a time."""
    flashes = FlashTable.of([Flash(onset_s, onset_s + 0.1, 0.0, 0.0, 9.0) for onset_s in onsets_s])
    who = identities.Identities(whose, whose, onsets_s, 1.0)
    return Robots(TRACK._replace(times_s=start_s + TIMES), "tags", flashes, who, np.arange(count), None, ())


def test_phases_rise_from_flash_to_flash_with_an_order_parameter_and_pairs_flash_at_once() -> None:
    onsets, robot = np.array([0.0, 0.5, 1.0, 1.4, 2.0, 2.4, 4.0]), np.array([0, 1, 0, 1, 0, 1, 0])
    times, nan = np.array([0.0, 0.25, 0.5, 0.95, 2.2, 2.5, 3.0, 4.5, 5.5]), np.nan
    shares = robots_of(onsets, robot, 3, start_s=-1.0).phases(times)
    assert np.isnan(shares[:, 2]).all()  # it never flashes
    # robot 0 was not seen for two periods from 2.0 on; robot 1 flashed early, and last at 2.4
    assert shares[:, 0] == pytest.approx([0, 0.25, 0.5, 0.95, nan, nan, nan, 0.5, nan], nan_ok=True)
    assert shares[:, 1] == pytest.approx([nan, nan, 0, 0.5, 0.8, 0.1, 0.6, nan, nan], nan_ok=True)
    shares = np.array([[0.1, 0.2, 0.3, 0.9], [0.5, 0.5, 0.5, nan], [0.5, 0.5, nan, nan]])
    order = order_of_shares(shares)
    assert order[0] == pytest.approx(float(order_parameter(shares[0], 1.0)))
    assert order[1] == pytest.approx(1)  # three of four are enough
    assert np.isnan(order[2])
    onsets = np.array([0.0, 0.05, 0.5, 1.0, 1.2, 1.5, 2.0, 2.05])
    table = robots_of(onsets, np.array([0, 1, 2, 0, 1, 2, 0, 1]), 4).pair_columns()
    pairs = list(zip(table["robot"].tolist(), table["other"].tolist(), strict=True))
    assert pairs == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    assert (table["flashes"][0], table["together"].tolist()) == (3, [2, 0, 0, 0, 0, 0])
    assert table["share"][0] == pytest.approx(2 / 3)
