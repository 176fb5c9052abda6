"""What a page promises: one file, no network, who is refused, and trials that are the program's to the bit."""

import gzip
import json
import re
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from epuck_sim import ScenarioError, load_scenario, run_trial
from epuck_sim.page import build, roots
from epuck_sim.page.roots import ANEW, FOLDER, digest_kernels, meanings, own_roots, read_module
from epuck_sim.page.writer import Page, make_page, page_data, write_page
from epuck_sim.statistics.statistic import Measured, estimate_mean
from epuck_sim.trial.model import simulate
from epuck_sim.util.seeds import trial_seed
from tests import golden
from tests.browsers import Driven
from tests.cli.commands import call
from tests.control.bench import EMPTY, with_sense
from tests.tools import needs_browser


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    driven = Driven(tmp_path_factory.mktemp("browser") / "profile")
    yield driven
    driven.close()


@pytest.fixture
def opened(browser: Driven, tmp_path: Path) -> Iterator[Callable[..., Driven]]:
    """A function that opens the page of a scenario, with changes, and returns the browser."""

    def open_page(name: str, changes: Sequence[str] = ()) -> Driven:
        write_page(name, tmp_path / "page.html", changes)
        browser.said.clear()
        browser.open((tmp_path / "page.html").as_uri())
        return browser

    yield open_page
    browser.leave()


@pytest.mark.parametrize("model", ["particles", "embodied"])
def test_the_webassembly_is_made_from_the_kernels_as_they_are_and_asks_for_nothing(model: Any) -> None:
    assert (FOLDER / f"{model}.digest").read_text().strip() == digest_kernels(model), f"kernels have changed; {ANEW}"
    module = gzip.decompress(read_module(model))
    assert module[:8] == b"\0asm\1\0\0\0"
    place, sections = 8, set()
    while place < len(module):
        kind, place, size, shift = module[place], place + 1, 0, 0
        while True:
            byte, place = module[place], place + 1
            size, shift = size | (byte & 127) << shift, shift + 7
            if byte < 128:
                break
        sections.add(kind)
        place += size
    assert 2 not in sections  # imports


LIMIT = 3


def test_comments_and_docstrings_make_no_webassembly_stale_but_code_and_values_do(monkeypatch) -> None:
    def one(x: float) -> float:
        return x + LIMIT

    def same(x: float) -> float:
        """Add."""
        return x + LIMIT  # a limit

    def other(x: float) -> float:
        return x - LIMIT

    def said(function: Any) -> list[str]:
        return [text.replace(function.__name__, "f") for text in meanings(function, set())]

    assert said(one) == said(same) != said(other)
    before = said(one)
    monkeypatch.setitem(globals(), "LIMIT", 4)
    assert said(one) != before


@pytest.mark.parametrize("name", ["particles", "kilobots", "obstacles", "spotlight"])
def test_a_page_is_one_small_file_that_names_no_other(name: str) -> None:
    page = make_page(load_scenario(name), name)
    assert page == make_page(load_scenario(name), name)
    assert len(gzip.compress(page.encode())) < 500_000
    readable = re.sub(r'<script id="(data|wasm)".*?</script>', "", page, flags=re.DOTALL)
    addresses = set(re.findall(r"(?:https?:)?//[\w.-]+\.\w+[^\s\"']*", readable))
    assert addresses <= {"http://www.w3.org/2000/svg"}
    assert re.findall(r"<(?:link|img|iframe)\b|\bsrc=|@import|url\(", readable) == []
    assert ("default-src 'none'" in page, "unsafe-inline" in page) == (True, False)
    assert "@" not in re.sub(r"<(style|script).*?</\1>", "", page, flags=re.DOTALL)  # all names are filled in


CURVE = "def phase_shift(phase, coupling, parameters):\n    return {}\n"


