"""What users write is found by name and by path, also what installed packages offer, and reloaded after an edit."""

import builtins
import importlib
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from epuck_sim import Simulation, points, run_sweep, user_files
from epuck_sim.control.loader import CONTROLLER, SENSOR, find_controller
from epuck_sim.environments.rewards import REWARD, find_reward
from epuck_sim.errors import ControllerError, CurveError, ScenarioError
from epuck_sim.measures.measure import MEASURE, find_measure
from epuck_sim.replication.claims import CLAIMS, read_claims
from epuck_sim.runs.sources import own_files
from epuck_sim.scenario.loader import SCENARIO, load_scenario
from epuck_sim.scenario.particles import CURVE, find_curve
from epuck_sim.scenario.robot_kind import ROBOT
from tests.cli.commands import call, called, refused
from tests.control.bench import EMPTY
from tests.sweep.pool_here import pool_here

PACKAGES = Path(__file__).parent / "plugins"
CURVE_FILE = "def phase_shift(phase, coupling, parameters):\n    return coupling * phase ** 2\n"


def look_again() -> None:
    """Forget what is installed."""
    importlib.invalidate_caches()
    user_files.installed.cache_clear()
    for kind in (CONTROLLER, SENSOR, ROBOT, MEASURE, CURVE, REWARD, CLAIMS, SCENARIO):
        vars(kind).pop("offers", None)


def offer(folder: Path, monkeypatch: pytest.MonkeyPatch):
    """Have packages in a folder installed, for this process and for those that it starts."""
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=":")
    look_again()
    yield folder
    look_again()


@pytest.fixture
def site(tmp_path, monkeypatch):
    yield from offer(tmp_path / "site", monkeypatch)


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    packages = [PACKAGES / "crowding", PACKAGES / "darkness"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, "--target", folder, *packages], check=True)
    return folder


