"""Scenarios of particles: the thesis's defaults, and mistakes named with key, value and what is allowed."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.yaml_io import parse_yaml


def message_of(**sections):
    """Return what is said of a scenario that is refused."""
    with pytest.raises(ScenarioError) as caught:
        load_scenario({"model": "particles", **sections})
    assert str(caught.value).startswith("scenario: ")
    return str(caught.value).removeprefix("scenario: ")


def test_without_any_key_it_is_the_base_case_of_chapter_5():
    scenario = load_scenario({"model": "particles"})
    assert isinstance(scenario, ParticleScenario)
    assert (scenario.agents.count, scenario.space.side_cm, scenario.space.dimensions) == (20, 100, 2)
    assert (scenario.space.boundary, scenario.neighbourhood.kind, scenario.neighbourhood.k) == ("bounded", "nearest", 1)
    response = scenario.response
    assert (response.curve, response.coupling, response.refractory) == ("multiplicative", 0.1, 0)
    assert (scenario.clocks.period_s, scenario.clocks.jitter, scenario.start.phases) == (1, 0, "random")
    assert (scenario.stop.metric, scenario.stop.reference, scenario.stop.order_parameter) == ("complex", 0, 1 - 1e-9)
    assert scenario.agents.reorient_on == ()


@pytest.mark.parametrize(
    "rule",
    [
        {"kind": "nearest", "k": 19},
        {"kind": "range", "radius_cm": 5},
        {"kind": "cone_of_vision", "angle_deg": 360},
        {"kind": "cone_of_emission", "angle_deg": 0.1, "radius_cm": 1e6},
        {"kind": "all"},
        {"kind": "random", "k": 19},
    ],
    ids=lambda rule: rule["kind"],
)
def test_every_kind_of_neighbourhood_is_read_and_what_is_written_is_read_again(rule):
    scenario = load_scenario({"model": "particles", "neighbourhood": rule})
    for key, value in rule.items():
        assert getattr(scenario.neighbourhood, key) == value
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    assert load_scenario({"model": "particles"}, [f"neighbourhood={rule}".replace("'", "")]) == scenario


@pytest.mark.parametrize(
    "sections",
    [
        {"response": {"curve": "sine", "coupling": 1}},
        {"response": {"coupling": 5}},
        {"response": {"curve": "additive", "coupling": 1}},
        {"response": {"curve": "mirollo_strogatz", "parameters": {"dissipation": 100}}},
        {"response": {"curve": "piecewise_linear", "coupling": 9, "parameters": {"knee": 1, "early_slope": -1000}}},
        {"space": {"boundary": "mirrored"}},
        {"start": {"phases": [0, 1], "positions_cm": [[0, 100], [5.5, 0]]}, "agents": {"count": 2}},
        {"start": {"headings": [[-1]]}, "agents": {"count": 1}, "space": {"dimensions": 1}},
        {"agents": {"reorient_on": ["arriving"]}},
        {"response": {"refractory": 0.499}},
        {"agents": {"count": 1}},
        {"agents": {"speed_cm_s": 0}},
        {"agents": {"speed_cm_s": 1e5}},
        {"agents": {"speed_distribution": "uniform", "speed_spread": 1}},
        {"agents": {"speed_distribution": "lognormal", "speed_spread": 2}},
        {"agents": {"speed_distribution": "two_speeds", "fast_share": 0.1, "fast_ratio": 10}},
        {"agents": {"walk": {"kind": "brownian", "run_s": 0.001}}},
        {"agents": {"walk": {"kind": "correlated", "run_s": 1e6, "persistence": 1}}},
        {"agents": {"walk": {"kind": "levy", "run_s": 1, "exponent": 1.0001}}},
        {"agents": {"reorient_on": ["receiving", "emitting"]}},
        {"start": {"phases": "synchronised", "displacement": 0.999}},
        {"start": {"phases": "synchronised"}},
        {"stop": {"order_parameter": None}},
        {"stop": {"order_parameter": 1}},
        {"clocks": {"jitter": 0.2, "period_s": 1e-3}},
    ],
)
def test_what_is_just_allowed_is_read(sections):
    ParticleSimulation({"model": "particles", **sections})


# --- keys of the other model ------------------------------------------------------------------------


def test_a_particle_simulation_needs_its_model_and_one_point_of_a_sweep():
    wrong_model = "model is 'embodied'; a ParticleSimulation needs model: particles; use Simulation"
    with pytest.raises(ScenarioError, match=wrong_model):
        ParticleSimulation({})
    with pytest.raises(ScenarioError, match="is a sweep; simulate one of its points"):
        ParticleSimulation({"model": "particles", "sweep": {"grid": {"agents.speed_cm_s": [1, 2]}}})
    with pytest.raises(ScenarioError, match="seed is -1; allowed: whole numbers from 0"):
        ParticleSimulation({"model": "particles"}, -1)


# --- messages that mislead --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "key"),
    [
        ({"kind": "nearest", "angle_deg": 90}, "angle_deg"),
        ({"kind": "all", "k": 3}, "k"),
        ({"kind": "range", "radius_cm": 3, "k": 2}, "k"),
    ],
)
def test_a_key_of_another_kind_of_neighbourhood_is_not_suggested_again(rule, key):
    assert f"did you mean {key!r}" not in message_of(neighbourhood=rule)


def test_what_is_allowed_of_one_agent_alone_is_not_an_empty_interval():
    assert "1 to 0" not in message_of(neighbourhood={"kind": "nearest", "k": 2}, agents={"count": 1})


def test_a_displacement_out_of_place_is_named_with_its_value():
    assert "0.001" in message_of(start={"displacement": 0.001})
