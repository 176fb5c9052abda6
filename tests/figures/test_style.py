"""Claims about looks and files of figures: colours are told apart by all eyes, words stay words, files are whole."""

import errno
from itertools import combinations, product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib import image, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cbook import is_math_text
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import style as looks
from epuck_sim.figures.films import BAR, FOUND, MARK, SYNC
from epuck_sim.figures.forms.violins import LINE, VIOLIN
from epuck_sim.figures.saving import Target, parse_target, save_figure
from epuck_sim.figures.style import COLOURS, GREY, MARKERS, choose_looks, finish, make_panels, style
from epuck_sim.overhead.annotate import CYAN
from epuck_sim.recording import LIT, NIGHT
from epuck_sim.recording.layers import DARK
from tests.cli.commands import names
from tests.figures.drawn import legend_texts
from tests.runs.made_folders import rows

MIN_CONTRAST = 3.0  # of graphical objects with what is behind them (Web Content Accessibility Guidelines 2.1, 1.4.11)
MIN_DISTANCE = 26.0  # in CIELAB; between neighbours of Okabe and Ito's colours it is 16

VISIONS = {  # what eyes make of linear RGB (Machado, Oliveira and Fernandes 2009, severity 1)
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}

TO_XYZ = np.array(  # from linear sRGB to CIE XYZ
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def linear(colour: str) -> FloatArray:
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast_with_white(colour: str) -> float:
    return float(1.05 / (linear(colour) @ TO_XYZ[1] + 0.05))


def lab(rgb: FloatArray) -> FloatArray:
    ratio = TO_XYZ @ rgb / TO_XYZ.sum(axis=1)
    x, y, z = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / 3 * (29 / 6) ** 2 + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def distance(one: str, other: str, vision: str) -> float:
    seen = [lab(np.clip(np.array(VISIONS[vision]) @ linear(colour), 0, 1)) for colour in (one, other)]
    return float(np.linalg.norm(seen[0] - seen[1]))


def test_lines_marks_violins_and_discs_have_contrast_with_white_and_all_eyes_tell_curves_and_marks_apart() -> None:
    assert min(map(contrast_with_white, [*COLOURS, GREY, LINE])) >= MIN_CONTRAST
    assert contrast_with_white(VIOLIN) >= 2.5  # as much as the line over it leaves
    assert min(contrast_with_white(to_hex(np.array(below) / 255)) for below in (LIT, DARK, NIGHT)) >= 4.5
    ring, found = "#dc2828", to_hex(np.array(CYAN) / 255)
    beside_red = (ring, found), (ring, FOUND), (BAR, SYNC), (BAR, MARK)
    for vision, (one, other) in product(VISIONS, (*combinations(COLOURS, 2), *beside_red, (VIOLIN, LINE))):
        assert distance(one, other, vision) >= MIN_DISTANCE, (vision, one, other)


@given(st.integers(1, len(COLOURS) * len(MARKERS)))
def test_each_curve_has_a_look_of_its_own_and_the_first_differ_in_both_colour_and_marker(count: int) -> None:
    chosen = choose_looks(count)
    assert len({*chosen}) == len(chosen) == count
    first = chosen[: len(COLOURS)]
    assert len({look.colour for look in first}) == len({look.marker for look in first}) == len(first)
    assert {"v", "^", "x"}.isdisjoint(MARKERS)


@pytest.mark.parametrize("marker", MARKERS)
def test_of_a_hollow_marker_one_sees_the_middle(marker: str) -> None:
    with rc_context(style()):
        canvas = FigureCanvasAgg(Figure((1, 1), dpi=300))
        canvas.figure.add_axes((0, 0, 1, 1)).plot(0, 0, marker, color="black", markerfacecolor="white")
        canvas.draw()
    assert np.asarray(canvas.buffer_rgba())[149:151, 149:151].min() > 200


@given(st.text(st.characters(exclude_categories=["C"]), max_size=40))
def test_any_text_is_shown_as_it_is(text: str) -> None:
    shown = looks.typeset(text.replace("_", " "))
    assert not is_math_text(shown)
    assert shown.replace(r"\$", "$") == text.replace("_", " ")


@pytest.mark.parametrize("width_cm", [8.5, 17.5])
def test_a_long_label_has_two_lines_within_the_figure(width_cm: float) -> None:
    label = ", ".join(f"a_long_key_{number} = {number}" for number in range(20))
    with rc_context(style()):
        figure, (panel,) = make_panels("", [""], ("x", "y"), width_cm)
        panel.plot([0, 1], label=label)
        finish(figure, [panel])
        figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().width < figure.bbox.width
    first, last = legend.get_texts()[0].get_text().split("\n")
    assert label.startswith(f"{first} {last.removesuffix(' …')}")
    assert len(first) + len(last) > 6 * width_cm
    panel.plot([0, 2], label=label.replace("_18 = 18", "_18 = 7"))
    legend.remove()
    with rc_context(style()):
        looks.add_shared_legend(figure, [panel])
    assert len(set(legend_texts(figure))) == 2


@given(st.floats(1e-3, 9e4))
def test_a_plain_number_has_no_exponent_and_is_read_back(number: float) -> None:
    assert looks.is_plain(number, number)
    assert float(looks.format_tick(number)) == pytest.approx(number)
    assert "e" not in looks.format_tick(number)


def test_ticks_of_a_low_panel_with_one_power_of_ten_do_not_overlap() -> None:
    with rc_context(style()):
        figure = Figure((1.5, 1.2))
        panel = figure.subplots()
        looks.make_logarithmic(panel, "y")
        panel.set_ylim(16, 350)
        figure.draw_without_rendering()
    assert [tick for tick in panel.get_yticks() if 16 < tick < 350] == [20, 50, 100, 200]


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
    looks.mark_wholes(panel.xaxis, np.array(values))
    assert (not (panel.get_xticks() % 1).any()) is whole
    looks.make_logarithmic(panel, "x")
    looks.mark_wholes(panel.xaxis, np.array(values))  # which has ticks of its own


def test_a_short_logarithmic_axis_has_plain_numbers_beside_one_of_powers_of_ten() -> None:
    panel = Figure().subplots()
    looks.make_logarithmic(panel, "x", "y")
    for end, shown in ((20, "2"), (1000, "$2\\cdot10^{0}$")):
        panel.set(xlim=(1, end), ylim=(10, 1e6))
        assert panel.xaxis.get_major_formatter()(2) == shown
        assert panel.yaxis.get_major_formatter()(100) == "$10^{2}$"


def test_names_of_places_are_split_neither_within_a_value_nor_before_a_unit() -> None:
    panel = Figure(figsize=(3, 3)).subplots()
    looks.set_names(panel, ["range, R = 40 cm", "nearest, K = 1", "all"])
    shown = [text.get_text().replace("\N{NO-BREAK SPACE}", " ") for text in panel.get_xticklabels()]
    assert shown == ["range,\nR = 40 cm", "nearest,\nK = 1", "all"]


ENDINGS = (".png", ".svg", ".csv", "-more.csv")
SIGNATURES = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


def draw(title: str = "title") -> Figure:
    """Return a small figure; an SVG names its markers and masks by digests."""
    figure = Figure(figsize=(2, 1.5), dpi=300)
    axes = figure.subplots()
    axes.plot([1, 2, 3], [1, 3, 2], "o-")
    axes.set_title(title)
    return figure


def tables(value: float = 1.5) -> dict[str, str]:
    return {".csv": f"a,b\n1,{value}\n", "-more.csv": 'c\nx\n"y, z"\n'}


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """Return the stem of a figure's files."""
    stem = tmp_path_factory.mktemp("saved") / "fig"
    assert save_figure(Target(stem), draw, tables()) == [stem.with_name(f"fig{ending}") for ending in ENDINGS]
    assert names(stem.parent) == sorted(f"fig{ending}" for ending in ENDINGS)
    return stem


def test_pictures_are_whole_with_text_as_text_and_the_tables_hold_their_rows(saved, tmp_path) -> None:
    picture = image.imread(saved.with_name("fig.png"))
    assert picture.shape == (450, 600, 4)
    assert picture[..., :3].std() > 0.05
    assert ElementTree.parse(saved.with_name("fig.svg")).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert rows(saved.with_name("fig.csv")) == [{"a": "1", "b": "1.5"}]
    assert rows(saved.with_name("fig-more.csv")) == [{"c": "x"}, {"c": "y, z"}]
    svg, pdf = save_figure(Target(tmp_path / "fig", (".svg", ".pdf")), lambda: draw("some words"))
    words = [element.text for element in ElementTree.parse(svg).iter("{http://www.w3.org/2000/svg}text")]
    assert "some words" in words
    assert b"/CIDFontType2" in pdf.read_bytes()  # TrueType, which programs edit, and not outlines of type 3


def test_a_target_is_a_stem_or_one_picture_alone_with_the_tables_beside_it(tmp_path) -> None:
    for stem in ("fig", "v0.5", "a.b", "runs.old/fig"):
        assert parse_target(Path(stem)) == Target(Path(stem), (".png", ".svg"))
        assert parse_target(Path(f"{stem}.png")) == Target(Path(stem), (".png",))
    for ending in (".png", ".svg", ".PDF"):
        target = parse_target(tmp_path / ending / f"v0.5{ending}")
        (tmp_path / ending).mkdir()
        files = save_figure(target, draw, tables())
        assert names(tmp_path / ending) == sorted([f"v0.5{ending}", "v0.5.csv", "v0.5-more.csv"])
        assert files[0].read_bytes().startswith(SIGNATURES[ending.lower()])


def test_the_same_figure_gives_the_same_files_byte_for_byte_and_another_one_others(tmp_path, monkeypatch) -> None:
    target = Target(tmp_path / "fig", (".png", ".svg", ".pdf"))
    first = [file.read_bytes() for file in save_figure(target, draw, {".csv": tables()[".csv"]})]
    monkeypatch.setattr("time.time", lambda: 2e9)
    assert [file.read_bytes() for file in save_figure(target, draw, {".csv": tables()[".csv"]})] == first
    other = save_figure(target, lambda: draw("other"), {".csv": tables(2.5)[".csv"]})
    assert all(file.read_bytes() != before for file, before in zip(other, first, strict=True))


@pytest.mark.parametrize("ending", ENDINGS)
def test_where_one_file_cannot_be_written_none_is_and_nothing_is_drawn(tmp_path, ending: str) -> None:
    (tmp_path / f"T{ending}").mkdir()
    with pytest.raises(EpuckSimError, match=f"T{ending}: cannot be written: is a directory"):
        save_figure(Target(tmp_path / "T"), pytest.fail, tables())
    assert names(tmp_path) == [f"T{ending}"]


@pytest.mark.parametrize("problem", [OSError(errno.ENOSPC, "No space left"), KeyboardInterrupt()], ids=repr)
def test_where_writing_fails_older_files_stay_and_nothing_is_left_beside_them(tmp_path, monkeypatch, problem):
    for ending in ENDINGS:
        (tmp_path / f"T{ending}").write_text("older")

    def write_half(_: Figure, part: Path, **__) -> None:
        part.write_text("half")
        if ".svg" in part.name:  # the second picture
            raise problem

    monkeypatch.setattr(Figure, "savefig", write_half)
    with pytest.raises(EpuckSimError if isinstance(problem, OSError) else KeyboardInterrupt):
        save_figure(Target(tmp_path / "T"), draw, tables())
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {f"T{end}": "older" for end in ENDINGS}