def test_files_of_ones_own_are_kernels_that_the_page_calls_by_their_names(tmp_path: Path, monkeypatch) -> None:
    """With ziglang, which takes long, another test has them run."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(EMPTY)
    Path("curve.py").write_text(CURVE.format("coupling * phase"))
    for name in ("near", "far"):
        Path(f"{name}.py").write_text(with_sense(f"readings.{name} = 1.0", f"{{'{name}': float}}"))
    groups = "robots=[{count: 4}, {count: 3, controller: mine.py, sensors: [near.py, far.py]}]"
    scenario = load_scenario("thesis", [groups])
    found = {name: kernel.function.__globals__ for name, (kernel, _) in own_roots(scenario).items()}
    assert found.keys() == {"run_group_1", "sense_0", "sense_1"}
    assert [found[f"sense_{number}"]["READINGS"].names for number in range(2)] == [("near",), ("far",)]
    data = page_data(scenario, "thesis")
    labels = {each["label"] for each in data["settings"]}
    assert {"speed of the first group", "field of view of the first group"} <= labels
    swarm = data["facts"]["swarms"][4]
    called = list(swarm["functions"].values())
    assert called == ["run_firefly", "run_group_1", "sense_infrared", "look", "sense_0", "sense_1"]
    assert [streams["robot"] for streams in swarm["streams"]] == [4, 4]
    bent = load_scenario("particles", ["response.curve=curve.py"])
    assert list(own_roots(bent)) == [roots.CURVE]
    assert roots.CURVE in json.dumps(page_data(bent, "particles"))


def test_arrays_that_robots_remember_are_set_and_named_number_by_number(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(f'{EMPTY}\nMEMORY = {{"own": (float, 2), "on": bool}}\n')
    memory = "memory: {own: [[1, 2], [3, 4], [5, 6]], on: 1}"
    scenario = load_scenario("thesis", [f"robots=[{{count: 3, controller: mine.py, {memory}}}]"])
    facts = page_data(scenario, "thesis")["facts"]
    assert facts["memories"] == [{"own.0": (0, "f8"), "own.1": (8, "f8"), "on": (16, "i8")}]
    assert facts["memory"] == [{"own.0": [1, 3, 5], "own.1": [2, 4, 6], "on": 1}]


def test_files_of_ones_own_need_ziglang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text(CURVE.format("coupling * phase"))
    monkeypatch.setattr(build, "find_spec", lambda _: None)
    with pytest.raises(ScenarioError, match=r'response curves in files .* pip install "epuck-sim\[page\]"'):
        write_page("particles", tmp_path / "x.html", [f"response.curve={tmp_path / 'mine.py'}"])
    assert not (tmp_path / "x.html").exists()


def test_commands_write_a_page_and_say_where_or_open_it_and_notebooks_show_it(monkeypatch, tmp_path) -> None:
    path, scenario = tmp_path / "x.html", tmp_path / "my own.yaml"
    scenario.write_text("model: particles")
    result = call("page", scenario, "--set", "space.dimensions=3", "--to", path)
    assert (result.exit_code, result.stdout.strip()) == (0, str(path))
    assert f"epuck-sim page '{scenario}' --set space.dimensions=3 --set KEY=VALUE" in unescape(path.read_text())
    assert "lines lead to their receivers; this is a cube seen from above. Space plays" in path.read_text()
    assert "Cycles of agent 3<" in make_page(load_scenario("particles", ["stop.reference=3"]), "")
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("epuck_sim.util.cache_folder.cache_root", lambda: tmp_path)
    paths = [Path(call("play", name).stdout.strip()) for name in ("particles", "pair")]
    assert opened == [paths[0].as_uri()] * 2
    assert "epuck-sim page pair" in paths[0].read_text()
    changed = load_scenario("thesis", ["robots.0.count=5"])
    for scenario in ("particles", "thesis", changed):
        shown = Page(scenario, seed=5)._repr_html_()
        assert shown.startswith("<iframe")
        assert 'sandbox="allow-scripts' in shown
        assert ("<pre hidden" in unescape(shown)) == (scenario is changed)  # its name would give another trial
    write_page(changed, path)
    assert "<pre hidden" in path.read_text()


@needs_browser
@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_a_page_opens_from_disk_without_network_and_without_complaint(opened, name: str) -> None:
    browser = opened(name)
    for control in ("step", "again", "next", "play"):
        browser.run(f"find('{control}').click()")
    key = "dispatchEvent(new KeyboardEvent('keydown', {{ key: '{}', bubbles: true }}))"
    for control in ("play", "slider-0", "arena"):  # what was pressed last keeps no keys from the page
        browser.run(f"find('{control}').{key.format('n')}")
    assert browser.run(f"find('seed').{key.format('n')}, find('play').{key.format(' ')}, String(page.seed)") == "4"
    browser.run("find('hundred').click(); find('stop').click(); logTicks(0, 1); logTicks(1, Infinity)")
    assert browser.run("[12.345, 0.0123, 1234.5, 98765].map(rounded)") == ["12.3", "0.0123", "1230", "98,800"]
    browser.run("page.chosen = 2; page.show_one(); page.touch(() => page.swarm.put(2, 20, 20)); page.draw()")
    browser.run("find('find').value = 'stop'; page.show_keys()")
    seen = "[find('one').hidden, find('one').textContent.includes('1 others'), find('trouble').hidden]"
    assert browser.run(seen) == [False, False, True]
    assert browser.run("[...document.querySelectorAll('#rows tr')].every((row) => row.textContent.includes('stop'))")
    assert [said for said in browser.said if not said.startswith(("asks for file:", "asks for blob:"))] == []


@needs_browser
@pytest.mark.parametrize("width", [360, 1200])
def test_a_page_fits_its_window_and_has_names_for_what_can_be_pressed(browser: Driven, opened, width: int) -> None:
    browser.set_window(width, 900, is_dark=width == 360)
    opened("thesis").run(f"page.say('Not taken from the link: {'x' * 400}')")
    assert browser.run("document.documentElement.scrollWidth") <= width
    nameless = """[...document.querySelectorAll('button, input, select, canvas')].filter(
      (each) => !(each.textContent.trim() || each.labels?.length || each.ariaLabel || each.closest('figure')))"""
    assert browser.run(f"{nameless}.map((each) => each.outerHTML)") == []
    phases = "[NaN, ...Array(60).keys()].map((each) => [phaseColour(each / 60, c), ON_PHASE])"
    pairs = f"[[c.amber, c.box], [c.faint, c.paper], ...{phases}]"
    as_hex = "(colour) => ((pen.fillStyle = colour), pen.fillStyle)"
    given = "colours(), document.createElement('canvas').getContext('2d')"
    found = browser.run(f"((c, pen) => {pairs}.map((pair) => pair.map({as_hex})))({given})")
    assert all(contrast(*pair) >= 4.5 for pair in found)


def contrast(*colours: str) -> float:
    """Return the contrast of two colours, `#rrggbb`, as WCAG defines it."""
    parts = np.array([[int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)] for colour in colours])
    linear = np.where(parts > 0.04045, ((parts + 0.055) / 1.055) ** 2.4, parts / 12.92)
    low, high = sorted(linear @ [0.2126, 0.7152, 0.0722] + 0.05)
    return float(high / low)


@needs_browser
def test_robots_without_oscillators_have_no_cycles_and_seeds_or_robots_that_are_refused_do_not_stay(opened) -> None:
    browser = opened("wall")
    seen = "[find('many').hidden, find('counted').hidden, find('sliders').textContent.includes('cycles')]"
    assert browser.run(seen) == [True, True, False]
    seen = "[...find('readings').querySelectorAll('dd, canvas, button')].filter((each) => each.checkVisibility())"
    seen = f"page.draw(), {seen}.map((each) => each.id || each.textContent)"
    assert browser.run(seen) == ["time", "eye", "bars", "Switch its ring off"]
    found = opened("kilobots").run(f"page.chosen = 1, page.show_one(), {seen}")  # without cameras and proximity sensors
    assert found[3:] == ["orders", "phases", "flashes", "Push its phase", "Switch its ring off"]
    for name, changes in (("wall", []), ("thesis", ["stop.order_parameter=null", "stop.max_cycles=3"])):
        opened(name, changes).run("page.advance(1e9)")
        assert browser.run("find('banner').textContent").startswith("Ended after ")
    browser.run("find('seed').value = ' 7 ', find('seed').onchange()")
    browser.run("find('seed').value = '1x'; find('seed').onchange()")
    seen = browser.run("[find('seed').value, find('csv').disabled, find('banner').textContent.slice(0, 19)]")
    assert seen == ["7", True, "A seed cannot be 1x"]
    shown = "getComputedStyle(find('many').parentElement).visibility"  # without JavaScript, nothing is ever ready
    assert browser.run(f"[delete document.documentElement.dataset.ready, {shown}]") == [True, "hidden"]
    browser = opened("thesis")
    browser.run("page.change({'robots.0.count': 50, 'arena.width_cm': 30})")
    said = browser.run("page.picture(performance.now()), document.getElementById('trouble').textContent")
    assert "do not fit" in said
    link = browser.run("location.href.split('#')[0] + '#robots.0.count=50&arena.width_cm=30'")
    browser.leave()
    browser.open(link)
    seen = browser.run("find('play').click(), [find('trouble').textContent, page.swarm.count, page.place().width]")
    assert seen == [said, 10, 60]  # what does not fit is said, beside the scenario's own swarm
    browser.run("page.change({...page.data.values}), page.advance(1)")
    assert browser.run("document.getElementById('trouble').hidden")
    browser.run("page.swarm.kernels.has_own = true; page.swarm.kernels.functions.take_steps = () => 1")
    said = browser.run("find('step').click(), find('trouble').textContent")
    assert said == "The scenario's own code has failed; `epuck-sim run` says where."
    assert not browser.run("find('trouble').hidden")


@needs_browser
def test_a_link_brings_values_and_seed_back_and_a_command_runs_one_trial(opened) -> None:
    browser = opened("particles", [f"seed={2**53 + 1}", "trials=3", "stop.order_parameter=null"])
    assert browser.run("find('many').hidden && find('csv').hidden")  # without a threshold there is no T_sync
    assert browser.run("String(page.seed)") == f"{2**53 + 1}"
    browser.run(f"page.change({{'agents.speed_cm_s': 2, 'neighbourhood.kind': 'range'}}); page.take_seed({2**70 + 1}n)")
    link, command = browser.run("[location.href, page.command]")
    assert command == (
        f"epuck-sim run particles --set seed={2**53 + 1} --set trials=3 --set stop.order_parameter=null "
        "--set agents.speed_cm_s=2 --set 'neighbourhood={kind: range, radius_cm: 30}' --trials 1 "
        f"--seed {2**70 + 1}"
    )
    browser.open(link)
    assert browser.run("[page.command, String(page.seed)]") == [command, f"{2**70 + 1}"]
    rows = browser.run("[...document.querySelectorAll('#rows tr')].map((row) => row.textContent)")
    listed = [row for row in rows if row.startswith("neighbourhood.")]
    assert listed == ["neighbourhood.kindrange", "neighbourhood.radius_cm30"]  # none of another kind
    browser = opened("particles", ["agents.count=100", "neighbourhood.k=30"])
    link, command = browser.run("page.change({'agents.count': 25}), [location.href, page.command]")
    assert command.endswith("--set 'neighbourhood={kind: nearest, k: 20}' --seed 0")
    browser.leave()
    browser.open(link)
    assert browser.run("page.command") == command
    odd = "agents.count=25&seed=-1&agents.speed_cm_s=3.33"
    told = "[String(page.seed), page.swarm.count, find('banner').textContent]"
    bare = f"new Promise((done) => {{ onhashchange = () => done({told}); location.hash = '{odd}' }})"
    said = "Not taken from the link: seed=-1, agents.speed_cm_s=3.33"
    assert browser.run(f"page.take_seed(7n), {bare}") == ["0", 25, said]  # the scenario's seed
    copied = "globalThis.copied = ''; page.copy = (text) => { copied = text }; find('link').click(); copied"
    browser.run("for (let each = 0; each < 300; each++) page.take_seed(page.seed + 1n)")  # more than an address takes
    assert "#seed=300&" in browser.run(copied)


def test_sliders_have_no_value_that_the_program_refuses_and_as_many_robots_as_find_room(tmp_path: Path) -> None:
    for name, limit in (("thesis", 12.8), ("pair", 12.8), ("kilobots", 1.0)):
        stops = page_data(load_scenario(name), name)["speed"]["stops"]
        assert 0 < min(stops) < max(stops) == limit  # no speed is beyond what wheels can
        assert len(set(stops)) == len(stops)
    changes = ["robots.0.memory={phase_ms: 4000}", "robots.0.parameters={delay_ms: 62, flash_fraction: 0.1}"]
    settings = page_data(load_scenario("thesis", changes), "thesis")["settings"]
    stops = {each["key"].rpartition(".")[2]: each["stops"] for each in settings}
    assert (stops["period_s"][0], stops["refractory_fraction"][0]) == (4.5, 0.1)
    (tmp_path / "steep.py").write_text(CURVE.format("0.01 * phase / coupling"))
    changes = [f"response.curve={tmp_path / 'steep.py'}", "space.side_cm=0.01", "agents.speed_cm_s=0.5"]
    settings = page_data(load_scenario("particles", changes), "particles")["settings"]
    stops = {each["key"]: each["stops"] for each in settings}
    assert (stops["response.coupling"][0], stops["agents.speed_cm_s"][-1]) == (0.01, 10)
    pillar = "arena.obstacles=[{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 5}]"
    counts, *_ = page_data(load_scenario("thesis", [pillar]), "thesis")["settings"]
    assert (counts["key"], counts["stops"][0], counts["value"]) == ("robots.0.count", 1, 10)
    assert 20 < counts["stops"][-1] < 50


@needs_browser
def test_floors_and_lamps_are_drawn_and_cameras_of_robots_are_those_of_their_groups(opened) -> None:
    grey = "{shape: box, x_cm: 15, y_cm: 60, width_cm: 30, height_cm: 60, heading_rad: 0, brightness: 0.2}"
    browser = opened("thesis", [f"arena.floor.patches=[{grey}]", "arena.lamps=[{x_cm: 45, y_cm: 15}]"])
    shares = browser.run("page.place().floor.map(([w, n, e, s, level]) => [(e - w) * (n - s), level])")
    assert sum(share for share, level in shares if level == 51) == pytest.approx(1 / 4)
    assert browser.run("page.place().lamps[0].slice(0, 2)") == [45, 15]
    drawn = "((pen) => (drawArena(pen, page.place(), page.shown(), colours()), pen.svg))(new SvgPen(300, 300))"
    assert "rgb(51,51,51)" in browser.run(drawn)
    assert opened("thesis").run("page.place().floor") == []
    wide = "{count: 2, camera: {field_of_view_deg: 180, range_cm: 30}}"
    browser = opened("thesis", [f"robots=[{{count: 2, signal: {{kind: radio}}}}, {wide}, {{count: 1}}]"])
    cones = "page.shown().cones.map(({ robot, half, reach }) => [robot, Math.round(half * 360 / Math.PI), reach])"
    assert browser.run(cones) == [[2, 180, 30], [3, 180, 30], [4, 56, 20]]


@needs_browser
def test_a_push_and_a_drag_change_the_swarm(opened) -> None:
    for name in ("particles", "thesis"):
        browser = opened(name)
        phase = "page.swarm.look().phases[3]"
        before, _, after = browser.run(f"[{phase}, page.touch(() => page.swarm.push(3, 0.01)), {phase}]")
        assert after == pytest.approx(min(before + 0.01, 1), abs=2e-3)
        browser.run("page.touch(() => page.swarm.put(3, 31, 12))")
        x, y = browser.run("[page.swarm.look().x[3], page.swarm.look().y[3]]")
        assert (x, y) == pytest.approx((31, 12))
        assert browser.run("page.advance(3), page.is_touched")


@needs_browser
def test_rings_that_are_switched_off_are_lit_again_in_the_next_trial_and_are_named_as_they_are(opened) -> None:
    browser = opened("thesis")
    press = "[...document.querySelectorAll('#one button')][1]"
    browser.run(f"page.chosen = 2; page.show_one(); {press}.click()")
    for who in (3, 2):
        browser.run(f"page.chosen = {who}; page.show_one(); page.draw()")
        assert browser.run(f"{press}.textContent") == f"Switch its ring {'on' if who == 2 else 'off'}"
    browser.set_window(1200, 900, is_calm=True)
    flashes = "page.shown().picture.is_lit !== null"
    found = browser.run(f"[15, 16].map((rate) => (page.rate = rate, {flashes}))")
    assert found == [True, False]  # for those who want little motion: three flashes a second, not more
    browser.set_window(1200, 900)
    browser.run("page.advance(30)")
    assert 2 not in browser.run("page.flashes.map(([, robot]) => robot)")
    browser.run("find('again').click(); page.advance(1e9)")
    assert 2 in browser.run("page.flashes.map(([, robot]) => robot)")
    assert browser.run(f"{press}.textContent") == "Switch its ring off"
    (end,) = ended(load_scenario("thesis"), range(1))
    assert browser.run("find('banner').textContent") == f"Synchronised: T_sync is {end[0]} cycles. Play to go on"


@needs_browser
@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_play_goes_on_beyond_synchrony_where_all_flash_together(opened, name: str) -> None:
    browser = opened(name)
    browser.run("page.advance(1e9)")
    said, cycles = browser.run("[find('banner').textContent, page.swarm.cycles]")
    assert said == f"Synchronised: T_sync is {cycles} cycles. Play to go on"
    assert browser.run("find('step').click(), page.swarm.goes_on")
    browser.run("page.toggle(); page.flashes = []; page.advance(6 * page.swarm.period_s)")
    assert cycles + 4 <= browser.run("page.swarm.cycles") <= cycles + 9
    assert len({who for _, who in browser.run("page.flashes")}) == browser.run("page.swarm.count")
    assert browser.run("find('banner').textContent") == said
    browser.run("page.advance(3500 * page.swarm.period_s)")
    gaps = "page.orders.slice(1).map(([time], each) => time - page.orders[each][0])"
    assert browser.run(f"(Math.max(...{gaps}) / page.swarm.period_s)") < 2  # from the beginning on
    browser.run("page.begin()")
    assert browser.run("[page.swarm.cycles, page.swarm.goes_on, find('banner').textContent]") == [0, False, ""]


@needs_browser
def test_trials_that_are_censored_are_told_from_those_that_are_not(opened) -> None:
    browser = opened("particles", ["stop.max_cycles=60", "agents.speed_cm_s=1"])
    browser.run("page.sweep()")
    rows = browser.run("[...document.querySelectorAll('#table tbody tr')].map((row) => row.innerText.split('\\t'))")
    assert {mean == "\u2013" for _, mean, _, censored in rows if censored == "30"} == {True}
    assert {censored for *_, censored in rows} > {"30"}
    browser.run("page.hundred()")
    assert "restricted mean" in browser.run("find('histogram').ariaLabel")
    one = "[{is_synchronised: true, cycles: 9}], {}, colours()"
    drawn = f"(() => {{ const pen = new SvgPen(500, 220); drawHistogram(pen, {one}); return pen.parts.join() }})()"
    assert "0.5<" not in browser.run(drawn)  # numbers of trials are whole
    browser.set_window(360, 900)
    text = "document.createRange(); text.selectNodeContents(document.querySelector('#table th:last-child'))"
    assert browser.run(f"{{ const text = {text}; text.getClientRects().length }}") == 1  # a word is not broken


AGENTS = [  # cases of golden_cases.yaml
    *("nearest_mirrored", "nearest_on_a_segment", "nearest_in_a_cube", "range", "range_in_a_cyclic_cube", "everybody"),
    *("cone_of_vision", "cone_of_vision_without_end", "cone_of_emission", "random_neighbours", "many_nearest_3"),
    *("sine", "mirollo_strogatz", "refractory", "metric_of_the_reference", "start_displaced", "start_given"),
    *("correlated", "levy", "reorientation_on_arriving"),
]
ROBOTS = [
    *("camera_slow_with_clocks_that_differ", "reflections_among_obstacles", "cone_of_vision", "radio_with_loss"),
    *("friction", "robots_without_contact", "groups", "kilobot_with_radio"),
]
SHIPPED = ["particles", "thesis", "physical", "crowded", "obstacles", "kilobots", "wall"]
CASES = [(kind, name) for kind, names in {"agents": AGENTS, "robots": ROBOTS, "": SHIPPED}.items() for name in names]


def ended(scenario: Any, seeds: range) -> list[list[Any]]:
    """Return how the program's trials end."""
    simulation, rows = simulate(scenario, 0), []
    for seed in seeds:
        simulation.reset(seed)
        end = run_trial(simulation)
        rows.append([end.cycles, end.t_sync_cycles is not None, end.order_parameter, end.steps, end.simulated_s])
    return rows


