"""Scenarios: what is read, that what is written is read again, quick versions, and how YAML is read."""

import ast
import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import epuck_sim
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario import robots
from epuck_sim.scenario.changes import FAULTS
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.keys import quick_version, set_value, without_quick
from epuck_sim.scenario.loader import load_scenario, validate, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import MAX_BYTES, parse_yaml, read_yaml
from tests.cli.commands import call
from tests.control.bench import with_step

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


def test_what_is_left_out_is_that_of_the_base_cases_of_chapters_4_and_5() -> None:
    for sections, *shipped in (({}, "thesis"), ({"model": "particles"}, "particles", ["speed_cm_s=1"])):
        scenario = load_scenario(sections)
        assert scenario == load_scenario(*shipped).model_copy(update={"description": ""})
        assert scenario.stop.metric == "complex"


def test_a_file_is_read_with_what_lies_beside_it_and_is_called_after_itself(tmp_path) -> None:
    (tmp_path / "mine.py").write_text(with_step("pass", PARAMETERS="{'pace': 2.0}"))
    (tmp_path / "scene.yaml").write_text("robots: [{controller: mine.py, count: 1}]")
    scenario = load_scenario(tmp_path / "scene.yaml")
    assert scenario == load_scenario(str(tmp_path / "scene.yaml"))
    group = scenario.robots[0]
    assert (scenario.name, group.controller, group.parameters) == ("scene", str(tmp_path / "mine.py"), {"pace": 2.0})


def test_set_changes_one_value() -> None:
    for setting, read in [
        ("robots.0.parameters.period_s=8", lambda s: s.robots[0].parameters["period_s"] == 8.0),
        ("arena.width_cm=1e2", lambda s: s.arena.width_cm == 100.0),
        ("stop.metric=reference", lambda s: s.stop.metric == "reference"),
        ("noise=off", lambda s: (s.noise.wheel_speed, s.noise.infrared_counts) == (0, 0)),
        ("noise=on", lambda s: s.noise == load_scenario({}).noise),
        ("robots=[{poses: [[10, 10, 0], [30, 30, 1]]}]", lambda s: s.robots[0].count == 2),
        ("seed=123456789012345678901234567890", lambda s: s.seed == 123456789012345678901234567890),
    ]:
        assert read(load_scenario("thesis", [setting]))
        assert read(load_scenario({}, [setting]))


def test_later_settings_win_and_the_original_stays() -> None:
    given = {"trials": 1}
    assert set_value(set_value(given, "trials", 2, "x"), "trials", 3, "x")["trials"] == 3
    assert given == {"trials": 1}
    assert load_scenario(load_scenario("pair"), ["trials=7", "trials=8"]).trials == 8


def test_all_mistakes_are_named_at_once_each_with_the_origin() -> None:
    with pytest.raises(ScenarioError) as caught:
        validate({"model": "particles", "seed": -1, "agents": {"count": 0}, "robots": []}, "here")
    lines = str(caught.value).splitlines()
    assert [line[:6] for line in lines] == ["here: "] * 3


@pytest.mark.parametrize(
    ("settings", "axes", "notes"),
    [
        (["robots.0.count=5"], [], "; with robots.0.count=5"),
        (["noise=off"], ["arena.width_cm=60,80"], "; with noise=off, sweep arena.width_cm=60,80"),
        (["trials=5", "seed=3", "name=mine", "figure.form=violins"], [], ""),
    ],
)
def test_a_description_is_followed_by_the_changes_that_may_have_made_it_untrue(settings, axes, notes: str) -> None:
    assert load_scenario("thesis", settings, axes).description == load_scenario("thesis").description + notes
    assert load_scenario("thesis", [*settings, "description=mine"], axes).description == "mine"
    assert load_scenario({}, settings, axes).description == ""


def test_scenarios_are_read_at_the_edge_alone() -> None:
    """By commands, the public functions that take what is read, and where a scenario names another one."""
    texts = [path.read_text() for path in Path(epuck_sim.__file__).parent.rglob("*.py")]
    trees = [ast.parse(text) for text in texts if "load_scenario(" in text]
    calls = [node.func for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)]
    assert sum(getattr(function, "id", "") == "load_scenario" for function in calls) <= 8


