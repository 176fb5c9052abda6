"""The command `compare-film`: what it prints and writes, and how mistakes end."""

import csv
import json
from pathlib import Path

import pytest

from epuck_sim import Simulation, film_trial, load_scenario
from tests.cli.commands import call, called
from tests.cli.films import frames_and_description, names
from tests.overhead.films import save

SETTINGS = [
    *("robots.0.count=4", "robots.0.parameters.speed_cm_s=1.5", "robots.0.parameters.period_s=2.0"),
    *("overhead.width_px=160", "overhead.height_px=160"),
]
OPTIONS = [word for setting in SETTINGS for word in ("--set", setting)]


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> Path:
    """Return a film of twelve seconds."""
    path = tmp_path_factory.mktemp("films") / "swarm.mp4"
    scenario = load_scenario("thesis", SETTINGS)
    with film_trial(path, scenario, seed=1) as observe:
        for step in Simulation(scenario, seed=1):
            observe(step, State)  # type: ignore[arg-type]
            if step.time_s >= 12:
                break
    return path


class State:
    cycles = 0
    order_parameter = None


def test_a_film_is_shown_beside_trials_and_fitted(film, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["compare-film", film, "thesis", *OPTIONS, "--trials", 3]
    result = call(*words, "--json", "--plot", "b.png", "--fit", "lab.yaml")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert (found["film"], found["scenario"]) == (str(film), "thesis")
    quantities = {each["name"]: each for each in found["quantities"]}
    speed = quantities["speed straight ahead"]
    assert speed["film"] == pytest.approx(1.5, rel=0.06)
    assert speed["trials"] == pytest.approx([1.5] * 3, rel=0.05)
    fitted = found["fitted"]["robots.0.parameters.speed_cm_s"]
    assert fitted["low"] <= 1.5 <= fitted["high"]
    assert names(tmp_path) == ["b.csv", "b.png", "lab.yaml"]
    with (tmp_path / "b.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["trial"] for row in rows[:4]] == ["film", "0", "1", "2"]
    assert len(rows) == 4 * len(quantities)
    t_sync = quantities["T_sync"]
    statuses = [row["status"] for row in rows if row["quantity"] == "T_sync"]
    assert (statuses[0] == "beyond") == t_sync["film_is_beyond"]
    assert [statuses[1:].count(status) for status in ("beyond", "unknown")] == [t_sync["beyond"], t_sync["unknown"]]
    assert "epuck_sim" in found["versions"]
    lab = load_scenario("lab.yaml")
    assert lab.robots[0].parameters["speed_cm_s"] == pytest.approx(fitted["value"], abs=1e-5)
    printed = call(*words).stdout
    assert printed.startswith(
        "3 trials are too few to tell whether the film is like them; give --trials 19 or more.\n\n"
    )
    assert "speed straight ahead" in printed
    assert "A film does not tell coupling" in printed
    assert "commands" not in called("run", "lab.yaml", "--set", "stop.max_cycles=2", "--json")


def test_a_film_without_a_description_has_the_floor_of_the_scenario(film, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    frames, _ = frames_and_description(film)
    save(tmp_path / "bare.mp4", frames)
    wide = ["robots=[{count: 2, parameters: {speed_cm_s: 1.5, period_s: 2}}, {count: 2}]", "arena.width_cm=90"]
    words = ["--period-s", 2, "--trials", 1, *(word for setting in wide for word in ("--set", setting))]
    bare = call("compare-film", "bare.mp4", "thesis", *words)
    assert (bare.exit_code, "warning: the film's floor" in bare.stderr) == (0, False), bare.stderr
    described = call("compare-film", film, "thesis", *words, "--set", "robots.1.count=1")
    assert described.exit_code == 0, described.stderr
    assert "warning: the film shows 4 robots, thesis has 3" in described.stderr
    assert "warning: the film's floor is 60 x 60 cm, that of thesis 90 x 60 cm" in described.stderr
