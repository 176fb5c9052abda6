"""Predictions, and the command that prints them."""

import pytest

from epuck_sim import load_scenario
from epuck_sim.theory.predict import predict, predict_points
from tests.cli.commands import called, read


def of_agents(*settings: str):
    return predict(load_scenario("particles", ["agents.count=10", *settings]))


def test_swarms_have_the_regime_that_trials_find_and_where_they_find_it() -> None:
    """As docs/neighbour_change.md and docs/theory.md have them; speeds within a factor of 3."""
    for settings, verdict, v_p in [
        ((), "yes", 2.2),
        (("neighbourhood={kind: cone_of_vision, angle_deg: 60, radius_cm: 142}",), "yes", 3.45),
        (("neighbourhood={kind: cone_of_emission, angle_deg: 60, radius_cm: 142}",), "no", None),
        (("neighbourhood.k=2",), "no", None),
        (("neighbourhood.k=2", "agents.count=24", "response.coupling=0.2"), "yes", 1.1),
        (("response.curve=sawtooth",), "no", None),
    ]:
        found = of_agents(*settings)
        assert found.intermediate_regime.verdict == verdict
        if v_p is not None:
            assert v_p / 3 < found.v_p_cm_s.value < v_p * 3
        assert found.reason


def test_a_users_curve_is_taken_as_it_is_and_speeds_are_in_lengths_a_period(tmp_path) -> None:
    (tmp_path / "curve.py").write_text("def phase_shift(phase, coupling, parameters):\n    return coupling * phase\n")
    own, shipped = of_agents(f"response.curve={tmp_path / 'curve.py'}", "clocks.period_s=2"), of_agents()
    assert own.t_sync_fast == shipped.t_sync_fast
    assert own.pair == shipped.pair
    assert 2 * own.v_p_cm_s.value == pytest.approx(shipped.v_p_cm_s.value)


def test_receivers_drawn_for_each_pulse_have_no_regime_at_any_speed() -> None:
    found = of_agents("neighbourhood={kind: random, k: 2}")
    assert (found.intermediate_regime.verdict, found.intermediate_regime.probability) == ("no", 0)
    assert found.t_sync == found.t_sync_fast
    assert "any speed" in found.reason


def test_radio_that_all_receive_joins_robots_of_any_speed() -> None:
    found = predict(load_scenario("thesis", ["robots.0.signal={kind: radio}"]))
    assert (found.graph.joined.value, found.graph.reciprocity.value) == (1, 1)
    assert found.intermediate_regime.verdict == "no"
    assert "reaches all" in found.reason


def test_what_is_left_out_is_said() -> None:
    schedule = [{"at_cycle": 5, "set": {"agents.speed_cm_s": 3}}]
    given = {"model": "particles", "schedule": schedule, "agents": {"count": 5}, "start": {"phases": "synchronised"}}
    notes = " ".join(predict(load_scenario(given)).notes)
    assert "schedule is left out" in notes
    assert "start is left out" in notes


def test_points_that_differ_in_speed_alone_share_what_does_not_depend_on_it() -> None:
    sweep = load_scenario("particles", ["agents.count=6"], ["agents.speed_cm_s=0,1,30"])
    (still, slow, fast) = [prediction for _, prediction in predict_points(sweep)]
    assert still.graph is slow.graph is fast.graph
    assert slow.link_cycles == pytest.approx(30 * fast.link_cycles)
    assert slow.t_sync.value > fast.t_sync.value


def test_the_command_prints_a_table_an_object_or_a_row_a_point() -> None:
    words = ("predict", "particles", "--set", "count=6")
    told = called(*words)
    assert "intermediate regime" in told
    assert "V_p, peak of T_sync" in told
    printed = read(*words)
    assert printed["intermediate_regime"].keys() == {"verdict", "probability"}
    assert printed["graph"]["links"]["value"] == 1
    rows = read(*words, "--sweep", "speed_cm_s=1,30")["points"]
    assert [row["axes"] for row in rows] == [{"agents.speed_cm_s": 1}, {"agents.speed_cm_s": 30}]
    assert len(called(*words, "--sweep", "speed_cm_s=1,30", "--csv").splitlines()) == 3
