"""What README and docs show runs as it stands, and so do their examples; their site is built, and has everything."""

import doctest
import json
import pkgutil
import re
import runpy
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from html import unescape
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from typer.main import get_command

import epuck_sim
from epuck_sim import Simulation, load_scenario, points, read_recording
from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_names
from epuck_sim.figures import report
from epuck_sim.measures.measure import SHIPPED
from epuck_sim.recording import viewer
from epuck_sim.statistics.comparison import Samples, compare
from epuck_sim.testing import TestRobot
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.util.yaml_io import parse_yaml
from tests.browsers import Driven
from tests.cli.commands import call
from tests.figures.drawn import note_figures
from tests.tools import needs_browser

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
LONG_SWEEPS = ("fig-", "switching", "neighbour-change", "two-nearest")  # whose quick versions take minutes
SMALL_PICTURES = ["--set", "overhead.width_px=320", "--set", "overhead.height_px=320"]  # tags can still be read
pytestmark = pytest.mark.usefixtures("here")


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


def code(page_part) -> list:
    found = [(f"{page.name}-{n}", block) for page in PAGES for n, block in enumerate(blocks(page, "python"))]
    return [pytest.param(block, id=name) for name, block in found if page_part(block)]


def is_controller(block: str) -> bool:
    return "PARAMETERS = " in block and ("def step(" in block or "\nstep = " in block)


def write_files(*pages: str) -> dict[str, str]:
    """Write the files that pages show, and return their contents by the names that stand before them."""
    texts = "".join((ROOT / page).read_text() for page in pages)
    shown = dict(re.findall(r"`([\w-]+\.\w+)`[^`]*:\n\n```(?:python|yaml)\n(.*?)^```", texts, re.MULTILINE | re.DOTALL))
    for name, text in shown.items():
        Path(name).write_text(text)
    return shown


@pytest.mark.parametrize("block", code(lambda block: not is_controller(block)))
def test_examples_run(block: str) -> None:
    write_files("docs/sensors.md")
    exec(compile(block, "example", "exec"), {"__name__": "__main__"})


def test_the_robots_shown_stop_in_the_dark() -> None:
    files = write_files("docs/sensors.md")
    assert sum(len(text.splitlines()) for text in files.values()) <= 60
    Path("light.py").write_text(files["ground.py"].replace("ground", "light").replace("ahead_cm", "range_cm"))
    two = load_scenario(parse_yaml(blocks(ROOT / "docs/sensors.md", "yaml")[1], "docs"))
    assert [list(group.sensors) for group in two.robots] == [["ground", "light"], ["eye"]]
    steps = [Simulation("patches.yaml", 2, interpret=interpret).advance(300) for interpret in (False, True)]
    assert steps[0].poses.tobytes() == steps[1].poses.tobytes()
    is_dark = steps[0].readings["ground"] < 0.5
    assert is_dark.any()
    np.testing.assert_array_equal((steps[0].wheels_cm_s == 0).all(axis=1), is_dark)


@pytest.mark.parametrize("block", code(lambda block: is_controller(block) and "sensors.ground <" not in block))
def test_controllers_run_compiled_and_interpreted_alike(block: str) -> None:
    Path("shown.py").write_text(block)
    scenario = load_scenario({"robots": [{"controller": "shown.py", "count": 5}, {"count": 5}]})
    runs = [islice(Simulation(scenario, 3, interpret=interpret), 200) for interpret in (False, True)]
    for compiled, interpreted in zip(*runs, strict=True):
        assert compiled.poses.tobytes() == interpreted.poses.tobytes()
        assert compiled.ring_on.tobytes() == interpreted.ring_on.tobytes()
    assert compiled.wheels_cm_s[:5].any()


