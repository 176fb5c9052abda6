"""The title of a trial's page: what was run, how it ended, and in what the scenario differs from the known one."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from textwrap import shorten, wrap
from typing import Any

from epuck_sim.figures.labels import format_axis_values, key_name
from epuck_sim.recording.recorded import Recorded
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.util.builtin import ARENAS, builtin_files

MAX_CHANGES = 8
"""Most changed keys that a title names."""

MAX_VALUE = 40
"""Most characters of a changed value that a title shows."""

LINE_LENGTH = 120
"""Most characters in a line of the title."""

_IRRELEVANT = WITHOUT_EFFECT | {"model", "seed", "sweep"}


def page_title(recorded: Recorded, *, has_oscillators: bool) -> str:
    """Return the title: scenario, seed and outcome, and a second line if the scenario is not as it is known."""
    if recorded.synchronised:
        outcome = f"synchronised after {recorded.cycles} cycles"
    elif recorded.scenario.stop.order_parameter is None and has_oscillators:
        outcome = f"{recorded.cycles} cycles"
    else:
        outcome = "not synchronised" if has_oscillators else "without oscillators"
    changes = describe_changes(changed_values(recorded.scenario))
    return "\n".join([f"{recorded.scenario.name}, seed {recorded.seed}: {outcome}", *wrap(changes, LINE_LENGTH)])


def changed_values(scenario: Scenario) -> dict[str, Any]:
    """Return the values, by dotted key, in which a scenario differs from the shipped one of its name.

    If none has its name, these are the values in which it differs from its model's defaults.

    >>> changed_values(load_scenario("thesis", ["stop.max_cycles=7"]))
    {'stop.max_cycles': 7}
    """
    name = scenario.name
    known = load_scenario(name if name in builtin_files(ARENAS) else {"model": scenario.model})
    before = dict(_leaves(known.model_dump(mode="json", exclude=set(_IRRELEVANT))))
    return {
        key: value
        for key, value in _leaves(scenario.model_dump(mode="json", exclude=set(_IRRELEVANT)))
        if key not in before or before[key] != value
    }


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in nested mappings, and in lists of mappings, with their dotted keys."""
    inner: Mapping[Any, Any] = {}
    if isinstance(value, Mapping):
        inner = value
    elif isinstance(value, Sequence) and value and all(isinstance(each, Mapping) for each in value):
        inner = dict(enumerate(value))
    if not inner:
        yield key, value
    for name, part in inner.items():
        yield from _leaves(part, f"{key}.{name}" if key else str(name))


def describe_changes(changes: Mapping[str, Any]) -> str:
    """Return changed values as text: with symbols and units, or with the whole key where a symbol would be ambiguous.

    >>> describe_changes({"robots.0.parameters.speed_cm_s": 3.0, "stop.max_cycles": 7})
    'with V = 3 cm/s, stop.max_cycles = 7'
    >>> describe_changes({"robots.0.count": 2, "robots.1.count": 3})
    'with N = 2, N of robots.1 = 3'
    """
    if not changes:
        return ""
    uses = Counter(map(key_name, changes))
    values = {key: f"{value:g}" if isinstance(value, float) else value for key, value in changes.items()}
    texts = [
        format_axis_values({key: value}) if uses[key_name(key)] == 1 else f"{key} = {value}"
        for key, value in values.items()
    ]
    shown = [shorten(text, len(text.partition(" = ")[0]) + MAX_VALUE, placeholder=" …") for text in texts[:MAX_CHANGES]]
    rest = len(texts) - len(shown)
    return "with " + ", ".join(shown) + (f", and {rest} more" if rest else "")
