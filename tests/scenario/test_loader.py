"""Scenarios: what is read and written and read again, quick versions, all that is shipped, and how YAML is read."""

import ast
import os
import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import epuck_sim
from epuck_sim import EmbodiedScenario, ParticleScenario, Scenario, ScenarioError, Simulation, points
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario import robots
from epuck_sim.scenario.axes import check_figure_axes
from epuck_sim.scenario.changes import FAULTS
from epuck_sim.scenario.keys import quick_version, set_value, without_quick
from epuck_sim.scenario.loader import SCENARIO, complete, load_scenario, validate, write_scenario
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.yaml_io import MAX_BYTES, parse_yaml, read_yaml, write_yaml
from tests.cli.commands import call
from tests.control.bench import with_step

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


def test_what_is_left_out_is_that_of_the_base_cases_of_chapters_4_and_5() -> None:
    for sections, *shipped in (({}, "thesis"), ({"model": "particles"}, "particles", ["speed_cm_s=1"])):
        scenario = load_scenario(sections)
        assert scenario == load_scenario(*shipped).model_copy(update={"description": ""})
        assert scenario.stop.metric == "complex"


def test_a_file_is_read_with_what_lies_beside_it_and_numpy_s_numbers_and_paths_as_in_a_file(tmp_path) -> None:
    (tmp_path / "mine.py").write_text(with_step("pass", PARAMETERS="{'pace': 2.0}"))
    (tmp_path / "scene.yaml").write_text("robots: [{controller: mine.py, count: 1}]")
    scenario = load_scenario(tmp_path / "scene.yaml")
    assert scenario == load_scenario(str(tmp_path / "scene.yaml"))
    group = scenario.robots[0]
    assert (scenario.name, group.controller, group.parameters) == ("scene", str(tmp_path / "mine.py"), {"pace": 2.0})
    path = tmp_path / "other.py"
    path.write_text(with_step("pass").replace("{}", "{'gain': 1.0}"))
    group = {"controller": path, "poses": np.array([[9.0, 9.0, 0.0]]), "parameters": {"gain": np.int64(2)}}
    grid = {"arena.width_cm": [*np.arange(60, 62)], "robots.0.parameters.gain": np.float32([2, 0.5])}
    found = points({"robots": [group], "sweep": {"grid": grid}})
    plain = {key: np.array(values).tolist() for key, values in grid.items()}
    group = {"controller": str(path), "poses": [[9.0, 9.0, 0.0]], "parameters": {"gain": 2.0}}
    assert repr(found) == repr(points({"robots": [group], "sweep": {"grid": plain}}))
    simulation = Simulation("thesis")
    simulation.set_parameters(speed_cm_s=np.int64(3))
    assert simulation.advance(1).wheels_cm_s.max() == 3


def test_set_changes_one_value_later_settings_win_and_the_original_stays() -> None:
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
    given = {"trials": 1}
    assert set_value(set_value(given, "trials", 2, "x"), "trials", 3, "x")["trials"] == 3
    assert given == {"trials": 1}
    assert load_scenario(load_scenario("pair"), ["trials=7", "trials=8"]).trials == 8


