"""Claims about the page of a trial: what is drawn is what was recorded, and the same trial gives the same files."""

import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import image
from matplotlib.axes import Axes
from matplotlib.cbook import is_math_text
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import RecordingError
from epuck_sim.figures.saving import Target, save_figure
from epuck_sim.figures.trial_page import MAX_VECTOR_MARKS, RED, check_drawable, draw_page, page_title
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.recording import Level
from epuck_sim.recording.layers.arena import UNLABELLED
from epuck_sim.recording.reader import read_recording
from epuck_sim.recording.recorded import Recorded
from epuck_sim.recording.recorder import record
from epuck_sim.recording.rows import PATH_S
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from tests.cli.commands import call, refused
from tests.figures.drawn import laid_out

ENDINGS = (".png", ".svg")
SVG = "{http://www.w3.org/2000/svg}"

MIXED = {
    "name": "mixed",
    "robots": [
        {"count": 2, "parameters": {"period_s": 4}},
        {"count": 1, "controller": "obstacle_avoidance"},
        {"count": 3, "parameters": {"period_s": 5}},
    ],
    "stop": {"reference_robot": 4, "max_time_s": 25, "order_parameter": 1},
}
LONG = {
    "name": "long",
    "robots": [{"count": 12, "parameters": {"period_s": 1}}],
    "stop": {"max_time_s": 520, "order_parameter": 1},
}
"""Of more flashes, steps and phases than are drawn one by one."""


def recorded(path: Path, scenario: Any, seed: int = 0, level: Level = Level.POSES) -> Recorded:
    """Return a trial that is recorded into a file."""
    loaded = load_scenario(scenario)
    with record(path, loaded, seed, level) as recorder:
        run_trial(Simulation(loaded, seed), [recorder])
    return read_recording(path)


def panels(trial: Recorded) -> list[Axes]:
    """Return the arena, the flashes, the phases and the order parameter."""
    return draw_page(trial).axes


def circles(axes: Axes) -> list[Circle]:
    return [patch for patch in axes.patches if isinstance(patch, Circle)]


def robots(axes: Axes) -> list[Circle]:
    return [circle for circle in circles(axes) if circle.radius == epuck.RADIUS_CM and circle.get_zorder() > 1]


def lines(axes: Axes, colour: str | None = None) -> list[Line2D]:
    """Return the lines of a colour; without one, those that are of no robot's front."""
    chosen = [(line, to_hex(line.get_color())) for line in axes.get_lines()]
    return [line for line, own in chosen if (own == colour if colour else own != "#ffffff")]


def points(line: Line2D) -> FloatArray:
    return np.column_stack([line.get_xdata(), line.get_ydata()])


def fullest(trial: Recorded) -> int:
    """Return the last of the steps with the most rings lit."""
    lit = trial.ring_on.sum(axis=1).tolist()
    return max(range(len(lit)), key=lambda step: (lit[step], step))


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
def thesis(file) -> Recorded:
    return read_recording(file)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("mixed") / "mixed.rrd", MIXED)


@pytest.fixture(scope="module")
def long(tmp_path_factory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("long") / "long.rrd", LONG)


@pytest.fixture(scope="module")
def saved(thesis, tmp_path_factory) -> Path:
    """Return the stem of the files of a page."""
    stem = tmp_path_factory.mktemp("saved") / "page"
    saved_page(thesis, stem, ENDINGS)
    return stem


def saved_page(trial: Recorded, stem: Path, formats: tuple[str, ...] = (".svg",)) -> list[Path]:
    return save_figure(Target(stem, formats), lambda: draw_page(trial))


# What is drawn over time


def test_each_flash_is_a_mark_at_its_time_in_the_row_of_its_robot(thesis) -> None:
    _, axes, *_ = panels(thesis)
    (marks,) = axes.collections
    segments = np.array(marks.get_segments())
    assert len(segments) > 20
    np.testing.assert_array_equal(segments[:, :, 0], np.column_stack([thesis.flash_s] * 2))
    np.testing.assert_allclose(segments[:, :, 1].mean(axis=1), thesis.flash_robot)
    assert (np.ptp(segments[:, :, 1], axis=1) < 1).all()
    assert to_hex(marks.get_color()[0]) == RED