STILL = {"robots.0.parameters.speed_cm_s": 0}
NEEDED = {"clock_drift": {"rate": 1.1}, "clock_jitter": {"jitter": 0.1}, "camera_misses": {"missed": 0.5}}
ROBOTS = [
    *({"faults": [{"kind": kind, "count": 2, "per_hour": 3, **NEEDED.get(kind, {})}]} for kind in [*FAULTS][:-1]),
    {
        "robots": [{"count": 3, "controller": "constant"}, {"count": 3}],
        "stop": {"reference_robot": 3},
        "faults": [{"kind": "restart", "robots": [3, 5]}],
        "schedule": [{"at_s": 3, "displace": {"by_cycles": 0.5, "robots": [4]}}],
    },
    {
        "faults": [{"kind": "ring_dead", "scheduled": True}],
        "schedule": [
            {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": STILL, "begin": [0]},
            {"at_s": 3, "displace": {"by_cycles": "random"}, "end": [0]},
        ],
    },
    *({"name": name} for name in ("1e3", "08")),
]
RULES = [
    *({"kind": "nearest", "k": 19}, {"kind": "range", "radius_cm": 5}, {"kind": "all"}, {"kind": "random", "k": 19}),
    *({"kind": "cone_of_vision", "angle_deg": 360}, {"kind": "cone_of_emission", "angle_deg": 0.1, "radius_cm": 1e6}),
]
WHEN = {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": {"response.coupling": 1}}
AGENTS = [
    *({"neighbourhood": rule} for rule in RULES),
    {"schedule": [WHEN, {"at_s": 3, "displace": {"by_cycles": "random", "agents": [2]}}]},
    {"response": {"curve": "sine", "coupling": 1, "refractory": 0.499}},
    {"response": {"coupling": 5}},
    {"response": {"curve": "mirollo_strogatz", "parameters": {"dissipation": 100}}},
    {"response": {"curve": "piecewise_linear", "coupling": 9, "parameters": {"knee": 1, "early_slope": -1000}}},
    {"start": {"phases": [0, 1], "positions_cm": [[0, 100], [5.5, 0]]}, "agents": {"count": 2}},
    {"start": {"headings": [[-1]]}, "agents": {"count": 1}, "space": {"dimensions": 1, "boundary": "mirrored"}},
    {"agents": {"speed_cm_s": 1e5, "reorient_on": ["receiving", "emitting"]}},
    {"agents": {"speed_cm_s": 0, "reorient_on": ["arriving"]}},
    {"agents": {"speed_distribution": "uniform", "speed_spread": 1}},
    {"agents": {"speed_distribution": "lognormal", "speed_spread": 2}},
    {"agents": {"speed_distribution": "two_speeds", "fast_share": 0.1, "fast_ratio": 10}},
    {"agents": {"walk": {"kind": "brownian", "run_s": 0.001}}},
    {"agents": {"walk": {"kind": "correlated", "run_s": 1e6, "persistence": 1}}},
    {"agents": {"walk": {"kind": "levy", "run_s": 1, "exponent": 1.0001}}},
    {"start": {"phases": "synchronised", "displacement": 0.999}},
    {"stop": {"order_parameter": 1}, "clocks": {"jitter": 0.2, "period_s": 1e-3}},
]


@pytest.mark.parametrize("sections", [*ROBOTS, *({"model": "particles", **each} for each in AGENTS)], ids=str)
def test_what_is_just_allowed_is_read_simulated_written_and_read_again(sections) -> None:
    scenario = load_scenario(sections)
    (ParticleSimulation if scenario.model == "particles" else Simulation)(scenario, 1)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_changes_are_checked_at_each_point_of_a_sweep() -> None:
    sweep = load_scenario({"faults": [{"kind": "ring_dead", "share": 0.1}]}, axes=["faults.0.share=0.1,0.5"])
    assert [point.scenario.faults[0].share for point in points(sweep)] == [0.1, 0.5]
    rules = [{"kind": "nearest", "k": 2}, {"kind": "all"}]
    given = {"model": "particles", "schedule": [{"at_s": 1, "set": {"neighbourhood.k": 4}}]}
    with pytest.raises(ScenarioError, match=r"point 1 .*schedule\.0\.set: neighbourhood\.k: unknown 'k'"):
        points(load_scenario({**given, "sweep": {"grid": {"neighbourhood": rules}}}))


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just("9" * 5000)
JUNK = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=2),
    max_leaves=6,
)
FIELDS = [*EmbodiedScenario.model_fields.items(), *ParticleScenario.model_fields.items()]
SECTIONS, DEFAULTS = sorted({*dict(FIELDS)} - {"model"}), [field.default for _, field in FIELDS]
KEYS = sorted({key for default in DEFAULTS for key in getattr(type(default), "model_fields", ())})
OF_PYDANTIC = ["input", "Input", "valid ", "should", "Field", "dictionary", "tuple", "another kind", "instance", "<"]


