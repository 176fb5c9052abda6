"""Claims about point agents that start like robots: same places, headings and phases for the same seed."""

import numpy as np
import pytest

from epuck_sim import ParticleSimulation, ScenarioError, Simulation, load_scenario, points, run_trial, start_like
from epuck_sim.scenario.loader import write_scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.trial.model import simulate

AGENTS = {"model": "particles", "agents": {"count": 10}, "space": {"side_cm": 60}, "start": {"like": "thesis"}}


@pytest.mark.parametrize("seed", [0, 5])
def test_agents_start_where_the_robots_of_a_trial_with_the_same_seed_do(seed):
    robots = Simulation("thesis", seed)
    placed = robots.last_step
    assert placed.number == -1
    assert robots.steps == 0
    agents = simulate(load_scenario(AGENTS), seed)
    assert agents.positions().tobytes() == np.ascontiguousarray(placed.poses[:, :2]).tobytes()
    assert agents.scenario.start.phases == tuple((placed.phase_ms / 5000).tolist())
    np.testing.assert_allclose(agents.phases(), placed.phase_ms / 5000, atol=1e-15)  # agents keep when they fire
    x, y = np.array(agents.scenario.start.headings).T
    assert np.abs((np.arctan2(y, x) - placed.poses[:, 2] + np.pi) % (2 * np.pi) - np.pi).max() < 1e-14
    by_hand = ParticleSimulation({**AGENTS, "start": start_like("thesis", seed)}, seed)
    assert by_hand.positions().tobytes() == agents.positions().tobytes()
    assert run_trial(by_hand).cycles == run_trial(agents).cycles
    assert next(iter(robots)).number == 0


def test_trials_differ_in_their_starts_and_sweeps_keep_the_key():
    scenario = load_scenario(AGENTS)
    with pytest.raises(ScenarioError, match=r"give a ParticleSimulation start_like\(robots, seed\)"):
        ParticleSimulation(AGENTS, 1)
    with pytest.raises(ScenarioError, match="some robots have no phase"):
        start_like({"robots": [{"controller": "constant"}]}, 1)
    one, other = (simulate(scenario, seed).positions() for seed in (1, 2))
    assert (one != other).any()
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    swept = points(load_scenario(AGENTS, axes=["agents.speed_cm_s=1,2"]))
    assert [point.scenario.start.like for point in swept] == ["thesis"] * 2


def test_files_of_robots_are_found_beside_the_scenario(tmp_path):
    (tmp_path / "robots.yaml").write_text("robots: [{count: 3}]\n")
    (tmp_path / "agents.yaml").write_text(
        "model: particles\nagents: {count: 3}\nneighbourhood: {kind: all}\nspace: {side_cm: 60}\n"
        "start: {like: robots.yaml}\n"
    )
    scenario = load_scenario(tmp_path / "agents.yaml")
    assert scenario.start.like == str(tmp_path / "robots.yaml")
    assert (
        simulate(scenario, 1).positions().tolist()
        == Simulation(str(tmp_path / "robots.yaml"), 1).last_step.poses[:, :2].tolist()
    )
