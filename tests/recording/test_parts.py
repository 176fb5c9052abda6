"""One table says what can be recorded."""

import pytest

from epuck_sim.errors import RecordingError
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import PARTS, layout_of, parts_of, population_of
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import MODELS

REFUSED = r"^pair: model: other cannot be recorded; allowed: embodied, particles$"


def test_all_models_can_be_recorded() -> None:
    assert PARTS.keys() == MODELS.keys()


@pytest.mark.parametrize("ask", [parts_of, population_of, lambda scenario: layout_of(scenario, Level.FULL)])
def test_another_model_is_refused_with_those_that_are_allowed(ask) -> None:
    other = load_scenario("pair").model_copy(update={"model": "other"})
    with pytest.raises(RecordingError, match=REFUSED):
        ask(other)


def test_no_recording_is_begun_of_another_model(tmp_path, monkeypatch) -> None:
    monkeypatch.delitem(PARTS, "embodied")
    with (
        pytest.raises(RecordingError, match="allowed: particles"),
        record(tmp_path / "t.rrd", load_scenario("pair"), 1),
    ):
        pytest.fail("it is recorded")
    assert list(tmp_path.iterdir()) == []
