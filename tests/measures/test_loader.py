"""A measure is found by name or in its file and checked; what is wrong with it is said in one readable message."""

import pytest

from epuck_sim.measures.interface import Measure
from epuck_sim.measures.loader import SHIPPED, find_measure
from tests.measures.files import COUNTER, TELLTALE, write


def test_one_of_several_is_chosen_by_name(tmp_path):
    write(tmp_path / "mine.py", COUNTER + TELLTALE + "\ndef helper(): pass\n")
    for name in SHIPPED:
        measure = find_measure(name)
        assert (measure.name, measure.stored_name, dict(measure.sources), measure.is_function) == (
            name,
            name,
            {},
            False,
        )
        assert measure.make.__doc__.strip()
    measure = find_measure("mine.py:Telltale", tmp_path)
    assert (measure.name, measure.stored_name) == ("Telltale", f"{tmp_path}/mine.py:Telltale")


@pytest.fixture
def counter(tmp_path) -> Measure:
    write(tmp_path / "mine.py", COUNTER)
    return find_measure("mine.py", tmp_path)


def test_parameters_have_the_types_of_their_defaults(counter):
    assert counter.resolve({}) == {"weight": 1.0, "offset": 0, "loud": False, "label": "all"}
    given = counter.resolve({"weight": 2, "offset": 3.0, "label": "none"})
    assert (given["weight"], given["offset"], given["label"]) == (2.0, 3, "none")
    assert (type(given["weight"]), type(given["offset"])) == (float, int)


def test_a_measure_measures_the_models_that_tell_what_it_asks_for(tmp_path, counter):
    write(tmp_path / "steps.py", TELLTALE.replace("def event", "def _event"))
    write(tmp_path / "both.py", TELLTALE)
    write(tmp_path / "named.py", COUNTER + "    MODELS = ('particles',)\n")
    for measure in (counter, find_measure("both.py", tmp_path)):
        measure.check_model("particles", "event")
        measure.check_model("embodied", "step")
    only_steps, only_agents = (find_measure(name, tmp_path) for name in ("steps.py", "named.py"))
    only_steps.check_model("embodied", "step")
    only_agents.check_model("particles", "event")
