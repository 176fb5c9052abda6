"""Controllers on the command line: which one runs, what is said of errors in them; and mistakes as far-fetched."""

import sys
from io import StringIO
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from epuck_sim import Simulation, load_scenario, points
from epuck_sim.cli.app import app
from epuck_sim.environments.rewards import find_reward
from epuck_sim.replication.claims import read_claims
from epuck_sim.replication.sweeps import needed_sweeps
from epuck_sim.runs.reader import read_status
from epuck_sim.util.messages import describe_error
from tests.cli.commands import call, called, read, refused, write_scene
from tests.control.bench import with_step

pytestmark = pytest.mark.usefixtures("here")


def write(folder, **files):
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)


def with_parameters(text):
    return with_step("pass", PARAMETERS=text)


def test_traceback_shows_the_controller_s_own_lines_alone(tmp_path):
    mine = "import helper\n" + with_step("memory.x = helper.halve(sensors.step_ms)")
    write(tmp_path, helper="def halve(x):\n    raise RuntimeError('no half')\n", mine=mine)
    (tmp_path / "scene.yaml").write_text("robots: [{controller: mine.py, count: 1}]")
    command = ["run", "scene.yaml", "--set", "stop.max_time_s=1", "--json"]
    assert "helper.py:2: RuntimeError: no half" in refused(*command, "--interpret")
    result = call(*command, "--interpret", "--traceback")
    assert result.exit_code == 2
    assert result.stderr.startswith(f'Traceback of the controller:\n  File "{tmp_path}/mine.py", line 10, in step\n')
    assert f'  File "{tmp_path}/helper.py", line 2, in halve\n    raise RuntimeError' in result.stderr
    assert result.stderr.splitlines()[-1].startswith("error: ")
    assert "helper.py:2: RuntimeError: no half (in the controller" in result.stderr


def test_controller_replaces_that_of_all_robots_and_keeps_the_parameters_that_it_has_but_for_set(tmp_path):
    write(tmp_path, mine=with_parameters("{'speed_cm_s': 1.0, 'gain': 2.0}"))
    (tmp_path / "two.yaml").write_text("robots: [{count: 1, parameters: {speed_cm_s: 5, coupling: 0.2}}, {count: 2}]")
    with pytest.warns(UserWarning, match=r"^two\.yaml: mine lacks the parameter coupling: left out$"):
        scenario = load_scenario("two.yaml", controller="mine.py")
    assert scenario.controllers == (str(tmp_path / "mine.py"),) * 2
    first, second = scenario.robots
    assert (first.count, first.parameters) == (1, {"speed_cm_s": 5.0, "gain": 2.0})
    assert (second.count, second.parameters) == (2, {"speed_cm_s": 1.0, "gain": 2.0})
    with pytest.warns(UserWarning, match="constant lacks"):
        scenario = load_scenario("thesis", ["robots.0.parameters.left_cm_s=2"], controller="constant")
    assert scenario.robots[0].parameters["left_cm_s"] == 2.0
    assert scenario.description.endswith("; with controller=constant; with robots.0.parameters.left_cm_s=2")


@pytest.mark.parametrize("way", ["option", "grid", "points"])
def test_an_ending_is_looked_for_among_the_parameters_of_controllers_that_are_an_axis(tmp_path, way):
    faster = with_parameters("{'speed_cm_s': 2.0, 'gain': 1.0, 'lead': 1.0}")
    write(tmp_path, a=with_parameters("{'speed_cm_s': 1.0}"), b=faster)
    key, files = "robots.0.controller", ["a.py", "b.py"]
    sweep = {"grid": {key: files}} if way == "grid" else {"points": [{key: file} for file in files]}
    given = {"robots": [{}]} if way == "option" else {"robots": [{}], "sweep": sweep}
    axes = ["controller=a.py,b.py"] if way == "option" else []
    found = points(load_scenario(given, ["gain=2", "parameters.lead=3"], axes))
    slow, fast = (point.scenario.robots[0].parameters for point in found)
    assert (slow, fast) == ({"speed_cm_s": 1.0}, {"speed_cm_s": 2.0, "gain": 2.0, "lead": 3.0})
    assert {point.scenario.overhead.gain for point in found} == {load_scenario({}).overhead.gain}


def same_either_way(scenario):
    """Return a few steps of a swarm, which are the same compiled and interpreted."""
    compiled, interpreted = (Simulation(scenario, 3, interpret=interpret).advance(30) for interpret in (False, True))
    assert compiled.poses.tobytes() == interpreted.poses.tobytes()
    return compiled


