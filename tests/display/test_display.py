"""Pictures of the arena show robots where they are, and tables have the same numbers in every form."""

import csv
import json
import math
import re
from base64 import b64decode
from dataclasses import replace
from io import StringIO
from itertools import product
from xml.etree.ElementTree import fromstring

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import ParticleSimulation, Simulation, load_scenario
from epuck_sim.arena import make_arena, make_floor
from epuck_sim.display.arena_svg import DARK, LIT, draw_arena
from epuck_sim.display.html import element, table, to_html
from epuck_sim.display.table import Row, Share, Table, cell_text
from epuck_sim.estimate import Estimate, significant
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.util.messages import shortest_endings

SQUARE = np.array([[10.0, 10.0], [20.0, 10.0], [20.0, 20.0], [10.0, 20.0]])


def test_robots_lie_where_they_are_with_y_upwards() -> None:
    arena = make_arena(60, 40, [(30, 30, 5)], [SQUARE])
    poses = np.array([[10.0, 30.0, 0.0], [50.0, 5.0, math.pi / 2]])
    drawn = draw_arena(arena, poses, 3.7, np.array([True, False]))
    walls, square = (each.get("points") for each in drawn.findall("polygon"))
    assert walls == "0,0 60,0 60,40 0,40"
    assert square == "10,30 20,30 20,20 10,20"
    first, second = drawn.findall("g")
    found = [[each.find("circle").get(key) for key in ("cx", "cy", "fill")] for each in (first, second)]
    assert found == [["10", "10", LIT], ["50", "35", DARK]]
    assert [each.find("text").text for each in (first, second)] == ["0", "1"]
    fronts = [(each.find("line").get("x2"), each.find("line").get("y2")) for each in (first, second)]
    assert fronts == [("13.7", "10"), ("50", "31.3")]


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_agents_are_shown_in_every_space(dimensions: int) -> None:
    simulation = ParticleSimulation({"model": "particles", "space": {"dimensions": dimensions}}, seed=1)
    simulation.run(3)
    drawn = fromstring("<div>" + simulation._repr_html_() + "</div>")
    places = [float(circle.get("cx")) for circle in drawn.findall(".//{*}circle")]
    assert np.allclose(places, simulation.positions()[:, 0], rtol=1e-4)
    assert ("a cube" in simulation._repr_html_()) == (dimensions == 3)


@pytest.mark.parametrize("name", ["thesis", "particles"])
def test_showing_changes_no_outcome(name: str) -> None:
    scenario = load_scenario(name, ["stop.max_cycles=5"])
    looked_at = simulate(scenario, 3)
    assert looked_at._repr_html_()
    watched = run_trial(looked_at, [lambda *_: looked_at._repr_html_()])
    if name == "thesis":  # robots turn round and round, but headings are shown as angles
        step = Simulation(name, seed=13).advance(800)
        shown = [float(row[3].text) for row in fromstring(f"<div>{step._repr_html_()}</div>").iterfind(".//tbody/tr")]
        assert max(map(abs, shown)) < 3.15 < max(map(abs, step.poses[:, 2]))
    assert watched._replace(wall_s=0) == run_trial(simulate(scenario, 3))._replace(wall_s=0)


def test_text_is_escaped_wherever_it_stands() -> None:
    nasty = "<b>&\"'"
    html = to_html(element("p", nasty, element("i", nasty), nasty, title=nasty), table([nasty], [[nasty]]))
    assert html.count("&lt;b&gt;&amp;") == 5
    assert 'title="<b&gt;&amp;&quot;' in html  # in an attribute, only > and quotes end something
    assert "<b>" not in html
    assert nasty not in load_scenario({"name": nasty})._repr_html_()
    ended = load_scenario("thesis", ["stop.order_parameter=null", "max_time_s=60"])._repr_html_()
    assert "<td>after 10000 cycles or 60 s</td>" in ended
    estimates = Table("<T>", [Row({"a": "<b>"}, {"mean": Estimate(44.21, 28.9, 66.8)})], ["x < y"])
    assert "<td>44 [29, 67]</td>" in to_html(estimates.to_html())
    assert all(escaped in estimates._repr_html_() for escaped in ("&lt;T&gt;", "&lt;b&gt;", "x &lt; y"))