TRIALS = """
(values, seeds) => {
  const swarm = swarmMaker(page.trials.modules, page.data.facts)(values);
  return seeds.map((seed) => {
    swarm.reset(BigInt(seed));
    const run = swarm.run();
    let step = run.next();
    while (!step.done) step = run.next();
    const { cycles, is_synchronised, order_parameter, steps, time_s } = step.value;
    return [cycles, is_synchronised, order_parameter, steps, time_s];
  });
}
"""


@needs_browser
@pytest.mark.parametrize(("kind", "name"), CASES)
def test_trials_end_as_the_programs_do_to_the_bit(opened, kind: str, name: str) -> None:
    scenario = golden.case(kind, name) if kind else load_scenario(name, ["stop.max_time_s=67.35"])
    seeds = range(8 if scenario.model == "particles" and scenario.population < 100 else 2)
    assert opened(scenario).run(f"({TRIALS})(page.values, {json.dumps([*seeds])})") == ended(scenario, seeds)


@needs_browser
@pytest.mark.parametrize(("name", "changes"), [("thesis", ["robots.0.parameters.delay_ms=370"]), ("particles", [])])
def test_order_relative_to_the_reference_is_measured_and_shown_so(opened, name: str, changes: list[str]) -> None:
    changes = [*changes, "stop.metric=reference", "stop.max_cycles=12"]
    browser, scenario = opened(name, changes), load_scenario(name, changes)
    found = browser.run(f"({TRIALS})(page.values, [11, 12])")
    assert found == ended(scenario, range(11, 13))
    shown = browser.run("page.take_seed(12n), page.advance(1e9), page.draw(), page.order")
    assert shown == pytest.approx(found[1][2])


