"""A page's trial is the program's, to the bit: of each model, of all that sliders change, and however it is run."""

import json
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from epuck_sim import load_scenario, run_trial
from epuck_sim.page.writer import page_data
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.statistic import estimate_mean
from epuck_sim.trial.model import simulate
from epuck_sim.util.seeds import trial_seed
from tests.tools import needs_browser

CASES: dict[str, tuple[str, list[str], int]] = {
    # name: scenario, changes, trials
    "agents": ("particles", [], 40),
    "agents in cones": ("particles", ["neighbourhood={kind: cone_of_vision, angle_deg: 90}"], 20),
    "agents with emission": ("particles", ["neighbourhood={kind: cone_of_emission, angle_deg: 50, radius_cm: 60}"], 20),
    "agents in range": ("particles", ["neighbourhood={kind: range, radius_cm: 30}", "stop.max_cycles=200"], 20),
    "any agents": ("particles", ["neighbourhood={kind: random, k: 2}"], 20),
    "all agents": ("particles", ["neighbourhood={kind: all}", "space.boundary=mirrored"], 20),
    "agents in space": ("particles", ["space={dimensions: 3, boundary: cyclic}", "neighbourhood.k=3"], 20),
    "agents on a line": ("particles", ["space.dimensions=1", "stop.max_cycles=100"], 20),
    "agents that walk": (
        "particles",
        ["agents.walk={kind: levy, run_s: 0.5, exponent: 2}", "agents.reorient_on=[arriving]"],
        20,
    ),
    "agents that turn a little": ("particles", ["agents.walk={kind: correlated, run_s: 0.3, persistence: 0.6}"], 20),
    "many agents": ("particles", ["agents.count=500", "neighbourhood.k=5", "stop.max_cycles=12"], 3),
    "agents by the clock": ("particles", ["stop.max_time_s=7.35"], 20),
    "agents with a sine": ("particles", ["response={curve: sine, coupling: 0.3}", "stop.max_cycles=60"], 10),
    "agents with a concave state": ("particles", ["response.curve=mirollo_strogatz", "response.refractory=0.1"], 10),
    "agents that start together": ("particles", ["start={phases: synchronised, displacement: 0.3}"], 20),
    "agents with places": (
        "particles",
        [
            "agents.count=2",
            "start={positions_cm: [[10, 20], [30, 40]], headings: [[1, 0], [0, 2]], phases: [0.2, 0.9]}",
        ],
        5,
    ),
    "robots": ("thesis", ["stop.max_cycles=20"], 20),
    "robots that differ": ("physical", [], 2),
    "robots that touch": ("crowded", ["stop.max_cycles=12"], 2),
    "robots among obstacles": ("obstacles", [], 4),
    "robots with radios": ("kilobots", ["stop.max_cycles=20"], 3),
    "robots with cones": ("thesis", ["robots.0.signal={kind: cone, angle_deg: 120}"], 4),
    "robots with mirrors and slow cameras": (
        "thesis",
        ["robots.0.camera={frames_per_s: 8, latency_ms: 50, reflection_range_cm: 100}", "spread.clock_rate=0.02"],
        4,
    ),
    "robots with friction": ("thesis", ["contact={friction: 0.4}", "robots.0.count=20", "stop.max_cycles=12"], 2),
    "robots that pass through each other": ("thesis", ["contact.robots=false", "stop.max_time_s=60"], 3),
    "no oscillators": ("wall", [], 2),
}


def ended(scenario: Any, seeds: range) -> list[list[Any]]:
    """Return how the program's trials end."""
    simulation = simulate(scenario, 0)
    rows = []
    for seed in seeds:
        simulation.reset(seed)
        result = run_trial(simulation)
        is_synchronised = result.t_sync_cycles is not None
        rows.append([result.cycles, is_synchronised, result.order_parameter, result.steps, result.simulated_s])
    return rows


TRIALS = """
(values, seeds) => {
  const swarm = makeSwarm(page.modules, page.data.facts, values);
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
@pytest.mark.parametrize("case", CASES)
def test_trials_end_as_the_programs_do_to_the_bit(opened, case: str) -> None:
    name, changes, trials = CASES[case]
    found = opened(name, changes).run(f"({TRIALS})(page.values, {json.dumps(list(range(trials)))})")
    assert found == ended(load_scenario(name, changes), range(trials))


OWN_FILES = {
    "turner.py": """
from epuck_sim.util.rng import randint
from oscillator import is_flash

PARAMETERS = {"period_s": 5.0, "flash_pixels": 1, "speed_cm_s": 6.0, "mean_wait_steps": 40}
MEMORY = {"phase_ms": float, "wait": int, "sightings": int}

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
    actuators.left_cm_s = -parameters.speed_cm_s if memory.wait < 0 else parameters.speed_cm_s
    actuators.right_cm_s = parameters.speed_cm_s * sensors.ground * (0.5 + sensors.across)
""",
    "ground.py": """
from epuck_sim.embodied.sensing import brightness_at
from epuck_sim.util.rng import uniform

PARAMETERS = {"noise": 0.2}
READINGS = {"ground": float}

def sense(world, robot, readings, parameters, random):
    readings.ground = brightness_at(world, robot.x, robot.y) + parameters.noise * uniform(random)
""",
    "bright.py": """
READINGS = {"across": float}

def sense(world, robot, readings, parameters, random):
    readings.across = robot.x / world.width_cm
""",
}
TURNERS = [
    "robots=[{count: 4}, {count: 4, controller: turner.py, sensors: [bright.py, ground.py]}]",
    "arena.floor.patches=[{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 15, brightness: 0.1}]",
    "stop.max_cycles=20",
]
GOLDEN_FILES = Path(__file__).parents[1] / "golden_files"
BENT = [f"response={{curve: {GOLDEN_FILES}/bent_curve.py, coupling: 0.1}}", "stop.max_cycles=200"]
OWN_CASES = {
    "a controller and its sensors": ("thesis", TURNERS, []),
    "a response curve": ("particles", BENT, ["response.coupling=0.2"]),
}


@pytest.mark.slow
@needs_browser
@pytest.mark.skipif(find_spec("ziglang") is None, reason="there is no ziglang to compile users' files for pages with")
@pytest.mark.parametrize("case", OWN_CASES)
def test_a_users_files_run_in_a_page_to_the_bit(
    opened, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    for name, text in OWN_FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    name, changes, moved = OWN_CASES[case]
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
          const swarm = makeSwarm(page.modules, page.data.facts, page.values), flashes = [];
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


@needs_browser
def test_means_and_intervals_are_the_programs(opened) -> None:
    browser = opened("particles")
    random = np.random.default_rng(1)
    for limit in (1000, 40, 15):
        times = np.minimum(random.integers(5, 60, 30), limit)
        results = [{"cycles": int(time), "is_synchronised": bool(time < limit)} for time in times]
        found = browser.run(f"estimate({json.dumps(results)}, {limit}, page.data.student)")
        measured = Measured(times.astype(float), times < limit, float(limit), 0)
        expected = estimate_mean(measured)
        assert [found["mean"], found["low"], found["high"]] == pytest.approx(
            [expected.value, expected.low, expected.high], rel=1e-12
        )
