"""The annotated film: rings in cyan, and the evolving histogram below them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.overhead.annotate import (
    BARS,
    BLUE,
    CYAN,
    GREY,
    OLD_BARS,
    WHITE,
    Annotator,
    TrackedFrame,
    counts_by_column,
)
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.synchrony import Evaluation

PERIOD_S = 5.0


def ring(*seen_px: float) -> Ring:
    return Ring(0.0, 0.0, 3.5, *seen_px)


def rings(count: int) -> list[Ring]:
    return [ring(30 + 40 * number, 50, 15) for number in range(count)]


def spread(spread_s: float) -> Evaluation:
    return Evaluation(0.0, 2, spread_s, 1.0)


class Film:
    """An annotated film of black pictures."""

    def __init__(self, width_px: int = 480, height_px: int = 480) -> None:
        self.annotator = Annotator(width_px, height_px, PERIOD_S)
        self.black = np.zeros((height_px, width_px, 3), np.uint8)

    def add(self, time_s: float, found=(), start_s=0.0, evaluation=None, histogram_s=None) -> np.ndarray:
        """Return the strip below the next picture."""
        tracked = TrackedFrame(Frame(time_s, self.black), found, start_s, evaluation, histogram_s)
        self.picture = self.annotator.annotate(tracked)
        return self.picture[len(self.black) :]

    def add_counts(self, counts: dict[float, int], start_s: float = 0.0) -> np.ndarray:
        """Return the strip below the last of some pictures; counts: number of rings by time."""
        return [self.add(time_s, rings(count), start_s) for time_s, count in counts.items()][-1]


def has(picture: np.ndarray, *colours: tuple[int, int, int]) -> np.ndarray:
    return np.any([(picture == colour).all(axis=-1) for colour in colours], axis=0)


@pytest.mark.parametrize("size", [(480, 480), (241, 239), (65, 64)])
def test_both_sides_are_even_and_the_picture_is_untouched(size):
    annotator = Annotator(*size, PERIOD_S)
    picture = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 3), np.uint8)
    before = picture.copy()
    annotated = annotator.annotate(TrackedFrame(Frame(3.0, picture), (), 0.0, None, None))
    assert annotated.shape == (annotator.height_px, annotator.width_px, 3)
    assert annotator.width_px % 2 == annotator.height_px % 2 == 0
    np.testing.assert_array_equal(annotated[: size[1], : size[0]], before)
    assert not annotated[: size[1] + size[1] % 2, size[0] :].any()
    annotator.annotate(TrackedFrame(Frame(3.1, picture), [ring(32, 32, 9)], 0.0, None, None))
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize(("x", "y", "radius"), [(250.3, 100.7, 25.6), (35.5, 440.5, 27.25)])
def test_rings_are_drawn_where_they_were_found(x, y, radius):
    """The centre of gravity and the mean radius of their green part are those of the ring, to a fraction of a pixel."""
    film = Film()
    film.add(0.0, [ring(x, y, radius)])
    green = film.picture[:480, :, 1].astype(float)
    rows, columns = np.mgrid[:480, :480]
    far = np.hypot(columns - x, rows - y)
    assert not film.picture[:480, :, 0].any()
    assert green.max() == CYAN[1]
    assert not green[np.abs(far - radius) > 4].any()
    middle = [(green * values).sum() / green.sum() for values in (far, columns, rows)]
    assert middle == pytest.approx([radius, x, y], abs=0.3)


def test_bars_are_as_high_as_the_counts_and_paler_after_a_period():
    """The present is at the right edge, and ten seconds ago at the left one; marks are around the last period."""
    lengths = has(Film().add(0.0), BLUE).sum(axis=0)
    assert np.flatnonzero(lengths).tolist() == [239, 240, 359, 360, 478, 479]
    assert 0 < 2 * lengths[359] < lengths[239] == lengths[479]
    strip = Film().add_counts({0.0: 1, 1.0: 2, 2.0: 4, 3.0: 8, 4.0: 0, 4.5: 0})
    heights = has(strip, BARS).sum(axis=0)[[479 - round(48 * age) for age in (4.2, 3.2, 2.2, 1.2, 0.2)]]
    np.testing.assert_allclose(heights / heights.max(), [1 / 8, 1 / 4, 1 / 2, 1, 0], atol=0.02)
    assert heights.max() > 40
    strip = Film().add_counts({0.0: 4, 10.0: 0})
    assert np.flatnonzero(has(strip, OLD_BARS).any(axis=0)).tolist() == list(range(239))
    assert np.flatnonzero(has(strip, BARS).any(axis=0)).tolist() == list(range(241, 478))  # then the present's mark


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


def test_what_was_before_the_beginning_is_forgotten():
    film = Film(64, 64)
    film.add(26.6, rings(3))
    film.add(26.8, [], 0.0, spread(0.2))
    assert not has(film.add(27.0, [], start_s=27.0), BARS).any()
    np.testing.assert_array_equal(film.add(28.0, [], 27.0), Film(64, 64).add_counts({27.0: 0, 28.0: 0}, 27.0))


@pytest.mark.parametrize("size", [(64, 64), (1920, 1080)])
def test_each_statement_is_in_its_own_corner_and_cut_off_nowhere(size):
    film, half = Film(*size), size[0] // 2
    text = film.add(0.1, rings(2))
    rows = np.flatnonzero(has(text, BLUE).any(axis=1))[0]
    written = has(text[:rows], GREY) == 0
    assert written[:, :half].any()
    assert not written[:, half:].any()
    film.add(0.2, rings(2), 0.0, spread(12.3456))
    written = has(film.add(12345.6, rings(100), 0.0, None, 9999.0)[:rows], GREY) == 0
    assert written[: rows // 2, half:].any()
    assert written[rows // 2 :, half:].any()
    assert not written[:, [0, half - 1, half, size[0] - 1]].any()
    assert not written[0].any()


def test_the_last_evaluation_stays_and_synchrony_is_cyan():
    film = Film()
    plain, with_spread, later = film.add(1.0), film.add(1.0, [], 0.0, spread(0.2)), film.add(1.0)
    assert not has(plain, CYAN).any()
    assert has(with_spread, WHITE).sum() > has(plain, WHITE).sum()
    np.testing.assert_array_equal(later, with_spread)
    assert has(film.add(1.0, [], 0.0, None, 0.5), CYAN).any()
