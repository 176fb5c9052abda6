"""Claims about the page of a trial: what is drawn is what was recorded, and the same trial gives the same files."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.cbook import is_math_text
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle

from epuck_sim import epuck, load_scenario, read_recording
from epuck_sim.arrays import FloatArray
from epuck_sim.display.arena_svg import LAMP, MOST_NUMBERED
from epuck_sim.figures import trial_page
from epuck_sim.figures.saving import Target, save_figure
from epuck_sim.figures.trial_page import RED, draw_page, page_title
from epuck_sim.recording import Level
from epuck_sim.recording.reader import Recorded
from epuck_sim.recording.rows import PATH_S, population_of
from tests.cli.commands import call
from tests.figures.drawn import laid_out
from tests.recording import recordings

ENDINGS = (".png", ".svg")
SVG = "{http://www.w3.org/2000/svg}"

FAST, USUAL = ({"count": count, "parameters": {"period_s": period_s}} for count, period_s in ((2, 4), (3, 5)))
THREE_GROUPS = [FAST, {"count": 1, "controller": "obstacle_avoidance"}, USUAL]
STOP = {"reference_robot": 4, "max_time_s": 25, "order_parameter": 1}
MIXED = {"name": "mixed", "robots": THREE_GROUPS, "stop": STOP}


def recorded(path: Path, scenario: Any, seed: int = 0, level: Level = Level.POSES) -> Recorded:
    recordings.recorded(path, load_scenario(scenario), seed, level)
    return read_recording(path)


def robots(axes: Axes) -> list[Circle]:
    circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
    return [circle for circle in circles if circle.radius == epuck.RADIUS_CM and circle.get_zorder() > 1]


def lines(axes: Axes, colour: str | None = None) -> list[Line2D]:
    """Return the lines of a colour; without one, those that are of no robot's front."""
    chosen = [(line, to_hex(line.get_color())) for line in axes.get_lines()]
    return [line for line, own in chosen if (own == colour if colour else own != "#ffffff")]


def points(line: Line2D) -> FloatArray:
    return np.column_stack([line.get_xdata(), line.get_ydata()])


def rasterized(axes: Axes) -> set[bool]:
    """Return whether what is drawn at many times is a picture in an SVG: one value, if all of it is alike."""
    drawn = [line for line in axes.get_lines() if len(line.get_xdata()) > 2]
    return {bool(artist.get_rasterized()) for artist in [*drawn, *axes.collections]}


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    """Return a recording of the thesis's base case, which no test changes."""
    path = tmp_path_factory.mktemp("file") / "thesis.rrd"
    recorded(path, "thesis", level=Level.FULL)
    return path


@pytest.fixture(scope="module")
def trials(file, tmp_path_factory) -> dict[str, Recorded]:
    folder = tmp_path_factory.mktemp("trials")
    agents = recorded(folder / "agents.rrd", load_scenario("particles", ["stop.max_cycles=8"]))
    return {"thesis": read_recording(file), "mixed": recorded(folder / "mixed.rrd", MIXED), "agents": agents}


@pytest.fixture(scope="module")
def pages(trials) -> dict[str, list[Axes]]:
    """Return the arena, the flashes, the phases and the order parameter of each trial, laid out."""
    return {name: laid_out(draw_page(trial)).axes for name, trial in trials.items()}


@pytest.fixture(scope="module")
def saved(trials, tmp_path_factory) -> Path:
    """Return the stem of the files of a page."""
    stem = tmp_path_factory.mktemp("saved") / "page"
    save_figure(Target(stem, ENDINGS), lambda: draw_page(trials["thesis"]))
    return stem


def test_each_flash_is_a_mark_at_its_time_which_all_panels_share_in_the_row_of_its_robot(trials, pages) -> None:
    trial, axes = trials["thesis"], pages["thesis"][1]
    (marks,) = axes.collections
    segments = np.array(marks.get_segments())
    assert len(segments) > 20
    np.testing.assert_array_equal(segments[:, :, 0], np.column_stack([trial.flash_s] * 2))
    np.testing.assert_allclose(segments[:, :, 1].mean(axis=1), trial.flash_robot)
    assert (np.ptp(segments[:, :, 1], axis=1) < 1).all()
    assert to_hex(marks.get_color()[0]) == RED
    bottom, top = axes.get_ylim()
    assert bottom < -0.4 < 9.4 < top < 10
    _, *timed = pages["thesis"]
    assert len({axes.get_xlim() for axes in timed}) == 1
    (left, right), end_s = timed[0].get_xlim(), trials["thesis"].time_s[-1]
    assert left <= 0 < end_s < right < 1.1 * end_s
    assert timed[-1].get_xlabel() == "simulated time (s)"