GOLDEN_FILES = Path(__file__).parents[1] / "golden_files"
OWN_FILES = {
    "turner.py": """
from epuck_sim.util.rng import randint
from oscillator import is_flash

PARAMETERS = {"period_s": 5.0, "flash_pixels": 1, "speed_cm_s": 6.0, "mean_wait_steps": 40}
MEMORY = {"phase_ms": float, "wait": int, "sightings": int, "bias": (float, 2)}

def start(memory, parameters, random):
    memory.phase_ms = 50.0 * randint(random, 100)

def step(sensors, memory, actuators, parameters, random):
    is_red = is_flash(sensors, parameters)
    memory.sightings += int(is_red)
    memory.phase_ms += 2.5 * sensors.step_ms if is_red else sensors.step_ms
    actuators.ring_on = memory.phase_ms >= 1000 * parameters.period_s
    if actuators.ring_on:
        memory.phase_ms = 0.0
    memory.wait -= 1
    if memory.wait < -4:
        memory.wait = randint(random, 2 * parameters.mean_wait_steps)
    actuators.left_cm_s = memory.bias[1] + (-parameters.speed_cm_s if memory.wait < 0 else parameters.speed_cm_s)
    actuators.right_cm_s = parameters.speed_cm_s * sensors.ground[0] * (0.5 + sensors.across)
""",
    "bright.py": with_sense("readings.across = robot.x / world.width_cm", "{'across': float}"),
}
TURNERS = [
    "robots=[{count: 4}, {count: 4, controller: turner.py, memory: {bias: 0.5}}]",
    f"robots.1.sensors=[bright.py, {GOLDEN_FILES}/ground.py]",
    "arena.floor.patches=[{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 15, brightness: 0.1}]",
    "stop.max_cycles=20",
]


