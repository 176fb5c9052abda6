"""A scenario with what a film determines in place of its own values."""

from pathlib import Path

from epuck_sim.errors import FilmError
from epuck_sim.overhead.track.film_fit import Fitted, fit_film
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.robots import Robots
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.util.atomic_write import atomic_write


def fitted_values(scenario: EmbodiedScenario, track: Track, robots: Robots) -> dict[str, Fitted]:
    """Return what a film determines, by the keys that a scenario has.

    Of several groups of robots, a film does not show whose values are whose: it determines only those of the camera.
    """
    groups = len(scenario.robots)
    known = {f"robots.0.parameters.{name}" for name in scenario.robots[0].parameters}
    return {
        key: value
        for key, value in fit_film(track, robots).items()
        if key.startswith("overhead.") or (groups == 1 and (key in known or not key.startswith("robots.")))
    }


def check_one_group(scenario: EmbodiedScenario) -> None:
    """Raise FilmError if a scenario cannot be fitted to a film, because its robots are not all alike."""
    if len(scenario.robots) > 1:
        raise FilmError(
            f"{scenario.name}: has {len(scenario.robots)} groups of robots; allowed: one, to fit it to a film"
        )


def fit_scenario(scenario: EmbodiedScenario, fitted: dict[str, Fitted]) -> EmbodiedScenario:
    """Return a scenario with fitted values in place of its own, and an exposure that is no longer than a frame.

    Raises:
        FilmError: The scenario has several groups of robots.
        ScenarioError: A fitted value is not allowed.
    """
    check_one_group(scenario)
    digits = {key: 3 if key.endswith(".period_s") else 6 for key in fitted}  # periods are whole milliseconds
    values = {key: round(value.value, digits[key]) for key, value in fitted.items()}
    longest_ms = 1000 / values.get("overhead.frames_per_s", scenario.overhead.frames_per_s)
    if scenario.overhead.exposure_ms > longest_ms:
        values["overhead.exposure_ms"] = longest_ms
    settings = [f"{key}={value}" for key, value in values.items()]
    return load_scenario(scenario, [*settings, f"name={scenario.name}-fitted"])


def save_fitted(path: Path, scenario: EmbodiedScenario, fitted: dict[str, Fitted], film: str) -> None:
    """Write a scenario that was fitted, with intervals as comments; raise EpuckSimError where it cannot be written."""
    lines = [f"# Fitted to {film}, with 95 % intervals; all else is as it was."]
    lines += [f"# {key}: {each.value:.6g} ({each.low:.6g} to {each.high:.6g})" for key, each in fitted.items()]
    with atomic_write(path) as part:
        part.write_text("\n".join([*lines, write_scenario(scenario)]), encoding="utf-8")
