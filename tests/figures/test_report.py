"""What a report shows of a run folder, as read from its HTML and as a browser draws it."""

import re
import shlex
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from epuck_sim import load_scenario, read_points, run_sweep, summarize
from epuck_sim.figures import report as page_module
from epuck_sim.figures.report import MOST_FAILURES, make_page, write_report
from epuck_sim.figures.style import COLOURS
from epuck_sim.runs.reader import Failure
from epuck_sim.util.provenance import host
from tests.browsers import Driven
from tests.runs.made_folders import COUNT, SPEED, censored, ended, store, sweep, weibull
from tests.sweep.pool_here import pool_here
from tests.tools import needs_browser

NASTY = "<b>&'\"</script><img src=x>"


def some(point):
    """Give point 1 no trials, censor all of point 2, and let others have 20."""
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


def figures_of(html: str) -> list[str]:
    return re.findall(r'<figure><svg[^>]* id="([^"]*)"', html)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a run folder of two axes, in which 3 trials have failed, and 77 are left."""
    scenario = sweep({COUNT: [2, 4], SPEED: [0.2, 1.0, 5.0]}, trials=30, description="Of speed.")
    return store(tmp_path_factory.mktemp("page") / "my runs", scenario, some, failed=3)


@pytest.fixture(scope="module")
def html(folder) -> str:
    return make_page(folder)


def test_it_has_the_numbers_of_summarize_and_says_what_was_run_and_how_to_run_trials_again(folder, html) -> None:
    assert html.count('<div class="scroll" tabindex="0"><table') == html.count("<thead>") > 1  # keys scroll them
    cell = r"<t[dh][^>]*>(?:<code>)?(.*?)(?:</code>)?</t[dh]>"
    rows = [re.findall(cell, row) for row in re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)]
    for point in summarize(read_points(folder)):
        (row,) = [cells for cells in rows if len(cells) == 8 and cells[0] == str(point.point)]
        assert row[3:5] == [str(point.trials), f"{100 * point.censored:.0f} %" if point.trials else "-"]
        shown = ("median", "restricted_mean", "weibull_mean")
        assert row[5:] == [str(point.estimates[name]) for name in shown]
    text = " ".join(Page(html).text)
    assert "Of speed." in text
    assert "100 of 180 have a result, 20 censored, 3 failed, 77 still to be run" in text
    for said in ("V (cm/s), robots.0.parameters.speed_cm_s", "numba", host(), "Failed trials: 3", "gone 21"):
        assert said in text
    assert f"epuck-sim run {shlex.quote(str(folder))} --point K --trial J" in text


def test_many_trials_and_failures_make_a_short_page(tmp_path, html) -> None:
    store(tmp_path / "many", sweep({SPEED: [1, 2]}, trials=2000), lambda p: weibull(p, 50, 1500), failed=300)
    many = make_page(tmp_path / "many")
    assert len(many) < len(html) + 100_000
    assert many.count("gone ") == MOST_FAILURES
    assert "There are 200 more" in many
    assert figures_of(many) == ["curves-T_sync", "violins-T_sync"]


def test_figures_are_vectors_with_words_and_nothing_in_them_is_taken_for_a_part_of_another(tmp_path, html) -> None:
    assert figures_of(html) == ["curves-T_sync", "map-T_sync", "violins-T_sync"]
    own = [set(re.findall(r' id="([^"]*)"', svg)) for svg in re.findall(r"<svg.*?</svg>", html, re.DOTALL)]
    assert [len(ids) > 20 for ids in own] == [True] * 3
    assert len(set.union(*own)) == sum(map(len, own))
    used = re.findall(r'(?:href="#|url\(#)([^")]*)', html.partition("<svg")[2].rpartition("</svg>")[0])
    assert set(used) - {"failed", "again"} <= set.union(*own)
    words = " ".join(Page(html).text)
    assert [each in words for each in ("N = 2", "N = 4", "V (cm/s)", "95 % interval")] == [True] * 4
    assert re.findall(r'(?:src|href)="(?!#|data:)|<script|<style(?! *>\n:root)', html) == []
    assert '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; ' in html
    store(tmp_path / "words", sweep({"noise": ["off", {"wheel_speed": 0.5}]}, trials=2), lambda p: weibull(p, 50))
    page = make_page(tmp_path / "words")
    assert figures_of(page) == ["curves-T_sync", "violins-T_sync"]
    texts, words = ("off, {wheel_speed: 0.5}", "No prediction"), " ".join(Page(page).text)
    assert [each in words for each in texts] == [True, False]


def test_names_and_messages_stay_text(tmp_path, monkeypatch) -> None:
    scenario = sweep({SPEED: [1, 2]}, name=NASTY, description=NASTY)
    folder = store(tmp_path / NASTY.replace("/", ""), scenario, lambda p: weibull(p, 50, 2))
    read, failed = page_module.read_status, [Failure(0, 1, 7, NASTY + "\0\ud800")]
    monkeypatch.setattr(page_module, "read_status", lambda path: read(path)._replace(failed=failed))
    write_report(folder, tmp_path / "page.html")
    page = Page((tmp_path / "page.html").read_text())
    assert not {"b", "img"} & set(page.tags)
    assert sum(NASTY in text for text in page.text) >= 4
    assert page.tags.count("script") == 0


def test_series_and_measures_of_agents(tmp_path) -> None:
    changes = ["stop={order_parameter: null, max_cycles: 3}", "trials=2"]
    measures = ["order_parameter", "near_walls"]
    scenario = load_scenario("particles", changes, ["agents.speed_cm_s=1,20"], measures=measures)
    run_sweep(scenario, tmp_path / "run", pool_here)
    html = make_page(tmp_path / "run")
    assert figures_of(html) == ["curves-near_walls", "violins-near_walls", "series-order_parameter"]


@needs_browser
def test_it_is_legible_in_the_dark_and_a_figure_is_seen_on_narrow_screens(tmp_path, html) -> None:
    path = tmp_path / "page.html"
    path.write_text(html.replace("<html", '<html data-ready="now"', 1))
    browser = Driven(tmp_path / "profile")
    try:
        browser.open(path.as_uri())
        for is_dark, width, paper in ((False, 400, 255), (True, 1400, 0x14)):
            browser.set_window(width, 2000, is_dark=is_dark)
            browser.picture(tmp_path / "seen.png")
            with Image.open(tmp_path / "seen.png") as opened:
                seen = np.asarray(opened.convert("RGB"), float)
            assert seen[-1, 2, 0] == paper
            assert (abs(seen - tuple(bytes.fromhex(COLOURS[0][1:]))).max(axis=-1) < 10).sum() > 100
            assert seen.min() < 30
            assert seen.max() > 225
    finally:
        browser.close()
