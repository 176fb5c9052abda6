"""Claims about maps: points have the colours of their values, and what is undetermined or untried shows."""

import math
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import image
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, to_hex, to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.ticker import NullLocator

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms.maps import COLOURS, GREY, MAX_LEVELS, Map, Maps, choose_levels, read_maps
from epuck_sim.figures.style import MAX_PANELS
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import FigureSection
from epuck_sim.statistics.names import Statistic
from tests.figures.drawn import laid_out, written
from tests.runs.made_folders import (
    COUNT,
    COUPLING,
    HEIGHT,
    PIXELS,
    SPEED,
    SPEEDS,
    WIDTH,
    ended,
    in_memory,
    six_digits,
    sweep,
)

WIDTHS = [40, 60, 80, 100]
PANELS = [16, 4, 8]

UNDETERMINED = {(2.0, 60, 4), (0.2, 40, 8)}
UNTRIED = {(1.0, 80, 4), (5.0, 100, 16)}


def place(point) -> tuple[float, float, int]:
    return point.axes[SPEED], point.axes[WIDTH], point.axes.get(PIXELS, 16)


def mean_at(speed: float, width: float, pixels: int = 16) -> float:
    """Return a mean that differs from point to point, from 10 to more than 1,000."""
    return round(1000 * width / 40 / pixels / speed)


def law(point):
    if place(point) in UNTRIED:
        return ended([])
    if place(point) in UNDETERMINED:
        return ended([5000] * 12, [False] * 12)
    return ended([mean_at(*place(point))] * 3)


def measured(grid: dict, law=law) -> list[PointTrials]:
    return in_memory(sweep(grid, trials=12), law)


GRID = {PIXELS: PANELS, WIDTH: WIDTHS, SPEED: SPEEDS}
POINTS = measured(GRID)
MAPS = read_maps(POINTS, SPEED, WIDTH)
LEVELS = choose_levels(np.concatenate([each.values.ravel() for each in MAPS]), is_log=True)


def panels_of(maps: list[Map], x: str = SPEED, y: str = WIDTH) -> list[Axes]:
    """Return the panels of a figure, laid out; the last of its axes is the colour bar."""
    return laid_out(Maps(x=x, y=y, maps=maps).draw_figure()).axes[:-1]


def contours(panel: Axes) -> list[QuadContourSet]:
    return [each for each in panel.collections if isinstance(each, QuadContourSet)]


def hatched(panel: Axes) -> list:
    return [each for each in panel.collections if each.get_hatch()]


def colour_of(mean: float, levels: np.ndarray = LEVELS) -> str:
    """Return the colour of a mean, of as many from one end of viridis to the other as there are steps."""
    step = int(np.searchsorted(levels, math.log10(mean), "right")) - 1
    return to_hex(COLOURS(BoundaryNorm(np.arange(len(levels)), COLOURS.N)(step + 0.5)))


def painted(maps: list[Map], bare: bool = True) -> list[dict[tuple[float, float], str]]:
    """Return the colour of the page at each point of each map; `bare`: with no hatches over what is grey."""
    figure = Maps(x=SPEED, y=WIDTH, maps=maps).draw_figure()
    for panel in figure.axes[:-1]:
        for axis in (panel.xaxis, panel.yaxis):  # ticks reach onto the points at the edge
            axis.set_major_locator(NullLocator())
            axis.set_minor_locator(NullLocator())
        for each in hatched(panel) if bare else ():
            each.set_hatch(None)
    whole = BytesIO()
    figure.savefig(whole, dpi=200)
    whole.seek(0)
    picture = image.imread(whole)[::-1]
    figure.set_dpi(200)
    found = []
    for panel, each in zip(figure.axes[:-1], maps, strict=True):
        (left, bottom), (right, top) = panel.get_window_extent().get_points()
        middle = np.array([(left + right) / 2, (bottom + top) / 2])
        colours = {}
        for x in each.x:
            for y in each.y:
                at = panel.transData.transform((x, y))
                column, row = (at + 4 * np.sign(middle - at)).astype(int)  # inwards of the frame
                colours[float(x), float(y)] = to_hex(picture[row, column, :3])
        found.append(colours)
    return found


