"""Messages for scenarios that fail validation: in the words of the file, not in those of the library that checks it."""

from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import validate
from epuck_sim.scenario.particles import ParticleScenario

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