def test_tests_shown_pass(tmp_path) -> None:
    shown = [block for block in blocks(ROOT / "docs/testing.md", "python") if "def test_" in block]
    (controller,) = filter(is_controller, blocks(ROOT / "README.md", "python"))
    (tmp_path / "turner.py").write_text(controller)
    (tmp_path / "test_shown.py").write_text("".join(shown))
    command = [sys.executable, "-m", "pytest", "-p", "epuck_sim.pytest_plugin", "-W", "error", "-v"]
    run = subprocess.run([*command, tmp_path / "test_shown.py"], capture_output=True, text=True, check=False)
    for way in ("interpreted", "compiled"):
        assert f"test_it_flashes_when_it_has_waited[{way}] PASSED" in run.stdout, run.stdout
    assert "4 passed" in run.stdout


def test_the_firmware_shown_runs() -> None:
    (block,) = blocks(ROOT / "docs/firmware.md", "c")
    Path("shown.c").write_text(block)
    simulation = Simulation({"robots": [{"controller": "shown.c", "count": 5}]}, 3)
    seen = [(step.ring_on.sum(), step.wheels_cm_s.min()) for step in islice(simulation, 100)]
    assert 0 < sum(lit for lit, _ in seen) < 100 * 5
    assert min(slowest for _, slowest in seen) == -400 * 12.8 / 1000


@pytest.mark.parametrize("block", code(lambda block: "def value(self)" in block))
@pytest.mark.parametrize("model", ["thesis", "particles"])
def test_measures_shown_measure_trials_of_both_models(model: str, block: str) -> None:
    Path("shown.py").write_text(block)
    scenario = load_scenario(model, ["stop.max_cycles=5"], measures=["shown.py"])
    (value,) = run_trial(simulate(scenario, 1)).measures.values()
    assert 0 < value <= 1


def commands(page: Path) -> list[list[str]]:
    """Return the commands that a page shows; short ones of sweeps that take minutes, and of films."""
    shown = re.findall(r"^\$ epuck-sim (.*)$", "".join(blocks(page, "console")), re.MULTILINE)
    return [[*words, *shorter(words)] for words in map(shlex.split, shown)]


def shorter(words: list[str]) -> list[str]:
    """Return options that shorten what a command does; the last of several equal ones counts."""
    match words:
        case ["run", name, *_] if name.startswith(LONG_SWEEPS):
            return ["--trials", "1", "--set", "stop.max_cycles=2"]
        case ["run" | "compare-film" as command, *options] if command != "run" or "--out" in options:
            return ["--trials", "8"]  # one page looks at trial 7
        case ["run", *options] if "--film" in options or any("further_cycles" in option for option in options):
            return [*SMALL_PICTURES, "--set", "stop.max_cycles=1", "--set", "stop.further_cycles=1"]
        case ["film", *_]:
            return SMALL_PICTURES
        case ["plan", *options] if "--seconds" in options:
            return ["--seconds", "0.1"]
    return []


@pytest.mark.usefixtures("sweeps_run_here")
@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda page: page.name)
def test_the_commands_shown_run(page: Path, monkeypatch) -> None:
    shown: list[str] = []  # viewers only take note of what they are to show; they are looked at in tests/recording
    no_viewer = SimpleNamespace(wait=lambda: shown.append("live"))
    monkeypatch.setenv("DISPLAY", ":0")
    for way in ("show", "serve", "draw_screenshot"):
        monkeypatch.setattr(viewer, way, lambda path, *_: shown.append(read_recording(path).scenario.name))
    monkeypatch.setattr(viewer, "live_viewer", lambda *_: nullcontext((no_viewer, 0)))
    monkeypatch.setattr(viewer, "live", lambda *_, **__: nullcontext(lambda *_: None))
    note_figures(monkeypatch)  # pictures are looked at in tests/figures
    monkeypatch.setattr(report, "_draw", lambda *_: ())
    write_files("README.md", str(page))
    for words in commands(page):
        result = call(*words)
        assert result.exit_code == 0, (words, result.stderr)
    assert Path("trace.parquet").exists() == any("--trace" in words for words in commands(page))
    looked_at = [words for words in commands(page) if words[0] == "replay" or "--live" in words]
    assert shown == ["live" if "--live" in words else "thesis" for words in looked_at]


