"""What a report shows of a run folder, as read from its HTML and as a browser draws it."""

import re
import shlex
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from plotly.colors import hex_to_rgb
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.report import contents as contents_module
from epuck_sim.report.contents import read_contents
from epuck_sim.report.page import make_page
from epuck_sim.report.sections import MOST_FAILURES
from epuck_sim.report.series_plot import mean_series
from epuck_sim.report.theme import PAPER, colours
from epuck_sim.report.writer import write_report
from epuck_sim.runs.reader import read_points
from epuck_sim.runs.status import Failure
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.statistics.summary import summarize
from epuck_sim.sweep.run import run_sweep
from tests.browsers import needs_browser, picture, shown, texts
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, censored, ended, store, sweep, weibull

NASTY = "<b>&'\"</script><img src=x>"


def some(point):
    """Give point 1 no trials, and censor all of point 2."""
    if point.number == 1:
        return ended([])
    return censored(point, 20) if point.number == 2 else weibull(point, 50 / point.axes[SPEED], 20)


class Page(HTMLParser):
    """Tags, and text outside of scripts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, _attrs) -> None:
        self.tags.append(tag)

    def handle_data(self, data) -> None:
        if self.tags[-1:] not in (["script"], ["style"]):
            self.text.append(data)


def page_of(folder: Path) -> str:
    return make_page(read_contents(folder))


def rows_of(html: str) -> list[list[str]]:
    """Return the cells of all rows of all tables."""
    rows = re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)
    return [re.findall(r"<t[dh][^>]*>(?:<code>)?(.*?)(?:</code>)?</t[dh]>", row) for row in rows]


def test_the_table_has_the_numbers_of_summarize(tmp_path) -> None:
    store(tmp_path / "run", sweep({SPEED: SPEEDS}, trials=20), some)
    rows = rows_of(page_of(tmp_path / "run"))
    for point in summarize(read_points(tmp_path / "run")):
        (row,) = [cells for cells in rows if len(cells) == 8 and cells[0] == str(point.point)]
        assert row[2:4] == [str(point.trials), f"{point.censored:.0%}"]
        assert row[4].startswith("-" if point.mean is None else f"{point.mean:.4g} ({point.mean_low:.4g} to ")


def test_it_says_what_was_run_and_how_to_run_trials_again(tmp_path) -> None:
    folder = store(tmp_path / "my runs", sweep({SPEED: SPEEDS}, trials=30, description="Of speed."), some, failed=3)
    text = " ".join(Page(page_of(folder)).text)
    assert "Of speed." in text
    assert "80 of 150 have a result, 20 censored, 3 failed, 67 still to be run" in text
    for said in ("V [cm/s], robots.0.parameters.speed_cm_s", "numba", "here", "Failed trials: 3", "gone 21"):
        assert said in text
    command = f"epuck-sim run {shlex.quote(str(folder))} --point 4 --trial J"
    assert command in text


def test_many_trials_and_failures_make_a_short_page(tmp_path) -> None:
    few = store(tmp_path / "few", sweep({SPEED: SPEEDS}, trials=30), lambda p: weibull(p, 50, 30))
    many = store(tmp_path / "many", sweep({SPEED: SPEEDS}, trials=2000), lambda p: weibull(p, 50, 1000), failed=900)
    first, second = page_of(few), page_of(many)
    assert len(second.splitlines()) < len(first.splitlines()) + 10
    assert len(second) < len(first) + 200_000
    assert second.count("gone ") == MOST_FAILURES
    assert "There are 800 more" in second


@pytest.mark.parametrize(
    ("grid", "figures"),
    [
        ({}, ["distribution-T-sync"]),
        ({"noise": ["on", "off"]}, ["estimates-T-sync", "distribution-T-sync"]),
        ({SPEED: SPEEDS}, ["estimates-T-sync", "distribution-T-sync"]),
        ({SPEED: SPEEDS, COUNT: [5, 10]}, ["estimates-T-sync", "map-T-sync", "distribution-T-sync"]),
        ({SPEED: SPEEDS, "noise": ["on", "off"]}, ["estimates-T-sync", "distribution-T-sync"]),
    ],
)
def test_figures_fit_the_axes(tmp_path, grid, figures) -> None:
    store(tmp_path / "run", sweep(grid, trials=20), lambda p: weibull(p, 50))
    html = page_of(tmp_path / "run")
    assert re.findall(r'<div id="([^"]*)" class="plotly', html) == figures
    assert html.count("plotly.js v") == 1


def test_without_results_there_is_no_figure_and_no_library(tmp_path) -> None:
    store(tmp_path / "failed", sweep({SPEED: SPEEDS}, trials=2), lambda _: ended([]), failed=2)
    html = page_of(tmp_path / "failed")
    assert "No trial has a result yet." in html
    assert "Failed trials: 2" in html
    assert "<figure" not in html
    assert len(html) < 20_000


def test_names_and_messages_stay_text(tmp_path, monkeypatch) -> None:
    folder = store(
        tmp_path / NASTY.replace("/", ""),
        sweep({"noise": ["on", "off"]}, name=NASTY, description=NASTY),
        lambda p: weibull(p, 50, 10),
    )
    read = contents_module.read_status

    def nasty(path):
        status = read(path)
        return status._replace(failed=[Failure(0, 1, 7, NASTY + "\0\ud800")])

    monkeypatch.setattr(contents_module, "read_status", nasty)
    write_report(folder, tmp_path / "page.html")
    page = Page((tmp_path / "page.html").read_text())
    assert not {"b", "img"} & set(page.tags)
    assert sum(NASTY in text for text in page.text) >= 4
    assert page.tags.count("script") == 3  # the library, and one for each figure


def test_series_and_measures_of_agents(tmp_path) -> None:
    scenario = load_scenario(
        "particles",
        ["stop.max_cycles=30", "trials=6"],
        ["agents.speed_cm_s=1,20"],
        measures=["order_parameter", "near_walls"],
    )
    run_sweep(scenario, tmp_path / "run")
    html = page_of(tmp_path / "run")
    drawn = re.findall(r'<div id="([^"]*)" class="plotly', html)
    assert drawn[-3:] == ["estimates-near-walls", "distribution-near-walls", "series-order-parameter"]
    assert "A value for each cycle, in 12 trials." in html


def test_without_oscillators_nothing_speaks_of_synchrony(tmp_path) -> None:
    scenario = load_scenario(
        {"name": "still", "robots": [{"controller": "constant", "count": 2}], "stop": {"max_cycles": 2}},
        measures=["near_walls"],
    )
    run_sweep(scenario, tmp_path / "run")
    html = page_of(tmp_path / "run")
    assert "T_sync" not in " ".join(Page(html).text)
    assert 'id="distribution-near-walls"' in html


def test_a_series_is_averaged_over_the_trials_that_still_run() -> None:
    values, counts = mean_series(([1, 2, 3], [3, None], True, None))
    assert values.tolist() == [2, 2, 3]
    assert counts.tolist() == [2, 1, 1]


def contrast(one: tuple[int, ...], other: tuple[int, ...]) -> float:
    """Return the ratio of the luminances, as WCAG 2 defines it."""
    shares = [np.array(colour) / 255 for colour in (one, other)]
    linear = [np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) for c in shares]
    low, high = sorted(float(c @ [0.2126, 0.7152, 0.0722]) for c in linear)
    return (high + 0.05) / (low + 0.05)


def rgb(colour: str) -> tuple[int, ...]:
    """Return the levels of a colour as plotly writes it."""
    return hex_to_rgb(colour) if colour.startswith("#") else tuple(map(int, re.findall(r"\d+", colour)))


@pytest.mark.parametrize("paper", PAPER)
def test_colours_are_legible_on_both_papers(paper: str) -> None:
    assert min(contrast(rgb(colour), rgb(paper)) for colour in colours(25)) >= 3


@needs_browser
def test_a_browser_draws_the_figures(tmp_path) -> None:
    folder = store(tmp_path / "run", sweep({COUNT: [5, 10], SPEED: SPEEDS}, trials=20), lambda p: weibull(p, 50, 20))
    write_report(folder, tmp_path / "page.html")
    html = shown(tmp_path / "page.html", tmp_path / "profile")
    assert {"N = 5", "N = 10", "V = 0.2 cm/s"} <= set(texts(html, "legendtext"))
    assert texts(html, "xtitle") == ["V [cm/s]", "V [cm/s]", "T_sync [cycles]"]
    assert len(re.findall(r'<path class="point"', html)) >= 2 * len(SPEEDS)
    without_scripts = re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)
    assert re.findall(r'(?:src|href)="(?!#|data:)', without_scripts) == []
    buttons = set(re.findall(r'data-title="([^"]*)"', without_scripts))
    assert buttons == {"Download plot", "Zoom", "Pan", "Zoom in", "Zoom out", "Autoscale", "Reset axes"}


@pytest.fixture(scope="module")
def page_file(tmp_path_factory) -> Path:
    """Return a page of one axis."""
    folder = tmp_path_factory.mktemp("speeds")
    store(folder / "run", sweep({SPEED: SPEEDS}, trials=20), lambda p: weibull(p, 50, 20))
    write_report(folder / "run", folder / "page.html")
    return folder / "page.html"


@needs_browser
@pytest.mark.parametrize(("is_dark", "width"), [(False, 400), (True, 1400)])
def test_it_is_legible_in_the_dark_and_on_narrow_screens(page_file, tmp_path, is_dark: bool, width: int) -> None:
    seen = picture(page_file, tmp_path / "profile", is_dark=is_dark, size=f"{width},2000")
    assert tuple(seen[-1, 2]) == rgb(PAPER[is_dark])
    drawn = abs(seen - rgb(colours(1)[0])).max(axis=-1) < 10
    assert drawn.sum() > 300
    assert contrast(tuple(seen.min(axis=(0, 1))), tuple(seen.max(axis=(0, 1)))) > 12  # ink on paper


def test_pages_are_written_whole_and_mistakes_are_said(tmp_path, monkeypatch) -> None:
    folder = store(tmp_path / "run", sweep({SPEED: SPEEDS}, trials=2), lambda p: weibull(p, 50, 2))
    with pytest.raises(EpuckSimError, match=r"allowed: \.html$"):
        write_report(folder, tmp_path / "page.pdf")
    with pytest.raises(StoreError, match="is not a run folder"):
        write_report(tmp_path, tmp_path / "page.html")
    monkeypatch.setattr("epuck_sim.report.writer.find_spec", lambda *_: None)
    result = CliRunner().invoke(app, ["report", str(folder), "--to", str(tmp_path / "page.html")])
    assert result.exit_code == 2
    assert "pip install 'epuck-sim[report]'" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
