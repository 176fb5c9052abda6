"""The package: the built wheel carries what it needs and works from any folder; names it shows, and what it refuses."""

import json
import os
import pydoc
import subprocess
import sys
import tarfile
import venv
import zipfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import yaml

import epuck_sim
from epuck_sim import EpuckSimError, ParticleSimulation, ScenarioError, Simulation, load_scenario, read_recording
from epuck_sim.trial.model import simulate
from epuck_sim.util.builtin import ARENAS, CONTROLLERS, SWEEPS

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    (file,) = built.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(built / "unpacked")
    return built / "unpacked"


def test_the_source_distribution_holds_what_its_commands_need_and_who_cites_this_version_names_it(built) -> None:
    (file,) = built.glob("*.tar.gz")
    assert file.name == f"epuck_sim-{epuck_sim.__version__}.tar.gz"
    with tarfile.open(file) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    needed = {"Makefile", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE", "pyproject.toml"}
    assert needed | {"docs/conf.py", "docs/_ext/reference.py", "arenas/thesis.yaml", "tests/golden.json"} <= held
    old = {str(path.relative_to(ROOT)) for path in (ROOT / "tests" / "old").rglob("*") if path.suffix != ".pyc"}
    assert {name for name in old if (ROOT / name).is_file()} <= held
    named = yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"]
    assert named == json.loads((ROOT / "codemeta.json").read_text())["version"] == epuck_sim.__version__


@pytest.mark.slow
def test_the_wheel_runs_in_an_empty_environment_and_both_can_be_published(built: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "empty", with_pip=True)
    (wheel,) = built.glob("*.whl")

    def run(program: str, *words: str | Path) -> str:
        return output_of("", tmp_path, tmp_path / "empty" / "bin" / program, *words)

    run("python", "-m", "pip", "install", "--quiet", f"{wheel}[view,film,plot]")
    assert run("epuck-sim", "--version") == f"epuck-sim {epuck_sim.__version__}\n"
    for scenario in ("pair", "particles"):
        assert json.loads(run("epuck-sim", "run", scenario, "--json"))["t_sync_cycles"] >= 1
    run("epuck-sim", "run", "pair", "--record", "pair.rrd", "--film", "pair.mp4")
    run("epuck-sim", "plot", "pair.rrd")
    run("python", "-m", "pip", "install", "--quiet", "twine")
    run("twine", "check", "--strict", wheel, *built.glob("*.tar.gz"))


def output_of(wheel: Path | str, folder: Path, *command: str | Path) -> str:
    """Return what a command prints in a folder where Python imports the package from the wheel, if one is given."""
    return subprocess.check_output(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(wheel)}, text=True)


def test_arenas_and_controllers_are_inside_the_wheel_which_is_used_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    for kind in (ARENAS, SWEEPS, CONTROLLERS):
        shipped = {path.name for path in (ROOT / kind).iterdir() if path.is_file()}
        assert {path.name for path in (wheel / "epuck_sim" / kind).iterdir() if path.is_file()} == shipped
    assert (wheel / "epuck_sim" / "py.typed").exists()
    assert (wheel / "epuck_sim" / "control" / "include" / "epuck.h").exists()
    script = "import epuck_sim; print(epuck_sim.__file__); from epuck_sim.cli.app import app; app(['list'])"
    file, *listed = output_of(wheel, tmp_path, sys.executable, "-c", script).splitlines()
    assert file.startswith(str(wheel))
    assert any(line.startswith("  pair  ") and "two e-pucks" in line for line in listed)


def test_dir_star_import_and_help_show_the_public_names_and_no_others_and_nothing_heavy_is_loaded() -> None:
    names = set(dir(epuck_sim))
    everything: dict[str, object] = {}
    exec("from epuck_sim import *", everything)
    assert set(everything) - {"__builtins__"} == names == set(epuck_sim.__all__)
    assert {"Simulation", "Trace", "film_trial", "run_trial", "load_scenario"} <= names
    assert all(getattr(epuck_sim, name).__doc__ for name in names)
    shown = pydoc.plain(pydoc.render_doc(epuck_sim))
    assert "Simulate swarms of e-puck robots" in shown
    assert "run_trial" in shown
    code = "import sys, epuck_sim; print([name for name in ('numpy', 'numba', 'pydantic') if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "[]\n"