def test_there_is_a_row_for_each_robot(mixed) -> None:
    _, axes, *_ = panels(mixed)
    bottom, top = axes.get_ylim()
    assert bottom < -0.4
    assert 5.4 < top < 6
    assert set(mixed.flash_robot) == {0, 1, 3, 4, 5}


@pytest.mark.parametrize("count", [1, 2, 12])
def test_rows_have_whole_numbers(tmp_path, count: int) -> None:
    trial = recorded(tmp_path / "t.rrd", {"robots": [{"count": count}], "stop": {"max_time_s": 1}})
    _, axes, *_ = panels(trial)
    bottom, top = axes.get_ylim()
    ticks = [float(tick) for tick in axes.get_yticks() if bottom < tick < top]
    assert ticks
    assert all(tick.is_integer() for tick in ticks)


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_phases_are_relative_to_the_reference_at_its_firings(request, name: str) -> None:
    trial = request.getfixturevalue(name)
    _, _, axes, _ = panels(trial)
    drawn = [points(line) for line in axes.get_lines()]
    periods = [
        group.parameters.get("period_s", math.nan) for group in trial.scenario.robots for _ in range(group.count)
    ]
    rows = [[*trial.time_s].index(firing) for firing in trial.firing_s]
    angles = 2 * math.pi * trial.phase_ms[rows] / (1000 * np.array(periods))
    reference = trial.scenario.stop.reference_robot
    assert len(drawn) == trial.scenario.robot_count
    assert len(rows) > 3
    for robot, marks in enumerate(drawn):
        np.testing.assert_array_equal(marks[:, 0], trial.firing_s)
        expected = np.exp(1j * (angles[:, robot] - angles[:, reference]))
        np.testing.assert_allclose(np.exp(2j * math.pi * marks[:, 1]), expected, atol=1e-9)
        assert (np.abs(marks[:, 1][~np.isnan(marks[:, 1])]) <= 0.5).all()
        assert np.isnan(marks[:, 1]).all() == np.isnan(periods[robot])
    assert (drawn[reference][:, 1] == 0).all()
    assert max(np.nanmax(np.abs(marks[:, 1])) for marks in (drawn[0], drawn[1])) > 0.02
    bottom, top = axes.get_ylim()
    assert bottom < -0.5 < 0.5 < top


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_the_order_parameter_is_drawn_at_steps_and_at_firings_with_its_threshold(request, name: str) -> None:
    trial = request.getfixturevalue(name)
    *_, axes = panels(trial)
    steps, firings, threshold = axes.get_lines()
    np.testing.assert_array_equal(points(steps), np.column_stack([trial.time_s, trial.order_parameter]))
    np.testing.assert_array_equal(points(firings), np.column_stack([trial.firing_s, trial.firing_order]))
    assert [*threshold.get_ydata()] == [trial.scenario.stop.order_parameter] * 2
    bottom, top = axes.get_ylim()
    assert bottom == 0
    assert 1 < top < 1.1


def test_an_order_parameter_below_0_is_within_the_page(tmp_path) -> None:
    stop = {"metric": "reference", "max_time_s": 10, "order_parameter": 1}
    trial = recorded(tmp_path / "t.rrd", {"stop": stop})
    *_, axes = panels(trial)
    assert axes.get_ylim()[0] <= trial.order_parameter.min() < 0


def test_time_is_the_same_in_all_panels_and_all_of_it_is_there(thesis) -> None:
    _, *timed = panels(thesis)
    assert len({axes.get_xlim() for axes in timed}) == 1
    left, right = timed[0].get_xlim()
    assert left <= 0
    assert thesis.time_s[-1] < right < 1.1 * thesis.time_s[-1]
    assert timed[-1].get_xlabel() == "simulated time (s)"