# What is read


def test_there_is_a_map_for_each_combination_of_the_other_axes_in_the_order_of_the_sweep() -> None:
    assert [each.axes for each in MAPS] == [{PIXELS: n} for n in PANELS]
    for each in MAPS:
        assert each.x.tolist() == SPEEDS
        assert each.y.tolist() == WIDTHS


def test_every_point_is_in_its_place_whatever_the_order_of_the_sweep() -> None:
    shuffled = {SPEED: [2.0, 0.2, 5.0, 1.0, 0.5], WIDTH: [80, 40, 100, 60], PIXELS: PANELS}
    for maps in (MAPS, read_maps(measured(shuffled), SPEED, WIDTH)):
        for each in maps:
            for row, width in enumerate(WIDTHS):
                for column, speed in enumerate(SPEEDS):
                    where = (speed, width, each.axes[PIXELS])
                    assert each.is_tried[row, column] == (where not in UNTRIED)
                    expected = math.nan if where in UNTRIED | UNDETERMINED else mean_at(*where)
                    np.testing.assert_equal(each.values[row, column], expected)


def test_x_and_y_change_places() -> None:
    for turned, each in zip(read_maps(POINTS, WIDTH, SPEED), MAPS, strict=True):
        np.testing.assert_array_equal(turned.values, each.values.T)
        np.testing.assert_array_equal(turned.is_tried, each.is_tried.T)


def test_an_axis_that_goes_along_with_y_makes_no_maps_of_its_own() -> None:
    scenario = sweep(
        None, sweep={"zip": {WIDTH: [40, 60, 80], HEIGHT: [40, 60, 80]}, "grid": {SPEED: [1, 2], COUPLING: [0.1]}}
    )
    (only,) = read_maps(in_memory(scenario, lambda _: ended([5])), SPEED, WIDTH)
    assert only.axes == {COUPLING: 0.1}
    assert only.values.shape == (3, 2)


def test_points_that_fill_no_grid_leave_holes() -> None:
    listed = [{SPEED: 1, WIDTH: 40}, {SPEED: 2, WIDTH: 60}, {SPEED: 3, WIDTH: 60}]
    made = in_memory(sweep(None, sweep={"points": listed}), lambda point: ended([point.axes[SPEED]]))
    (only,) = read_maps(made, SPEED, WIDTH)
    np.testing.assert_array_equal(only.values, [[1, math.nan, math.nan], [math.nan, 2, 3]])
    np.testing.assert_array_equal(only.is_tried, ~np.isnan(only.values))


@pytest.mark.parametrize(("synchronised", "is_shown"), [(2, False), (5, False), (6, True), (10, True)])
@pytest.mark.parametrize("statistic", Statistic)
def test_a_point_has_a_value_just_if_fewer_than_half_of_its_trials_are_censored(
    synchronised: int, is_shown: bool, statistic: Statistic
) -> None:
    times = [*range(50, 50 + synchronised), *[30_000] * (10 - synchronised)]
    made = measured({WIDTH: [40, 60], SPEED: [1, 2]}, lambda _: ended(times, [time < 30_000 for time in times]))
    (only,) = read_maps(made, SPEED, WIDTH, statistic)
    assert only.is_tried.all()
    assert np.isnan(only.values).any() != is_shown
    if is_shown and statistic != Statistic.WEIBULL_MEAN:
        assert only.values.max() <= 30_000


# What is drawn


@pytest.mark.parametrize("grid", [GRID, {WIDTH: [40, 60], SPEED: SPEEDS}], ids=["contours", "cells"])
def test_each_point_has_the_colour_of_the_level_that_its_mean_is_in(grid: dict) -> None:
    maps = read_maps(measured(grid), SPEED, WIDTH)
    levels = choose_levels(np.concatenate([each.values.ravel() for each in maps]), is_log=True)
    seen = set()
    for colours, each in zip(painted(maps), maps, strict=True):
        for (speed, width), colour in colours.items():
            where = (speed, width, each.axes.get(PIXELS, 16))
            if where not in UNDETERMINED | UNTRIED:
                # within a few pixels of a point, a contour may be passed
                allowed = {colour_of(mean_at(*where) * factor, levels) for factor in (0.93, 1, 1.07)}
                assert colour in allowed, where
                seen.add(colour)
    assert len(seen) > 6