@settings(max_examples=40)
@given(
    model=st.sampled_from(["embodied", "particles"]),
    section=st.sampled_from([*SECTIONS, "other"]),
    value=JUNK | st.dictionaries(st.sampled_from(KEYS), JUNK, min_size=1, max_size=3),
)
def test_junk_is_read_or_refused_in_words_that_are_not_the_library_s(model: str, section: str, value) -> None:
    with suppress(ScenarioError):
        assert isinstance(load_scenario({"model": model, section: value}), Scenario)
    try:
        validate({"model": model, section: value}, "x")
    except ScenarioError as error:
        if section not in ("name", "description"):
            for line in str(error).splitlines():
                allowed = line.rpartition("; allowed: ")[2] if "; allowed: " in line else ""
                assert not any(word in allowed for word in OF_PYDANTIC), line


def test_a_scenario_is_shown_on_one_line() -> None:
    scenario = load_scenario("fig-4-2a")
    short = "EmbodiedScenario(name='fig-4-2a', model='embodied', population=10, points=100)"
    assert repr(scenario) == str(scenario) == short
    assert repr(load_scenario("particles")) == "ParticleScenario(name='particles', model='particles', population=20)"


def test_what_a_user_has_changed_in_a_copy_is_completed_and_checked_when_it_is_simulated() -> None:
    loaded = load_scenario("thesis")
    copy = loaded.model_copy(update={"robots": (RobotGroup(count=2, controller="oscillator"),)})
    expected = load_scenario({"robots": [{"count": 2, "controller": "oscillator"}]}).robots
    assert Simulation(copy, seed=0).scenario.robots == expected
    for group, said in (
        (RobotGroup(controller="fierfly"), r"thesis: robots\.0\.controller: unknown 'fierfly'"),
        (RobotGroup(parameters={"period_s": 0.01}), r"thesis: robots\.0\.parameters: period_s is 0.01"),
    ):
        with pytest.raises(ScenarioError, match=said):
            Simulation(loaded.model_copy(update={"robots": (group,)}))


def test_a_loaded_scenario_is_completed_without_a_look_into_folders(monkeypatch) -> None:
    thesis, agents = load_scenario("thesis"), load_scenario("particles")
    monkeypatch.setattr(Path, "glob", None)
    assert load_scenario(thesis) == thesis
    monkeypatch.setattr(robots, "find_controller", None)
    assert load_scenario(agents) is agents


def test_a_simulation_needs_its_model_and_one_point_of_a_sweep() -> None:
    swept = {"sweep": {"grid": {"trial_timeout_s": [1, 2]}}}
    for kind, model, other in ((ParticleSimulation, "particles", {}), (Simulation, "embodied", {"model": "particles"})):
        with pytest.raises(ScenarioError, match=r"is a sweep; simulate one of its points"):
            kind({"model": model, **swept})
        with pytest.raises(ScenarioError, match=f"needs model: {model}"):
            kind(other)