@pytest.mark.parametrize("name", ["thesis", "mixed", "agents"])
def test_phases_are_relative_to_the_reference_at_its_firings(trials, pages, name: str) -> None:
    trial, axes = trials[name], pages[name][2]
    drawn = [points(line) for line in axes.get_lines()]
    population = population_of(trial.scenario)
    rows = [[*trial.time_s].index(firing) for firing in trial.firing_s]
    angles = 2 * math.pi * trial.phase_ms[rows] / population.period_ms
    reference = population.reference
    assert len(drawn) == population.size
    assert len(rows) > 3
    for robot, marks in enumerate(drawn):
        np.testing.assert_array_equal(marks[:, 0], trial.firing_s)
        expected = np.exp(1j * (angles[:, robot] - angles[:, reference]))
        np.testing.assert_allclose(np.exp(2j * math.pi * marks[:, 1]), expected, atol=1e-9)
        assert (np.abs(marks[:, 1][~np.isnan(marks[:, 1])]) <= 0.5).all()
        assert np.isnan(marks[:, 1]).all() == np.isnan(population.period_ms[robot])
    assert (drawn[reference][:, 1] == 0).all()
    bottom, top = axes.get_ylim()
    assert bottom < -0.5 < 0.5 < top


@pytest.mark.parametrize("name", ["thesis", "mixed", "agents"])
def test_the_order_parameter_is_drawn_at_steps_and_at_firings_with_its_threshold(trials, pages, name: str) -> None:
    trial, axes = trials[name], pages[name][3]
    steps, firings, threshold = axes.get_lines()
    np.testing.assert_array_equal(points(steps), np.column_stack([trial.time_s, trial.order_parameter]))
    np.testing.assert_array_equal(points(firings), np.column_stack([trial.firing_s, trial.firing_order]))
    assert [*threshold.get_ydata()] == [trial.scenario.stop.order_parameter] * 2
    assert axes.get_ylim()[0] == 0
    assert 1 < axes.get_ylim()[1] < 1.1
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names[:2] == [f"at each {population_of(trial.scenario).moment}", "at firings of the reference"]
    box = axes.get_legend().get_window_extent()
    assert axes.figure.bbox.y0 <= box.y0 < box.y1 < axes.get_window_extent().y0


def test_the_title_names_the_outcome_and_what_is_not_as_in_the_shipped_scenario(trials) -> None:
    trial = trials["thesis"]
    assert page_title(trial, has_oscillators=True) == f"thesis, seed 0: synchronised after {trial.cycles} cycles"
    pillar = "arena.obstacles=[{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 5}]"  # which is drawn
    own = "robots.0.parameters.speed_cm_s=3", "stop.max_time_s=1", "trials=7"
    changed = load_scenario("thesis", [pillar, *own])
    _, *rest = page_title(trial._replace(scenario=changed), has_oscillators=True).splitlines()
    assert sorted("".join(rest).removeprefix("with ").split(", ")) == ["V = 3 cm/s", "max time = 1 s"]
    mine = changed.model_copy(update={"robots": (changed.robots[0].model_copy(update={"controller": "/me/once.py"}),)})
    assert "controller = once," in page_title(trial._replace(scenario=mine), has_oscillators=True)
    assert draw_page(trial, "mine").get_suptitle() == "mine"
    for stop, outcome in [
        ({}, "not synchronised"),
        *(({"order_parameter": None}, said) for said in ("7 cycles", "without oscillators")),
    ]:
        ended = SimpleNamespace(scenario=load_scenario({"stop": stop}), seed=1, cycles=7, synchronised=False)
        title = page_title(ended, has_oscillators=outcome != "without oscillators")
        assert title.splitlines()[0] == f"thesis, seed 1: {outcome}"


