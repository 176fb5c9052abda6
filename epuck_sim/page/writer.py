"""Writes a page: a scenario, the kernels, and the scripts that run in the browser, in one HTML file."""

import base64
import gzip
import hashlib
import json
import re
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from html import escape
from itertools import chain
from pathlib import Path
from typing import Any

from epuck_sim import __version__
from epuck_sim.display.html import write_html
from epuck_sim.display.table import leaves
from epuck_sim.errors import ScenarioError
from epuck_sim.page.agents import agents_facts, agents_settings
from epuck_sim.page.build import compile_own
from epuck_sim.page.robots import robots_facts, robots_settings
from epuck_sim.page.roots import Model, read_module
from epuck_sim.page.settings import Setting, Value
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario, robots_like
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, ScenarioLike
from epuck_sim.statistics.statistic import student_quantile

WEB = Path(__file__).parent / "web"
CORE = ("kernels.js", "agents.js", "robots.js", "trials.js")  # scripts that workers run, too
INTERFACE = ("draw.js", "page.js")
SPEED_POINTS = 11  # speeds of the curve of T_sync
MOST_FREEDOM = 300  # degrees of freedom up to which a page knows Student's distribution

LINES: dict[Model, str] = {
    "embodied": "; lines lead to robots that see them; fans show where cameras look, not how far",
    "particles": "; lines lead to their receivers",
}


def write_page(
    scenario: ScenarioLike, path: Path | str, settings: Sequence[str] = (), *, controller: str | Path | None = None
) -> None:
    """Write a scenario as a page: one HTML file that runs its trials in a browser, without a server or a network.

    Args:
        scenario: What `load_scenario` takes; the page has commands if it is a name or a file.
        path: The page, whose name ends in `.html`.
        settings: Changes as `key=value`.
        controller: A controller that runs on all robots, see `load_scenario`.

    Raises:
        ScenarioError: The scenario is not allowed, or cannot be a page; the message names the key.
        EpuckSimError: The page cannot be written.
    """
    options = [("--controller", str(each)) for each in [controller] if each] + [("--set", each) for each in settings]
    given = shlex.join([str(scenario), *chain.from_iterable(options)]) if isinstance(scenario, str | Path) else ""
    write_html(path, lambda: make_page(load_scenario(scenario, settings, controller=controller), given))


class Page:
    """A page in a notebook: it shows itself there, in a frame of its own.

    >>> from epuck_sim import Page
    >>> page = Page("thesis", seed=3)
    """

    def __init__(self, scenario: ScenarioLike, seed: int | None = None) -> None:
        """Make the page of a scenario, with another seed; it has commands if the scenario is given by name or file.

        Args:
            scenario: A scenario, such as a simulation's, or what `load_scenario` takes.
            seed: Seed of the page's first trial; the scenario's by default.

        Raises:
            ScenarioError: The scenario is not allowed, or cannot be a page; the message names the key.
        """
        given = load_scenario(scenario, [] if seed is None else [f"seed={seed}"])
        self.html = make_page(given, shlex.quote(str(scenario)) if isinstance(scenario, str | Path) else "")

    def _repr_html_(self) -> str:
        frame = 'width="100%" height="900" style="border: 0" sandbox="allow-scripts allow-downloads"'
        return f'<iframe title="swarm" {frame} srcdoc="{escape(self.html)}"></iframe>'


def make_page(scenario: Scenario, given: str) -> str:
    """Return the page of a scenario; `given` is the text that commands take for it; "" if there is none."""
    if not isinstance(scenario, EmbodiedScenario | ParticleScenario):
        raise ScenarioError(f"{scenario.name}: model: pages run {' and '.join(LINES)} alone; use `epuck-sim run`")
    model: Model = scenario.model
    data = page_data(scenario, given)
    core, interface, style = (_joined(names) for names in (CORE, INTERFACE, ("page.css",)))
    one, facts, lines = data["one"], data["facts"], LINES[model] * ("camera" in data["facts"].get("sees", ["camera"]))
    lines += "; this is a cube seen from above" * (facts.get("dimensions") == 3)
    policy = (
        f"default-src 'none'; script-src {_hash(core)} {_hash(interface)} 'wasm-unsafe-eval' blob:; worker-src blob:; "
        f"style-src {_hash(style)}; base-uri 'none'; form-action 'none'"
    )
    parts = {
        "POLICY": policy,
        "GENERATOR": f"epuck-sim {__version__}",
        "TITLE": escape(f"{scenario.name}: a swarm to play with"),
        "NAME": escape(scenario.name),
        "DESCRIPTION": escape(scenario.description),
        "LINES": lines,
        "ONE": one,
        "REFERENCE": f"{one} {facts['reference']}",
        "SWEEP": "" if data["speed"] else "hidden",
        "GIVEN": escape(data["given"]),
        "COMMAND": "" if given else "hidden",
        "STYLE": style,
        "DATA": _packed(gzip.compress(json.dumps(data, allow_nan=False).encode(), 9, mtime=0)),
        "WASM": _packed(read_module(model)),
        "OWN": _packed(compile_own(scenario)),
        "CORE": core,
        "PAGE": interface,
    }
    return re.sub("@([A-Z]+)@", lambda name: parts[name[1]], _joined(["page.html"]))


def page_data(scenario: EmbodiedScenario | ParticleScenario, given: str) -> dict[str, Any]:
    """Return the data of a page: facts of the swarm, values of all keys, and settings that can be changed."""
    if isinstance(scenario, EmbodiedScenario):
        facts = robots_facts(scenario)
        changes = robots_settings(scenario, robots_like("thesis", scenario.name), tuple(facts["swarms"]))
        speed_key, one = "robots.0.parameters.speed_cm_s", "robot"
    else:
        facts = agents_facts(scenario)
        changes = agents_settings(scenario)
        speed_key, one = "agents.speed_cm_s", "agent"
    limit = scenario.stop.max_cycles
    limits = {limit, *(factor * 10**power for power in range(2, 7) for factor in (1, 2, 5)), 10**7}
    if facts["has_cycles"]:
        changes.append(Setting("stop.max_cycles", "trials end after", "cycles", tuple(sorted(limits)), limit))
    nested = scenario.model_dump(mode="json", warnings=False)
    speed = next((each for each in changes if each.key == speed_key), None)
    return {
        "facts": facts,
        "values": dict(leaves(nested)) | {each.key: each.value for each in changes},
        "nested": nested,
        "settings": [asdict(each) for each in changes],
        "speed": speed and {"key": speed_key, "stops": _spread(speed)},
        "given": given,
        "seed": str(scenario.seed),  # JavaScript would round a number
        "one": one,
        "student": [student_quantile(freedom) for freedom in range(1, MOST_FREEDOM + 1)],
    }


def _spread(setting: Setting) -> list[Value]:
    """Return about `SPEED_POINTS` of a slider's values above 0, as its axis is logarithmic, from first to last."""
    stops = [stop for stop in setting.stops if isinstance(stop, float | int) and stop > 0]
    places = {round((len(stops) - 1) * number / (SPEED_POINTS - 1)) for number in range(SPEED_POINTS)}
    return [stops[place] for place in sorted(places)]


def _joined(names: Sequence[str]) -> str:
    return "\n".join((WEB / name).read_text(encoding="utf-8") for name in names)


def _hash(text: str) -> str:
    return f"'sha256-{_packed(hashlib.sha256(text.encode()).digest())}'"


def _packed(contents: bytes) -> str:
    return base64.b64encode(contents).decode()
