"""What type checkers know of the class that is loaded: `make lint` has mypy check it, and nothing runs it."""

from typing import assert_type

from epuck_sim import EmbodiedScenario, ParticleScenario, Scenario, Simulation, load_scenario

loaded = load_scenario("thesis")
assert_type(loaded, EmbodiedScenario | ParticleScenario)
if loaded.model == "embodied":
    assert_type(loaded, EmbodiedScenario)
else:
    assert_type(loaded.agents.count, int)


def smaller(scenario: EmbodiedScenario, other: Scenario) -> float:
    assert_type(load_scenario(scenario, ["arena.width_cm=50"]), EmbodiedScenario)
    assert_type(load_scenario(other), Scenario)
    return load_scenario(scenario).arena.width_cm


print(smaller(EmbodiedScenario(), loaded), Simulation(loaded).scenario.arena.width_cm)
