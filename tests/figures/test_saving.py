"""Claims about the files of figures: which are written, that they are whole and the same again, and what is refused."""

import errno
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib import image
from matplotlib.figure import Figure

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.saving import Table, Target, parse_target, save_figure
from tests.cli.films import names
from tests.runs.made_folders import rows

ENDINGS = (".png", ".svg", ".csv", "-more.csv")
SIGNATURES = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


def draw(title: str = "title") -> Figure:
    """Return a small figure; an SVG names its markers and masks by digests."""
    figure = Figure(figsize=(2, 1.5), dpi=300)
    axes = figure.subplots()
    axes.plot([1, 2, 3], [1, 3, 2], "o-")
    axes.set_title(title)
    return figure


def tables(value: float = 1.5) -> dict[str, Table]:
    return {".csv": Table(("a", "b"), [(1, value)]), "-more.csv": Table(("c",), [("x",), ("y, z",)])}


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """Return the stem of a figure's files."""
    stem = tmp_path_factory.mktemp("saved") / "fig"
    assert save_figure(Target(stem), draw, tables()) == [stem.with_name(f"fig{ending}") for ending in ENDINGS]
    assert names(stem.parent) == sorted(f"fig{ending}" for ending in ENDINGS)
    return stem


def test_the_pictures_are_whole_and_the_tables_hold_their_rows(saved) -> None:
    picture = image.imread(saved.with_name("fig.png"))
    assert picture.shape == (450, 600, 4)
    assert picture[..., :3].std() > 0.05
    assert ElementTree.parse(saved.with_name("fig.svg")).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert rows(saved.with_name("fig.csv")) == [{"a": "1", "b": "1.5"}]
    assert rows(saved.with_name("fig-more.csv")) == [{"c": "x"}, {"c": "y, z"}]


@pytest.mark.parametrize("ending", [".png", ".svg", ".PDF"])
def test_a_target_of_one_format_is_that_picture_alone_with_the_tables_beside_it(tmp_path, ending: str) -> None:
    target = parse_target(tmp_path / f"v0.5{ending}")
    files = save_figure(target, draw, tables())
    assert names(tmp_path) == sorted([f"v0.5{ending}", "v0.5.csv", "v0.5-more.csv"])
    assert files[0].read_bytes().startswith(SIGNATURES[ending.lower()])


def test_the_same_figure_gives_the_same_files_byte_for_byte_and_another_one_others(tmp_path, monkeypatch) -> None:
    target = Target(tmp_path / "fig", (".png", ".svg", ".pdf"))
    first = [file.read_bytes() for file in save_figure(target, draw, {".csv": tables()[".csv"]})]
    monkeypatch.setattr("time.time", lambda: 2e9)
    assert [file.read_bytes() for file in save_figure(target, draw, {".csv": tables()[".csv"]})] == first
    other = save_figure(target, lambda: draw("other"), {".csv": tables(2.5)[".csv"]})
    assert all(file.read_bytes() != before for file, before in zip(other, first, strict=True))


def test_a_target_is_a_stem_or_one_picture() -> None:
    for stem in ("fig", "v0.5", "a.b", "runs.old/fig"):
        assert parse_target(Path(stem)) == Target(Path(stem), (".png", ".svg"))
        assert parse_target(Path(f"{stem}.png")) == Target(Path(stem), (".png",))


@pytest.mark.parametrize("ending", ENDINGS)
def test_where_one_file_cannot_be_written_none_is_and_nothing_is_drawn(tmp_path, ending: str) -> None:
    def refuse() -> Figure:
        raise AssertionError

    (tmp_path / f"T{ending}").mkdir()
    with pytest.raises(EpuckSimError, match=f"T{ending}: cannot be written: is a directory"):
        save_figure(Target(tmp_path / "T"), refuse, tables())
    assert names(tmp_path) == [f"T{ending}"]


@pytest.mark.parametrize(
    ("problem", "raised"),
    [(OSError(errno.ENOSPC, "No space left"), EpuckSimError), (KeyboardInterrupt(), KeyboardInterrupt)],
    ids=["full disk", "Ctrl-C"],
)
def test_where_writing_fails_older_files_stay_and_nothing_is_left_beside_them(
    tmp_path, monkeypatch, problem: BaseException, raised: type[BaseException]
) -> None:
    for ending in ENDINGS:
        (tmp_path / f"T{ending}").write_text("older")

    def write_half(_: Figure, part: Path, **__) -> None:
        part.write_text("half")
        if ".svg" in part.name:  # the second picture
            raise problem

    monkeypatch.setattr(Figure, "savefig", write_half)
    with pytest.raises(raised):
        save_figure(Target(tmp_path / "T"), draw, tables())
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {f"T{end}": "older" for end in ENDINGS}


def test_text_is_text_in_every_format_that_has_any(tmp_path) -> None:
    svg, pdf = save_figure(Target(tmp_path / "fig", (".svg", ".pdf")), lambda: draw("some words"))
    words = [element.text for element in ElementTree.parse(svg).iter("{http://www.w3.org/2000/svg}text")]
    assert "some words" in words
    assert b"/CIDFontType2" in pdf.read_bytes()  # TrueType, which programs edit, and not outlines of type 3