def test_the_title_names_scenario_seed_and_outcome(thesis, mixed) -> None:
    outcome = f"synchronised after {thesis.cycles} cycles"
    assert draw_page(thesis).get_suptitle() == f"thesis, seed 0: {outcome}"
    title = draw_page(mixed._replace(seed=10**30)).get_suptitle()
    assert title.splitlines()[0] == f"mixed, seed {10**30}: not synchronised"


def test_the_title_names_what_is_not_as_in_the_shipped_scenario(tmp_path) -> None:
    settings = ["robots.0.parameters.speed_cm_s=3", "stop.max_time_s=1", "trials=7"]
    trial = recorded(tmp_path / "t.rrd", load_scenario("thesis", settings))
    first, *rest = draw_page(trial).get_suptitle().splitlines()
    assert first == "thesis, seed 0: not synchronised"
    assert sorted("".join(rest).removeprefix("with ").split(", ")) == ["V = 3 cm/s", "max time = 1 s"]


# What can be read


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_labels_beside_the_panels_do_not_run_into_each_other(request, name: str) -> None:
    arena, *timed = laid_out(draw_page(request.getfixturevalue(name))).axes
    boxes = [axes.yaxis.label.get_window_extent() for axes in timed]
    for above, below in pairwise(boxes):
        assert above.y0 > below.y1 + 3
    assert all(box.x0 > arena.get_window_extent().x1 for box in boxes)


def test_lines_of_the_order_parameter_are_named_with_the_threshold(thesis) -> None:
    *_, axes = panels(thesis)
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["at each step", "at firings of the reference", "threshold 0.95"]
    laid_out(axes.figure)
    box, page = axes.get_legend().get_window_extent(), axes.figure.bbox
    assert page.y0 <= box.y0
    assert box.y1 < axes.get_window_extent().y0


def test_each_robot_has_its_number_on_its_disc_unless_there_are_too_many(thesis, tmp_path) -> None:
    arena, *_ = panels(thesis)
    assert [text.get_text() for text in arena.texts] == [str(robot) for robot in range(10)]
    for text, body in zip(arena.texts, robots(arena), strict=True):
        assert math.dist(text.get_position(), body.center) < epuck.RADIUS_CM / 2
    scenario = {"arena": {"width_cm": 100, "height_cm": 100}, "robots": [{"count": UNLABELLED}]}
    many, *_ = panels(recorded(tmp_path / "t.rrd", {**scenario, "stop": {"max_time_s": 0.1}}))
    assert not many.texts


@pytest.mark.parametrize("is_lit", [False, True])
def test_a_trial_without_oscillators_has_no_empty_panels(tmp_path, is_lit: bool) -> None:
    group = {"controller": "constant", "parameters": {"ring_on": is_lit}}
    trial = recorded(tmp_path / "t.rrd", {"robots": [group], "stop": {"max_time_s": 2}})
    figure = laid_out(draw_page(trial))
    assert len(figure.axes) == 1 + is_lit
    assert figure.axes[0].get_xlabel() == "x (cm)"
    assert figure.axes[-1].get_xlabel() == ("simulated time (s)" if is_lit else "x (cm)")
    assert "without oscillators" in figure.get_suptitle()


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_a_cube_is_said_to_be_seen_from_above(tmp_path, dimensions: int) -> None:
    settings = [f"space.dimensions={dimensions}", "agents.count=4", "stop.max_cycles=2"]
    scenario = load_scenario("particles", settings)
    with record(tmp_path / "t.rrd", scenario, 0, Level.POSES) as recorder:
        run_trial(ParticleSimulation(scenario, 0), [recorder])
    arena, *_ = laid_out(draw_page(read_recording(tmp_path / "t.rrd"))).axes
    assert ("a cube seen from above" in arena.get_title()) == (dimensions == 3)
    assert arena.title.get_window_extent().x0 >= 0
    assert arena.yaxis.label.get_window_extent().x0 >= 0


