"""Point agents that start like robots: the key `start.like` of a scenario of agents."""

from pathlib import Path

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import find_scenario, load_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.start import StartSection


def robots_like(name: str, origin: str) -> EmbodiedScenario:
    """Return the scenario of robots of a name or file; of a sweep, what is swept is as it is without.

    Raises:
        ScenarioError: There is none, or it is of another model.
    """
    scenario = load_scenario(name)
    if not isinstance(scenario, EmbodiedScenario):
        raise ScenarioError(f"{origin}: {name} is of model: {scenario.model}; allowed: a scenario of robots")
    return scenario.model_copy(update={"sweep": None})


def resolve_like(scenario: ParticleScenario, origin: str, folder: Path | None) -> StartSection:
    """Return the start of agents with the path of its scenario, if that is a user's.

    Args:
        scenario: The scenario of agents.
        origin: Begins every error message.
        folder: Files are looked for here first, then in the working directory.

    Raises:
        ScenarioError: There is no such scenario of robots, or agents cannot start like its robots.
    """
    like = scenario.start.like
    assert like is not None
    if folder is not None and (folder / like).is_file():
        like = str((folder / like).resolve())
    elif Path(like).suffix:
        like = str(find_scenario(like).resolve())
    robots = robots_like(like, origin)
    swept = scenario.sweep.keys if scenario.sweep else ()
    sides = [robots.arena.width_cm, robots.arena.height_cm]
    checks = {
        "agents.count": (scenario.agents.count, robots.robot_count),
        "space.dimensions": (scenario.space.dimensions, 2),
        "space.side_cm": ([scenario.space.side_cm] * 2, sides),
    }
    for key, (given, needed) in checks.items():
        section = key.partition(".")[0]
        if given != needed and not {key, section} & set(swept):
            raise ScenarioError(
                f"{origin}: {key} is {given}, and that of the robots in {like} is {needed}; give the same"
            )
    if not all("period_s" in group.parameters for group in robots.robots) or not all(robots.present):
        raise ScenarioError(f"{origin}: some robots in {like} are no oscillators, or are not present at the start")
    return scenario.start.model_copy(update={"like": like})