TINY = """
name: tiny
model: particles
agents: {count: 5, speed_cm_s: 30}
stop: {max_cycles: 40}
trials: 3
sweep: {grid: {agents.speed_cm_s: [3, 30, 90]}}
quick:
  trials: 2
  stop: {max_cycles: 20}
  sweep: {grid: {agents.speed_cm_s: [3, 90]}}
"""
FULL = {"trials": 100, "stop": {"max_cycles": 1000}, "sweep": {"grid": {"a": [1, 2, 3], "b": [4, 5]}}}


def test_sections_are_merged_key_by_key_and_everything_else_is_replaced() -> None:
    for quick, changed in [
        ({}, {}),
        ({"trials": 5}, {"trials": 5}),
        ({"stop": {"order_parameter": None}}, {"stop": {"max_cycles": 1000, "order_parameter": None}}),
        ({"sweep": {"grid": {"a": [1]}}}, {"sweep": {"grid": {"a": [1], "b": [4, 5]}}}),
        ({"sweep": {"zip": {"c": [1]}}}, {"sweep": {"grid": {"a": [1, 2, 3], "b": [4, 5]}, "zip": {"c": [1]}}}),
        ({"stop": None}, {"stop": None}),
        ({"trials": {"x": 1}}, {"trials": {"x": 1}}),
        ({"figure": {"form": "map"}}, {"figure": {"form": "map"}}),
    ]:
        given = {**FULL, "quick": quick}
        assert quick_version(given, "here") == {**FULL, **changed}
        assert given == {**FULL, "quick": quick}
        assert without_quick(given) == FULL


def test_settings_and_axes_count_beside_the_quick_version_which_is_forgotten_then() -> None:
    given = {"model": "particles", "trials": 9, "quick": {"trials": 2, "stop": {"max_cycles": 5}}}
    assert load_scenario(given) == load_scenario({"model": "particles", "trials": 9})
    scenario = load_scenario(given, ["trials=4"], ["agents.count=3,4"], quick=True)
    assert (scenario.trials, scenario.stop.max_cycles) == (4, 5)
    assert scenario.sweep.rows() == [{"agents.count": 3}, {"agents.count": 4}]


def test_run_runs_the_quick_version_and_its_folder_holds_that_alone(tmp_path) -> None:
    tiny, folder = tmp_path / "tiny.yaml", tmp_path / "run"
    tiny.write_text(TINY)
    quick = load_scenario(tiny, quick=True)
    one = call("run", tiny, "--quick", "--point", 1, "--trial", 1, "--json")
    assert f'"seed": {points(quick)[1].seed(1)},' in one.stdout
    result = call("run", tiny, "--quick", "--out", folder, "--workers", 1)
    assert result.exit_code == 0, result.stderr
    assert "tiny: 2 points, 4 of 4 trials have a result" in result.stdout
    assert (folder / "scenario.yaml").read_text() == write_scenario(quick)
    assert load_scenario(folder) == quick
    assert "stop.max_cycles: 20 in the folder, 40 now" in call("run", tiny, "--out", folder).stderr


def test_plain_words_and_numbers_mean_what_they_look_like_and_aliases_and_merge_keys_work() -> None:
    text = "[1e-3, 1E3, .5, -2., 12, 010, +3, true, False, no, off, 12:30, 0x10, null, ~, a, [2.5], {b: 1}]"
    values = [0.001, 1000.0, 0.5, -2.0, 12, 10, 3, True, False, "no", "off", "12:30", "0x10", None, None, "a"]
    assert repr(parse_yaml(text, "here")) == repr([*values, [2.5], {"b": 1}])
    assert parse_yaml("", "here") is None
    text = "base: &base {x: 1, y: 2}\nother: {<<: *base, y: 3}"
    assert parse_yaml(text, "here")["other"] == {"x": 1, "y": 3}


def test_files_that_cannot_be_read_are_named(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="cannot be read: Is a directory"):
        read_yaml(tmp_path)
    path = tmp_path / "odd.yaml"
    path.write_bytes(b"name: caf\xe9")
    with pytest.raises(ScenarioError, match="is not UTF-8 text"):
        read_yaml(path)
    os.truncate(path, 100 * MAX_BYTES)
    with pytest.raises(ScenarioError, match="larger than 1 MB"):
        read_yaml(path)
