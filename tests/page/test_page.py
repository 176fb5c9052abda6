"""What a page promises: one file, no network, what it shows and gives away, and who is refused."""

import gzip
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from epuck_sim import ParticleSimulation, ScenarioError, Simulation, load_scenario
from epuck_sim.page import own
from epuck_sim.page.kernels import ANEW, read_module
from epuck_sim.page.roots import is_fresh, meanings
from epuck_sim.page.writer import make_page, page_data, write_page
from tests.browsers import Driven
from tests.cli.commands import call
from tests.control.bench import EMPTY
from tests.tools import needs_browser

MOST_BYTES = 500_000


@pytest.mark.parametrize("model", ["particles", "embodied"])
def test_the_webassembly_is_made_from_the_kernels_as_they_are(model: Any) -> None:
    assert is_fresh(model), f"the kernels of {model} have changed since their WebAssembly was made; {ANEW}"


LIMIT = 3


def test_comments_and_docstrings_make_no_webassembly_stale_but_code_and_values_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
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


@pytest.mark.parametrize("model", ["particles", "embodied"])
def test_modules_ask_for_nothing(model: Any) -> None:
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


@pytest.mark.parametrize("name", ["particles", "kilobots", "obstacles", "spotlight"])
def test_a_page_is_one_small_file_that_names_no_other(name: str) -> None:
    page = make_page(load_scenario(name), name)
    assert page == make_page(load_scenario(name), name)
    assert len(gzip.compress(page.encode())) < MOST_BYTES
    readable = re.sub(r'<script id="(data|wasm)".*?</script>', "", page, flags=re.DOTALL)
    addresses = set(re.findall(r"(?:https?:)?//[\w.-]+\.\w+[^\s\"']*", readable))
    assert addresses <= {"http://www.w3.org/2000/svg"}
    assert re.findall(r"<(?:link|img|iframe)\b|\bsrc=|@import|url\(", readable) == []
    assert "default-src 'none'" in page
    assert "unsafe-inline" not in page
    assert "@" not in re.sub(r"<(style|script).*?</\1>", "", page, flags=re.DOTALL)  # all names are filled in


WAITING = ["measures=[order_parameter]", "stop={when: order_parameter > 0.9, order_parameter: null}"]
REFUSED = {
    "sweep": ("fig-4-2a", []),
    "agents.count": ("particles", ["agents.count=5000"]),
    "agents.speed_distribution": ("particles", ["agents.speed_distribution=exponential"]),
    "clocks.jitter": ("particles", ["clocks.jitter=0.1"]),
    "start.like": ("particles", ["agents.count=10", "space.side_cm=60", "start={like: thesis}"]),
    "stop.when": ("particles", WAITING),
    "schedule": ("particles", ["schedule=[{at_s: 3, set: {agents.speed_cm_s: 2}}]"]),
    "robots": ("thesis", ["robots.0.count=300", "arena={width_cm: 500, height_cm: 500}"]),
    "robots.controller": ("thesis", ["robots.0.controller=external", "robots.0.parameters={}"]),
    "arena.movables": ("pushing", []),
    "faults": ("thesis", ["faults=[{kind: ring_dead, robots: [1]}]"]),
    "robots.present": ("thesis", ["robots=[{count: 3}, {count: 2, present: false}]"]),
}


@pytest.mark.parametrize("key", REFUSED)
def test_what_cannot_be_a_page_is_refused_with_its_key_and_nothing_is_written(tmp_path: Path, key: str) -> None:
    scenario, changes = REFUSED[key]
    with pytest.raises(ScenarioError, match=rf": {re.escape(key)}: .*; `epuck-sim run` does$"):
        write_page(scenario, tmp_path / "x.html", changes)
    assert list(tmp_path.iterdir()) == []


CURVE = "def phase_shift(phase, coupling, parameters):\n    return {}\n"
SENSOR = """
READINGS = {{"{0}": float}}

def sense(world, robot, readings, parameters, random):
    readings.{0} = 1.0
"""
GROUPS = "robots=[{count: 4}, {count: 3, controller: mine.py, sensors: [near.py, far.py]}]"


def test_files_of_ones_own_are_kernels_that_the_page_calls_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With ziglang, which takes long, tests/page/test_trials.py has them run."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(EMPTY)
    Path("curve.py").write_text(CURVE.format("coupling * phase"))
    for name in ("near", "far"):
        Path(f"{name}.py").write_text(SENSOR.format(name))
    scenario = load_scenario("thesis", [GROUPS])
    roots = {name: kernel.function.__globals__ for name, (kernel, _) in own.own_roots(scenario).items()}
    assert roots.keys() == {"run_group_1", "sense_0", "sense_1"}
    assert [roots[f"sense_{number}"]["READINGS"].names for number in range(2)] == [("near",), ("far",)]
    swarm = page_data(scenario, "thesis")["facts"]["swarms"][4]
    called = list(swarm["functions"].values())
    assert called == ["run_firefly", "run_group_1", "sense_infrared", "look", "sense_0", "sense_1"]
    assert [streams["robot"] for streams in swarm["streams"]] == [4, 4]
    bent = load_scenario("particles", ["response.curve=curve.py"])
    assert list(own.own_roots(bent)) == [own.CURVE]
    assert own.CURVE in json.dumps(page_data(bent, "particles"))


def test_files_of_ones_own_need_ziglang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text(CURVE.format("coupling * phase"))
    monkeypatch.setattr(own, "find_spec", lambda _: None)
    with pytest.raises(ScenarioError, match=r'response curves in files .* pip install "epuck-sim\[page\]"'):
        write_page("particles", tmp_path / "x.html", [f"response.curve={tmp_path / 'mine.py'}"])
    assert not (tmp_path / "x.html").exists()