def test_keys_inside_what_is_a_word_left_out_or_a_path_can_be_set_and_swept(tmp_path) -> None:
    for name in ("mine", "other"):
        (tmp_path / f"{name}.py").write_text("def mine(simulation, offset=0.0):\n    return offset\n")
    listed = [{f"{tmp_path}/mine.py": {"offset": 1.0}}, {"coverage": {"as": "seen", "cells": 4}}]
    kilobots, of_group = ({"robots": [{"signal": {"kind": "radio"}, **kind}]} for kind in ({}, {"kind": "kilobot"}))
    coupling = "robots.0.parameters.coupling"
    later = [{"at_s": 5, "set": {coupling: 0.2}}]
    for sections, key, value, read in [
        ({"noise": "off"}, "noise.wheel_speed", 0.5, lambda s: s.noise.wheel_speed),
        ({"robot": "kilobot", **kilobots}, "robot.radius_cm", 1.7, lambda s: s.robot.radius_cm),
        (of_group, "robots.0.kind.radius_cm", 1.7, lambda s: s.group_kinds[0].radius_cm),
        ({"model": "particles"}, "k", 2, lambda s: s.neighbourhood.k),
        ({"measures": listed}, "measures.0.mine.offset", 3, lambda s: s.measures[0].parameters["offset"]),
        ({"measures": listed}, "measures.0.mine.py.offset", 3, lambda s: s.measures[0].parameters["offset"]),
        ({"measures": listed}, "measures.1.seen.cells", 2, lambda s: s.measures[1].parameters["cells"]),
        ({"measures": listed}, "offset", 3, lambda s: s.measures[0].parameters["offset"]),
        ({"measures": [f"{tmp_path}/other.py"]}, "mine.offset", 3, lambda s: s.measures[0].parameters["offset"]),
        ({"measures": [f"{tmp_path}/other.py"]}, "other.offset", 3, lambda s: s.measures[0].parameters["offset"]),
        ({"schedule": later}, f"schedule.0.set.{coupling}", 0.3, lambda s: s.schedule[0].set[coupling]),
        ({"measures": ["coverage"]}, "coverage.cells", 2, lambda s: s.measures[0].parameters["cells"]),
    ]:
        assert read(load_scenario(sections, [f"{key}={value}"])) == value
        assert read(points(load_scenario(sections, axes=[f"{key}={value}"]))[0].scenario) == value
    kept = load_scenario({"noise": "off"}, ["noise.wheel_speed=0.5"]), load_scenario({"robot": "kilobot", **kilobots})
    labelled = load_scenario("thesis", ["figure.labels.robots.0.count=N"], ["count=2,3"])
    assert labelled.figure.labels == {"robots.0.count": "N"}
    assert (kept[0].noise.infrared_counts, kept[1].robot.kind) == (0, "kilobot")


def test_a_description_is_followed_by_the_changes_that_may_have_made_it_untrue() -> None:
    for changes, axes, notes in (
        (["robots.0.count=5"], [], "; with robots.0.count=5"),
        (["noise=off"], ["arena.width_cm=60,80"], "; with noise=off, sweep arena.width_cm=60,80"),
        (["trials=5", "seed=3", "name=mine", "figure.form=violins"], [], ""),
    ):
        assert load_scenario("thesis", changes, axes).description == load_scenario("thesis").description + notes
        assert load_scenario("thesis", [*changes, "description=mine"], axes).description == "mine"
        assert load_scenario({}, changes, axes).description == ""


def test_scenarios_are_read_at_the_edge_alone() -> None:
    """By commands, the public functions that take what is read, and where a scenario names another one."""
    texts = [path.read_text() for path in Path(epuck_sim.__file__).parent.rglob("*.py")]
    trees = [ast.parse(text) for text in texts if "load_scenario(" in text]
    calls = [node.func for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)]
    assert sum(getattr(function, "id", "") == "load_scenario" for function in calls) <= 8