NOBODY = np.empty((0, 3)), 3.7, np.empty(0, bool)


def test_patches_lie_in_their_order_below_everything_and_end_at_the_walls() -> None:
    floor = make_floor(0.8, [(0, (10, 30, 5)), (1, SQUARE), (0.5, (59, 1, 9))])
    drawn = draw_arena(replace(make_arena(60, 40, [(30, 30, 5)], []), floor=floor), *NOBODY)
    ground, walls, obstacle = drawn
    assert (ground.tag, ground.get("viewBox"), ground.get("y"), walls.tag) == ("svg", "0 0 60 40", "0", "polygon")
    fills = {"rect": "#cccccc", "circle": "#000000", "polygon": "#ffffff"}
    assert [(part.tag, part.get("fill")) for part in ground] == [*fills.items(), ("circle", "#808080")]
    assert [ground[1].get("cx"), ground[1].get("cy")] == ["10", "10"]
    assert ground[2].get("points") == "10,30 20,30 20,20 10,20"
    assert obstacle.tag == "circle"
    assert draw_arena(make_arena(60, 40, [], []), *NOBODY).find("svg") is None


def test_a_picture_of_the_floor_and_lamps_that_say_how_high_and_how_strong_they_are_are_shown() -> None:
    levels = np.array([[0, 100, 200], [50, 150, 250]], np.uint8)
    arena = replace(make_arena(60, 40, [], []), floor=make_floor(1, [(0.5, (30, 20, 5))], levels))
    picture, patch = draw_arena(arena, *NOBODY)[0]
    kind, _, coded = picture.get("href").partition(",")
    shown = cv2.imdecode(np.frombuffer(b64decode(coded), np.uint8), cv2.IMREAD_UNCHANGED)
    assert kind == "data:image/png;base64"
    assert (picture.get("width"), picture.get("height"), patch.get("fill")) == ("60", "40", "#808080")
    assert shown.shape == (213, 320)
    np.testing.assert_array_equal(shown[53::107, 53::107], levels)
    drawn = draw_arena(replace(make_arena(60, 40, [], []), lamps=np.array([(10, 30, 25, 2)], float)), *NOBODY)
    (lamp,) = drawn.findall("g")
    dot = lamp.find("circle")
    assert lamp.find("title").text == "lamp: 25 cm, strength 2"
    assert (dot.get("cx"), dot.get("cy")) == ("10", "10")


NUMBERS = st.floats(-1e6, 1e6) | st.floats(1e-6, 1e-3) | st.just(0.0)
WIDTHS = st.floats(1e-3, 1e5)
ESTIMATES = st.builds(
    lambda at, low, high: Estimate(at, at - low, at + high), NUMBERS, WIDTHS, WIDTHS | st.just(math.inf)
)


@st.composite
def tables(draw) -> Table:
    shares = st.builds(Share, st.floats(0, 1))
    kinds = st.sampled_from([ESTIMATES, ESTIMATES | st.none(), NUMBERS | st.none(), st.integers(0, 10**15), shares])
    columns = {f"name_{'long_' * n}{n}": draw(kinds) for n in range(draw(st.integers(1, 6)))}
    keys = [f"robots.{n}.parameters.speed_cm_s" for n in range(draw(st.integers(1, 3)))]
    rows = []
    for number in range(draw(st.integers(1, 4))):
        axes = {key: draw(st.sampled_from([1, 2.5, "firefly"])) for key in keys}
        rows.append(Row(axes, {"point": number, **{name: draw(cells) for name, cells in columns.items()}}))
    return Table("A title of some words " * 5, rows, ["A note of some words. " * 6])


