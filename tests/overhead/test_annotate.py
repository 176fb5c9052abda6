"""The annotated film: rings in cyan, and the evolving histogram below them."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.overhead.annotate import BARS, BLUE, CYAN, GREY, OLD_BARS, STRIP_SHARE, WHITE, Annotator
from epuck_sim.overhead.annotate import _counts_by_column as counts_by_column
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.flashes import TrackedFrame

PERIOD_S = 5.0


class FoundRing(NamedTuple):
    x_px: float
    y_px: float
    radius_px: float


class Spread(NamedTuple):
    spread_s: float


def black(width_px: int = 480, height_px: int = 480) -> np.ndarray:
    return np.zeros((height_px, width_px, 3), np.uint8)


def rings(count: int) -> list[FoundRing]:
    return [FoundRing(30 + 40 * ring, 50, 15) for ring in range(count)]


def annotate(annotator, frame, rings=(), start_s=0.0, evaluation=None, histogram_s=None) -> np.ndarray:
    return annotator.annotate(TrackedFrame(frame, rings, start_s, evaluation, histogram_s))


def annotate_counts(annotator: Annotator, counts: dict[float, int], start_s: float = 0.0) -> np.ndarray:
    """Return the strip below the last of some frames; counts: number of rings by time."""
    for time_s, count in counts.items():
        picture = annotate(annotator, Frame(time_s, black()), rings(count), start_s)
    return picture[480:]


def has(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return (picture == colour).all(axis=-1)


@pytest.mark.parametrize("size", [(480, 480), (240, 240), (241, 239), (65, 64), (640, 480), (1920, 1080), (1080, 1921)])
def test_both_sides_are_even_and_the_picture_is_untouched(size):
    annotator = Annotator(*size, PERIOD_S)
    picture = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 3), np.uint8)
    before = picture.copy()

    annotated = annotate(annotator, Frame(3.0, picture))

    assert annotated.shape == (annotator.height_px, annotator.width_px, 3)
    assert annotated.dtype == np.uint8
    assert annotator.width_px % 2 == annotator.height_px % 2 == 0
    np.testing.assert_array_equal(annotated[: size[1], : size[0]], before)
    assert not annotated[: size[1], size[0] :].any()
    assert not annotated[size[1] : size[1] + size[1] % 2].any()
    annotate(annotator, Frame(3.1, picture), [FoundRing(32, 32, 9)])
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize("size", [(480, 480), (640, 480), (1920, 1080)])
def test_the_strip_is_about_a_fifth_of_the_picture(size):
    assert Annotator(*size, PERIOD_S).height_px - size[1] == pytest.approx(STRIP_SHARE * size[1], abs=2)


def test_rings_are_drawn_where_they_were_found():
    """The centre of gravity and the mean radius of their green part are those of the ring, to a fraction of a pixel."""
    for x, y, radius in [(100.0, 200.0, 26.0), (250.3, 100.7, 25.6), (20.5, 470.5, 27.25)]:
        annotated = annotate(Annotator(480, 480, PERIOD_S), Frame(0.0, black()), [FoundRing(x, y, radius)])[:480]
        green = annotated[..., 1].astype(float)
        rows, columns = np.mgrid[:480, :480]
        far = np.hypot(columns - x, rows - y)

        assert not annotated[..., 0].any()
        assert green.max() == CYAN[1]
        assert not green[np.abs(far - radius) > 4].any()
        assert (green * far).sum() / green.sum() == pytest.approx(radius, abs=0.3)
        if y + radius + 4 < 480:
            assert (green * columns).sum() / green.sum() == pytest.approx(x, abs=0.2)
            assert (green * rows).sum() / green.sum() == pytest.approx(y, abs=0.2)


def test_marks_of_the_interval():
    """It ends now, at the right edge; its midpoint is half a period, a quarter of the width, left of that."""
    strip = annotate_counts(Annotator(480, 480, PERIOD_S), {0.0: 0})
    long, short = has(strip, BLUE).sum(axis=0).max(), np.unique(has(strip, BLUE).sum(axis=0))[1]
    columns = np.flatnonzero(has(strip, BLUE).sum(axis=0) == long)

    assert columns.tolist() == [239, 240, 478, 479]
    assert np.flatnonzero(has(strip, BLUE).sum(axis=0) == short).tolist() == [359, 360]
    assert 2 * short < long
    assert has(strip, BLUE)[-1, [239, 359, 479]].all()


def test_bars_move_from_right_to_left():
    """A frame that lasted 1 s, t s ago, is a bar of a tenth of the width whose left end is t tenths from the right."""
    annotator = Annotator(480, 480, PERIOD_S)
    annotate_counts(annotator, {10.0: 0, 11.0: 4, 12.0: 0})
    for now_s in (12.5, 14.0, 17.5):
        strip = annotate_counts(annotator, {now_s: 0})
        columns = np.flatnonzero((has(strip, BARS) | has(strip, OLD_BARS)).any(axis=0))
        left = 479 - (now_s - 11) * 48

        assert columns.tolist() == [c for c in range(480) if left <= c < left + 48 and c not in {239, 240}]
        assert has(strip, BARS)[:, :239].sum() == has(strip, OLD_BARS)[:, 239:].sum() == 0


def test_bars_are_as_high_as_the_counts():
    strip = annotate_counts(Annotator(480, 480, PERIOD_S), {0.0: 1, 1.0: 2, 2.0: 4, 3.0: 8, 4.0: 0, 4.5: 0})
    heights = has(strip, BARS).sum(axis=0)[[479 - round(48 * age) for age in (4.2, 3.2, 2.2, 1.2, 0.2)]]

    np.testing.assert_allclose(heights / heights.max(), [1 / 8, 1 / 4, 1 / 2, 1, 0], atol=0.02)
    assert heights.max() > 40


def slow_counts_by_column(history, now_s, window_s, width):
    """Return the largest count that holds at some time in each column, which is 1/width of the window."""
    shown = np.zeros(width, int)
    for column in range(width):
        end_s = now_s - (width - 1 - column) * window_s / width
        begin_s = end_s - window_s / width
        for (time_s, count), until_s in zip(history, [time_s for time_s, _ in history[1:]] + [np.inf], strict=True):
            if begin_s < time_s <= end_s or (time_s <= end_s < until_s):
                shown[column] = max(shown[column], count)
    return shown


@given(
    st.lists(st.tuples(st.integers(1, 2000), st.integers(0, 12)), min_size=1, max_size=40),
    st.integers(0, 3000),
    st.integers(1, 97),
)
def test_columns_against_a_slow_twin(steps, later, width):
    """Times are odd multiples of 1/1024 s, and ends of columns are not: none depends on rounding."""
    times = np.cumsum([step for step, _ in steps]) / 512 + 1 / 1024
    history = [(float(time_s), count) for time_s, (_, count) in zip(times, steps, strict=True)]
    now_s = history[-1][0] + later / 512 + 1e-4

    shown = counts_by_column(history, now_s, 10.0, width)

    np.testing.assert_array_equal(shown, slow_counts_by_column(history, now_s, 10.0, width))


def test_a_mode_of_one_frame_is_seen_at_any_rate():
    """At 400 frames a second several share a column."""
    annotator = Annotator(64, 64, PERIOD_S)
    for number in range(1200):
        picture = annotate(annotator, Frame(number / 400, black(64, 64)), rings(number == 901))

    assert has(picture, BARS).any()


def test_no_more_is_remembered_than_is_shown():
    annotator = Annotator(64, 64, PERIOD_S)
    for number in range(2000):
        annotate(annotator, Frame(number / 15, black(64, 64)))
        assert len(annotator._counts) <= 2 * PERIOD_S * 15 + 2


def test_what_was_before_the_beginning_is_forgotten():
    annotator = Annotator(480, 480, PERIOD_S)
    before = {number / 4: 3 for number in range(20)}
    assert has(annotate_counts(annotator, before), BARS).any()

    assert not has(annotate_counts(annotator, {5.0: 0}, start_s=5.0), BARS).any()


def test_text():
    """Each statement is in its own corner above the bars, and cut off nowhere, however narrow the picture is."""
    for width_px, height_px in [(64, 64), (240, 240), (480, 480), (1920, 1080)]:
        annotator = Annotator(width_px, height_px, PERIOD_S)
        text = annotate(annotator, Frame(0.1, black(width_px, height_px)), rings(2))[height_px:]
        rows = np.flatnonzero(has(text, BLUE).any(axis=1))[0]
        written = (text[:rows] != GREY).any(axis=-1)
        assert written[:, : width_px // 2].any()
        assert not written[:, width_px // 2 :].any()

        annotate(annotator, Frame(0.2, black(width_px, height_px)), rings(2), 0.0, Spread(12.3456), None)
        text = annotate(annotator, Frame(12345.6, black(width_px, height_px)), rings(100), 0.0, None, 9999.0)[
            height_px:
        ]
        written = (text[:rows] != GREY).any(axis=-1)
        assert written[: rows // 2, width_px // 2 :].any()
        assert written[rows // 2 :, width_px // 2 :].any()
        assert not written[:, [0, width_px // 2 - 1, width_px // 2, width_px - 1]].any()
        assert not written[0].any()


def test_text_of_the_right_colour_and_of_the_last_evaluation():
    annotator = Annotator(480, 480, PERIOD_S)
    plain = annotate(annotator, Frame(1.0, black()))[480:]
    with_spread = annotate(annotator, Frame(1.0, black()), [], 0.0, Spread(0.2), None)[480:]
    later = annotate(annotator, Frame(1.0, black()))[480:]
    synchronised = annotate(annotator, Frame(1.0, black()), [], 0.0, None, 0.5)[480:]

    assert not has(plain, CYAN).any()
    assert has(with_spread, WHITE).sum() > has(plain, WHITE).sum()
    np.testing.assert_array_equal(later, with_spread)
    assert has(synchronised, CYAN).any()