def test_no_controller_is_compiled_for_this_machine_to_make_a_page(monkeypatch) -> None:
    monkeypatch.setattr("epuck_sim.embodied.user_code.compile_for", lambda *_, **__: pytest.fail("it was compiled"))
    assert "<html" in make_page(load_scenario("pair"), "pair")


BENT = [f"response={{curve: {GOLDEN_FILES}/bent_curve.py, coupling: 0.1}}", "stop.max_cycles=200"]
OWN_CASES = [("thesis", TURNERS, []), ("particles", BENT, ["response.coupling=0.2"])]


@pytest.mark.slow
@needs_browser
@pytest.mark.skipif(find_spec("ziglang") is None, reason="there is no ziglang to compile users' files for pages with")
@pytest.mark.parametrize(("name", "changes", "moved"), OWN_CASES, ids=["a controller and sensors", "a response curve"])
def test_a_users_files_run_in_a_page_to_the_bit(opened, tmp_path: Path, monkeypatch, name, changes, moved) -> None:
    for file, text in OWN_FILES.items():
        (tmp_path / file).write_text(text)
    monkeypatch.chdir(tmp_path)
    browser, scenario = opened(name, changes), load_scenario(name, changes)
    assert browser.run(f"({TRIALS})(page.values, {json.dumps(list(range(8)))})") == ended(scenario, range(8))
    for key, value in (change.split("=") for change in moved):
        browser.run(f"page.change({{'{key}': {value}}})")
    found = browser.run(f"({TRIALS})(page.values, [3, 4])")
    assert found == ended(load_scenario(name, [*changes, *moved]), range(3, 5))