def test_an_estimate_has_the_digits_that_its_interval_leaves() -> None:
    for ends, text in [
        ((44.21, 28.9, 66.8), "44 [29, 67]"),
        ((0.0223, 0.0101, 0.0338), "0.022 [0.010, 0.034]"),
        ((-0.695, -0.81, -0.6), "-0.695 [-0.810, -0.600]"),
        ((12345.6, 9000, 15000), "12300 [9000, 15000]"),
        ((47.0, 40.1, math.inf), "47.0 [40.1, ?]"),
        ((7, 7, 7), "7 [7, 7]"),
        ((47.027, math.nan, math.nan), "47"),
        ((math.nan, math.nan, math.nan), "-"),
        ((0, -1, 1), "0.0 [-1.0, 1.0]"),
    ]:
        assert str(Estimate(*ends)) == text


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12))
def test_a_number_has_three_significant_digits_and_is_as_near_as_these_allow(number: float) -> None:
    text = significant(number)
    digits = re.sub(r"e.*|[-.]", "", text).lstrip("0")
    assert len(digits.rstrip("0")) <= 3
    assert float(text) == pytest.approx(number, rel=0.00501)


@given(ESTIMATES)
def test_an_interval_is_shown_as_wide_as_it_is(estimate: Estimate) -> None:
    low, high = re.fullmatch(r".* \[(.*), (.*)\]", str(estimate)).groups()
    width = min(estimate.value - estimate.low, estimate.high - estimate.value)
    for shown, true in ((low, estimate.low), (high, estimate.high)):
        if shown != "?":
            assert float(shown) == pytest.approx(true, rel=0.00501, abs=0.051 * width)


@settings(max_examples=40)
@given(tables(), st.integers(40, 120))
def test_on_a_terminal_every_cell_is_whole_and_no_line_longer_than_it_need_be(table: Table, width: int) -> None:
    text = table.to_text(width)
    for row in table.rows:
        for cell in row.cells.values():
            if isinstance(cell, Estimate):
                assert any(cell_text(cell) in line for line in text.splitlines())
    widest = max(len(cell_text(cell)) for row in table.rows for cell in row.cells.values())
    longest_key = max(map(len, shortest_endings(table.rows[0].axes).values()))
    least = max(len("point"), widest, len("long")) + longest_key + 4
    assert max(map(len, text.splitlines())) <= max(width, 3 * least)


def test_what_fits_stands_in_one_part_with_numbers_below_each_other_and_columns_that_others_tell_above() -> None:
    rows = [Row({"robots.0.count": n}, {"point": n, "mean": Estimate(40 + n, 30, 60 + n), "p": 0.04}) for n in (3, 10)]
    assert Table("T_sync", rows, ["A note."]).to_text(80).splitlines() == [
        "T_sync",
        "p 0.04",
        "point  count         mean",
        "-----  -----  -----------",
        "    3      3  43 [30, 63]",
        "   10     10  50 [30, 70]",
        "A note.",
    ]
    axes = [{"arena.width_cm": n, "arena.height_cm": 2 * n, "robots.0.count": 5} for n in (40, 60)]
    rows = [Row(each, {"trials": 20, "mean": Estimate(each["arena.width_cm"])}) for each in axes]
    text = Table("T_sync", rows).to_text(80)
    assert text.splitlines()[1] == "height_cm 80, 120 with width_cm; count = 5; trials 20"
    assert text.splitlines()[2].split() == ["width_cm", "mean"]
    quotients = Table("T_sync", [Row({}, {"ratio": None})], headings={"ratio": "B / A"})
    assert quotients.to_text(80).splitlines()[1] == "B / A"