def test_what_is_undetermined_is_grey_and_hatched_what_is_untried_is_blank_and_colours_are_neither() -> None:
    greys, blanks = set(), set()
    for colours, each in zip(painted(MAPS), MAPS, strict=True):
        for (speed, width), colour in colours.items():
            if to_rgb(colour) == pytest.approx(to_rgb(GREY), abs=0.01):
                greys.add((speed, width, each.axes[PIXELS]))
            if colour == "#ffffff":
                blanks.add((speed, width, each.axes[PIXELS]))
    assert (greys, blanks) == (UNDETERMINED, UNTRIED)
    assert [len(hatched(panel)) for panel in panels_of(MAPS)] == [0, 1, 1]
    for step in range(256):
        assert max(abs(np.subtract(to_rgb(COLOURS(step)), to_rgb(GREY)))) > 0.1


def test_a_legend_names_what_is_undetermined_where_there_is_any() -> None:
    (legend,) = Maps(x=SPEED, y=WIDTH, maps=MAPS).draw_figure().legends
    assert [text.get_text() for text in legend.get_texts()] == ["half of the trials or more are censored"]
    (patch,) = legend.get_patches()
    assert patch.get_hatch()
    assert to_rgb(patch.get_facecolor()) == pytest.approx(to_rgb(GREY))
    assert Maps(x=SPEED, y=WIDTH, maps=MAPS[:1]).draw_figure().legends == []


def test_contours_do_not_reach_over_holes() -> None:
    panel = panels_of(MAPS)[1]
    (drawn,) = contours(panel)
    on_page = panel.transLimits.inverted()  # from the panel to log10 V and L
    assert on_page.is_affine
    for speed, width in ((2.0, 60), (1.0, 80)):
        column, row = SPEEDS.index(speed), WIDTHS.index(width)
        near = [math.log10(SPEEDS[column]), float(WIDTHS[row])]
        assert not any(path.contains_point(near) for path in drawn.get_paths() if len(path.vertices))
    inside = [math.log10(0.5), 80.0]
    assert any(path.contains_point(inside, radius=1e-6) for path in drawn.get_paths() if len(path.vertices))


def test_contours_do_not_reach_into_a_square_of_four_points_one_of_which_is_hidden() -> None:
    grid = {WIDTH: [40, 50, 60, 70], SPEED: [0.1, 1, 5, 12]}
    hidden = 1, 50

    def law(point):
        is_hidden = (point.axes[SPEED], point.axes[WIDTH]) == hidden
        return ended([100 + point.axes[SPEED]] * 3, [not is_hidden] * 3)

    (panel,) = panels_of(read_maps(measured(grid, law), SPEED, WIDTH))
    (drawn,) = contours(panel)

    def is_covered(x: float, y: float) -> bool:
        return any(path.contains_point([math.log10(x), y]) for path in drawn.get_paths() if len(path.vertices))

    assert not is_covered(0.9, 59)  # near the corner that is farthest from the hidden point
    assert is_covered(1.1, 61)


def test_between_two_points_of_a_logarithmic_axis_a_contour_is_where_the_page_has_it() -> None:
    """Means are 100 V, so that the contour at 10 ^ 2.5 is at V = 10 ^ 0.5 and not halfway from 1 to 10."""
    made = measured({WIDTH: [40, 50, 60], SPEED: [0.1, 1, 10]}, lambda point: ended([100 * point.axes[SPEED]] * 3))
    (panel,) = panels_of(read_maps(made, SPEED, WIDTH))
    (drawn,) = contours(panel)
    edges = {round(float(x), 6) for path in drawn.get_paths() for x, _ in path.vertices}
    assert edges >= {round(level - 2, 6) for level in drawn.levels if 1 < level < 3}