@needs_browser
@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_what_sliders_change_is_what_the_command_says(opened, name: str) -> None:
    browser = opened(name, ["stop.max_cycles=30"])
    settings = page_data(load_scenario(name, ["stop.max_cycles=30"]), name)["settings"]
    random = np.random.default_rng(3)
    for _ in range(5):
        chosen = [each for each in settings if each["key"] != "stop.max_cycles" and random.random() < 0.5]
        values = {each["key"]: each["stops"][random.integers(len(each["stops"]))] for each in chosen}
        values |= {"robots.0.count": min(values["robots.0.count"], 10)} if "robots.0.count" in values else {}
        browser.run(f"page.change({json.dumps(values)})")
        if browser.run("find('trouble').hidden") is False:
            continue  # the robots do not fit, which the program says, too
        sets = [f"{key}={value}" for key, value in browser.run("page.changes()")]
        changed = load_scenario(name, ["stop.max_cycles=30", *sets])
        found = browser.run(f"({TRIALS})(page.values, [5, 6])")
        assert found == ended(changed, range(5, 7)), sets
        kept = load_scenario(yaml.safe_load(browser.run("toYaml(page.nested())")))
        assert kept.model_copy(update={"description": ""}) == changed.model_copy(update={"description": ""})
        browser.run("find('defaults').click()")


