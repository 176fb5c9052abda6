"""Claims about the figure of a tracked film: which moments it shows, what stands beside it, and where it cannot be."""

import csv
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Circle, StepPatch

from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.figures.films import ACROSS, COLUMNS, FOUND, MARK, choose_moments, draw_track, save_track_figure
from epuck_sim.overhead.synchrony import evaluate, first_synchronised
from epuck_sim.overhead.track import Snapshot, Track
from tests.overhead.counts import counted, frames
from tests.overhead.films import TRACK

PERIOD = 5.0
START = 2.0
THRESHOLD = 0.126


def make_track(cycles: int, narrow_from: int | None = None, seconds: float | None = None) -> Track:
    """Return the track of a film in which flashes are spread at first, and close together from some cycle on."""
    times = frames(seconds or START + (cycles + 1) * PERIOD)
    widths = [0.01 if narrow_from is not None and cycle >= narrow_from else 0.12 for cycle in range(cycles + 2)]
    onsets = [START + 3 + PERIOD * cycle + width * np.arange(10) for cycle, width in enumerate(widths)]
    counts = counted(np.array(onsets), 0.375, times)
    found = evaluate(times, counts, PERIOD, START)
    sync = first_synchronised(found, THRESHOLD)
    at_s = None if sync is None else sync.time_s
    return TRACK._replace(
        times_s=times,
        counts=counts,
        evaluations=tuple(found),
        period_s=PERIOD,
        start_s=START,
        threshold_ms=1000 * THRESHOLD,
        histogram_s=None if at_s is None else at_s - START,
        histogram_periods=None if at_s is None else (at_s - START) / PERIOD,
    )


def evaluated(film: Track) -> list:
    """Return the moments of the second and the third row."""
    _, second, third = choose_moments(film)
    return [*second, *third]


PICTURE = Snapshot(9.0, np.zeros((48, 64, 3), np.uint8), np.array([[10.0, 20.0, 6.0], [40.0, 30.0, 6.5]]))
LONG = make_track(20, narrow_from=12)


@pytest.fixture(scope="module")
def drawn() -> Figure:
    """The figure of the long film."""
    return draw_track(LONG)


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> list[Path]:
    """Its files, with a picture."""
    return save_track_figure(tmp_path_factory.mktemp("saved") / "track.png", LONG, PICTURE)


# --- moments ----------------------------------------------------------------------------------------


def test_the_first_row_is_the_first_period():
    assert [now for now, _ in choose_moments(LONG)[0]] == [START + PERIOD * part for part in (0.25, 0.5, 0.75, 1)]


def test_the_second_row_leads_from_the_first_evaluation_to_the_third_row():
    _, second, third = choose_moments(LONG)
    found = list(LONG.evaluations)
    numbers = [found.index(evaluation) for _, evaluation in second]
    assert len(numbers) == ACROSS
    assert numbers[0] == 0
    assert numbers[-1] + 1 == found.index(third[0][1])
    assert np.ptp(np.diff(numbers)) <= 1


def test_the_third_row_is_one_before_synchrony_synchrony_one_after_and_the_last():
    rounded = LONG._replace(histogram_s=LONG.histogram_s * (1 + 1e-15))
    third = choose_moments(rounded)[2]
    times = [each.time_s for each in LONG.evaluations]
    sync = times.index(START + LONG.histogram_s)
    assert [evaluation for _, evaluation in third] == [LONG.evaluations[n] for n in (sync - 1, sync, sync + 1, -1)]


def test_a_moment_is_when_the_mode_is_at_the_midpoint():
    for now_s, evaluation in evaluated(LONG):
        assert now_s - evaluation.time_s == PERIOD / 2