@pytest.mark.parametrize(
    ("grid", "expected"),
    [
        ({WIDTH: [40, 60, 80], SPEED: [1, 2, 3]}, 1),
        ({WIDTH: [40, 60], SPEED: [1, 2, 3]}, 0),
        ({WIDTH: [40, 60, 80], SPEED: [1]}, 0),
    ],
)
def test_contours_need_three_values_on_both_axes(grid: dict, expected: int) -> None:
    (panel,) = panels_of(read_maps(measured(grid), SPEED, WIDTH))
    assert len(contours(panel)) == expected


def test_one_panel_with_too_few_values_leaves_all_without_contours() -> None:
    (small,) = read_maps(measured({WIDTH: [40, 60], SPEED: SPEEDS}), SPEED, WIDTH)
    panels = panels_of([*MAPS, small._replace(axes={PIXELS: 2})])
    assert [len(contours(panel)) for panel in panels] == [0] * 4


def test_cells_end_halfway_and_lie_wholly_within_the_panel() -> None:
    made = measured({WIDTH: [40, 60], SPEED: [0.1, 1, 10]}, lambda _: ended([7]))
    (panel,) = panels_of(read_maps(made, SPEED, WIDTH))
    mesh = panel.collections[0].get_coordinates()
    np.testing.assert_allclose(mesh[0, :, 0], 10 ** np.array([-1.5, -0.5, 0.5, 1.5]))
    np.testing.assert_allclose(mesh[:, 0, 1], [30, 50, 70])
    np.testing.assert_allclose(panel.get_xlim(), 10 ** np.array([-1.5, 1.5]))
    assert panel.get_ylim() == (30, 70)


def test_panels_are_in_order_share_their_scales_and_end_at_the_outermost_points() -> None:
    panels = panels_of(MAPS)
    assert [panel.get_title() for panel in panels] == [f"pixels = {n}" for n in PANELS]
    corners = [panel.get_position().get_points()[0].tolist() for panel in panels]
    assert sorted(corners, key=lambda corner: (-round(corner[1], 3), corner[0])) == corners
    for panel in panels:
        assert panel.get_xlim() == (0.2, 5.0)
        assert panel.get_ylim() == (40, 100)
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "linear")


@pytest.mark.parametrize(
    ("count", "shape"), [(1, (1, 1)), (3, (1, 3)), (4, (2, 2)), (5, (2, 3)), (6, (2, 3)), (18, (5, 4))]
)
def test_panels_are_arranged_in_a_grid_with_numbers_on_its_lower_edge(count: int, shape: tuple[int, int]) -> None:
    (one,) = read_maps(measured({WIDTH: [40, 60], SPEED: [1, 2]}), SPEED, WIDTH)
    panels = panels_of([one._replace(axes={PIXELS: n}) for n in range(count)])
    assert len(panels) == count
    lefts, bottoms = (len({round(panel.get_position().get_points()[0][k], 3) for panel in panels}) for k in (0, 1))
    assert (bottoms, lefts) == shape
    for number, panel in enumerate(panels):
        is_lowest = number + shape[1] >= count
        assert bool(panel.get_xlabel()) == panel.xaxis.get_tick_params()["labelbottom"] == is_lowest
        assert bool(panel.get_ylabel()) == (number % shape[1] == 0)


def test_more_panels_than_a_page_holds_are_refused() -> None:
    many = [MAPS[0]._replace(axes={PIXELS: n}) for n in range(MAX_PANELS + 1)]
    with pytest.raises(EpuckSimError, match=f"there would be {MAX_PANELS + 1} panels.*up to {MAX_PANELS}"):
        Maps(x=SPEED, y=WIDTH, maps=many).draw_figure()


def test_y_is_logarithmic_where_it_spans_a_decade_and_x_is_linear_where_it_does_not() -> None:
    made = measured({WIDTH: [40, 100, 400], COUNT: [2, 5, 8]}, lambda _: ended([7]))
    (panel,) = panels_of(read_maps(made, COUNT, WIDTH), COUNT, WIDTH)
    assert (panel.get_xscale(), panel.get_yscale()) == ("linear", "log")
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("N", "L (cm)")