def test_the_readmes_controller_is_as_short_as_promised_and_the_tutorial_tells_what_comes_out() -> None:
    assert len(commands(ROOT / "README.md")) >= 15
    assert write_files("README.md").keys() == {"turner.py"}
    assert len([line for line in Path("turner.py").read_text().splitlines() if line.strip()]) <= 20
    assert write_files("docs/tutorial.md").keys() == {"listener.py", "lowest_order.py"}
    told = " ".join((ROOT / "docs/tutorial.md").read_text().split())
    three = ["--seed", "1", "--trials", "3"]
    for words, sentence in (
        (three, "T_sync is now {}, {} and {} cycles."),
        (["--seed", "1", "--set", "robots.0.count=5"], "Five robots need {} cycles."),
        (["--controller", "listener.py", *three], "The three trials take {}, {} and {} cycles."),
    ):
        result = call("run", "thesis", *words, "--json")
        trials = [json.loads(line) for line in result.stdout.splitlines()]
        assert sentence.format(*(trial["t_sync_cycles"] for trial in trials)) in told


def test_the_scenarios_shown_are_read() -> None:
    names = ("scenario", "particles", "sweeps")
    given = [parse_yaml(block, "docs") for name in names for block in blocks(ROOT / f"docs/{name}.md", "yaml")]
    shown, with_obstacles, with_movables, with_floor, agents, sweep = map(load_scenario, given)
    assert shown.population == 7
    assert with_movables.arena.movables
    assert len(with_obstacles.arena.obstacles) == 3
    assert len(with_floor.arena.floor.patches) == 3
    assert agents == load_scenario({"model": "particles"})
    assert len(points(sweep)) == 2 * 4 * 2 * 2


def is_broken(page: Path, name: str, place: str) -> bool:
    """Return whether a link of a page to a file, or to a heading in it, leads nowhere."""
    target = page.parent / name if name else page
    if "://" in name or not target.exists():
        return "://" not in name
    if not place or target.suffix != ".md" or "```{" in target.read_text():  # which is made with the site
        return False
    headings = re.findall(r"^#+ (.*)$", target.read_text(), re.MULTILINE)
    return place not in {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_lead_somewhere_pages_say_for_whom_they_are_and_doors_are_short() -> None:
    links = [(page, link) for page in PAGES for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text())]
    parted = [(page, *link.partition("#")) for page, link in links]
    assert [(page.name, name, place) for page, name, _, place in parted if is_broken(page, name, place)] == []
    for page in PAGES:
        first, *others = page.read_text().splitlines()
        is_made = page.stem == "replication" or first.startswith("```{include}")
        assert is_made or next(filter(None, others)).startswith("*For "), page.name
    for name in ("teach", "oscillators", "real_robots", "policies"):
        door = (ROOT / f"docs/{name}.md").read_text()
        assert len(door.split()) <= 400, name
        assert "![" in door
        assert f"docs/{name}.md" in (ROOT / "README.md").read_text()


def test_docstrings_begin_with_a_verb_or_a_noun_and_their_examples_hold() -> None:
    """As CONTRIBUTING says: not "Return what ...", but what it is."""
    begin = re.compile(r'"""(?:Return what|What|Of|And|That|So) .*')
    found = {path: begin.findall(path.read_text()) for path in (ROOT / "epuck_sim").rglob("*.py")}
    assert not {str(path): each for path, each in found.items() if each}
    modules = [module.name for module in pkgutil.walk_packages(epuck_sim.__path__, "epuck_sim.")]
    results = [doctest.testmod(import_module(module)) for module in modules if not module.endswith("__main__")]
    assert sum(result.failed for result in results) == 0
    assert sum(result.attempted for result in results) >= 6


def test_the_moving_pictures_are_those_of_their_commands() -> None:
    films = runpy.run_path(str(ROOT / "docs/figures/moving.py"))["FILMS"]
    rows = re.findall(r"moving-(\w+)\.gif\) \| .*`epuck-sim (.*)`", (ROOT / "docs/gallery.md").read_text())
    assert dict(rows) == films
    pictures = [ROOT / f"docs/figures/moving-{name}.gif" for name in films]
    assert sum(picture.stat().st_size for picture in pictures) < 15e6


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("site")
    options = ("--fail-on-warning", "--keep-going", "--fresh-env", "--quiet", "--doctree-dir", target / "doctrees")
    command = [sys.executable, "-m", "sphinx", *options, "docs", target / "html"]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return target / "html"