def test_files_are_given_as_text_or_as_paths_and_so_are_controllers_and_measures(tmp_path) -> None:
    scenario = load_scenario("thesis", ["stop.max_cycles=1", "robots.0.count=2"])
    observers = {"t.parquet": epuck_sim.Trace, "t.rrd": epuck_sim.record, "t.mp4": epuck_sim.film_trial}
    with ExitStack() as stack:
        watching = [stack.enter_context(each(str(tmp_path / name), scenario, 1)) for name, each in observers.items()]
        epuck_sim.run_trial(Simulation(scenario, 1), watching)
    assert {path.name for path in tmp_path.iterdir()} == set(observers)
    assert read_recording(str(tmp_path / "t.rrd")).seed == 1
    (tmp_path / "mine.py").write_text("def mine(simulation):\n    return 1\n")
    controller = ROOT / "controllers" / "firefly.py"
    found = load_scenario("thesis", measures=[tmp_path / "mine.py"], controller=controller)
    assert [measure.name for measure in found.measures] == ["mine"]


def test_a_trial_is_not_kept_under_the_seed_of_another_one_nor_its_scenario_nor_outside_of_a_block(tmp_path) -> None:
    films = [("t.mp4", epuck_sim.film_trial, model) for model in ("pair", "particles")]
    for name, each, of in [("t.parquet", epuck_sim.Trace, "pair"), ("t.rrd", epuck_sim.record, "pair"), *films]:
        with pytest.raises(ValueError, match="for seed 1, but "), each(tmp_path / name, of, 1) as seen:
            epuck_sim.run_trial(simulate(load_scenario(of), 2), [seen])
        other = load_scenario(of, ["stop.max_cycles=7"])
        with pytest.raises(ValueError, match="has other values"), each(tmp_path / name, of, None) as seen:
            epuck_sim.run_trial(simulate(other, other.seed), [seen])
        with pytest.raises(ScenarioError, match=r"seed is 1\.5; allowed"), each(tmp_path / name, of, 1.5):
            pass
        with pytest.raises(ValueError, match="an observer needs its block: with record"):
            epuck_sim.run_trial(simulate(other, 0), [each(tmp_path / name, other, 0)])
    assert not list(tmp_path.iterdir())


def test_simulations_say_what_they_are_and_how_far() -> None:
    said = "EmbodiedScenario(name='pair', model='embodied', population=2), seed=3, steps=0)"
    assert repr(Simulation("pair", 3)) == f"Simulation({said}"
    assert repr(ParticleSimulation("particles", 3)).endswith("population=20), seed=3, time_s=0)")


def test_a_single_text_is_no_list_of_settings() -> None:
    for given in ([3], [("trials", 3)], {"trials": 3}):
        with pytest.raises(ScenarioError, match=r"^settings is .*; allowed: a list of such texts$"):
            load_scenario("thesis", given)
    for option in ("settings", "axes"):
        with pytest.raises(ScenarioError, match=f"^{option} is 'arena.width_cm=100'; allowed: a list of such texts$"):
            load_scenario("thesis", **{option: "arena.width_cm=100"})


@pytest.mark.parametrize(("kind", "name"), [(Simulation, "pair"), (ParticleSimulation, "particles")])
def test_a_seed_may_be_a_whole_number_of_numpy_and_others_are_refused(kind: type, name: str) -> None:
    simulation = kind(name, np.uint8(200))
    simulation.reset(np.int64(7))
    assert type(simulation.seed) is int
    for seed in ("1", 0.5, -1):
        with pytest.raises(EpuckSimError, match=f"seed is {seed!r}; allowed: whole numbers from 0"):
            kind(name, seed)