@pytest.mark.parametrize("cycles", range(9))
def test_no_evaluation_is_shown_twice_and_short_films_show_fewer(cycles):
    for film in (make_track(cycles), make_track(cycles, narrow_from=0), make_track(cycles, narrow_from=cycles // 2)):
        shown = [evaluation for _, evaluation in evaluated(film)]
        assert shown == sorted(set(shown))
        assert len(shown) >= min(len(film.evaluations), ACROSS)


def test_without_synchrony_the_third_row_is_the_last_evaluations():
    film = make_track(20)
    assert film.histogram_s is None
    assert [evaluation for _, evaluation in choose_moments(film)[2]] == list(film.evaluations[-ACROSS:])


# --- the figure -------------------------------------------------------------------------------------


def panels(figure: Figure) -> list:
    return [axes for axes in figure.axes if axes.axison]


def marked(axes) -> list[float]:
    """Return where blue lines stand."""
    lines = [each for each in axes.collections if to_hex(each.get_color()[0]) == MARK]
    return sorted(segment[0][0] for line in lines for segment in line.get_segments())


def test_snapshots_mark_the_period_and_its_midpoint(drawn):
    for axes in panels(drawn)[:12]:
        assert marked(axes) == [-PERIOD, -PERIOD / 2, 0]


def test_snapshots_show_the_counts_until_then_and_the_spread(drawn):
    shown = panels(drawn)[:12]
    tracked_frames = [*choose_moments(LONG)[0], *evaluated(LONG)]
    for axes, (now_s, evaluation) in zip(shown, tracked_frames, strict=True):
        (bars,) = [each for each in axes.patches if isinstance(each, StepPatch)]
        until = (LONG.times_s >= max(START, now_s - 1.3 * PERIOD)) & (LONG.times_s < now_s)
        assert bars.get_data().values[::2].tolist() == LONG.counts[until].tolist()
        words = [f"{1000 * evaluation.spread_s:.0f} ms"] if evaluation else []
        assert [text.get_text() for text in axes.texts] == words


def test_the_panels_below_mark_synchrony_and_the_threshold(drawn):
    counts, detector = panels(drawn)[12:]
    cycles = LONG.histogram_s / PERIOD
    for axes in (counts, detector):
        assert any(set(line.get_xdata()) == {cycles} for line in axes.get_lines())
    assert any(np.allclose(line.get_ydata(), 1000 * THRESHOLD) for line in detector.get_lines())
    legend = drawn.legends[0]
    assert [text.get_text() for text in legend.get_texts()] == ["threshold: 126 ms", f"T_sync: {cycles:.1f} periods"]


def test_a_gap_in_the_film_is_empty_in_the_figure_and_its_spread_is_an_empty_dot():
    seen = (LONG.times_s < 26.5) | (LONG.times_s > 29.5)
    times, counts = LONG.times_s[seen], LONG.counts[seen]
    film = LONG._replace(times_s=times, counts=counts, evaluations=tuple(evaluate(times, counts, PERIOD, START)))
    shown, detector = panels(draw_track(film))[12:]
    (bars,) = [each for each in shown.patches if isinstance(each, StepPatch)]
    heights, edges, _ = bars.get_data()
    empty = np.diff(edges)[heights == 0]
    assert empty.max() * PERIOD == pytest.approx(3, abs=0.3)
    assert "frames are missing" in [line.get_label() for line in detector.get_lines()]


def test_a_picture_has_its_rings_circled_in_green():
    first = panels(draw_track(LONG, PICTURE))[0]
    circles = [each for each in first.patches if isinstance(each, Circle)]
    assert [(*circle.center, circle.radius) for circle in circles] == [tuple(ring) for ring in PICTURE.rings_px]
    assert all(to_hex(circle.get_edgecolor()) == FOUND for circle in circles)
    assert first.get_title() == "1.4 periods: 2 rings"


# --- files ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("film", "snapshot"),
    [
        (LONG, None),
        (make_track(20), PICTURE),
        (make_track(1), None),
        (make_track(0, seconds=3.0), None),
        (make_track(0, seconds=0.15), PICTURE),
    ],
    ids=["synchronised", "never", "two cycles", "less than one", "two frames"],
)
def test_figure_and_table_are_written_for_films_of_any_length(tmp_path, film, snapshot):
    files = save_track_figure(tmp_path / "track.png", film, snapshot)
    assert files == [tmp_path / "track.png", tmp_path / "track.csv"]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    height, width, _ = image.imread(files[0]).shape
    assert (width, height) == ((1860, 1200) if snapshot else (1320, 1200))


def test_the_table_has_a_row_for_each_evaluation(saved):
    table = saved[1]
    header, *rows = csv.reader(table.read_text().splitlines())
    assert tuple(header) == COLUMNS
    for row, each in zip(rows, LONG.evaluations, strict=True):
        expected = (each.time_s, (each.time_s - START) / PERIOD, each.rings, 1000 * each.spread_s)
        assert [float(cell) for cell in row] == pytest.approx(expected, rel=1e-5)


def test_the_same_film_gives_the_same_files(saved, tmp_path):
    again = save_track_figure(tmp_path / "again.png", LONG, PICTURE)
    assert [file.read_bytes() for file in again] == [file.read_bytes() for file in saved]
    assert b"tIME" not in saved[0].read_bytes()


@pytest.mark.parametrize("name", ["track.csv", "track.svg", "track"])
def test_another_ending_is_refused(tmp_path, name):
    with pytest.raises(FilmError, match=r"allowed: \.png"):
        save_track_figure(tmp_path / name, LONG)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("taken", ["track.png", "track.csv"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_written(tmp_path, taken):
    (tmp_path / taken).mkdir()
    with pytest.raises(EpuckSimError, match="is a directory"):
        save_track_figure(tmp_path / "track.png", LONG)
    assert [file.name for file in tmp_path.iterdir()] == [taken]


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(EpuckSimError, match="there is no directory"):
        save_track_figure(Path(tmp_path / "missing" / "track.png"), LONG)
