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


REFUSED = [
    (
        {"neighbourhood": {"kind": "nearest", "k": 20}},
        "neighbourhood.k is 20; allowed: 1 to 19, because agents.count is 20",
    ),
    ({"neighbourhood": {"kind": "nearest", "k": 0}}, "neighbourhood.k: is 0; allowed: at least 1"),
    ({"neighbourhood": {"kind": "nearest", "k": 1.5}}, "neighbourhood.k: is 1.5; allowed: a whole number"),
    ({"neighbourhood": {"kind": "range", "radius_cm": 0}}, "neighbourhood.radius_cm: is 0; allowed: above 0"),
    ({"neighbourhood": {"kind": "range", "radius_cm": -3}}, "neighbourhood.radius_cm: is -3; allowed: above 0"),
    (
        {"neighbourhood": {"kind": "range", "radius_cm": 2e6}},
        "neighbourhood.radius_cm: is 2000000.0; allowed: at most",
    ),
    ({"neighbourhood": {"kind": "range"}}, "neighbourhood.radius_cm: is missing"),
    ({"neighbourhood": {"kind": "cone_of_vision"}}, "neighbourhood.angle_deg: is missing"),
    (
        {"neighbourhood": {"kind": "cone_of_vision", "angle_deg": 0}},
        "neighbourhood.angle_deg: is 0; allowed: above 0",
    ),
    (
        {"neighbourhood": {"kind": "cone_of_emission", "angle_deg": 361}},
        "neighbourhood.angle_deg: is 361; allowed: at most 360",
    ),
    (
        {"neighbourhood": {"kind": "cone_of_emission", "angle_deg": 9, "radius_cm": 0}},
        "neighbourhood.radius_cm: is 0; allowed: above 0",
    ),
    (
        {"neighbourhood": {"kind": "cone"}},
        "neighbourhood: is {'kind': 'cone'}; allowed: a mapping with kind: nearest or range or cone_of_vision or ",
    ),
    ({"neighbourhood": {"k": 3}}, "neighbourhood: is {'k': 3}; allowed: a mapping with kind: nearest or "),
    ({"neighbourhood": None}, "neighbourhood: is None; allowed: a mapping"),
    (
        {"neighbourhood": {"kind": "range", "radius_cm": 3, "radius": 3}},
        "neighbourhood.radius: unknown 'radius', did you mean 'radius_cm'?",
    ),
    ({"clocks": {"period_s": -1}}, "clocks.period_s: is -1; allowed: above 0"),
    ({"clocks": {"period_s": 0}}, "clocks.period_s: is 0; allowed: above 0"),
    ({"clocks": {"jitter": 0.3}}, "clocks.jitter: is 0.3; allowed: at most 0.2"),
    ({"clocks": {"jitter": -0.1}}, "clocks.jitter: is -0.1; allowed: at least 0"),
    ({"response": {"curve": "sine", "coupling": 1.5}}, "response: coupling is 1.5; allowed: 0 to 1 for the sine curve"),
    ({"response": {"curve": "sawtooth", "coupling": 2}}, "response: coupling is 2; allowed: 0 to 1 for the sawtooth"),
    ({"response": {"coupling": -1}}, "response.coupling: is -1; allowed: at least 0"),
    ({"response": {"refractory": 0.5}}, "response.refractory: is 0.5; allowed: below 0.5"),
    ({"response": {"refractory": -0.1}}, "response.refractory: is -0.1; allowed: at least 0"),
    (
        {"response": {"curve": "cosine"}},
        "response.curve: unknown 'cosine', did you mean 'sine'?; shipped response curves: multiplicative, sawtooth, "
        "sine, additive, mirollo_strogatz, piecewise_linear; or give a file that ends in .py",
    ),
    ({"response": {"curve": "lost.py"}}, "response.curve: no response curve file 'lost.py' in "),
    ({"response": {"curve": 3}}, "response.curve: is 3; allowed: text"),
    ({"response": {"epsilon": 0.1}}, "response.epsilon: unknown 'epsilon'; allowed: curve, coupling, refractory, para"),
    ({"response": {"parameters": {"knee": 0.5}}}, "response: unknown 'knee'; multiplicative has none"),
    (
        {"response": {"curve": "piecewise_linear", "parameters": {"knees": 0.5}}},
        "response: unknown 'knees', did you mean 'knee'?; piecewise_linear has knee, early_slope",
    ),
    (
        {"response": {"curve": "piecewise_linear", "parameters": {"knee": 1.5}}},
        "response: knee is 1.5; allowed: 0 to 1",
    ),
    (
        {"response": {"curve": "mirollo_strogatz", "parameters": {"dissipation": "b"}}},
        "response: dissipation is 'b'; allowed: a number",
    ),
    (
        {"response": {"curve": "additive", "coupling": 1.5}},
        "response: coupling is 1.5; allowed: 0 to 1 for the additive curve",
    ),
    ({"neighbourhood": {"kind": "random", "k": 20}}, "neighbourhood.k is 20; allowed: 1 to 19"),
    ({"neighbourhood": {"kind": "random", "radius_cm": 20}}, "neighbourhood.radius_cm: unknown 'radius_cm'"),
    (
        {"start": {"phases": [0.1, 0.2]}},
        "start.phases has 2 rows; allowed: 20, because that is agents.count",
    ),
    (
        {"start": {"phases": [1.5]}, "agents": {"count": 1}},
        "start.phases: is [1.5]; allowed: random, synchronised, or a list of numbers from 0 to 1, one for each agent",
    ),
    ({"start": {"phases": [True]}, "agents": {"count": 1}}, "start.phases: is [True]; allowed: random, synchronised"),
    (
        {"start": {"positions_cm": [[1, 2, 3]]}, "agents": {"count": 1}},
        "start.positions_cm.0 has 3 numbers; allowed: 2, dimensions",
    ),
    (
        {"start": {"positions_cm": [[1, 101]]}, "agents": {"count": 1}},
        "start.positions_cm.0 is [1.0, 101.0]; allowed: 0 to 100, space.side_cm",
    ),
    (
        {"start": {"headings": [[0, 0]]}, "agents": {"count": 1}},
        "start.headings.0 is [0.0, 0.0]; allowed: a vector that is not 0",
    ),
    ({"start": {"headings": [["east"]]}}, "start.headings.0.0: is 'east'; allowed: a number"),
    (
        {"start": {"displacement": 0.001}},
        "start: displacement is 0.001 and phases is 'random'; allowed: 0, or phases: synchronised",
    ),
    ({"start": {"phases": "synchronised", "displacement": 1}}, "start.displacement: is 1; allowed: below 1"),
    ({"start": {"phases": "equal"}}, "start.phases: is 'equal'; allowed: random, synchronised, or a list"),
    ({"agents": {"speed_spread": 0.5}}, "agents: speed_distribution 'fixed' takes no speed_spread; leave it out"),
    (
        {"agents": {"speed_distribution": "uniform"}},
        "agents: speed_distribution 'uniform' needs a speed_spread, above 0 and up to 1",
    ),
    (
        {"agents": {"speed_distribution": "exponential", "speed_spread": 0.1}},
        "agents: speed_distribution 'exponential' takes no speed_spread; leave it out",
    ),
    (
        {"agents": {"speed_distribution": "normal", "speed_spread": 1.5}},
        "agents: speed_spread is 1.5; allowed: above 0 and up to 1",
    ),
    (
        {"agents": {"speed_distribution": "lognormal", "speed_spread": 2.5}},
        "agents.speed_spread: is 2.5; allowed: at most 2",
    ),
    (
        {"agents": {"speed_distribution": "two_speeds", "fast_share": 0.1}},
        "agents: speed_distribution 'two_speeds' needs a fast_ratio, above 1 and up to 1000",
    ),
    (
        {"agents": {"fast_ratio": 10}},
        "agents: speed_distribution 'fixed' takes no fast_ratio; leave it out",
    ),
    (
        {"agents": {"speed_per_run": True, "speed_distribution": "exponential"}},
        "agents: speed_per_run is true, walk.kind is 'straight' and speed_distribution is 'exponential'; it needs runs",
    ),
    ({"agents": {"walk": {"kind": "random"}}}, "agents.walk.kind: is 'random'; allowed: 'straight', 'brownian', "),
    ({"agents": {"walk": {"kind": "brownian"}}}, "agents.walk: kind 'brownian' needs run_s"),
    (
        {"agents": {"walk": {"kind": "correlated", "run_s": 1}}},
        "agents.walk: kind 'correlated' needs run_s and persistence",
    ),
    ({"agents": {"walk": {"run_s": 1}}}, "agents.walk: kind 'straight' takes no run_s; leave it out"),
    (
        {"agents": {"walk": {"kind": "levy", "run_s": 1, "exponent": 1}}},
        "agents.walk.exponent: is 1; allowed: above 1",
    ),
    (
        {"agents": {"walk": {"kind": "brownian", "run_s": 0.001}}, "clocks": {"period_s": 2}},
        "agents.walk.run_s is 0.001; allowed: from 0.002, 1000 runs a period",
    ),
    ({"agents": {"speed_cm_s": 100001}}, "agents.speed_cm_s is 100001; allowed: up to 100000, 1000 sides a period"),
    (
        {"agents": {"speed_cm_s": 3e4}, "clocks": {"period_s": 4}},
        "agents.speed_cm_s is 30000; allowed: up to 25000, 1000 sides a period",
    ),
    ({"agents": {"speed_cm_s": -1}}, "agents.speed_cm_s: is -1; allowed: at least 0"),
    ({"agents": {"count": 0}}, "agents.count: is 0; allowed: at least 1"),
    (
        {"agents": {"reorient_on": ["hearing"]}},
        "agents.reorient_on.0: is 'hearing'; allowed: 'emitting', 'receiving' or 'arriving'",
    ),
    ({"agents": {"reorient_on": "emitting"}}, "agents.reorient_on: is 'emitting'; allowed: a list"),
    ({"space": {"dimensions": 4}}, "space.dimensions: is 4; allowed: at most 3"),
    ({"space": {"dimensions": 0}}, "space.dimensions: is 0; allowed: at least 1"),
    ({"space": {"side_cm": 0}}, "space.side_cm: is 0; allowed: above 0"),
    ({"space": {"boundary": "torus"}}, "space.boundary: is 'torus'; allowed: 'bounded', 'cyclic' or 'mirrored'"),
    ({"space": {"width_cm": 3}}, "space.width_cm: unknown 'width_cm', did you mean 'side_cm'?"),
    ({"stop": {"reference": 20}}, "stop.reference is 20; allowed: 0 to 19"),
    ({"stop": {"reference": -1}}, "stop.reference: is -1; allowed: at least 0"),
    ({"stop": {"order_parameter": 0}}, "stop.order_parameter: is 0; allowed: above 0"),
    ({"stop": {"order_parameter": 1.1}}, "stop.order_parameter: is 1.1; allowed: at most 1"),
    ({"stop": {"max_cycles": 0}}, "stop.max_cycles: is 0; allowed: at least 1"),
]


