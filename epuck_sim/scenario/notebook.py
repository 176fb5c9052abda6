"""How scenarios show themselves in notebooks."""

from epuck_sim.display.html import details, element, facts, to_html
from epuck_sim.scenario.loader import write_scenario
from epuck_sim.scenario.scenario import Scenario


def show_scenario(scenario: Scenario) -> str:
    """Return a scenario as HTML: what it is, and all its keys to open."""
    stop, noun = scenario.stop, "robots" if scenario.controllers else "agents"
    rows = [
        ("model", scenario.model),
        (noun, str(scenario.population)),
        ("trials", str(scenario.trials)),
        ("ends at", f"an order parameter of {stop.order_parameter}, or after {stop.max_cycles} cycles"),
    ]
    rows += [("measures", ", ".join(measure.measure for measure in scenario.measures))] * bool(scenario.measures)
    if scenario.sweep is not None:
        rows += [("sweep", f"{scenario.sweep.point_count} points over {', '.join(scenario.sweep.keys)}")]
    return to_html(
        element("p", element("b", scenario.name), f": {scenario.description}" if scenario.description else ""),
        facts(rows),
        details("every key", element("pre", write_scenario(scenario))),
    )