# The arena


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_robots_are_where_they_were_when_most_rings_were_lit_for_the_last_time(request, name: str) -> None:
    trial = request.getfixturevalue(name)
    arena, *_ = panels(trial)
    moment = fullest(trial)
    bodies = robots(arena)
    assert len(bodies) == trial.scenario.robot_count
    np.testing.assert_array_equal([body.center for body in bodies], trial.positions[moment])
    assert [to_hex(body.get_facecolor()) == RED for body in bodies] == trial.ring_on[moment].tolist()
    assert trial.ring_on[moment].any()
    assert arena.get_title().startswith(f"at {trial.time_s[moment]:.1f} s")


def test_the_edge_of_a_disc_is_parted_from_its_middle_by_white(thesis) -> None:
    arena, *_ = panels(thesis)
    inner = [circle for circle in circles(arena) if not circle.get_fill()]
    assert len(inner) == 10
    for line, body in zip(inner, robots(arena), strict=True):
        assert (to_hex(line.get_edgecolor()), tuple(line.center)) == ("#ffffff", tuple(body.center))
        assert 0.8 * body.radius < line.radius < body.radius
        assert line.get_zorder() > body.get_zorder()


def test_each_robot_has_its_front_where_it_heads(thesis) -> None:
    arena, *_ = panels(thesis)
    moment = fullest(thesis)
    fronts = lines(arena, "#ffffff")
    assert len(fronts) == thesis.scenario.robot_count
    for line, place, heading in zip(fronts, thesis.positions[moment], thesis.headings[moment], strict=True):
        ahead = epuck.RADIUS_CM * np.array([math.cos(heading), math.sin(heading)])
        np.testing.assert_allclose(points(line), [place, place + ahead], atol=1e-5)


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_paths_are_those_of_the_last_seconds_in_cm(request, name: str) -> None:
    trial = request.getfixturevalue(name)
    arena, *_ = panels(trial)
    moment = fullest(trial)
    step_s = trial.time_s[1]
    assert trial.time_s[moment] > PATH_S
    paths = lines(arena)
    assert len(paths) == trial.scenario.robot_count
    for robot, line in enumerate(paths):
        path = points(line)
        assert PATH_S - 1.01 * step_s < (len(path) - 1) * step_s < PATH_S + 0.01 * step_s
        np.testing.assert_array_equal(path, trial.positions[moment + 1 - len(path) : moment + 1, robot])
    assert arena.get_title().endswith("with the paths of 10 s")


def test_paths_of_a_moment_soon_after_the_beginning_are_shorter(thesis) -> None:
    lit = np.zeros_like(thesis.ring_on)
    lit[30, 4] = True
    arena, *_ = panels(thesis._replace(ring_on=lit))
    assert arena.get_title() == "at 3.0 s, with the paths of 3 s"
    for robot, line in enumerate(lines(arena)):
        np.testing.assert_array_equal(points(line), thesis.positions[:31, robot])
    assert [to_hex(body.get_facecolor()) == RED for body in robots(arena)] == [n == 4 for n in range(10)]


def test_walls_and_obstacles_are_drawn_where_they_stand(tmp_path) -> None:
    trial = recorded(tmp_path / "t.rrd", load_scenario("obstacles", ["stop.max_time_s=12"]))
    arena, *_ = panels(trial)
    (pillar,) = [circle for circle in circles(arena) if circle.get_zorder() == 1]
    assert (pillar.center, pillar.radius) == ((30, 30), 6)
    assert len(robots(arena)) == 10
    bar, wedge = [patch for patch in arena.patches if isinstance(patch, Polygon)]
    np.testing.assert_allclose(wedge.get_xy()[:3], [(20, 70), (35, 72), (24, 85)])
    np.testing.assert_allclose(bar.get_xy()[:4].mean(axis=0), (65, 60))
    assert math.hypot(*np.diff(bar.get_xy()[:2], axis=0)[0]) == pytest.approx(30)
    (walls,) = [patch for patch in arena.patches if isinstance(patch, Rectangle)]
    assert (walls.get_bbox().bounds, walls.get_fill()) == ((0, 0, 100, 100), False)


