"""A measure is found by name or in its file and checked; what is wrong with it is said in one readable message."""

import pytest

from epuck_sim.errors import MeasureError
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
    with pytest.raises(MeasureError, match=r"mine\.py: holds Counter, Telltale; give one of them as mine\.py:NAME"):
        find_measure("mine.py", tmp_path)
    with pytest.raises(
        MeasureError, match=r"mine\.py: unknown 'Countr', did you mean 'Counter'\?; it holds Counter, T"
    ):
        find_measure("mine.py:Countr", tmp_path)


def test_a_name_without_a_file_and_a_file_that_is_not_there_are_refused(tmp_path):
    with pytest.raises(MeasureError, match=r"^unknown 'order_paramter', did you mean 'order_parameter'\?; measures: "):
        find_measure("order_paramter")
    with pytest.raises(MeasureError, match=rf"^no measure file 'nowhere\.py' in {tmp_path}"):
        find_measure("nowhere.py:A", tmp_path)
    with pytest.raises(MeasureError, match=r"^unknown 'nowhere'; .* or give FILE\.py:NAME"):
        find_measure("nowhere:A", tmp_path)
    with pytest.raises(MeasureError, match=r"'coverage:A' names no file; give FILE\.py:NAME"):
        find_measure("coverage:A", tmp_path)


@pytest.fixture
def counter(tmp_path) -> Measure:
    write(tmp_path / "mine.py", COUNTER)
    return find_measure("mine.py", tmp_path)


def test_parameters_have_the_types_of_their_defaults(counter):
    assert counter.resolve({}) == {"weight": 1.0, "offset": 0, "loud": False, "label": "all"}
    given = counter.resolve({"weight": 2, "offset": 3.0, "label": "none"})
    assert (given["weight"], given["offset"], given["label"]) == (2.0, 3, "none")
    assert (type(given["weight"]), type(given["offset"])) == (float, int)
    for wrong, said in (
        ({"weigth": 1}, "unknown 'weigth', did you mean 'weight'.; Counter has weight, offset, loud, label"),
        ({"loud": 1}, "loud is 1; allowed: true or false"),
        ({"label": 1}, "label is 1; allowed: text"),
    ):
        with pytest.raises(ValueError, match=said):
            counter.resolve(wrong)


def test_a_measure_may_check_its_parameters(tmp_path):
    check = (
        "    @staticmethod\n    def check(parameters):\n        if parameters.offset < 0: raise ValueError('too low')\n"
    )
    write(tmp_path / "mine.py", COUNTER + check)
    measure = find_measure("mine.py", tmp_path)
    measure.resolve({"offset": 0})
    with pytest.raises(ValueError, match=r"^too low$"):
        measure.resolve({"offset": -1})


def test_a_measure_that_asks_for_what_a_model_does_not_tell_of_is_refused(tmp_path, counter):
    write(tmp_path / "steps.py", TELLTALE.replace("def event", "def other"))
    write(tmp_path / "both.py", TELLTALE)
    write(tmp_path / "named.py", COUNTER + "    MODELS = ('particles',)\n")
    for measure in (counter, find_measure("both.py", tmp_path)):
        measure.check_model("particles", "event")
        measure.check_model("embodied", "step")
    only_steps, only_agents = (find_measure(name, tmp_path) for name in ("steps.py", "named.py"))
    only_steps.check_model("embodied", "step")
    with pytest.raises(ValueError, match=r"Telltale asks for every control step of robots, .*; model: particles tells"):
        only_steps.check_model("particles", "event")
    only_agents.check_model("particles", "event")
    with pytest.raises(ValueError, match="Counter measures model: particles; this is model: embodied"):
        only_agents.check_model("embodied", "step")
