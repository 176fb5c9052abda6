"""The figure of a tracked film: which moments it shows, what stands beside it, and where it cannot be."""

from itertools import chain

import numpy as np
import pytest
from matplotlib import image
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Circle, StepPatch

from epuck_sim.figures.films import ACROSS, COLUMNS, FOUND, MARK, choose_moments, draw_track, save_track_figure
from epuck_sim.overhead.annotate import TrackedFrame
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.synchrony import evaluate, is_synchronised
from epuck_sim.overhead.track import Track
from tests.overhead.films import TRACK, counted, even, read_rings

PERIOD = 5.0
START = 2.0
THRESHOLD = 0.126


def make_track(cycles: int, narrow_from: int | None = None, seconds: float | None = None) -> Track:
    """Return the track of a film in which flashes are spread at first, and close together from some cycle on."""
    times = START + even(seconds or (cycles + 1) * PERIOD, 15.0)
    widths = [0.01 if narrow_from is not None and cycle >= narrow_from else 0.12 for cycle in range(cycles + 2)]
    onsets = [START + 3 + PERIOD * cycle + width * np.arange(10) for cycle, width in enumerate(widths)]
    counts = counted(np.array(onsets), 0.375, times)
    found = evaluate(times, counts, PERIOD)
    sync = next((each for each in found if is_synchronised(each, THRESHOLD)), None)
    after_s, periods = (None, None) if sync is None else (sync.time_s - START, (sync.time_s - START) / PERIOD)
    track = TRACK._replace(times_s=times, counts=counts, evaluations=tuple(found), period_s=PERIOD, start_s=START)
    return track._replace(threshold_ms=1000 * THRESHOLD, histogram_s=after_s, histogram_periods=periods)


RINGS = [Ring(0.0, 0.0, 3.5, 10.0, 20.0, 6.0), Ring(0.0, 0.0, 3.5, 40.0, 30.0, 6.5)]
PICTURE = TrackedFrame(Frame(9.0, np.zeros((48, 64, 3), np.uint8)), RINGS, START, None, None)
LONG = make_track(20, narrow_from=12)


def test_rows_are_the_first_period_then_evaluations_up_to_synchrony_and_after_it():
    rounded = LONG._replace(histogram_s=LONG.histogram_s * (1 + 1e-15))
    first, second, third = choose_moments(rounded)
    assert [now for now, _ in first] == [START + PERIOD * part for part in (0.25, 0.5, 0.75, 1)]
    found = list(LONG.evaluations)
    sync = [each.time_s for each in found].index(START + LONG.histogram_s)
    assert [evaluation for _, evaluation in third] == [found[number] for number in (sync - 1, sync, sync + 1, -1)]
    numbers = [found.index(evaluation) for _, evaluation in second]
    assert (len(numbers), numbers[0], numbers[-1]) == (ACROSS, 0, sync - 2)
    assert np.ptp(np.diff(numbers)) <= 1
    assert all(now_s - evaluation.time_s == PERIOD / 2 for now_s, evaluation in [*second, *third])


@pytest.mark.parametrize("cycles", [0, 1, 3, 4, 8])
def test_no_evaluation_is_shown_twice_and_short_films_show_fewer(cycles):
    for film in (make_track(cycles), make_track(cycles, narrow_from=0), make_track(cycles, narrow_from=cycles // 2)):
        _, second, third = choose_moments(film)
        shown = [evaluation for _, evaluation in [*second, *third]]
        assert shown == sorted(set(shown))
        assert len(shown) >= min(len(film.evaluations), ACROSS)
        if film.histogram_s is None:
            assert [evaluation for _, evaluation in third] == list(film.evaluations[-ACROSS:])


def panels(figure: Figure) -> list:
    return [axes for axes in figure.axes if axes.axison]


def test_snapshots_and_panels_show_counts_spreads_synchrony_the_threshold_and_rings_circled_in_green():
    figure = draw_track(LONG)
    *snapshots, counts, detector = panels(figure)
    for axes, (now_s, evaluation) in zip(snapshots, chain.from_iterable(choose_moments(LONG)), strict=True):
        lines = [each for each in axes.collections if to_hex(each.get_color()[0]) == MARK]
        places = sorted(segment[0][0] for line in lines for segment in line.get_segments())
        assert places == [-PERIOD, -PERIOD / 2, 0]
        (bars,) = [each for each in axes.patches if isinstance(each, StepPatch)]
        until = (LONG.times_s >= max(START, now_s - 1.3 * PERIOD)) & (LONG.times_s < now_s)
        assert bars.get_data().values[::2].tolist() == LONG.counts[until].tolist()
        words = [f"{1000 * evaluation.spread_s:.0f} ms"] if evaluation else []
        assert [text.get_text() for text in axes.texts] == words
    periods = LONG.histogram_s / PERIOD
    for axes in (counts, detector):
        places = [line.get_xdata()[0] for line in axes.get_lines()]
        assert {periods, LONG.t_sync_periods} <= set(places)
    assert any(np.allclose(line.get_ydata(), 1000 * THRESHOLD) for line in detector.get_lines())
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert told == ["threshold: 126 ms", "T_sync: 4 cycles, 2.5 s", f"by the histogram: {periods:.1f} periods"]
    first = panels(draw_track(LONG, PICTURE))[0]
    circles = [each for each in first.patches if isinstance(each, Circle)]
    assert [(*circle.center, circle.radius) for circle in circles] == [ring[3:6] for ring in RINGS]
    assert all(to_hex(circle.get_edgecolor()) == FOUND for circle in circles)
    assert first.get_title() == "1.4 periods: 2 rings"


def test_a_gap_in_the_film_is_empty_in_the_figure_and_its_spread_is_an_empty_dot():
    seen = (LONG.times_s < 26.5) | (LONG.times_s > 29.5)
    times, counts = LONG.times_s[seen], LONG.counts[seen]
    film = LONG._replace(times_s=times, counts=counts, evaluations=tuple(evaluate(times, counts, PERIOD)))
    shown, detector = panels(draw_track(film))[12:]
    (bars,) = [each for each in shown.patches if isinstance(each, StepPatch)]
    heights, edges, _ = bars.get_data()
    assert np.diff(edges)[heights == 0].max() * PERIOD == pytest.approx(3, abs=0.3)
    assert "frames are missing" in [line.get_label() for line in detector.get_lines()]


@pytest.mark.parametrize(("film", "snapshot"), [(LONG, PICTURE), (make_track(0, seconds=0.15), None)])
def test_figure_and_table_are_written_for_films_of_any_length(tmp_path, film, snapshot):
    files = save_track_figure(tmp_path / "track.png", film, snapshot)
    assert files == [tmp_path / "track.png", tmp_path / "track.csv"]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    height, width, _ = image.imread(files[0]).shape
    assert (width, height) == ((1860, 1200) if snapshot else (1320, 1200))
    for row, each in zip(read_rings(files[1]), film.evaluations, strict=True):
        expected = (each.time_s, (each.time_s - START) / PERIOD, each.rings, 1000 * each.spread_s)
        assert row == pytest.approx(dict(zip(COLUMNS, expected, strict=True)), rel=1e-5)