def test_the_colour_bar_is_one_for_all_panels_with_powers_of_ten() -> None:
    figure = Maps(x=SPEED, y=WIDTH, maps=MAPS).draw_figure()
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "$T_\\mathrm{sync}$ (cycles)"
    assert bar.get_ylim() == (LEVELS[0], LEVELS[-1])
    assert bar.get_yticks().tolist() == [1, 2, 3]
    assert [label.get_text() for label in bar.get_yticklabels()] == ["10", "100", "1000"]
    for panel in figure.axes[:-1]:
        for drawn in (panel.collections[0], *contours(panel)):
            assert drawn.norm.boundaries.tolist() == LEVELS.tolist()


@pytest.mark.parametrize(
    ("times", "labels"),
    [((20, 70), ["20", "30", "40", "50", "60", "70"]), ((31, 32), ["30.2", "31.6", "33.1"]), ((1, 1), ["1", "1.05"])],
)
def test_where_there_are_not_two_powers_of_ten_the_bar_has_numbers_between(times, labels: list[str]) -> None:
    made = measured({WIDTH: [40, 60], SPEED: [1, 2]}, lambda point: ended([times[point.axes[SPEED] - 1]] * 3))
    bar = Maps(x=SPEED, y=WIDTH, maps=read_maps(made, SPEED, WIDTH)).draw_figure().axes[-1]
    assert [label.get_text() for label in bar.get_yticklabels()] == labels


@given(st.lists(st.floats(1, 1e9), min_size=1, max_size=5))
def test_levels_are_even_few_enough_and_enclose_all_values(values: list[float]) -> None:
    levels = choose_levels(np.array([*values, math.nan]), is_log=True)
    steps = np.diff(levels)
    assert 1 <= len(steps) <= MAX_LEVELS
    assert np.allclose(steps, steps[0])
    assert levels[0] <= math.log10(min(values)) + 1e-9
    assert math.log10(max(values)) < levels[-1] + 1e-9


def test_where_every_mean_is_undetermined_all_is_grey() -> None:
    made = measured({WIDTH: [40, 60, 80], SPEED: SPEEDS}, lambda _: ended([9] * 4, [False] * 4))
    (colours,) = painted(read_maps(made, SPEED, WIDTH))
    assert all(to_rgb(colour) == pytest.approx(to_rgb(GREY), abs=0.01) for colour in colours.values())


# The table


def test_the_csv_has_a_row_for_each_point_with_trials(tmp_path) -> None:
    table = written(tmp_path, Maps(x=SPEED, y=WIDTH, maps=MAPS).tables[".csv"])
    assert list(table[0]) == [PIXELS, WIDTH, SPEED, "trials", "censored", "statistic", "estimate", "low", "high"]
    expected = []
    for pixels in PANELS:
        for width in WIDTHS:
            for speed in SPEEDS:
                where = (speed, width, pixels)
                point = [str(pixels), str(width), six_digits(speed)]
                if where in UNDETERMINED:
                    expected.append([*point, "12", "1", "restricted mean", "", "", ""])
                elif where not in UNTRIED:
                    expected.append([*point, "3", "0", "mean", six_digits(mean_at(*where)), "", ""])
    assert [[*row.values()] for row in table] == expected


def test_a_width_that_is_asked_for_is_that_of_the_figure_with_fewer_columns_where_it_is_narrow() -> None:
    figure = laid_out(Maps(x=SPEED, y=WIDTH, maps=MAPS, settings=FigureSection(width_cm=8.5)).draw_figure())
    assert figure.get_size_inches()[0] == pytest.approx(8.5 / 2.54)
    assert len({round(panel.get_position().x0, 3) for panel in figure.axes[:-1]}) == 2
    box = figure.get_tightbbox()
    assert box.x0 >= -0.01
    assert box.x1 <= 8.5 / 2.54 + 0.01