NEEDED = {"clock_drift": {"rate": 1.1}, "clock_jitter": {"jitter": 0.1}, "camera_misses": {"missed": 0.5}}
WHEN = {"when": "order_parameter >= 0.9", "for_cycles": 3}
ROBOTS = [
    *(
        {"faults": [{"kind": kind, "count": 2, "per_hour": 3, **NEEDED.get(kind, {})}]}
        for kind in FAULTS
        if kind != "sensor_dead"
    ),
    {
        "robots": [{"count": 3, "controller": "constant"}, {"count": 3}],
        "stop": {"reference_robot": 3},
        "faults": [{"kind": "restart", "robots": [3, 5]}],
        "schedule": [{"at_s": 3, "displace": {"by_cycles": 0.5, "robots": [4]}}],
    },
    {
        "faults": [{"kind": "ring_dead", "scheduled": True}],
        "schedule": [
            {**WHEN, "set": {"robots.0.parameters.speed_cm_s": 0}, "begin": [0]},
            {"at_s": 3, "displace": {"by_cycles": "random"}, "end": [0]},
        ],
    },
    *({"name": name} for name in ("1e3", "08")),
]
RULES = [
    *({"kind": "nearest", "k": 19}, {"kind": "range", "radius_cm": 5}, {"kind": "all"}, {"kind": "random", "k": 19}),
    *({"kind": "cone_of_vision", "angle_deg": 360}, {"kind": "cone_of_emission", "angle_deg": 0.1, "radius_cm": 1e6}),
]
AGENTS = [
    *({"neighbourhood": rule} for rule in RULES),
    {
        "schedule": [
            {**WHEN, "set": {"response.coupling": 1}},
            {"at_s": 3, "displace": {"by_cycles": "random", "agents": [2]}},
        ]
    },
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


def test_a_scenario_is_shown_on_one_line_and_a_simulation_needs_its_model_and_one_point_of_a_sweep() -> None:
    scenario = load_scenario("fig-4-2a")
    short = "EmbodiedScenario(name='fig-4-2a', model='embodied', population=10, points=100)"
    assert repr(scenario) == str(scenario) == short
    assert repr(load_scenario("particles")) == "ParticleScenario(name='particles', model='particles', population=20)"
    swept = {"sweep": {"grid": {"stop.max_cycles": [1, 2]}}}
    for kind, model, other in ((ParticleSimulation, "particles", {}), (Simulation, "embodied", {"model": "particles"})):
        with pytest.raises(ScenarioError, match=r"is a sweep; simulate one of its points"):
            kind({"model": model, **swept})
        with pytest.raises(ScenarioError, match=f"needs model: {model}"):
            kind(other)


def test_a_loaded_scenario_is_completed_without_a_look_into_folders_and_a_changed_copy_checked(monkeypatch) -> None:
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
    wide = loaded.model_copy(update={"arena": {"width_cm": 80}})
    assert {each.scenario.arena.width_cm for each in (Simulation(wide), *points(wide))} == {80}
    with pytest.raises(ScenarioError, match="thesis: seeds: unknown 'seeds', did you mean 'seed'"):
        Simulation(loaded.model_copy(update={"seeds": 3}))
    agents = load_scenario("particles")
    monkeypatch.setattr(Path, "glob", None)
    assert load_scenario(loaded) == loaded
    monkeypatch.setattr(robots, "find_controller", None)
    assert load_scenario(agents) is agents


FULL = {"trials": 100, "stop": {"max_cycles": 1000}, "sweep": {"grid": {"a": [1, 2, 3], "b": [4, 5]}}}


def test_quick_versions_are_merged_key_by_key_and_forgotten_once_settings_and_axes_count_beside_them() -> None:
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
    given = {"model": "particles", "trials": 9, "quick": {"trials": 2, "stop": {"max_cycles": 5}}}
    assert load_scenario(given) == load_scenario({"model": "particles", "trials": 9})
    scenario = load_scenario(given, ["trials=4"], ["agents.count=3,4"], quick=True)
    assert (scenario.trials, scenario.stop.max_cycles) == (4, 5)
    assert scenario.sweep.rows() == [{"agents.count": 3}, {"agents.count": 4}]


def test_run_runs_the_quick_version_and_its_folder_holds_that_alone(tmp_path) -> None:
    tiny, folder = tmp_path / "tiny.yaml", tmp_path / "run"
    few = {"trials": 2, "stop": {"max_cycles": 20}, "sweep": {"grid": {"agents.speed_cm_s": [3, 90]}}}
    full = {"trials": 3, "stop": {"max_cycles": 40}, "sweep": {"grid": {"agents.speed_cm_s": [3, 30, 90]}}}
    tiny.write_text(write_yaml({"model": "particles", "agents": {"count": 5}, **full, "quick": few}))
    quick = load_scenario(tiny, quick=True)
    one = call("run", tiny, "--quick", "--point", 1, "--trial", 1, "--json")
    assert f'"seed": {points(quick)[1].seed(1)},' in one.stdout
    result = call("run", tiny, "--quick", "--out", folder, "--workers", 1)
    assert result.exit_code == 0, result.stderr
    assert "tiny: 2 points, 4 of 4 trials have a result" in result.stdout
    assert (folder / "scenario.yaml").read_text() == write_scenario(quick)
    assert load_scenario(folder) == quick
    assert "stop.max_cycles: 20 in the folder, 40 now" in call("run", tiny, "--out", folder).stderr


def test_plain_words_and_numbers_mean_what_they_look_like_and_files_that_cannot_be_read_are_named(tmp_path) -> None:
    text = "[1e-3, 1E3, .5, -2., 12, 010, +3, true, False, no, off, 12:30, 0x10, null, ~, a, [2.5], {b: 1}]"
    values = [0.001, 1000.0, 0.5, -2.0, 12, 10, 3, True, False, "no", "off", "12:30", "0x10", None, None, "a"]
    assert repr(parse_yaml(text, "here")) == repr([*values, [2.5], {"b": 1}])
    assert parse_yaml("", "here") is None
    text = "base: &base {x: 1, y: 2}\nother: {<<: *base, y: 3}"
    assert parse_yaml(text, "here")["other"] == {"x": 1, "y": 3}
    path = tmp_path / "odd.yaml"
    path.touch()
    os.truncate(path, 100 * MAX_BYTES)
    with pytest.raises(ScenarioError, match="larger than 1 MB"):
        read_yaml(path)


HAS_QUICK = {name: "quick" in read_yaml(path) for name, path in SCENARIO.shipped().items()}


def flat(value, prefix="") -> list[str]:
    """Return the dotted keys of nested mappings and of sections in lists."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    parts = [(f"{prefix}{name}", each) for name, each in items if isinstance(value, dict) or isinstance(each, dict)]
    return [key for name, each in parts for key in (name, *flat(each, f"{name}."))]


def versions():
    for name, has_quick in HAS_QUICK.items():
        for quick in [False, True][: 1 + has_quick]:
            sweep = load_scenario(name, quick=quick).sweep
            is_long = sweep is not None and sweep.point_count > 60  # which the slow tests alone look at
            yield pytest.param(name, quick, id=f"{name}-quick" if quick else name, marks=[pytest.mark.slow] * is_long)


@pytest.mark.parametrize(("name", "quick"), [*versions()])
def test_a_shipped_scenario_is_checked_written_and_read_again_and_its_figure_is_of_its_axes(name, quick) -> None:
    scenario = load_scenario(name, quick=quick)
    printed = call("check", name, *["--quick"] * quick)
    assert printed.exit_code == 0
    assert printed.stderr in ("", f"checking {name} takes a while; Ctrl-C ends it\n")  # on a busy machine
    assert printed.stdout.startswith(write_scenario(scenario))
    written = parse_yaml(printed.stdout, "stdout")
    assert load_scenario(written) == complete(scenario, name) == scenario  # and so are its points
    found = points(scenario)
    assert len(found) == (scenario.sweep.point_count if scenario.sweep else 1)
    keys = set(scenario.all_keys(written))
    assert {key for key in flat(written) if not re.match(r"sweep|measures|\w+\.\d+\.(poses|set)\.", key)} <= keys
    for point in found:
        assert (point.scenario.sweep, point.scenario.name) == (None, scenario.name)
        assert set(point.axes) == set(scenario.sweep.keys if scenario.sweep else ())
    if scenario.sweep is None:
        return
    figure, axes = scenario.figure, scenario.sweep.keys
    named = [key for key in (figure.x, figure.y, figure.panels) if key is not None]
    assert set(named) <= set(axes)
    assert len(set(named)) == len(named)
    check_figure_axes(figure, [point.axes for point in found])
    assert (figure.y is not None) <= (figure.form == "map")
    assert (figure.panels is not None) <= (figure.form == "curves")
    assert (figure.censored_at_cycles is not None) <= (figure.form == "violins")
    if figure.form in ("perturbation", "course"):
        assert isinstance(scenario, ParticleScenario)
        assert (scenario.start.phases, scenario.stop.order_parameter) == ("synchronised", None)


def test_sweeps_of_particles_have_a_quick_version_and_each_is_less_of_the_same_figure_with_the_same_trials() -> None:
    shipped = map(load_scenario, HAS_QUICK)
    sweeps = [each.name for each in shipped if each.sweep and each.model == "particles"]
    assert len(sweeps) >= 15
    assert [name for name in sweeps if not HAS_QUICK[name]] == []
    for name in (name for name, has_quick in HAS_QUICK.items() if has_quick):
        full, quick = load_scenario(name), load_scenario(name, quick=True)
        assert full != quick
        assert (quick.name, quick.description, quick.seed) == (full.name, full.description, full.seed)
        assert quick.sweep.keys == full.sweep.keys, name
        assert quick.sweep.point_count <= full.sweep.point_count, name
        assert (quick.trials, quick.stop.max_cycles) <= (full.trials, full.stop.max_cycles), name
        assert quick.figure.model_copy(update={"censored_at_cycles": full.figure.censored_at_cycles}) == full.figure
        alone = [each.model_copy(update={"sweep": None}).model_dump() for each in (full, quick)]
        changed = {part for part in alone[0] if alone[0][part] != alone[1][part]}
        assert changed <= {"stop", "trials", "figure", "agents"}, name