@pytest.mark.parametrize(("sections", "message"), REFUSED, ids=lambda case: case[:60] if isinstance(case, str) else "")
def test_a_mistake_is_named_with_key_value_and_what_is_allowed(sections, message):
    assert message_of(**sections).startswith(message)
    assert "\n" not in message_of(**sections)


# --- keys of the other model ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sections", "key", "place"),
    [
        ({"arena": {"width_cm": 60}}, "arena", "space"),
        ({"robots": [{"count": 3}]}, "robots", "agents, clocks, response and neighbourhood"),
        ({"noise": "off"}, "noise", "clocks.jitter for clocks; agents neither sense nor drive"),
        ({"contact": {}}, "contact", "no counterpart, because agents are points"),
        ({"spread": {"clock_rate": 0.01}}, "spread", "no counterpart, because agents are all alike"),
        ({"stuck": {"per_hour": 1}}, "stuck", "no counterpart, because agents are points"),
        ({"timing": {"control_hz": 10}}, "timing", "no counterpart, because time has no steps"),
        ({"stop": {"reference_robot": 1}}, "stop.reference_robot", "stop.reference"),
        (
            {"stop": {"further_cycles": 1}},
            "stop.further_cycles",
            "no counterpart, because its trials end with synchrony",
        ),
    ],
)
def test_a_key_of_embodied_scenarios_is_rejected_with_where_it_belongs(sections, key, place):
    assert message_of(**sections) == f"{key}: belongs to model: embodied; model: particles has {place}"


@pytest.mark.parametrize("key", ["space", "agents", "neighbourhood", "response", "clocks", "start"])
def test_a_key_of_particle_scenarios_is_rejected_with_where_it_belongs(key):
    with pytest.raises(ScenarioError) as caught:
        load_scenario({key: {}})
    assert str(caught.value) == f"scenario: {key}: belongs to model: particles; give that model, or leave it out"


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


def test_a_neighbourhood_that_is_only_a_word_is_rejected_with_the_kinds():
    assert "cone_of_vision" in message_of(neighbourhood="nearest")


def test_a_key_of_particle_scenarios_in_stop_is_rejected_with_where_it_belongs():
    with pytest.raises(ScenarioError, match="belongs to model: particles"):
        load_scenario({"stop": {"reference": 1}})
