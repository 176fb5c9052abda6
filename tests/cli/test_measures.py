"""Measures on the command line: `run --measure`, `list --measures` and `new measure`."""

import pytest

from epuck_sim.measures.loader import SHIPPED, find_measure
from tests.cli.commands import call, called, read
from tests.measures.files import COUNTER, write

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

SHORT = ["--set", "stop.max_cycles=3"]


@pytest.fixture(autouse=True)
def _mine(here):
    write(here / "mine.py", COUNTER)


@pytest.mark.parametrize("scenario", ["thesis", "particles"])
def test_run_prints_measures_as_json_and_as_columns(scenario):
    command = ["run", scenario, *SHORT, "--measure", "order_parameter", "--measure", "mine.py:Counter"]
    trial = read(*command)
    assert list(trial["measures"]) == ["order_parameter", "Counter"]
    assert trial["measures"]["Counter"] == 3.0
    assert len(trial["measures"]["order_parameter"]) == trial["cycles"] == 3
    assert trial["measures"]["order_parameter"][-1] == trial["order_parameter"]
    set_too = read(*command[:4], "--measure", "mine.py:Counter: {offset: 2, as: later}")
    assert set_too["measures"] == {"later": 5.0}
    table = called(*command)
    assert "3 values" in table
    assert "Counter" in table


def test_list_tells_the_shipped_measures_and_their_parameters():
    heading, *lines = called("list", "--measures").splitlines()
    assert heading == "measures"
    assert [line.split()[0] for line in lines] == sorted(SHIPPED)
    for line in lines:
        assert all(f"{name}: {default}" in line for name, default in find_measure(line.split()[0]).parameters.items())


@pytest.mark.parametrize("scenario", ["thesis", "particles"])
def test_new_writes_a_measure_that_runs_as_it_stands(scenario, tmp_path):
    assert (
        called("new", "measure", "wandering") == "wandering.py: try it: epuck-sim run thesis --measure wandering.py\n"
    )
    assert (tmp_path / "wandering.py").read_text().count("#") > 5
    trial = read("run", scenario, *SHORT, "--measure", "wandering.py")
    assert trial["measures"]["wandering"] > 0
    assert call("new").exit_code == 2