def words(text: str) -> set[str]:
    """Return the words of Markdown, such as dotted keys and names of options."""
    return set(re.sub(r"[`|*(),]", " ", text).split())


def test_the_reference_has_every_key_every_command_and_all_that_is_shipped(monkeypatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs/_ext")
    keys = import_module("scenario_keys").write_scenario_keys()
    for model in ("embodied", "particles"):
        for section, inner in load_scenario({"model": model}).model_dump().items():
            names = [f"{section}.{key}" for key in inner] if isinstance(inner, dict) else [section]
            assert [name for name in names if f"`{name}" not in keys] == []
    assert "| |" not in keys  # a column without a heading
    assert {"robots.N.camera.latency_ms", "arena.obstacles.N.radius_cm", "stop.when.relation"} <= words(keys)
    commands = words(import_module("command_line").write_commands())
    assert get_command(app).commands.keys() | {"--measure", "--statistic", "--threshold-ms"} <= commands
    module = import_module("shipped")
    shipped = words("".join(map(module.write, module.KINDS)))
    assert {name for kind in list_names().values() for name in kind} | SHIPPED.keys() <= shipped


@pytest.mark.slow
def test_every_link_within_the_site_leads_somewhere_and_pages_load_nothing_from_elsewhere(site: Path) -> None:
    texts = {path: unescape(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    pages = {path: {"", *re.findall(r'\s(?:id|name)="([^"]+)"', text)} for path, text in texts.items()}
    names = {path.name for path in pages}
    assert {"index.html", "keys.html", "commands.html", "thesis.html", "particles.html"} <= names
    for path, text in texts.items():
        for link in set(re.findall(r'\s(?:href|src)="([^"]+)"', text)):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                assert not parts.netloc or not parts.path.endswith((".js", ".css", ".png", ".svg")), (path.name, link)
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), (path.name, link)
            if target in pages:
                assert unquote(parts.fragment) in pages[target], (path.name, link)
    public = set(re.sub(r"<[^>]*>", "", (site / "api.html").read_text(encoding="utf-8")).split())
    assert all(any(word.startswith(f"epuck_sim.{name}") for word in public) for name in epuck_sim.__all__)


@needs_browser
@pytest.mark.slow
def test_pages_open_without_an_error_or_a_missing_picture_and_words_are_found(site: Path, tmp_path: Path) -> None:
    browser = Driven(tmp_path / "profile")
    for name in ("index", "gallery", "keys"):
        is_there = f"location.pathname.endsWith('{name}.html') && document.readyState === 'complete'"
        browser.open((site / f"{name}.html").as_uri(), is_there)
    assert [said for said in browser.said if not said.startswith("asks for")] == []
    found = "document.querySelector('#search-results a[href*=\"keys.html\"]') !== null"
    browser.open(f"{(site / 'search.html').as_uri()}?q=refractory", found)
    browser.close()


EXAMPLES = Path(__file__).parent.parent / "docs" / "examples"
RESPONSIVE = EXAMPLES / "responsive_firefly.py"


@pytest.fixture
def examples(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    return import_module


@pytest.mark.parametrize("period_s", [5.0, 1.7])
def test_as_it_stands_the_response_is_the_thesiss_to_the_bit(period_s):
    robots = {"count": 10, "parameters": {"speed_cm_s": 4.0, "period_s": period_s}}
    group = [{**robots, "controller": controller} for controller in (str(RESPONSIVE), "firefly")]
    runs = [islice(Simulation(load_scenario({"robots": [each]}), 3), 1000) for each in group]
    moved = 0
    for step, expected in zip(*runs, strict=True):
        assert step.poses.tobytes() == expected.poses.tobytes()
        assert step.phase_ms.tobytes() == expected.phase_ms.tobytes()
        moved += step.camera.any(axis=1).sum()
    assert moved > 100


@given(st.lists(st.floats(-0.1, 0.1), min_size=8, max_size=8), st.integers(0, 4999), st.booleans())
@settings(max_examples=30)
def test_a_flash_moves_the_phase_by_the_response_in_between_its_nodes(response, phase_ms, sees):
    nodes = {f"response_{node}": value for node, value in enumerate(response, 1)}
    robot = TestRobot(RESPONSIVE, nodes)
    robot.memory.phase_ms = phase_ms
    robot.camera[20:30] = sees
    robot.step()
    phase = phase_ms + 100
    beyond = 2 * response[-1] - response[-2]  # past the period the last line goes on
    if sees and phase > 750:
        phase = max(0.0, phase + 5000 * np.interp(phase, np.arange(10) * 625, [0, *response, beyond]))
    if abs(phase - 5000) > 1:  # it may fire there or not, as phases are truncated to whole ms
        assert robot.memory.phase_ms == pytest.approx(0 if phase >= 5000 else phase, abs=1.001)


def test_it_learns_from_trials_that_neither_measure_progress_nor_are_held_out(examples):
    """Of each generation the seeds differ, and all that is learnt stays within what is allowed."""
    learn_response, used = examples("learn_response"), []

    class Executor:
        def map(self, _, responses, seeds, **__):
            used.append(set(seeds))
            assert (np.abs(responses) <= learn_response.STRONGEST).all()
            return [type("Result", (), {"simulated_s": float(np.ptp(each))}) for each in responses]

    course = list(learn_response.evolve(Executor(), 3))
    checks, *learning = used[0], *used[1::2]
    assert all(each == checks for each in used[2::2])
    assert [len(each) for each in learning] == [learn_response.TRIALS] * 3
    assert len(set.union(checks, *learning)) == learn_response.CHECKS + 3 * learn_response.TRIALS
    assert [each.trials for each in course] == [0, 256, 512, 768]


@pytest.mark.slow
def test_it_learns_to_synchronise_sooner_than_the_thesis(examples):
    learn_response = examples("learn_response")
    with ThreadPoolExecutor(1) as executor:  # all trials take place in one simulation
        *_, last = learn_response.evolve(executor, generations=2)
        both, speed = (learn_response.THESIS, last.response), learn_response.SPEED_CM_S
        thesis, learnt = (learn_response.held_out(executor, each, speed, 60) for each in both)
    (comparison,) = compare(Samples(["thesis", "learnt"], [({}, [thesis, learnt])]))
    (point,) = comparison.points
    assert point.ratio.high < 0.5
    assert point.p_value < 0.001


@pytest.mark.parametrize("name", ["aggregation", "covering"])
def test_the_shipped_policies_are_worth_more_than_the_baselines(examples, name):
    random, thesis, learnt = (rewards for _, rewards in examples("learnt_policy").baselines(name, 4))
    assert learnt.min() > max(random.mean(), thesis.mean())


def test_the_policy_is_worth_as_much_as_a_controller_and_the_table_is_of_shipped_ones(examples):
    learnt_policy = examples("learnt_policy")
    robots = [{"controller": str(EXAMPLES / "gathering.py"), "count": 10}]
    simulation = Simulation({"robots": robots}, interpret=True)
    (reward,) = learnt_policy.rewards_of_robots(learnt_policy.TASKS["aggregation"], simulation, 1)
    assert 0.45 < reward < 0.75  # 0.59 in figures/policy.txt, 0.15 by chance
    rows = [line.split() for line in (EXAMPLES.parent / "figures/policy.txt").read_text().splitlines()[1:]]
    (mean,) = (float(row[2]) for row in rows if row[:2] == ["aggregation", "learnt"])
    policy = learnt_policy.learnt("aggregation", np.random.default_rng(1))
    few = learnt_policy.rewards_of(learnt_policy.TASKS["aggregation"], policy, 8)
    assert few.mean() == pytest.approx(mean, abs=4 * few.std() / np.sqrt(7))
