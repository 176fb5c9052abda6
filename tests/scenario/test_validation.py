"""Messages for scenarios that fail validation: in the words of the file, not in those of the library that checks it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.validation import validate

PYDANTIC_S_WORDS = (
    "input",
    "Input",
    "valid ",
    "should",
    "Field",
    "dictionary",
    "tuple",
    "another kind",
    "instance",
    "<",
)


def message_of(scenario: dict) -> str:
    with pytest.raises(ScenarioError) as caught:
        validate(scenario, "x")
    return str(caught.value)


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ({"arena": 3}, "x: arena: is 3; allowed: a mapping of keys to values"),
        ({"arena": {"width_cm": float("nan")}}, "x: arena.width_cm: is nan; allowed: a finite number"),
        ({"arena": {"width_cm": []}}, "x: arena.width_cm: is []; allowed: a number"),
        ({"arena": {"width_cm": "wide"}}, "x: arena.width_cm: is 'wide'; allowed: a number"),
        ({"arena": {"width_cm": True}}, "x: arena.width_cm: is True; allowed: a number, not true or false"),
        ({"arena": {"width_cm": 2e6}}, "x: arena.width_cm: is 2000000.0; allowed: at most 1000000"),
        ({"arena": {"width_cm": 1}}, "x: arena.width_cm: is 1; allowed: at least 7.4"),
        ({"stuck": {"mean_s": 0}}, "x: stuck.mean_s: is 0; allowed: above 0"),
        ({"noise": {"wheel_speed": 1}}, "x: noise.wheel_speed: is 1; allowed: below 1"),
        ({"seed": 1.5}, "x: seed: is 1.5; allowed: a whole number"),
        ({"seed": "one"}, "x: seed: is 'one'; allowed: a whole number"),
        ({"seed": None}, "x: seed: is None; allowed: a whole number"),
        ({"seed": "1" * 5000}, f"x: seed: is '{'1' * 56}...; allowed: a whole number with fewer digits"),
        ({"name": 3}, "x: name: is 3; allowed: text"),
        ({"name": ""}, "x: name: is ''; allowed: 1 or more characters"),
        ({"name": "n" * 101}, f"x: name: is '{'n' * 56}...; allowed: at most 100 characters"),
        ({"name": "\ud800"}, "x: name: is '\\ud800'; allowed: text in Unicode"),
        ({3: 4}, "x: 3: is 3; allowed: text as the key"),
        ({"robots": [{"parameters": {3: 4}}]}, "x: robots.0.parameters.3: is 3; allowed: text"),
        ({"robots": {}}, "x: robots: is {}; allowed: a list"),
        ({"robots": [{"poses": [[1, 2]]}]}, "x: robots.0.poses.0.2: is missing"),
        ({"robots": [{"poses": [[1, 2, 3, 4]]}]}, "x: robots.0.poses.0: is [1, 2, 3, 4]; allowed: at most 3 values"),
        ({"sweep": {"grid": []}}, "x: sweep.grid: is []; allowed: a mapping of keys to values"),
        ({"sweep": {"grid": {"seed": []}}}, "x: sweep.grid.seed: is []; allowed: 1 or more values"),
        ({"sweep": {"gird": {}}}, "x: sweep.gird: unknown 'gird', did you mean 'grid'?; allowed: points, zip, grid"),
        (
            {"arena": {"obstacles": [{"shape": "polygon", "corners_cm": [[0, 0], [1, 1]]}]}},
            "x: arena.obstacles.0.corners_cm: is [[0, 0], [1, 1]]; allowed: 3 or more values",
        ),
        (
            {"arena": {"obstacles": [{"shape": "cube"}]}},
            "x: arena.obstacles.0: is {'shape': 'cube'}; allowed: a mapping with shape: circle or box or polygon",
        ),
        (
            {"arena": {"obstacles": [{"shape": "circle", "x_cm": 9, "y_cm": 9, "radius_cm": 1, "width_cm": 2}]}},
            "x: arena.obstacles.0.width_cm: unknown 'width_cm'; allowed: shape, x_cm, y_cm, radius_cm",
        ),
        (
            {"model": "particles", "neighbourhood": {"kind": "all", "k": 3}},
            "x: neighbourhood.k: unknown 'k'; allowed: kind; for another kind, give the whole section",
        ),
        (
            {"robots": [{"signal": {"kind": "smoke"}}]},
            "x: robots.0.signal: is {'kind': 'smoke'}; allowed: a mapping with kind: camera or cone or radio",
        ),
        (
            {"robots": [{"signal": {"kind": "radio", "los": 1}}]},
            "x: robots.0.signal.los: unknown 'los', did you mean 'loss'?; allowed: range_cm, angle_deg, of, kind, "
            "latency_ms, loss, collisions, half_duplex",
        ),
        (
            {"robots": [{"signal": {"kind": "cone"}, "camera": {"pixels": 3}}]},
            "x: robots.0: signal.kind is 'cone' and a camera is given; leave the camera out, or choose camera",
        ),
        ({"contact": {"robots": 3}}, "x: contact.robots: is 3; allowed: true or false"),
        ({"stop": {"metric": "real"}}, "x: stop.metric: is 'real'; allowed: 'complex' or 'reference'"),
        ({"model": 3}, "x: model: is 3; allowed: 'embodied' or 'particles'"),
    ],
)
def test_a_message_names_the_key_the_value_and_what_is_allowed(scenario: dict, message: str) -> None:
    assert message_of(scenario) == message


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just("9" * 5000)
JUNK = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=2),
    max_leaves=6,
)
SECTIONS = sorted({*EmbodiedScenario.model_fields, *ParticleScenario.model_fields} - {"name", "description", "model"})
KEYS = sorted(
    {
        key
        for kind in (EmbodiedScenario, ParticleScenario)
        for field in kind.model_fields.values()
        for key in getattr(type(field.default), "model_fields", ())
    }
)


@settings(max_examples=300)
@given(
    model=st.sampled_from(["embodied", "particles"]),
    section=st.sampled_from(SECTIONS),
    value=JUNK | st.dictionaries(st.sampled_from(KEYS), JUNK, min_size=1, max_size=3),
)
def test_no_message_shows_words_of_the_library_that_checks(model: str, section: str, value) -> None:
    try:
        validate({"model": model, section: value}, "x")
    except ScenarioError as error:
        for line in str(error).splitlines():
            allowed = line.rpartition("; allowed: ")[2] if "; allowed: " in line else ""
            assert not any(word in allowed for word in PYDANTIC_S_WORDS), line