@pytest.mark.parametrize("is_lit", [False, True])
def test_a_trial_without_oscillators_has_no_empty_panels(tmp_path, is_lit: bool) -> None:
    group = {"controller": "constant", "parameters": {"ring_on": is_lit}}
    figure = draw_page(recorded(tmp_path / "t.rrd", {"robots": [group], "stop": {"max_time_s": 2}}))
    assert len(figure.axes) == 1 + is_lit
    assert figure.axes[0].get_xlabel() == "x (cm)"
    assert figure.axes[-1].get_xlabel() == ("simulated time (s)" if is_lit else "x (cm)")
    assert "without oscillators" in figure.get_suptitle()


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_robots_are_where_they_were_when_most_rings_were_lit_for_the_last_time(trials, pages, name: str) -> None:
    trial, arena = trials[name], pages[name][0]
    lit, bodies = trial.ring_on.sum(axis=1).tolist(), robots(arena)
    moment = max(range(len(lit)), key=lambda step: (lit[step], step))
    assert len(bodies) == trial.scenario.population
    np.testing.assert_array_equal([body.center for body in bodies], trial.positions[moment])
    assert [to_hex(body.get_facecolor()) == RED for body in bodies] == trial.ring_on[moment].tolist()
    assert [text.get_text() for text in arena.texts] == [str(robot) for robot in range(len(bodies))]
    assert arena.get_title() == f"at {trial.time_s[moment]:.1f} s, with the paths of 10 s"
    ahead = np.column_stack([np.cos(trial.headings[moment]), np.sin(trial.headings[moment])])
    fronts = lines(arena, "#ffffff")
    for line, place, end, text in zip(fronts, trial.positions[moment], ahead, arena.texts, strict=True):
        np.testing.assert_allclose(points(line), [place, place + epuck.RADIUS_CM * end], atol=1e-5)
        assert math.dist(text.get_position(), place) < epuck.RADIUS_CM / 2
    colours = [to_hex(line.get_color()) for line in pages[name][2].get_lines()]
    assert [to_hex(body.get_edgecolor()) for body in bodies] == colours
    assert len(set(colours)) == len(bodies)
    step_s, paths = trial.time_s[1], lines(arena)
    assert [to_hex(line.get_color()) for line in paths] == colours
    for robot, line in enumerate(paths):
        path = points(line)
        assert PATH_S - 1.01 * step_s < (len(path) - 1) * step_s < PATH_S + 0.01 * step_s
        np.testing.assert_array_equal(path, trial.positions[moment + 1 - len(path) : moment + 1, robot])


def test_walls_and_obstacles_are_drawn_where_they_stand_and_a_cube_alone_is_seen_from_above(tmp_path, pages) -> None:
    arena, *_ = draw_page(recorded(tmp_path / "t.rrd", load_scenario("obstacles", ["stop.max_time_s=12"]))).axes
    (pillar,) = [each for each in arena.patches if isinstance(each, Circle) and each.get_zorder() == 1]
    assert (pillar.center, pillar.radius) == ((30, 30), 6)
    bar, wedge = [patch for patch in arena.patches if isinstance(patch, Polygon)]
    np.testing.assert_allclose(wedge.get_xy()[:3], [(20, 70), (35, 72), (24, 85)])
    np.testing.assert_allclose(bar.get_xy()[:4].mean(axis=0), (65, 60))
    (walls,) = [patch for patch in arena.patches if isinstance(patch, Rectangle)]
    assert (walls.get_bbox().bounds, walls.get_fill()) == ((0, 0, 100, 100), False)
    settings = ["space.dimensions=3", "agents.count=4", "stop.max_cycles=2"]
    cube, *_ = draw_page(recorded(tmp_path / "t.rrd", load_scenario("particles", settings))).axes
    assert ["a cube seen from above" in arena.get_title() for arena in (cube, pages["agents"][0])] == [True, False]