@pytest.mark.parametrize(("width", "height"), [(200, 40), (40, 200), (60, 60)])
def test_the_whole_arena_is_within_the_page_and_undistorted(tmp_path, width: float, height: float) -> None:
    given = {"arena": {"width_cm": width, "height_cm": height}, "stop": {"max_time_s": 1}}
    arena, *_ = panels(recorded(tmp_path / "t.rrd", given))
    arena.figure.draw_without_rendering()
    (left, right), (bottom, top) = arena.get_xlim(), arena.get_ylim()
    assert left <= 0 < width <= right
    assert bottom <= 0 < height <= top
    assert arena.get_aspect() == 1
    box = arena.get_window_extent()
    assert box.width / (right - left) == pytest.approx(box.height / (top - bottom), rel=0.01)


def test_a_robot_has_one_colour_on_the_whole_page(thesis) -> None:
    arena, _, phases, _ = panels(thesis)
    colours = [to_hex(line.get_color()) for line in phases.get_lines()]
    assert [to_hex(line.get_color()) for line in lines(arena)] == colours
    assert [to_hex(body.get_edgecolor()) for body in robots(arena)] == colours
    assert len(set(colours)) == 10


# What can be drawn


@pytest.mark.parametrize(
    "scenario",
    [
        *("push", "arc", "spotlight", "wall", "pair"),
        {"robots": [{"poses": [[30, 30, 0]]}], "stop": {"max_time_s": 12}},
        {"robots": [{"poses": [[30, 30, 0]], "controller": "constant"}], "stop": {"max_time_s": 0.01}},
        {"stop": {"max_time_s": 0.01}},
        {**MIXED, "stop": {"reference_robot": 2, "max_time_s": 6}},
        {
            "arena": {"width_cm": 400, "height_cm": 400},
            "robots": [{"count": 200}, {"count": 20, "controller": "constant"}],
            "stop": {"max_time_s": 7},
        },
    ],
    ids=["push", "arc", "spotlight", "wall", "pair", "alone", "one step", "a step of many", "no firing", "hundreds"],
)
def test_any_trial_can_be_drawn(tmp_path, scenario: str | Mapping[str, Any]) -> None:
    trial = recorded(tmp_path / "t.rrd", scenario)
    arena, *_ = laid_out(draw_page(trial)).axes
    assert len(robots(arena)) == trial.scenario.robot_count


@pytest.mark.parametrize("name", ["costs $5 and $6", "a $\\frac{$", "x_1^2 \\alpha & <b> {0} 50 %", "[/red]", "群れ"])
def test_a_name_is_no_formula(tmp_path, name: str) -> None:
    trial = recorded(tmp_path / "t.rrd", {"name": name, "stop": {"max_time_s": 1}})
    figure = draw_page(trial)
    (title,) = figure.texts
    assert title.get_text().startswith(f"{name}, seed 0: ")
    assert not (title.get_parse_math() and is_math_text(title.get_text()))
    saved_page(trial, tmp_path / "page")
    ElementTree.parse(tmp_path / "page.svg")


def test_of_many_marks_the_svg_holds_a_picture(long, thesis, saved, tmp_path) -> None:
    assert min(len(long.flash_s), len(long.time_s), long.firing_s.size * 12) > MAX_VECTOR_MARKS
    assert [rasterized(axes) for axes in panels(long)] == [{False}, {True}, {True}, {True}]
    assert [rasterized(axes) for axes in panels(thesis)] == [{False}] * 4
    (first,), (again,) = (saved_page(long, tmp_path / name) for name in ("first", "again"))
    assert first.read_bytes() == again.read_bytes()
    assert len([*ElementTree.parse(first).iter(f"{SVG}image")]) >= 3
    assert first.stat().st_size < 1_000_000
    assert [*ElementTree.parse(saved.with_name("page.svg")).iter(f"{SVG}image")] == []