@pytest.fixture
def plugins(built, monkeypatch):
    yield from offer(built, monkeypatch)


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def install(site: Path, package: str, group: str, name: str, module: str, text: str = "") -> Path:
    """Install a package with one entry point; write the file that it names, and return it."""
    folder = site / f"{package}-1.0.dist-info"
    write(folder / "METADATA", f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    write(folder / "entry_points.txt", f"[epuck_sim.{group}]\n{name} = {module}\n")
    return write(site / f"{module.replace('.', '/')}.py", text) if text else folder


@pytest.mark.usefixtures("plugins")
def test_what_packages_offer_is_listed_with_their_names_and_used_by_name():
    listed = json.loads(called("list", "--json"))
    assert listed["scenarios"]["plaza"].endswith("how close they come (from crowding)")
    walk = "Walks straight, and turns now and then. {speed_cm_s: 4.0, straight_steps: 20} (from darkness)"
    assert listed["controllers"]["dark_walk"] == walk
    assert not any("(from" in said for name, said in listed["scenarios"].items() if name != "plaza")
    measures = json.loads(called("list", "--measures", "--json"))["measures"]
    assert measures["nearest_robot"].endswith("{most_cm: 1000.0} (from crowding)")
    assert not {"crowding", "darkness"} & sys.modules.keys()
    command = ("run", "plaza", "--controller", "dark_walk", "--set", "max_time_s=600", "--json")
    (trial,) = map(json.loads, called(*command).splitlines())
    interpreted = json.loads(called(*command, "--interpret"))
    assert 7 < trial["measures"]["nearest_robot"] < 60
    assert trial["measures"] == interpreted["measures"]
    (measured,) = map(json.loads, called("run", "pair", "--measure", "nearest_robot", "--json").splitlines())
    assert measured["measures"]["nearest_robot"] == 30.0


@pytest.mark.usefixtures("plugins")
def test_a_sweep_s_workers_find_what_packages_offer_and_its_folder_knows_their_files(tmp_path):
    sweep = ("plaza", "--sweep", "robots.0.controller=firefly,dark_walk", "--workers", "2", "--out", tmp_path / "runs")
    # in a process of its own: workers are forks of what was started first, which may not know the packages
    command = [sys.executable, "-m", "epuck_sim", "run", *sweep, "--trials", "2"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert run_sweep(load_scenario(tmp_path / "runs", ["trials=3"]), tmp_path / "runs", pool_here).ended == 2
    scenario = points(load_scenario("plaza", axes=["robots.0.controller=firefly,dark_walk"]))[1].scenario
    assert scenario.robots[0].controller == "dark_walk"
    assert [name.partition(" with digest ")[0] for name in own_files(scenario)] == ["dark_walk", "nearest_robot"]


@pytest.mark.usefixtures("plugins")
def test_a_package_offers_a_robot_with_a_sensor_of_its_own():
    listed = json.loads(called("list", "--json"))
    assert listed["robots"]["rover"] == "a slow robot that looks at the floor (from darkness)"
    said = "How dark the floor is below the middle of the body. {scale: 1.0} (from darkness)"
    assert listed["sensors"] == {"darkness": said}
    floor = {"patches": [{"shape": "circle", "x_cm": 20, "y_cm": 20, "radius_cm": 10, "brightness": 0.25}]}
    groups = [{"poses": [[20, 20, 0], [50, 50, 0]], "controller": "external", "signal": {"kind": "radio"}}]
    scenario = load_scenario({"robot": "rover", "arena": {"floor": floor}, "robots": groups})
    assert scenario.robot.kind == "rover"
    assert scenario.robots[0].sensors == {"ground": {"file": "darkness", "scale": 1.0}}
    assert Simulation(scenario, 1, interpret=True).advance(1).readings["darkness"].tolist() == [0.75, 0.0]
    by_name = load_scenario({"robots": groups, "sensors": ["darkness"]})
    assert by_name.robots[0].sensors == {"darkness": {"file": "darkness", "scale": 1.0}}


def test_the_docs_show_one_of_them():
    shown = (Path(__file__).parents[1] / "docs" / "plugins.md").read_text()
    for file in ("pyproject.toml", "crowding/nearest.py", "crowding/plaza.yaml"):
        assert (PACKAGES / "crowding" / file).read_text() in shown


def test_a_curve_a_reward_and_claims_may_come_from_packages_and_a_file_without_a_reward_is_refused(site, tmp_path):
    path = install(site, "bends", "curves", "bent", "bends.bent", CURVE_FILE)
    install(site, "prizes", "rewards", "calm", "prizes", "def reward(situation):\n    return -situation.time_s\n")
    install(site, "paper", "claims", "ours", "paper.ours")
    write(site / "paper" / "__init__.py", "")
    write(site / "paper" / "ours.yaml", "claims: [{id: A1, section: '9', claim: so, not_asked: why}]")
    assert [claim.id for claim in read_claims("ours").claims] == ["A1"]
    curve = find_curve("bent")
    assert (curve.name, curve.phase_shift(0.5, 1.0, None)) == ("bent", 0.25)
    by_name, by_path = (load_scenario("particles", [f"response.curve={curve}"]) for curve in ("bent", path))
    assert by_name.response.curve == by_path.response.curve == "bent"
    assert by_name.compiled == ("particles", "bent")
    situation = type("Situation", (), {"time_s": np.array([2.0])})
    assert find_reward("calm")(situation) == find_reward(str(site / "prizes.py"))(situation) == -2.0
    for text, place in (("", ""), ("\nreward = 3", ":2")):
        with pytest.raises(ScenarioError, match=f"mine.py{place}: a reward needs a function reward"):
            find_reward(str(write(tmp_path / "mine.py", text)))
    drawn = write(tmp_path / "mine.py", "import numpy as np\ndef reward(situation):\n    return np.random.rand()")
    with pytest.raises(ScenarioError, match=r"mine\.py:3: calls np\.random\.rand, whose numbers ignore"):
        find_reward(str(drawn))


@pytest.mark.parametrize("file", ["dark.py", "dark/__init__.py", "deep/dark.py", "deep/dark/__init__.py"])
def test_an_entry_point_names_a_module_or_a_package_which_is_not_imported(file, site):
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    install(site, "deep", "controllers", "night", module)
    write(site / "deep" / "__init__.py", "raise RuntimeError('imported')")
    path = write(site / file, EMPTY)
    controller = find_controller("night")
    assert (controller.name, controller.stored_name, controller.path) == ("night", "night", path)
    assert find_controller("night") is controller


def test_a_scenario_of_a_package_names_files_beside_it_and_a_folder_of_its_name_goes_first(site, here):
    install(site, "town", "scenarios", "square", "town.places.square")
    write(site / "town" / "__init__.py", "")
    write(site / "town" / "places" / "square.yaml", "model: embodied\nrobots: [{count: 2, controller: mine.py}]\n")
    mine = write(site / "town" / "places" / "mine.py", EMPTY)
    assert load_scenario("square").robots[0].controller == str(mine)
    write(here / "square" / "scenario.yaml", "model: embodied\nrobots: [{count: 3}]\n")
    assert load_scenario("square").population == 3


def test_a_name_of_two_packages_or_of_one_and_ours_is_refused_and_one_of_several_measures_is_named(site):
    for package in ("night", "moon"):
        install(site, package, "controllers", "dark", f"{package}.dark", EMPTY)
    with pytest.raises(ControllerError, match=r"^'dark' is the name of two controllers: offered by \w+ and by \w+;"):
        find_controller("dark")
    assert find_controller(str(site / "moon" / "dark.py")).stored_name == str(site / "moon" / "dark.py")
    assert find_controller("firefly").name == "firefly"
    said = json.loads(called("list", "--json"))["controllers"]["dark"]
    assert {"night", "moon"} <= set(said.replace(";", "").split())
    install(site, "sky", "measures", "coverage", "sky.area", "def area(simulation): return 1")
    look_again()
    said = "'coverage' is the name of two measures: offered by epuck-sim and by sky; uninstall one of these"
    assert said in refused("run", "pair", "--measure", "coverage")
    assert said in json.loads(called("list", "--measures", "--json"))["measures"]["coverage"]
    assert find_measure("degree").name == "degree"
    install(site, "sky", "measures", "sky", "sky.both", "def a(simulation): return 1\ndef b(simulation): return 2")
    look_again()
    assert refused("run", "pair", "--measure", "sky").endswith("both.py: holds a, b; give one of them as sky:NAME\n")
    assert find_measure("sky:b").name == "b"


@pytest.mark.parametrize("module", ["nowhere", "nowhere.dark", "night.lost", "night.dark:Walk", "", "..", "sys"])
def test_an_entry_point_without_a_file_is_warned_of_once_with_its_package_and_everything_else_works(module, site):
    install(site, "night", "controllers", "dark", module)
    write(site / "night" / "dark.py", EMPTY)
    with pytest.warns(UserWarning, match=f"^night offers the controller 'dark' as {module}, which has no file") as told:
        assert find_controller("firefly").name == "firefly"
    assert told[0].filename == "night"  # and no line of code
    with pytest.raises(ControllerError, match=r"^unknown 'dark'"):
        find_controller("dark")
    look_again()
    result = call("check", "pair")
    assert (result.exit_code, result.stderr.count("note: night offers the controller")) == (0, 1)
    look_again()
    said = call("run", "pair", "--controller", "dark").stderr.splitlines()
    both = ["note: night offers the controller", "error: pair: --controller dark: unknown"]
    assert [line.partition(" '")[0] for line in said] == both
    install(site, "night", "scenarios", "dark", module)
    look_again()
    assert call("run", "dark").stderr.startswith("note: night offers the scenario 'dark'")


def test_a_broken_file_is_refused_with_its_line_where_it_is_used_and_an_unknown_name_with_the_nearest(site):
    path = install(site, "night", "controllers", "dark", "night.dark", "\n1 / 0\n")
    assert f"{path}:2: cannot be loaded: ZeroDivisionError" in refused("run", "pair", "--controller", "dark")
    write(path, "def step(:\n")
    assert "(dark.py, line 1)" in json.loads(called("list", "--json"))["controllers"]["dark"]
    install(site, "night", "curves", "dusk", "night.dusk", CURVE_FILE)
    look_again()
    known = r"response curves: dusk, .* and 2 more; or give a file that ends in \.py$"
    with pytest.raises(CurveError, match=rf"^unknown 'dask', did you mean 'dusk'\?; {known}"):
        find_curve("dask")


def test_threads_load_files_one_at_a_time(tmp_path):
    (tmp_path / "beside.py").write_text("import time\n\ntime.sleep(0.05)\nONE = 1\n")
    paths = [tmp_path / f"measure_{number}.py" for number in range(4)]
    for path in paths:
        path.write_text(f"from beside import ONE\n\n\ndef {path.stem}(simulation):\n    return ONE\n")
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda path: load_scenario("pair", measures=[path]), paths))
    assert [each.name for scenario in found for each in scenario.measures] == [path.stem for path in paths]


def test_a_file_may_hold_what_contains_itself_and_so_may_python(tmp_path, monkeypatch):
    monkeypatch.setattr(builtins, "_", {"__builtins__": vars(builtins)}, raising=False)  # as `>>> namespace` does
    (path := tmp_path / "ring.py").write_text(
        "RING = [1]\nRING.append(RING)\n\n\ndef ring(simulation):\n    return 1\n"
    )
    assert find_measure(str(path)).name == "ring"


def test_an_edit_while_a_file_is_loaded_is_noticed_at_the_next_look(tmp_path):
    path, new = tmp_path / "late.py", "def late(simulation): 'new'"
    path.write_text(f"from pathlib import Path\n\nPath(__file__).write_text({new!r})\n\n{new.replace('new', 'old')}\n")
    assert [find_measure(str(path)).make.__doc__ for _ in range(2)] == ["old", "new"]