def test_firmware_is_refused_by_name(tmp_path: Path) -> None:
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    (tmp_path / "mine.c").write_text(
        "#define PARAMETERS\n#define MEMORY\n#include <epuck.h>\n\nvoid start(void) {}\n\nvoid step(void) {}\n"
    )
    changes = [f"robots.0.controller={tmp_path / 'mine.c'}", "robots.0.parameters={}"]
    with pytest.raises(ScenarioError, match=r"robots\.controller: is .*mine.*; pages have controllers in Python"):
        write_page("thesis", tmp_path / "x.html", changes)


def test_the_command_writes_a_page_and_says_where(tmp_path: Path) -> None:
    path = tmp_path / "x.html"
    result = call("page", "particles", "--set", "agents.count=7", "--to", path)
    assert (result.exit_code, result.stdout.strip()) == (0, str(path))
    assert "epuck-sim page particles" in path.read_text()


def test_play_opens_a_page_in_the_browser_which_the_next_one_replaces(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    paths = [Path(call("play", name).stdout.strip()) for name in ("particles", "pair")]
    assert opened == [paths[0].as_uri()] * 2
    assert "epuck-sim page pair" in paths[0].read_text()


def test_simulations_show_themselves_as_pages_in_notebooks() -> None:
    for simulation in (ParticleSimulation("particles", seed=5), Simulation("thesis", seed=5)):
        shown = simulation.page()._repr_html_()
        assert shown.startswith("<iframe")
        assert 'sandbox="allow-scripts' in shown


@needs_browser
@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_a_page_opens_from_disk_without_network_and_without_complaint(opened, name: str) -> None:
    browser = opened(name)
    for control in ("step", "again", "next", "play"):
        browser.run(f"find('{control}').click()")
    browser.run("find('hundred').click(); find('stop').click()")
    browser.run("page.chosen = 2; page.show_one(); page.touch(() => page.swarm.put(2, 20, 20)); page.draw()")
    browser.run("find('find').value = 'stop'; page.show_keys()")
    assert browser.run("find('one').hidden") is False
    assert browser.run("[...document.querySelectorAll('#rows tr')].every((row) => row.textContent.includes('stop'))")
    assert browser.run("find('trouble').hidden")
    assert [said for said in browser.said if not said.startswith(("asks for file:", "asks for blob:"))] == []


@needs_browser
@pytest.mark.parametrize("width", [360, 1200])
def test_a_page_fits_its_window_and_has_names_for_what_can_be_pressed(browser: Driven, opened, width: int) -> None:
    browser.set_window(width, 900, is_dark=width == 360)
    opened("thesis")
    assert browser.run("document.documentElement.scrollWidth") <= width
    nameless = """[...document.querySelectorAll('button, input, select, canvas')].filter((each) => {
      const named = each.textContent.trim() || each.labels?.length || each.ariaLabel || each.closest('figure');
      return !named;
    })"""
    assert browser.run(f"{nameless}.map((each) => each.outerHTML)") == []


@needs_browser
def test_robots_without_oscillators_have_no_cycles_and_a_refused_seed_does_not_stay(opened) -> None:
    browser = opened("wall")
    assert browser.run("[find('many').hidden, find('counted').hidden]") == [True, True]
    browser.run("page.advance(1e9)")
    assert browser.run("find('banner').textContent").startswith("Ended after ")
    browser.run("find('seed').value = '1x'; find('seed').onchange()")
    assert browser.run("[find('seed').value, find('banner').textContent.slice(0, 18)]") == ["0", "The seed is not 1x"]


@needs_browser
def test_a_link_brings_values_and_seed_back(opened) -> None:
    browser = opened("particles")
    browser.run("page.change({'agents.speed_cm_s': 2, 'neighbourhood.kind': 'range'}); page.take_seed(12n)")
    link, command = browser.run("[location.href, page.command]")
    assert command == (
        "epuck-sim run particles --set agents.speed_cm_s=2 --set 'neighbourhood={kind: range, radius_cm: 30}' --seed 12"
    )
    browser.open(link)
    assert browser.run("[page.command, String(page.seed)]") == [command, "12"]


@needs_browser
def test_robots_that_do_not_fit_are_said_and_the_page_goes_on(opened) -> None:
    browser = opened("thesis")
    browser.run("page.change({'robots.0.count': 50, 'arena.width_cm': 30})")
    assert "do not fit" in browser.run(
        "page.picture(performance.now()), document.getElementById('trouble').textContent"
    )
    browser.run("page.change({...page.data.values}), page.advance(1)")
    assert browser.run("document.getElementById('trouble').hidden")


@pytest.mark.parametrize(("scenario", "limit"), [("thesis", 12.8), ("kilobots", 1.0)])
def test_no_speed_is_beyond_what_wheels_can(scenario: str, limit: float) -> None:
    stops = page_data(load_scenario(scenario), scenario)["speed"]["stops"]
    assert max(stops) == limit
    assert len(set(stops)) == len(stops)


@needs_browser
def test_a_push_and_a_drag_change_the_swarm(opened) -> None:
    for name in ("particles", "thesis"):
        browser = opened(name)
        before, after = browser.run(
            "(() => { const phase = () => page.swarm.look().phases[3]; const before = phase();"
            "page.touch(() => page.swarm.push(3, 0.01)); return [before, phase()] })()"
        )
        assert after == pytest.approx(min(before + 0.01, 1), abs=2e-3)
        x, y = browser.run(
            "(() => { page.touch(() => page.swarm.put(3, 31, 12));"
            "const { x, y } = page.swarm.look(); return [x[3], y[3]] })()"
        )
        assert (x, y) == pytest.approx((31, 12))
        browser.run("page.advance(3)")
        assert browser.run("page.is_touched")