def test_floor_and_lamps_are_drawn_if_there_are_any(tmp_path, pages) -> None:
    patch = "arena.floor.patches=[{shape: circle, x_cm: 20, y_cm: 10, radius_cm: 5, brightness: 0}]"
    lit = load_scenario("pair", [patch, "arena.lamps=[{x_cm: 5, y_cm: 30, height_cm: 9}]", "stop.max_time_s=1"])
    arena, *_ = draw_page(recorded(tmp_path / "t.rrd", lit)).axes
    (floor,) = arena.get_images()
    levels = floor.get_array()
    left, right, bottom, top = floor.get_extent()
    assert (left, bottom, right, top) == (0, 0, lit.arena.width_cm, lit.arena.height_cm)
    row, column = (round(share * side) for share, side in zip((1 - 10 / top, 20 / right), levels.shape, strict=True))
    assert (levels[row, column], levels[0, 0]) == (0, 255)
    assert [circle.center for circle in arena.patches if to_hex(circle.get_facecolor()) == LAMP] == [(5, 30)]
    assert not pages["thesis"][0].get_images()


ONE_STEP = {"robots": [{"poses": [[30, 30, 0]], "controller": "constant"}], "stop": {"max_time_s": 0.01}}
NO_FIRING = {**MIXED, "stop": {"reference_robot": 2, "max_time_s": 6}}
CROWD = {"arena": {"width_cm": 400, "height_cm": 200}, "robots": [{"count": 60}], "stop": {"max_time_s": 0.2}}


@pytest.mark.parametrize("scenario", [ONE_STEP, NO_FIRING, CROWD], ids=["one step", "no firing", "a crowd"])
def test_any_trial_can_be_drawn_undistorted(tmp_path, scenario: Any) -> None:
    trial = recorded(tmp_path / "t.rrd", scenario)
    arena, *_ = laid_out(draw_page(trial)).axes
    assert len(robots(arena)) == trial.scenario.population
    assert bool(arena.texts) == (trial.scenario.population < MOST_NUMBERED)
    (left, right), (bottom, top), box = arena.get_xlim(), arena.get_ylim(), arena.get_window_extent()
    assert left <= 0 < trial.scenario.arena.width_cm <= right
    assert box.width / (right - left) == pytest.approx(box.height / (top - bottom), rel=0.01)


def test_a_name_is_no_formula(trials, tmp_path) -> None:
    name = "a $\\frac{$ & <b> {0} 50 % [/red] 群れ"
    trial = trials["mixed"]._replace(scenario=trials["mixed"].scenario.model_copy(update={"name": name}))
    (title,) = draw_page(trial).texts
    assert title.get_text().startswith(f"{name}, seed 0: ")
    assert not (title.get_parse_math() and is_math_text(title.get_text()))
    ElementTree.parse(*save_figure(Target(tmp_path / "page", (".svg",)), lambda: draw_page(trial)))


def test_of_many_marks_the_svg_holds_a_picture(trials, pages, saved, tmp_path, monkeypatch) -> None:
    trial = trials["thesis"]
    monkeypatch.setattr(trial_page, "MAX_VECTOR_MARKS", 20)
    assert min(len(trial.flash_s), len(trial.time_s), trial.firing_s.size * 10) > 20
    many = draw_page(trial)
    assert [rasterized(axes) for axes in many.axes] == [{False}, {True}, {True}, {True}]
    assert [rasterized(axes) for axes in pages["thesis"]] == [{False}] * 4
    (written,) = save_figure(Target(tmp_path / "many", (".svg",)), lambda: many)
    pictures = [[*ElementTree.parse(svg).iter(f"{SVG}image")] for svg in (written, saved.with_name("page.svg"))]
    assert len(pictures[0]) >= 3
    assert pictures[1] == []


def test_plot_of_a_recording_writes_beside_it_and_names_the_files(file, saved, tmp_path) -> None:
    own = tmp_path / "v0.5.rrd"
    own.write_bytes(file.read_bytes())
    result = call("plot", own)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [str(tmp_path / "v0.5.png"), str(tmp_path / "v0.5.svg")]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["v0.5.png", "v0.5.rrd", "v0.5.svg"]
    assert own.read_bytes() == file.read_bytes()
    for ending in ENDINGS:
        assert own.with_suffix(ending).read_bytes() == saved.with_name(f"page{ending}").read_bytes()
