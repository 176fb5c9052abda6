"""Claims about the looks of figures: colours have contrast and are told apart by all eyes, words stay words."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import rc_context
from matplotlib.cbook import is_math_text
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.films import BAR, FOUND, MARK, SYNC
from epuck_sim.figures.forms.violins import LINE, VIOLIN
from epuck_sim.figures.style import (
    COLOURS,
    GREY,
    MARKERS,
    add_shared_legend,
    choose_looks,
    finish,
    format_tick,
    is_plain,
    make_logarithmic,
    make_panels,
    mark_wholes,
    style,
    typeset,
)
from epuck_sim.overhead.annotate import CYAN
from epuck_sim.recording.layers.arena import DARK, LIT, NIGHT
from tests.figures.drawn import legend_texts

MIN_CONTRAST = 3.0
"""Least contrast of graphical objects with what is behind them (Web Content Accessibility Guidelines 2.1, 1.4.11)."""

MIN_DISTANCE = 26.0
"""Least distance in CIELAB; between neighbours of Okabe and Ito's colours it is 16."""

VISIONS = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""What eyes make of linear RGB (Machado, Oliveira and Fernandes 2009, severity 1)."""

TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""From linear sRGB to CIE XYZ."""


def linear(colour: str) -> FloatArray:
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast_with_white(colour: str) -> float:
    return float(1.05 / (linear(colour) @ TO_XYZ[1] + 0.05))


def lab(rgb: FloatArray) -> FloatArray:
    """Return CIELAB coordinates of linear RGB."""
    ratio = TO_XYZ @ rgb / TO_XYZ.sum(axis=1)
    x, y, z = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / 3 * (29 / 6) ** 2 + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def distance(one: str, other: str, vision: str) -> float:
    seen = [lab(np.clip(np.array(VISIONS[vision]) @ linear(colour), 0, 1)) for colour in (one, other)]
    return float(np.linalg.norm(seen[0] - seen[1]))


def test_lines_marks_violins_and_discs_below_white_numbers_have_contrast_with_white() -> None:
    assert min(map(contrast_with_white, [*COLOURS, GREY, LINE])) >= MIN_CONTRAST
    assert contrast_with_white(VIOLIN) >= 2.5  # as much as the line over it leaves
    assert min(contrast_with_white(to_hex(np.array(below) / 255)) for below in (LIT, DARK, NIGHT)) >= 4.5


@pytest.mark.parametrize("vision", VISIONS)
def test_all_eyes_tell_curves_apart_and_see_what_is_marked_beside_red(vision: str) -> None:
    ring, found = "#dc2828", to_hex(np.array(CYAN) / 255)
    beside_red = (ring, found), (ring, FOUND), (BAR, SYNC), (BAR, MARK)
    for one, other in (*combinations(COLOURS, 2), *beside_red, (VIOLIN, LINE)):
        assert distance(one, other, vision) >= MIN_DISTANCE, (one, other)


@given(st.integers(1, len(COLOURS) * len(MARKERS)))
def test_each_curve_has_a_look_of_its_own_and_the_first_differ_in_both_colour_and_marker(count: int) -> None:
    looks = choose_looks(count)
    assert len({*looks}) == len(looks) == count
    first = looks[: len(COLOURS)]
    assert len({look.colour for look in first}) == len({look.marker for look in first}) == len(first)
    assert {"v", "^", "x"}.isdisjoint(MARKERS)


@given(st.text(st.characters(exclude_categories=["C"]), max_size=40))
def test_any_text_is_shown_as_it_is(text: str) -> None:
    shown = typeset(text.replace("_", " "))
    assert not is_math_text(shown)
    assert shown.replace(r"\$", "$") == text.replace("_", " ")


@pytest.mark.parametrize("width_cm", [8.5, 17.5])
def test_a_long_label_has_one_line_within_the_figure_with_both_its_ends(width_cm: float) -> None:
    label = ", ".join(f"a_long_key_{number} = {number}" for number in range(12))
    with rc_context(style()):
        figure, (panel,) = make_panels("", [""], ("x", "y"), width_cm)
        panel.plot([0, 1], label=label)
        finish(figure, [panel])
        figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().width < figure.bbox.width
    first, last = legend.get_texts()[0].get_text().split(" … ")
    assert label.startswith(first)
    assert label.endswith(last)
    assert len(first) + len(last) > 3 * width_cm
    panel.plot([0, 2], label=label.replace("_6 = 6", "_6 = 7"))
    legend.remove()
    with rc_context(style()):
        add_shared_legend(figure, [panel])
    assert len(set(legend_texts(figure))) == 2


@given(st.floats(1e-3, 9e4))
def test_a_plain_number_has_no_exponent_and_is_read_back(number: float) -> None:
    assert is_plain(number, number)
    assert float(format_tick(number)) == pytest.approx(number)
    assert "e" not in format_tick(number)


@pytest.mark.parametrize(("width_cm", "font_pt", "label"), [(5, 12, "T_sync (cycles)"), (8.5, 8, "a long label, " * 8)])
def test_a_panel_is_as_high_as_its_label(width_cm: float, font_pt: float, label: str) -> None:
    with rc_context(style(font_pt)):
        figure, (panel,) = make_panels("", [""], ["x", label], width_cm)
        panel.plot([1, 2], label="a curve")
        finish(figure, [panel])
    figure.draw_without_rendering()
    shown = panel.yaxis.label.get_window_extent()
    assert figure.bbox.y0 <= shown.y0 < shown.y1 <= figure.bbox.y1


@pytest.mark.parametrize(("values", "whole"), [([2.0, 3.0], True), ([2.0, 2.5], False)])
def test_where_all_values_are_whole_so_are_the_ticks(values: list[float], whole: bool) -> None:
    panel = Figure().subplots()
    panel.set_xlim(values[0], values[-1])
    mark_wholes(panel.xaxis, np.array(values))
    assert (not (panel.get_xticks() % 1).any()) is whole
    make_logarithmic(panel, "x")
    mark_wholes(panel.xaxis, np.array(values))  # which has ticks of its own