def test_many_marks_are_drawn_all_the_same(long) -> None:
    _, flashes, phases, order = panels(long)
    assert len(flashes.collections[0].get_segments()) == len(long.flash_s)
    assert all(len(line.get_xdata()) == len(long.firing_s) for line in phases.get_lines())
    assert len(order.get_lines()[0].get_xdata()) == len(long.time_s)


# The files


def test_the_png_is_a_picture_and_not_blank(thesis, saved) -> None:
    picture = image.imread(saved.with_name("page.png"))[..., :3]
    assert picture.shape == (1680, 3600, 3)
    assert picture.std() > 0.05
    packed = (picture * 255).round().astype(np.int64) @ (1 << 16, 1 << 8, 1)  # whole rows take seconds to sort
    colours = {f"#{colour:06x}" for colour in np.unique(packed)}
    arena, *_ = panels(thesis)
    assert {RED, *(to_hex(body.get_edgecolor()) for body in robots(arena))} <= colours
    quarters = [half for side in np.hsplit(picture, 2) for half in np.vsplit(side, 2)]
    assert min(quarter.std() for quarter in quarters) > 0.03


def test_the_same_trial_gives_the_same_files_byte_for_byte_and_another_one_others(saved, tmp_path) -> None:
    again = saved_page(recorded(tmp_path / "again.rrd", "thesis"), tmp_path / "again", ENDINGS)
    other = saved_page(recorded(tmp_path / "other.rrd", "thesis", seed=1), tmp_path / "other", ENDINGS)
    for ending, same, different in zip(ENDINGS, again, other, strict=True):
        first = saved.with_name(f"page{ending}").read_bytes()
        assert same.read_bytes() == first
        assert different.read_bytes() != first


def test_a_summary_has_nothing_to_draw(tmp_path) -> None:
    trial = recorded(tmp_path / "t.rrd", "pair", level=Level.SUMMARY)
    with pytest.raises(RecordingError, match=r"mine\.rrd: holds no poses.*--record-level poses or full"):
        check_drawable(trial, "mine.rrd")
    assert f"{tmp_path}/t.rrd: holds no poses" in refused("plot", tmp_path / "t.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["t.rrd"]


@pytest.mark.parametrize("stem", ["gone/page", "file/page", ".", "..", "/", "y" * 300, "taken-png", "taken-svg"])
def test_where_one_file_cannot_be_written_none_is(file, tmp_path, monkeypatch, stem: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    for ending in ENDINGS:
        (tmp_path / f"taken-{ending[1:]}{ending}").mkdir()
    before = sorted(tmp_path.rglob("*"))
    assert stem in refused("plot", file, "--to", stem)
    assert sorted(tmp_path.rglob("*")) == before


# The command


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


@pytest.mark.parametrize(("name", "written"), [("a.b", ["a.b.png", "a.b.svg"]), ("page.pdf", ["page.pdf"])])
def test_plot_of_a_recording_writes_where_and_what_it_should(file, tmp_path, name: str, written: list[str]) -> None:
    result = call("plot", file, "--to", tmp_path / name)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [str(tmp_path / each) for each in written]
    assert sorted(path.name for path in tmp_path.iterdir()) == written
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize(
    ("stop", "has_oscillators", "outcome"),
    [
        ({}, True, "not synchronised"),
        ({"order_parameter": None}, True, "7 cycles"),
        ({"order_parameter": None}, False, "without oscillators"),
    ],
)
def test_the_title_speaks_of_synchrony_where_a_trial_was_to_end_with_it(stop, has_oscillators, outcome) -> None:
    recorded = SimpleNamespace(scenario=load_scenario({"stop": stop}), seed=1, cycles=7, synchronised=False)
    assert page_title(recorded, has_oscillators=has_oscillators).splitlines()[0] == f"thesis, seed 1: {outcome}"
