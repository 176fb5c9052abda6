"""Claims about the library's edge: the names it shows, and what it says to who calls it in a wrong way."""

import pydoc
import subprocess
import sys
from contextlib import ExitStack

import numpy as np
import pytest

import epuck_sim
from epuck_sim import EpuckSimError, ParticleSimulation, ScenarioError, Simulation, load_scenario, read_recording

SHORT = ["stop.max_cycles=1", "robots.0.count=2"]


def test_dir_and_star_import_show_the_public_names_and_no_others() -> None:
    names = set(dir(epuck_sim))
    everything: dict[str, object] = {}
    exec("from epuck_sim import *", everything)
    assert set(everything) - {"__builtins__"} == names == set(epuck_sim.__all__)
    assert {"Simulation", "Trace", "film_trial", "run_trial", "load_scenario"} <= names
    assert all(getattr(epuck_sim, name).__doc__ for name in names)


def test_help_names_what_there_is() -> None:
    shown = pydoc.plain(pydoc.render_doc(epuck_sim))
    assert "Simulate swarms of e-puck robots" in shown
    assert "run_trial" in shown


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, epuck_sim; print([name for name in ('numpy', 'numba', 'pydantic') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_files_are_given_as_text_or_as_paths(tmp_path) -> None:
    scenario = load_scenario("thesis", SHORT)
    observers = {"t.parquet": epuck_sim.Trace, "t.rrd": epuck_sim.record, "t.mp4": epuck_sim.film_trial}
    with ExitStack() as stack:
        watching = [stack.enter_context(each(str(tmp_path / name), scenario, 1)) for name, each in observers.items()]
        epuck_sim.run_trial(Simulation(scenario, 1), watching)
    assert {path.name for path in tmp_path.iterdir()} == set(observers)
    assert read_recording(str(tmp_path / "t.rrd")).seed == 1


def test_a_trace_is_refused_for_agents(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="particles: model is 'particles'; "):
        epuck_sim.Trace(tmp_path / "t.parquet", load_scenario("particles"), 1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["settings", "axes"])
def test_a_single_text_is_no_list_of_settings(option: str) -> None:
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