@needs_browser
@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_a_trial_that_is_looked_at_ends_as_one_that_is_not(opened, name: str) -> None:
    browser = opened(name)
    looked = browser.run(
        """(() => {
          const swarm = swarmMaker(page.trials.modules, page.data.facts)(page.values), flashes = [];
          swarm.reset(4n);
          for (let time = 0; !swarm.has_ended; time += 0.37) {
            swarm.advance_to(time, (at, who) => flashes.push([at, who]));
            swarm.look();
            if (swarm.receivers) swarm.receivers(3);
          }
          const { cycles, order_parameter, steps } = swarm.finish();
          return [cycles, order_parameter, steps, flashes.length, flashes];
        })()"""
    )
    ((cycles, _, order, steps, _),) = browser.run(f"({TRIALS})(page.values, [4])")
    assert looked[:3] == [cycles, order, steps]
    assert looked[3] > 5 * cycles
    assert all(one[0] <= other[0] for one, other in pairwise(looked[4]))


@needs_browser
@pytest.mark.parametrize("worker", ["", "globalThis.Worker = class { constructor() { throw new Error('refused'); } };"])
def test_a_hundred_trials_are_those_of_the_command_with_workers_or_without(opened, worker: str) -> None:
    browser, scenario = opened("particles"), load_scenario("particles")
    browser.run(f"{worker} page.take_seed(7n); page.hundred()")
    rows = [line.split(",") for line in browser.run("page.csv()").splitlines()[1:]]
    rows.sort(key=lambda row: int(row[1]))
    seeds = [trial_seed(7, trial) for trial in range(100)]
    assert [int(row[2]) for row in rows] == seeds
    expected = [ended(scenario, range(seed, seed + 1))[0] for seed in seeds[:5]]
    assert [[int(row[3]), float(row[6])] for row in rows[:5]] == [[row[0], row[2]] for row in expected]
    assert browser.run("find('summary').hidden") is (worker == "")
    assert "100 trials: mean T_sync" in browser.run("find('histogram').ariaLabel")
    browser.run("find('hundred').focus(); var run = page.hundred(); page.change({'response.coupling': 0.5})")
    focus = "document.activeElement.id"
    assert browser.run(f"(async () => [{focus}, await run, {focus}])()") == ["stop", None, "hundred"]
    assert browser.run("find('histogram').parentElement.textContent").endswith("censored. With earlier settings.")
    browser.run("for (const each of page.results) each.task.values = page.values")
    assert {line.rpartition(",")[2] for line in browser.run("page.csv()").split()} == {"response.coupling", "0.5"}


@needs_browser
def test_means_and_intervals_are_the_programs(opened) -> None:
    browser = opened("particles")
    random = np.random.default_rng(1)
    for limit, first in ((1000, 5), (40, 5), (15, 5), (40, 0)):  # trials may run out of time before the first cycle
        times = np.minimum(random.integers(5, 60, 30), limit)
        times[:3] = times[:3] if first else 0
        seen = (times < limit) & (times > 0)
        pairs = zip(times.tolist(), seen.tolist(), strict=True)
        results = [{"cycles": time, "is_synchronised": known} for time, known in pairs]
        found = browser.run(f"estimate({json.dumps(results)}, {limit}, page.data.student)")
        expected = estimate_mean(Measured(times.astype(float), seen, float(limit), 0))
        ends = [expected.value, expected.low, expected.high]
        assert [found["mean"], found["low"], found["high"]] == pytest.approx(ends, rel=1e-12)