def test_values_of_axes_are_shown_as_scenarios_have_them_and_with_all_of_their_digits_in_csv() -> None:
    axes = [[{"shape": "box", "x_cm": 30, "is_low": True}], [], None, False, "a\nb"]
    lines = Table("", [Row({"arena.obstacles": each}, {"trials": n}) for n, each in enumerate(axes)]).to_text()
    shown = [line.rpartition("  ")[0].strip() for line in lines.splitlines()[2:]]
    assert shown == ["[{shape: box, x_cm: 30, is_low: true}]", "[]", "null", "false", r"a\nb"]
    each = ((1_000_000, 1234567), (1_000_001, np.int64(1234567)))
    rows = [Row({"max_cycles": cycles, "speed": 0.1234567}, {"trials": trials}) for cycles, trials in each]
    head, *lines = Table("", rows).to_csv().splitlines()
    assert head == "max_cycles,speed,trials"
    assert lines == [f"{cycles},0.1234567,1234567" for cycles in (1_000_000, 1_000_001)]
    in_any_order = [Row({"n": 1, "v": 2}, {"mean": 3, "sd": 4}), Row({"v": 6, "n": 5}, {"sd": 8, "mean": 7})]
    assert Table("", in_any_order).to_csv().splitlines() == ["n,v,mean,sd", "1,2,3,4", "5,6,7,8"]


def test_a_table_that_is_too_wide_comes_in_parts_with_what_tells_rows_apart() -> None:
    names = [f"statistic {n}" for n in range(6)]
    cells = [{"point": n, **dict.fromkeys(names, Estimate(n, n - 1.0, n + 1.0))} for n in (2, 3)]
    rows = [Row({"controller": f"/home/me/{each['point']}.py"}, each) for each in cells]
    text = Table("T_sync", rows).to_text(40)
    assert "points 2 to 3, in order" in text
    assert "home" not in text
    assert all(len(line) <= 40 for line in text.splitlines())
    assert text.count("2.py") == text.count("controller") == 6
    assert text.count("2.0 [1.0, 3.0]") == 6
    rows = [Row({}, {"quantity": name, **cells[0]}) for name in names]
    parts = Table("", [row._replace(cells={k: v for k, v in row.cells.items() if k != "point"}) for row in rows])
    assert parts.to_text(40).count("statistic 5") > 2  # nothing but the first column tells rows apart
    keys = [f"a_long_key_{n}" for n in range(3)]  # wider than half of the terminal
    for cell, name in (("point", "point"), ("mean", "row")):
        rows = [Row(dict(zip(keys, each, strict=True)), {cell: n}) for n, each in enumerate(product((1, 2), repeat=3))]
        first, second = (part.splitlines()[-10:] for part in Table("T_sync", rows).to_text(40).split("\n\n"))
        assert [first[0].split(), second[0].split()[:2]] == [[name, *keys[:2]], [name, keys[2]]]


@given(st.lists(st.sampled_from(["a.b.c", "a.c", "x.b.c", "c", "a.b", "a.0"]), min_size=1, unique=True))
def test_shortest_endings_are_unique_and_shortest(keys: list[str]) -> None:
    endings = shortest_endings(keys)
    assert len(set(endings.values())) == len(keys)
    for key, ending in endings.items():
        assert key == ending or key.endswith(f".{ending}")
        shorter = ending.partition(".")[2]
        assert shorter in ("", "0") or any(f".{other}".endswith(f".{shorter}") for other in keys if other != key)


@settings(max_examples=40)
@given(tables())
def test_json_and_csv_have_every_number(table: Table) -> None:
    read = json.loads(json.dumps(table.records()))
    of_csv = list(csv.DictReader(StringIO(table.to_csv())))
    for row, record, line in zip(table.rows, read, of_csv, strict=True):
        assert record["axes"] == row.axes
        for name, cell in row.cells.items():
            numbers = cell.ends if isinstance(cell, Estimate) else (cell,)
            for number, key in zip(numbers, (name, f"{name}_low", f"{name}_high"), strict=False):
                known = number is not None and math.isfinite(number)
                assert record[key] == (number if known else None)
                assert (line[key] == "") == (not known)
                assert not known or float(line[key]) == pytest.approx(number, rel=1e-5)