def test_new_writes_files_of_every_kind_that_run_as_they_stand(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)  # as of `python -m`
    (tmp_path / "wanderer").mkdir()  # its run folder, say
    said = called("new", "controller", "wanderer")
    assert said == "wanderer.py: try it: epuck-sim run thesis --controller wanderer.py\n"
    assert (tmp_path / "wanderer.py").read_text().count("#") > 8
    scenario = load_scenario({"robots": [{"controller": "wanderer.py", "count": 5}]})
    assert np.isfinite(same_either_way(scenario).phase_ms).all()
    assert called("new", "scenario", "pillar-80") == "pillar-80.yaml: try it: epuck-sim run pillar-80.yaml\n"
    text = (tmp_path / "pillar-80.yaml").read_text()
    assert read("run", "pillar-80.yaml", "--set", "stop.max_cycles=1")["cycles"] == 1
    (tmp_path / "swept.yaml").write_text(text.replace("# sweep:", "sweep:").replace("#   ", "  "))
    assert len(points(load_scenario("swept.yaml"))) == 6
    assert called("new", "sensor", "eye").startswith("eye.py: try it: epuck-sim run thesis --set ")
    assert called("new", "robot", "cart") == "cart.yaml: try it: epuck-sim run thesis --set robot=cart.yaml\n"
    swarm = load_scenario("thesis", ["robot=cart.yaml", "robots.0.sensors=[eye.py]"])
    assert same_either_way(swarm).readings["eye"].tolist() == [1.0] * 10
    assert swarm.robot.radius_cm == 3
    assert called("new", "curve", "bent").endswith("try it: epuck-sim run particles --set response.curve=bent.py\n")
    assert "parameters: {bend: 2.0}" in called("check", "particles", "--set", "response.curve=bent.py")
    assert 'vector_env("thesis", 8, reward="lit.py")' in called("new", "reward", "lit")
    rings = SimpleNamespace(ring_on=np.array([[True, False], [True, True]]))
    for file in ("lit.py", tmp_path / "lit.py"):
        assert find_reward(file)(rings).tolist() == [0.5, 1]
    said = called("new", "measure", "wandering")
    assert said == "wandering.py: try it: epuck-sim run thesis --measure wandering.py\n"
    assert (tmp_path / "wandering.py").read_text().count("#") > 5
    for base in ("thesis", "particles"):
        trial = read("run", base, "--set", "stop.max_cycles=3", "--measure", "wandering.py")
        assert trial["measures"]["wandering"] > 0
    assert "epuck-sim replicate --claims mine.yaml --out mine" in called("new", "claims", "mine")
    claims = read_claims(tmp_path / "mine.yaml")
    assert needed_sweeps(claims, claims.choose(())).keys() == {"couplings"}
    assert call("new").exit_code == 2


@pytest.mark.parametrize("line", ["sys.stdout.close()", "setattr(sys, 'stdout', None)"])
def test_a_controller_that_closes_the_output_is_no_traceback(tmp_path, monkeypatch, capsys, line: str) -> None:
    scene = write_scene(tmp_path, "import sys\n" + with_step(line), 0.3)
    monkeypatch.setattr(sys, "stdout", StringIO())
    with pytest.raises(SystemExit) as ended:
        app(["run", str(scene), "--interpret"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: the output cannot be written: it was closed\n"


def test_a_message_that_is_no_unicode_costs_its_own_trial_alone_and_an_interrupted_one_interrupts(tmp_path) -> None:
    scene = write_scene(tmp_path, with_step("raise ValueError('\\ud800')"), 0.3)
    result = call("run", scene, "--interpret", "--out", tmp_path / "run", "--trials", "2")
    assert result.exit_code == 1
    assert "failed: 2 trials: mine.py:" in result.stdout
    errors = [failure.error.rpartition("ValueError: ")[2] for failure in read_status(tmp_path / "run").failed]
    assert errors == ["\\ud800"] * 2
    with pytest.raises(KeyboardInterrupt):
        describe_error(type("Slow", (Exception,), {"__str__": Mock(side_effect=KeyboardInterrupt)})())


def test_more_workers_than_the_system_allows_files_are_refused_at_once(tmp_path, monkeypatch) -> None:
    for allowed, enough in ((64, "enough for 20 workers"), (20, "too few for any")):
        monkeypatch.setattr("resource.getrlimit", lambda _, allowed=allowed: (allowed, allowed))
        result = call("run", "thesis", "--trials", "99", "--workers", "64", "--out", tmp_path / "run")
        said = f"error: 64 workers need 152 open files; allowed: {allowed}, {enough}; ulimit -n raises this limit"
        assert (result.exit_code, result.stderr.splitlines()[-1]) == (2, said)
